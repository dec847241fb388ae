"""What recheck makes of numbers of 0, A and B against the oracle in 60 digits: of those that lie, and of any."""

from __future__ import annotations

from dataclasses import fields, replace
from fractions import Fraction
from functools import cache
from typing import Any

import gains_oracle as oracle
import mpmath
import numpy as np
import pytest
from flint import arb, ctx
from gains_oracle import Given
from lies import KINDS, OMEGAS, PROBLEMS, at, honest, problems, told, told_twice
from rechecked import case_of, certified
from systems import SMALL

from tubecert.conditions.problem import TubeProblem
from tubecert.recheck.balls import exact
from tubecert.recheck.conditions import (
    Distance,
    DistanceProof,
    Gains,
    Numbers,
    Setting,
    WindNumbers,
    derived,
    distance_bound,
    kappa,
    margin,
    margins_26,
    own_distance_proof,
    tight_kernel,
)
from tubecert.recheck.kinds import alone
from tubecert.recheck.kinds.kind import ultimate

F = Fraction
BITS, CLOSE = 160, 1e-25


@cache
def system() -> Any:
    """Some system: its options are replaced."""
    return case_of(certified(SMALL, conditions="distance")).system


def ball(x: object) -> arb:
    return exact(F(x.above))


def reading(p: TubeProblem) -> Setting:
    """A problem as recheck reads it: every constant on its safe side."""
    values = {item.name: ball(getattr(p.constants, item.name)) for item in fields(Numbers)}
    values["lower"] = exact(F(p.constants.lower.below))
    rest = arb(0)
    if p.residual is not None:
        rest = ball(p.residual.size)
        values["plan_defect_metric"] += ball(p.residual.push)
        values["drift_on_plan"] += rest
    wind = None
    if p.wind is not None:
        own = p.wind.constants
        wind = WindNumbers(ball(own.push), ball(own.size), ball(own.explained), exact(p.wind.bound))
    options = {"rate": p.rate, "horizon": p.horizon, "smooth": p.smooth, "predictor_gain": p.predictor_gain}
    turns = p.constants.B_x.above > 0
    return Setting(replace(system(), **options), Numbers(**values), p.rho, p.rho_a, wind, turns, rest)


def gains_of(recipe: Any) -> Gains:
    return Gains(**{item.name: getattr(recipe, item.name) for item in fields(Gains)})


def proof_of(recipe: Any) -> DistanceProof:
    return DistanceProof(**{item.name: exact(getattr(recipe, item.name)) for item in fields(DistanceProof)})


def margins(setting: Setting, recipe: Any) -> dict[str, arb]:
    """By condition, not numbers where it says that the theorem does not hold."""
    if KINDS["0"] is type(recipe):
        return {"no_adaptation": margin(setting, alone.supremum(setting, setting.n.h))}
    if KINDS["A"] is type(recipe):
        return margins_26(setting, gains_of(recipe))
    found = distance_bound(setting, gains_of(recipe), proof_of(recipe))
    return {"distance": arb("nan") if found is None else margin(setting, found.supremum())}


def digits(x: arb) -> mpmath.mpf:
    return mpmath.mpf(x.mid().str(60, radius=False))


def same(found: arb, true: mpmath.mpf, words: object) -> None:
    """A ball around a number, in its first 25 digits."""
    assert found.is_finite(), words
    assert abs(digits(found) - true) <= CLOSE * max(1, abs(true)), words


def agrees(setting: Setting, problem: TubeProblem, recipe: Any, words: object) -> bool:
    """Whether recheck takes a recipe for a proof, which has to be what the oracle says."""
    found, true = margins(setting, recipe), oracle.margins(problem, recipe)
    holds = all(value > 0 for value in found.values())
    assert holds == (oracle.left(true) > 0), words
    with mpmath.workdps(oracle.DIGITS):
        for claim, value in found.items() if holds else ():
            same(value, true[claim], (words, claim))
    return holds


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_numbers_that_lie_are_confirmed_where_they_prove_the_theorem_all_the_same(name, kind):
    (problem, proven), recipe = PROBLEMS[name], honest(name, kind)
    with ctx.workprec(BITS):
        setting = reading(problem)
        assert agrees(setting, problem, recipe, "the truth") == (kind in proven)
        lies = (*told(recipe, kind), *told_twice(recipe, kind))
        found = [agrees(setting, problem, lie, words) for words, lie in lies]
    if kind != "0":
        assert any(found) == (kind in proven)
        assert not all(found)


@pytest.mark.slow
@pytest.mark.parametrize("omega", OMEGAS)
def test_any_numbers_of_theorem_a_are_those_of_the_theory(omega):
    for problem in problems():
        recipe = at(problem, "A", omega)
        with ctx.workprec(BITS), mpmath.workdps(oracle.DIGITS):
            given, setting, gains = Given.of(problem), reading(problem), gains_of(recipe)
            true, found = oracle.rate_terms(given, recipe), derived(setting, gains)
            assert found.keys() == true.keys()
            for name, value in found.items():
                same(value, true[name], name)
            for claim, left in oracle.rates(given, recipe).items():
                value = margins_26(setting, gains)[claim]
                if mpmath.isfinite(left):
                    same(value, left, claim)
                else:
                    assert not value > 0


@pytest.mark.slow
@pytest.mark.parametrize("omega", OMEGAS)
def test_any_numbers_of_theorems_0_and_b_are_those_of_the_theory(omega):
    """At the Y, e and S that recheck finds by itself; a radius in the long run follows where the tube does."""
    followed = set()
    for problem in problems():
        recipe = at(problem, "B", omega)
        with ctx.workprec(BITS), mpmath.workdps(oracle.DIGITS):
            given, setting, gains = Given.of(problem), reading(problem), gains_of(recipe)
            own, h = oracle.alone(given), setting.n.h
            same(alone.supremum(setting, h), own.supremum(), "sup D of 0")
            same(alone.settled(setting, h), own.ultimate, "A1 of 0")
            proof = own_distance_proof(setting, gains)
            found = distance_bound(setting, gains, proof)
            assert found is not None
            true = oracle.course(given, recipe, digits(proof.uncertainty), digits(proof.prediction_error))
            same(found.supremum(), true.supremum(), "sup D")
            same(found.ultimate(), true.ultimate, "A1")
            holds = true.supremum() < given.dbar
            assert ultimate(F(10) ** 9, setting, gains, proof).holds == holds
            followed.add(holds)
            least = oracle.best(problem, recipe)
            assert abs(1 - true.supremum() / given.dbar - least) <= 1e-20 * (1 + abs(least))
    assert len(followed) == 2


def test_sizes_of_theorem_b_are_not_negative():
    """With a negative Y and e it would ask for less than nothing where B^+ is said to turn fast (an upper bound)."""
    for problem in problems():
        setting, gains = reading(problem), gains_of(at(problem, "B", OMEGAS[0]))
        turning = replace(setting, n=replace(setting.n, B_pinv_x=arb(10) ** 15))
        proof = DistanceProof(speed=arb(-1), prediction_error=arb(-(10**6)), uncertainty=arb(10) ** 3)
        assert distance_bound(turning, gains, proof) is None


@pytest.fixture
def precise():
    with ctx.workprec(BITS), mpmath.workdps(oracle.DIGITS):
        yield


def inside(x: arb, rng: np.random.Generator) -> mpmath.mpf:
    """A number of a ball: one of its ends, or between them."""
    at = rng.choice([-1.0, 1.0, rng.uniform(-1, 1)])
    return mpmath.mpf(float(x.mid())) + mpmath.mpf(at * (1 - 1e-9)) * mpmath.mpf(float(x.rad()))


SHARES = (0.0, 1e-12, 1e-3, 0.2, 0.9)  # of a number, by which its ball is wide


@pytest.mark.slow
@pytest.mark.usefixtures("precise")
@pytest.mark.parametrize("share", SHARES)
def test_a_supremum_bounds_that_of_every_number_of_its_balls(share):
    """Rates that are equal, a filter that starts where it ends; with and without an end."""
    rng, moving = np.random.default_rng(11), 0
    for k in range(300):
        d0, beta, H0, S, e, delta, lam = map(float, np.exp(rng.uniform(-2.5, 1.5, 7)))
        own = {
            "d0": d0 * (k % 3 > 0), "beta": beta, "H0": H0, "S": (S, H0, S / 50)[k % 3], "e": e,
            "delta": delta,
        }  # fmt: skip
        w = lam * (1.0, 1 + 1e-13, 0.2, 3.0, 40.0)[k % 5]
        T = None if k % 2 else float(np.exp(rng.uniform(-3, 2))) / lam
        balls = {name: arb(x, share * x * (rng.random() < 0.5)) for name, x in own.items()}
        end = None if T is None else arb(T)
        found = Distance(**balls, rate=arb(lam), omega=arb(w), horizon=end).supremum()
        for _ in range(8):
            numbers = [inside(x, rng) for x in balls.values()]
            last = None if T is None else mpmath.mpf(T)
            true = oracle.Course(*numbers, mpmath.mpf(lam), mpmath.mpf(w), last)
            top = true.supremum()
            assert digits(found.upper()) >= top
            assert share > 0 or digits(found.upper()) <= top + CLOSE * top
            moving += top > 1.001 * max(true.d0, true.ultimate if T is None else true.at(last))
    assert moving > 50


@pytest.mark.slow
@pytest.mark.usefixtures("precise")
@pytest.mark.parametrize("share", SHARES)
def test_a_kernel_bounds_that_of_every_number_of_its_balls(share):
    """On both sides of where its cases meet, and there."""
    rng = np.random.default_rng(12)
    for k in range(300):
        c, s0 = map(float, np.exp(rng.uniform(-2, 2, 2)))
        w = c * (1.0, 1 + 1e-13, 0.3, 7.0, float(np.exp(rng.uniform(-3, 3))))[k % 5]
        s1 = min(c, w) * s0 * (0.2, 1.0, 1 - 1e-10, 3.0)[k % 4]
        balls = arb(s0, share * s0), arb(s1, share * s1)
        found = tight_kernel(arb(c), arb(w), *balls)
        for _ in range(3):
            true = oracle.kernel(mpmath.mpf(c), mpmath.mpf(w), *(inside(x, rng) for x in balls))
            assert digits(found.upper()) >= true
            # where a ball cannot tell the case, a start that adds nothing costs nothing
            assert share > 1e-12 or digits(found.upper()) <= true + (1e-9 if share else CLOSE) * true
        # sup |e^(-wt) - e^(-ct)|/|c - w| is that of a course as well
        peak = oracle.Course(*map(mpmath.mpf, (0, 1, 1, 0, 0, 0)), mpmath.mpf(c), mpmath.mpf(w)).supremum()
        same(kappa(arb(c), arb(w)), peak, "kappa")
