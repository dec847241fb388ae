"""How outputs of the loop answer to every signal, lag by lag: rows of floats, what they miss, integrals of kernels.

An output is a row c of xi = (e, zeta, v_1..v_(q+1), eta) and of what is heard at a sample, (y, u, zeta): noise and
roundings. Rows r_0 = c, r_1, .. are any floats ("free rows"): r_i misses r_(i-1) AA by a defect that meets the box of
xi. Proposed by powers of AA, believed by the defect. Trusted: yes.
Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import accumulate, pairwise
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.sampled_loop.matrices import Exponential, product, stacked, total
from tubecert.sampled_loop.record import Tables
from tubecert.sampled_loop.setting import Loop

_AT_ONCE: Final = 400_000  # entries of a batch of rows


class Dynamics:
    """The loop from sample to sample, and within one: rows of (xi, heard), of `width` and n + m + z columns."""

    def __init__(self, loop: Loop, controller: Tables) -> None:
        self.loop, self.exponential, c = loop, Exponential(loop.A), controller
        n, m, z, past = loop.states, loop.inputs, c.size, loop.whole + 1
        ends = [0, *accumulate([n, z, *[m] * past, loop.H.shape[1], n, m, z])]
        self.width = ends[-4]
        unit = np.eye(ends[-1])
        self._e, zeta, *waiting, self._eta, heard, rounded, lost = (unit[a:b] for a, b in pairwise(ends))
        self.memory = zeta
        self.sent = [c.N @ (self._e + heard) + c.M @ zeta + rounded, *waiting]  # delta_k, v_1, ..
        self._kept = c.G @ (self._e + heard) + c.F @ zeta + lost

    def error(self, s: Fraction) -> Interval:
        """c_s: e at a time s of a sample, (n, ..)."""
        loop, until = self.loop, min(s, self.loop.rest)
        newer, older = self.sent[loop.whole : loop.whole + 2]
        phi, whole = self.exponential.at(s)
        B, (after, since) = Interval.exact(loop.B), self.exponential.at(s - until)
        held = product(after, product(self.exponential.at(until)[1], B))
        maps = stacked([[phi, product(whole, Interval.exact(loop.H)), held, product(since, B)]])
        return product(maps, Interval.exact(np.vstack([self._e, self._eta, older, newer])))

    def slope(self, s: Fraction) -> Interval:
        """c_s' = A c_s + B (what acts) + H eta, at a time that is not tau'."""
        acting = self.sent[self.loop.whole + (s < self.loop.rest)]
        rows = stacked([[self.error(s)], [Interval.exact(np.vstack([self._eta, acting]))]])
        return product(Interval.exact(np.hstack([self.loop.A, self.loop.H, self.loop.B])), rows)

    def step(self) -> Interval:
        """Xi at the next sample: AA, and how what is heard enters, (width, ..)."""
        rows = np.vstack([self._kept, *self.sent[:-1], self._eta])
        return stacked([[self.error(self.loop.sample_time)], [Interval.exact(rows)]])


class Acting:
    """What acts all the time does from the beginning of a sample up to a time: int |r G(s)| ds, by the trapezoid.

    In this order: winds, as they are; rho and eta by their components; eta by its rate. G is Phi K, of the rate J H.
    On a panel of length d the integral is at most that of the chord, d (|r G(a)| + |r G(b)|)/2, and d^3/12 sup|r G''|;
    G'' is A^2 Phi K or A Phi H, and |Phi(s - mid)| <= e^(|A| d/2) entry by entry (theory, 3.5).
    """

    def __init__(self, dynamics: Dynamics, until: Fraction, panels: int) -> None:
        own, loop = dynamics.exponential, dynamics.loop
        A, self._winds, self._rates = Interval.exact(loop.A), loop.sudden, loop.H.shape[1]
        K, H = Interval.exact(np.hstack([*(each for each, _ in self._winds), loop.R, loop.H])), loop.H
        parts = max(1, ceil(panels * until / loop.sample_time))
        self._at: list[tuple[float, Interval]] = []
        self._bent = np.zeros((loop.states, K.lo.shape[1] + self._rates))
        for a, b in pairwise(until * k / parts for k in range(parts + 1)):
            d = fraction_bounds(b - a)[1]
            for phi, whole in map(own.at, (a, b)):
                self._at.append((0.5 * d, stacked([[product(phi, K), product(whole, Interval.exact(H))]])))
            turned = product(A, product(own.at((a + b) / 2)[0], K))
            second = stacked([[product(A, turned), turned[:, K.lo.shape[1] - self._rates :]]]).magnitude
            self._bent += d**3 / 12 * total(swelling(loop.A, (b - a) / 2), second)

    def of(self, rows: Array, eta: Array | None = None) -> Array:
        """For rows (N, n) of e, and (N, r) of eta: (N, 1 + n + m + r + r)."""
        found = self.sized(total(np.abs(rows), self._bent))
        for weight, G in self._at:
            value = product(Interval.exact(rows), G)
            if eta is not None:
                whole = np.pad(eta, ((0, 0), (self._bent.shape[1] - self._rates, 0)))
                value = value + Interval.exact(whole)
            found += weight * self.sized(value.magnitude)
        return np.asarray(found)

    def sized(self, columns: Array) -> Array:
        """Numbers that are not negative, winds weighed by how large they are."""
        wind = np.zeros(len(columns))
        for K, size in self._winds:
            own, columns = np.split(columns, [K.shape[1]], axis=1)
            wind = wind + size.weigh(own)
        return np.column_stack([wind, columns])


def swelling(A: Array, s: Fraction) -> Array:
    """e^(|A| s), (n, n), from above."""
    return Exponential(np.abs(A)).at(s)[0].magnitude


class Responses:
    """The answers of all outputs over `lags` L; rows are those of e at every node of a sample, delta, zeta.

    What counts stands side by side: noise and wind, as they are; by their sizes roundings (n + m + z) and rho (n + m),
    with which `passing` ends; xi (a + r); the rate of eta (r). Sums over lags 0..k-1 stand at index k, k = 0..L: `past`
    (L + 1, R, passing), `rate` and `size` (L + 1, R, r) of eta. `rows` (L + 1, R, a + r) are the free rows. `now`
    (R, ..): what enters directly, and all that the rows miss, with the radii of the outputs; `direct` (nodes, n, ..):
    what acts within the sample up to a node; `pieces` (.., n, ..): how far e between two of them is from the chord.
    """

    def __init__(self, loop: Loop, controller: Tables, *, lags: int, pieces: int, panels: int) -> None:
        self.loop, self.controller, self.lags = loop, controller, lags
        self.dynamics = own = Dynamics(loop, controller)
        n, self._r = loop.states, loop.H.shape[1]
        Ts, step = loop.sample_time, own.step()
        self.nodes = sorted({*(Ts * k / pieces for k in range(pieces + 1)), loop.rest})
        outputs = [*map(own.error, self.nodes), *map(Interval.exact, (own.sent[0], own.memory))]
        first = stacked([[rows] for rows in outputs])
        self.rows = self._proposed(first.mid[:, : own.width], step.mid[:, : own.width])
        missed = first.rad[:, : own.width] + self._missed(step[:, : own.width])
        self.now = self._counted(len(missed), xi=missed, heard=first[:, own.width :].magnitude)
        self.passing = self.now.shape[1] - own.width - self._r
        acting, heard = Acting(own, Ts, panels), step[:, own.width :]
        each = np.concatenate([self._entered(self.rows[part], acting, heard) for part in self._batches()])
        sums = np.concatenate([np.zeros_like(each[:1]), np.cumsum(each, axis=0)])
        parts = np.split(sums, [self.passing, self.passing + self._r], axis=2)
        self.past, self.rate, self.size = map(np.ascontiguousarray, parts)
        reached = (Acting(own, s, panels).of(np.eye(n)) for s in self.nodes)
        self.direct = np.stack([self._counted(n, acting=each) for each in reached])
        self.pieces = np.stack([self._piece(acting, a, b) for a, b in pairwise(self.nodes)])

    def _counted(
        self, count: int, xi: Array | None = None, heard: Array | None = None, acting: Array | None = None
    ) -> Array:
        """Side by side (count, ..), what is not given as 0."""
        n, m, r, width = self.loop.states, self.loop.inputs, self._r, self.dynamics.width
        heard = np.zeros((count, n + m + self.controller.size)) if heard is None else heard
        acting = np.zeros((count, 1 + n + m + 2 * r)) if acting is None else acting
        xi = np.zeros((count, width)) if xi is None else xi
        wind, rho, _, rate = np.split(acting, [1, 1 + n + m, 1 + n + m + r], axis=1)
        return np.hstack([self.loop.noise.weigh(heard[:, :n])[:, None], wind, heard, rho, xi, rate])

    @property
    def eta(self) -> Array:
        """The entries of the free rows for eta, (L + 1, R, r)."""
        return self.rows[:, :, self.dynamics.width - self._r :]

    def _proposed(self, first: Array, step: Array) -> Array:
        """r_0..r_L, (L + 1, R, a + r)."""
        rows = first[None]
        with np.errstate(all="ignore"):  # rows that overflow prove nothing
            while len(rows) <= self.lags:
                rows, step = np.concatenate([rows, rows @ step]), step @ step
        return rows[: self.lags + 1]

    def _missed(self, step: Interval) -> Array:
        """sum_i |r_(i-1) AA - r_i|, (R, a + r)."""
        missed = np.zeros(self.rows[0].shape)
        for part in self._batches():
            before, after = self.rows[part], self.rows[part.start + 1 : part.stop + 1]
            off = product(Interval.exact(before.reshape(-1, before.shape[2])), step)
            off = off - Interval.exact(after.reshape(off.lo.shape))
            missed += np.sum(off.magnitude.reshape(after.shape), axis=0)
        return missed

    def _batches(self) -> list[slice]:
        size = max(1, _AT_ONCE // self.rows[0].size)
        return [slice(start, min(start + size, self.lags)) for start in range(0, self.lags, size)]

    def _entered(self, rows: Array, acting: Acting, heard: Interval) -> Array:
        """What the signals of each lag count, side by side: those that pass, the rate of eta, and its size."""
        flat, r = rows.reshape(-1, rows.shape[2]), self._r
        jumps = product(Interval.exact(flat), heard).magnitude
        acted = acting.of(
            np.ascontiguousarray(flat[:, : self.loop.states]), flat[:, self.dynamics.width - r :]
        )
        passing = self._counted(len(flat), heard=jumps, acting=acted)[:, : self.passing]
        size, rate = np.split(acted[:, acted.shape[1] - 2 * r :], 2, axis=1)
        return np.hstack([passing, rate, size]).reshape(*rows.shape[:2], -1)

    def _piece(self, acting: Acting, a: Fraction, b: Fraction) -> Array:
        """How far e is from its chord between two nodes (theory, 3.4)."""
        loop, own = self.loop, self.dynamics
        d, middle, r = fraction_bounds(b - a)[1], (a + b) / 2, self._r
        turned = d * d / 8 * swelling(loop.A, (b - a) / 2)
        share = total(np.abs(loop.A), turned)
        bent = total(share, own.slope(middle).magnitude)
        K = np.hstack([*(columns for columns, _ in loop.sudden), loop.R, loop.H, loop.H])
        pushed = product(own.exponential.at(middle)[0], Interval.exact(K)).magnitude
        acted = np.hstack([total(share, pushed[:, : len(K.T) - r]), total(turned, pushed[:, len(K.T) - r :])])
        return self._counted(
            len(bent), xi=bent[:, : own.width], heard=bent[:, own.width :], acting=acting.sized(acted)
        )
