"""A specification and the matrices of an error equation -> the loop that the theorem is about.

Everything is exact: times are rational, matrices are floats that anybody may propose. Trusted: yes.
Implements: theory of the sampled loop, section 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import Range
from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.outward import number_above
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression, constant, free_symbols, symbol
from tubecert.expression.matrix import column, combine, multiply
from tubecert.model import ControlAffineModel, moving_parts, time_period
from tubecert.sampled_loop.matrices import lengths, nothing, total
from tubecert.sampled_loop.record import HexMatrix, Nominal, Tables
from tubecert.spec import Spec
from tubecert.spec.types import Afterwards, Hardware, Hold, Knots, Vector
from tubecert.trajectory.plan import Family, Plan

ROUNDING: Final = {"single": 2.0**-24, "double": 2.0**-53}
_DEFECT: Final = Effort(gap=0.05, absolute=1e-9, budget=20_000)
PLAN_ROUNDING: Final = 2.0**-24
"""The controller's x* and u* are off by at most this of their largest size along the plan."""


@dataclass(frozen=True, slots=True, eq=False)
class Size:
    """What bounds a signal: every component, shape (k,), or its length (then each entry of `each` is the length)."""

    each: Array
    length: bool

    @classmethod
    def of(cls, bound: Fraction | Vector, components: int) -> Size:
        """A number bounds the length, a list the components."""
        if isinstance(bound, tuple):
            return cls(np.array([fraction_bounds(each)[1] for each in bound]), length=False)
        return cls(np.full(components, fraction_bounds(bound)[1]), length=components > 1)

    @property
    def weights(self) -> Array:
        """Of the components (k,), or of the length alone (1,)."""
        return self.each[:1] if self.length else self.each

    def weigh(self, columns: Array) -> Array:
        """What rows (.., k) of numbers that are not negative do to the signal: (..,), from above."""
        return total(lengths(columns) if self.length else columns, self.weights)


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """x(0) - x*(0): a known vector (n,) and what may be added to it, within a box (n,) or a length."""

    known: Interval
    box: Array
    length: float

    @property
    def reach(self) -> Array:
        """sup |x_i(0) - x*_i(0)|, (n,)."""
        return np.asarray((self.known.magnitude[:, 0] + self.box + self.length) * (1 + 1e-15))


@dataclass(frozen=True, eq=False, kw_only=True)
class Loop:
    """The sampled loop about its plan; A (n, n), B (n, m), E (n, k) are any floats.

    `slow`: what unknown parameters do along the plan is a component of eta, else it is sudden.
    """

    spec: Spec
    model: ControlAffineModel
    plan: Plan
    knots: Knots | None
    A: Array
    B: Array
    E: Array
    slow: bool

    def nominal(self) -> Nominal:
        """A, B and E as they are written."""
        return Nominal(**{name: HexMatrix(getattr(self, name)) for name in "ABE"})

    # sizes

    @property
    def states(self) -> int:
        """n."""
        return len(self.model.states)

    @property
    def inputs(self) -> int:
        """m."""
        return len(self.model.inputs)

    @property
    def names(self) -> tuple[str, ...]:
        """States, then inputs."""
        return *self.model.states, *self.model.inputs

    # the machine

    @property
    def hardware(self) -> Hardware:
        """The computer and the sensors."""
        assert self.spec.hardware is not None
        return self.spec.hardware

    @property
    def sample_time(self) -> Fraction:
        """Ts in s."""
        return self.hardware.sample_time

    @property
    def whole(self) -> int:
        """q: whole samples of the delay."""
        return int(self.hardware.delayed // self.sample_time)

    @property
    def rest(self) -> Fraction:
        """tau': the rest of the delay, in [0, Ts)."""
        return self.hardware.delayed - self.whole * self.sample_time

    @property
    def hold(self) -> Hold:
        """What the plan's input is while a command acts."""
        return self.hardware.hold

    @property
    def noise(self) -> Size:
        """Of the measured states."""
        return Size.of(self.hardware.noise, self.states)

    # what pushes

    @cached_property
    def gusts(self) -> Size:
        """Of the disturbance w, (k,)."""
        wind = self.spec.disturbance
        return Size(np.zeros(0), length=False) if wind is None else Size.of(wind.bound, self.E.shape[1])

    @property
    def sways(self) -> bool:
        """Whether the disturbance has a rate: then it is a component of eta."""
        return self.spec.disturbance is not None and self.spec.disturbance.rate is not None

    @cached_property
    def matched(self) -> tuple[int, ...]:
        """The inputs beside which an h acts that is not identically 0."""
        h = self.model.h
        return tuple(j for j in range(self.inputs) if h is None or h[j] != constant(0))

    @cached_property
    def declared(self) -> Array:
        """Bounds of |h|, of its slope and of its rate, of an h that is not given otherwise, (3,)."""
        bounds = self.spec.uncertainty.bounds
        given = (None,) * 3 if bounds is None else (bounds.h, bounds.h_x, bounds.h_t)
        return np.array([np.inf if each is None else fraction_bounds(each)[1] for each in given])

    @property
    def jumps(self) -> bool:
        """Whether nothing bounds how fast h changes: it is sudden, as a wind through the columns of B."""
        return self.model.h is None and not np.isfinite(self.declared[1:]).all()

    @cached_property
    def unknown(self) -> tuple[int, ...]:
        """The rows of F in which a parameter stands that is not known."""
        names = {name for name, _ in self.model.parameters}
        rows = zip(self.drift, self.gained, strict=True)
        return tuple(i for i, (f, row) in enumerate(rows) if names & set(free_symbols([f, *row])))

    @property
    def drift(self) -> tuple[Expression, ...]:
        """f(x, p), (n,)."""
        return self.model.drift or self.model.f

    @property
    def gained(self) -> tuple[tuple[Expression, ...], ...]:
        """B(x, p), (n, m)."""
        return tuple(map(tuple, self.model.gained or self.model.B))

    @cached_property
    def field(self) -> tuple[Expression, ...]:
        """F(x, u, p) = f(x, p) + B(x, p) u, (n,)."""
        return driven(self.drift, self.gained, self.model.inputs)

    @cached_property
    def H(self) -> Array:
        """How eta enters, (n, r): h by columns of B, a disturbance with a rate by those of E, parameters by rows."""
        own = self.B[:, [] if self.jumps else list(self.matched)]
        swaying = self.E if self.sways else self.E[:, :0]
        rows = self.unknown if self.slow else ()
        return np.hstack([own, swaying, np.eye(self.states)[:, list(rows)]])

    @property
    def R(self) -> Array:
        """How rho enters, (n, n + m): as it is, and by columns of B."""
        return np.hstack([np.eye(self.states), self.B])

    @cached_property
    def sudden(self) -> tuple[tuple[Array, Size], ...]:
        """Blocks of what may jump at any time: columns (n, k) and its size."""
        blocks = []
        if self.gusts.each.size and not self.sways:
            blocks.append((self.E, self.gusts))
        if self.jumps and self.matched:
            blocks.append((self.B, Size(np.full(self.inputs, self.declared[0]), length=self.inputs > 1)))
        return tuple(blocks)

    # the plan in time

    @cached_property
    def horizon(self) -> Fraction | None:
        """Until when the claim is, in s; None: for ever."""
        end = self.plan.horizon
        return None if end is None or self.afterwards != "nothing" else end

    @property
    def afterwards(self) -> Afterwards:
        """What holds after the end of a finite plan."""
        return self.spec.trajectory.afterwards

    @cached_property
    def samples(self) -> int | None:
        """Intervals up to the horizon, None for ever."""
        return None if self.horizon is None else ceil(self.horizon / self.sample_time)

    @cached_property
    def times(self) -> Range | None:
        """The times that matter for h and the plan; None where nothing depends on t.

        Raises `ValueError` for an h that depends on t for ever without a period.
        """
        period = time_period(moving_parts(self.spec))
        if self.horizon is not None:
            return Fraction(0), self.horizon
        if period is None:
            raise ValueError("h depends on t without a horizon or a period")
        end = max(0.0 if self.plan.horizon is None else float(self.plan.horizon), float(period.hi))
        return (0.0, number_above(end)) if end else None

    @cached_property
    def defect(self) -> Array:
        """sup |x*_i' - F_i(x*, u*, p0)| while the plan moves, (n,)."""
        if isinstance(self.plan, Family):
            return np.full(self.states, fraction_bounds(self.plan.limit)[1])
        found = np.zeros(self.states)
        for i, (e,) in enumerate(self.plan.defect(self.model)):
            if e is not ZERO:
                found[i] = supremum(SumOfNorms([((e,),)], self.plan.fixed), self.plan.domain, _DEFECT).above
        return found

    @cached_property
    def start(self) -> Start:
        """x(0) - x*(0)."""
        n, spec = self.states, self.spec
        if spec.within is not None:
            return Start(nothing(n, 1), np.zeros(n), fraction_bounds(spec.within)[1])
        planned = Tape(self.plan.start, ()).run([], ())
        ends = spec.start_box or tuple((x, x) for x in spec.x0)
        bounds = np.array([(*fraction_bounds((a + b) / 2), fraction_bounds((b - a) / 2)[1]) for a, b in ends])
        middle, box = Interval(bounds[:, 0], bounds[:, 1]), bounds[:, 2]
        return Start((middle - planned).sanitised()[:, None], box, 0.0)


def driven(
    f: Sequence[Expression], B: Sequence[Sequence[Expression]], inputs: Sequence[str]
) -> tuple[Expression, ...]:
    """f + B u, (n,)."""
    u = column([symbol(name) for name in inputs])
    return tuple(row[0] for row in combine(1, column(f), 1, multiply(B, u)))


@dataclass(frozen=True, slots=True, eq=False)
class Controller:
    """The tables as arrays: F (z, z), G (z, n), M (m, z), N (m, n)."""

    F: Array
    G: Array
    M: Array
    N: Array

    @classmethod
    def of(cls, tables: Tables) -> Controller:
        """The tables of a record."""
        return cls(tables.F.value, tables.G.value, tables.M.value, tables.N.value)

    def record(self) -> Tables:
        """The same as they are written."""
        return Tables(**{name: HexMatrix(getattr(self, name)) for name in "FGMN"})

    @property
    def size(self) -> int:
        """z, the entries of its state."""
        return len(self.F)

    def fits(self, loop: Loop) -> bool:
        """Whether the shapes agree and every entry is a number of single precision."""
        z, n, m = self.size, loop.states, loop.inputs
        tables, shapes = (self.F, self.G, self.M, self.N), ((z, z), (z, n), (m, z), (m, n))
        with np.errstate(all="ignore"):
            single = all(bool((own.astype(np.float32).astype(float) == own).all()) for own in tables)
        return single and tuple(own.shape for own in tables) == shapes
