"""Certificate 0: the feedback alone, u = u* + k, without adaptation. Trusted.

THEOREM 0. D+ d <= -lambda d + beta |h| + delta with |h| <= Dh, so d <= D(t) = A1 + (d0 - A1) e^(-lambda t), A1 = (beta
Dh + delta)/lambda; dbar > sup D = max(d0, D(T)) implies |x - x*| < rho over the horizon. No gain enters: what
adaptation buys is what the other certificates leave of this. Implements: theory section 4a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.conditions.arithmetic import Array, T, decay_mean, exp, maximum, quiet, sqrt
from tubecert.conditions.inputs import InputShares, shares
from tubecert.conditions.obstacles import obstacles, reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import Theorem
from tubecert.conditions.wind import provisos, pushed
from tubecert.enclosure.interval import Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class NoGains:
    """The proof of theorem 0: it needs nothing beyond the constants."""


@quiet
def ultimate(n: Numbers[T]) -> T:
    """A1 = (beta Dh + delta)/lambda: what d tends to at most, (4.0)."""
    return (n.beta * n.Dh + pushed(n)) / n.lam


@quiet
def supremum(n: Numbers[T]) -> T:
    """sup D over the horizon: D is monotone, from d0 to A1, (4.0)."""
    if n.horizon is None:
        return maximum(n.d0, ultimate(n))
    # D(T), with both ends positive: no difference is taken
    left, mean = exp(-n.lam * n.horizon), decay_mean(n.lam * n.horizon)
    return maximum(n.d0, n.d0 * left + (n.beta * n.Dh + pushed(n)) * n.horizon * mean)


@quiet
def largest_uncertainty(n: Numbers[T]) -> T:
    """The Dh for which sup D reaches dbar, if d0 does not: (lambda dbar - delta)/beta, more on a finite horizon.

    Theory 4a.
    """
    if n.horizon is None:
        return (n.lam * reach(n) - pushed(n)) / n.beta
    left, mean = exp(-n.lam * n.horizon), decay_mean(n.lam * n.horizon)
    return ((reach(n) - n.d0 * left) / (n.horizon * mean) - pushed(n)) / n.beta


def _margin(n: Numbers[Interval]) -> Interval:
    """1 - sup D/dbar of theorem 0."""
    return (1 - supremum(n) / reach(n)).sanitised()


def margin_alone(problem: TubeProblem, recipes: Sequence[NoGains]) -> Interval:
    """The margin of dbar, shape `(len(recipes),)`: the same for each, theorem 0."""
    low, high = _margin(problem.proven()).lo, _margin(problem.enclosed()).hi
    one = np.ones(len(recipes))
    return Interval(low * one, np.maximum(low, high) * one)


def distance(problem: TubeProblem) -> Interval:
    """sup D: proven from above; from below what no constants within their enclosures go under, (4.0)."""
    high = supremum(problem.proven()).hi
    return Interval(np.minimum(supremum(problem.enclosed()).lo, high), high)


def uncertainty_limit(problem: TubeProblem) -> float | None:
    """The feedback alone holds for every |h| below this, in units of the input; None if for none, or for any.

    Theory 4a.
    """
    n = problem.proven()
    limit = float(largest_uncertainty(n).lo)
    return limit if np.isfinite(limit) and limit > 0 and bool(n.d0.hi < reach(n).lo) else None


def ultimate_radius(problem: TubeProblem, recipe: NoGains) -> float:
    """A1/sqrt(a): |x - x*| is at most this in the long run, proven: D -> A1 of (4.0)."""
    del recipe
    n = problem.proven()
    return float((ultimate(n) / sqrt(n.a)).hi)


def input_shares(problem: TubeProblem, recipe: NoGains) -> InputShares | None:
    """u = u* + k with |k| <= du sup D."""
    del recipe
    n = problem.proven()
    return shares(n, supremum(n), None)


def _formula(problem: TubeProblem, n: Numbers[Array]) -> object:
    """Everything that theorem 0 compares."""
    del problem
    return supremum(n) < reach(n)


THEOREM = Theorem(
    recipe=NoGains,
    margins=lambda problem, recipes: {"no_adaptation": margin_alone(problem, recipes)},
    ceilings=lambda problem, recipe: {"no_adaptation": float(_margin(problem.enclosed()).hi)},
    formula=_formula,
    obstacles=obstacles,
    provisos=provisos,
    ultimate=ultimate_radius,
    inputs=input_shares,
)
