"""Wind and unknown parameters in the formulas of 0 and B (theory 7): limits, closed forms, verdicts."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import alive, judged_26, judged_distance, two_state

from tubecert.bounds.constants import Constant, ResidualConstants, WindConstants
from tubecert.conditions import distance
from tubecert.conditions.problem import TubeProblem, Wind
from tubecert.conditions.theorem import Asked
from tubecert.conditions.wind import prediction
from tubecert.kinds.table import KINDS
from tubecert.search.distance import least_rate
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
    Xt = float(prediction(n, np.asarray(s1), np.asarray(q / 2), np.asarray(Gamma), np.asarray(zb)))
    V = y**2 + (s * hs) ** 2 / Gamma
    if Xt**2 * (1 + 1e-9) < V:
        assert -q * y**2 + 2 * zb * y + 2 * s * hs * s1 / Gamma <= 1e-9 * q * y**2


def test_the_bound_of_the_prediction_is_attained():
    """At Xt, with s~ as large as it may be, V' vanishes: no smaller number would do for this argument."""
    n = two_state().floats()
    zb, s1, Gamma, q = 0.3, 4.0, 1e4, 20.0
    Xt = float(prediction(n, np.asarray(s1), np.asarray(q / 2), np.asarray(Gamma), np.asarray(zb)))
    hs = float(n.Dh + n.R)
    y = np.sqrt(Xt**2 - hs**2 / Gamma)
    assert -q * y**2 + 2 * zb * y + 2 * hs * s1 / Gamma == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    "problem", [two_state(wind=wind("0.02")), curved(wind=wind("0.02")), two_state(residual=rest(0.01, 0.02))]
)
def test_the_least_rate_is_one_at_which_e_is_what_it_has_to_be(problem):
    n = problem.floats(problem.projection_radius)
    omega = np.array([60.0])
    Gamma, e = least_rate(problem, n, omega, omega)
    Y = distance.least_speed(n, omega, e)
    needed = distance.error_needed(n, Y, omega, omega, Gamma)
    assert np.isfinite(Gamma[0])
    assert needed[0] == pytest.approx(e[0], rel=1e-9)


@pytest.mark.slow
def test_more_wind_never_needs_less():
    rates = []
    for bound in ("0", "0.01", "0.05", "0.1"):
        problem = two_state(wind=wind(bound, explained=0.05))
        pair = judged_distance(problem).at("least_adaptation")
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
