"""Random plans of a family: what a loop is made to follow where the specification asks for every plan in its boxes.

u* is held between knots and jumps at them, x* follows the dynamics plus a part of the defect that is allowed
(`simulation.plans`): so it is, too, what a planner makes that gives up one plan for another that starts where x* is.
Untrusted: that a plan keeps to boxes and defect is looked at in many points; `pipeline.membership` proves it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Final

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulation.plans import Steering, integrated, waves
from tubecert.spec import Bundle, Knots, Spec
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan

_KNOTS: Final = (100, 2000)  # of a plan, at least and at most
_PACE: Final = 0.05  # |A| times the time between two of them
_WIDEST: Final = 16  # times the square of the ellipsoid, in the box, from whose edge plans turn back
_LANES: Final = 25  # plans that are drawn at once
_TRIES: Final = 20  # draws of a plan, until one keeps to the boxes
_INSIDE: Final = 1e-3  # of a box, which curves between knots stay within
_DEFECT: Final = 0.6  # of the limit, at most: between knots the defect of a cubic is 3/2 of that
_ROUNDING: Final = 1e-5  # of |x*'|: what a cubic may miss of the dynamics where no defect is allowed
_POINTS: Final = 5  # of a piece, that are looked at
_SECANT: Final = 1e-6  # where a box is a point


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """What plans are drawn for: the dynamics, `drift` f + B u of states, inputs and t, and what keeps x* in its box.

    Plans last `horizon` s and have `count` pieces.
    """

    model: ControlAffineModel
    bundle: Bundle
    horizon: Fraction
    drift: Tape
    count: int
    steering: Steering

    def speed(self, t: float | Array, x: Array, u: Array) -> Array:
        """f(t, x) + B(x) u for points (n, N) and (m, N), at one time or at N."""
        return self.drift.run_floats([*x, *u, np.broadcast_to(t, x[0].shape)], x[0].shape)


def drawing_of(spec: Spec, model: ControlAffineModel, horizon: float) -> Drawing:
    """What plans of a family are drawn for."""
    bundle = spec.trajectory.bundle
    if bundle is None:
        raise ValueError("only a family of plans has members")
    drift = Tape([row[0] for row in model.drift_on_plan()], (*model.states, *model.inputs, TIME))
    P, Q = (np.array(box, dtype=float) for box in (bundle.x, bundle.u))
    P += _INSIDE * np.ptp(P, axis=1)[:, None] * [1, -1]
    boxes, n = np.vstack([P, Q]), len(P)
    half = np.maximum(np.ptp(boxes, axis=1) / 2, _SECANT)
    ends = boxes.mean(axis=1)[:, None] + np.hstack([np.diag(half), -np.diag(half)])
    high, low = np.split(drift.run_floats([*ends, np.zeros(ends.shape[1])], ends.shape[1:]), 2, axis=1)
    A, B = np.split((high - low) / (2 * half), [n], axis=1)  # by secants
    pace = np.linalg.norm(A * half[:n] / half[:n, None], 2)  # 1/s, whatever the units of the states
    count = int(np.clip(ceil(pace * horizon / _PACE), *_KNOTS))
    return Drawing(
        model=model,
        bundle=bundle,
        horizon=Fraction(repr(horizon)),
        drift=drift,
        count=count,
        steering=Steering(A, B, horizon / count, P, Q),
    )


def members_of(drawing: Drawing, seed: int, numbers: Sequence[int]) -> Iterator[tuple[Plan, float]]:
    """Plans of a seed by their numbers, with the largest defect of each that was seen, |x*' - f - B u*|.

    Raises `TubecertError` if one is not found that keeps to the boxes.
    """
    for first in range(0, len(numbers), _LANES):
        part = numbers[first : first + _LANES]
        found: dict[int, tuple[Plan, float]] = {}
        for trial in range(_TRIES):
            left = [number for number in part if number not in found]
            for number, knots in _drawn(drawing, seed, left, trial) if left else ():
                plan = piecewise_plan(drawing.model, knots, drawing.horizon)
                defect = _belongs(drawing, plan)
                if defect is not None:
                    found[number] = plan, defect
        for number in part:
            if number not in found:
                message = f"no random plan {number} was found that keeps x* and u* in their boxes"
                told = f"{message} for {near(drawing.horizon)} s"
                help = "give a plan of your own with --plan FILE, or a shorter --duration"
                raise TubecertError([Finding(code="TC708", message=told, help=help)])
            yield found[number]


def _drawn(drawing: Drawing, seed: int, numbers: Sequence[int], trial: int) -> Iterator[tuple[int, Knots]]:
    """Those of the plans that keep to the boxes at their knots, which are exact."""
    steer, count, length = drawing.steering, drawing.count, float(drawing.horizon) / drawing.count
    n, m = len(steer.x), len(steer.u)
    seeds = [np.random.SeedSequence(entropy=seed, spawn_key=(2**30, number, trial)) for number in numbers]
    draws = np.stack([np.random.default_rng(each).random(1 + 3 * (n + m) + n) for each in seeds], axis=1)
    wide, most = _WIDEST ** (draws[0] * (1 - trial / _TRIES)), _DEFECT * float(drawing.bundle.defect)
    x, u = [steer.inside(draws[-n:], wide)], list[Array]()
    with np.errstate(all="ignore"):  # plans that go astray
        for k in range(count):
            wish, free = np.split(waves(draws[1:-n], count, k), [m])
            free = free * (steer.half > 0)
            missed = most * free / np.maximum(1.0, np.linalg.norm(free, axis=0))
            u.append(steer.input(x[-1], wish, wide))

            def slope(t: float, z: Array, u: Array = u[-1], missed: Array = missed) -> Array:
                return drawing.speed(t, z, u) + missed

            x.append(integrated(slope, k * length, x[-1], length, 2))
    t = tuple(drawing.horizon * k / count for k in range(count + 1))
    paths, inputs = np.stack(x), np.stack([*u, u[-1]])  # (K + 1, n, N), (K + 1, m, N)
    for lane in np.flatnonzero(np.all([steer.within(row) for row in paths], axis=0)).tolist():
        exact, held = (
            tuple(tuple(map(Fraction, row)) for row in rows[..., lane].tolist()) for rows in (paths, inputs)
        )
        yield numbers[lane], Knots(t=t, x=exact, u=held, interpolation="hold")


def _belongs(drawing: Drawing, plan: PiecewisePlan) -> float | None:
    """The defect, if x* keeps to its box and the dynamics, in many points."""
    pieces = plan.pieces
    tau = np.multiply.outer(np.linspace(0, 1, _POINTS), pieces.length.mid)  # (P, K)
    a, b, c, d = pieces.x.mid.T[:, :, None]
    x, slope = a + tau * (b + tau * (c + tau * d)), b + tau * (2 * c + 3 * tau * d)  # (n, P, K)
    missed = slope - drawing.speed(pieces.start.mid + tau, x, pieces.u.mid[:, :, 0].T[:, None])
    defect, speed = (float(np.linalg.norm(part, axis=0).max()) for part in (missed, slope))
    low, high = np.array(drawing.bundle.x, dtype=float).T[:, :, None, None]
    inside = bool(((x >= low) & (x <= high)).all())
    return defect if inside and defect <= (float(drawing.bundle.defect) or _ROUNDING * speed) else None
