"""A plan in windows of its time or cells of a family's boxes; what of the loop is not linear on the tube around it.

Windows tell where the plan is and how fast it moves; beside that: how far its input is from what the actuators hold,
and how far it is from a motion of the plant. F(x + e, u + d) - F(x, u) - A e - B d is bounded by mean values: slopes'
distance from (A, B) on balls that grow from the plan to the tube in some steps; what parameters do likewise, from p0.
Implements: theory of the sampled loop, sections 1 and 4.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from heapq import heapify, heappush, heapreplace
from itertools import islice, pairwise, product
from math import ceil

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import (
    Ball,
    between,
    ceiling,
    column,
    exact,
    floor,
    joined,
    length,
    picked,
    sizes,
)
from tubecert.recheck.boxes import Field
from tubecert.recheck.cover import SHARP
from tubecert.recheck.curve import CLOCK, Curve, Knots
from tubecert.recheck.identity import vanish
from tubecert.recheck.plans import Plan
from tubecert.recheck.program import Program
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.numbers import TIME, upright
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Planned, Resting, Tabled
from tubecert.recheck.system import curve_of, knots_of
from tubecert.recheck.terms import NOUGHT, Matrix, Term, names, plus, replaced, slopes, times, variable
from tubecert.recheck.times import common_period

_HALVINGS = 500  # for one supremum along a plan
_STEPS = 5  # boxes between the plan and the tube
_PARTS = 128  # of a period of h
PLAN = Fraction(1, 2**24)  # what a computer misses x* and u* by, of their largest size


@dataclass(frozen=True)
class Window:
    """Boxes of x* (n) and u* (m), of x*' and u*', and when that is; `time` None: at any time."""

    x: Sequence[Ball]
    u: Sequence[Ball]
    speed: Sequence[Ball]
    steepness: Sequence[Ball]
    time: Ball | None


@dataclass(frozen=True)
class Course:
    """A plan of a specification: a curve, or the boxes of a family; `knots` where it was planned through some."""

    spec: SampledSpecification
    curve: Curve
    knots: Knots | None

    @property
    def family(self) -> AnyPlan | None:
        """The family, if it is one."""
        trajectory = self.spec.trajectory
        return trajectory if isinstance(trajectory, AnyPlan) else None

    @property
    def horizon(self) -> Fraction | None:
        """Until when something is claimed; None: for ever."""
        return self.spec.trajectory.horizon if self.spec.afterwards == "nothing" else None

    @property
    def smooth(self) -> bool:
        """Whether u* has a rate."""
        if self.family is not None:
            return self.family.input_rate is not None
        return self.knots is None or not self.knots.held

    @property
    def goes_on(self) -> bool:
        """Whether a plan that is repeated is one of formulas, of a period that is no longer, or begins as it ends."""
        plan, knots, sample = self.spec.trajectory, self.knots, self.spec.hardware.sample_time
        if self.spec.afterwards != "repeat" or isinstance(plan, (Resting, AnyPlan)):
            return True
        if isinstance(plan, Expressed):
            period = common_period([*plan.x, *plan.u])
            if not period.of_pi:
                return period.length <= plan.horizon
            with ctx.workprec(2 * SHARP):  # a horizon of 2*pi is written as the next decimal of 30 digits
                return bool(period.ball <= exact(plan.horizon))
        assert knots is not None
        joined = knots.x[0] == knots.x[-1] and knots.u[0] == knots.u[-1]
        return joined and plan.horizon % sample == 0 and knots.t[-1] == plan.horizon

    # -- windows

    @cached_property
    def F(self) -> list[Term]:
        """The plant for the middles of parameters, f + B u, (n,)."""
        return driven(self.spec.plant.f, self.spec.plant.B, self.spec.plant.inputs)

    @property
    def names(self) -> tuple[str, ...]:
        """Of states and inputs."""
        return (*self.spec.plant.states, *self.spec.plant.inputs)

    @property
    def _end(self) -> tuple[list[Ball], list[Ball]]:
        """x* and u* at the end, of inputs that jump there those before."""
        horizon = self.spec.trajectory.horizon
        assert horizon is not None, "only then something may hold afterwards"
        return self.curve.at(horizon)

    def windows(self, count: int) -> list[Window]:
        """About so many windows, or cells, that cover it."""
        if self.family is not None:
            return list(self._cells(self.family, count))
        found = list(self._along(count))
        if self.spec.afterwards == "rest":
            x, u = self._end
            found.append(Window(x, u, [arb(0)] * len(x), [arb(0)] * len(u), None))
        return found

    def _along(self, count: int) -> Iterator[Window]:
        curve, n, m = self.curve, len(self.curve.x), len(self.curve.u)
        terms = [*curve.x, *curve.u, *curve.slope, *slopes(curve.u, CLOCK)]
        field = Field(terms, curve.parts[0].values)
        whole = sum((float(part.length.mid()) for part in curve.parts), start=0.0)
        timed = self.horizon is not None and curve.moves
        for part in curve.parts:
            pieces = max(1, ceil(count * float(part.length.mid()) / whole)) if curve.moves and whole else 1
            own, length = field.with_values(part.values), ceiling(part.length)
            for lo, hi in pairwise([*(length * k / pieces for k in range(pieces)), length]):
                found = iter(own.hull([(lo, hi)] if own.variables else []))
                x, u, speed, steepness = (list(islice(found, size)) for size in (n, m, n, m))
                yield Window(x, u, speed, steepness, exact(part.start) + between(lo, hi) if timed else None)

    def defect(self) -> list[Ball]:
        """sup |x*_i' - F_i(x*, u*, p0)|, (n,), and |F_i| where the plan rests."""
        if self.family is not None:
            return [exact(self.family.defect)] * len(self.curve.x)
        along = dict(zip(self.names, (*self.curve.x, *self.curve.u), strict=True))
        missed = [f - e for f, e in zip(replaced(self.F, along), self.curve.slope, strict=True)]
        found = [arb(0) if self.knots is None and vanish([e]) else self._supremum(e) for e in missed]
        if self.spec.afterwards != "rest":
            return found
        x, u = self._end
        return tops([found, Program(self.F, self.names).run([*x, *u])])

    def _supremum(self, term: Term) -> Ball:
        """sup |term| along the plan: the piece of it with the largest bound is halved, again and again."""
        whole, parts = Field([term], self.curve.parts[0].values), self.curve.parts

        def piece(k: int, lo: float, hi: float) -> tuple[float, int, float, float]:
            own = whole.with_values(parts[k].values)
            (found,) = own.hull([(lo, hi)] if own.variables else [])
            return -ceiling(found.abs_upper()), k, lo, hi

        pieces = [piece(k, 0.0, ceiling(part.length)) for k, part in enumerate(parts)]
        heapify(pieces)
        for _ in range(_HALVINGS):
            _, k, lo, hi = pieces[0]
            middle = 0.5 * lo + 0.5 * hi
            heapreplace(pieces, piece(k, lo, middle))
            heappush(pieces, piece(k, middle, hi))
        return arb(-pieces[0][0])

    def _cells(self, family: AnyPlan, count: int) -> Iterator[Window]:
        """A grid in what the derivatives of F depend on; x*' is F(x*, u*) within the defect."""
        n, ends = len(self.spec.plant.states), {**family.x, **family.u}
        bent = names(slope for name in self.names for slope in slopes(self.F, name))
        split = [name for name in self.names if name in bent and ends[name][0] < ends[name][1]]
        parts = max(1, int(count ** (1 / len(split)) + 1e-9)) if split else 1
        grid = []
        for name in self.names:
            (a, b), pieces = ends[name], parts if name in split else 1
            own = [exact(a + (b - a) * k / pieces) for k in range(pieces + 1)]
            grid.append([between(low, high) for low, high in pairwise(own)])
        field, missed = Field(self.F), arb(0, exact(family.defect))
        rates = [arb(0, exact(rate)) for rate in family.input_rate or ()]
        for cell in product(*grid):
            values = dict(zip(self.names, cell, strict=True))
            own = field.hull([(floor(values[v]), ceiling(values[v])) for v in field.variables])
            yield Window(cell[:n], cell[n:], [x + missed for x in own], rates, None)

    def held(self, windows: Sequence[Window]) -> list[Ball]:
        """sup |u*_j - ubar_j| while a command acts, (m,), without rounding: 0 for jumps where commands begin to act."""
        machine, m = self.spec.hardware, len(self.spec.plant.inputs)
        span = machine.sample_time if machine.hold == "left" else machine.sample_time / 2
        if machine.hold == "continuous" or (self.family is not None and not self.smooth):
            return [arb(0)] * m
        if self.knots is None or not self.knots.held:
            return [exact(span) * rate for rate in tops(own.steepness for own in windows)]
        begins, rows = list(self.knots.t[:-1]), list(self.knots.u[:-1])
        if self.spec.afterwards == "repeat":
            begins += [self.knots.t[-1] + t for t in begins]
            rows += rows
        jumps = [t for t, (a, b) in zip(begins[1:], pairwise(rows), strict=True) if a != b]
        since = machine.delay % machine.sample_time
        if machine.hold == "middle" and all((t - since) % machine.sample_time == 0 for t in jumps):
            return [arb(0)] * m
        # at the left end a computer's time may be that of the interval before
        ends = [begin + span * Fraction(1001, 1000) for begin in (*begins[1:], begins[-1])]
        near = [zip(*rows[k : bisect_right(begins, end)], strict=True) for k, end in enumerate(ends)]
        jumps_by_input = zip(*([max(own) - min(own) for own in column] for column in near), strict=True)
        return [exact(max(own)) for own in jumps_by_input]


def tops(rows: Iterable[Sequence[Ball]]) -> list[Ball]:
    """The largest magnitudes, column by column; what is not a number stays so."""
    return [reduce(arb.max, (x.abs_upper() for x in own)) for own in zip(*rows, strict=True)]


def driven(drift: Sequence[Term], gains: Matrix, inputs: Sequence[str]) -> list[Term]:
    """f + B u, (n,)."""
    return [row[0] for row in plus(upright(drift), times(gains, [[variable(name)] for name in inputs]))]


def course_of(spec: SampledSpecification, plan: Plan) -> Course:
    """The plan of a specification; `plan` holds the knots of one that was planned. Raises `CertificateError`."""
    own, plant = spec.trajectory, spec.plant
    drift = driven(plant.f, plant.B, plant.inputs)
    curve = curve_of(own, plan, plant.states, plant.inputs, drift)
    knots = knots_of(plan, own.between, own.horizon) if isinstance(own, (Planned, Tabled)) else None
    return Course(spec, curve, knots)


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
        (_, self._B, self._E), self._nominal = nominal, joined([nominal])
        self._n, self._m = self._B.nrows(), self._B.ncols()
        plant, wind, h = self._spec.plant, self._spec.disturbance, self._spec.uncertainty
        self._names = (*course.names, *plant.ranges)
        self._middle = [exact((a + b) / 2) for a, b in plant.ranges.values()]
        self._reach = [exact((b - a) / 2) for a, b in plant.ranges.values()]
        field = driven(plant.unknown or plant.f, plant.gained or plant.B, plant.inputs)
        blown = () if wind is None else zip(*wind.E, strict=True)
        self._slopes = Program(_gradients(field, course.names, *blown), self._names, wide=True)
        strange = enumerate(f - known for f, known in zip(field, course.F, strict=True))
        self._strange = {i: e for i, e in strange if not names([e]).isdisjoint(plant.ranges)}  # 0 at p0
        if slow and self._strange and not course.smooth:
            raise ValueError("u* jumps, so that parameters are not slow")
        own, timed = h.h or (), (*plant.states, TIME)
        self._h, self._slopes_of_h = (Program(e, timed, wide=True) for e in (own, _gradients(own, timed)))
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
            own, rate = zip(self._E.transpose().tolist(), self._gusts.each, strict=True), exact(wind.rate)
            found += [Slow(e, size, rate, size) for e, size in own]
        if self._slow:
            units = picked(range(self._n), self._n).tolist()
            found += [Slow(units[i], size, rate, size) for i, (size, rate) in self._strangeness.items()]
        return found

    def _uncertain(self, W: Sequence[Ball]) -> list[Slow]:
        given, columns = self._spec.uncertainty, self._B.transpose().tolist()
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
        program = Program(_gradients(own, tuple(self._spec.plant.ranges), own), self._names, wide=True)
        count, by, found = len(rows), [*[arb(0)] * len(moving), *self._reach], []
        for window in self.windows:
            at = [*window.x, *window.u, *self._middle]
            mean, last = _growing(program, at, by, arb_mat(len(own), len(self._reach) + 1))
            far = (mean * column([*self._reach, arb(0)])).entries()
            far = [x.min(last[i, len(self._reach)]) for i, x in enumerate(far)]
            speeds = [*window.speed, *window.steepness, *[arb(0)] * (self._m - len(window.steepness))]
            steep = arb_mat(count, len(moving), far[count:])
            found.append([*far[:count], *(steep * sizes(column(speeds))).entries()])
        top = tops(found)
        return dict(zip(self._strange, zip(top[:count], top[count:], strict=True), strict=True))

    # -- on the tube

    def rho(self, W: Sequence[Ball], U: Sequence[Ball], slow: Sequence[Slow]) -> list[Ball]:
        """sup |rho| where |e| <= W, |delta| <= U: through the unit matrix (n), and the columns of B (m)."""
        acting = [exact(self._spec.uncertainty.declared["h"]) if self._sudden else arb(0)] * self._m
        for j, eta in zip(self._matched, slow, strict=False):
            acting[j] = eta.size
        bent = tops(self._off(own, W, U, acting) for own in self.windows)
        sudden = {} if self._slow else self._strangeness
        missed = [x + sudden[i][0] if i in sudden else x for i, x in enumerate(self._defect)]
        return [*map(arb.__add__, bent, missed), *map(arb.__add__, self.held, self._steep(W))]

    def _off(self, own: Window, W: Sequence[Ball], U: Sequence[Ball], acting: Sequence[Ball]) -> list[Ball]:
        """What a window has of the remainder without the defect, (n,)."""
        n, others = self._n, [arb(0)] * self._E.ncols()
        at = [*own.x, *_wider(own.u, self.held), *_wider(self._middle, self._reach)]
        mean, last = _growing(self._slopes, at, [*W, *U, *[arb(0)] * len(self._reach)], self._nominal)
        total = mean * column([*W, *map(arb.__add__, U, self.held), *others])
        total += last * column([*[arb(0)] * n, *acting, *others])
        shaken = (row[n + self._m :] for row in last.tolist())
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


def _gradients(rows: Sequence[Term], by: Sequence[str], *beside: Sequence[Term]) -> list[Term]:
    """The slopes of every row, row by row, and columns beside them."""
    columns = [*(slopes(rows, name) for name in by), *beside]
    return [e for row in zip(*columns, strict=True) for e in row]


def _growing(
    program: Program, at: Sequence[Ball], by: Sequence[Ball], nominal: arb_mat
) -> tuple[arb_mat, arb_mat]:
    """How far outputs are from what is nominal on boxes that grow until they are `by` wider: the mean, and the last."""
    total, last = 0 * nominal, nominal
    for step in range(1, _STEPS + 1):
        values = program.run(_wider(at, [arb(step) / _STEPS * x for x in by]))
        last = sizes(arb_mat(nominal.nrows(), nominal.ncols(), values) - nominal)
        total += last
    return total / _STEPS, last


def _wider(x: Sequence[Ball], by: Sequence[Ball]) -> list[Ball]:
    """Balls wider by so much on each side."""
    return [a + arb(0, b) for a, b in zip(x, by, strict=True)]
