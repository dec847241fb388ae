"""The data of a plan through knots: coefficients of its pieces as intervals, and their ranges.

Knots are exact. Between two of them x* is the cubic with the values x_k, x_k+1 and the one-sided slopes f(t_k, x_k) +
B(x_k) u(t_k+), f(t_k+1, x_k+1) + B(x_k+1) u(t_k+1-); u* is held or linear. Where rows are in turn a knot and a point
between two knots (Hermite-Simpson), u* is quadratic through the three; x in that point is no part of the curve. Where
u* jumps x* has a kink, as it must: one smooth curve through a held input would have a defect of the size of the jump.
Implements: theory 4, plan defect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.tape import Tape
from tubecert.model import TIME, ControlAffineModel
from tubecert.spec import Knots, Vector

Index = NDArray[np.intp]


@dataclass(frozen=True)
class Pieces:
    """K pieces, each a function of tau = t - t_k in [0, length]; nothing else is known of them.

    `x` (K, n, 4): coefficients of 1, tau, tau^2, tau^3; `u` (K, m, 2): of 1, tau, or (K, m, 3): of 1, tau, tau^2;
    `start`, `end`, `length` (K,), in s.
    """

    start: Interval
    end: Interval
    length: Interval
    x: Interval
    u: Interval

    def __len__(self) -> int:
        return len(self.start.lo)

    @property
    def defined(self) -> NDArray[np.bool_]:
        """Which pieces have finite slopes: where f and B are defined at both knots; (K,)."""
        finite = np.isfinite(self.x.lo) & np.isfinite(self.x.hi)
        return np.asarray(finite.all(axis=(1, 2)))

    def over(self, lo: Array, hi: Array, piece: Index | None = None) -> Interval:
        """x* and u* over windows of time (N,): (N, n + m). At a jump of u*, both sides belong to it.

        With numbers of pieces (N,), only what lies in that piece.
        """
        if piece is not None:
            return self._within(piece, lo, hi)
        first = np.clip(np.searchsorted(self.end.hi, lo, side="left"), 0, len(self) - 1)
        last = np.clip(np.searchsorted(self.start.lo, hi, side="right") - 1, 0, len(self) - 1)
        last = np.maximum(first, last)
        more = last > first
        if more.any():  # first and last pieces in one evaluation
            every = self._within(
                *(np.concatenate([x, y[more]]) for x, y in ((first, last), (lo, lo), (hi, hi)))
            )
            found = every[: len(lo)]
            wide = found[more].hull(every[len(lo) :])
            found.lo[more], found.hi[more] = wide.lo, wide.hi
        else:
            found = self._within(first, lo, hi)
        between = last > first + 1
        if between.any():
            wide = found[between].hull(self._whole(first[between] + 1, last[between] - 1))
            found.lo[between], found.hi[between] = wide.lo, wide.hi
        return found

    def _within(self, piece: Index, lo: Array, hi: Array) -> Interval:
        """One piece for each window: what it takes over the part of the window that it covers."""
        most = self.length.hi[piece]
        tau = Interval(lo, hi) - self.start[piece]
        left, right = np.clip(tau.lo, 0.0, most), np.clip(tau.hi, 0.0, most)
        middle = np.clip(0.5 * left + 0.5 * right, left, right)
        r = np.nextafter(np.maximum(right - middle, middle - left), np.inf)[:, None]
        c, swing = Interval.exact(middle[:, None]), Interval(-r, r)
        a, b = self.x[piece], self.u[piece]
        a1, a2, a3 = (a[..., k] for k in range(1, 4))
        c3 = c * a3
        # the cubic about the middle, exactly: q(c + d) = q(c) + q'(c) d + (a2 + 3 a3 c) d^2 + a3 d^3
        value = a[..., 0] + c * (a1 + c * (a2 + c3))
        c3 = 3 * c3
        slope = a1 + c * (2 * a2 + c3)
        bend = a2 + c3
        square = Interval(np.zeros_like(r), np.nextafter(r * r, np.inf))
        x = value + slope * swing + bend * square + a3 * swing**3
        if b.lo.shape[-1] == 2:
            u = b[..., 0] + b[..., 1] * Interval(left[:, None], right[:, None])
        else:  # about the middle, exactly: q(c + d) = q(c) + q'(c) d + b2 d^2
            value = b[..., 0] + c * (b[..., 1] + c * b[..., 2])
            u = value + (b[..., 1] + 2 * (c * b[..., 2])) * swing + b[..., 2] * square
        both = Interval(np.concatenate([x.lo, u.lo], axis=1), np.concatenate([x.hi, u.hi], axis=1))
        return both.sanitised()

    @cached_property
    def _levels(self) -> list[Interval]:
        """Hulls over 2^j pieces from each on, level by level."""
        every = np.arange(len(self))
        levels = [self._within(every, self.start.lo, self.end.hi)]
        while 2 ** len(levels) <= len(self):
            step = 2 ** (len(levels) - 1)
            levels.append(levels[-1][:-step].hull(levels[-1][step:]))
        return levels

    def _whole(self, first: Index, last: Index) -> Interval:
        """The hull over all pieces from `first` to `last`, both included."""
        level = np.frexp((last - first + 1).astype(float))[1] - 1  # the largest j with 2^j pieces or fewer
        columns = self._levels[0].lo.shape[1]
        lo, hi = np.empty((len(first), columns)), np.empty((len(first), columns))
        for j in np.unique(level):
            rows = level == j
            table = self._levels[j]
            wide = table[first[rows]].hull(table[last[rows] + 1 - 2**j])
            lo[rows], hi[rows] = wide.lo, wide.hi
        return Interval(lo, hi)


def pieces(model: ControlAffineModel, knots: Knots, horizon: Fraction) -> Pieces:
    """The pieces through the knots up to the horizon; the last one may be cut short."""
    inputs = slopes_of_inputs(knots)
    knots = ends_of_pieces(knots)
    count = next(k for k, t in enumerate(knots.t) if t >= horizon)
    t = knots.t[: count + 1]
    steps = [b - a for a, b in pairwise(t)]
    h = intervals(steps)[:, None]
    # one place turns exact data into intervals; differences are taken before that
    x = intervals_of_rows(knots.x[: count + 1])
    secant = intervals_of_rows(
        [
            [(q - p) / step for p, q in zip(a, b, strict=True)]
            for (a, b), step in zip(pairwise(knots.x), steps, strict=False)
        ]
    )
    u_left, u_right = sides(knots, count)
    rate = _Drift(model)
    at = intervals(t)
    m0 = rate(at[:-1], x[:-1], intervals_of_rows(u_left))
    m1 = rate(at[1:], x[1:], intervals_of_rows(u_right))
    a2 = (3 * secant - 2 * m0 - m1) / h
    a3 = (m0 + m1 - 2 * secant) / (h * h)
    powers = [intervals_of_rows([row[power] for row in inputs[:count]]) for power in range(len(inputs[0]))]
    length = [min(b, horizon) - a for a, b in pairwise(t)]
    return Pieces(
        start=intervals(t[:-1]),
        end=intervals([min(b, horizon) for b in t[1:]]),
        length=intervals(length),
        x=_stacked([x[:-1], m0, a2, a3]),
        u=_stacked([intervals_of_rows(u_left), *powers]),
    )


def sides(knots: Knots, count: int) -> tuple[list[Sequence[Fraction]], list[Sequence[Fraction]]]:
    """u* just after the left knot of every piece, and just before its right knot."""
    left: list[Sequence[Fraction]] = list(knots.u[:count])
    return left, (left if knots.interpolation == "hold" else list(knots.u[1 : count + 1]))


def ends_of_pieces(knots: Knots) -> Knots:
    """The rows in which pieces begin and end; as linear ones where there are others."""
    if knots.interpolation != "hermite-simpson":
        return knots
    return Knots(t=knots.t[::2], x=knots.x[::2], u=knots.u[::2], interpolation="linear")


def slopes_of_inputs(knots: Knots) -> list[tuple[Vector, ...]]:
    """The coefficients of tau, and of tau^2 where u* is quadratic, of u* on every piece; each of shape (m,)."""
    if knots.interpolation == "hermite-simpson":
        return [_quadratic(knots, k) for k in range(0, len(knots.t) - 1, 2)]
    held = knots.interpolation == "hold"
    return [
        (tuple(Fraction(0) if held else (q - p) / (end - begin) for p, q in zip(a, b, strict=True)),)
        for (begin, end), (a, b) in zip(pairwise(knots.t), pairwise(knots.u), strict=True)
    ]


def _quadratic(knots: Knots, k: int) -> tuple[Vector, Vector]:
    """The parabola through rows k, k + 1, k + 2 in tau = t - t_k: c1, c2 with u = u_k + c1 tau + c2 tau^2."""
    h, H = knots.t[k + 1] - knots.t[k], knots.t[k + 2] - knots.t[k]
    middle, end = ([b - a for a, b in zip(knots.u[k], knots.u[row], strict=True)] for row in (k + 1, k + 2))
    # c1 h + c2 h^2 = middle, c1 H + c2 H^2 = end
    bend = tuple((e * h - m * H) / (h * H * (H - h)) for m, e in zip(middle, end, strict=True))
    return tuple(m / h - c * h for m, c in zip(middle, bend, strict=True)), bend


class _Drift:
    """f(t, x) + B(x) u as an interval function of rows, at times (N,)."""

    def __init__(self, model: ControlAffineModel) -> None:
        outputs = [row[0] for row in model.drift_on_plan()]
        self._tape = Tape(outputs, (*model.states, *model.inputs, TIME))

    def __call__(self, t: Interval, x: Interval, u: Interval) -> Interval:
        columns = [x[:, i] for i in range(x.lo.shape[1])] + [u[:, j] for j in range(u.lo.shape[1])] + [t]
        found = self._tape.run(columns, (len(x.lo),))
        return Interval(found.lo.T, found.hi.T)


def intervals(values: Sequence[Fraction]) -> Interval:
    """Exact numbers as intervals, (N,)."""
    ends = np.array([fraction_bounds(value) for value in values]).reshape(-1, 2)
    return Interval(ends[:, 0].copy(), ends[:, 1].copy())


def intervals_of_rows(rows: Sequence[Sequence[Fraction]]) -> Interval:
    """Exact rows as intervals, (N, columns)."""
    flat = intervals([value for row in rows for value in row])
    shape = (len(rows), -1)
    return Interval(flat.lo.reshape(shape), flat.hi.reshape(shape))


def _stacked(parts: Sequence[Interval]) -> Interval:
    return Interval(
        np.ascontiguousarray(np.stack([part.lo for part in parts], axis=-1)),
        np.ascontiguousarray(np.stack([part.hi for part in parts], axis=-1)),
    )
