"""What filtering does: suprema over time of the distance bound D(t) and of the kernels inside it.

Closed forms with removable singularities at omega = c taken out by r(x) = log(1 + x)/x. Every supremum is
nondecreasing in the sizes that enter (distances, bounds on h and its rate, errors), so interval arguments are
evaluated at their end points: no width is lost to a size that occurs twice.
Implements: theory sections 2 (kappa, J) and 4 (sup D).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic

from tubecert.conditions.arithmetic import (
    T,
    absolute,
    choose,
    confined,
    decay_mean,
    exp,
    expm1,
    log1p_ratio,
    maximum,
    minimum,
    number,
    quiet,
)
from tubecert.enclosure.interval import Interval


@quiet
def kappa(c: T, w: T) -> T:
    """sup_t |e^(-wt) - e^(-ct)|/|c - w| = (1/c) (c/w)^(w/(w-c)), and 1/(e c) at w = c, (2.17)."""
    return exp(-(w / c) * log1p_ratio((w - c) / c)) / c


@quiet
def tight_kernel(c: T, w: T, s0: T, s1: T) -> T:
    """J(c, w, s0, s1): the exact sup over t and admissible h of the filtered uncertainty seen at rate c, (2.19).

    |h| <= s0 at the start and |dh/dt| <= s1 afterwards. Nondecreasing in s0 and s1, decreasing in w.
    """
    if isinstance(s0, Interval):
        below = _tight_kernel(c, w, Interval.exact(s0.lo), Interval.exact(s1.lo))
        above = _tight_kernel(c, w, Interval.exact(s0.hi), Interval.exact(s1.hi))
        return Interval(below.lo, above.hi).sanitised()
    return _tight_kernel(c, w, s0, s1)


def _tight_kernel(c: T, w: T, s0: T, s1: T) -> T:
    """(2.19) with s0 and s1 at an end of their enclosures."""
    slow = s1 / (c * w)
    q = c * s0 - s1
    peak = slow + q * exp(-(c * s0 / q) * log1p_ratio((w - c) * s0 / q)) / (c * w)
    # In every case slow <= J <= slow + s0 kappa, and J <= slow + max(0, r)/(c w) with r = min(c, w) s0 - s1:
    # q (q/p)^(c/(w-c)) is q times a number below 1 if c < w, and q (p/q)^(c/(c-w)) <= p otherwise. These limit the
    # damage where the sign of q is undecided.
    room = minimum(c, w) * s0 - s1
    peak = confined(peak, slow, slow + minimum(s0 * kappa(c, w), maximum(number(0, slow), room) / (c * w)))
    return choose(room, peak, slow)


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceBound(Generic[T]):
    """D(t) = A1 + (d0 - A1) e^(-lam t) + C1 K(t) with A1 = (beta (S + e) + delta)/lam and C1 = beta (H0 - S).

    The solution of D' = -lam D + beta (e^(-omega t) H0 + (1 - e^(-omega t)) S + e) + delta, D(0) = d0;
    K(t) = (e^(-lam t) - e^(-omega t))/(omega - lam). A `horizon` of None is [0, infinity).
    """

    d0: T
    beta: T
    H0: T
    S: T
    e: T
    delta: T
    lam: T
    omega: T
    horizon: T | None = None

    def ultimate(self) -> T:
        """A1, the limit of D(t), (2.15)."""
        return (self.beta * (self.S + self.e) + self.delta) / self.lam

    @quiet
    def at(self, t: T) -> T:
        """D(t); nondecreasing in d0, beta, H0, S, e and delta, (2.15)."""
        return _at(self, t)

    @quiet
    def supremum(self) -> T:
        """The largest D(t) over the horizon; nondecreasing in d0, beta, H0, S, e and delta, (2.16)."""
        if isinstance(self.d0, Interval):
            below, above = _supremum(_end(self, "lo")), _supremum(_end(self, "hi"))
            return Interval(below.lo, above.hi).sanitised()
        return _supremum(self)


def _end(D: DistanceBound[Any], side: str) -> DistanceBound[Interval]:
    """The same with every size at its lower ("lo") or upper ("hi") end; lam and omega stay enclosures."""
    sizes = ("d0", "beta", "H0", "S", "e", "delta")
    return replace(D, **{name: Interval.exact(getattr(getattr(D, name), side)) for name in sizes})


def _at(D: DistanceBound[T], t: T) -> T:
    """D(t), with K(t) = e^(-m t) t (1 - e^(-y))/y, m = min(lam, omega), y = |omega - lam| t, (2.15)."""
    slower = minimum(D.lam, D.omega)
    K = exp(-slower * t) * t * decay_mean(absolute(D.omega - D.lam) * t)
    return _monotone(D, t) + D.beta * (D.H0 - D.S) * K


def _monotone(D: DistanceBound[T], t: T) -> T:
    """D(t) without C1 K(t): it goes from d0 towards A1, (2.15)."""
    return D.d0 * exp(-D.lam * t) - D.ultimate() * expm1(-D.lam * t)


def _supremum(D: DistanceBound[T]) -> T:
    """(2.16), with every size at an end of its enclosure."""
    A1 = D.ultimate()
    C1 = D.beta * (D.H0 - D.S)
    D1 = D.omega - D.lam
    zero = number(0, A1)
    z = (D.d0 - A1) / C1
    t1 = log1p_ratio(D1 / D.lam) / D.lam - z * log1p_ratio(z * D1)
    last = limit = A1
    if D.horizon is None:
        peak = A1 + exp(-D.lam * t1) * (C1 + (D.d0 - A1) * D1) / D.omega
    else:
        last, limit = _at(D, D.horizon), _monotone(D, D.horizon)
        peak = _at(D, maximum(zero, minimum(t1, D.horizon)))
    ends = maximum(D.d0, last)
    # D without C1 K is monotone; so this holds in every case, and bounds what an interval cannot decide, as for H0 = S
    weak = maximum(D.d0, limit) + maximum(C1, zero) * kappa(D.lam, D.omega)
    peak = confined(maximum(ends, peak), ends, weak)
    # D rises from d0 to an interior maximum iff C1 > max(0, lam (d0 - A1)) and 1 + z D1 > 0
    rises = C1 - maximum(zero, D.lam * (D.d0 - A1))
    interior = choose(rises, 1 + z * D1, -absolute(rises))
    return choose(interior, peak, ends)
