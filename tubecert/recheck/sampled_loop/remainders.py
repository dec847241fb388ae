"""What of a sampled loop is not linear, and how large and how fast its signals are: suprema on the tube, on balls.

F(x + e, u + d) - F(x, u) - A e - B d is bounded by mean values: the slopes' distance from (A, B), on boxes that grow
from the plan to the tube in some steps. Implements: theory of the sampled loop, section 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, between, exact, length
from tubecert.recheck.program import Program
from tubecert.recheck.sampled_loop.loop import column, joined, parted, picked, sizes
from tubecert.recheck.sampled_loop.windows import Course, Window, driven, tops
from tubecert.recheck.specified.numbers import TIME
from tubecert.recheck.terms import NOUGHT, Term, names, slopes
from tubecert.recheck.times import common_period

_STEPS = 5  # boxes between the plan and the tube
_PARTS = 128  # of a period of h
PLAN = Fraction(1, 2**24)  # what a computer misses x* and u* by, of their largest size


@dataclass(frozen=True)
class Size:
    """Bounds of the components of a signal that may jump; or of its Euclidean length, then all are that."""

    each: list[Ball]
    length: bool

    @classmethod
    def of(cls, bound: Fraction | Sequence[Fraction], components: int) -> Size:
        """A number bounds the length, several the components."""
        if isinstance(bound, Fraction):
            return cls([exact(bound)] * components, length=components > 1)
        return cls([exact(q) for q in bound], length=False)

    def through(self, row: Sequence[Ball]) -> Ball:
        """sup |row w|."""
        if self.length:
            return length(row) * self.each[0]
        return sum((x.abs_upper() * y for x, y in zip(row, self.each, strict=True)), start=arb(0))


@dataclass(frozen=True)
class Slow:
    """A component of eta: its column of H (n), and sup |eta|, |eta'|, |eta(0)|."""

    column: Sequence[Ball]
    size: Ball
    rate: Ball
    first: Ball


class Remainders:
    """The suprema of one plan with the matrices A (n, n), B (n, m), E (n, k) of the error equation.

    Along the plan, in its `windows`: sup |x*_i| (n), sup |u*_j| (m); `held`: sup |u*_j - ubar_j| while a command acts
    (m), with what a computer misses u* by. Raises `ValueError` where parameters are `slow`, and u* jumps.
    """

    def __init__(self, course: Course, nominal: Sequence[arb_mat], windows: int, *, slow: bool) -> None:
        self._course, self._spec, self._slow = course, course.spec, slow
        self._A, self._B, self._E = nominal
        self._n, self._m = self._B.nrows(), self._B.ncols()
        plant, wind, h = self._spec.plant, self._spec.disturbance, self._spec.uncertainty
        self._names = (*course.names, *plant.ranges)
        self._parameters = [between(exact(a), exact(b)) for a, b in plant.ranges.values()]
        field = driven(plant.unknown or plant.f, plant.gained or plant.B, plant.inputs)
        blown = () if wind is None else (e for row in wind.E for e in row)
        self._slopes = Program([*_gradients(field, course.names), *blown], self._names)
        strange = enumerate(f - known for f, known in zip(field, course.F, strict=True))
        self._strange = {i: e for i, e in strange if not names([e]).isdisjoint(plant.ranges)}  # 0 at p0
        if slow and self._strange and not course.smooth:
            raise ValueError("u* jumps, so that parameters are not slow")
        own, timed = h.h or (), (*plant.states, TIME)
        self._h, self._slopes_of_h = Program(own, timed), Program(_gradients(own, timed), timed)
        self._sudden = h.h is None and not {"h_x", "h_t"} <= h.declared.keys()
        matched = [] if self._sudden else range(self._m)
        self._matched = [j for j in matched if h.h is None or h.h[j] is not NOUGHT]
        self._gusts = Size([], length=False) if wind is None else Size.of(wind.bound, self._E.ncols())
        self.windows, self._defect = course.windows(windows), course.defect()
        self.states_above = tops(own.x for own in self.windows)
        self.inputs_above = tops(own.u for own in self.windows)
        jumps = zip(course.held(self.windows), self.inputs_above, strict=True)
        self.held = [x + exact(PLAN) * above for x, above in jumps]

    # -- signals

    def sudden(self) -> list[tuple[arb_mat, Size]]:
        """What may jump, a wind or h: columns (n, k) and its size."""
        wind = self._spec.disturbance
        found = [] if wind is None or wind.rate is not None else [(self._E, self._gusts)]
        if self._sudden:
            found.append((self._B, Size.of(self._spec.uncertainty.declared["h"], self._m)))
        return found

    def slow(self, W: Sequence[Ball]) -> list[Slow]:
        """The components of eta, of which h is met where |e| <= W: h, a wind with a rate, parameters."""
        found = [] if self._sudden else self._uncertain(W)
        wind = self._spec.disturbance
        if wind is not None and wind.rate is not None:
            own, rate = zip(_columns(self._E), self._gusts.each, strict=True), exact(wind.rate)
            found += [Slow(e, size, rate, size) for e, size in own]
        if self._slow:
            units = _columns(picked(range(self._n), self._n))
            found += [Slow(units[i], size, rate, size) for i, (size, rate) in self._strangeness.items()]
        return found

    def _uncertain(self, W: Sequence[Ball]) -> list[Slow]:
        given, columns = self._spec.uncertainty, _columns(self._B)
        if given.h is None:
            size, steep, fast = (exact(given.declared[key]) for key in ("h", "h_x", "h_t"))
            (speed,) = tops([length([x.abs_upper() for x in own.speed])] for own in self.windows)
            return [Slow(own, size, fast + steep * speed, size) for own in columns]
        start = [own.x for own in self.windows] if self._course.family else [self._course.curve.somewhere()]
        sizes_ = tops(self._h.run([*_wider(own.x, W), time]) for own, time in self._timed)
        first = tops(self._h.run([*x, arb(0)]) for x in start)
        moved = ((self._along_h(own.x, time), [*own.speed, arb(1)]) for own, time in self._timed)
        rates = tops((slope * column(speed)).entries() for slope, speed in moved)
        return [Slow(columns[j], sizes_[j], rates[j], first[j]) for j in self._matched]

    def _along_h(self, x: Sequence[Ball], time: Ball) -> arb_mat:
        """Slopes of h by states, then by t, (m, n + 1)."""
        return arb_mat(self._m, self._n + 1, self._slopes_of_h.run([*x, time]))

    @cached_property
    def _timed(self) -> list[tuple[Window, Ball]]:
        """Windows with the times of h there; one window is enough for an h that is free of the states.

        Where the plan's own time is not that of h these are parts of a period, or of all of it.
        """
        h, parts, horizon = self._spec.uncertainty.h or (), [arb(0)], self._course.horizon
        if TIME in names(h):
            whole = exact(horizon) if horizon is not None else common_period(h).ball
            parts = [whole * between(arb(k) / _PARTS, arb(k + 1) / _PARTS) for k in range(_PARTS)]
        anywhere = [own for own in self.windows if own.time is None]
        if names(h).isdisjoint(self._spec.plant.states):
            anywhere = anywhere[:1]
        found = [(own, own.time) for own in self.windows if own.time is not None]
        return [*found, *((own, time) for own in anywhere for time in parts)]

    @cached_property
    def _strangeness(self) -> dict[int, tuple[Ball, Ball]]:
        """What parameters do along the plan, by row: how large, and how fast; 0 at p0, so bounded by slopes in p."""
        rows, moving = list(self._strange.values()), self._course.names
        own = [*rows, *_gradients(rows, moving)]
        program = Program([*rows, *_gradients(own, tuple(self._spec.plant.ranges))], self._names)
        reach = column([exact((b - a) / 2) for a, b in self._spec.plant.ranges.values()])
        count, found = len(rows), []
        for window in self.windows:
            values = program.run([*window.x, *window.u, *self._parameters])
            far = (sizes(arb_mat(len(own), reach.nrows(), values[count:])) * reach).entries()
            size = [x.abs_upper().min(y) for x, y in zip(values[:count], far[:count], strict=True)]
            speeds = [*window.speed, *window.steepness, *[arb(0)] * (self._m - len(window.steepness))]
            steep = arb_mat(count, len(moving), far[count:])
            found.append([*size, *(steep * sizes(column(speeds))).entries()])
        top = tops(found)
        return dict(zip(self._strange, zip(top[:count], top[count:], strict=True), strict=True))

    # -- on the tube

    def rho(self, W: Sequence[Ball], U: Sequence[Ball], slow: Sequence[Slow]) -> list[Ball]:
        """sup |rho| where |e| <= W, |delta| <= U: through the unit matrix (n), and the columns of B (m)."""
        acting = [exact(self._spec.uncertainty.declared["h"]) if self._sudden else arb(0)] * self._m
        for j, eta in zip(self._matched, slow, strict=False):
            acting[j] = eta.size
        bent = tops(self._off(own, W, U, acting) for own in self.windows)
        missed = list(self._defect)
        if not self._slow:
            for i, (size, _) in self._strangeness.items():
                missed[i] += size
        return [*map(arb.__add__, bent, missed), *map(arb.__add__, self.held, self._steep(W))]

    def _off(self, own: Window, W: Sequence[Ball], U: Sequence[Ball], acting: Sequence[Ball]) -> list[Ball]:
        """What a window has of the remainder without the defect, (n,)."""
        n, m, k = self._n, self._m, self._E.ncols()
        nominal = joined([[self._A, self._B]])
        weights = column([*W, *map(arb.__add__, U, self.held)])
        total, off, values = arb_mat(n, 1), nominal, []
        for step in range(1, _STEPS + 1):
            share = arb(step) / _STEPS
            x = _wider(own.x, [share * w for w in W])
            u = _wider(own.u, [share * w + y for w, y in zip(U, self.held, strict=True)])
            values = self._slopes.run([*x, *u, *self._parameters])
            off = sizes(arb_mat(n, n + m, values[: n * (n + m)]) - nominal)
            total += off * weights
        total = total / _STEPS + parted(off, n)[1] * column(acting)
        shaken = (arb_mat(n, k, values[n * (n + m) :]) - self._E).tolist()
        return [x + self._gusts.through(row) for x, row in zip(total.entries(), shaken, strict=True)]

    def _steep(self, W: Sequence[Ball]) -> list[Ball]:
        """sup |h_j(t, x* + e) - h_j(t, x*)|, (m,)."""
        given = self._spec.uncertainty
        if given.h is None:
            slope = arb(0) if self._sudden else exact(given.declared["h_x"])
            return [slope * length(W)] * self._m
        away = column([*W, arb(0)])
        near = (self._along_h(_wider(own.x, W), time) for own, time in self._timed)
        return tops((sizes(own) * away).entries() for own in near)


def _gradients(rows: Sequence[Term], by: Sequence[str]) -> list[Term]:
    """The slopes of every row, row by row."""
    columns = [slopes(rows, name) for name in by]
    return [e for row in zip(*columns, strict=True) for e in row]


def _columns(a: arb_mat) -> list[list[Ball]]:
    return a.transpose().tolist()


def _wider(x: Sequence[Ball], by: Sequence[Ball]) -> list[Ball]:
    """Balls wider by so much on each side."""
    return [a + arb(0, b) for a, b in zip(x, by, strict=True)]
