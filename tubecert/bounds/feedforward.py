"""How fast u* through knots moves: its largest slope. Trusted."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np

from tubecert.bounds.constants import Constant
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.spec import Knots
from tubecert.trajectory.hermite import slopes_of_inputs


def rate_of(knots: Knots) -> Constant:
    """The largest slope of u* through knots; where it is held and not the same throughout, it jumps, Lus of (H.6a)."""
    steps = list(pairwise(knots.u))
    if all(a == b for a, b in steps):
        return Constant.exactly(0.0)
    if knots.interpolation == "hold":
        return Constant(below=0.0, above=np.inf)
    if knots.interpolation == "hermite-simpson":
        return _steepest(knots)
    durations = [b - a for a, b in pairwise(knots.t)]
    squares = [
        sum(((q - p) / length) ** 2 for p, q in zip(a, b, strict=True))
        for (a, b), length in zip(steps, durations, strict=True)
    ]
    root = sqrt(Interval.of(max(map(Fraction, squares))))
    return Constant(below=float(root.lo), above=float(root.hi))


def _steepest(knots: Knots) -> Constant:
    """The largest slope of a u* that is quadratic on each piece: at an end of one, for it is linear there, (H.6a)."""
    lengths = [end - begin for begin, end in zip(knots.t[::2], knots.t[2::2], strict=False)]
    squares = [
        sum(((c + 2 * bend * tau) ** 2 for c, bend in zip(*of_piece, strict=True)), Fraction(0))
        for of_piece, length in zip(slopes_of_inputs(knots), lengths, strict=True)
        for tau in (Fraction(0), length)
    ]
    root = sqrt(Interval.of(max(squares)))
    return Constant(below=float(root.lo), above=float(root.hi))
