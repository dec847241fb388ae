"""Theorems BW and CW: certificates B and C window by window, each with a level and constants of its own. Trusted.

In continuous time a window is only entered by what filter and estimator hold. A window is a few stretches of time with
one forcing each; D(t) and the memory mu of the filter go from stretch to stretch. Implements: theory section 4f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Generic, Protocol

import numpy as np

from tubecert.conditions.arithmetic import T, exp, expm1, maximum, minimum, number, quiet
from tubecert.conditions.inputs import InputShares, shares
from tubecert.conditions.kernels import DistanceBound
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import Numbers, Part, TubeProblem
from tubecert.conditions.wind import drifting, pushed
from tubecert.enclosure.interval import Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelProof:
    """What theorems BW and CW ask for in a window: its level, and its bound of |x'|."""

    level: Fraction
    speed: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch(Generic[T]):
    """A stretch of `length` in s: |xi| goes towards S + e at the rate omega, e being there at once.

    `jump` is what the memory of the filter is larger by where the stretch begins.
    """

    length: T
    S: T
    e: T
    jump: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Gone(Generic[T]):
    """What is left at a time: the bound D of the distance, and mu of the filter."""

    distance: T
    memory: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Course(Generic[T]):
    """A window that is gone through: the largest D and |xi| in it, and what is left at its end."""

    supremum: T
    uncertainty: T
    end: Gone[T]


@quiet
def through(n: Numbers[T], omega: T, stretches: Sequence[Stretch[T]], start: Gone[T]) -> Course[T]:
    """One window, stretch after stretch, (4.14)."""
    at, highest, most = start, start.distance, number(0, start.distance)
    for each in stretches:
        mu = at.memory + each.jump
        D = DistanceBound(
            d0=at.distance,
            beta=n.beta,
            H0=mu,
            S=each.S,
            e=each.e,
            delta=pushed(n),
            lam=n.lam,
            omega=omega,
            horizon=each.length,
        )
        highest = maximum(highest, D.supremum())
        most = maximum(most, maximum(mu, each.S) + each.e)
        at = Gone(distance=D.at(each.length), memory=_towards(mu, each.S, omega * each.length))
    return Course(supremum=highest, uncertainty=most, end=at)


def _towards(start: T, end: T, age: T) -> T:
    """S + (mu - S) e^(-age), (4.14)."""
    return start * exp(-age) - end * expm1(-age)


@quiet
def speed_needed(n: Numbers[T], level: T, uncertainty: T) -> T:
    """What Y has to exceed in a window: phi + DB [du dhat + min(Dh + R_H, xi)], (4.18)."""
    return drifting(n) + n.DB * (n.du * level + minimum(n.Dh + n.R, uncertainty))


# -- over a problem


class InParts(Protocol):
    """A recipe with levels of its own in every window."""

    @property
    def speed(self) -> Fraction:
        """The largest bound of |x'|."""

    @property
    def windows(self) -> tuple[LevelProof, ...]:
        """What is proven in every window."""


def over(problem: TubeProblem, part: Part) -> TubeProblem:
    """The problem with the constants of a part, as if its tube were all, theory 4f."""
    half = part.radius / 2
    wind = problem.wind
    return replace(
        problem,
        constants=part.constants,
        wind=None if wind is None or part.wind is None else replace(wind, constants=part.wind),
        residual=part.residual,
        machine=None,
        parts=(),
        rho=part.radius,
        # theorems B and C know of rho alone
        epsilon=half,
        rho_a=half,
        rho_r=half,
        horizon=part.end - part.begin,
    )


def numbers_of(problem: TubeProblem, part: Part, radius: Fraction) -> Numbers[Interval]:
    """The safe side of every constant of a part.

    What (7.7) says of a constant B is of one that is the same in all parts.
    """
    n = over(problem, part).proven(radius)
    if problem.constant_input:
        return n
    return replace(n, wind_matched=n.wind_speed, rest_matched=n.rest_speed)


def cover(problem: TubeProblem, recipe: InParts) -> bool:
    """Whether the parts follow one another over the horizon, within the tube, and the recipe has a level in each.

    The speed of the recipe is the largest of its windows.
    """
    parts = problem.parts
    if not parts or len(parts) != len(recipe.windows):
        return False
    return (
        parts[0].begin == 0
        and parts[-1].end == problem.horizon
        and all(a.end == b.begin for a, b in pairwise(parts))
        and all(part.begin < part.end and 0 < part.radius <= problem.rho for part in parts)
        and recipe.speed == max(own.speed for own in recipe.windows)
    )


def margin(
    problem: TubeProblem,
    numbers: Sequence[Numbers[Interval]],
    recipe: InParts,
    found: Sequence[Course[Interval]],
) -> Interval:
    """The least (dbar - sup D)/dbar of the windows; -oo below where (4.18) is not proven.

    No level is beyond the dbar of the whole tube, which its half-widths and the clearance rest on.
    """
    whole = reach(problem.proven())
    proven, low, high = True, np.inf, np.inf
    for n, own, course in zip(numbers, recipe.windows, found, strict=True):
        level, Y = Interval.of(own.level), Interval.of(own.speed)
        fits = level.hi <= reach(n).lo and level.hi <= whole.lo
        stays = course.supremum.hi < level.lo
        fast = speed_needed(n, level, course.uncertainty).hi < Y.lo
        proven = proven and bool(fits and stays and fast)
        left = (1 - course.supremum / reach(n)).sanitised()
        low, high = min(low, float(left.lo)), min(high, float(left.hi))
    return Interval(np.asarray(low if proven else -np.inf), np.asarray(max(low, high)))


def shares_in(problem: TubeProblem, part: Part, supremum: float, radius: Fraction) -> InputShares | None:
    """What the loop adds to u* at most in a part: du sup D, and R_H."""
    return shares(numbers_of(problem, part, radius), Interval.exact(supremum), radius)


def widest_shares(problem: TubeProblem, suprema: Sequence[float], radius: Fraction) -> InputShares | None:
    """What the loop adds to u* at most in any part."""
    found = [shares_in(problem, part, sup, radius) for part, sup in zip(problem.parts, suprema, strict=True)]
    known = [each for each in found if each is not None]
    return max(known, key=lambda each: each.feedback) if known and len(known) == len(found) else None
