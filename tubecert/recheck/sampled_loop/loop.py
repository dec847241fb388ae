"""The linear sampled loop of an error equation, enclosed: e^(A t), and the loop over one sample, and within one.

xi = (e, zeta, v_1..v_b, eta): the error, the controller's memory, the deltas of the b samples before (which the delay
keeps waiting), the slow signals. What is heard at a sample stands beside it: noise and rounding of dy, then rounding
of u and of zeta. Rows are those of (xi_k, heard_k). Implements: theory of the sampled loop, sections 2 and 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import accumulate, pairwise

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, exact


def picked(rows: range, size: int) -> arb_mat:
    """Rows of the unit matrix of a size."""
    return arb_mat(len(rows), size, [int(i == j) for i in rows for j in range(size)])


def column(entries: Sequence[Ball]) -> arb_mat:
    """A matrix of one column."""
    return arb_mat(len(entries), 1, list(entries))


def joined(blocks: Sequence[Sequence[arb_mat]]) -> arb_mat:
    """A matrix of blocks: those of one row are equally high, those of one column equally wide."""
    lines = [line for row in blocks for line in zip(*(block.tolist() for block in row), strict=True)]
    width = sum(block.ncols() for block in blocks[0])
    return arb_mat(len(lines), width, [x for line in lines for part in line for x in part])


def stacked(parts: Sequence[arb_mat]) -> arb_mat:
    """A matrix of all rows."""
    return joined([[own] for own in parts])


def parted(a: arb_mat, at: int) -> tuple[arb_mat, arb_mat]:
    """The columns before one, and the others."""
    left, right = ([x for row in a.tolist() for x in row[part]] for part in (slice(at), slice(at, None)))
    return arb_mat(a.nrows(), at, left), arb_mat(a.nrows(), a.ncols() - at, right)


def sizes(a: arb_mat) -> arb_mat:
    """The entries' largest magnitudes."""
    return arb_mat(a.nrows(), a.ncols(), [x.abs_upper() for x in a.entries()])


def around_zero(a: arb_mat) -> arb_mat:
    """Balls around 0 as large as the entries: r times such a column is a ball around 0 as large as |r| times it."""
    return arb_mat(a.nrows(), a.ncols(), [arb(0, x.abs_upper()) for x in a.entries()])


class Loop:
    """A (n, n), B (n, m), H (n, r); tables F (z, z), G (z, n), M (m, z), N (m, n); sample time and delay in s.

    `whole` samples of delay, Q, and the `rest` tau'; `waiting`, b: of how many earlier samples a delta acts or waits.
    `parts`: rows that pick e (n), zeta (z), v_1..v_b (m each), eta (r), which are the `width` entries of xi; what is
    heard of dy (n), u (m), zeta (z). `sent`: rows of delta_k, v_1, .., v_b, (m, ..) each.
    """

    def __init__(
        self, A: arb_mat, B: arb_mat, H: arb_mat, tables: Sequence[arb_mat], times: tuple[Fraction, Fraction]
    ) -> None:
        (F, G, M, N), (sample, delay) = tables, times
        self.A, self.B, self.H, self.sample = A, B, H, sample
        self.whole, self.rest = divmod(delay, sample)
        self.waiting = self.whole + (self.rest > 0)
        n, m, z = A.nrows(), B.ncols(), F.nrows()
        ends = [0, *accumulate([n, z, *[m] * self.waiting, H.ncols(), n, m, z])]
        self.parts, self.width = [picked(range(a, b), ends[-1]) for a, b in pairwise(ends)], ends[-4]
        e, zeta, *waiting, _, heard, rounded, lost = self.parts
        self.sent = [N * (e + heard) + M * zeta + rounded, *waiting]
        self._kept = G * (e + heard) + F * zeta + lost

    def flow(self, t: Ball, order: int = 0) -> arb_mat:
        """e^(S t) with S = [A H B; 0 0 0; 0 0 0], or its derivative of an order, for every t of the ball.

        It moves (e, eta, a held input): with P = e^(A t) and J its integral, e^(S t) = [P JH JB; 0 I 0; 0 0 I].
        """
        rates = joined([[self.A, self.H, self.B]])
        rates = stacked([rates, arb_mat(rates.ncols() - rates.nrows(), rates.ncols())])
        found = (rates * t).exp()
        for _ in range(order):
            found = rates * found
        return found

    def error(self, s: Ball, order: int = 0, *, later: bool) -> arb_mat:
        """Rows of e(t_k + s), (n, ..), but for what acts on it from t_k on; or their derivative of an order.

        `later`: s is not before tau'.
        """
        e, eta, before, now = self.parts[0], self.parts[-4], self.sent[-1], self.sent[self.whole]
        found = self.flow(s, order) * stacked([e, eta, before])
        if later:
            found += self.flow(s - exact(self.rest), order) * stacked([0 * e, 0 * eta, now - before])
        return picked(range(e.nrows()), found.nrows()) * found

    @property
    def step(self) -> arb_mat:
        """Those of xi_(k+1), (width, ..): AA, and NN."""
        moved, eta = self.error(exact(self.sample), later=True), self.parts[-4]
        return stacked([moved, self._kept, *self.sent[:-1], eta])
