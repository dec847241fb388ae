"""In what coordinates the condition number of a metric is meant.

In the states' own units a condition number depends on the units: a speed in mm/s makes another metric the best. With
x = S z, S = diag(half-widths of the safe set), the metric in z is S^-1 W S^-1, and what is best there is best in
every unit. The columns of a frame and the functions of a family are scaled as well, so that all unknowns are of one
size. B B', which is a floor of W, is measured by its own size, and C2 by the rate that is asked for: so the unit of
time is gone, too.
Untrusted: W is proven in the states' own coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression.matrix import Matrix
from tubecert.model import ControlAffineModel
from tubecert.synthesis.family import MetricFamily

Choice = Literal["auto", "identity"]
_POINTS = 256  # of the safe set at which functions are looked at


@dataclass(frozen=True, slots=True)
class Coordinates:
    """`states` (n,): the diagonal of S; `columns` (n,): by what the columns of the frame are multiplied.

    `functions`: what the g_k (K,) are measured in; `input`: |S^-1 B|; `rate`: rates, in 1/s.
    """

    states: Array
    columns: Array
    functions: Array
    input: float = 1.0
    rate: float = 1.0

    @property
    def entries(self) -> Array:
        """What an unknown of the V_k stands for, (K, n, n)."""
        return np.asarray(np.outer(self.columns, self.columns) / self.functions[:, None, None])


def coordinates(
    choice: Choice,
    family: MetricFamily,
    safe_set: Sequence[tuple[Fraction, Fraction]],
    half_widths: Sequence[Fraction] = (),
) -> Coordinates:
    """S: half-widths (those of the safe set, if none are given), or ones."""
    if choice == "identity":
        return unscaled(family)
    half = half_widths or [(high - low) / 2 for low, high in safe_set]
    states = np.array([float(width) for width in half])
    functions = _sizes(functions_at(family, safe_set))
    if family.flat:
        return Coordinates(states, states, functions)
    columns = 1 / np.linalg.norm(_frame(family, safe_set) / states[:, None], axis=0)
    return Coordinates(states, columns, functions)


def unscaled(family: MetricFamily) -> Coordinates:
    """The states' own units."""
    ones = np.ones(len(family.states))
    return Coordinates(ones, ones, np.ones(len(family.functions)))


def functions_at(family: MetricFamily, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Array:
    """The functions g_k at random points of the safe set, (P, K)."""
    ends = np.array([[float(low), float(high)] for low, high in safe_set])
    points = np.random.default_rng(7).uniform(ends[:, 0], ends[:, 1], (_POINTS, len(ends)))
    with np.errstate(all="ignore"):
        values = Tape(family.functions, family.states).run_floats(list(points.T), (_POINTS,)).T
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def _sizes(values: Array) -> Array:
    """Powers of two near the largest magnitudes (K,) of functions at points (P, K); 1 for what vanishes."""
    largest = np.abs(values).max(axis=0, initial=0.0)
    return np.asarray(2.0 ** np.rint(np.log2(np.where(largest > 0, largest, 1.0))))


def _frame(family: MetricFamily, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Array:
    """The frame at the centre of the safe set, (n, n); the identity where it cannot be evaluated."""
    values = _at_centre(family.frame, family.states, safe_set)
    return values if (np.abs(values).max(axis=0) > 0).all() else np.eye(len(safe_set))


def input_size(
    model: ControlAffineModel, states: Array, safe_set: Sequence[tuple[Fraction, Fraction]]
) -> float:
    """|S^-1 B| at the centre of the safe set, S = diag(states); 1 where it is no positive number."""
    size = float(np.linalg.norm(_at_centre(model.B, model.states, safe_set) / states[:, None], 2))
    return size if 0 < size < np.inf else 1.0


def _at_centre(entries: Matrix, names: Sequence[str], safe_set: Sequence[tuple[Fraction, Fraction]]) -> Array:
    """A matrix of n rows at the centre of the safe set; 0 where it cannot be evaluated."""
    centre = np.array([[float((low + high) / 2)] for low, high in safe_set])
    with np.errstate(all="ignore"):
        tape = Tape([e for row in entries for e in row], names)
        values = np.asarray(tape.run_floats(list(centre), (1,)), dtype=float).reshape(len(entries), -1)
    return values if np.isfinite(values).all() else np.zeros_like(values)
