"""Test vectors: measurements within the tube that meet every branch of a controller, and what it does then."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.controller import Controller
from tubecert.export.reference import Handed, Reference

_SAMPLES: Final = 40
_CALM: Final = (
    24  # samples that move as a plant might; then the measurements jump, and the estimate is clipped
)
_FEEDBACKS: Final = 4  # more of them, at least, where it has a clock of its own
_SLOW: Final = 1e-3  # of the tube, per sample
_RELATIVE: Final = 1e-11
_SINGLE: Final = 64 * 2.0**-24
_DIGITS: Final = 15


@dataclass(frozen=True, slots=True, kw_only=True)
class Vectors:
    """What is measured, K rows of n numbers, and K + 1 rows of inputs: of `start`, and of every `step`.

    `plan`: K rows of x*, u* and, where u* is played, its mean over the last sample, where the plan is handed in.
    """

    y: tuple[tuple[float, ...], ...]
    u: tuple[tuple[float, ...], ...]
    tolerance: float
    plan: tuple[tuple[float, ...], ...] = ()

    @property
    def given(self) -> tuple[tuple[float, ...], ...]:
        """Rows of everything that is given."""
        return tuple((*y, *p) for y, p in zip(self.y, self.plan, strict=True)) if self.plan else self.y


def vectors(controller: Controller, *, single: bool = False) -> Vectors:
    """The vectors of a controller; they are the same in every process."""
    samples = _SAMPLES + _FEEDBACKS * (controller.every - 1)
    plan = None if controller.boxes is None else planned(controller, samples)
    y = measured(controller, samples, plan)
    exact = run(controller, y, plan=plan)
    scale = float(np.abs(exact).max())
    tolerance = _RELATIVE * scale
    if single:
        rounded = run(controller, y, np.float32, plan)
        tolerance = 8 * float(np.abs(rounded - exact).max()) + _SINGLE * scale
    return Vectors(
        y=tuple(tuple(map(float, row)) for row in y),
        u=tuple(tuple(float(f"{value:.{_DIGITS}g}") for value in row) for row in exact),
        tolerance=float(f"{tolerance:.2g}"),
        plan=() if plan is None else tuple(tuple(map(float, row)) for row in plan),
    )


def run(controller: Controller, y: Array, real: type = np.float64, plan: Array | None = None) -> Array:
    """The inputs (K + 1, m) of one run: at the start, and at every sample; `plan` (K, n + 2 m) if that is handed in."""
    reference = Reference(controller=controller, real=real)
    found = []
    for k, row in enumerate(y):
        own = row[None].astype(real)
        if plan is not None:
            reference.handed = handed_of(controller, plan[k])
        found += [reference.start(own)] if k == 0 else []
        found.append(reference.step(own)[0])
    return np.concatenate(found).astype(float)


def handed_of(controller: Controller, row: Array) -> Handed:
    """A row of a plan; where u* is held, there is no mean in it."""
    n, m = len(controller.states), len(controller.inputs)
    u = row[None, n : n + m]
    return Handed(row[None, :n], u, u if controller.held else row[None, n + m :])


def planned(controller: Controller, samples: int) -> Array:
    """Plans (K, n + m) or (K, n + 2 m) within the boxes, which no planner made; numbers of few digits."""
    boxes = controller.boxes
    if boxes is None:
        raise ValueError("only a family of plans is handed in")
    ends = [*boxes.x, *boxes.u, *(() if controller.held else boxes.u)]
    low, high = np.array([[float(q) for q in pair] for pair in ends]).T
    rows = []
    for k in range(samples):
        turn = np.array([np.sin(0.01 * k * (i + 1) + 1.3 * i + 0.4) for i in range(len(ends))])
        rows.append([float(f"{value:.9g}") for value in (low + high) / 2 + 0.45 * (high - low) * turn])
    return np.array(rows)


def measured(controller: Controller, samples: int = _SAMPLES, given: Array | None = None) -> Array:
    """Measurements (K, n) within the level around the plan; numbers of few digits."""
    reference = Reference(controller=controller)
    n, calm = len(controller.states), _CALM * samples // _SAMPLES
    rows = []
    for k in range(samples):
        slow = k < calm
        phase = (_SLOW if slow else 1.7) * k
        turn = np.array([np.sin(phase * (i + 1) + 2.0 * i + (0.0 if slow else 0.4 * i)) for i in range(n)])
        size = 0.5 * float(controller.level) / np.sqrt(n)
        reference.sample = k
        if given is not None:
            reference.handed = handed_of(controller, given[k])
        plan = reference.plan(reference.time())[0][0]
        factor = np.linalg.inv(np.linalg.cholesky(reference.metric(plan[None])[0]).T)  # columns of length 1
        rows.append([float(f"{value:.9g}") for value in plan + factor @ (size * turn)])
    return np.array(rows)
