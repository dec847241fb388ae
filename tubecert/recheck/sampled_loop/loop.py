"""The linear sampled loop of an error equation, enclosed: its matrices over one sample, and at times within one.

xi = (e, zeta, v_1..v_b, eta): the error, the controller's memory, the deltas of the b samples before (which the delay
keeps waiting), the slow signals. Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb_mat

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.sampled_loop.exponential import flow, identity, joined, zeros


@dataclass(frozen=True)
class Loop:
    """A (n, n), B (n, m), H (n, r); tables F (z, z), G (z, n), M (m, z), N (m, n); times in s."""

    A: arb_mat
    B: arb_mat
    H: arb_mat
    F: arb_mat
    G: arb_mat
    M: arb_mat
    N: arb_mat
    sample: Fraction
    delay: Fraction

    @property
    def n(self) -> int:
        """States."""
        return self.A.nrows()

    @property
    def m(self) -> int:
        """Inputs."""
        return self.B.ncols()

    @property
    def z(self) -> int:
        """States of the controller."""
        return self.F.nrows()

    @property
    def r(self) -> int:
        """Slow signals."""
        return self.H.ncols()

    @property
    def whole(self) -> int:
        """Q: whole samples of delay."""
        return int(self.delay // self.sample)

    @property
    def rest(self) -> Fraction:
        """tau': what is left of the delay."""
        return self.delay - self.whole * self.sample

    @property
    def waiting(self) -> int:
        """b: deltas of earlier samples that act in an interval, or later."""
        return self.whole + (self.rest > 0)

    @property
    def acting(self) -> tuple[int, ...]:
        """How many samples ago the deltas were made that act in an interval."""
        return (self.whole, self.whole + 1) if self.rest else (self.whole,)

    @property
    def width(self) -> int:
        """Entries of xi."""
        return self.n + self.z + self.waiting * self.m + self.r

    def nodes(self, pieces: int) -> list[Fraction]:
        """Times of a sample between which nothing jumps: `pieces` equal parts, and tau'."""
        return sorted({self.sample * Fraction(a, pieces) for a in range(pieces + 1)} | {self.rest})

    # -- e(t_k + s) = error(s) xi_k + heard(s) (N n_k + rounding of u_k) + integrals

    def heard(self, s: Ball, later: bool) -> arb_mat:
        """What of delta_k the error has at s, (n, m): nothing where it acts in a later interval."""
        return zeros(self.n, self.m) if self.whole else self._now(s, later)

    def error(self, s: Ball, later: bool) -> arb_mat:
        """The rows of e(t_k + s) at xi_k, (n, width); `later`: s is not before tau'."""
        own, steady = flow(self.A, s)
        return self._rows(own, self._before(s, later), self._now(s, later), steady * self.H)

    def error_rate(self, s: Ball, later: bool) -> arb_mat:
        """d error/ds."""
        B, none = self.B, zeros(self.n, self.m)
        acting = (none, B) if later else (B, none)
        return self.A * self.error(s, later) + self._rows(zeros(self.n, self.n), *acting, self.H)

    def heard_rate(self, s: Ball, later: bool) -> arb_mat:
        """d heard/ds."""
        moved = self.A * self.heard(s, later)
        return moved + self.B if later and not self.whole else moved

    def _before(self, s: Ball, later: bool) -> arb_mat:
        """int over the part of [0, s] before tau' of e^(A (s - r)) B dr."""
        steady = flow(self.A, s)[1]
        return (steady - flow(self.A, s - exact(self.rest))[1] if later else steady) * self.B

    def _now(self, s: Ball, later: bool) -> arb_mat:
        """The same over the part after tau'."""
        return flow(self.A, s - exact(self.rest))[1] * self.B if later else zeros(self.n, self.m)

    def _rows(self, own: arb_mat, before: arb_mat, now: arb_mat, steady: arb_mat) -> arb_mat:
        """Of e, what acts before and after tau' at its place, and eta."""
        waiting = [zeros(self.n, self.m) for _ in range(self.waiting)]
        if self.rest:
            waiting[self.whole] = before
        if self.whole:
            waiting[self.whole - 1] = now
            return joined([[own, zeros(self.n, self.z), *waiting, steady]])
        return joined([[own + now * self.N, now * self.M, *waiting, steady]])

    # -- from sample to sample

    @cached_property
    def delta(self) -> arb_mat:
        """The rows of delta_k at xi_k, (m, width)."""
        return self._stacked(self.N, self.M, zeros)

    @cached_property
    def memory(self) -> arb_mat:
        """The rows of zeta at its own sample, (z, width)."""
        return self._stacked(zeros(self.z, self.n), identity(self.z), zeros)

    @cached_property
    def step(self) -> arb_mat:
        """AA: from xi_k to xi_(k+1), (width, width)."""
        n, m, b, r = self.n, self.m, self.waiting, self.r
        moved = self._stacked(self.G, self.F, zeros)
        kept = [
            joined([[zeros(m, n + self.z + i * m), identity(m), zeros(m, (b - 1 - i) * m + r)]])
            for i in range(b - 1)
        ]
        slow = joined([[zeros(r, n + self.z + b * m), identity(r)]])
        first = [self.delta] if b else []
        rows = [self.error(exact(self.sample), True), moved, *first, *kept, slow]
        return joined([[row] for row in rows])

    @cached_property
    def arriving(self) -> arb_mat:
        """What noise n_k, rounding of u_k and of zeta_(k+1) do to xi_(k+1), (width, n + m + z)."""
        n, m, z, b = self.n, self.m, self.z, self.waiting
        heard, none = self.heard(exact(self.sample), True), zeros(m, z)
        rows = [[heard * self.N, heard, zeros(n, z)], [self.G, zeros(z, m), identity(z)]]
        rows += [[self.N, identity(m), none]] if b else []
        left = max(b - 1, 0) * m + self.r
        return joined([*rows, [zeros(left, n), zeros(left, m), zeros(left, z)]])

    def _stacked(self, e: arb_mat, zeta: arb_mat, rest: Callable[[int, int], arb_mat]) -> arb_mat:
        return joined([[e, zeta, rest(e.nrows(), self.waiting * self.m + self.r)]])
