"""Where a plan is and how fast it moves: windows of its time that cover it, or cells that cover a family's boxes.

Beside that: how far its input is from what the actuators hold, and how far it is from a motion of the plant.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, product
from math import ceil

from flint import arb

from tubecert.recheck.balls import Ball, between, ceiling, exact, floor
from tubecert.recheck.boxes import Field
from tubecert.recheck.curve import CLOCK, Curve, Knots, Part, expressed, hermite
from tubecert.recheck.family import everyone
from tubecert.recheck.identity import vanish
from tubecert.recheck.plans import Plan
from tubecert.recheck.program import Program
from tubecert.recheck.reading import TIME, upright
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Resting
from tubecert.recheck.system import knots_of
from tubecert.recheck.terms import Term, matrix_replaced, names, number, plus, slopes, times, variable
from tubecert.recheck.times import common_period

_REFINED = 20  # times as many evaluations as windows, for a defect
_SHARP = 1.005  # a supremum is not looked for more closely than that,
_MEANS_NOTHING = 1e-10  # ... nor than this, in units of the states per s
_PARTS = 128  # of a period of h


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
    def intervals(self) -> int | None:
        """Sample intervals up to there."""
        return None if self.horizon is None else ceil(self.horizon / self.spec.hardware.sample_time)

    @property
    def smooth(self) -> bool:
        """Whether u* has a rate."""
        if self.family is not None:
            return self.family.input_rate is not None
        return self.knots is None or not self.knots.held

    def lasts(self) -> str:
        """Why the plan does not go on as it is said to; empty if it does."""
        horizon = self.spec.trajectory.horizon
        if self.spec.afterwards != "repeat" or horizon is None:
            return ""
        if (knots := self.knots) is not None:
            joined = knots.x[0] == knots.x[-1] and knots.u[0] == knots.u[-1]
            whole = (horizon / self.spec.hardware.sample_time).denominator == 1 and knots.t[-1] == horizon
            return "" if joined and whole else "its ends differ, or its horizon is no whole number of samples"
        if not isinstance(plan := self.spec.trajectory, Expressed):
            return ""
        period = common_period([*plan.x, *plan.u]).ball
        return "" if period <= exact(horizon) else "its period is longer than its horizon"

    # -- windows

    def windows(self, count: int) -> list[Window]:
        """About so many windows, or cells, that cover it."""
        found = list(self._cells(count) if self.family is not None else self._along(count))
        if self.spec.afterwards == "rest":  # where it is then, without moving
            x, u = self._end
            found.append(Window(x, u, [arb(0)] * len(x), [arb(0)] * len(u), None))
        return found

    @property
    def _end(self) -> tuple[list[Ball], list[Ball]]:
        """x* and u* at the end, of inputs that jump there those before."""
        part = self.curve.parts[-1]
        field = self.curve.field.with_values(part.values)
        found = field.at([part.length] if field.variables else [])
        return found[: len(self.curve.x)], found[len(self.curve.x) :]

    def _along(self, count: int) -> Iterator[Window]:
        curve, n, m = self.curve, len(self.curve.x), len(self.curve.u)
        whole = sum((float(part.length.mid()) for part in curve.parts), start=0.0)
        field = Field([*curve.x, *curve.u, *curve.slope, *slopes(curve.u, CLOCK)], curve.parts[0].values)
        timed = self.horizon is not None and curve.moves
        for part in curve.parts:
            pieces = ceil(count * float(part.length.mid()) / whole) if curve.moves and whole else 1
            own = field.with_values(part.values)
            for lo, hi in _equal(ceiling(part.length), pieces):
                found = own.hull([(lo, hi)] if own.variables else [])
                time = part.start + between(lo, hi) if timed else None
                yield Window(found[:n], found[n : n + m], found[n + m : 2 * n + m], found[2 * n + m :], time)

    def _cells(self, count: int) -> Iterator[Window]:
        """A grid in what the derivatives of F depend on; x*' is F(x*, u*) within the defect."""
        family, plant = self.family, self.spec.plant
        assert family is not None
        named = [*plant.states, *plant.inputs]
        ends = {**family.x, **family.u}
        F = [row[0] for row in field_of(self.spec)]
        bent = names(slope for name in named for slope in slopes(F, name))
        split = [name for name in named if name in bent and ends[name][0] < ends[name][1]]
        parts = max(1, int(count ** (1 / len(split)) + 1e-9)) if split else 1
        grid = [
            [(a + (b - a) * k / parts, a + (b - a) * (k + 1) / parts) for k in range(parts)]
            if name in split
            else [(a, b)]
            for name in named
            for a, b in [ends[name]]
        ]
        known = Field(F)
        reach = exact(family.defect)
        rates = [arb(0, exact(rate)) for rate in family.input_rate or ()]
        for sides in product(*grid):
            balls = [between(exact(a), exact(b)) for a, b in sides]
            values = dict(zip(named, balls, strict=True))
            own = known.hull([(floor(values[v]), ceiling(values[v])) for v in known.variables])
            speed = [x + arb(0, reach) for x in own]
            yield Window(balls[: len(plant.states)], balls[len(plant.states) :], speed, rates, None)

    # -- how the plan's input is held, and how far the plan is from a motion

    def held(self, windows: Sequence[Window]) -> list[Ball]:
        """sup |u*_j - ubar_j| while a command acts, (m,), without rounding."""
        machine, m = self.spec.hardware, len(self.spec.plant.inputs)
        if machine.hold == "continuous":
            return [arb(0)] * m
        span = machine.sample_time if machine.hold == "left" else machine.sample_time / 2
        if self.knots is not None and self.knots.held:
            return [exact(self._jumps(j, span)) for j in range(m)]
        if self.family is not None and self.family.input_rate is None:
            return [arb(0)] * m
        return [exact(span) * most(own.steepness[j] for own in windows) for j in range(m)]

    def _jumps(self, j: int, span: Fraction) -> Fraction:
        """The most that u*_j, held between knots, jumps within a time; 0 if only where commands begin to act.

        At the left end of an interval the computer's time may be that of the interval before.
        """
        assert self.knots is not None
        t, machine = self.knots.t, self.spec.hardware
        horizon = self.spec.trajectory.horizon
        values = [row[j] for row in self.knots.u[:-1]]
        jumps = [(at, abs(b - a)) for at, a, b in zip(t[1:-1], values, values[1:], strict=False)]
        if self.spec.afterwards == "repeat" and horizon is not None:
            jumps.append((t[-1], abs(values[0] - values[-1])))
            jumps += [(at + horizon, size) for at, size in jumps]
        jumps = [(at, size) for at, size in jumps if size]
        rest = machine.delay % machine.sample_time
        aligned = all(((at - rest) / machine.sample_time).denominator == 1 for at, _ in jumps)
        if machine.hold == "middle" and aligned:
            return Fraction(0)
        reach = span * Fraction(1001, 1000)
        return max(
            (
                sum((s for at, s in jumps if begin <= at <= begin + reach), start=Fraction(0))
                for begin, _ in jumps
            ),
            default=Fraction(0),
        )

    def defect(self, count: int) -> list[Ball]:
        """sup |x*_i' - F_i(x*, u*, p0)|, (n,), and |F_i| where the plan rests."""
        n = len(self.spec.plant.states)
        if self.family is not None:
            return [exact(self.family.defect)] * n
        names_ = (*self.spec.plant.states, *self.spec.plant.inputs)
        along = dict(zip(names_, (*self.curve.x, *self.curve.u), strict=True))
        F = [row[0] for row in matrix_replaced(field_of(self.spec), along)]
        missed = [f - slope for f, slope in zip(F, self.curve.slope, strict=True)]
        left = [i for i, e in enumerate(missed) if self.knots is not None or not vanish([e])]
        found = [arb(0)] * n
        if left:
            for i, top in zip(left, self._supremum([missed[i] for i in left], count), strict=True):
                found[i] = top
        if self.spec.afterwards == "rest":
            x, u = self._end
            resting = Program([row[0] for row in field_of(self.spec)], names_).run([*x, *u])
            found = [x.max(y.abs_upper()) for x, y in zip(found, resting, strict=True)]
        return found

    def _supremum(self, terms: Sequence[Term], count: int) -> list[Ball]:
        """sup |term| along the plan, each: windows are halved where that may make it smaller."""
        whole = Field(terms, self.curve.parts[0].values)
        parts, done = self.curve.parts, [arb(0)] * len(terms)
        each = max(1, count // len(parts))
        waiting = [(part, *ends) for part in parts for ends in _equal(ceiling(part.length), each)]
        least, left = [0.0] * len(terms), _REFINED * len(waiting)
        while waiting:
            tops: list[list[Ball]] = []
            for part, lo, hi in waiting:
                own = whole.with_values(part.values)
                tops.append([x.abs_upper() for x in own.hull([(lo, hi)] if own.variables else [])])
                middle = own.at([arb(0.5 * lo + 0.5 * hi)] if own.variables else [])
                least = [max(a, float(x.abs_lower())) for a, x in zip(least, middle, strict=True)]
            left -= len(waiting)
            enough = [_SHARP * a + _MEANS_NOTHING for a in least]
            later: list[tuple[Part, float, float]] = []
            for (part, lo, hi), top in zip(waiting, tops, strict=True):
                at = 0.5 * lo + 0.5 * hi
                if left <= 0 or not lo < at < hi or all(x <= e for x, e in zip(top, enough, strict=True)):
                    done = [a.max(x) for a, x in zip(done, top, strict=True)]
                else:
                    later += [(part, lo, at), (part, at, hi)]
            waiting = later
        return done


def most(values: Iterator[Ball] | Sequence[Ball]) -> Ball:
    """The largest magnitude; what is not a number stays so."""
    found = arb(0)
    for x in values:
        found = found.max(x.abs_upper())
    return found


def _equal(length: float, pieces: int) -> Iterator[tuple[float, float]]:
    """[0, length] in pieces."""
    ends = [length * k / pieces for k in range(pieces)] + [length]
    return pairwise(ends)


def field_of(spec: SampledSpecification) -> list[list[Term]]:
    """F(x, u, p0) = f + B u of the middles of parameters, (n, 1)."""
    return plus(upright(spec.plant.f), times(spec.plant.B, [[variable(name)] for name in spec.plant.inputs]))


def course_of(spec: SampledSpecification, plan: Plan) -> Course:
    """The plan of a specification; `plan` holds the knots of one that was planned. Raises `CertificateError`."""
    trajectory, plant = spec.trajectory, spec.plant
    if isinstance(trajectory, AnyPlan):
        return Course(spec, everyone(trajectory, plant.states, plant.inputs), None)
    if isinstance(trajectory, Resting):
        at, input_ = ([number(q) for q in own] for own in (trajectory.at, trajectory.input))
        return Course(spec, expressed(at, input_, TIME, trajectory.horizon), None)
    if isinstance(trajectory, Expressed):
        return Course(spec, expressed(trajectory.x, trajectory.u, TIME, trajectory.horizon), None)
    knots = knots_of(plan, trajectory.between, trajectory.horizon)
    drift = [row[0] for row in field_of(spec)]
    curve = hermite(knots, drift, plant.states, plant.inputs, trajectory.horizon)
    return Course(spec, curve, knots)


def times_of(course: Course) -> list[Ball]:
    """Parts of the times at which h may be met where the plan's own time is not that of h: a period, or all of it."""
    given = course.spec.uncertainty
    terms = given.h or ()
    if TIME not in names(terms):
        return [arb(0)]
    length = exact(course.horizon) if course.horizon is not None else common_period(terms).ball
    return [length * between(arb(k) / _PARTS, arb(k + 1) / _PARTS) for k in range(_PARTS)]
