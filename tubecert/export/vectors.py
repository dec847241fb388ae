"""Test vectors: measurements within the tube that meet every branch of a controller, and what it does then."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.controller import Controller
from tubecert.export.reference import Reference

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
    """What is measured, K rows of n numbers, and K + 1 rows of inputs: of `start`, and of every `step`."""

    y: tuple[tuple[float, ...], ...]
    u: tuple[tuple[float, ...], ...]
    tolerance: float


def vectors(controller: Controller, *, single: bool = False) -> Vectors:
    """The vectors of a controller; they are the same in every process."""
    y = measured(controller, _SAMPLES + _FEEDBACKS * (controller.every - 1))
    exact = run(controller, y)
    scale = float(np.abs(exact).max())
    tolerance = _RELATIVE * scale
    if single:
        rounded = run(controller, y, np.float32)
        tolerance = 8 * float(np.abs(rounded - exact).max()) + _SINGLE * scale
    return Vectors(
        y=tuple(tuple(map(float, row)) for row in y),
        u=tuple(tuple(float(f"{value:.{_DIGITS}g}") for value in row) for row in exact),
        tolerance=float(f"{tolerance:.2g}"),
    )


def run(controller: Controller, y: Array, real: type = np.float64) -> Array:
    """The inputs (K + 1, m) of one run: at the start, and at every sample."""
    reference = Reference(controller=controller, real=real)
    rows = [row[None].astype(real) for row in y]
    found = [reference.start(rows[0]), *(reference.step(row)[0] for row in rows)]
    return np.concatenate(found).astype(float)


def measured(controller: Controller, samples: int = _SAMPLES) -> Array:
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
        plan = reference.plan(reference.time())[0][0]
        factor = np.linalg.inv(np.linalg.cholesky(reference.metric(plan[None])[0]).T)  # columns of length 1
        rows.append([float(f"{value:.9g}") for value in plan + factor @ (size * turn)])
    return np.array(rows)
