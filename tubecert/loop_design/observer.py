"""Weights -> tables: an observer of e, of what eta does and of the inputs under way, and a feedback of all of it.

In: a plant in units of its own, and the logarithms of the weights. Out: a `Table` by two Riccati equations, and the
same in the plant's units as numbers of single precision. Trusted: no.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning, expm, lstsq, qr, solve_discrete_are

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant
from tubecert.loop_design.widths import Sample, Table, step_of

__all__ = ["Observer", "Units", "in_units", "observe", "rounded", "units_of"]

HORIZON = 3.0  # sample times and delays after which a signal's effect is the size of a state
FLOOR = 1e-9  # of a state that nothing reaches, relative to the largest
PARALLEL = 1e-6  # below it, what a component of eta does is what others do
LEAST = 1e-3  # of its unit is what eta may do in a sample, to the observer, even if it is constant
RARE = 0.03  # of the start's errors come back in every sample, to the observer
CLEAN = 1e-12  # an entry that is smaller relative to its row is none: axes that are decoupled stay so


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Units:
    """One of each: of the states (n,), the inputs (m,) and of eta (r,)."""

    states: Array
    inputs: Array
    eta: Array


def units_of(plant: Plant) -> Units:
    """The sizes that signals give the states before feedback answers, so that no result depends on the user's units."""
    horizon = HORIZON * (plant.sample_time + plant.delay)
    eta = np.minimum(plant.magnitude, plant.rate * horizon) + (plant.rate == 0) * plant.magnitude
    eta = np.where(eta > 0, eta, 1.0)
    signals = np.hstack([plant.H * eta, plant.E * plant.wind])
    pushed = _reached(plant.A, np.hstack([signals, plant.B]), horizon)
    states = np.maximum(pushed[:, : signals.shape[1]].sum(1), np.maximum(plant.noise, plant.start))
    moved = pushed[:, signals.shape[1] :]
    with np.errstate(divide="ignore", invalid="ignore"):
        answers = np.where((states[:, None] > 0) & (moved > 0), states[:, None] / moved, np.inf).min(axis=0)
    inputs = np.where(np.isfinite(plant.room), plant.room, np.where(np.isfinite(answers), 10 * answers, 1.0))
    states = np.maximum(states, 0.1 * moved @ inputs)
    return Units(states=np.maximum(states, FLOOR * (states.max() or 1.0)), inputs=inputs, eta=eta)


def _reached(A: Array, columns: Array, horizon: float) -> Array:
    """The largest effect of each column, held since any time in the horizon; (n, -)."""
    n, width = columns.shape
    block = np.zeros((n + width, n + width))
    block[:n, :n], block[:n, n:] = A, columns
    found: Array = np.max([np.abs(expm(block * horizon * i / 8)[:n, n:]) for i in range(1, 9)], axis=0)
    return found


def in_units(plant: Plant, units: Units) -> Plant:
    """The same plant, its states, inputs and eta counted in these units and each w in its own bound."""
    s, u = units.states, units.inputs
    both = np.r_[s, u]
    return replace(
        plant,
        A=plant.A * s / s[:, None],
        B=plant.B * u / s[:, None],
        H=plant.H * units.eta / s[:, None],
        E=plant.E * plant.wind / s[:, None],
        noise=plant.noise / s,
        magnitude=plant.magnitude / units.eta,
        rate=plant.rate / units.eta,
        wind=np.ones_like(plant.wind),
        room=plant.room / u,
        wishes=plant.wishes / s,
        start=plant.start / s,
        eta_start=plant.eta_start / units.eta,
        remainder=lambda W, U: plant.remainder(W * s, U * u) / both,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observer:
    """A plant in units of its own, its sample, and its model of eta: what its components do, without repetition.

    `kept` (p,) of the components span what all do, `mixed` (p, r) how; `moved` (r,) is how far each gets in a sample.
    `shaken` (n, -): what wind does in a sample, and errors like those of the start, which are rare.
    """

    plant: Plant
    step: Sample
    kept: Array
    mixed: Array
    moved: Array
    shaken: Array

    def sizes(self) -> tuple[int, ...]:
        """How many weights of each sort: states, inputs, their changes, eta, shocks, noise."""
        n, m = self.plant.B.shape
        return (n, m, m, len(self.moved), self.shaken.shape[1], n)

    def table(self, weights: Array) -> Table | None:
        """The tables of these weights, natural logarithms in the order of `sizes`; None if a Riccati equation fails."""
        parts = np.split(np.exp(np.clip(weights, -40, 40)), np.cumsum(self.sizes())[:-1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LinAlgWarning)
            try:
                return self._joined(*self._feedback(*parts[:3]), self._filter(*parts[3:]))
            except (LinAlgError, ValueError):
                return None

    def _feedback(self, states: Array, inputs: Array, changes: Array) -> tuple[Array, Array]:
        """Feedback of (e, v) that costs e, delta and delta - v_1, and what is best for an eta that stays."""
        (n, m), A, B = self.plant.B.shape, self.step.A, self.step.B
        H = self.step.H[:, self.kept]
        Q, S = np.zeros_like(A), np.zeros_like(B)
        Q[:n, :n], Q[n : n + m, n : n + m] = np.diag(states), np.diag(0.01 * changes)
        S[n : n + m] = -np.diag(0.01 * changes)
        R = np.diag(0.01 * (inputs + changes))
        P = solve_discrete_are(A, B, Q, R, s=S)
        curved = R + B.T @ P @ B
        K = np.linalg.solve(curved, B.T @ P @ A + S.T)
        closed = A - B @ K
        lasting = P @ H + np.linalg.solve(np.eye(len(A)) - closed.T, closed.T @ P @ H)
        return K, np.linalg.solve(curved, B.T @ lasting)

    def _filter(self, eta: Array, shocks: Array, noise: Array) -> Array:
        """What the observer of (e, eta) takes from the innovation; (n + p, n)."""
        n, p = len(self.plant.A), len(self.kept)
        A = np.eye(n + p)
        A[:n, :n], A[:n, n:] = self.step.A[:n, :n], self.step.H[:n, self.kept]
        blown = self.shaken * np.sqrt(shocks)
        Q = np.zeros((n + p, n + p))
        Q[:n, :n] = blown @ blown.T + 1e-14 * np.eye(n)
        Q[n:, n:] = 10 * (self.mixed * eta * self.moved**2) @ self.mixed.T
        heard = noise * (self.plant.noise**2 + 1e-8)
        P = solve_discrete_are(A.T, np.eye(n + p, n), Q, np.diag(heard))
        gain: Array = np.linalg.solve(P[:n, :n] + np.diag(heard), P[:n]).T
        return gain

    def _joined(self, K: Array, from_eta: Array, learnt: Array) -> Table:
        """zeta = (e, eta, v): corrected by the sample, fed back, and predicted to the next one."""
        n, p, held = len(self.plant.A), len(self.kept), len(self.step.A)
        order = np.r_[:n, held : held + p, n:held]  # of (e, v, eta)
        predict = np.eye(held + p)
        predict[:held, :held], predict[:held, held:] = self.step.A, self.step.H[:, self.kept]
        predict = predict[np.ix_(order, order)]
        push = np.vstack([self.step.B, np.zeros((p, K.shape[0]))])[order]
        hear = np.vstack([learnt, np.zeros((held - n, n))])
        keep = np.eye(held + p)
        keep[:, :n] -= hear
        feed = -np.hstack([K, from_eta])[:, order]
        M, N = feed @ keep, feed @ hear
        return Table(
            F=_clean(predict @ keep + push @ M), G=_clean(predict @ hear + push @ N), M=_clean(M), N=_clean(N)
        )


def _clean(rows: Array) -> Array:
    return np.where(np.abs(rows) < CLEAN * np.abs(rows).max(axis=1, keepdims=True, initial=0), 0.0, rows)


def observe(plant: Plant) -> Observer:
    """The observer of a plant whose units are its own.

    Components of eta that do what others do cannot be told apart by any filter: they are one for the observer.
    """
    active = np.flatnonzero((plant.magnitude > 0) & np.abs(plant.H).any(axis=0))
    pivoted = qr(plant.H[:, active], mode="r", pivoting=True) if len(active) else (np.zeros((0, 0)), active)
    sizes = np.abs(np.diagonal(pivoted[0]))
    kept = active[pivoted[1][: int((sizes > PARALLEL * sizes.max(initial=0)).sum())]]
    mixed = lstsq(plant.H[:, kept], plant.H)[0] if len(kept) else np.zeros((0, plant.H.shape[1]))
    step = step_of(plant)
    return Observer(
        plant=plant,
        step=step,
        kept=kept,
        mixed=np.where(np.abs(mixed) < CLEAN, 0.0, mixed),
        shaken=np.hstack([step.kernels.wind.sum(0), RARE * np.diag(plant.start)[:, plant.start > 0]]),
        moved=np.clip(plant.rate * plant.sample_time, LEAST, np.maximum(LEAST, 2 * plant.magnitude)),
    )


def rounded(observer: Observer, table: Table, units: Units) -> Table:
    """The table in the plant's units; every entry a number of single precision."""
    s, u = units.states, units.inputs
    queue = (len(observer.step.A) - len(s)) // len(u)
    zeta = np.r_[s, units.eta[observer.kept], np.tile(u, queue)]
    return Table(
        F=_single(table.F * zeta[:, None] / zeta),
        G=_single(table.G * zeta[:, None] / s),
        M=_single(table.M * u[:, None] / zeta),
        N=_single(table.N * u[:, None] / s),
    )


def _single(entries: Array) -> Array:
    """Rounded to single precision, without numbers that a small processor may flush to zero."""
    return np.where(np.abs(entries) < 1e-30, 0.0, entries).astype(np.float32).astype(np.float64)
