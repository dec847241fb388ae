"""How outputs of the loop answer to every signal, lag by lag: rows of floats, what they miss, integrals of kernels.

An output is a row c of xi = (e, zeta, v_1..v_(q+1), eta). Rows r_0 = c, r_1, .. are any floats ("free rows"): r_i
misses r_(i-1) AA by a defect that meets the box of xi. Proposed by powers of AA, believed by the defect. Trusted: yes.
Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from fractions import Fraction
from itertools import pairwise
from math import ceil
from typing import Final, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.sampled_loop.matrices import (
    SUMMED,
    UNIT,
    Exponential,
    lengths,
    nothing,
    product,
    stacked,
    total,
)
from tubecert.sampled_loop.setting import Controller, Loop

_AT_ONCE: Final = 400_000  # entries of a batch of rows


class Flow(NamedTuple):
    """Outputs (R) by the parts of xi, `core` (R, a) and `eta` (R, r), and directly by n (R, n) and r_u (R, m)."""

    core: Interval
    eta: Interval
    noise: Interval
    rounding: Interval


class Counts(NamedTuple):
    """How much every signal counts in outputs (R), from above: noise and wind as they are, the others by their sizes.

    `core` (R, a) and `eta` (R, r) of xi, `rounding` (R, n + m) of y and u, `rho` (R, n + m), `rate` (R, r) of eta.
    """

    noise: Array
    wind: Array
    core: Array
    eta: Array
    rounding: Array
    rho: Array
    rate: Array


class Dynamics:
    """The loop from sample to sample, and within one."""

    def __init__(self, loop: Loop, controller: Controller) -> None:
        self.loop, self.controller = loop, controller
        self.exponential = Exponential(loop.A)
        self.n, self.m, self.z, self.q = loop.states, loop.inputs, controller.size, loop.whole
        self.A, self.B, self.H = map(Interval.exact, (loop.A, loop.B, loop.H))
        self.core_size = self.n + self.z + self.m * (self.q + 1)
        self._N, self._M = map(Interval.exact, (controller.N, controller.M))

    def held(self, s: Fraction) -> tuple[Interval, Interval]:
        """G0(s), of the newer input, and G1(s), of the older one, each (n, m)."""
        rest = self.loop.rest
        if s <= rest:
            return nothing(self.n, self.m), product(self.exponential.at(s)[1], self.B)
        phi, since = self.exponential.at(s - rest)
        return product(since, self.B), product(phi, product(self.exponential.at(rest)[1], self.B))

    def flow(self, s: Fraction) -> Flow:
        """c_s: e at a time s of a sample."""
        phi, whole = self.exponential.at(s)
        return self._assembled(phi, *self.held(s), product(whole, self.H))

    def _assembled(self, e: Interval, newer: Interval, older: Interval, eta: Interval) -> Flow:
        """A map of xi whose newer input is delta_k (no whole sample of delay) or v_q."""
        zero = nothing(self.n, self.m)
        if not self.q:
            heard = product(newer, self._N)
            return Flow(stacked([[e + heard, product(newer, self._M), older]]), eta, heard, newer)
        core = stacked([[e, nothing(self.n, self.z), *[zero] * (self.q - 1), newer, older]])
        return Flow(core, eta, nothing(self.n, self.n), zero)

    def slope(self, s: Fraction) -> Flow:
        """c_s' = A c_s + B (what acts) + H eta, at a time that is not tau'."""
        zero = nothing(self.n, self.m)
        newer, older = (zero, self.B) if s < self.loop.rest else (self.B, zero)
        acting = self._assembled(nothing(self.n, self.n), newer, older, self.H)
        return Flow(*(product(self.A, own) + more for own, more in zip(self.flow(s), acting, strict=True)))

    def _sample(self) -> Interval:
        """xi without eta at the next sample, by itself, eta, n, r_u and r_z: (a, a + r + n + m + z)."""
        c, zero, past = self.controller, np.zeros, self.m * (self.q + 1)
        n, m, z, held = self.n, self.m, self.z, past + self.loop.H.shape[1]
        lower = [
            [c.G, c.F, zero((z, held)), c.G, zero((z, m)), np.eye(z)],
            [c.N, c.M, zero((m, held)), c.N, np.eye(m), zero((m, z))],
            [zero((past - m, n + z)), np.eye(past - m, held + n + m + z)],
        ]
        upper = stacked([[*self.flow(self.loop.sample_time), nothing(n, z)]])
        return stacked([[upper], [Interval.exact(np.block(lower))]])

    def step(self) -> tuple[Interval, Interval]:
        """AA without eta, (a, a), and its column of eta, (a, r)."""
        whole, a = self._sample(), self.core_size
        return whole[:, :a], whole[:, a : a + self.loop.H.shape[1]]

    def discrete(self) -> Interval:
        """How n, r_u and r_z enter at a sample, (a, n + m + z)."""
        return self._sample()[:, self.core_size + self.loop.H.shape[1] :]

    def outputs(self, nodes: Iterable[Fraction]) -> Flow:
        """The rows of e at every node of a sample, of delta, and of zeta."""
        n, m, z, a, r = self.n, self.m, self.z, self.core_size, self.loop.H.shape[1]
        sent = stacked([[self._N, self._M, nothing(m, a - n - z)]])
        delta = Flow(sent, nothing(m, r), self._N, Interval.exact(np.eye(m)))
        zeta = Flow(Interval.exact(np.eye(z, a, n)), *(nothing(z, size) for size in (r, n, m)))
        parts = zip(*map(self.flow, nodes), delta, zeta, strict=True)
        return Flow(*(stacked([[own] for own in part]) for part in parts))


class Kernel:
    """int_0^T |r G(s)| ds of rows r (.., n) for G = Phi K or J K, by the trapezoid, from above.

    On a part of length d the integral is at most that of the chord, d (|r G(a)| + |r G(b)|)/2, and d^3/12 sup|r G''|;
    G'' is A^2 Phi K or A Phi K, and |Phi(s - mid)| <= e^(|A| d/2) entry by entry (theory, eq. 3.5). A length in place
    of components: its norms are convex as well.
    """

    def __init__(
        self, own: Exponential, K: Array, ends: Sequence[Fraction], *, integral: bool = False
    ) -> None:
        self.columns = K.shape[1]
        self._at: list[tuple[float, Interval]] = []
        bent, columns = np.zeros_like(K), Interval.exact(K)
        for a, b in pairwise(ends):
            d = fraction_bounds(b - a)[1]
            self._at += [(0.5 * d, product(own.at(s)[integral], columns)) for s in (a, b)]
            slope = product(own.A, product(own.at((a + b) / 2)[0], columns))
            second = slope if integral else product(own.A, slope)
            bent = bent + d**3 / 12 * (swelling(own.A.mid, (b - a) / 2) @ second.magnitude) * (1 + 1e-12)
        self._bent = bent * SUMMED

    def of(self, rows: Array, plus: Array | None = None, *, length: bool = False) -> Array:
        """The integrals for rows (N, n): (N, columns), or (N, 1) of lengths; `plus` (N, columns) is added to r G."""
        parts = np.zeros((len(rows), 1 if length else self.columns))
        for weight, G in self._at:
            value = product(Interval.exact(rows), G)
            size = (value if plus is None else value + Interval.exact(plus)).magnitude
            parts += weight * (lengths(size) if length else size)
        bent = lengths(self._bent) if length else self._bent
        return np.asarray((parts + np.abs(rows) @ bent * SUMMED) * SUMMED)


def swelling(A: Array, s: Fraction) -> Array:
    """e^(|A| s), (n, n), from above."""
    return Exponential(np.abs(A)).at(s)[0].magnitude


class _Within:
    """What acts from the beginning of a sample up to a time: wind, rho, eta by its rate, and eta as an input."""

    def __init__(self, dynamics: Dynamics, until: Fraction, panels: int) -> None:
        loop, own = dynamics.loop, dynamics.exponential
        parts = max(1, ceil(panels * until / loop.sample_time))
        ends = [until * k / parts for k in range(parts + 1)]
        self._winds = [(Kernel(own, K, ends), size) for K, size in loop.sudden]
        self._rho, self._size = (Kernel(own, K, ends) for K in (loop.R, loop.H))
        self._rate = Kernel(own, loop.H, ends, integral=True)

    def of(self, rows: Array, eta: Array | None = None) -> tuple[Array, Array, Array, Array]:
        """For rows (N, n) of e, and (N, r) of eta: wind (N,), rho (N, n + m), rate (N, r), size (N, r)."""
        winds = (total(own.of(rows, length=size.length), size.weights) for own, size in self._winds)
        wind = sum(winds, start=np.zeros(len(rows)))
        return wind, self._rho.of(rows), self._rate.of(rows, eta), self._size.of(rows)


class Responses:
    """The answers of all outputs over `lags` L; rows are those of e at every node of a sample, delta, zeta.

    Sums over lags 0..k-1 stand at index k, k = 0..L: `noise`, `wind` (L + 1, R), `rounding` (L + 1, R, n + m + z),
    `rho` (L + 1, R, n + m), `rate` and `size` (L + 1, R, r). `rows` (L + 1, R, a) and `eta` (L + 1, R, r) are the free
    rows themselves. `now`: what enters directly, and all that the rows miss, with the radii of the outputs; `direct`:
    what acts within the sample up to every node; `pieces`: how far e between two of them is from the chord.
    """

    def __init__(self, loop: Loop, controller: Controller, *, lags: int, pieces: int, panels: int) -> None:
        self.loop, self.lags, self._panels = loop, lags, panels
        self.dynamics = own = Dynamics(loop, controller)
        Ts = loop.sample_time
        self.nodes = sorted({*(Ts * k / pieces for k in range(pieces + 1)), loop.rest})
        self._first = own.outputs(self.nodes)
        self.count = len(self._first.core.lo)
        self.rows, self.eta, missed_core, missed_eta = self._free_rows()
        noise, rounding = self._first.noise.magnitude, self._first.rounding.magnitude
        now = {"noise": loop.noise.weigh(noise), "rounding": np.hstack([noise, rounding])}
        self.now = self._unmoved(self.count)._replace(core=missed_core, eta=missed_eta, **now)
        self._discrete, self._within = own.discrete(), _Within(own, Ts, panels)
        sums = zip(*map(self._entered, self._batches()), strict=True)
        self.noise, self.wind, self.rounding, self.rho, self.rate, self.size = map(self._cumulated, sums)
        self.direct = [self._direct(s) for s in self.nodes]
        self.pieces = [self._piece(a, b) for a, b in pairwise(self.nodes)]

    def _unmoved(self, outputs: int) -> Counts:
        own, r = self.dynamics, self.loop.H.shape[1]
        sizes = (own.core_size, r, own.n + own.m, own.n + own.m, r)
        zero = np.zeros(outputs)
        return Counts(zero, zero, *(np.zeros((outputs, size)) for size in sizes))

    def shorter(self, lags: int) -> Responses:
        """The same over fewer lags; what the free rows miss is still counted over all."""
        found = copy(self)
        found.lags = lags
        for name in ("rows", "eta", "noise", "wind", "rounding", "rho", "rate", "size"):
            setattr(found, name, getattr(self, name)[: lags + 1])
        return found

    def _free_rows(self) -> tuple[Array, Array, Array, Array]:
        """r_0..r_L without eta, (L + 1, R, a), and their entries for eta, (L + 1, R, r); and what they miss."""
        (step, into), first = self.dynamics.step(), self._first
        rows, power = first.core.mid[None], step.mid
        with np.errstate(all="ignore"):  # rows that overflow prove nothing
            while len(rows) <= self.lags:
                rows = np.concatenate([rows, rows @ power])
                power = power @ power
        rows = rows[: self.lags + 1]
        eta = np.cumsum(np.concatenate([first.eta.mid[None], rows[:-1] @ into.mid]), axis=0)
        missed_core, missed_eta = first.core.rad, first.eta.rad
        for part in self._batches():
            before, last = rows[part].reshape(-1, rows.shape[2]), slice(part.start + 1, part.stop + 1)
            follows, slow = (product(Interval.exact(before), own) for own in (step, into))
            slow = slow + Interval.exact(eta[part].reshape(len(before), -1))
            missed_core = missed_core + _off(follows, rows[last])
            missed_eta = missed_eta + _off(slow, eta[last])
        slack = (1 + 4 * self.lags * UNIT) * SUMMED
        return rows, eta, missed_core * slack, missed_eta * slack

    def _batches(self) -> list[slice]:
        size = max(1, _AT_ONCE // max(1, self.count * self.dynamics.core_size))
        return [slice(start, min(start + size, self.lags)) for start in range(0, self.lags, size)]

    def _entered(self, part: slice) -> tuple[Array, ...]:
        """What the signals of each lag count."""
        rows = self.rows[part]
        flat = rows.reshape(-1, rows.shape[2])
        e, eta = np.ascontiguousarray(flat[:, : self.loop.states]), self.eta[part].reshape(len(flat), -1)
        jumps = product(Interval.exact(flat), self._discrete).magnitude
        noise = self.loop.noise.weigh(jumps[:, : self.loop.states])
        wind, *slow = self._within.of(e, eta)
        return tuple(own.reshape(*rows.shape[:2], *own.shape[1:]) for own in (noise, wind, jumps, *slow))

    def _cumulated(self, parts: Sequence[Array]) -> Array:
        """Sums over the lags before each, from above: k additions, k u."""
        whole = np.concatenate(parts)
        sums = np.concatenate([np.zeros_like(whole[:1]), np.cumsum(whole, axis=0)])
        return np.asarray(sums * (1 + 4 * (self.lags + 4) * UNIT))

    def _direct(self, until: Fraction) -> Counts:
        n = self.loop.states
        wind, rho, rate, _ = _Within(self.dynamics, until, self._panels).of(np.eye(n))
        return self._unmoved(n)._replace(wind=wind, rho=rho, rate=rate)

    def _piece(self, a: Fraction, b: Fraction) -> Counts:
        """How far e is from its chord between two nodes (theory, eq. 3.4)."""
        loop, own = self.loop, self.dynamics
        middle, d = (a + b) / 2, fraction_bounds(b - a)[1]
        turned = d * d / 8 * swelling(loop.A, (b - a) / 2) * SUMMED
        share = np.abs(loop.A) @ turned * SUMMED
        core, eta, noise, rounding = (share @ part.magnitude * SUMMED for part in own.slope(middle))
        phi, _ = own.exponential.at(middle)

        def moved(by: Array, columns: Array) -> Array:
            return np.asarray(by @ product(phi, Interval.exact(columns)).magnitude * SUMMED)

        winds = (size.weigh(moved(share, K)) for K, size in loop.sudden)
        return Counts(
            noise=loop.noise.weigh(noise),
            wind=sum(winds, start=np.zeros(own.n)),
            core=core,
            eta=eta,
            rounding=np.hstack([noise, rounding]),
            rho=moved(share, loop.R),
            rate=moved(turned, loop.H),
        )


def _off(found: Interval, after: Array) -> Array:
    """|r_(i-1) AA - r_i|, summed over the lags of `after`."""
    missed = (found - Interval.exact(after.reshape(found.lo.shape))).magnitude
    return np.asarray(np.sum(missed.reshape(after.shape), axis=0) * SUMMED)
