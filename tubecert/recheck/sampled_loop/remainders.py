"""What of a sampled loop is not linear, and how large and how fast its signals are: suprema on the tube, on balls.

F(x + e, u + d) - F(x, u) - A e - B d is bounded by mean values: the slopes' distance from (A, B), on boxes that grow
from the plan to the tube in some steps. Implements: theory of the sampled loop, section 4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb

from tubecert.recheck.balls import Ball, between, exact, length
from tubecert.recheck.program import Program
from tubecert.recheck.reading import TIME
from tubecert.recheck.sampled_loop.windows import Course, Window, most, times_of
from tubecert.recheck.terms import NOUGHT, Matrix, Term, names, slopes, variable

_STEPS = 5  # boxes between the plan and the tube
_PLAN = Fraction(1, 2**24)  # what a computer misses x* and u* by, of their largest size

Floats = Sequence[Sequence[float]]


@dataclass(frozen=True)
class Size:
    """Bounds of the components of a signal that may jump; or of its Euclidean length, then all are that."""

    each: Sequence[Ball]
    length: bool

    @classmethod
    def of(cls, bound: Fraction | Sequence[Fraction], components: int) -> Size:
        """A number bounds the length, several the components."""
        if isinstance(bound, Fraction):
            return cls([exact(bound)] * components, length=components > 1)
        return cls([exact(q) for q in bound], length=False)


@dataclass(frozen=True)
class Slow:
    """A component of eta: its column of H (n), and sup |eta|, |eta'|, |eta(0)|."""

    column: Sequence[Ball]
    size: Ball
    rate: Ball
    first: Ball


class Remainders:
    """The suprema of one plan with the matrices A (n, n), B (n, m), E (n, k) of the error equation."""

    def __init__(self, course: Course, A: Floats, B: Floats, E: Floats, windows: int, *, slow: bool) -> None:
        spec = course.spec
        self._course, self._spec, self._slow = course, spec, slow
        self._A, self._B, self._E = A, B, E
        self._windows = course.windows(windows)
        self._times = times_of(course)
        self._count = windows
        plant = spec.plant
        self._n, self._m = len(plant.states), len(plant.inputs)
        self._names = (*plant.states, *plant.inputs, *plant.ranges)
        self._parameters = [between(exact(a), exact(b)) for a, b in plant.ranges.values()]
        self._field = _driven(plant.unknown or plant.f, plant.gained or plant.B, plant.inputs)
        columns = [slopes(self._field, name) for name in (*plant.states, *plant.inputs)]
        blown = [] if spec.disturbance is None else [e for row in spec.disturbance.E for e in row]
        self._slopes = Program([*(e for row in zip(*columns, strict=True) for e in row), *blown], self._names)
        self._strange = self._strangers()

    # -- along the plan

    @cached_property
    def states_above(self) -> list[Ball]:
        """sup |x*_i|, (n,)."""
        return [most(own.x[i] for own in self._windows) for i in range(self._n)]

    @cached_property
    def inputs_above(self) -> list[Ball]:
        """sup |u*_j|, (m,)."""
        return [most(own.u[j] for own in self._windows) for j in range(self._m)]

    @cached_property
    def held(self) -> list[Ball]:
        """sup |u*_j - ubar_j| while a command acts, (m,), with what a computer misses u* by."""
        own = zip(self._course.held(self._windows), self.inputs_above, strict=True)
        return [x + exact(_PLAN) * above for x, above in own]

    @cached_property
    def defect(self) -> list[Ball]:
        """sup |x*_i' - F_i(x*, u*, p0)|, (n,)."""
        return self._course.defect(self._count)

    @cached_property
    def matched(self) -> list[int]:
        """The inputs beside which an h acts."""
        h, declared = self._spec.uncertainty.h, self._spec.uncertainty.declared
        if h is None:
            return list(range(self._m)) if declared else []
        return [j for j, e in enumerate(h) if e is not NOUGHT]

    @property
    def jumps(self) -> bool:
        """Whether h may jump: nothing bounds how fast it changes."""
        given = self._spec.uncertainty
        return given.h is None and not {"h_x", "h_t"} <= given.declared.keys()

    @property
    def has_rates(self) -> bool:
        """Whether what parameters do along the plan has a rate, if it is taken for slow."""
        return not (self._slow and self._strange) or self._course.smooth

    def sudden(self) -> list[tuple[Floats, Size]]:
        """What may jump: columns (n, k) and its size."""
        wind, found = self._spec.disturbance, []
        if wind is not None and wind.rate is None:
            found.append((self._E, Size.of(wind.bound, len(self._E[0]))))
        if self.jumps and self.matched:
            found.append((self._B, Size.of(self._spec.uncertainty.declared["h"], self._m)))
        return found

    # -- slow signals

    def slow(self, W: Sequence[Ball]) -> list[Slow]:
        """The components of eta, of which h is met where |e| <= W: h, a wind with a rate, parameters."""
        found = [] if self.jumps else self._uncertain(W)
        wind = self._spec.disturbance
        if wind is not None and wind.rate is not None:
            sizes = Size.of(wind.bound, len(self._E[0])).each
            rate = exact(wind.rate)
            found += [Slow(column, x, rate, x) for column, x in zip(_columns(self._E), sizes, strict=True)]
        if self._slow:
            for i, (size, rate) in self._strangeness.items():
                column = [arb(int(i == k)) for k in range(self._n)]
                found.append(Slow(column, size, rate, size))
        return found

    def _uncertain(self, W: Sequence[Ball]) -> list[Slow]:
        given, columns = self._spec.uncertainty, _columns(self._B)
        if given.h is None:
            if not self.matched:
                return []
            size, steep, fast = (exact(given.declared[key]) for key in ("h", "h_x", "h_t"))
            rate = fast + steep * most([length([x.abs_upper() for x in own.speed]) for own in self._windows])
            return [Slow(columns[j], size, rate, size) for j in self.matched]
        size_of = [arb(0)] * self._m
        rate_of = [arb(0)] * self._m
        for own, time in self._timed():
            size_of = [
                a.max(x.abs_upper())
                for a, x in zip(size_of, self._h.run([*_wider(own.x, W), time]), strict=True)
            ]
            every = self._h_slopes.run([*own.x, time])
            wide = self._n + 1
            for j in range(self._m):
                by_states, moved = every[j * wide : (j + 1) * wide - 1], every[(j + 1) * wide - 1]
                moved = sum((a * v for a, v in zip(by_states, own.speed, strict=True)), start=moved)
                rate_of[j] = rate_of[j].max(moved.abs_upper())
        first = self._h_first
        return [Slow(columns[j], size_of[j], rate_of[j], first[j]) for j in self.matched]

    @cached_property
    def _h(self) -> Program:
        return Program(self._spec.uncertainty.h or (), (*self._spec.plant.states, TIME))

    @cached_property
    def _h_slopes(self) -> Program:
        """By states, then by t, row by row."""
        inputs = (*self._spec.plant.states, TIME)
        h = self._spec.uncertainty.h or ()
        columns = [slopes(h, name) for name in inputs]
        return Program([e for row in zip(*columns, strict=True) for e in row], inputs)

    @property
    def _h_first(self) -> list[Ball]:
        """sup |h_j| at x*(0)."""
        curve = self._course.curve
        starts = [own.x for own in self._windows] if self._course.family else [curve.somewhere()]
        found = [self._h.run([*x, arb(0)]) for x in starts]
        return [most(own[j] for own in found) for j in range(self._m)]

    def _timed(self) -> Iterator[tuple[Window, Ball]]:
        """Windows with the times of h there; one window is enough for an h that is free of the states."""
        free = names(self._spec.uncertainty.h or ()).isdisjoint(self._spec.plant.states)
        anywhere = [own for own in self._windows if own.time is None]
        for own in (
            [*anywhere[:1], *(own for own in self._windows if own.time is not None)]
            if free
            else self._windows
        ):
            for time in self._times if own.time is None else (own.time,):
                yield own, time

    # -- parameters

    def _strangers(self) -> dict[int, Term]:
        """F_i(x, u, p) - F_i(x, u, p0) of the rows in which parameters stand."""
        plant = self._spec.plant
        known = _driven(plant.f, plant.B, plant.inputs)
        drift, gains = plant.unknown or plant.f, plant.gained or plant.B
        return {
            i: self._field[i] - known[i]
            for i in range(self._n)
            if not names([drift[i], *gains[i]]).isdisjoint(plant.ranges)
        }

    @cached_property
    def _strangeness(self) -> dict[int, tuple[Ball, Ball]]:
        """Of these rows along the plan: how large, and how fast."""
        rows = list(self._strange.values())
        plant = self._spec.plant
        moving = (*plant.states, *plant.inputs)
        derived = [slopes(rows, name) for name in moving]
        centred = [slopes([*rows, *(e for own in derived for e in own)], name) for name in plant.ranges]
        plain = Program([*rows, *(e for own in derived for e in own)], self._names)
        by_parameter = [Program(own, self._names) for own in centred]
        reach = [exact((b - a) / 2) for a, b in plant.ranges.values()]
        count = len(rows)
        size, rate = [arb(0)] * count, [arb(0)] * count
        for own in self._windows:
            point = [*own.x, *own.u, *self._parameters]
            mean = [arb(0)] * (count * (1 + len(moving)))
            for program, r in zip(by_parameter, reach, strict=True):
                mean = [a + r * x.abs_upper() for a, x in zip(mean, program.run(point), strict=True)]
            least = [x.abs_upper().min(y) for x, y in zip(plain.run(point), mean, strict=True)]
            speeds = [*own.speed, *own.steepness]
            for k in range(count):
                size[k] = size[k].max(least[k])
                steep = least[count + k :: count]
                moved = sum((a * v.abs_upper() for a, v in zip(steep, speeds, strict=False)), start=arb(0))
                rate[k] = rate[k].max(moved)
        return dict(zip(self._strange, zip(size, rate, strict=True), strict=True))

    # -- on the tube

    def rho(
        self, W: Sequence[Ball], U: Sequence[Ball], slow: Sequence[Slow]
    ) -> tuple[list[Ball], list[Ball]]:
        """sup |rho| where |e| <= W, |delta| <= U: through the unit matrix (n,), and the columns of B (m,)."""
        acting = self._acting(slow)
        found = [
            most(own) for own in zip(*(self._off(own, W, U, acting) for own in self._windows), strict=True)
        ]
        found = [x + y for x, y in zip(found, self.defect, strict=True)]
        if not self._slow:
            for i, (size, _) in self._strangeness.items():
                found[i] += size
        return found, [x + y for x, y in zip(self.held, self._steep(W), strict=True)]

    def _acting(self, slow: Sequence[Slow]) -> list[Ball]:
        """sup |h_j|, (m,)."""
        found = [arb(0)] * self._m
        if self.jumps:
            return [exact(self._spec.uncertainty.declared["h"])] * self._m if self.matched else found
        for j, own in zip(self.matched, slow, strict=False):
            found[j] = own.size
        return found

    def _off(self, own: Window, W: Sequence[Ball], U: Sequence[Ball], acting: Sequence[Ball]) -> list[Ball]:
        """What a window has of the remainder, (n,)."""
        n, m = self._n, self._m
        total = [arb(0)] * n
        weights = [*W, *(x + y for x, y in zip(U, self.held, strict=True))]
        values: list[Ball] = []
        for step in range(1, _STEPS + 1):
            share = arb(step) / _STEPS
            x = _wider(own.x, [share * w for w in W])
            u = _wider(own.u, [share * w + y for w, y in zip(U, self.held, strict=True)])
            values = self._slopes.run([*x, *u, *self._parameters])
            for i in range(n):
                row = values[i * (n + m) : (i + 1) * (n + m)]
                off = zip(row, (*self._A[i], *self._B[i]), weights, strict=True)
                total[i] += sum(((a - b).abs_upper() * w for a, b, w in off), start=arb(0))
        wind = self._spec.disturbance
        for i in range(n):
            gains = values[i * (n + m) + n : (i + 1) * (n + m)]
            off = zip(gains, self._B[i], acting, strict=True)
            total[i] = total[i] / _STEPS + sum(((a - b).abs_upper() * h for a, b, h in off), start=arb(0))
            if wind is not None:
                k = len(self._E[0])
                start = n * (n + m) + i * k
                size = Size.of(wind.bound, k)
                shaken = [
                    (a - b).abs_upper() for a, b in zip(values[start : start + k], self._E[i], strict=True)
                ]
                if size.length and wind.rate is None:
                    total[i] += length(shaken) * size.each[0]
                else:
                    total[i] += sum((a * b for a, b in zip(shaken, size.each, strict=True)), start=arb(0))
        return total

    def _steep(self, W: Sequence[Ball]) -> list[Ball]:
        """sup |h_j(t, x* + e) - h_j(t, x*)|, (m,)."""
        given = self._spec.uncertainty
        if self.jumps or not self.matched:
            return [arb(0)] * self._m
        if given.h is None:
            return [exact(given.declared["h_x"]) * length(W)] * self._m
        found, wide = [arb(0)] * self._m, self._n + 1
        for own, time in self._timed():
            steep = self._h_slopes.run([*_wider(own.x, W), time])
            for j in self.matched:
                row = zip(steep[j * wide : (j + 1) * wide], W, strict=False)
                found[j] = found[j].max(sum((a.abs_upper() * w for a, w in row), start=arb(0)).upper())
        return found

    def inputs(self, j: int) -> list[Ball]:
        """u*_j in every window."""
        return [own.u[j] for own in self._windows]

    def inside(self, W: Sequence[Ball]) -> Iterator[tuple[str, bool]]:
        """Whether the tube of every state stays in the safe set."""
        for i, (name, (low, high)) in enumerate(self._spec.plant.safe_set.items()):
            sides = [_wider([own.x[i]], [W[i]])[0] for own in self._windows]
            yield name, all(exact(low) <= x <= exact(high) for x in sides)


def _driven(drift: Sequence[Term], gains: Matrix, inputs: Sequence[str]) -> list[Term]:
    """f + B u."""
    return [
        sum((b * variable(name) for b, name in zip(row, inputs, strict=True)), start=f)
        for f, row in zip(drift, gains, strict=True)
    ]


def _columns(a: Floats) -> list[list[Ball]]:
    return [[arb(x) for x in column] for column in zip(*a, strict=True)]


def _wider(x: Sequence[Ball], by: Sequence[Ball]) -> list[Ball]:
    """Balls wider by so much on each side."""
    return [a + arb(0, b) for a, b in zip(x, by, strict=True)]
