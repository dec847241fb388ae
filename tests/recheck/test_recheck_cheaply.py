"""Bounds of a machine that recheck proves in few boxes by the form that the producer used, and nothing below them."""

from __future__ import annotations

import copy
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import arb
from rechecked import certified, examine, failing, sealed, terms
from systems import SMALL
from tubecert.recheck.relative import drift_difference, drift_difference_metric
from tubecert.recheck.turning import feedback_curvature

from tubecert.errors import TubecertError
from tubecert.recheck import constants, relative
from tubecert.recheck.curve import CLOCK, Curve, Part, expressed
from tubecert.recheck.place import Place
from tubecert.recheck.specified.plant import Uncertainty
from tubecert.recheck.system import System
from tubecert.recheck.terms import number, replaced, variable

# f_x = [[y, x], [x, -y]] - diag(1, 2): for W = I, T_v = 2 [[v_y, v_x], [v_x, -v_y]], |T_v| = 2 |v|
F = ["-x + x*y", "-2*y + (x**2 - y**2)/2"]


def place(W: list[list[str]], budget: int = 400) -> Place:
    states = ("x", "y")
    system = System(
        states=states,
        inputs=("u",),
        f=[[e] for e in terms(F, list(states))],
        B=[terms([row], list(states)) for row in ("0", "1")],
        W=[terms(row, list(states)) for row in W],
        rate=Fraction(1, 2),
        uncertainty=Uncertainty(h=None, declared={}, duties=()),
        safe_set={name: (Fraction(-2), Fraction(2)) for name in states},
        x0=None,
        within=None,
        box=None,
        A_m=None,
        smooth=None,
        kernel="tight",
        horizon=None,
        duties=(),
    )
    resting = expressed([number(Fraction(0))] * 2, [number(Fraction(0))], "t", None)
    return Place(system, resting, Fraction(1, 2), budget)


UNIT = [["1", "0"], ["0", "1"]]
OBLIQUE = [["1", "-0.3"], ["-0.3", "2"]]


def stacked(W: np.ndarray) -> float:
    """The root of the largest eigenvalue of sum_i T_i M T_i by W, in floats."""
    slopes = [np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([[1.0, 0.0], [0.0, -1.0]])]
    L = np.linalg.inv(np.linalg.cholesky(W))
    turned = [L @ (A @ W + W @ A.T) @ L.T for A in slopes]
    return float(np.sqrt(np.linalg.eigvalsh(sum(T @ T for T in turned)).max()))


@pytest.mark.parametrize("W", [UNIT, OBLIQUE], ids=["unit", "oblique"])
def test_all_directions_at_once_need_one_box(W):
    bound = stacked(np.array(W, dtype=float))
    above = feedback_curvature(place(W), Fraction(bound * 1.0001))
    assert (above.verdict, above.boxes) == ("confirmed", 1)


def test_less_than_the_curvature_is_never_confirmed():
    """2 is attained; between it and sqrt(8) directions are examined one by one."""
    assert stacked(np.eye(2)) == pytest.approx(np.sqrt(8))
    assert feedback_curvature(place(UNIT, 4_000), Fraction(2) * Fraction(101, 100)).holds
    assert feedback_curvature(place(UNIT), Fraction(2) * Fraction(999, 1000)).verdict == "contradicted"


@pytest.mark.parametrize("direct", [True, False])
def test_a_difference_is_at_most_the_mean_value_and_the_direct_form_serves_below_it(direct, monkeypatch):
    """|f(z) - f(0)| over |z| <= 1/2 attains less than rho sup|f_x|: the direct form proves what lies between."""
    angle = np.linspace(0, 2 * np.pi, 721)
    x, y = 0.5 * np.cos(angle), 0.5 * np.sin(angle)
    largest = float(np.hypot(-x + x * y, -2 * y + (x**2 - y**2) / 2).max())
    slopes = [np.linalg.norm([[-1 + q, p], [p, -2 - q]], 2) / 2 for p, q in zip(x, y, strict=True)]
    assert largest < 0.96 * max(slopes)
    if not direct:
        monkeypatch.setattr(relative, "_difference", lambda *_: pytest.fail("the mean value serves"))
    limit = Fraction(largest * 1.02 if direct else max(slopes) * 1.001)
    upper = {"upper": Fraction(1)}.get
    outcomes = [
        drift_difference(place(UNIT, 4_000), limit),
        drift_difference_metric(place(UNIT, 4_000), limit, upper),
    ]
    assert all(found.holds for found in outcomes)
    if direct:
        less = Fraction(largest * 0.99)
        assert drift_difference(place(UNIT), less).verdict == "contradicted"
        assert drift_difference_metric(place(UNIT), less, upper).verdict == "contradicted"


TWO_INPUTS = (
    SMALL.replace("states: [x, y]", "states: [x, y, z]")
    .replace("inputs: [u]", "inputs: [u, v]")
    .replace('"-y + 0.3*sin(x)"]', '"-y + 0.3*sin(x)", "-2*z"]')
    .replace("B: [[0], [1]]", "B: [[0, 0], [1, 0], [0, 1]]")
    .replace("y: [-1, 1]}", "y: [-1, 1], z: [-1, 1]}")
    .replace('["0.1*sin(t) + 0.05*x"]', '["0.1*sin(t)", "0.02*sin(t)"]')
    .replace("at: [0, 0], input: [0]", "at: [0, 0, 0], input: [0, 0]")
    .replace("at: [0.05, 0]", "at: [0.05, 0, 0]")
    .replace('[[1, "-0.3"], ["-0.3", 2]]', '[[1, "-0.3", 0], ["-0.3", 2, 0], [0, 0, 1]]')
    + "hardware: {rate: 500}\nlimits: {u: [-5, 5], v: [-5, 5]}\n"
)


@pytest.mark.slow
def test_every_input_has_the_clip_of_its_own():
    """h of two sizes: what adaptation adds to one input says nothing of the other."""
    made = certified(TWO_INPUTS, conditions="hardware")
    u, v = (own["bounds"]["hardware"] for own in made["result"]["inputs"])
    assert v["adaptation"] < 0.3 * u["adaptation"]
    memory: dict[object, object] = {}
    assert not failing(examine(made, memory=memory))
    for i, most in ((0, v["adaptation"]), (1, 0.99 * v["adaptation"])):
        forged = copy.deepcopy(made)
        forged["result"]["inputs"][i]["bounds"]["hardware"]["adaptation"] = most
        try:
            names = [name for name, _ in failing(examine(sealed(forged), memory=memory))]
        except TubecertError:
            pytest.fail("it is of the form")
        assert "hardware: what is added to u*" in names


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
    parts = tuple(Part(arb(i), arb(1), own) for i, own in enumerate(values))
    moving = Curve((clock * slope, number(0)), (clock * slope,), parts, Fraction(2), (number(0), number(0)))
    angle, s = np.meshgrid(np.linspace(0, 2 * np.pi, 721), np.linspace(0, 1, 101))
    largest = 0.0
    for radius in np.linspace(0, 0.5, 51):
        x, y = s + radius * np.cos(angle), radius * np.sin(angle)
        length = np.hypot(-x + x * y, -2 * y + (x**2 - y**2) / 2 + s)
        largest = max(largest, float(length.max()))
    where = replace(place(UNIT, 300), curve=moving)
    assert constants.bounded(where, "drift_on_plan", Fraction(largest * share), None).holds == holds
