"""Bounds of inputs against closed forms, in exact arithmetic, and what is said of limits."""

from dataclasses import replace
from fractions import Fraction
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import constants

from tubecert.conditions.inputs import InputShares, LimitedInput
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.theorem import Asked
from tubecert.enclosure.constant import Constant, Witness
from tubecert.kinds.table import kind_of
from tubecert.search.proposers import PROPOSERS
from tubecert.verdict import Verdict

GAIN = 3.0  # du
FLOATS = st.floats(-1e6, 1e6)
SIZES = st.floats(0, 1e6)


def problem(horizon=None, **values):
    """dbar = 2."""
    given = {"lower": 4.0, "upper": 4.0, "metric_input_gain": 2.0, "h": 0.3, "initial_distance": 0.1}
    given |= {"B": 1.0, "B_pinv": 1.0, "h_t": 0.2, "drift_on_plan": 1.0, "feedback_gain": GAIN}
    return TubeProblem(
        constants=constants(**(given | values)),
        rate=Fraction("1.5"),
        epsilon=Fraction("0.5"),
        rho_a=Fraction("0.1"),
        rho_r=Fraction("0.9"),
        rho=Fraction(1),
        horizon=None if horizon is None else Fraction(horizon),
        states=2,
    )


def section(letter, of):
    kind = kind_of(letter)
    return kind.section(of, PROPOSERS[kind.theorem.recipe].propose(of, Asked()))


def shares_of(found):
    """What the proof of a section adds to inputs; None if it proves nothing."""
    return None if found.proof is None else found.proof.input_shares


def test_what_is_not_proven_bounds_nothing():
    found = section("0", problem(h=5.0, h_t=0.2))
    assert found.verdict is not Verdict.CERTIFIED
    assert shares_of(found) is None


def test_without_a_feedback_gain_nothing_is_added_and_without_a_bound_of_it_nothing_is_known():
    assert shares_of(section("0", problem(feedback_gain=0.0))).feedback == 0
    assert shares_of(section("0", problem(feedback_gain=(1.0, inf)))) is None


def limited(low=-1.0, high=2.0, limits=("-3", "4"), **changes):
    return replace(
        LimitedInput(
            name="u",
            limits=(Fraction(limits[0]), Fraction(limits[1])),
            least=Constant(below=low - 1e-3, above=low, at=Witness(t=1.0, x=(0.0,))),
            greatest=Constant(below=high, above=high + 1e-3, at=Witness(t=2.0, x=(0.0,))),
            any_plan=False,
        ),
        **changes,
    )


@given(FLOATS, SIZES, SIZES, SIZES)
def test_a_bound_is_never_inside_of_the_exact_sum(low, width, feedback, adaptation):
    own = limited(low, low + width)
    bound = own.bound(InputShares(feedback=feedback, adaptation=adaptation))
    added = Fraction(feedback) + Fraction(adaptation)
    least, greatest = Fraction(own.least.below) - added, Fraction(own.greatest.above) + added
    slack = Fraction(1, 10**8) * (abs(least) + abs(greatest) + Fraction(2) ** -890)
    assert least - slack <= Fraction(bound.least) <= least
    assert greatest <= Fraction(bound.greatest) <= greatest + slack
    # as the decimals that are written
    assert Fraction(repr(bound.least)) <= least
    assert Fraction(repr(bound.greatest)) >= greatest


def verdict(own, *pairs):
    return own.verdict([own.bound(InputShares(feedback=a, adaptation=b)) for a, b in pairs])


def test_the_verdict_is_that_of_the_bounds_by_every_kind_that_decides():
    assert verdict(limited(), (1, 0.9)) is Verdict.CERTIFIED
    assert verdict(limited(), (1, 0.9), (0.5, 0.5)) is Verdict.CERTIFIED
    assert verdict(limited(), (1, 0.9), (1.5, 0.5)) is Verdict.UNDECIDED
    assert verdict(limited()) is Verdict.UNDECIDED
    assert limited().verdict([None]) is Verdict.UNDECIDED


@pytest.mark.parametrize("limits", [("-2.8", "9"), ("-9", "3.8")])
def test_either_limit_may_be_missed(limits):
    assert verdict(limited(limits=limits), (1, 0.9)) is Verdict.UNDECIDED
    assert verdict(limited(limits=limits), (0.9, 0.8)) is Verdict.CERTIFIED


def test_a_limit_may_be_met_exactly_and_not_be_missed_by_a_hair():
    own = limited(limits=("-2", "3"), least=Constant.exactly(-1.0), greatest=Constant.exactly(2.0))
    assert verdict(own, (0.5, 0.5)) is Verdict.CERTIFIED
    assert verdict(own, (0.5, 0.5 + 1e-12)) is Verdict.UNDECIDED


def test_a_plan_beyond_a_limit_refutes_with_the_place_and_a_family_does_not():
    high, low = limited(limits=("-3", "1.9")), limited(limits=("-0.5", "4"))
    assert high.leaves.t == 2.0
    assert low.leaves.t == 1.0
    for own in (high, low):
        assert verdict(own, (0, 0)) is Verdict.REFUTED
        assert verdict(replace(own, any_plan=True), (0, 0)) is Verdict.UNDECIDED
    assert limited(limits=("-1", "2")).leaves is None  # met, not left
    # what is only possible refutes nothing
    unsure = limited(limits=("-3", "2.0005"))
    assert unsure.leaves is None
    assert verdict(unsure, (0, 0)) is Verdict.UNDECIDED


def test_a_plan_without_a_bound_has_none_in_the_loop():
    own = limited(greatest=Constant(below=0.0, above=inf))
    assert own.bound(InputShares(feedback=0.0, adaptation=0.0)) is None
