"""In what coordinates the condition number of a metric is meant.

In the states' own units a condition number depends on the units: a speed in mm/s makes another metric the best. With
x = S z, S = diag(half-widths of the safe set), the metric in z is S^-1 W S^-1, and what is best there is best in
every unit. The columns of a frame are scaled as well, so that all unknowns are of one size. B B', which is a floor of
W, is measured by its own size, and C2 by the rate that is asked for: so the unit of time is gone, too.
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


@dataclass(frozen=True, slots=True)
class Coordinates:
    """`states` (n,): the diagonal of S; `columns` (n,): by what the columns of the frame are multiplied.

    `input`: what |S^-1 B| is measured in; `rate`: what rates are measured in, in 1/s.
    """

    states: Array
    columns: Array
    input: float = 1.0
    rate: float = 1.0

    @property
    def entries(self) -> Array:
        """What an unknown of V stands for, (n, n)."""
        return np.asarray(self.columns[:, None] * self.columns)


def coordinates(
    choice: Choice,
    family: MetricFamily,
    safe_set: Sequence[tuple[Fraction, Fraction]],
    half_widths: Sequence[Fraction] = (),
) -> Coordinates:
    """S: half-widths (those of the safe set, if none are given), or ones."""
    n = len(safe_set)
    if choice == "identity":
        return Coordinates(np.ones(n), np.ones(n))
    half = half_widths or [(high - low) / 2 for low, high in safe_set]
    states = np.array([float(width) for width in half])
    if family.flat:
        return Coordinates(states, states)
    return Coordinates(states, 1 / np.linalg.norm(_frame(family, safe_set) / states[:, None], axis=0))


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
