"""Frames in closed form where B depends only on states that it does not move (mechanical systems: on positions).

With m pivot rows R of B, B_R invertible, and x_R the states of these rows,
    e_j = d/dx_j + (dB/dx_j) B_R^-1 x_R  for states j that B depends on,  e_i = d/dx_i  for all others,
commute with every column: [b_k, e_j] = -db_k/dx_j + (dB/dx_j) B_R^-1 (b_k)_R = 0. They are independent everywhere.
If B_R is the inverse of a mass matrix, B_R^-1 is simpler:
    (dB/dx_j) B_R^-1 = d(B B_R^-1)/dx_j - B d(B_R^-1)/dx_j.
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
    combine,
    determinant,
    differentiate,
    identity,
    multiply,
    transpose,
)
from tubecert.model import ControlAffineModel, divide
from tubecert.synthesis.factors import reduced

_POINTS = 400


def pivot_frame(model: ControlAffineModel, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Matrix | None:
    """E (n, n) for the pivot rows that keep it smallest on random points of the safe set; None if there are none.

    Small in half-widths of the set: in the states' own units that would depend on them.
    """
    ends = np.array([[float(lo), float(hi)] for lo, hi in safe_set])
    points = np.random.default_rng(17).uniform(ends[:, 0], ends[:, 1], (_POINTS, len(ends)))
    half = (ends[:, 1] - ends[:, 0]) / 2
    units = (half / half[:, None]).reshape(-1, 1)
    best: tuple[float, Matrix] | None = None
    for frame in pivot_frames(model):
        tape = Tape([e for row in frame for e in row], model.states)
        size = float(np.abs(tape.run_floats(list(points.T), (len(points),)) * units).max())
        if np.isfinite(size) and (best is None or size < best[0]):
            best = size, frame
    return best[1] if best else None


def pivot_frames(model: ControlAffineModel) -> Iterator[Matrix]:
    """The frames of all choices of pivot rows."""
    moved = {name for name, row in zip(model.states, model.B, strict=True) if any(e is not ZERO for e in row)}
    needed = free_symbols(e for row in model.B for e in row)
    if moved & needed:
        return
    B = reduced(model.B)
    for rows in model.pivots[0]:
        B_R = [B[i] for i in rows]
        ((size,),) = reduced([[determinant(B_R)]])
        if size is ZERO:
            continue
        inverse = reduced(divide(adjugate(B_R), size))
        gain = reduced(multiply(B, inverse))
        x_R = column([symbol(model.states[i]) for i in rows])
        fields = [list(row) for row in identity(len(model.states))]  # columns of E as rows
        for j, name in enumerate(model.states):
            if name in needed:
                slope = combine(1, differentiate(gain, name), -1, multiply(B, differentiate(inverse, name)))
                fields[j] = [a + b for a, (b,) in zip(fields[j], multiply(slope, x_R), strict=True)]
        yield transpose(reduced(fields))
