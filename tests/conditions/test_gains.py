"""Theorem H with an uncertain gain: limits, what it refuses, and the recursion of the filter, by brute force."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from machines import alive_machine
from test_hardware import proving, recipe, with_gain

from tubecert.bounds.constants import GainConstants
from tubecert.conditions import hardware
from tubecert.conditions.hardware import evaluated, gains, loop_of, margins_hardware, plant
from tubecert.conditions.proposal import Proposal
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Proof, check, judge
from tubecert.kinds.table import kinds_of, needed_by_all
from tubecert.verdict import Verdict

NAME = "an uncertain gain, plain"


def reached(problem, own):
    x = evaluated(plant(problem, own.clip_radius), loop_of(own))
    return float(x.course.supremum().hi)


def test_it_tends_to_theorem_h():
    own, problem = recipe(), alive_machine()
    known = reached(problem, own)
    assert reached(with_gain(problem, 1e-12), own) == pytest.approx(known, rel=1e-9)
    deadbeat = recipe(bandwidth=None, noise=Fraction(1, 10**5))
    with_none = reached(problem, deadbeat)
    assert reached(with_gain(problem, 1e-12), deadbeat) == pytest.approx(with_none, rel=1e-6)


def test_more_of_it_costs_more():
    errors = (1e-6, 1e-3, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9)
    for own in (recipe(), recipe(bandwidth=None)):
        found = [reached(with_gain(alive_machine(), error), own) for error in errors]
        assert all(a < b for a, b in pairwise(found)), found


def test_a_gain_that_may_vanish_or_acts_elsewhere_proves_nothing():
    own, problem = proving(NAME), with_gain(alive_machine())
    assert isinstance(check(problem, own), Proof)
    for gain, claim in (
        (GainConstants(error=Constant(below=0.0, above=1.0), matched=True), "gain_range"),
        (GainConstants(error=Constant(below=0.0, above=0.03), matched=False), "gain_unmatched"),
    ):
        other = replace(problem, gain=gain)
        assert [float(m.lo) for m in margins_hardware(other, own)] == [-np.inf, -np.inf]
        assert not isinstance(check(other, own), Proof)
        found = judge(other, hardware.THEOREM, Proposal())
        assert found.verdict is Verdict.UNDECIDED
        assert [item.claim for item in found.shortfalls] == [claim]


def test_no_other_theorem_speaks_of_it():
    problem = with_gain(alive_machine())
    assert [kind.key for kind in kinds_of(problem)] == ["hardware"]
    assert needed_by_all(replace(problem, machine=None)) == needed_by_all(problem)


@pytest.mark.parametrize("omega", [None, Fraction(20), Fraction(900)])
@pytest.mark.parametrize("late", [0, Fraction(1, 2), 1])
def test_the_filter_forgets_at_that_rate(omega, late):
    """rho_k of the proof, with equality throughout, stays below S + (H0 - S)_+ e^(-omega_b k Ts) (times r for age)."""
    Ts, error, S, H0 = Fraction(1, 1000), 0.3, 0.02, 0.5
    own = recipe(sample_time=Ts, delay=late * Ts, bandwidth=omega)
    p = plant(with_gain(alive_machine(), error), own.clip_radius)
    rate = float(gains.forgetting(p, loop_of(own)).lo)
    th = 1.0 if omega is None else 1 - np.exp(-float(omega * Ts))
    drift = S * (1 - error)  # what is added per sample where S is the fixed point
    before = now = H0
    for k in range(1, 400):
        before, now = (
            now,
            (1 - th) * now + th * (drift + error * ((1 - float(late)) * now + float(late) * before)),
        )
        assert now <= S + (H0 - S) * np.exp(-rate * k * float(Ts)) + 1e-12
    assert now < S + 0.02 or omega == 20


def test_the_search_finds_the_least_bias():
    own, problem = recipe(), with_gain(alive_machine(), 0.2)
    p, loop = plant(problem, own.clip_radius), loop_of(own)
    zero = 0 * loop.S
    first = hardware.estimate(p, replace(loop, S=zero, N=zero))
    least = gains.settled(p, first.bias, first.ripple)
    again = hardware.estimate(p, replace(loop, S=least, N=first.ripple))
    assert float(again.bias.hi) == pytest.approx(float(least.hi), rel=1e-12)
