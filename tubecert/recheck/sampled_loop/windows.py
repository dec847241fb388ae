"""Where a plan is and how fast it moves: windows of its time that cover it, or cells that cover a family's boxes.

Beside that: how far its input is from what the actuators hold, and how far it is from a motion of the plant.
Implements: theory of the sampled loop, section 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from heapq import heapify, heappush, heapreplace
from itertools import islice, pairwise, product
from math import ceil

from flint import arb

from tubecert.recheck.balls import Ball, between, ceiling, exact, floor
from tubecert.recheck.boxes import Field
from tubecert.recheck.curve import CLOCK, Curve, Knots, expressed, hermite
from tubecert.recheck.family import everyone
from tubecert.recheck.identity import vanish
from tubecert.recheck.plans import Plan
from tubecert.recheck.program import Program
from tubecert.recheck.reading import TIME, upright
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Resting
from tubecert.recheck.system import knots_of
from tubecert.recheck.terms import (
    Matrix,
    Term,
    names,
    number,
    plus,
    replaced,
    slopes,
    times,
    variable,
)
from tubecert.recheck.times import common_period

_HALVINGS = 500  # for one supremum along a plan


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
        if self.family is not None:
            return list(self._cells(self.family, count))
        found = list(self._along(count))
        if self.spec.afterwards == "rest":  # where it is then, without moving
            (x, u), n = self._end, len(self.curve.x)
            still = [arb(0)] * (n + len(u))
            found.append(Window(x, u, still[:n], still[n:], None))
        return found

    @property
    def _end(self) -> tuple[list[Ball], list[Ball]]:
        """x* and u* at the end, of inputs that jump there those before."""
        last, n = self.curve.parts[-1], len(self.curve.x)
        field = self.curve.field.with_values(last.values)
        found = field.at([last.length] if field.variables else [])
        return found[:n], found[n:]

    @cached_property
    def F(self) -> list[Term]:
        """The plant for the middles of parameters, f + B u, (n,)."""
        return driven(self.spec.plant.f, self.spec.plant.B, self.spec.plant.inputs)

    @property
    def names(self) -> tuple[str, ...]:
        """Of states and inputs."""
        return (*self.spec.plant.states, *self.spec.plant.inputs)

    def _along(self, count: int) -> Iterator[Window]:
        curve, n, m = self.curve, len(self.curve.x), len(self.curve.u)
        terms = [*curve.x, *curve.u, *curve.slope, *slopes(curve.u, CLOCK)]
        field = Field(terms, curve.parts[0].values)
        whole = sum((float(part.length.mid()) for part in curve.parts), start=0.0)
        timed = self.horizon is not None and curve.moves
        for part in curve.parts:
            pieces = ceil(count * float(part.length.mid()) / whole) if curve.moves and whole else 1
            own, length = field.with_values(part.values), ceiling(part.length)
            for lo, hi in pairwise([*(length * k / pieces for k in range(pieces)), length]):
                found = iter(own.hull([(lo, hi)] if own.variables else []))
                time = part.start + between(lo, hi) if timed else None
                x, u, speed, steepness = (list(islice(found, size)) for size in (n, m, n, m))
                yield Window(x, u, speed, steepness, time)

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

    # -- how far the plan is from a motion, and how its input is held

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
        parts = self.curve.parts
        whole = Field([term], parts[0].values)

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

    def held(self, windows: Sequence[Window]) -> list[Ball]:
        """sup |u*_j - ubar_j| while a command acts, (m,), without rounding."""
        machine, m = self.spec.hardware, len(self.spec.plant.inputs)
        span = machine.sample_time if machine.hold == "left" else machine.sample_time / 2
        if machine.hold == "continuous" or (self.family is not None and not self.smooth):
            return [arb(0)] * m
        if self.knots is not None and self.knots.held:
            return [exact(self._jumps(j, span, self.knots)) for j in range(m)]
        return [exact(span) * rate for rate in tops(own.steepness for own in windows)]

    def _jumps(self, j: int, span: Fraction, knots: Knots) -> Fraction:
        """The most that u*_j, held between knots, jumps within a time; 0 if only where commands begin to act.

        At the left end of an interval the computer's time may be that of the interval before.
        """
        t, machine, values = knots.t, self.spec.hardware, [row[j] for row in knots.u[:-1]]
        jumps = [(at, abs(b - a)) for at, (a, b) in zip(t[1:-1], pairwise(values), strict=True)]
        if self.spec.afterwards == "repeat":
            jumps.append((t[-1], abs(values[0] - values[-1])))
            jumps += [(at + t[-1], size) for at, size in jumps]
        jumps = [(at, size) for at, size in jumps if size]
        rest = machine.delay % machine.sample_time
        if machine.hold == "middle" and all(
            ((at - rest) / machine.sample_time).denominator == 1 for at, _ in jumps
        ):
            return Fraction(0)
        reach = span * Fraction(1001, 1000)
        nearby = ([size for at, size in jumps if begin <= at <= begin + reach] for begin, _ in jumps)
        return max((sum(own, start=Fraction(0)) for own in nearby), default=Fraction(0))


def tops(rows: Iterable[Sequence[Ball]]) -> list[Ball]:
    """The largest magnitudes, column by column; what is not a number stays so."""
    return [reduce(arb.max, (x.abs_upper() for x in own)) for own in zip(*rows, strict=True)]


def driven(drift: Sequence[Term], gains: Matrix, inputs: Sequence[str]) -> list[Term]:
    """f + B u, (n,)."""
    return [row[0] for row in plus(upright(drift), times(gains, [[variable(name)] for name in inputs]))]


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
    drift = driven(plant.f, plant.B, plant.inputs)
    curve = hermite(knots, drift, plant.states, plant.inputs, trajectory.horizon)
    return Course(spec, curve, knots)
