"""Compiled programs against mpmath: every function of the language has its own step."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from tubecert.expression import norm, parse, symbol
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
