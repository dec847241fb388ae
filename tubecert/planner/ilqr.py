"""The built-in planner: iLQR with an augmented Lagrangian for the goal. Untrusted: it only proposes knots.

Minimises sum dt (|x - target|_Q^2 + |u - input|_R^2)/2 over inputs that are held (or linear) between knots.
Deterministic: no clock, no randomness. Reference: Y. Tassa, T. Erez, E. Todorov, Synthesis and stabilization of complex
behaviors through online trajectory optimization, IROS 2012.

The dynamics in floats: batches of steps by RK4 and their derivatives. Untrusted: nothing here is a bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import free_symbols
from tubecert.expression.matrix import jacobian
from tubecert.model import TIME, ControlAffineModel

# RK4: time of the stage, share of the slope before
_STAGES = ((0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0))
_WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
_ANY = np.zeros(())


class Dynamics:
    """x' = f(t, x) + B(x) u for N states at once: x has shape (n, N), u (m, N), t is a number or (N,)."""

    def __init__(self, model: ControlAffineModel) -> None:
        drift = [row[0] for row in model.drift_on_plan()]
        names, moved = (*model.states, *model.inputs, TIME), (*model.states, *model.inputs)
        self.n, self.m = len(model.states), len(model.inputs)
        self._rate = Tape(drift, names)
        slopes = jacobian(drift, moved)
        self._slopes = Tape([e for row in slopes for e in row], names)
        self._moves = TIME in free_symbols(drift)

    @np.errstate(all="ignore")
    def rate(self, t: Array | float, x: Array, u: Array) -> Array:
        """f + B u, (n, N)."""
        return self._rate_at(t, x, u)

    def _rate_at(self, t: Array | float, x: Array, u: Array) -> Array:
        now = np.broadcast_to(t, x.shape[1:]) if self._moves else _ANY
        return self._rate.run_floats_silenced([*x, *u, now], x.shape[1:])

    @np.errstate(all="ignore")
    def step(self, t: Array | float, x: Array, left: Array, right: Array, dt: float, *, count: int) -> Array:
        """The states a time dt after t, in `count` equal steps; u runs linearly from `left` to `right`."""
        h = dt / count
        for i in range(count):
            total, k = _ANY, _ANY
            for (c, a), weight in zip(_STAGES, _WEIGHTS, strict=True):
                share = (i + c) / count
                at = x + a * h * k if a else x
                k = self._rate_at(t + share * dt, at, (1 - share) * left + share * right)
                total = total + weight * k
            x = x + h * total
        return x

    @np.errstate(all="ignore")
    def step_slopes(self, t: Array, x: Array, left: Array, right: Array, dt: float, *, count: int) -> Array:
        """The derivatives of `step` by x, left and right: (N, n, n + 2 m)."""
        n, m = self.n, self.m
        h = dt / count
        N = x.shape[1]
        D = np.zeros((N, n, n + 2 * m))
        D[:, :, :n] = np.eye(n)
        for i in range(count):
            total, k = np.zeros_like(x), np.zeros_like(x)
            total_d, k_d = np.zeros_like(D), np.zeros_like(D)
            for (c, a), weight in zip(_STAGES, _WEIGHTS, strict=True):
                share = (i + c) / count
                at, u = x + a * h * k, (1 - share) * left + share * right
                now = np.broadcast_to(t + share * dt, (N,))
                both = self._slopes.run_floats_silenced([*at, *u, now], (N,)).T.reshape(N, n, n + m)
                k = self._rate_at(now, at, u)
                k_d = both[:, :, :n] @ (D + a * h * k_d)
                k_d[:, :, n : n + m] += (1 - share) * both[:, :, n:]
                k_d[:, :, n + m :] += share * both[:, :, n:]
                total, total_d = total + weight * k, total_d + weight * k_d
            x, D = x + h * total, D + h * total_d
        return D


Report = Callable[[int, float], None]
SUBSTEPS = 4  # of the integration between two knots
_SHARES = 0.5 ** np.arange(14)
_MOST_STEPS = 200
_MOST_ROUNDS = 15
_STIFFEST = 1e10
_HUGE = 1e8


class Outcome(StrEnum):
    """How planning ended, in words, with what to try."""

    FOUND = "a plan was found"
    DIVERGED = "every first guess diverges"
    MISSED = "the goal was missed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """What to plan: times of K knots, start and target (n,), reference input (m,), weights, goal, interpolation.

    `substeps`: of the integration between two knots.
    """

    t: Array
    start: Array
    target: Array
    input: Array
    Q: Array
    R: Array
    goal: bool
    held: bool
    substeps: int = SUBSTEPS


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """States (K, n) and inputs (K, m) at the knots; `costs` after every step; `miss` is |x(T) - target|."""

    outcome: Outcome
    x: Array
    u: Array
    costs: tuple[float, ...]
    miss: float


@dataclass(frozen=True, slots=True)
class _Curve:
    """z (K, N) and w (K-1, m): the state of the planner's own system and its controls."""

    z: Array
    w: Array


class _System:
    """The planner's own discrete system z+ = step(z, w).

    Held inputs: z = x, w = u. Linear inputs: z = (x, u), w = the input at the next knot.
    """

    def __init__(self, dynamics: Dynamics, problem: Problem) -> None:
        self.dynamics, self.problem = dynamics, problem
        self.dt = np.diff(problem.t)
        n, m = dynamics.n, dynamics.m
        self.size = n if problem.held else n + m
        self.reference = problem.target if problem.held else np.concatenate([problem.target, problem.input])
        self.P = problem.Q if problem.held else _blocks(problem.Q, problem.R)
        self.S = problem.R if problem.held else np.zeros_like(problem.R)

    @property
    def start(self) -> Array:
        p = self.problem
        return p.start if p.held else np.concatenate([p.start, p.input])

    def step(self, k: int, z: Array, w: Array) -> Array:
        """The next states for columns of states and controls."""
        n = self.dynamics.n
        left = w if self.problem.held else z[n:]
        x = self.dynamics.step(self.problem.t[k], z[:n], left, w, self.dt[k], count=self.problem.substeps)
        return x if self.problem.held else np.concatenate([x, w])

    def slopes(self, curve: _Curve) -> tuple[Array, Array]:
        """Derivatives by z and w at every knot: (K-1, N, N), (K-1, N, m)."""
        n, m = self.dynamics.n, self.dynamics.m
        x = curve.z[:-1, :n].T
        left = curve.w.T if self.problem.held else curve.z[:-1, n:].T
        count = len(self.dt)
        scaled = np.ones(count) * self.dt
        times = self.problem.t[:-1]
        D = _by_step(self.dynamics, (times, x, left, curve.w.T), scaled, self.problem.substeps)
        if self.problem.held:
            return D[:, :, :n], D[:, :, n : n + m] + D[:, :, n + m :]
        fz, fw = np.zeros((count, n + m, n + m)), np.zeros((count, n + m, m))
        fz[:, :n], fw[:, :n], fw[:, n:] = D[:, :, : n + m], D[:, :, n + m :], np.eye(m)
        return fz, fw

    def weights(self) -> Array:
        """The weight of every knot in the sum: left ends for held inputs, trapezoids for linear ones; (K,)."""
        weights = np.append(self.dt, 0.0)
        return weights if self.problem.held else 0.5 * (weights + np.append(0.0, self.dt))

    def cost(self, z: Array, w: Array) -> Array:
        """The cost of curves z (K, N, A), w (K-1, m, A), without the goal: (A,)."""
        dz, dw = z - self.reference[:, None], w - self.problem.input[:, None]
        own = 0.5 * np.einsum("k,kia,ij,kja->a", self.weights(), dz, self.P, dz)
        return np.asarray(own + 0.5 * np.einsum("k,kia,ij,kja->a", self.dt, dw, self.S, dw))


def _by_step(dynamics: Dynamics, at: tuple[Array, Array, Array, Array], dt: Array, substeps: int) -> Array:
    """Derivatives of one step for every knot; equal lengths of steps are done together."""
    t, x, left, right = at
    found = np.empty((len(dt), dynamics.n, dynamics.n + 2 * dynamics.m))
    for length in np.unique(dt):
        same = dt == length
        ends = left[:, same], right[:, same]
        found[same] = dynamics.step_slopes(t[same], x[:, same], *ends, float(length), count=substeps)
    return found


def _blocks(a: Array, b: Array) -> Array:
    joined = np.zeros((len(a) + len(b), len(a) + len(b)))
    joined[: len(a), : len(a)], joined[len(a) :, len(a) :] = a, b
    return joined


@dataclass(frozen=True, slots=True)
class _Goal:
    """nu' (x - target) + rho |x - target|^2/2, the augmented Lagrangian of x(T) = target."""

    nu: Array
    rho: float

    def cost(self, miss: Array) -> Array:
        return np.asarray(self.nu @ miss + 0.5 * self.rho * np.sum(miss * miss, axis=0))


@dataclass(frozen=True, slots=True)
class _Policy:
    """Changes of the controls: open loop `k` (K-1, m), feedback `K` (K-1, m, N); `first` (N,) changes the start."""

    k: Array
    K: Array
    first: Array
    promised: float


def plan(dynamics: Dynamics, problem: Problem, report: Report | None = None) -> Proposal:
    """The best curve found, and how the search ended."""
    with np.errstate(all="ignore"):
        return _Planner(_System(dynamics, problem), report).run()


class _Planner:
    def __init__(self, system: _System, report: Report | None) -> None:
        self.system, self.report = system, report
        self.problem = system.problem
        scale = max(1.0, float(np.trace(self.problem.Q)), float(np.trace(self.problem.R)))
        wanted = 10.0 * scale if self.problem.goal else 0.0
        self.goal = _Goal(np.zeros(system.dynamics.n), wanted)
        self.costs: list[float] = []
        self.steps = 0

    def run(self) -> Proposal:
        curve = self._first_guess()
        if curve is None:
            empty = np.zeros((len(self.problem.t), 1))
            return Proposal(outcome=Outcome.DIVERGED, x=empty, u=empty, costs=(), miss=np.inf)
        near = 1e-7 * (1 + float(np.linalg.norm(self.problem.target)))
        curve = self._descend(curve)
        last = self._miss(curve)
        for _ in range(_MOST_ROUNDS if self.problem.goal else 0):
            if last <= near:
                break
            gap = curve.z[-1, : self.system.dynamics.n] - self.problem.target
            self.goal = replace(self.goal, nu=self.goal.nu + self.goal.rho * gap)
            curve = self._descend(curve)
            now = self._miss(curve)
            if now > 0.25 * last:
                self.goal = replace(self.goal, rho=10.0 * self.goal.rho)
            last = now
        missed = self.problem.goal and last > 1e-3 * (1 + float(np.linalg.norm(self.problem.target)))
        x, u = self._read(curve)
        outcome = Outcome.MISSED if missed else Outcome.FOUND
        return Proposal(outcome=outcome, x=x, u=u, costs=tuple(self.costs), miss=last)

    def _read(self, curve: _Curve) -> tuple[Array, Array]:
        n = self.system.dynamics.n
        if self.problem.held:
            return curve.z, np.concatenate([curve.w, curve.w[-1:]])
        return curve.z[:, :n], curve.z[:, n:]

    def _miss(self, curve: _Curve) -> float:
        return float(np.linalg.norm(curve.z[-1, : self.system.dynamics.n] - self.problem.target))

    def _first_guess(self) -> _Curve | None:
        """The best of: the reference input, and shares of a feedback that would hold the target."""
        count, m = len(self.system.dt), self.system.dynamics.m
        still = _Curve(
            np.tile(self.system.reference, (count + 1, 1)), np.tile(self.problem.input, (count, 1))
        )
        policy = self._backward(still, 0.0)
        gains = np.zeros((count, m, self.system.size)) if policy is None else policy.K
        shares = np.array([1.0, 0.5, 0.25, 0.0])
        z = np.tile(self.system.start[:, None], len(shares))
        curves, controls = [z], []
        for k in range(count):
            w = self.problem.input[:, None] + shares * (gains[k] @ (z - self.system.reference[:, None]))
            z = self.system.step(k, z, w)
            curves.append(z)
            controls.append(w)
        return self._best(np.array(curves), np.array(controls), np.inf)

    def _best(self, z: Array, w: Array, below: float) -> _Curve | None:
        """The curve of least cost among columns, if it costs less than `below`."""
        total = self._total(z, w)
        best = int(np.argmin(total))
        if not total[best] < below:
            return None
        self.costs.append(float(total[best]))
        return _Curve(z[:, :, best], w[:, :, best])

    def _total(self, z: Array, w: Array) -> Array:
        gap = z[-1, : self.system.dynamics.n] - self.problem.target[:, None]
        total = self.system.cost(z, w) + self.goal.cost(gap)
        usable = np.isfinite(total) & (np.abs(z).max(axis=(0, 1)) < _HUGE)
        return np.where(usable, total, np.inf)

    def _descend(self, curve: _Curve) -> _Curve:
        """Steps until nothing is gained; a step that gains nothing is tried again with a stiffer model."""
        mu = 0.0
        self.costs.append(float(self._total(curve.z[:, :, None], curve.w[:, :, None])[0]))
        while self.steps < _MOST_STEPS * (1 + _MOST_ROUNDS):
            self.steps += 1
            before = self.costs[-1]
            policy = self._backward(curve, mu)
            if policy is not None and policy.promised <= 1e-13 * (1 + abs(before)):
                break
            better = self._search(curve, policy) if policy is not None else None
            if self.report is not None:
                self.report(self.steps, self.costs[-1])
            if better is None:
                mu = max(1e-6, 10.0 * mu)
                if mu > _STIFFEST:
                    break
                continue
            mu = 0.0 if mu < 1e-5 else mu / 10.0
            curve = better
            if before - self.costs[-1] <= 1e-12 * (1 + abs(before)):
                break
        return curve

    def _search(self, curve: _Curve, policy: _Policy) -> _Curve | None:
        """All lengths of the step at once; the best one that keeps a part of what was promised."""
        z = curve.z[0][:, None] + policy.first[:, None] * _SHARES
        curves, controls = [z], []
        for k in range(len(curve.w)):
            w = curve.w[k][:, None] + policy.k[k][:, None] * _SHARES + policy.K[k] @ (z - curve.z[k][:, None])
            z = self.system.step(k, z, w)
            curves.append(z)
            controls.append(w)
        return self._best(np.array(curves), np.array(controls), self.costs[-1])

    def _backward(self, curve: _Curve, mu: float) -> _Policy | None:
        """Riccati pass; None where the model is not convex in the controls."""
        system, n = self.system, self.system.dynamics.n
        fz, fw = system.slopes(curve)
        if not (np.isfinite(fz).all() and np.isfinite(fw).all()):
            return None
        weights = system.weights()
        dz, dw = curve.z - system.reference, curve.w - self.problem.input
        V = weights[-1] * system.P
        v = V @ dz[-1]
        V[:n, :n] += self.goal.rho * np.eye(n)
        v[:n] += self.goal.nu + self.goal.rho * (curve.z[-1, :n] - self.problem.target)
        count, m = curve.w.shape
        ks, Ks, promised = np.zeros((count, m)), np.zeros((count, m, system.size)), 0.0
        for i in range(count - 1, -1, -1):
            Qw = system.dt[i] * system.S @ dw[i] + fw[i].T @ v
            Qz = weights[i] * system.P @ dz[i] + fz[i].T @ v
            Qww = system.dt[i] * system.S + fw[i].T @ V @ fw[i] + mu * system.dt[i] * np.eye(m)
            Qwz, Qzz = fw[i].T @ V @ fz[i], weights[i] * system.P + fz[i].T @ V @ fz[i]
            try:
                np.linalg.cholesky(Qww)
            except np.linalg.LinAlgError:
                return None
            both = -np.linalg.solve(Qww, np.column_stack([Qw, Qwz]))
            ks[i], Ks[i] = both[:, 0], both[:, 1:]
            promised -= 0.5 * float(Qw @ ks[i])
            v = Qz + Qwz.T @ ks[i]
            V = Qzz + Qwz.T @ Ks[i]
            V = 0.5 * (V + V.T)
        first = np.zeros(system.size)
        if not self.problem.held:  # the input at the first knot is free
            first[n:] = -np.linalg.solve(V[n:, n:] + mu * np.eye(m), v[n:])
            promised -= 0.5 * float(v[n:] @ first[n:])
        return _Policy(ks, Ks, first, promised)
