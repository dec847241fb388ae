"""The times of the steps, the plan at them, and the gains in the form that compiled lanes read."""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.model import TIME
from tubecert.simulate.fast import Fast, exact_flows
from tubecert.simulate.feedback import Reference
from tubecert.simulate.layout import layout
from tubecert.simulate.problem import LoopProblem
from tubecert.simulate.stepping import Grid
from tubecert.spec import Knots

_SAME = 1e-11  # of the horizon: times that differ by less are one
_FEWEST_STEPS = 64
MOST_STEPS = 4_000_000


def corners(problem: LoopProblem) -> Array:
    """Times (C,) that must be ends of steps."""
    end = problem.horizon
    kinks = np.zeros(0) if problem.plan.knots is None else _corners_of(problem.plan.knots)
    every = np.unique(np.minimum(np.concatenate([[0.0, end], problem.times, kinks[kinks < end]]), end))
    t = every[np.concatenate([[True], np.diff(every) > _SAME * end])]
    t[-1] = end
    return np.asarray(t)


def _corners_of(knots: Knots) -> Array:
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


def nearest(t: Array, wanted: Array) -> Array:
    """Numbers of the entries of t (increasing) that are nearest to the wanted times."""
    right = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    return np.asarray(right - (wanted - t[right - 1] < t[right] - wanted))


def steps(problem: LoopProblem, level: int) -> tuple[Grid, Array]:
    """The steps of a level, each level with twice as many as the one before, and their distinct lengths (Q,)."""
    t = corners(problem)
    spans = np.diff(t)
    counts = np.maximum(1, np.ceil(spans / problem.horizon * _FEWEST_STEPS)).astype(np.int64) * 2**level
    if counts.sum() > MOST_STEPS:
        raise ValueError(f"more than {MOST_STEPS} steps")
    first = np.concatenate([[0], np.cumsum(counts)])
    inside = np.arange(first[-1]) - np.repeat(first[:-1], counts)
    start = np.repeat(t[:-1], counts) + inside * np.repeat(spans / counts, counts)
    length = np.repeat(np.array([float(f"{span:.10g}") for span in spans / counts]), counts)
    distinct, which = np.unique(length, return_inverse=True)
    exact_length = np.repeat(spans / counts, counts)
    output = np.full(len(start) + 1, -1)
    output[first[nearest(t, problem.times)]] = np.arange(len(problem.times))
    grid = Grid(
        start=np.append(start, problem.horizon),
        length=np.append(exact_length, 0.0),
        which=np.append(which, 0),
        output=output,
        plan=course(problem, start, exact_length),
    )
    return grid, distinct


def course(problem: LoopProblem, start: Array, length: Array) -> Reference:
    """The plan at start, middle and end of every step (S,), and after the last one: the arrays of `Grid.plan`.

    Where u* jumps, the side that belongs to the step.
    """
    plan, model = problem.plan, problem.model
    S = len(start)
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


def fast_part(problem: LoopProblem, lengths: Array, level: int) -> Fast:
    """The fast part for steps of the lengths (Q,); its own steps are halved with the level, too."""
    model, gains = problem.model, problem.gains
    at = layout(len(model.states), len(model.inputs))
    found = Fast(
        terms=problem.terms,
        at=at,
        forces=at.m + (at.n if problem.E or problem.rest else 0),
        A=np.zeros((at.n, at.n)) if gains is None else -gains.predictor_gain * np.eye(at.n),
        P=np.eye(at.n) if problem.P is None else problem.P,
        Gamma=1.0 if gains is None or gains.adaptation_rate is None else gains.adaptation_rate,
        omega=1.0 if gains is None else gains.bandwidth,
        radius=1.0 if gains is None else gains.projection_radius,
        layer=0.0 if gains is None or gains.smooth is None else gains.smooth,
        exact=False,
        flow=np.zeros((1, at.size, at.size)),
        forced=np.zeros((1, 3, at.size, at.m)),
        turn=0.5**level,
    )
    if not problem.adaptive or not model.constant_input:
        return found
    B = np.array([[float(e.fraction) for e in row] for row in model.B])
    return exact_flows(found, B, lengths)
