"""Where a plan is and how fast it moves: windows of its time that cover it, or cells that cover a family's boxes.

Beside that: how far its input is from what the actuators hold, and how far it is from a motion of the plant.
Implements: theory of the sampled loop, section 1.
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

from flint import arb

from tubecert.recheck.balls import Ball, between, ceiling, exact, floor
from tubecert.recheck.boxes import Field
from tubecert.recheck.curve import CLOCK, Curve, Knots
from tubecert.recheck.identity import vanish
from tubecert.recheck.plans import Plan
from tubecert.recheck.program import Program
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.numbers import upright
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Planned, Resting, Tabled
from tubecert.recheck.system import curve_of, knots_of
from tubecert.recheck.terms import Matrix, Term, names, plus, replaced, slopes, times, variable
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

    @property
    def goes_on(self) -> bool:
        """Whether a plan that is repeated is one of formulas, of a period that is no longer, or begins as it ends."""
        plan, knots, sample = self.spec.trajectory, self.knots, self.spec.hardware.sample_time
        if self.spec.afterwards != "repeat" or isinstance(plan, (Resting, AnyPlan)):
            return True
        if isinstance(plan, Expressed):
            return bool(common_period([*plan.x, *plan.u]).ball <= exact(plan.horizon))
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
            pieces = ceil(count * float(part.length.mid()) / whole) if curve.moves and whole else 1
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
