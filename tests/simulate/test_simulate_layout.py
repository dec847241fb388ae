"""Where things are in the compiled lanes: blocks of y, terms of the loops, and what is known of the state."""

from __future__ import annotations

import ast
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import tubecert
from tubecert.expression import as_expression, sin, symbol
from tubecert.model import ControlAffineModel
from tubecert.simulate.compiled import entry
from tubecert.simulate.fast import _rate, generator
from tubecert.simulate.grid import fast_part
from tubecert.simulate.layout import blocks, layout, slices
from tubecert.simulate.loops import CONTROLLERS, DESIGNS
from tubecert.simulate.problem import LoopGains, LoopProblem
from tubecert.spec.simulation import CONTROLLERS as NAMES
from tubecert.trajectory import constant_plan

ROOM = Path(tubecert.__file__).parent / "simulate"
X, Y, T = symbol("x1"), symbol("x2"), symbol("t")


def exact(rows):
    return tuple(tuple(as_expression(Fraction(entry)) for entry in row) for row in rows)


TWO = ControlAffineModel(
    states=("x1", "x2"),
    inputs=("u1", "u2"),
    f=(-X + Y, sin(X) - Y),
    B=exact([["1", "1/2"], ["-1/4", "2"]]),
    W=exact([["1", "-1/2"], ["-1/2", "1"]]),
    rate=Fraction(1, 2),
    h=None,
)
GAINS = LoopGains(bandwidth=7.0, projection_radius=100.0, predictor_gain=3.0, adaptation_rate=11.0)


def problem(controller, **options):
    return LoopProblem(
        model=TWO,
        plan=constant_plan([0, 0], [0, 0], None),
        controller=controller,
        horizon=1.0,
        times=np.linspace(0, 1, 5),
        gains=GAINS,
        **options,
    )


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (3, 2), (6, 4)])
def test_blocks_cover_y_once_and_in_order(n, m):
    at = layout(n, m)
    y = np.arange(at.size)
    parts = blocks.py_func(y, at)
    assert np.array_equal(np.concatenate(parts), y)
    assert [len(part) for part in parts] == [n, m, m, n]
    assert parts._fields == ("xtilde", "sigma_hat", "u_a", "v")
    assert all(np.array_equal(y[where], part) for where, part in zip(slices(at), parts, strict=True))
    parts.u_a[:] = -1
    assert (y == -1).sum() == m  # they are views


@entry
def rate(fast, y, h, B, dy):
    _rate(fast, False, y, h, B, dy)


@pytest.mark.slow
@pytest.mark.parametrize("controller", [name for name in CONTROLLERS if DESIGNS[name].terms.filters])
def test_both_forms_of_the_right_hand_sides_agree(controller):
    """The matrix of the exact flow and the rate that RK4 integrates, at random states."""
    rng = np.random.default_rng(2)
    fast = fast_part(problem(controller), np.array([0.1]), 0)
    B = np.array([[1.0, 0.5], [-0.25, 2.0]])
    L, E = generator(fast, B)
    y, h = rng.normal(size=fast.at.size), rng.normal(size=2)
    found = np.zeros_like(y)
    rate(fast, y, h, B, found)
    np.testing.assert_allclose(found, L @ y + E @ h, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("controller", [name for name in CONTROLLERS if DESIGNS[name].terms.filters])
def test_right_hand_sides_are_those_of_the_theory(controller):
    """(0.6) less (0.1), (0.7), (0.8), written out a second time."""
    rng = np.random.default_rng(3)
    B = np.array([[1.0, 0.5], [-0.25, 2.0]])
    xt, sigma, u_a, h = (rng.normal(size=2) for _ in range(4))
    y = np.concatenate([xt, sigma, u_a, np.zeros(2)])
    zero = np.zeros(2)
    expected = {
        "reference": [zero, zero, -7 * (u_a + h), B @ u_a],
        "l1": [-3 * xt + B @ (sigma - h), -11 * B.T @ xt, -7 * (u_a + sigma), B @ u_a],
    }[controller]
    fast = fast_part(problem(controller), np.array([0.1]), 0)
    found = np.zeros(fast.at.size)
    rate(fast, y, h, B, found)
    np.testing.assert_allclose(found, np.concatenate(expected), atol=1e-13)


def test_loops_are_named_alike_everywhere():
    assert NAMES == CONTROLLERS
    assert not DESIGNS["nominal"].disturbed
    assert all(DESIGNS[name].disturbed for name in CONTROLLERS if name != "nominal")
    assert all(hasattr(GAINS, need) for design in DESIGNS.values() for need in design.needs)


# the rules of the room


def test_entries_are_counted_in_one_place():
    counted = re.compile(r"\bn \+ m\b|\bm \+ n\b|\b[23] \* n\b|\bn \+ 2\b")
    for path in ROOM.glob("*.py"):
        if path.name != "layout.py":
            for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
                assert not counted.search(line.split("#")[0]), f"{path.name}:{number}: {line}"


def test_what_travels_together_is_passed_together():
    for path in ROOM.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef):
                count = len(node.args.posonlyargs + node.args.args + node.args.kwonlyargs)
                assert count <= 7, f"{path.name}: {node.name} takes {count} arguments"
