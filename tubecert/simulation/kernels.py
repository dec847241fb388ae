"""The loop without remainders, lag by lag: what each signal does to a state, or to an input, some samples later.

xi = (e, zeta, v_1 .. v_{q+1}): errors, the controller's memory, what the inputs still to act add to the plan's.
Implements: theory of the sampled loop, section 3, rows r_i = c AA^i, in floats. Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, log2
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array

_TERMS: Final = 18  # of the exponential's series, of a matrix of norm 1/2 at most
_LEVELS: Final = 1000  # of h that are told apart


def exponential(M: Array) -> Array:
    """e^M, by Taylor's series and squaring."""
    squarings = max(0, ceil(log2(2 * float(abs(M).sum(axis=1).max()) + 1e-300)))
    part = M / 2.0**squarings
    total = term = np.eye(len(M))
    for i in range(1, _TERMS):
        term = term @ part / i
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return np.asarray(total)


def flow(A: Array, s: float) -> tuple[Array, Array]:
    """Phi(s) = e^(A s) and its integral from 0 to s, (n, n)."""
    n = len(A)
    both = exponential(np.block([[A, np.eye(n)], [np.zeros((n, 2 * n))]]) * s)
    return both[:n, :n], both[:n, n:]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Kernel:
    """Of one functional, by samples before it (index 0: its own): noise (L, n), wind (L, P, k), h (L, n), start (L, n).

    `h` is that of an input of the plant's states, held for the sample; `start` what the error of the first sample
    counts. `wind` is that of a unit gust in a part.
    """

    noise: Array
    wind: Array
    h: Array
    start: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Nominal:
    """A, B, E, the tables F, G, M, N, and the delay: `whole` samples, and up to node `acts` of the `nodes` (P + 1,)."""

    A: Array
    B: Array
    E: Array
    F: Array
    G: Array
    M: Array
    N: Array
    nodes: Array
    acts: int
    whole: int

    @property
    def lengths(self) -> Array:
        """Of the P parts of a sample, in s."""
        return np.diff(self.nodes)

    @cached_property
    def row(self) -> Array:
        """delta_k of xi_k, (m, xi)."""
        m = len(self.M)
        return np.hstack([self.N, self.M, np.zeros((m, m * (self.whole + 1)))])

    def at(self, node: int) -> tuple[Array, Array]:
        """e(t_k + s) at a node of xi_k, (n, xi), and of the noise of the sample, (n, n)."""
        n, (m, z), q = len(self.A), self.M.shape, self.whole
        s, acts = self.nodes[node], self.nodes[self.acts]
        after = flow(self.A, max(0.0, s - acts))[1] @ self.B
        before = flow(self.A, s)[1] @ self.B - after
        blocks = [np.zeros((n, m)) for _ in range(q + 1)]
        blocks[q] = before
        found = np.hstack([flow(self.A, s)[0], np.zeros((n, z)), *blocks])
        if q:
            found[:, n + z + (q - 1) * m : n + z + q * m] = after
            return found, np.zeros((n, n))
        return found + after @ self.row, after @ self.N

    @cached_property
    def step(self) -> tuple[Array, Array]:
        """AA (xi, xi) and NN (xi, n): xi_{k+1} = AA xi_k + NN n_k without other signals."""
        n, (m, z), q = len(self.A), self.M.shape, self.whole
        e, direct = self.at(len(self.nodes) - 1)
        memory = np.hstack([self.G, self.F, np.zeros((z, m * (q + 1)))])
        queue = np.hstack([np.zeros((m * q, n + z)), np.eye(m * q), np.zeros((m * q, m))])
        AA = np.vstack([e, memory, self.row, queue])
        return AA, np.vstack([direct, self.G, self.N, np.zeros((m * q, n))])

    def state(self, i: int, node: int, lags: int) -> Kernel:
        """The kernel of e_i at a node of a sample."""
        c, direct = self.at(node)
        return self._kernel(c[i], direct[i], np.eye(len(self.A))[i], node, lags)

    def input(self, j: int, lags: int) -> Kernel:
        """The kernel of delta_j of a sample."""
        return self._kernel(self.row[j], self.N[j], np.zeros(len(self.A)), 0, lags)

    def _kernel(self, c: Array, direct: Array, unit: Array, node: int, lags: int) -> Kernel:
        AA, NN = self.step
        rows = np.empty((lags, len(AA)))
        rows[0] = c
        for i in range(1, lags):
            rows[i] = rows[i - 1] @ AA
        n, last = len(self.A), len(self.nodes) - 1
        before = rows[:-1, :n]
        own, other = self._parts(node), self._parts(last)
        wind = np.concatenate(
            [(unit @ own @ self.E)[None], np.einsum("li,pij,jk->lpk", before, other, self.E)]
        )
        return Kernel(
            noise=np.vstack([direct, rows[:-1] @ NN]),
            wind=wind,
            h=np.vstack([unit @ own.sum(axis=0), before @ other.sum(axis=0)]),
            start=rows[:, :n],
        )

    def _parts(self, node: int) -> Array:
        """What a unit slope in each part of a sample is at a node, (P, n, n); 0 for parts after it."""
        found = np.zeros((len(self.nodes) - 1, len(self.A), len(self.A)))
        for p in range(node):
            s = self.nodes[node]
            found[p] = flow(self.A, s - self.nodes[p])[1] - flow(self.A, s - self.nodes[p + 1])[1]
        return found


def goals(weights: Array, size: float, rate: float) -> Array:
    """Where the h of an adversary is to go, lag by lag (L,): the greatest sum of weights (L,) times h.

    |h| <= size, and from sample to sample it changes by `rate` at most, per sample. Dynamic programming: the value is
    concave in h, kept as slopes between levels a sample's change apart; from any h the best is as far towards the
    level at which it is greatest as the rate allows.
    """
    L = len(weights)
    together = min(L, max(1, ceil(2 * size / max(rate, 1e-300) / _LEVELS)))  # samples in which h is one
    count = max(1, min(_LEVELS, ceil(2 * size / max(rate * together, 1e-300))))
    own = weights / 2 + np.append(weights[1:], 0.0) / 2  # h is linear within a sample
    slopes, best = np.full(count, weights[0] / 2), np.empty(L)
    for first in range(0, L, together):
        best[first : first + together] = np.count_nonzero(slopes > 0)
        rise, fall = slopes[slopes > 0], slopes[slopes <= 0]
        level = np.zeros(count - len(rise[1:]) - len(fall[:-1]))
        slopes = np.concatenate([rise[1:], level, fall[:-1]]) + own[first : first + together].sum()
    return size * (2 * best / count - 1)
