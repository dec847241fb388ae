"""Constant metrics for a machine: those that make the level of certificate H low, by a surrogate of theorem H.

Constants are sampled at points of the safe set and around the plan, and the theorem is evaluated with them in floats,
so that a metric costs about a millisecond. Metrics of Riccati equations, at many rates, start a search without slopes
over the factors of W. Untrusted: what comes out is rounded, proven and certified, or dropped.
Implements: theory section 8, with sampled constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from scipy.linalg import null_space, solve_continuous_are
from scipy.optimize import minimize

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import derivative, free_symbols
from tubecert.model import ControlAffineModel

_CORNERS: Final = 6  # states whose corners are all sampled
_LEVELS, _BANDWIDTHS, _SLOPES = 120, 12, 12  # of the grids
_BACK_OFF: Final = 0.995  # of the rate: what the proof may need
_RATES: Final = tuple(2.0**k for k in range(-3, 7))  # in the slow scale of the system
_WEIGHTS: Final = tuple(10.0**k for k in range(-3, 4))  # of the inputs
_STARTS: Final = 3
_EVALUATIONS: Final = 150  # per unknown
_ROUNDS: Final = 4
_NO_METRIC, _NO_LEVEL = 200.0, 50.0  # costs that lead back to where there is one


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampled:
    """A system with a machine as numbers.

    `slopes` (K, n, n): f_x on the safe set, `near` (K', n, n): around the plan; `bends` (n, n, n): how f_x changes with
    each state; `wind` (n, k) is E |w|; `noise` (n,): |n_i|; `h`, `h_t`, `h_0`: sizes; `h_x` (m, n); `start` (n,) is
    x(0) - x*(0); `room` (n,): what a half-width may be; times in s.
    """

    slopes: Array
    near: Array
    bends: Array
    B: Array
    wind: Array
    noise: Array
    h: float
    h_t: float
    h_0: float
    h_x: Array
    start: Array
    room: Array
    sample_time: float
    delay: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposed:
    """A constant dual metric (n, n) with a rate, and the half-widths (n,) that the surrogate has for it; inf: none."""

    W: Array
    rate: float
    widths: Array
    cost: float


def sampled_slopes(
    model: ControlAffineModel, centres: Array, reach: Array, box: Array
) -> tuple[Array, Array, Array]:
    """`slopes`, `near` and `bends` of `Sampled`: `centres` (K, n) on the plan, `reach` (n,) around it, `box` (n, 2)."""
    n = len(model.states)
    entries = [e for row in model.f_x for e in row]
    moving = [i for i, name in enumerate(model.states) if name in free_symbols(entries)]
    tape = Tape(entries, model.states)

    def at(points: Array) -> Array:
        with np.errstate(all="ignore"):
            values = tape.run_floats(list(points.T), (len(points),)).T.reshape(-1, n, n)
        return np.asarray(values[np.isfinite(values).all(axis=(1, 2))])

    middle, half = box.mean(axis=1), np.ptp(box, axis=1) / 2
    ends = list(product((-1.0, 1.0), repeat=len(moving))) if len(moving) <= _CORNERS else []
    whole = np.zeros((len(ends) + 1, n))
    whole[1:, moving] = np.array(ends).reshape(len(ends), len(moving))
    around = np.vstack([np.zeros((1, n)), np.diag(reach)[moving], -np.diag(reach)[moving]])
    beside = np.vstack([centres + shift for shift in around])
    turns = Tape([derivative(e, name) for name in model.states for e in entries], model.states)
    with np.errstate(all="ignore"):
        bends = turns.run_floats(list(centres.T), (len(centres),)).reshape(n, n, n, -1)
    return (
        at(middle + whole * half),
        at(beside),
        np.nan_to_num(np.abs(bends).max(axis=3) * np.sign(bends[..., 0])),
    )


class Surrogate:
    """What theorem H comes to for a constant metric, roughly: the least level on a grid, and its half-widths.

    `measure` makes one number of half-widths (n,).
    """

    def __init__(self, system: Sampled, measure: Callable[[Array], float]) -> None:
        self.system, self.measure = system, measure
        self.kernel = null_space(system.B.T)

    def __call__(self, W: Array) -> Proposed:
        """The metric with the largest rate that it has on the samples."""
        nothing = np.full(len(W), np.inf)
        try:
            L = np.asarray(np.linalg.cholesky(W), dtype=float)
            rate = self._rate(W)
        except np.linalg.LinAlgError:
            return Proposed(W=W, rate=0.0, widths=nothing, cost=10 * _NO_METRIC)
        if not rate > 0:
            return Proposed(W=W, rate=0.0, widths=nothing, cost=_NO_METRIC + min(-rate, 100.0))
        level, excess = self._level(W, L, rate)
        widths = level * np.sqrt(np.diag(W))
        if not np.isfinite(level):
            return Proposed(W=W, rate=rate, widths=nothing, cost=_NO_LEVEL + np.log(excess))
        beyond = max(0.0, float(np.log(np.max(widths / self.system.room))))
        return Proposed(W=W, rate=rate, widths=widths, cost=float(np.log(self.measure(widths))) + 10 * beyond)

    def _rate(self, W: Array) -> float:
        """C2 on the samples; where there are as many inputs as states any rate has it."""
        N = self.kernel
        if not N.shape[1]:
            return 1.0
        T = np.linalg.inv(np.linalg.cholesky(N.T @ W @ N))
        S = self.system.slopes @ W
        whole = T @ N.T @ (S + S.transpose(0, 2, 1)) @ N @ T.T
        return float(-0.5 * np.linalg.eigvalsh(whole).max()) * _BACK_OFF

    def _level(self, W: Array, L: Array, rate: float) -> tuple[float, float]:
        """The least level that serves, inf if none does; and the least ratio of what is needed to what there is."""
        s = self.system
        T = np.linalg.inv(L)
        B, near = T @ s.B, T @ s.near @ L
        form = near + near.transpose(0, 2, 1) + 2 * rate * np.eye(len(W))
        D_F, D_A = (
            float(np.abs(np.linalg.eigvalsh(form)).max()),
            float(np.linalg.norm(near, 2, axis=(1, 2)).max()),
        )
        beta, du = float(np.linalg.norm(B, 2)), self._feedback(form, B)
        left = np.linalg.pinv(B)
        D_pf = float(np.linalg.norm(left @ near, 2, axis=(1, 2)).max())
        bends = np.einsum("ji,jkl->ikl", L, s.bends)
        turned = T @ bends @ L
        D_Fx = float(np.abs(np.linalg.eigvalsh(turned + turned.transpose(0, 2, 1))).max(axis=1).sum())
        push, guess = float(np.linalg.norm(T @ s.wind, 2)), float(np.linalg.norm(left @ T @ s.wind, 2))
        n_M, n_B = (
            float(np.linalg.norm(np.abs(T) @ s.noise)),
            float(np.linalg.norm(np.abs(left @ T) @ s.noise)),
        )
        h_x, d0 = float(np.linalg.norm(s.h_x @ L, 2)), float(np.linalg.norm(T @ s.start))
        Ts, tau, t1, mu = s.sample_time, s.delay, s.sample_time + s.delay, s.sample_time / 2

        # over levels d and bandwidths omega
        scale = push + beta * max(s.h, guess) + rate * max(d0, n_M) or 1e-9
        d = np.geomspace(1e-4, 1e3, _LEVELS)[:, None] * scale / rate
        omega = np.geomspace(rate / 4, 40 / Ts, _BANDWIDTHS)[None, :]
        lag, gain = Ts / np.expm1(omega * Ts), -np.expm1(-omega * Ts) / Ts
        kb = du * (d + n_M)
        speed, X = D_A * d + beta * (kb + s.h) + push, s.h + 0 * omega
        for _ in range(2):
            s1 = s.h_t + h_x * speed
            bias = s1 * (lag + Ts / 2) + D_pf * (speed * Ts / 4 + n_M) + guess
            ripple = 2 * gain * n_B
            X = np.minimum(2 * s.h, np.maximum(bias, s.h_0) + ripple + s1 * t1)
            speed = D_A * d + beta * (kb + X) + push
        slope, turn = D_F + beta * du, D_Fx * (d + n_M) / 2
        noisy, aging = (slope + turn) * n_M, (slope + turn) * speed
        moved = (speed * t1 + n_M) / d
        need = (
            beta * (bias + ripple + s1 * (tau + mu))
            + push
            + noisy
            + aging * (tau + mu)
            + (noisy + aging * t1) * moved
        )
        first = d0 + beta * s.h_0 * (t1 + 1 / (omega + rate))
        ratio = np.maximum(need / (rate * d), first / d).min(axis=1)
        serves = ratio < 1
        return (float(d[np.argmax(serves), 0]) if serves.any() else np.inf), float(ratio.min())

    def _feedback(self, form: Array, B: Array) -> float:
        """du: over mu, the largest eigenvalue of the pencil (F, B B'/mu + mu I)."""
        values, vectors = np.linalg.eigh(B @ B.T)
        turned = vectors.T @ form @ vectors
        mus = np.geomspace(3e-3, 1, _SLOPES) * np.sqrt(max(values[-1], 1e-300))
        scale = 1 / np.sqrt(np.maximum(values, 0)[None] / mus[:, None] + mus[:, None])
        scaled = turned[:, None] * scale[None, :, :, None] * scale[None, :, None, :]
        return max(float(np.linalg.eigvalsh(scaled).max()), 0.0)


def metrics(surrogate: Surrogate, given: Sequence[Array], slow: float) -> list[Proposed]:
    """Metrics for a machine, the best first: those given and those of Riccati equations, the best of them improved.

    `slow` is a slow rate of the system, in 1/s.
    """
    seeds = [surrogate(W) for W in (*given, *_riccati(surrogate.system, slow))]
    seeds.sort(key=lambda each: each.cost)
    found = [_improved(surrogate, each) for each in seeds[:_STARTS]]
    return sorted([*found, *seeds[:_STARTS]], key=lambda each: each.cost)


def _riccati(system: Sampled, slow: float) -> Iterator[Array]:
    """W = P^-1 of (A + r)'P + P (A + r) - P B B'P/w + Q = 0: each has the rate r at the first sample."""
    A, scale = system.slopes[0], system.room
    B = system.B / np.linalg.norm(system.B, axis=0)
    for rate, weight in product(_RATES, _WEIGHTS):
        shifted = A + rate * slow * np.eye(len(A))
        try:
            P = solve_continuous_are(shifted, B, np.diag(scale**-2.0), weight * np.eye(B.shape[1]))
            W = np.linalg.inv(P)
        except (np.linalg.LinAlgError, ValueError):
            continue
        if np.isfinite(W).all():
            yield (W + W.T) / 2


def _improved(surrogate: Surrogate, seed: Proposed) -> Proposed:
    """The best that a search without slopes finds around a metric, over a lower triangular factor of it."""
    n = len(seed.W)
    L = np.linalg.cholesky(seed.W)
    below = np.tril_indices(n, -1)
    scale = np.diag(L).copy()

    def metric(x: Array) -> Array:
        own = np.diag(np.exp(x[:n]))
        own[below] = x[n:]
        own = scale[:, None] * own
        return np.asarray(own @ own.T)

    def cost(x: Array) -> float:
        return surrogate(metric(x)).cost

    x, best = np.concatenate([np.zeros(n), (L / scale[:, None])[below]]), seed
    steps = _EVALUATIONS * len(x)
    for _ in range(_ROUNDS):
        search = minimize(
            cost, x, method="Nelder-Mead", options={"maxfev": steps, "adaptive": True, "fatol": 1e-4}
        )
        x, found = np.asarray(search.x, dtype=float), surrogate(metric(search.x))
        if found.cost > best.cost - (1e-3 if found.cost < _NO_LEVEL else 1e-6):
            return min(best, found, key=lambda each: each.cost)
        best = found
    return best
