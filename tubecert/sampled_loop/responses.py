"""How outputs of the loop answer to every signal, lag by lag: rows of floats, what they miss, integrals of kernels.

An output is a row c of xi = (e, zeta, v_1..v_(q+1), eta). Rows r_0 = c, r_1, .. are any floats ("free rows"): r_i
misses r_(i-1) AA by a defect that meets the box of xi. Proposed by powers of AA, believed by the defect. Trusted: yes.
Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array, fraction_bounds
from tubecert.sampled_loop.exponential import Exponential
from tubecert.sampled_loop.midrad import SUMMED, UNIT, Known
from tubecert.sampled_loop.setting import Controller, Loop, Size

_AT_ONCE: Final = 400_000  # entries of a batch of rows
_ROOT_TINY: Final = 1e-150


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """e at a time s of a sample, by the parts of xi: `core` (n, a), `eta` (n, r); of n and r_u directly."""

    core: Known
    eta: Known
    noise: Known
    rounding: Known


@dataclass(frozen=True, slots=True, eq=False)
class Direct:
    """What acts within a sample up to a node: wind (n,), rho (n, n + m), rates of eta (n, r)."""

    wind: Array
    rho: Array
    rate: Array


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A part of a sample between two nodes, and how far e and its direct terms are from chords (theory, eq. 3.4)."""

    first: int
    core: Array
    eta: Array
    noise: Array
    rounding: Array
    wind: Array
    rho: Array
    rate: Array


class Dynamics:
    """The loop from sample to sample, and within one."""

    def __init__(self, loop: Loop, controller: Controller) -> None:
        self.loop, self.controller = loop, controller
        self.exponential = Exponential(loop.A)
        self.n, self.m, self.z, self.q = loop.states, loop.inputs, controller.size, loop.whole
        self.B, self.H = Known.exact(loop.B), Known.exact(loop.H)
        self.core_size = self.n + self.z + self.m * (self.q + 1)
        self._N, self._M = Known.exact(controller.N), Known.exact(controller.M)

    def held(self, s: Fraction) -> tuple[Known, Known]:
        """G0(s), of the newer input, and G1(s), of the older one, each (n, m)."""
        rest = self.loop.rest
        if s <= rest:
            return Known.exact(np.zeros((self.n, self.m))), self.exponential.at(s)[1] @ self.B
        phi, since = self.exponential.at(s - rest)
        return since @ self.B, phi @ (self.exponential.at(rest)[1] @ self.B)

    def flow(self, s: Fraction) -> Flow:
        """c_s, and the direct terms of the noise and of the rounding of the input."""
        phi, whole = self.exponential.at(s)
        newer, older = self.held(s)
        return self._assembled(phi, newer, older, whole @ self.H)

    def _assembled(self, e: Known, newer: Known, older: Known, eta: Known) -> Flow:
        """A map of xi whose newer input is delta_k (no whole sample of delay) or v_q."""
        zero = Known.exact(np.zeros((self.n, self.m)))
        past = [zero] * (self.q + 1)
        past[self.q] = older
        if self.q:
            past[self.q - 1] = newer
            nothing = Known.exact(np.zeros((self.n, self.z)))
            core = Known.stacked([[e, nothing, *past]])
            return Flow(core, eta, Known.exact(np.zeros((self.n, self.n))), zero)
        core = Known.stacked([[e + newer @ self._N, newer @ self._M, *past]])
        return Flow(core, eta, newer @ self._N, newer)

    def slope(self, s: Fraction) -> Flow:
        """c_s' = A c_s + B (what acts) + H eta, at a time that is not tau'."""
        own, A = self.flow(s), Known.exact(self.loop.A)
        zero = Known.exact(np.zeros((self.n, self.m)))
        older = s < self.loop.rest
        nothing = Known.exact(np.zeros((self.n, self.n)))
        acting = self._assembled(nothing, zero if older else self.B, self.B if older else zero, self.H)
        return Flow(
            A @ own.core + acting.core,
            A @ own.eta + acting.eta,
            A @ own.noise + acting.noise,
            A @ own.rounding + acting.rounding,
        )

    def step(self) -> tuple[Known, Known]:
        """AA without eta, (a, a), and its column of eta, (a, r)."""
        flow, c = self.flow(self.loop.sample_time), self.controller
        past = self.m * (self.q + 1)
        shift = np.zeros((past, past))
        shift[self.m :, : past - self.m] = np.eye(past - self.m)
        first = np.zeros((past, self.n + self.z))
        first[: self.m] = np.hstack([c.N, c.M])
        lower = np.block([[np.hstack([c.G, c.F]), np.zeros((self.z, past))], [first, shift]])
        eta = np.zeros((self.core_size - self.n, self.loop.H.shape[1]))
        return Known.stacked([[flow.core], [Known.exact(lower)]]), Known.stacked(
            [[flow.eta], [Known.exact(eta)]]
        )

    def discrete(self) -> Known:
        """How n, r_u and r_z enter at a sample, (a, n + m + z)."""
        flow, c = self.flow(self.loop.sample_time), self.controller
        past, z = self.m * (self.q + 1), self.z
        one = np.zeros((past, self.m))
        one[: self.m] = np.eye(self.m)
        first = np.zeros((past, self.n))
        first[: self.m] = c.N
        lower = np.block(
            [
                [c.G, np.zeros((z, self.m)), np.eye(z)],
                [first, one, np.zeros((past, z))],
            ]
        )
        upper = [flow.noise, flow.rounding, Known.exact(np.zeros((self.n, z)))]
        return Known.stacked([[Known.stacked([upper])], [Known.exact(lower)]])


class Kernel:
    """int_0^T |r G(s)| ds of rows r (.., n) for G = Phi K or J K, by the trapezoid, from above.

    On a part of length d the integral is at most that of the chord, d (|r G(a)| + |r G(b)|)/2, and d^3/12 sup|r G''|;
    G'' is A^2 Phi K or A Phi K, and |Phi(s - mid)| <= e^(|A| d/2) entry by entry (theory, eq. 3.5). A length in place
    of components: its norms are convex as well.
    """

    def __init__(
        self, exponential: Exponential, A: Array, K: Array, ends: Sequence[Fraction], *, integral: bool
    ) -> None:
        self.columns = K.shape[1]
        self._at: list[tuple[float, Known]] = []
        bent = np.zeros_like(K)
        for a, b in pairwise(ends):
            d = fraction_bounds(b - a)[1]
            for s in (a, b):
                phi, whole = exponential.at(s)
                self._at.append((0.5 * d, (whole if integral else phi) @ Known.exact(K)))
            phi, _ = exponential.at((a + b) / 2)
            slope = Known.exact(A) @ (phi @ Known.exact(K))
            second = slope if integral else Known.exact(A) @ slope
            bent = bent + d**3 / 12 * (swelling(A, (b - a) / 2) @ second.above) * (1 + 1e-12)
        self._bent = bent * SUMMED

    def of(self, rows: Array, plus: Array | None = None, *, length: bool = False) -> Array:
        """The integrals for rows (N, n): (N, columns), or (N, 1) of lengths; `plus` (N, columns) is added to r G."""
        parts = np.zeros((len(rows), 1 if length else self.columns))
        for weight, G in self._at:
            value = Known.exact(rows) @ G
            size = (value if plus is None else value + Known.exact(plus)).above
            parts += weight * (lengths(size) if length else size)
        bent = lengths(self._bent) if length else self._bent
        return np.asarray((parts + np.abs(rows) @ bent * SUMMED) * SUMMED)


def lengths(rows: Array) -> Array:
    """Euclidean lengths of rows of numbers that are not negative, (N, 1), from above."""
    return np.asarray(np.sqrt(np.sum(rows * rows, axis=-1, keepdims=True)) * SUMMED + _ROOT_TINY)


def swelling(A: Array, s: Fraction) -> Array:
    """e^(|A| s), (n, n), from above."""
    return Exponential(np.abs(A)).at(s)[0].above


class Responses:
    """The answers of all outputs over `lags` L; rows are those of e at every node of a sample, delta, zeta.

    Sums over lags 0..k-1 stand at index k, k = 0..L: `noise`, `wind` (L + 1, R), `rounding` (L + 1, R, n + m + z),
    `rho` (L + 1, R, n + m), `rate` and `size` (L + 1, R, r). `rows` (L + 1, R, a) and `eta` (L + 1, R, r) are the free
    rows themselves; `missed_core`, `missed_eta` all that they miss, summed, with the radii of the outputs.
    """

    def __init__(self, loop: Loop, controller: Controller, *, lags: int, pieces: int, panels: int) -> None:
        self.loop, self.controller, self.lags = loop, controller, lags
        self.dynamics = own = Dynamics(loop, controller)
        Ts, n = loop.sample_time, loop.states
        self.nodes = sorted({*(Ts * k / pieces for k in range(pieces + 1)), loop.rest})
        self._panels = panels
        flows = [own.flow(s) for s in self.nodes]
        self._outputs(flows)
        self.rows, self.eta = self._free_rows()
        self._kernels()
        self.pieces = [self._piece(i) for i in range(len(self.nodes) - 1)]
        self.direct = [self._direct(s) for s in self.nodes]
        self.count = n * len(self.nodes) + loop.inputs + controller.size

    def shorter(self, lags: int) -> Responses:
        """The same over fewer lags; what the free rows miss is still counted over all."""
        found = copy(self)
        found.lags = lags
        for name in ("rows", "eta", "noise", "wind", "rounding", "rho", "rate", "size"):
            setattr(found, name, getattr(self, name)[: lags + 1])
        return found

    def _outputs(self, flows: Sequence[Flow]) -> None:
        own, c = self.dynamics, self.controller
        z, m, a = own.z, own.m, own.core_size
        r = self.loop.H.shape[1]
        delta = np.zeros((m, a))
        delta[:, : own.n + z] = np.hstack([c.N, c.M])
        unit = np.zeros((z, a))
        unit[:, own.n : own.n + z] = np.eye(z)
        nothing = Known.exact(np.zeros((m + z, r)))
        core = Known.stacked([*([flow.core] for flow in flows), [Known.exact(delta)], [Known.exact(unit)]])
        eta = Known.stacked([*([flow.eta] for flow in flows), [nothing]])
        self._first, self._first_eta = core, eta
        zeros = np.zeros((z, own.n)), np.zeros((z, m))
        self.noise_now = np.vstack([*(f.noise.above for f in flows), np.abs(c.N), zeros[0]])
        self.rounding_now = np.vstack([*(f.rounding.above for f in flows), np.eye(m), zeros[1]])

    def _free_rows(self) -> tuple[Array, Array]:
        """r_0..r_L without eta, (L + 1, R, a), and their entries for eta, (L + 1, R, r); and what they miss."""
        step, into = self.dynamics.step()
        rows, power = self._first.mid[None], step.mid
        with np.errstate(all="ignore"):  # rows that overflow prove nothing
            while len(rows) <= self.lags:
                rows = np.concatenate([rows, rows @ power])
                power = power @ power
        rows = rows[: self.lags + 1]
        met = rows[:-1] @ into.mid
        eta = np.cumsum(np.concatenate([self._first_eta.mid[None], met]), axis=0)
        missed_core, missed_eta = self._first.rad, self._first_eta.rad
        for part in self._batches(self.lags):
            before = rows[part].reshape(-1, rows.shape[2])
            last = slice(part.start + 1, part.stop + 1)
            missed_core = missed_core + _sum(self._off(before, step, rows[last]))
            follows = self._off(before, into, eta[last], Known.exact(eta[part].reshape(len(before), -1)))
            missed_eta = missed_eta + _sum(follows)
        slack = 1 + 4 * self.lags * UNIT
        self.missed_core, self.missed_eta = missed_core * slack * SUMMED, missed_eta * slack * SUMMED
        return rows, eta

    def _off(self, rows: Array, step: Known, after: Array, plus: Known | None = None) -> Array:
        """|r_(i-1) AA - r_i|, in the shape of `after`."""
        exact = Known.exact(rows) @ step
        whole = exact if plus is None else exact + plus
        return (whole - Known.exact(after.reshape(whole.mid.shape))).above.reshape(after.shape)

    def _batches(self, count: int) -> list[slice]:
        size = max(1, _AT_ONCE // max(1, self._first.rows * self.dynamics.core_size))
        return [slice(start, min(start + size, count)) for start in range(0, count, size)]

    def _ends(self, until: Fraction) -> list[Fraction]:
        """Ends of the parts of a quadrature over [0, until]."""
        parts = max(1, ceil(self._panels * until / self.loop.sample_time))
        return [until * k / parts for k in range(parts + 1)]

    def _signals(self, until: Fraction) -> tuple[list[tuple[Kernel, Size]], Kernel, Kernel, Kernel]:
        """Kernels of winds, of rho, of eta' and of eta as an input."""
        loop, e = self.loop, self.dynamics.exponential
        ends, R = self._ends(until), np.hstack([np.eye(loop.states), loop.B])
        winds = [(Kernel(e, loop.A, K, ends, integral=False), size) for K, size in loop.sudden]
        return (
            winds,
            Kernel(e, loop.A, R, ends, integral=False),
            Kernel(e, loop.A, loop.H, ends, integral=True),
            Kernel(e, loop.A, loop.H, ends, integral=False),
        )

    def _kernels(self) -> None:
        loop, n = self.loop, self.loop.states
        winds, rho, rate, size = self._signals(loop.sample_time)
        enters = self.dynamics.discrete()
        found: list[list[Array]] = [[], [], [], [], [], []]
        for part in self._batches(self.lags):
            rows = self.rows[part]
            shape = rows.shape[:2]
            flat = rows.reshape(-1, rows.shape[2])
            e, eta = np.ascontiguousarray(flat[:, :n]), self.eta[part].reshape(len(flat), -1)
            jumps = (Known.exact(flat) @ enters).above
            values = (
                weighed(jumps[:, :n], loop.noise),
                sum((_blown(kernel, e, own) for kernel, own in winds), start=np.zeros(len(e))),
                jumps,
                rho.of(e),
                rate.of(e, eta),
                size.of(e),
            )
            for own, value in zip(found, values, strict=True):
                own.append(value.reshape(*shape, *value.shape[1:]))
        self.noise, self.wind, self.rounding, self.rho, self.rate, self.size = map(self._cumulated, found)

    def _cumulated(self, parts: list[Array]) -> Array:
        """Sums over the lags before each, from above: k additions, k u."""
        whole = np.concatenate(parts)
        before = np.zeros((1, *whole.shape[1:]))
        sums = np.concatenate([before, np.cumsum(whole, axis=0)])
        return np.asarray(sums * (1 + 4 * (self.lags + 4) * UNIT))

    def _direct(self, until: Fraction) -> Direct:
        n, m, r = self.loop.states, self.loop.inputs, self.loop.H.shape[1]
        if not until:
            return Direct(np.zeros(n), np.zeros((n, n + m)), np.zeros((n, r)))
        winds, rho, rate, _ = self._signals(until)
        one = np.eye(n)
        wind = sum((_blown(kernel, one, own) for kernel, own in winds), start=np.zeros(n))
        return Direct(np.asarray(wind), rho.of(one), rate.of(one))

    def _piece(self, first: int) -> Piece:
        a, b = self.nodes[first], self.nodes[first + 1]
        slope = self.dynamics.slope((a + b) / 2)
        d = fraction_bounds(b - a)[1]
        share = d * d / 8 * (np.abs(self.loop.A) @ swelling(self.loop.A, (b - a) / 2)) * SUMMED
        parts = (slope.core, slope.eta, slope.noise, slope.rounding)
        phi, _ = self.dynamics.exponential.at((a + b) / 2)
        turned = d * d / 8 * swelling(self.loop.A, (b - a) / 2) * SUMMED
        R = np.hstack([np.eye(self.loop.states), self.loop.B])
        core, eta, noise, rounding, rho = (
            share @ own.above * SUMMED for own in (*parts, phi @ Known.exact(R))
        )
        wind = np.zeros(self.loop.states)
        for K, size in self.loop.sudden:
            wind += weighed(share @ (phi @ Known.exact(K)).above * SUMMED, size)
        rate = turned @ (phi @ Known.exact(self.loop.H)).above * SUMMED
        return Piece(first, core, eta, noise, rounding, wind, rho, rate)


def weighed(columns: Array, size: Size) -> Array:
    """What rows (N, k) of numbers that are not negative do to a signal of a size: (N,), from above."""
    if size.length:
        return np.asarray(lengths(columns)[:, 0] * size.each[0] * (1 + 1e-15))
    return np.asarray(columns @ size.each * SUMMED)


def _blown(kernel: Kernel, rows: Array, size: Size) -> Array:
    found = kernel.of(rows, length=size.length)
    return np.asarray(found[:, 0] * size.each[0] * (1 + 1e-15) if size.length else found @ size.each * SUMMED)


def _sum(values: Array) -> Array:
    """Over lags."""
    return np.asarray(np.sum(values, axis=0) * SUMMED)
