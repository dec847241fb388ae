"""Certificate 0 against closed forms in exact arithmetic, an integrated comparison equation, and its own limit."""

from dataclasses import replace
from fractions import Fraction
from math import exp, inf

import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import constants

from tubecert.conditions import alone
from tubecert.conditions.alone import NoGains
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.theorem import Asked
from tubecert.kernel import Proof, check
from tubecert.kinds.alone import KIND
from tubecert.search.proposers import PROPOSERS
from tubecert.verdict import Verdict

LESS = 1 - 1e-9


def problem(horizon=None, rho="1", **values):
    defaults = {"lower": 4.0, "upper": 9.0, "metric_input_gain": 2.0, "h": 0.3, "initial_distance": 0.1}
    return TubeProblem(
        constants=constants(**(defaults | values)),
        rate=Fraction("1.5"),
        epsilon=Fraction("0.5"),
        rho_a=Fraction("0.1"),
        rho_r=Fraction("0.5"),
        rho=Fraction(rho),
        horizon=None if horizon is None else Fraction(horizon),
        states=2,
    )


def section(of):
    return KIND.section(of, PROPOSERS[NoGains].propose(of, Asked()))


@pytest.mark.slow
@given(st.floats(0, 1.9), st.floats(0, 2), st.floats(0, 1), st.floats(0.01, 20), st.booleans())
def test_it_is_above_the_solution_of_the_comparison_equation(d0, h, delta, T, endless):
    of = problem(None if endless else repr(T), initial_distance=d0, h=h, plan_defect_metric=delta)
    A1 = (2 * h + delta) / 1.5
    last = A1 if endless else A1 + (d0 - A1) * exp(-1.5 * T)
    top = max(d0, last)
    assert alone.distance(of).hi >= top * LESS
    assert alone.distance(of).hi <= top * (1 + 1e-9) + 1e-12
    certified = isinstance(check(of, NoGains()), Proof)
    assert certified == (top < 2) or top == pytest.approx(2, rel=1e-9)


@pytest.mark.slow
@given(st.floats(0, 1.5), st.floats(0, 1), st.sampled_from([None, "0.2", "7"]))
def test_the_largest_uncertainty_is_where_the_proof_ends(d0, delta, horizon):
    of = problem(horizon, initial_distance=d0, plan_defect_metric=delta)
    limit = alone.uncertainty_limit(of)
    assert limit is not None
    for h, holds in ((limit * (1 - 1e-9), True), (limit * (1 + 1e-9) + 1e-300, False)):
        at = replace(of, constants=replace(of.constants, h=constants(h=h).h))
        assert isinstance(check(at, NoGains()), Proof) == holds


@pytest.mark.parametrize(
    ("values", "claim"),
    [({"initial_distance": 2.1}, "initial_distance"), ({"plan_defect_metric": 3.5}, "plan_defect")],
)
def test_a_tube_that_no_gains_could_hold_is_refuted(values, claim):
    found = section(problem(**values))
    assert found.verdict is Verdict.REFUTED
    assert [item.claim for item in found.shortfalls] == [claim]
    assert found.data().uncertainty_limit is None


def test_a_constant_without_a_bound_proves_nothing():
    found = section(problem(h=(0.0, inf)))
    assert found.verdict is Verdict.UNDECIDED
    assert not isinstance(check(problem(h=(0.0, inf)), NoGains()), Proof)


def test_what_the_enclosures_leave_open_is_undecided_and_what_they_exclude_refuted():
    # dbar = 2 is reached at |h| = 1.5
    assert section(problem(h=(1.4, 1.6))).verdict is Verdict.UNDECIDED
    assert section(problem(h=(1.51, 1.6))).verdict is Verdict.REFUTED
    assert section(problem(h=(1.4, 1.49))).verdict is Verdict.CERTIFIED


def test_the_limit_of_h_is_absent_where_h_does_not_act():
    assert alone.uncertainty_limit(problem(metric_input_gain=0.0)) is None
