"""Frames in closed form where B depends only on states that it does not move (mechanical systems: on positions).

With m pivot rows R of B, B_R invertible, and x_R the states of these rows,
    e_j = d/dx_j + (dB/dx_j) B_R^-1 x_R  for states j that B depends on,  e_i = d/dx_i  for all others,
commute with every column: [b_k, e_j] = -db_k/dx_j + (dB/dx_j) B_R^-1 (b_k)_R = 0. They are independent everywhere.
Untrusted: `verify` proves C3 for the metric that comes of it. Implements: (CCM_3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, free_symbols, symbol
from tubecert.expression.matrix import (
    Matrix,
    adjugate,
    column,
    determinant,
    differentiate,
    identity,
    matrix,
    multiply,
    transpose,
)
from tubecert.model import ControlAffineModel, divide

_POINTS = 400


def pivot_frame(model: ControlAffineModel, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Matrix | None:
    """E (n, n) for the pivot rows that keep it smallest on random points of the safe set; None if there are none."""
    ends = np.array([[float(lo), float(hi)] for lo, hi in safe_set])
    points = np.random.default_rng(17).uniform(ends[:, 0], ends[:, 1], (_POINTS, len(ends)))
    best: tuple[float, Matrix] | None = None
    for frame in pivot_frames(model):
        tape = Tape([e for row in frame for e in row], model.states)
        size = float(np.abs(tape.run_floats(list(points.T), (len(points),))).max())
        if np.isfinite(size) and (best is None or size < best[0]):
            best = size, frame
    return best[1] if best else None


def pivot_frames(model: ControlAffineModel) -> Iterator[Matrix]:
    """The frames of all choices of pivot rows."""
    moved = {name for name, row in zip(model.states, model.B, strict=True) if any(e is not ZERO for e in row)}
    needed = free_symbols(e for row in model.B for e in row)
    if moved & needed:
        return
    for rows in model.pivots[0]:
        B_R = [model.B[i] for i in rows]
        if determinant(B_R) is ZERO:
            continue
        inverse = divide(adjugate(B_R), determinant(B_R))
        u = multiply(inverse, column([symbol(model.states[i]) for i in rows]))
        fields = [list(row) for row in identity(len(model.states))]  # columns of E as rows
        for j, name in enumerate(model.states):
            if name in needed:
                turned = multiply(differentiate(model.B, name), u)
                fields[j] = [a + b for a, (b,) in zip(fields[j], turned, strict=True)]
        yield transpose(matrix(fields))
