"""Certificate C: piecewise-constant adaptation with sample time Ts. Trusted.

THEOREM C. If Y > phi + DB[du dbar + min((1+r_H) Dh, max(H1, S_T))], then dbar > max(d0, d1, sup D) with
(d0, H0, S, e) := (d1, H1, S_T, 0) implies |x - x*| < rho over the horizon. The estimate is
clipped to R_H >= Dh. Over a problem with parts a recipe has a level in each of them, and theorem CW takes the place of
C. Implements: theory sections 4b and 4f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Generic

import numpy as np

from tubecert.conditions.arithmetic import (
    Array,
    T,
    confined,
    decay_mean,
    exp,
    expm1,
    least_solution,
    maximum,
    minimum,
    number,
    quiet,
    sqrt,
    vector,
)
from tubecert.conditions.distance import drift_bound, least_from_below
from tubecert.conditions.inputs import InputShares, shares
from tubecert.conditions.kernels import DistanceBound
from tubecert.conditions.obstacles import obstacles, reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.sampled_windows import InWindow, Loop, along
from tubecert.conditions.stretches import LevelProof, cover, margin, numbers_of, widest_shares
from tubecert.conditions.theorem import Theorem
from tubecert.conditions.wind import is_felt, provisos, pushed, taken, turning
from tubecert.enclosure.interval import Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledRecipe:
    """The proof of theorem C at printed gains: `speed` is Y, with `windows` (theorem CW) the largest of them."""

    sample_time: Fraction
    bandwidth: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction
    speed: Fraction
    windows: tuple[LevelProof, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ages(Generic[T]):
    """How old what the filter sees is: m, the mean age of an estimate, and w = Ts/(1 - e^(-omega Ts))."""

    m: T
    w: T


@quiet
def ages(Ts: T, omega: T, g: T) -> Ages[T]:
    """Mean age m = 1/g - Ts/(e^(g Ts) - 1) in [0, Ts/2], and the filter's share w, (4.6)."""
    y = g * Ts
    line = number(Fraction(1, 2), y) - y / 12
    mean = 1 / y - 1 / expm1(y)
    if isinstance(mean, Interval) and isinstance(line, Interval):
        # the series 1/2 - y/12 + y^3/720 - ... envelopes the mean: free of the cancellation at small y
        mean = confined(
            mean, maximum(line, number(0, line)), minimum(line + y**3 / 720, number(Fraction(1, 2), line))
        )
    else:
        mean = np.where(y < 1e-3, line, mean)
    return Ages(m=Ts * mean, w=1 / (omega * decay_mean(omega * Ts)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledState(Generic[T]):
    """H1, S_T and d1 of theorem C at one Y."""

    H1: T
    S_T: T
    d1: T


@quiet
def sampled_state(n: Numbers[T], Ts: T, age: Ages[T], Y: T) -> SampledState[T]:
    """H1 = min(Dh, H0 + s1 Ts), S_T = s1 w + m (s1 + b Y), d1 = the distance after the first sample, (4.8), (4.9)."""
    s1 = n.Dht + n.Dhx * Y
    b = _gain_drift(n)
    H1 = minimum(n.Dh, n.H0 + s1 * Ts)  # (4.8)
    S_T = s1 * age.w + age.m * (s1 + b * Y)  # (4.8)
    if is_felt(n):
        S_T = S_T + taken(n) + turning(n) * age.m * Y  # (7.6)
    # (4.9)
    d1 = n.d0 * exp(-n.lam * Ts) + (n.beta * H1 + pushed(n)) * Ts * decay_mean(n.lam * Ts)
    return SampledState(H1=H1, S_T=S_T, d1=d1)


def _gain_drift(n: Numbers[T]) -> T:
    """How fast B^+ B drifts: b = min(DBp DBx, DBpx DB) Dh, per unit of |xdot|; 0 for a constant B, (4.7)."""
    return minimum(n.DBp * n.DBx, n.DBpx * n.DB) * n.Dh


@quiet
def speed_needed(n: Numbers[T], s: SampledState[T]) -> T:
    """What Y has to exceed: phi + DB [du dbar + min(Dh + R_H, max(H1, S_T))] of theorem C."""
    return drift_bound(n) + n.DB * minimum(n.Dh + n.R, maximum(s.H1, s.S_T))


@quiet
def least_speed(n: Numbers[T], Ts: T, age: Ages[T]) -> T:
    """The least Y, in closed form: every term of the minimum and maximum is affine in Y (theorem C solved for Y)."""
    drift, b = drift_bound(n), _gain_drift(n)
    crude = drift + n.DB * (n.Dh + n.R)
    first = minimum(
        drift + n.DB * n.Dh, least_solution(drift + n.DB * (n.H0 + n.Dht * Ts), n.DB * n.Dhx * Ts)
    )
    lag = age.w + age.m
    known, slope = drift + n.DB * n.Dht * lag, n.DB * (n.Dhx * lag + b * age.m)
    if is_felt(n):
        known, slope = known + n.DB * taken(n), slope + n.DB * turning(n) * age.m
    later = least_solution(known, slope)
    return minimum(crude, maximum(first, later))


@quiet
def sampled_supremum(n: Numbers[T], Ts: T, omega: T, age: Ages[T], Y: T) -> T:
    """max(d0, d1, sup D): what dbar has to exceed, theorem C."""
    s = sampled_state(n, Ts, age, Y)
    return maximum(maximum(n.d0, s.d1), _bound(n, omega, s).supremum())


def _bound(n: Numbers[T], omega: T, s: SampledState[T]) -> DistanceBound[T]:
    return DistanceBound(
        d0=s.d1,
        beta=n.beta,
        H0=s.H1,
        S=s.S_T,
        e=number(0, n.d0),
        delta=pushed(n),
        lam=n.lam,
        omega=omega,
        horizon=n.horizon,
    )


@quiet
def margin_sampled_along(problem: TubeProblem, recipes: Sequence[SampledRecipe]) -> Interval:
    """Margins of many recipes at once, shape `(len(recipes),)`; recipes share the projection radius."""
    if problem.parts or any(recipe.windows for recipe in recipes):
        found = [_margin_in_windows(problem, recipe) for recipe in recipes]
        return Interval(np.array([m.lo for m in found]), np.array([m.hi for m in found]))
    R_H = recipes[0].projection_radius
    serves = all(r.projection_radius == R_H for r in recipes) and problem.radius_serves(R_H, clips=True)
    Ts, omega = vector([r.sample_time for r in recipes]), vector([r.bandwidth for r in recipes])
    age = ages(Ts, omega, vector([r.predictor_gain for r in recipes]))
    Y = vector([r.speed for r in recipes])
    n = problem.proven(R_H)
    valid = serves & (speed_needed(n, sampled_state(n, Ts, age, Y)).hi < Y.lo)
    low = _margin(n, Ts, omega, age, Y).lo
    high = _margin(problem.enclosed(R_H), Ts, omega, age, Y).hi
    return Interval(np.where(valid, low, -np.inf), np.maximum(low, high))


def _margin(
    n: Numbers[Interval], Ts: Interval, omega: Interval, age: Ages[Interval], Y: Interval
) -> Interval:
    """1 - max(d0, d1, sup D)/dbar of theorem C."""
    return (1 - sampled_supremum(n, Ts, omega, age, Y) / reach(n)).sanitised()


# -- theorem CW


def course_of(problem: TubeProblem, recipe: SampledRecipe) -> tuple[InWindow[Interval], ...]:
    """Every formula in every window, with outward rounding; `ValueError` where windows are not the parts.

    (4.14), (4.17).
    """
    if not cover(problem, recipe):
        raise ValueError("the windows of a recipe are those of its problem")
    Ts, omega = Interval.of(recipe.sample_time), Interval.of(recipe.bandwidth)
    age = ages(Ts, omega, Interval.of(recipe.predictor_gain))
    return along(
        [numbers_of(problem, part, recipe.projection_radius) for part in problem.parts],
        [Interval.of(part.end - part.begin) for part in problem.parts],
        [Interval.of(own.speed) for own in recipe.windows],
        Loop(Ts=Ts, omega=omega, m=age.m, w=age.w),
    )


def suprema_in_windows(problem: TubeProblem, recipe: SampledRecipe) -> tuple[float, ...]:
    """sup D in every window, by a recipe that is proven."""
    return tuple(float(own.course.supremum.hi) for own in course_of(problem, recipe))


@quiet
def _margin_in_windows(problem: TubeProblem, recipe: SampledRecipe) -> Interval:
    """The least margin of (4.18), if every window is longer than 2 Ts: theorem CW."""
    nothing = Interval(np.asarray(-np.inf), np.asarray(np.inf))
    if not problem.radius_serves(recipe.projection_radius, clips=True) or not cover(problem, recipe):
        return nothing
    if any(part.end - part.begin <= 2 * recipe.sample_time for part in problem.parts):
        return nothing
    found = course_of(problem, recipe)
    numbers = [numbers_of(problem, part, recipe.projection_radius) for part in problem.parts]
    return margin(problem, numbers, recipe, [own.course for own in found])


@quiet
def sampled_ceiling(problem: TubeProblem, recipe: SampledRecipe) -> float:
    """An upper bound of the margin that any Y can prove at the recipe's gains; <= 0 refutes these gains, theory 4.2.

    In windows nothing is refuted.
    """
    if problem.parts:
        return float(np.inf)
    n = problem.enclosed(recipe.projection_radius)
    Ts, omega = Interval.of(recipe.sample_time), Interval.of(recipe.bandwidth)
    age = ages(Ts, omega, Interval.of(recipe.predictor_gain))
    Y = least_from_below(lambda Y: speed_needed(n, sampled_state(n, Ts, age, Y)))
    return float(_margin(n, Ts, omega, age, Y).hi)


def ultimate_radius(problem: TubeProblem, recipe: SampledRecipe) -> float | None:
    """|x - x*| is at most this in the long run, proven; windows have an end (A1 of (2.15))."""
    if recipe.windows:
        return None
    n = problem.proven(recipe.projection_radius)
    Ts, omega = Interval.of(recipe.sample_time), Interval.of(recipe.bandwidth)
    s = sampled_state(n, Ts, ages(Ts, omega, Interval.of(recipe.predictor_gain)), Interval.of(recipe.speed))
    return float((_bound(n, omega, s).ultimate() / sqrt(n.a)).hi)


def input_shares(problem: TubeProblem, recipe: SampledRecipe) -> InputShares | None:
    """|k| <= du max(d0, d1, sup D), |u_a| <= R_H."""
    if recipe.windows:
        return widest_shares(problem, suprema_in_windows(problem, recipe), recipe.projection_radius)
    n = problem.proven(recipe.projection_radius)
    Ts, omega = Interval.of(recipe.sample_time), Interval.of(recipe.bandwidth)
    age = ages(Ts, omega, Interval.of(recipe.predictor_gain))
    top = sampled_supremum(n, Ts, omega, age, Interval.of(recipe.speed))
    return shares(n, top, recipe.projection_radius)


def _at_once(problem: TubeProblem, n: Numbers[Array]) -> object:
    """Everything that theorem C compares, at some gains."""
    del problem
    one = np.asarray(1.0)
    age = ages(one, one, one)
    Y = least_speed(n, one, age)
    return speed_needed(n, sampled_state(n, one, age, Y)), sampled_supremum(n, one, one, age, Y) < reach(n)


THEOREM = Theorem(
    recipe=SampledRecipe,
    margins=lambda problem, recipes: {"sampled": margin_sampled_along(problem, recipes)},
    ceilings=lambda problem, recipe: {"sampled": sampled_ceiling(problem, recipe)},
    formula=_at_once,
    # what fills the tube in the long run need not fill a window
    obstacles=lambda problem: () if problem.parts else obstacles(problem),
    provisos=provisos,
    ultimate=ultimate_radius,
    inputs=input_shares,
    own_predictor=True,
    parts=("windows",),
)
