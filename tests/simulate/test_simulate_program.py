"""Compiled programs against mpmath: every function of the language has its own step."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from tubecert.expression import Lookup, derivative, norm, parse, symbol
from tubecert.expression.scan import SMOOTH
from tubecert.simulate.compiled import entry
from tubecert.simulate.program import assemble, execute

POINTS = (0.03, 0.4, 0.97)


@entry
def run(steps, count, memory):
    """Python cannot call a kernel that other kernels call."""
    execute(steps, count, memory)


@pytest.mark.parametrize("name", SMOOTH)
def test_every_function_is_its_own(name):
    e = parse(f"{name}(x) + 2*y", symbols={"x": symbol("x"), "y": symbol("y")}).expression
    program, memory = assemble([e, norm([e])], ["x", "y"])
    for x in POINTS:
        memory[:2] = x, -1.0
        run(program.steps, len(program.steps), memory)
        exact = float(getattr(mpmath, name)(mpmath.mpf(x)) - 2)
        assert memory[program.outputs[0]] == pytest.approx(exact, rel=1e-14)
        assert memory[program.outputs[1]] == pytest.approx(abs(exact), rel=1e-14)
    assert np.isfinite(memory).all()


def test_tables_are_looked_up():
    """Between knots, at them and at both ends; beyond nothing is known. The memory of two tables is not mixed up."""
    knots, values, slopes = (-1, 0, 2), (3, 1, 2), (0, -1, 5)
    one = Lookup("one", *(tuple(map(Fraction, row)) for row in (knots, values, slopes)))
    two = Lookup("two", *(tuple(map(Fraction, row)) for row in (knots, slopes, values)))
    e = parse("one(x) + 10*two(x)", symbols={"x": symbol("x")}, tables={"one": one, "two": two}).expression
    program, memory = assemble([e, derivative(e, "x")], ["x"])
    theirs = [CubicHermiteSpline(knots, *rows) for rows in ((values, slopes), (slopes, values))]
    for x in (-1, -0.7, 0, 1e-9, 0.3, 1.9, 2):
        memory[0] = x
        run(program.steps, len(program.steps), memory)
        for order, place in enumerate(program.outputs):
            exact = theirs[0](x, order) + 10 * theirs[1](x, order)
            assert memory[place] == pytest.approx(float(exact), rel=1e-12, abs=1e-12)
    memory[0] = 2.1
    run(program.steps, len(program.steps), memory)
    assert np.isnan(memory[program.outputs]).all()
