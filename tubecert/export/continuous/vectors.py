"""Test vectors of a certificate C: states, times and predictions that meet every branch, and what is answered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.continuous.reference import Reference
from tubecert.export.controller import Boxes, Continuous
from tubecert.export.reference import Handed, execute

_SAMPLES: Final = 16
_INSTANTS: Final = (0.0, 0.3, 0.85)  # of a sample
_RELATIVE: Final = 1e-11
_SINGLE: Final = 64 * 2.0**-24
_DIGITS: Final = 15


@dataclass(frozen=True, slots=True, kw_only=True)
class Vectors:
    """Rows of what is given, (since, x, xhat), and of what is answered, (u, xhat'); `since` = 0 is a sample.

    A plan that is handed in, (x*, u*), stands at the end of what is given.
    """

    given: tuple[tuple[float, ...], ...]
    expected: tuple[tuple[float, ...], ...]
    tolerance: float


def vectors(controller: Continuous, *, single: bool = False) -> Vectors:
    """The vectors of a controller; they are the same in every process."""
    given = instants(controller)
    exact = run(controller, given)
    scale = float(np.abs(exact).max())
    tolerance = _RELATIVE * scale
    if single:
        rounded = run(controller, given, np.float32)
        tolerance = 8 * float(np.abs(rounded - exact).max()) + _SINGLE * scale
    return Vectors(
        given=tuple(tuple(map(float, row)) for row in given),
        expected=tuple(tuple(float(f"{value:.{_DIGITS}g}") for value in row) for row in exact),
        tolerance=float(f"{tolerance:.2g}"),
    )


def run(controller: Continuous, given: Array, real: type = np.float64) -> Array:
    """What is answered (K, m + n) to rows of what is given."""
    own, found = Reference(controller=controller, real=real), []
    for k, row in enumerate(given.astype(real)):
        x, xhat, own.handed = parts(controller, row)
        if k == 0:
            own.start(x)
        elif row[0] == 0:
            own.step(x, xhat)
        u, _ = own.law(row[0], x)
        found.append(np.concatenate([u, own.predictor(x, xhat, u)], axis=1)[0])
    return np.array(found, dtype=float)


def parts(controller: Continuous, row: Array) -> tuple[Array, Array, Handed | None]:
    """x (1, n), xhat (1, n), and the plan, if it is handed in, of a row."""
    n = len(controller.states)
    x, xhat, xs, us = np.split(row[None, 1:], [n, 2 * n, 3 * n], axis=1)
    return x, xhat, None if controller.boxes is None else Handed(xs, us, us)


def instants(controller: Continuous, samples: int = _SAMPLES) -> Array:
    """What is given, within the tube; errors of the prediction are now below and now above the clip."""
    own, n, Ts = Reference(controller=controller), len(controller.states), float(controller.sample_time)
    rows = []
    for k in range(samples):
        for share in _INSTANTS:
            place = k + share
            turn = np.array([np.sin(1.7 * place * (i + 1) + 2.0 * i) for i in range(n)])
            since = float(f"{share * Ts:.9g}")
            if controller.boxes is not None:
                own.handed = within(controller.boxes, place)
            x0 = own.plan(np.asarray(k * Ts + since))[0][0]
            factor = np.linalg.inv(np.linalg.cholesky(own.metric(x0[None])[0]).T)
            x = x0 + factor @ (0.5 * float(controller.reach) / np.sqrt(n) * turn)
            plan = () if own.handed is None else (*own.handed.x[0], *own.handed.u[0])
            rows.append([since, *x, *(x + _error(controller, x, k, turn)), *plan])
    return np.array([[float(f"{value:.9g}") for value in row] for row in rows])


def within(boxes: Boxes, place: float) -> Handed:
    """A plan within the boxes, which no planner made; numbers of few digits."""
    ends = [*boxes.x, *boxes.u]
    low, high = np.array([[float(q) for q in pair] for pair in ends]).T
    turn = np.array([np.sin(0.1 * place * (i + 1) + 1.3 * i + 0.4) for i in range(len(ends))])
    row = np.array([[float(f"{value:.9g}") for value in (low + high) / 2 + 0.45 * (high - low) * turn]])
    x, u = row[:, : len(boxes.x)], row[:, len(boxes.x) :]
    return Handed(x, u, u)


def _error(controller: Continuous, x: Array, k: int, turn: Array) -> Array:
    """xt that stands for an h of a part of the clip, or of more than that, and something beside it."""
    n, m = len(controller.states), len(controller.inputs)
    estimates = [execute(controller.estimator, x[None], x[None] + row[None])[1][0] for row in np.eye(n)]
    explains = np.array(estimates).T  # (m, n): q of an error
    wanted = np.array([np.cos(2.3 * k + 1.1 * j) for j in range(m)])
    size = (0.55 if k % 3 else 1.8) * float(controller.radius) / np.linalg.norm(wanted)
    error = np.linalg.lstsq(explains, size * wanted, rcond=None)[0]
    return np.asarray(error + 0.05 * np.linalg.norm(error) * turn)
