"""What recheck knows of plans without boxes: a start with roots exactly, a drift along knots part by part."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import arb
from rechecked import terms

from tubecert.recheck import constants
from tubecert.recheck.curve import CLOCK, Curve, Part, expressed
from tubecert.recheck.place import Place
from tubecert.recheck.specified.plant import Uncertainty
from tubecert.recheck.system import System
from tubecert.recheck.terms import number, replaced, variable

F = ["-x + x*y", "-2*y + (x**2 - y**2)/2"]


def place(budget: int) -> Place:
    states = ("x", "y")
    system = System(
        states=states,
        inputs=("u",),
        f=[[e] for e in terms(F, list(states))],
        B=[terms([row], list(states)) for row in ("0", "1")],
        W=[terms(row, list(states)) for row in ("10", "01")],
        rate=Fraction(1, 2),
        uncertainty=Uncertainty(h=None, declared={}, duties=()),
        safe_set={name: (Fraction(-2), Fraction(2)) for name in states},
        x0=None,
        within=None,
        box=None,
        predictor_gain=None,
        smooth=None,
        horizon=None,
        duties=(),
    )
    resting = expressed([number(Fraction(0))] * 2, [number(Fraction(0))], "t", None)
    return Place(system, resting, Fraction(1, 2), budget)


def test_a_start_on_a_plan_with_roots_is_on_it_exactly():
    """sqrt(1 + (c sin t)^2) is 1 at t = 0: no ball is so small that it would show it."""
    (slant,) = terms(["0.3*sqrt(1 + (0.1*sin(t))**2)"], ["t"])
    (start,) = replaced([slant], {"t": number(Fraction(0))})
    assert start is number(Fraction(3, 10))
    assert replaced([slant], {"t": number(Fraction(1))})[0] is not number(Fraction(3, 10))


@pytest.mark.parametrize("coarse", [0, 300])
@pytest.mark.parametrize(("share", "holds"), [(1.01, True), (0.99, False)])
def test_the_drift_along_knots_is_bounded_part_by_part(coarse, share, holds, monkeypatch):
    """|f(x*(t) + z) + B u*(t)| over |z| <= 1/2, x* = (s, 0) and u* = s in the second part, which decides."""
    monkeypatch.setattr(constants, "_SOME", coarse)
    clock, slope = variable(CLOCK), variable("slope")
    values = [{"slope": arb(0)}, {"slope": arb(1)}]
    parts = tuple(Part(Fraction(i), arb(1), own) for i, own in enumerate(values))
    moving = Curve((clock * slope, number(0)), (clock * slope,), parts, Fraction(2), (number(0), number(0)))
    angle, s = np.meshgrid(np.linspace(0, 2 * np.pi, 721), np.linspace(0, 1, 101))
    largest = 0.0
    for radius in np.linspace(0, 0.5, 51):
        x, y = s + radius * np.cos(angle), radius * np.sin(angle)
        length = np.hypot(-x + x * y, -2 * y + (x**2 - y**2) / 2 + s)
        largest = max(largest, float(length.max()))
    where = replace(place(300), curve=moving)
    assert constants.bounded(where, "drift_on_plan", Fraction(largest * share), None).holds == holds
