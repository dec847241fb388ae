"""Covariant constants in recheck: what the search finds is confirmed, what is less than they are is not."""

from __future__ import annotations

import copy
from fractions import Fraction

import pytest
from rechecked import CONFIGS, certified, examine, failing, sealed, terms
from systems import SMALL, matrix_of
from tubecert.bounds.covariant import CovariantSuprema
from tubecert.recheck.covariant import NAMES, bounded

from tubecert.bounds.constants import Constant
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import ExitCode, TubecertError
from tubecert.expression import parse, symbol
from tubecert.model import ControlAffineModel
from tubecert.recheck.curve import expressed
from tubecert.recheck.place import Place
from tubecert.recheck.specified.plant import Uncertainty
from tubecert.recheck.system import System
from tubecert.trajectory import Plan

# on a sphere, where B turns along the plan
F = ["0.3*x2 - x1", "-x2 + 0.1*sin(x1)"]
B = [["sin(x2)"], ["1 + tan(x1)*cos(x2)"]]
W = [["1", "0"], ["0", "1/cos(x1)**2"]]
CURVE, PLAYED = ["0.1*sin(t)", "0.3 + 0.1*cos(t)"], ["0.2*sin(2*t)"]
STATES = ("x1", "x2")
RHO, HORIZON = Fraction(1, 5), Fraction(1)


def place(budget: int = 4_000) -> Place:
    """The system as recheck has it."""
    system = System(
        states=STATES,
        inputs=("u",),
        f=[[e] for e in terms(F, list(STATES))],
        B=[terms(row, list(STATES)) for row in B],
        W=[terms(row, list(STATES)) for row in W],
        rate=Fraction(1, 2),
        uncertainty=Uncertainty(h=None, declared={}, duties=()),
        safe_set={},
        x0=None,
        within=None,
        box=None,
        A_m=None,
        smooth=None,
        kernel="tight",
        horizon=HORIZON,
        duties=(),
    )
    curve = expressed(terms(CURVE, ["t"]), terms(PLAYED, ["t"]), "t", HORIZON)
    return Place(system, curve, RHO, budget)


@pytest.fixture(scope="module")
def found():
    """The constants as the search finds them."""
    t = {"t": symbol("t")}
    x, u = (tuple(parse(e, symbols=t).expression for e in texts) for texts in (CURVE, PLAYED))
    model = ControlAffineModel(
        states=STATES,
        inputs=("u",),
        f=matrix_of([F], STATES)[0],
        B=matrix_of(B, STATES),
        W=matrix_of(W, STATES),
        rate=Fraction(1, 2),
        h=None,
    )
    s = CovariantSuprema(model, Plan(x, u, HORIZON), float(RHO), None, Effort())
    least, beta = s.metric_bounds()[0], s.metric_input_gain()
    return {
        "drift_slope": s.drift_slope(),
        "form_slope": s.form_slope(least),
        "input_slope": s.input_slope(least, beta),
        "input_gain": s.input_gain(),
        "drift_metric": s.drift_metric(least),
        "curvature": s.curvature(least),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_what_is_found_is_confirmed_and_what_is_less_is_not(found, name):
    constant: Constant = found[name]
    assert bounded(place(), name, Fraction(constant.above)).holds
    # two per cent below what is reached
    assert not bounded(place(400), name, Fraction(constant.below) * Fraction(98, 100)).holds
    assert constant.above <= constant.below * 1.03


def test_a_sphere_has_curvature_1():
    assert bounded(place(), "curvature", Fraction(1001, 1000)).holds
    assert not bounded(place(400), "curvature", Fraction(999, 1000)).holds


MOVING = (
    (CONFIGS / "state_dependent_input.yaml")
    .read_text("utf-8")
    .replace(
        "trajectory: {kind: equilibrium, at: [0, 0], input: [0]}",
        """trajectory:
  kind: expressions
  horizon: 1
  x: ["0.05*sin(t)", "0.05*(sin(t) + cos(t))"]
  u: ["(0.05*(cos(t) - sin(t)) - 0.025*sin(t) + 0.05*(sin(t) + cos(t)))/2"]
""",
    )
    .replace("initial_state: {at: [0.02, 0]}", "initial_state: {at: [0, 0.05]}")
)
MACHINE = "\nhardware: {rate: 1000, delay: 0.0002, noise: 0.0001}\n"


@pytest.fixture(scope="module")
def honest():
    document = certified(MOVING + MACHINE, conditions="hardware", gap=Fraction(1, 5))
    assert document["result"]["verdict"] == "certified", document["result"]["reasons"]
    return document, {}


@pytest.mark.slow
def test_a_certificate_of_a_plan_that_moves_is_confirmed(honest):
    document, memory = honest
    assert set(NAMES) <= document["result"]["constants"].keys()
    assert failing(examine(document, memory=memory)) == []


def refused(document, memory) -> bool:
    try:
        return examine(sealed(document), memory=memory, to_first_failure=True).exit_code != ExitCode.CERTIFIED
    except TubecertError:
        return True


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drift_slope", "form_slope", "input_gain"])
def test_no_constant_may_be_less_than_it_is(honest, name):
    document, memory = copy.deepcopy(honest[0]), honest[1]
    constant = document["result"]["constants"][name]
    constant |= {"above": constant["below"] * 0.98, "below": 0.0}
    assert refused(document, memory)


@pytest.mark.slow
def test_there_are_all_of_them_or_none(honest):
    document = copy.deepcopy(honest[0])
    del document["result"]["constants"]["curvature"]
    assert refused(document, honest[1])
    flat = certified(SMALL + MACHINE, conditions="hardware")
    assert not set(NAMES) & flat["result"]["constants"].keys()
    for name in NAMES:
        flat["result"]["constants"][name] = honest[0]["result"]["constants"][name]
    assert refused(flat, {})
