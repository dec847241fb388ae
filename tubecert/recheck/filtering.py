"""What filtering does: the kernels and the supremum of the distance bound D(t), on balls.

Implements: theory (2.15)-(2.19). Where a ball cannot decide a case, a bound that holds in every case is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import arb

from tubecert.recheck.balls import Ball, larger, smaller


def log_ratio(x: Ball) -> Ball:
    """log(1 + x)/x, 1 at 0; it falls with x, the r of (2.16)."""
    if x.is_zero():
        return arb(1)
    if not x.contains(0):
        return x.log1p() / x
    ends = [y.log1p() / y if y != 0 else arb(1) for y in (x.lower(), x.upper())]
    return ends[0].union(ends[1])


def kappa(c: Ball, w: Ball) -> Ball:
    """sup_t |e^(-wt) - e^(-ct)|/|c - w| (2.17)."""
    return (-(w / c) * log_ratio((w - c) / c)).exp() / c


def tight_kernel(c: Ball, w: Ball, s0: Ball, s1: Ball) -> Ball:
    """J(c, w, s0, s1) (2.19)."""
    slow = s1 / (c * w)
    room = smaller(c, w) * s0 - s1
    if room <= 0:
        return slow
    # what the initial value adds is 0 if room <= 0, else at most s0 kappa, and at most room/(c w): with p = w s0 - s1
    # it is q (q/p)^(c/(w-c)) <= q = room over c w if c < w, and q (p/q)^(c/(c-w)) <= p = room if c > w
    most = smaller(s0 * kappa(c, w), larger(room, arb(0)) / (c * w))
    always = slow.union(slow + most)
    q = c * s0 - s1
    if room > 0:
        exact = (s1 + q * (-(c * s0 / q) * log_ratio((w - c) * s0 / q)).exp()) / (c * w)
        return exact if exact.is_finite() else always
    return always


@dataclass(frozen=True, slots=True, kw_only=True)
class Distance:
    """D(t) of (2.15); `horizon` None is for ever."""

    d0: Ball
    beta: Ball
    H0: Ball
    S: Ball
    e: Ball
    delta: Ball
    rate: Ball
    omega: Ball
    horizon: Ball | None

    def ultimate(self) -> Ball:
        """A1, (2.15)."""
        return (self.beta * (self.S + self.e) + self.delta) / self.rate

    def supremum(self) -> Ball:
        """sup D (2.16), an upper bound."""
        A1, C1 = self.ultimate(), self.beta * (self.H0 - self.S)
        start = self.d0 - A1
        D1 = self.omega - self.rate
        last = A1 if self.horizon is None else self.at(self.horizon)
        ends = larger(self.d0, last)
        if C1 <= 0 or self.rate * start >= C1:
            return ends
        z = start / C1
        inside = 1 + z * D1
        if inside <= 0:
            return ends
        most = kappa(self.rate, self.omega)
        weak = larger(self.d0, A1) + larger(C1, arb(0)) * most
        # without its last part D is monotone: at most d0, or what it is in the end without that part
        weak = smaller(weak, ends + 2 * abs(C1) * most)
        if not (inside > 0 and C1 > 0 and self.rate * start < C1):
            return larger(ends, weak)
        t1 = log_ratio(D1 / self.rate) / self.rate - z * log_ratio(z * D1)
        if self.horizon is None:
            peak = A1 + (-self.rate * t1).exp() * (C1 + start * D1) / self.omega
        else:
            peak = self.at(larger(arb(0), smaller(t1, self.horizon)))
        return larger(ends, peak) if peak.is_finite() else larger(ends, weak)

    def at(self, t: Ball) -> Ball:
        """D(t), (2.15)."""
        A1, C1 = self.ultimate(), self.beta * (self.H0 - self.S)
        slow, fast = (-self.rate * t).exp(), (-self.omega * t).exp()
        D1 = self.omega - self.rate
        # a mean value: t times something between both
        K = t * slow.union(fast) if D1.contains(0) else (slow - fast) / D1
        return A1 + (self.d0 - A1) * slow + C1 * K
