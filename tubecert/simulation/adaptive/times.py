"""The times of the steps, and the plan at them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.model import TIME
from tubecert.simulation.adaptive.loops import Problem
from tubecert.spec import Knots
from tubecert.trajectory import Plan

_SAME = 1e-11  # of the horizon: times that differ by less are one
_FEWEST_STEPS = 64
TIMES = 251  # output times of the loops that are drawn
START, MIDDLE, END = range(3)  # of a step: the places of its plans


class Reference(NamedTuple):
    """The plan at times: x*, f(x*) + B(x*)u*, u*."""

    x: Array
    speed: Array
    u: Array


class Grid(NamedTuple):
    """Steps of a level: when they begin, (S + 1,) in s, and their lengths, the last 0; `outputs` (K,) are output times.

    `plan`: x* (S + 1, 3, n, L), f(x*) + B(x*)u* (S + 1, 3, n, L) and u* (S + 1, 3, m, L) of L plans at start, middle
    and end of every step; where u* jumps, the side that belongs to the step.
    """

    level: int
    start: Array
    length: Array
    outputs: NDArray[np.int64]
    plan: Reference


def kinks_of(knots: Knots) -> Array:
    """Times that no step may straddle: where u* has corners, or until when it is held; (K,)."""
    values = knots.u
    if knots.interpolation == "hermite-simpson":
        return np.array([float(t) for t in knots.t[2::2]])
    if knots.interpolation == "hold":
        # also where u* does not jump: a step is evaluated on one piece of the plan
        return np.array([float(t) for t in knots.t[1:]])
    slopes = [
        tuple((p - q) / (s - t) for p, q in zip(a, b, strict=True))
        for a, b, s, t in zip(values[1:], values, knots.t[1:], knots.t, strict=False)
    ]
    inner = zip(knots.t[1:], slopes, slopes[1:], strict=False)
    return np.array([float(t) for t, a, b in inner if a != b])


def output_times(plan: Plan, horizon: float) -> Array:
    """About `TIMES` times, or more: corners of the plan if it has as many, for steps end there anyway."""
    kinks = np.zeros(0) if plan.knots is None else kinks_of(plan.knots)
    inner = kinks[kinks < horizon * (1 - _SAME)]
    every = len(inner) // (TIMES - 1)
    return np.array([0.0, *inner[every - 1 :: every], horizon]) if every else np.linspace(0.0, horizon, TIMES)


def steps(problem: Problem, level: int, plans: Sequence[Plan], count: int | None = None) -> Grid:
    """The steps of a level, each level with twice as many as the one before, along some plans.

    With a `count` so many equal ones, which pass over the corners of plans, and no output times but the ends.
    """
    end, kinks = problem.horizon, [kinks_of(plan.knots) for plan in plans if plan.knots]
    inner = [] if count else [problem.times, *(own[own < end] for own in kinks)]
    t = np.unique(np.minimum(np.concatenate([[0.0, end], *inner]), end))  # ends of steps
    t = t[np.append(True, np.diff(t) > _SAME * end)]
    t[-1] = end
    fewest = np.ceil(np.diff(t) / end * (count or _FEWEST_STEPS))
    counts = np.maximum(1, fewest).astype(np.int64) * 2**level
    first = np.concatenate([[0], np.cumsum(counts)])
    length = np.repeat(np.diff(t) / counts, counts)
    start = np.repeat(t[:-1], counts) + (np.arange(first[-1]) - np.repeat(first[:-1], counts)) * length
    seen = first if count else first[np.searchsorted(t, problem.times - 2 * _SAME * end)]
    courses = [_course(problem, plan, start, length) for plan in plans]
    return Grid(
        level=level,
        start=np.append(start, end),
        length=np.append(length, 0.0),
        outputs=seen,
        plan=Reference(*(np.stack(part, axis=-1) for part in zip(*courses, strict=True))),
    )


def _course(problem: Problem, plan: Plan, start: Array, length: Array) -> Reference:
    """A plan at start, middle and end of every step (S,), and after the last one."""
    model, S = problem.model, len(start)
    t = np.minimum(start[:, None] + length[:, None] * np.array([0.0, 0.5, 1.0]), problem.horizon)
    span = None
    if plan.spans is not None:
        piece = np.searchsorted(plan.spans.lo, t[:, 1], side="right") - 1
        span = np.repeat(np.clip(piece, 0, len(plan.spans.lo) - 1), 3).astype(float)
    flat = t.ravel()
    x, u = (part.mid.reshape(S, 3, -1) for part in plan.enclose(flat, flat, span))
    drift = Tape([row[0] for row in model.drift_on_plan()], (*model.states, *model.inputs, TIME))
    values = [*np.moveaxis(x, -1, 0), *np.moveaxis(u, -1, 0), t]
    speed = np.moveaxis(drift.run_floats(values, (S, 3)), 0, -1)
    return Reference(*(np.concatenate([part, np.repeat(part[-1:, 2:], 3, axis=1)]) for part in (x, speed, u)))
