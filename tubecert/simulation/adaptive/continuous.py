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

from collections.abc import Mapping, Sequence
from itertools import groupby
from math import log
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.acting import Acting
from tubecert.simulation.adaptive.flows import Fast, Flow, blocks, times
from tubecert.simulation.adaptive.geodesics import FOUND, REASONS, Geodesic, Geodesics
from tubecert.simulation.adaptive.loops import Batch, Disturbance
from tubecert.simulation.adaptive.times import END, MIDDLE, START, Grid, Reference
from tubecert.simulation.plans import SHARES
from tubecert.trajectory import Plan

INFEASIBLE: Final = 10
DIVERGED: Final = 20
_NOTHING: Final = 1e-300  # so small that nothing is divided by less
_ROUNDING: Final = 1e-12
_SIDES: Final = (START, MIDDLE, MIDDLE, END)  # of a step, stage by stage


class _Group(NamedTuple):
    """Lanes whose fast part is the same, and its flows by the logarithm of the step's length, where B is constant."""

    lanes: slice
    fast: Fast
    flows: dict[float, Flow]


def reason(stopped: int, limit: float) -> str:
    """Why a lane was stopped."""
    own = {
        INFEASIBLE: "no input makes the metric contract here",
        DIVERGED: f"the state diverges from the plan: |x - x*| exceeds {near(limit, 4)}",
    }
    return {**REASONS, **own}[stopped]


class Continuous:
    """The lanes of some batches on a grid, for `lanes.follow`: peaks are taken of their `sizes`.

    `kept` stays, of what is seen, at the output times. `stopped` (N,) is 0 for the lanes that go on; the others may
    have any values. Above 0 it is why they failed.

    `_y` (Y, N) is the fast part of every lane at the start of the step (`flows.blocks`); in `_known` behind it stands h
    at every stage, with E w after it where one blows, (F, N), and in `_B` B (n, m, N) or (n, m).
    """

    kept = ("x", "off", "slope", "u", "k", "u_a", "sigma_hat", "h", "xtilde", "distance")

    def __init__(self, batches: Sequence[Batch], grid: Grid, plans: Sequence[Plan]) -> None:
        first = batches[0][0]
        n, m = len(first.model.states), len(first.model.inputs)
        problems = [problem for problem, cases in batches for _ in cases.start.T]
        self.grid, self._N = grid, len(problems)
        self._decay = 2 * float(first.model.rate)
        self._P = np.eye(n) if first.P is None else first.P
        self._x0 = np.hstack([cases.start for _, cases in batches])
        acting = [
            Disturbance.nothing(n, m, cases.start.shape[1]) if problem.controller == "nominal" else cases.h
            for problem, cases in batches
        ]
        self._acting = Acting(acting, first.model, first.E, first.rest)
        self._geodesics = Geodesics(first.model, first.degree, self._N)
        self._at, self._blown = blocks(n, m), bool(first.E or first.rest)
        self._forces = m + n * self._blown
        places = {id(plan): place for place, plan in enumerate(plans)}
        self._plans = np.array([places[id(own.plan)] for own in problems]) if len(plans) > 1 else None
        self._far = np.array([own.limit for own in problems]) ** 2
        self._predicts = np.array([own.adapts for own in problems])
        self._roots, self._groups, end = np.ones(self._N), list[_Group](), 0
        for (adapts, gains), group in groupby(
            problems, key=lambda own: (own.adapts, own.filters and own.gains)
        ):
            lanes = slice(end, end := end + len([*group]))
            if gains:
                self._groups.append(_Group(lanes, Fast(adapts, gains, self._P, m, self._forces), {}))
                self._roots[lanes] = self._groups[-1].fast.root
        self.stopped = np.zeros(self._N, dtype=np.int64)

    def start(self) -> Array:
        """x (n, N) at the start."""
        self.stopped[:] = FOUND
        self._known = np.zeros((self._at.end + len(_SIDES) * self._forces, self._N))
        self._y, self._within = self._known[: self._at.end], np.zeros((2, self._N))
        self._B, self._own = list[Array](), list[Flow]()
        return self._x0.copy()

    def at(self, step: int, stage: int, x: Array) -> Array:
        """f + B(u* + k + h) + E w (n, N); what u_a has added to x meanwhile is added here."""
        t = float(self.grid.start[step] + SHARES[stage] * self.grid.length[step])
        plan = self._plan(step, _SIDES[stage])
        if stage == 0:
            self._B.clear()
        elif self._groups:
            x = x + self._flown(step, stage, x)
        x = self._near(x, plan.x)
        terms = self._acting.terms(t, x)
        geodesic = self._geodesics.connect(plan.x, x)
        self._stop(geodesic.status != FOUND, geodesic.status)
        ahead = terms.f + times(terms.B, plan.u)
        push = _reached(terms.B, geodesic.end)
        k = self._feedback(plan, ahead, push, geodesic)
        h = self._acting.h(t, x, terms.base, push)
        slope = ahead + times(terms.B, k + h)
        first = self._at.end + stage * self._forces
        self._known[first : first + len(h)] = h
        self._B.append(terms.B)
        if self._blown:
            wind = self._acting.wind(t, terms, (geodesic.end, times(terms.B, push)))
            self._known[first + len(h) : first + self._forces] = wind
            slope += wind
        if stage == 0:
            distance = np.sqrt(np.maximum(geodesic.energy, 0.0))
            seen = {"x": x, "off": x - plan.x, "k": k, "h": h, "u": plan.u + k, "distance": distance}
            self._seen = seen
        return slope

    def _plan(self, step: int, side: int) -> Reference:
        """The plans of all lanes, (.., 1) if that is one."""
        found = (part[step, side] for part in self.grid.plan)
        return Reference(*(found if self._plans is None else (part[:, self._plans] for part in found)))

    def _near(self, x: Array, plan: Array) -> Array:
        """x, and the plan for lanes that are stopped because they are nowhere near it, or were before."""
        off = x - plan
        self._stop(~(np.einsum("in,in->n", off, off) <= self._far), DIVERGED)  # not for nan
        return np.where(self.stopped, plan, x) if self.stopped.any() else x

    def _stop(self, lanes: NDArray[np.bool_], why: NDArray[np.int64] | int) -> None:
        if lanes.any():
            self.stopped[:] = np.where(lanes & (self.stopped == FOUND), why, self.stopped)

    def _feedback(self, plan: Reference, ahead: Array, push: Array, geodesic: Geodesic) -> Array:
        """k (m, N) of (0.5); `ahead` is f(x) + B(x)u*, `push` is phi_1/2."""
        lost = np.einsum("in,in->n", plan.speed, geodesic.start)
        gained = np.einsum("in,in->n", geodesic.end, ahead)
        phi, reach = self._decay * geodesic.energy + 2 * (gained - lost), np.einsum("jn,jn->n", push, push)
        if not reach.all():
            self._stop((reach == 0) & (phi > _ROUNDING * (np.abs(lost) + np.abs(gained))), INFEASIBLE)
        return np.asarray(np.minimum(-phi, 0.0) / (2 * np.maximum(reach, _NOTHING)) * push)

    def _flown(self, step: int, stage: int, x: Array) -> Array:
        """What u_a has added to the slow state until a stage (n, N); it is V times the mean of B so far."""
        if stage == 1:
            self._prepare(step, x)
        V = np.zeros((self._at.V.stop - self._at.V.start, self._N))
        for group, flow in zip(self._groups, self._own, strict=True):
            known = self._known[: self._at.end + stage * self._forces, group.lanes]
            V[:, group.lanes] = group.fast.idle(flow, group.fast.ahead(known), whole=stage == 3)
        return times(self._B[-1], V)

    def _prepare(self, step: int, x: Array) -> None:
        """The flows of a step: those of B at its middle, where x comes but for u_a."""
        length, level = float(self.grid.length[step]), self.grid.level
        t, B = float(self.grid.start[step]) + length / 2, self._B[0]
        if B.ndim == 3:
            B = self._acting.input(t, x + length / 2 * times(B, self._y[self._at.u_a]))
            self._own = [group.fast.flow(B[..., group.lanes], length, level) for group in self._groups]
            return
        same = round(log(length), 10)  # lengths that differ by rounding are one
        for group in self._groups:
            if same not in group.flows:
                group.flows[same] = group.fast.flow(B, length, level)
        self._own = [group.flows[same] for group in self._groups]

    def step(self, step: int) -> Array | float:
        """Takes the fast part to the end of a step; what u_a has added to x."""
        if not self._groups:
            return 0.0
        for group, flow in zip(self._groups, self._own, strict=True):
            z = group.fast.ahead(self._known[:, group.lanes])
            self._y[:, group.lanes], self._within[:, group.lanes] = group.fast.advance(flow, z)
        a, b, c, d = self._B
        moved = times(a if a.ndim == 2 else (a + 2 * (b + c) + d) / 6, self._y[self._at.V])
        self._y[self._at.V] = 0.0
        if self.stopped.any():
            self._y[:, self.stopped != FOUND] = 0.0
        return moved

    def instant(self, slope: Array) -> dict[str, Array]:
        """What is seen of the lanes at the start of a step; `off` is x - x*, `within` what the step before had seen."""
        at, y = self._at, self._y
        u_a = y[at.u_a].copy()
        return {
            **self._seen,
            "u_a": u_a,
            "sigma_hat": y[at.sigma_hat].copy(),
            "xtilde": y[at.xi] / self._roots,
            "u": self._seen["u"] + u_a,
            "slope": slope + times(self._B[0], u_a),
            "within": self._within.copy(),
        }

    def sizes(self, rows: Mapping[str, Array]) -> dict[str, Array]:
        """What peaks are taken of, (S, N), from what was seen at S instants, (S, .., N).

        d(x*, x), |S (x - x*)|, |u|, |k|, |S xtilde|, |sigma_hat - h|, |S x'|. xtilde and sigma_hat may turn often in a
        step: theirs are the largest since the step before.
        """
        length, error = self._length, np.where(self._predicts, _norm(rows["sigma_hat"] - rows["h"]), 0.0)
        xtilde, within = length(rows["xtilde"]), np.moveaxis(rows["within"], 1, 0)
        return {
            "distance": rows["distance"],
            "deviation": length(rows["off"]),
            "u": _norm(rows["u"]),
            "k": _norm(rows["k"]),
            "xtilde": np.maximum(xtilde, within[0]),
            "sigma_error": np.maximum(error, within[1]),
            "speed": length(rows["slope"]),
        }

    def _length(self, z: Array) -> Array:
        """|S z| of (S, n, N), in the coordinates of the tube."""
        return np.asarray(np.sqrt(np.maximum((z * (self._P @ z)).sum(axis=1), 0.0)))


def _norm(z: Array) -> Array:
    return np.asarray(np.sqrt((z**2).sum(axis=1)))


def _reached(B: Array, m: Array) -> Array:
    """B'm (m, N)."""
    return np.asarray(B.T @ m if B.ndim == 2 else np.einsum("ijn,in->jn", B, m))
