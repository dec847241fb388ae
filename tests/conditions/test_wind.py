"""Wind and unknown parameters in the formulas of 0 and B (theory 7): limits, closed forms, verdicts."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import (
    alive,
    judged_26,
    judged_distance,
    margin_distance,
    two_state,
)

from tubecert.bounds.constants import Constant, ResidualConstants, WindConstants
from tubecert.conditions import alone, distance
from tubecert.conditions.predictor import Predictor
from tubecert.conditions.problem import TubeProblem, Wind
from tubecert.conditions.proposal import Asked
from tubecert.conditions.wind import prediction
from tubecert.kernel import check
from tubecert.kinds.table import KINDS
from tubecert.search.distance import least_rate, recipe_at
from tubecert.search.proposers import PROPOSERS
from tubecert.verdict import Verdict


def exactly(value: float) -> Constant:
    return Constant(below=value, above=value)


def wind(bound: str, push: float = 0.7, size: float = 0.9, explained: float = 0.4) -> Wind:
    own = WindConstants(push=exactly(push), size=exactly(size), explained=exactly(explained))
    return Wind(bound=Fraction(bound), constants=own)


def rest(push: float, size: float) -> ResidualConstants:
    return ResidualConstants(push=exactly(push), size=exactly(size))


def curved(**options) -> TubeProblem:
    """A problem that certifies although B depends on the state."""
    values = {"B_x": 0.05, "B_pinv_x": 0.02} | options.pop("values", {})
    return two_state(values=values, **options)


# -- without wind


@pytest.mark.parametrize("make", [alive, two_state, curved])
def test_a_wind_of_no_size_changes_nothing(make):
    bare, still = make(), make(wind=wind("0"), residual=rest(0.0, 0.0))
    one = Fraction(50)
    for problem in (bare, still):
        assert alone.distance(problem).hi == alone.distance(bare).hi
    first = recipe_at(bare, one, 10**6 * one, bare.predictor_gain or one)
    second = recipe_at(still, one, 10**6 * one, still.predictor_gain or one)
    assert float(second.prediction_error) == pytest.approx(float(first.prediction_error), rel=1e-9)
    assert margin_distance(still, second).lo == pytest.approx(margin_distance(bare, first).lo, rel=1e-9)


def test_without_wind_there_are_no_numbers_of_it():
    n = two_state().proven()
    assert n.wind_push is n.wind_speed is n.wind_error is n.wind_matched is n.rest_speed is None


# -- what is added to delta and phi


def test_a_wind_adds_its_push_to_the_defect_in_certificate_0():
    values = {"plan_defect_metric": 0.1 + 0.7 * 0.05}
    pushed, moved = two_state(values={"plan_defect_metric": 0.1}, wind=wind("0.05")), two_state(values=values)
    assert alone.distance(pushed).hi == pytest.approx(alone.distance(moved).hi, rel=1e-12)
    assert alone.uncertainty_limit(pushed) == pytest.approx(alone.uncertainty_limit(moved), rel=1e-12)


def test_what_parameters_leave_is_a_part_of_delta_and_phi():
    n = two_state(values={"plan_defect_metric": 0.1}, residual=rest(0.2, 0.3)).proven()
    assert n.delta.hi == pytest.approx(0.3)
    assert n.phi.hi == pytest.approx(19.4787 + 0.3)
    assert n.delta.hi >= 0.1 + 0.2


def test_the_speed_of_the_wind_enters_y():
    still, blown = two_state(), two_state(wind=wind("0.5"))
    a, b = (distance.drift_bound(problem.proven()).hi for problem in (still, blown))
    assert b - a == pytest.approx(0.9 * 0.5)


# -- the estimate of B


@given(
    zb=st.floats(0, 5),
    s1=st.floats(0, 50),
    Gamma=st.floats(1, 1e8),
    q=st.floats(0.1, 100),
    at=st.tuples(st.floats(0, 20), st.floats(0, 1)),
)
def test_v_falls_wherever_it_exceeds_the_bound(zb, s1, Gamma, q, at):
    """7.5: with |xt| = y and |s~| = s (Dh + R): if V > Xt^2 then -q y^2 + 2 zb y + 2 |s~| s1/Gamma <= 0."""
    y, s = at
    n = two_state().floats()
    hs = float(n.Dh + n.R)
    p = Predictor(norm=np.asarray(q / 2), shifted=np.asarray(1.0), q=np.asarray(q))
    Xt = float(prediction(n, np.asarray(s1), p, np.asarray(Gamma), np.asarray(zb)))
    V = y**2 + (s * hs) ** 2 / Gamma
    if Xt**2 * (1 + 1e-9) < V:
        assert -q * y**2 + 2 * zb * y + 2 * s * hs * s1 / Gamma <= 1e-9 * q * y**2


def test_the_bound_of_the_prediction_is_attained():
    """At Xt, with s~ as large as it may be, V' vanishes: no smaller number would do for this argument."""
    n = two_state().floats()
    zb, s1, Gamma, q = 0.3, 4.0, 1e4, 20.0
    p = Predictor(norm=np.asarray(q / 2), shifted=np.asarray(1.0), q=np.asarray(q))
    Xt = float(prediction(n, np.asarray(s1), p, np.asarray(Gamma), np.asarray(zb)))
    hs = float(n.Dh + n.R)
    y = np.sqrt(Xt**2 - hs**2 / Gamma)
    assert -q * y**2 + 2 * zb * y + 2 * hs * s1 / Gamma == pytest.approx(0, abs=1e-9)


def test_an_unmatched_wind_costs_the_estimate_of_b_nothing_if_b_is_constant():
    still, blown = two_state(), two_state(wind=wind("0.3", explained=0.0))
    one, rate = Fraction(50), Fraction(10**6)
    e = [float(recipe_at(p, one, rate, one).prediction_error) for p in (still, blown)]
    Y = [float(recipe_at(p, one, rate, one).speed) for p in (still, blown)]
    assert Y[1] > Y[0]
    assert e[1] == pytest.approx(e[0], rel=0.01)  # through Y alone
    turning = curved(wind=wind("0.3", explained=0.0))
    assert float(recipe_at(turning, one, rate, one).prediction_error) > 1.5 * e[0]


@pytest.mark.parametrize(
    "problem", [two_state(wind=wind("0.02")), curved(wind=wind("0.02")), two_state(residual=rest(0.01, 0.02))]
)
def test_the_least_rate_is_one_at_which_e_is_what_it_has_to_be(problem):
    n = problem.floats(problem.projection_radius)
    omega = np.array([60.0])
    Gamma, e = least_rate(problem, n, omega, omega)
    Y = distance.least_speed(n, omega, e)
    needed = distance.error_needed(n, Y, omega, Predictor.of_gain(omega, omega), Gamma)
    assert np.isfinite(Gamma[0])
    assert needed[0] == pytest.approx(e[0], rel=1e-9)


def test_adaptation_cannot_make_up_for_what_the_estimate_takes_for_wind():
    """e >= eps_w |w| whatever Gamma: a recipe that claims less is none."""
    problem = two_state(wind=wind("0.02"))
    honest = recipe_at(problem, Fraction(60), Fraction(10) ** 30, Fraction(60))
    assert float(honest.prediction_error) >= 0.4 * 0.02
    assert check(problem, honest).margins["distance"].lo > -np.inf
    liar = replace(honest, prediction_error=Fraction(4, 1000))
    assert check(problem, liar).margins["distance"].lo == -np.inf


# -- verdicts


@pytest.mark.slow
def test_more_wind_never_needs_less():
    rates = []
    for bound in ("0", "0.01", "0.05", "0.1"):
        problem = two_state(wind=wind(bound, explained=0.05))
        pair = judged_distance(problem).least_adaptation
        if judged_distance(problem).verdict is Verdict.CERTIFIED:
            rates.append(judged_distance(problem).decisive.recipe.adaptation_rate)
        assert pair is None or pair.recipe.adaptation_rate > 0
    assert len(rates) >= 3
    assert rates == sorted(rates)


def test_a_wind_that_nothing_can_overcome_is_named():
    problem = two_state(wind=wind("5"))
    section = judged_distance(problem)
    assert section.verdict is Verdict.REFUTED
    assert [item.claim for item in section.shortfalls] == ["wind"]
    parameters = two_state(residual=rest(5.0, 1.0))
    assert [item.claim for item in judged_distance(parameters).shortfalls] == ["parameters"]
    plan = two_state(values={"plan_defect_metric": 5.0}, wind=wind("5"), residual=rest(5.0, 1.0))
    assert [item.claim for item in judged_distance(plan).shortfalls] == ["plan_defect"]


def test_certificate_a_says_nothing_of_a_wind():
    section = judged_26(two_state(wind=wind("0.001")))
    assert section.verdict is Verdict.UNDECIDED
    assert section.shortfalls[0].claim == "wind_not_covered"
    assert judged_26(two_state(residual=rest(1e-9, 1e-9))).verdict is Verdict.UNDECIDED
    reached = judged_26(two_state(wind=wind("1", push=0.0, size=0.0, explained=0.0)))
    assert reached.verdict is judged_26(two_state()).verdict


@pytest.mark.parametrize("which", ["push", "size", "explained"])
def test_a_wind_constant_without_a_bound_proves_nothing(which):
    endless = {"push": 0.1, "size": 0.1, "explained": 0.1} | {which: np.inf}
    section = judged_distance(two_state(wind=wind("0.01", **endless)))
    assert section.verdict is Verdict.UNDECIDED
    assert section.shortfalls[0].constant == f"wind_{which}"


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.key)
def test_no_theorem_speaks_of_a_b_that_is_not_known(kind):
    problem = alive(gained=True)
    section = kind.section(problem, PROPOSERS[kind.theorem.recipe].propose(problem, Asked(curve=False)))
    assert section.verdict is Verdict.UNDECIDED
    assert section.shortfalls[0].claim == "gain_not_covered"
    assert section.proof is None
