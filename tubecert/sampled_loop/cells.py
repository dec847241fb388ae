"""Where a plan is: windows of its time, or cells of a family's boxes, as batches for a tape. Trusted: yes."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.tape import Tape
from tubecert.expression import derivatives, free_symbols
from tubecert.expression.matrix import jacobian
from tubecert.model import TIME, time_period
from tubecert.sampled_loop.setting import Loop
from tubecert.trajectory.pieces import PiecewisePlan
from tubecert.trajectory.plan import Family

_TIMES: Final = 64  # windows of a period of h, beside a plan that does not share it
MOST: Final = 4096  # windows that a proof may ask for


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """N sets that cover all (x*, u*, t) of a plan: x (N, n), u (N, m), t (N,)."""

    x: Interval
    u: Interval
    t: Interval

    def __len__(self) -> int:
        return len(self.x.lo)

    def at(self, index: Array) -> Cells:
        """Some of them, or some several times."""
        return Cells(self.x[index], self.u[index], self.t[index])


def cells_of(loop: Loop, count: int) -> Cells:
    """What covers the plan: `count` windows of its time; of a family about as many cells of its boxes."""
    plan = loop.plan
    if isinstance(plan, Family):
        return _of_family(loop, count)
    if plan.horizon is None:  # a point
        nothing = np.zeros(1)
        return Cells(*plan.enclose(nothing, nothing), Interval(nothing, np.array([np.inf])))
    ends = np.linspace(0.0, fraction_bounds(plan.horizon)[1], count + 1)
    return Cells(*plan.enclose(ends[:-1], ends[1:]), Interval(ends[:-1], ends[1:]))


def _of_family(loop: Loop, count: int) -> Cells:
    """A grid in those variables on which the derivatives of F depend."""
    zero = np.zeros(1)
    whole = [side[0] for side in loop.plan.enclose(zero, zero)]
    lo, hi = (np.concatenate([getattr(side, end) for side in whole]) for end in ("lo", "hi"))
    slopes = jacobian(loop.field, loop.names)
    bent = free_symbols([e for row in slopes for e in row])
    split = [name in bent and high > low for name, low, high in zip(loop.names, lo, hi, strict=True)]
    parts = max(1, int(count ** (1 / sum(split)) + 1e-9)) if any(split) else 1
    counts = [parts + 1 if bends else 2 for bends in split]
    ends = [np.linspace(a, b, count) for a, b, count in zip(lo, hi, counts, strict=True)]
    low, high = (
        np.stack(np.meshgrid(*(own[side] for own in ends), indexing="ij"), axis=-1).reshape(-1, len(lo))
        for side in (slice(None, -1), slice(1, None))
    )
    n, count = loop.states, len(low)
    x, u = Interval(low[:, :n], high[:, :n]), Interval(low[:, n:], high[:, n:])
    return Cells(x, u, Interval(np.zeros(count), np.full(count, np.inf)))


def in_time(loop: Loop, cells: Cells) -> Cells:
    """The cells with the times at which h is there: their own, or every time, where the claim is for ever.

    Where nothing else is known of an h that depends on t, t is anything from 0 on.
    """
    if loop.model.h is None or TIME not in free_symbols(loop.model.h):
        return cells
    if loop.horizon is not None and np.isfinite(cells.t.hi).all():
        return cells
    if loop.horizon is not None:
        ends = np.linspace(0.0, fraction_bounds(loop.horizon)[1], _TIMES + 1)
    elif (period := time_period(loop.model.h)) is not None:
        ends = np.linspace(0.0, float(period.hi), _TIMES + 1)
    else:
        ends = np.array([0.0, np.inf])
    k, n = len(ends) - 1, len(cells)
    found = cells.at(np.repeat(np.arange(n), k))
    return Cells(found.x, found.u, Interval(np.tile(ends[:-1], n), np.tile(ends[1:], n)))


def end_of(loop: Loop) -> Cells | None:
    """Where a finite plan ends, if it rests there for ever after."""
    if loop.afterwards != "rest" or loop.plan.horizon is None:
        return None
    low, high = fraction_bounds(loop.plan.horizon)
    lo, hi = np.array([low]), np.array([high])
    return Cells(*loop.plan.enclose(lo, hi), Interval(lo, hi))


def steepness(loop: Loop, count: int) -> Array | None:
    """sup |u*'_j| along the plan, (m,); None if u* jumps."""
    plan = loop.plan
    if (bundle := loop.spec.trajectory.bundle) is not None:
        rate = bundle.input_rate
        return None if rate is None else np.array([fraction_bounds(each)[1] for each in rate])
    if plan.horizon is None or plan.is_constant:
        return np.zeros(loop.inputs)
    if isinstance(plan, PiecewisePlan):
        if plan.data.interpolation == "hold":
            return None
        u, length = plan.pieces.u, plan.pieces.length
        slope = u[:, :, 1]
        if u.lo.shape[2] > 2:
            reach = Interval(np.zeros_like(length.hi), length.hi)[:, None]
            slope = slope + 2 * (reach * u[:, :, 2])
        return np.asarray(slope.sanitised().magnitude.max(axis=0))
    ends = cells_of(loop, count).t
    tape = Tape(derivatives(plan.u, TIME), (TIME,))
    return np.asarray(tape.run([ends], ends.lo.shape).magnitude.max(axis=1))


def largest_jump(loop: Loop) -> Array:
    """How far apart rows of u* held between knots may be that last at u*_j(t) and at ubar_j, (m,).

    Nothing, if every jump is where commands begin to act; but at the left end of an interval a computer's time may be
    that of the interval before.
    """
    knots, Ts = loop.plan.knots, loop.sample_time
    if knots is None:
        return np.full(loop.inputs, np.inf)
    begins, rows = list(knots.t[:-1]), list(knots.u[:-1])
    if loop.afterwards == "repeat":
        begins, rows = begins + [knots.t[-1] + t for t in begins], rows + rows
    jumps = [t for t, (a, b) in zip(begins[1:], pairwise(rows), strict=True) if a != b]
    if loop.hold == "middle" and all(((t - loop.rest) / Ts).denominator == 1 for t in jumps):
        return np.zeros(loop.inputs)
    span = (Ts if loop.hold == "left" else Ts / 2) * Fraction(1001, 1000)
    near = (rows[k : bisect_right(begins, end + span)] for k, end in enumerate((*begins[1:], begins[-1])))
    apart = [[max(each) - min(each) for each in zip(*own, strict=True)] for own in near]
    return np.array([fraction_bounds(max(each))[1] for each in zip(*apart, strict=True)])
