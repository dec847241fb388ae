"""Weights -> tables: an observer of e, of eta and of the inputs under way, and a feedback of all of it.

In: a plant in units of its own, and logarithms of weights. Out: theta of `widths` by two Riccati equations, and the
same in the plant's units as numbers of single precision. Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant
from tubecert.loop_design.widths import Sample, flow, parts, sample_of

HORIZON = 3.0  # sample times and delays after which a signal's effect is the unit of a state
PARALLEL = 1e-6  # below it, what a component of eta does is what others do
LEAST = 1e-3  # of its unit is what eta may do in a sample, to the observer, even if it is constant
RARE = 0.03  # of the start's errors come back in every sample, to the observer
QUIET = 1e-300  # what is smaller is a 0 that was rounded outward
CLEAN = 1e-12  # an entry that is smaller relative to its row is none: axes that are decoupled stay so


Units = tuple[Array, Array, Array]  # one of each: of the states (n,), the inputs (m,) and of eta (r,)


def units_of(plant: Plant) -> Units:
    """What signals do to the states before feedback answers: with them no result depends on the user's units."""
    horizon = HORIZON * (plant.sample_time + plant.delay)
    turned = np.where(plant.rate > 0, np.minimum(plant.magnitude, plant.rate * horizon), plant.magnitude)
    eta = np.where(turned > 0, turned, 1.0)
    columns = np.hstack([plant.H * eta, plant.E * plant.wind, plant.B])
    pushed = np.max([np.abs(flow(plant.A, columns, horizon * i / 8)[1]) for i in range(1, 9)], axis=0)
    signals, moved = np.split(pushed, [-plant.B.shape[1]], axis=1)
    states = np.max([signals.sum(axis=1), plant.noise, plant.start], axis=0)
    states = np.where(states > QUIET, states, 0.0)
    answers = (moved / np.where(states > 0, states, np.inf)[:, None]).max(axis=0)
    free = 10 / np.where(answers > 0, answers, 10)
    inputs = np.where(np.isfinite(plant.room), plant.room, free)
    states = np.maximum(states, 0.1 * moved @ inputs)
    return np.maximum(states, 1e-9 * (states.max() or 1.0)), inputs, eta


def in_units(plant: Plant, units: Units) -> Plant:
    """The same plant, its states, inputs and eta counted in these units and each w in its own bound."""
    s, u, a = units
    return replace(
        plant,
        A=plant.A * s / s[:, None], B=plant.B * u / s[:, None], H=plant.H * a / s[:, None],
        E=plant.E * plant.wind / s[:, None], wind=np.ones_like(plant.wind), noise=plant.noise / s,
        magnitude=plant.magnitude / a, rate=plant.rate / a, room=plant.room / u, wishes=plant.wishes / s,
        space=plant.space / s,
        start=plant.start / s, eta_start=plant.eta_start / a,
        remainder=lambda W, U: plant.remainder(W * s, U * u) / np.r_[s, u],
    )  # fmt: skip


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

    def _feedback(self, states: Array, inputs: Array, changes: Array) -> Array:
        """Feedback of (e, v) that costs e, delta and delta - v_1, and of an eta that stays as it is; (m, -)."""
        (n, m), A, B, H = self.plant.B.shape, self.sample.A, self.sample.B, self.sample.H[:, self.kept]
        Q, S = np.zeros_like(A), np.zeros_like(B)
        Q[:n, :n], Q[n : n + m, n : n + m] = np.diag(states), np.diag(0.01 * changes)
        S[n : n + m] = -np.diag(0.01 * changes)
        R = np.diag(0.01 * (inputs + changes))
        weak = np.linalg.solve(R, np.hstack([S.T, B.T]))
        P = _riccati(A - B @ weak[:, : len(A)], B @ weak[:, len(A) :], Q - S @ weak[:, : len(A)])
        curved = R + B.T @ P @ B
        K = np.linalg.solve(curved, B.T @ P @ A + S.T)
        lasting = np.linalg.solve(np.eye(len(A)) - (A - B @ K).T, P @ H)
        return np.hstack([-K, -np.linalg.solve(curved, B.T @ lasting)])

    def _filter(self, eta: Array, shocks: Array, noise: Array) -> Array:
        """What the observer of (e, eta) takes from the innovation; (n + p, n)."""
        n, p = len(self.plant.A), len(self.kept)
        A, Q = np.eye(n + p), np.zeros((n + p, n + p))
        A[:n, :n], A[:n, n:] = self.sample.A[:n, :n], self.sample.H[:n, self.kept]
        Q[:n, :n] = (self.shaken * shocks) @ self.shaken.T + 1e-14 * np.eye(n)
        Q[n:, n:] = 10 * (self.mixed * eta * self.moved**2) @ self.mixed.T
        heard = noise * (self.plant.noise**2 + 1e-8)
        P = _riccati(A.T, np.diag(np.r_[1 / heard, np.zeros(p)]), Q)
        return np.asarray(np.linalg.solve(P[:n, :n] + np.diag(heard), P[:n]).T, dtype=float)

    def _joined(self, feed: Array, learnt: Array) -> Array:
        """Theta, zeta = (e, eta, v): corrected by the sample, fed back, and predicted to the next one."""
        n, p, held = len(self.plant.A), len(self.kept), len(self.sample.A)
        order = np.r_[:n, held : held + p, n:held]  # of (e, v, eta)
        predict = np.eye(held + p)
        predict[:held] = np.hstack([self.sample.A, self.sample.H[:, self.kept]])
        predict += np.pad(self.sample.B, ((0, p), (0, 0))) @ feed
        hear = np.pad(learnt, ((0, held - n), (0, 0)))
        keep = np.eye(held + p) - np.pad(hear, ((0, 0), (0, held + p - n)))
        theta = np.vstack([feed[:, order], predict[np.ix_(order, order)]]) @ np.hstack([hear, keep])
        return np.where(np.abs(theta) < CLEAN * np.abs(theta).max(axis=1, keepdims=True), 0.0, theta)


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
    (n, m), sample = plant.B.shape, sample_of(plant)
    active = np.flatnonzero((plant.magnitude > 0) & (np.abs(plant.H) > CLEAN).any(axis=0))
    kept = active
    if len(active):
        triangle, pivots = qr(plant.H[:, active], mode="r", pivoting=True)
        sizes = np.abs(np.diagonal(triangle))
        kept = active[pivots[: int((sizes > PARALLEL * sizes[0]).sum())]]
    wind = parts(plant, sample.kernels.sum(0))[2]
    shaken = [wind, RARE * np.diag(plant.start)[:, plant.start > 0]]
    if (
        not active.size
    ):  # where only what is not linear moves e, nothing else would let the filter learn of it
        rest = plant.sample_time * plant.remainder(np.ones(n), np.zeros(m))[:n]
        shaken.append(np.diag(rest)[:, rest > np.maximum(CLEAN, 10 * np.abs(wind).sum(axis=1))])
    mixed = np.linalg.lstsq(plant.H[:, kept], plant.H)[0] if len(kept) else np.zeros((0, plant.H.shape[1]))
    return Observer(
        plant=plant,
        sample=sample,
        kept=kept,
        mixed=np.where(np.abs(mixed) < CLEAN, 0.0, mixed),
        moved=np.clip(plant.rate * plant.sample_time, LEAST, np.maximum(LEAST, 2 * plant.magnitude)),
        shaken=np.hstack(shaken),
    )


def rounded(observer: Observer, theta: Array, units: Units) -> Array:
    """Theta in the plant's units; every entry a number of single precision that no processor flushes to zero."""
    s, u, a = units
    zeta = np.r_[s, a[observer.kept], np.resize(u, len(observer.sample.A) - len(s))]
    found = theta * np.r_[u, zeta][:, None] / np.r_[s, zeta]
    return np.where(np.abs(found) < 1e-30, 0.0, found).astype(np.float32).astype(float)
