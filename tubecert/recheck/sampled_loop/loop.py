"""The linear sampled loop of an error equation, enclosed: its matrices over one sample, and at times within one.

xi = (e, zeta, v_1..v_b, eta): the error, the controller's memory, the deltas of the b samples before (which the delay
keeps waiting), the slow signals. Rows are those of (xi_k, w_k): w_k is what noise and rounding add to delta_k at once.
Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

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
    def shape(self) -> tuple[int, int, int, int, int]:
        """n, m, z, b, r: states, inputs, memory of the controller, earlier samples that act or wait, slow signals."""
        n, m, z, r = self.A.nrows(), self.B.ncols(), self.F.nrows(), self.H.ncols()
        return n, m, z, self.whole + (self.rest > 0), r

    @property
    def width(self) -> int:
        """Entries of xi."""
        n, m, z, b, r = self.shape
        return n + z + b * m + r

    @property
    def whole(self) -> int:
        """Q: whole samples of delay."""
        return int(self.delay // self.sample)

    @property
    def rest(self) -> Fraction:
        """tau': what is left of the delay."""
        return self.delay - self.whole * self.sample

    def nodes(self, pieces: int) -> list[Fraction]:
        """Times of a sample between which nothing jumps: `pieces` equal parts, and tau'."""
        return sorted({self.sample * Fraction(a, pieces) for a in range(pieces + 1)} | {self.rest})

    # -- within a sample: rows of e(t_k + s), without what acts on it from t_k on; `later`: s is not before tau'

    def error(self, s: Ball, *, later: bool) -> arb_mat:
        """The rows, (n, width + m)."""
        own, steady = flow(self.A, s)
        now = flow(self.A, s - exact(self.rest))[1] * self.B if later else 0 * self.B
        return self._rows(own, steady * self.B - now, now, steady * self.H)

    def error_rate(self, s: Ball, *, later: bool) -> arb_mat:
        """Their derivatives by s."""
        now = self.B if later else 0 * self.B
        return self.A * self.error(s, later=later) + self._rows(0 * self.A, self.B - now, now, self.H)

    def _rows(self, own: arb_mat, before: arb_mat, now: arb_mat, steady: arb_mat) -> arb_mat:
        """Of e, of what acts before and after tau' at its place, of eta."""
        n, m, _, b, _ = self.shape
        waiting = [zeros(n, m)] * b
        if self.rest:
            waiting[self.whole] = before
        if self.whole:
            waiting[self.whole - 1], now = now, zeros(n, m)
        return joined([[own + now * self.N, now * self.M, *waiting, steady, now]])

    # -- from sample to sample

    @property
    def delta(self) -> arb_mat:
        """The rows of delta_k, (m, width + m)."""
        _, m, _, b, r = self.shape
        return joined([[self.N, self.M, zeros(m, b * m + r), identity(m)]])

    @property
    def memory(self) -> arb_mat:
        """The rows of zeta at its own sample, (z, width + m)."""
        n, m, z, b, r = self.shape
        return joined([[zeros(z, n), identity(z), zeros(z, b * m + r + m)]])

    @property
    def step(self) -> arb_mat:
        """Those of xi_(k+1), (width, width + m): AA, and what w_k does."""
        n, m, z, b, r = self.shape
        moved = [self.G, self.F, zeros(z, b * m + r + m)]
        kept = max(b - 1, 0) * m  # v_i becomes v_(i+1)
        waiting = [zeros(kept, n + z), identity(kept), zeros(kept, m + r + m)]
        slow = [zeros(r, n + z + b * m), identity(r), zeros(r, m)]
        sent = [[self.delta]] if b else []
        return joined([[self.error(exact(self.sample), later=True)], moved, *sent, waiting, slow])

    def shaken(self, heard: arb_mat) -> arb_mat:
        """What rounding of dy_k (n), of u_k (m), of zeta_(k+1) (z), and noise (n) do through columns at w_k."""
        seen = heard * self.N
        return joined([[seen, heard, zeros(heard.nrows(), self.shape[2]), seen]])

    def arriving(self, heard: arb_mat) -> arb_mat:
        """What they do to xi_(k+1), (width, n + m + z + n); `heard`: the columns of `step` at w_k."""
        n, m, z, _, _ = self.shape
        every = n + m + z + n
        stored = joined([[self.G, zeros(z, m), identity(z), self.G]])
        return self.shaken(heard) + joined([[zeros(n, every)], [stored], [zeros(self.width - n - z, every)]])
