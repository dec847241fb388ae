"""Weights -> tables: an observer of e, of eta and of the inputs under way, and a feedback of all of it.

In: a plant in units of its own, and logarithms of weights. Out: theta of `widths`, by two Riccati equations.
Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import CLEAN, Plant
from tubecert.loop_design.widths import Sample, sample_of

PARALLEL = 1e-6  # below it, what a component of eta does is what others do
LEAST = 1e-3  # of its unit is what eta may do in a sample, to the observer, even if it is constant
RARE = 0.03  # of the start's errors come back in every sample, to the observer


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observer:
    """A plant in units of its own, its sample, and its model of eta: what its components do, without repetition.

    `kept` (p,) of the components span what all do, `mixed` (p, r) how; `moved` (r,) is how far each gets in a sample.
    `shaken` (n, -): what wind does in a sample, and errors like those of the start, which are rare; without
    eta, what is not linear where that is more.
    """

    plant: Plant
    sample: Sample
    kept: NDArray[Any]
    mixed: Array
    moved: Array
    shaken: Array

    def sizes(self) -> tuple[int, ...]:
        """How many weights of each sort: states, inputs, their changes, eta, shocks, noise."""
        n, m = self.plant.B.shape
        return (n, m, m, len(self.moved), self.shaken.shape[1], n)

    def table(self, weights: Array) -> Array | None:
        """Theta of these weights, logarithms in the order of `sizes`; None if a Riccati equation fails."""
        each = np.split(np.exp(np.clip(weights, -40, 40)), np.cumsum(self.sizes())[:-1])
        try:
            with np.errstate(all="ignore"):
                theta = self._joined(self._feedback(*each[:3]), self._filter(*each[3:]))
        except np.linalg.LinAlgError:
            return None
        return theta if np.isfinite(theta).all() else None

    def _known(self, states: NDArray[Any]) -> Array:
        """What becomes in a sample of these entries of (e, v), and of the eta that is kept."""
        own = np.r_[states, self.sample.held + self.kept]
        return np.asarray(self.sample.A[np.ix_(own, own)])

    def _feedback(self, states: Array, inputs: Array, changes: Array) -> Array:
        """Feedback of (e, v) that costs e, delta and delta - v_1, and of an eta that stays as it is; (m, -)."""
        (n, m), held = self.plant.B.shape, self.sample.held
        A, H = np.split(self._known(np.r_[:held])[:held], [held], axis=1)
        B = self.sample.B[:held]
        Q, S = np.zeros_like(A), np.zeros_like(B)
        Q[:n, :n], Q[n : n + m, n : n + m] = np.diag(states), np.diag(0.01 * changes)
        S[n : n + m] = -np.diag(0.01 * changes)
        R = np.diag(0.01 * (inputs + changes))
        weak = np.linalg.solve(R, np.hstack([S.T, B.T]))
        P = _riccati(A - B @ weak[:, :held], B @ weak[:, held:], Q - S @ weak[:, :held])
        curved = R + B.T @ P @ B
        K = np.linalg.solve(curved, B.T @ P @ A + S.T)
        lasting = np.linalg.solve(np.eye(held) - (A - B @ K).T, P @ H)
        return np.hstack([-K, -np.linalg.solve(curved, B.T @ lasting)])

    def _filter(self, eta: Array, shocks: Array, noise: Array) -> Array:
        """What the observer of (e, eta) takes from the innovation; (n + p, n)."""
        n, p = len(self.plant.A), len(self.kept)
        A, Q = self._known(np.r_[:n]), np.zeros((n + p, n + p))
        Q[:n, :n] = (self.shaken * shocks) @ self.shaken.T + 1e-14 * np.eye(n)
        Q[n:, n:] = 10 * (self.mixed * eta * self.moved**2) @ self.mixed.T
        heard = noise * (self.plant.noise**2 + 1e-8)
        P = _riccati(A.T, np.diag(np.r_[1 / heard, np.zeros(p)]), Q)
        return np.asarray(np.linalg.solve(P[:n, :n] + np.diag(heard), P[:n]).T, dtype=float)

    def _joined(self, feed: Array, learnt: Array) -> Array:
        """Theta, zeta = (e, eta, v): corrected by the sample, fed back, and predicted to the next one."""
        n, p, held = len(self.plant.A), len(self.kept), self.sample.held
        order = np.r_[:n, held : held + p, n:held]  # of (e, v, eta)
        predict = self._known(np.r_[:held]) + np.pad(self.sample.B[:held], ((0, p), (0, 0))) @ feed
        hear = np.pad(learnt, ((0, held - n), (0, 0)))
        keep = np.eye(held + p) - np.pad(hear, ((0, 0), (0, held + p - n)))
        theta = np.vstack([feed[:, order], predict[np.ix_(order, order)]]) @ np.hstack([hear, keep])
        return np.where(np.abs(theta) < CLEAN * np.abs(theta).max(axis=1, keepdims=True), 0.0, theta)

    def rounded(self, theta: Array) -> Array:
        """Theta in the units that the plant came in; numbers of single precision that no processor flushes to zero."""
        s, u, a = self.plant.units
        zeta = np.r_[s, a[self.kept], np.resize(u, self.sample.held - len(s))]
        found = theta * np.r_[u, zeta][:, None] / np.r_[s, zeta]
        return np.where(np.abs(found) < 1e-30, 0.0, found).astype(np.float32).astype(float)


def _riccati(A: Array, G: Array, Q: Array) -> Array:
    """The P = Q + A' P (I + G P)^-1 A that stabilises, by doubling (Chu, Fan, Lin, Wang 2004)."""
    one, P = np.eye(len(A)), Q
    for _ in range(60):
        faded, moved = np.hsplit(np.linalg.solve(one + G @ P, np.hstack([A, G])), 2)
        more = A.T @ P @ faded
        P, G, A = P + (more + more.T) / 2, G + A @ moved @ A.T, A @ faded
        if not np.abs(more).max() > 1e-14 * np.abs(P).max():
            break
    return P


def observe(plant: Plant) -> Observer:
    """The observer of a plant whose units are its own.

    Components of eta that do what others do cannot be told apart by any filter: they are one for the observer. One that
    does nothing is none.
    """
    (n, m), (_, r), sample = plant.B.shape, plant.H.shape, sample_of(plant)
    active = np.flatnonzero((plant.magnitude > 0) & (np.abs(plant.H) > CLEAN).any(axis=0))
    kept = active
    wind = sample.kernels[:n, :, 2 * r : 2 * r + plant.E.shape[1]].sum(axis=1)
    shaken = [wind, RARE * np.diag(plant.start)[:, plant.start > 0]]
    if len(active):
        triangle, pivots = qr(plant.H[:, active], mode="r", pivoting=True)
        sizes = np.abs(np.diagonal(triangle))
        kept = active[pivots[: int((sizes > PARALLEL * sizes[0]).sum())]]
    else:  # where only what is not linear moves e, nothing else would let the filter learn of it
        rest = plant.sample_time * plant.remainder(np.ones(n), np.zeros(m))[:n]
        shaken.append(np.diag(rest)[:, rest > np.maximum(CLEAN, 10 * np.abs(wind).sum(axis=1))])
    mixed = np.linalg.lstsq(plant.H[:, kept], plant.H)[0]
    return Observer(
        plant=plant,
        sample=sample,
        kept=kept,
        mixed=np.where(np.abs(mixed) < CLEAN, 0.0, mixed),
        moved=np.clip(plant.rate * plant.sample_time, LEAST, np.maximum(LEAST, 2 * plant.magnitude)),
        shaken=np.hstack(shaken),
    )
