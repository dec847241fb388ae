"""The loops in continuous time as lanes of one vector: plant, feedback, and the fast part of every loop.

x' = f + B(u* + k + u_a + h) + E w, (0.1) with (0.4). The stages are those of the exponential Runge-Kutta method of
Krogstad: between them h is the polynomial of time through the stages so far, and the fast part flows under it. Without
a fast part this is classical RK4. Of second order is what a moving B does to the fast part, and its projection, which
the flow over the whole step has, and those up to the stages have not. The feedback (0.5) is the smallest k with
phi_0 + phi_1'k <= 0: k = 0 if phi_0 <= 0, else -phi_0 phi_1/|phi_1|^2, where phi_0 = -2 gamma_s(0)'M(f(x*) + B(x*)u*)
+ 2 gamma_s(1)'M(f(x) + B(x)u*) + 2 rate E and phi_1 = 2 B'M gamma_s(1). Source: S. Krogstad, Generalized integrating
factor methods for stiff PDEs, J. Comput. Phys. 203, 2005.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import log
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression
from tubecert.expression.matrix import Matrix
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulation.adaptive.flows import Fast, Flow, blocks, driven
from tubecert.simulation.adaptive.geodesics import FOUND, REASONS, Geodesic, Geodesics
from tubecert.simulation.adaptive.loops import Found, Lanes, LoopGains, Problem, Seen, Sizes, mapped
from tubecert.simulation.adaptive.times import END, MIDDLE, START, Grid, Reference
from tubecert.simulation.plans import SHARES, stepped

INFEASIBLE: Final = 10
DIVERGED: Final = 20
_NOTHING: Final = 1e-300  # so small that nothing is divided by less
_ROUNDING: Final = 1e-12
_SIDES: Final = (START, MIDDLE, MIDDLE, END)  # of a step, stage by stage
_STEEP: Final = 3.0  # how much more than a sine the wave of a wind is a square
_THIN: Final = 0.05  # of the layer: where a wind that aims turns round
_CHUNK: Final = 64  # steps whose peaks are taken at once


class _Instant(NamedTuple):
    """Lanes at the start of a step, two sizes `within` the step before, (2, N), and which of them are `alive`."""

    seen: Seen
    within: Array
    alive: NDArray[np.bool_]


@lru_cache(maxsize=4)
def _tapes(
    model: ControlAffineModel, base: tuple[Expression, ...] | None, E: Matrix, rest: Matrix
) -> tuple[Tape, Tape]:
    """f, base h, E, the rest and, where it moves, B, of t, states and parameters; B alone. Kept for the next level."""
    inputs = (TIME, *model.states, *dict(model.parameters))
    B, nothing = [entry for row in model.B for entry in row], [ZERO] * len(model.inputs)
    beside = [row[0] for row in rest] or [ZERO] * len(model.f)
    outputs = [*model.f, *(base or nothing), *(e for row in E for e in row), *beside]
    return Tape([*outputs, *([] if model.constant_input else B)], inputs), Tape(B, inputs)


class Acting:
    """The plant of lanes, and their disturbances."""

    def __init__(self, problem: Problem, lanes: Lanes) -> None:
        model, E, rest = problem.model, problem.E, problem.rest
        n, m, k = self._sizes = len(model.states), len(model.inputs), len(E[0]) if E else 0
        self._lanes, self._own = lanes, lanes.h
        self._plant, self._input = _tapes(model, lanes.h.base, E, rest)
        nothing = [np.zeros(())] * len(self._input.inputs)
        self._B = self._input.run_floats(nothing, ()).reshape(n, m) if model.constant_input else None
        ends = np.cumsum([0, n, m, n * k, n, n * m * (self._B is None)]).tolist()
        self._parts = [slice(a, b) for a, b in pairwise(ends)]
        self._pushes, self._blows = bool(self._own.push.any()), bool(self._own.wind.any())
        self._clips = bool(np.isfinite(self._own.radius).any())
        self._theta = np.zeros((len(model.parameters), len(lanes.based)))
        self._theta[: len(self._own.theta)] = self._own.theta

    def terms(self, t: float, x: Array) -> tuple[Array, Array, Array, Array, Array]:
        """f (n, N), B (n, m, N) or constant (n, m), the base of h (m, N), E (n, k, N), the rest (n, N), at x (n, N).

        The rest is what unknown parameters do that no input can.
        """
        (n, m, k), N = self._sizes, x.shape[1]
        values = self._plant.run_floats_silenced([np.array(t), *x, *self._theta], (N,))
        f, base, E, rest, B = (values[part] for part in self._parts)
        B, base = B.reshape(n, m, N) if self._B is None else self._B, base * self._lanes.based
        return f, B, base, E.reshape(n, k, N), rest * self._lanes.unknown

    def input(self, t: float, x: Array) -> Array:
        """B alone, where it moves."""
        values = self._input.run_floats_silenced([np.array(t), *x, *self._theta], x.shape[1:])
        return values.reshape(*self._sizes[:2], -1)

    def h(self, t: float, x: Array, h: Array, push: Array) -> Array:
        """h (m, N) at x (n, N), from its base; `push` (m, N) is B'M gamma_s."""
        own = self._own
        if len(own.phase):
            angle = own.frequency * t + np.einsum("win,in->wn", own.wave, x) + own.phase
            h += np.einsum("wjn,wn->jn", own.amplitude, np.sin(angle))
        if self._pushes:
            h += own.push / np.sqrt(np.einsum("jn,jn->n", push, push) + own.layer**2) * push
        if self._clips:
            size = np.sqrt(np.einsum("jn,jn->n", h, h))
            h *= np.minimum(1.0, own.radius / np.maximum(size, _NOTHING))
        return np.asarray(h)

    def wind(self, t: float, E: Array, pushes: tuple[Array, Array]) -> Array | float:
        """E w (n, N); `pushes`: M gamma_s and B B'M gamma_s."""
        if not self._blows:
            return 0.0
        own, aims = self._own, [(E * way[:, None]).sum(axis=0) for way in pushes]
        w = np.where(own.aim == 0, own.blowing, np.where(own.aim == 1, *aims))
        square = np.where(own.aim > 0, (_THIN * own.layer) ** 2, 0.0) + (w**2).sum(axis=0)
        wave = np.clip(_STEEP * np.sin(own.gusting[0] * t + own.gusting[1]), -1.0, 1.0)
        share = np.where(square > 0, own.wind * wave / np.sqrt(square), 0.0)
        return np.asarray((E * (share * w)).sum(axis=1))


def reason(stopped: int, limit: float) -> str:
    """Why a lane was stopped."""
    far = f"the state diverges from the plan: |x - x*| exceeds {near(limit, 4)}"
    return {**REASONS, INFEASIBLE: "no input makes the metric contract here", DIVERGED: far}[stopped]


class Continuous:
    """Some lanes on a grid, once from start to end; `loops`: whether they adapt, and the gains of their filters.

    `_stopped` (N,) is 0 for the lanes that go on; the others may have any values. Above 0 it is why they failed.

    `_y` (Y, N) is the fast part of every lane at the start of the step (`flows.blocks`); in `_known` behind it stands h
    at every stage, with E w after it where one blows, (F, N), and in `_B` B (n, m, N) or (n, m).
    """

    def __init__(
        self, problem: Problem, loops: Sequence[tuple[bool, LoopGains | None]], lanes: Lanes, grid: Grid
    ) -> None:
        (n, N), m, self._P = lanes.start.shape, len(problem.model.inputs), problem.P
        self._grid, self._start = grid, lanes.start
        self._plans = lanes.plan if grid.plan.x.shape[-1] > 1 else None
        self._decay, self._far = 2 * float(problem.model.rate), problem.limit**2
        self._acting, self._geodesics = Acting(problem, lanes), Geodesics(problem.model, problem.degree, N)
        self._at, self._blown = blocks(n, m), bool(problem.E or problem.rest)
        self._forces = m + n * self._blown
        self._known = np.zeros((self._at.end + len(_SIDES) * self._forces, N))
        self._y, self._within = self._known[: self._at.end], np.zeros((2, N))
        self._fast, self._flows = list[tuple[slice, Fast]](), dict[float, list[Flow]]()
        self._predicts, self._roots = np.zeros(N, dtype=bool), np.ones(N)
        for a, b in pairwise([0, *(np.flatnonzero(np.diff(lanes.loop)) + 1).tolist(), N]):
            self._predicts[a:b], gains = loops[lanes.loop[a]]
            if gains:
                fast = Fast(bool(self._predicts[a]), gains, self._P, m, self._forces)
                self._fast.append((slice(a, b), fast))
                self._roots[a:b] = fast.root
        self._stopped, self._ended = np.zeros(N, dtype=np.int64), np.full(N, np.nan)
        self._B, self._own, self._rows = list[Array](), list[Flow](), list[_Instant]()

    def followed(self) -> Found:
        """What is found: peaks over all steps, and what is seen at the output times."""
        x, last = self._start, len(self._grid.length) - 1
        with np.errstate(all="ignore"):
            for step, length in enumerate(self._grid.length.tolist()):
                self._step = step
                slope = self._slope(0, x)
                if step == 0:
                    found = self._nothing(self._rows[0].seen)
                if step < last:
                    x = stepped(self._slope, x, length, slope) + self._flowed()
                over = step == last or self._stopped.all()
                if over or len(self._rows) == _CHUNK:
                    self._keep(found, mapped(lambda *each: np.stack(each), *self._rows))
                    self._rows.clear()
                if over:
                    break
        return found

    def _nothing(self, seen: Seen) -> Found:
        """What is found before the first step, of which this is seen."""
        N, inputs, sizes = len(self._stopped), seen.u.shape, len(Sizes._fields)
        return Found(
            seen=mapped(lambda part: np.full((len(self._grid.outputs), *part.shape), np.nan), seen),
            peak=Sizes(*np.full((sizes, N), -np.inf)),
            peak_time=Sizes(*np.zeros((sizes, N))),
            least=np.full(inputs, np.inf),
            greatest=np.full(inputs, -np.inf),
            stopped=self._stopped,
            ended=self._ended,
            error=np.full(N, np.inf),
            unresolved=np.full(N, np.nan),
            steps=np.full(N, len(self._grid.start) - 1),
        )

    def _keep(self, found: Found, own: _Instant) -> None:
        """Peaks of S instants (S, .., N), up to the one of the moment, and those of them that are at output times."""
        alive, live, end = own.alive, own.alive[:, None], self._step + 1
        first, lanes = end - len(alive), np.arange(alive.shape[1])
        for size, peak, time in zip(self._sizes(own), found.peak, found.peak_time, strict=True):
            alone = np.where(alive, size, -np.inf)
            best = np.argmax(alone, axis=0)
            higher = alone[best, lanes] > peak
            peak[higher] = alone[best, lanes][higher]
            time[higher] = self._grid.start[first + best[higher]]
        np.minimum(found.least, np.where(live, own.seen.u, np.inf).min(axis=0), out=found.least)
        np.maximum(found.greatest, np.where(live, own.seen.u, -np.inf).max(axis=0), out=found.greatest)
        low, high = np.searchsorted(self._grid.outputs, [first, end])
        at = self._grid.outputs[low:high] - first
        for seen, part in zip(found.seen, own.seen, strict=True):
            seen[low:high] = np.where(alive[at] if part.ndim == 2 else live[at], part[at], np.nan)

    def _sizes(self, own: _Instant) -> Sizes:
        """Of S instants, (S, N). xtilde and sigma_hat may turn often in a step: theirs are the largest since before."""
        seen, length = own.seen, self._length
        error = np.where(self._predicts, _norm(seen.sigma_hat - seen.h), 0.0)
        return Sizes(
            distance=seen.distance,
            deviation=length(seen.off),
            u=_norm(seen.u),
            k=_norm(seen.k),
            xtilde=np.maximum(length(seen.xtilde), own.within[:, 0]),
            sigma_error=np.maximum(error, own.within[:, 1]),
            speed=length(seen.slope),
        )

    def _length(self, z: Array) -> Array:
        """|S z| of (S, n, N), in the coordinates of the tube."""
        return np.asarray(np.sqrt(np.maximum((z * (self._P @ z)).sum(axis=1), 0.0)))

    def _slope(self, stage: int, x: Array) -> Array:
        """f + B(u* + k + h) + E w (n, N) at a stage of the step; what u_a has added to x meanwhile is added here."""
        t = float(self._grid.start[self._step] + SHARES[stage] * self._grid.length[self._step])
        # (.., 1) if that is one
        plan = Reference(*(part[self._step, _SIDES[stage]] for part in self._grid.plan))
        if self._plans is not None:
            plan = Reference(*(part[:, self._plans] for part in plan))
        if stage == 0:
            self._B.clear()
        elif self._fast:
            x = x + self._flown(stage, x)
        x = self._near(x, plan.x)
        f, B, base, E, rest = self._acting.terms(t, x)
        geodesic = self._geodesics.connect(plan.x, x)
        self._stop(geodesic.status != FOUND, geodesic.status)
        ahead = f + driven(B, plan.u)
        push = _reached(B, geodesic.end)
        k = self._feedback(plan, ahead, push, geodesic)
        h = self._acting.h(t, x, base, push)
        slope = ahead + driven(B, k + h)
        first = self._at.end + stage * self._forces
        self._known[first : first + len(h)] = h
        self._B.append(B)
        if self._blown:
            wind = rest + self._acting.wind(t, E, (geodesic.end, driven(B, push)))
            self._known[first + len(h) : first + self._forces] = wind
            slope += wind
        if stage == 0:
            _, sigma_hat, u_a, _ = (self._y[own].copy() for own in self._at[:-1])
            seen = Seen(
                x=x,
                off=x - plan.x,
                slope=slope + driven(B, u_a),
                u=plan.u + k + u_a,
                k=k,
                u_a=u_a,
                sigma_hat=sigma_hat,
                h=h,
                xtilde=self._y[self._at.xi] / self._roots,
                distance=np.sqrt(np.maximum(geodesic.energy, 0.0)),
            )
            self._rows.append(_Instant(seen, self._within.copy(), self._stopped == FOUND))
        return slope

    def _near(self, x: Array, plan: Array) -> Array:
        """x, and the plan for lanes that are stopped because they are nowhere near it, or were before."""
        off = x - plan
        self._stop(~(np.einsum("in,in->n", off, off) <= self._far), DIVERGED)  # not for nan
        return np.where(self._stopped, plan, x) if self._stopped.any() else x

    def _stop(self, lanes: NDArray[np.bool_], why: NDArray[np.int64] | int) -> None:
        if lanes.any():
            new = lanes & (self._stopped == FOUND)
            self._ended[new] = self._grid.start[self._step]
            self._stopped[:] = np.where(new, why, self._stopped)

    def _feedback(self, plan: Reference, ahead: Array, push: Array, geodesic: Geodesic) -> Array:
        """k (m, N) of (0.5); `ahead` is f(x) + B(x)u*, `push` is phi_1/2."""
        lost = np.einsum("in,in->n", plan.speed, geodesic.start)
        gained = np.einsum("in,in->n", geodesic.end, ahead)
        phi, reach = self._decay * geodesic.energy + 2 * (gained - lost), np.einsum("jn,jn->n", push, push)
        if not reach.all():
            self._stop((reach == 0) & (phi > _ROUNDING * (np.abs(lost) + np.abs(gained))), INFEASIBLE)
        return np.asarray(np.minimum(-phi, 0.0) / (2 * np.maximum(reach, _NOTHING)) * push)

    def _flown(self, stage: int, x: Array) -> Array:
        """What u_a has added to the slow state until a stage (n, N): B of the stage before times V."""
        if stage == 1:
            self._own = self._flows_of(x, float(self._grid.length[self._step]))
        V = np.zeros((self._at.V.stop - self._at.V.start, len(self._stopped)))
        for (lanes, fast), flow in zip(self._fast, self._own, strict=True):
            known = self._known[: self._at.end + stage * self._forces, lanes]
            V[:, lanes] = fast.idle(flow, fast.ahead(known), whole=stage == 3)
        return driven(self._B[-1], V)

    def _flows_of(self, x: Array, length: float) -> list[Flow]:
        """Those of the step, for B at its middle, where x comes but for u_a."""
        level, B = self._grid.level, self._B[0]
        if B.ndim == 3:
            t, u_a = float(self._grid.start[self._step]) + length / 2, self._y[self._at.u_a]
            B = self._acting.input(t, x + length / 2 * driven(B, u_a))
            return [fast.flow(B[..., lanes], length, level) for lanes, fast in self._fast]
        same = round(log(length), 10)  # lengths that differ by rounding are one
        if same not in self._flows:
            self._flows[same] = [fast.flow(B, length, level) for _, fast in self._fast]
        return self._flows[same]

    def _flowed(self) -> Array | float:
        """Takes the fast part to the end of the step; what u_a has added to x."""
        if not self._fast:
            return 0.0
        for (lanes, fast), flow in zip(self._fast, self._own, strict=True):
            z = fast.ahead(self._known[:, lanes])
            self._y[:, lanes], self._within[:, lanes] = fast.advance(flow, z)
        a, b, c, d = self._B
        moved = driven(a if a.ndim == 2 else (a + 2 * (b + c) + d) / 6, self._y[self._at.V])
        self._y[self._at.V] = 0.0
        if self._stopped.any():
            self._y[:, self._stopped != FOUND] = 0.0
        return moved


def _norm(z: Array) -> Array:
    return np.asarray(np.sqrt((z**2).sum(axis=1)))


def _reached(B: Array, m: Array) -> Array:
    """B'm (m, N)."""
    return np.asarray(B.T @ m if B.ndim == 2 else np.einsum("ijn,in->jn", B, m))
