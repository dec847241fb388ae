"""A plan as expressions of t, and what every plan can be asked.

A plan is a set of expressions in variables of its own: here t, in a piecewise plan the time within a piece and the
coefficients of the piece. `domain` is where these variables live: a supremum along any plan is a search over it.

Every plan at once: all curves whose x* stays in a box P, whose u* stays in a box U, and whose defect is small.

Nothing else is known of such a plan, so a supremum along it is a supremum over P and U, and O(rho) is the set of all
states within rho of P. Sound for each member, because no constant contains x*' but in the defect, which is limited.
Implements: theory 4.7. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from tubecert.coordinates import Coordinates, Fields
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.domain import BoxDomain, Domain, Range
from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.objective import MetricNorm, Objective, SumOfNorms
from tubecert.enclosure.pencil import Pencil
from tubecert.enclosure.tape import Tape
from tubecert.expression import (
    ZERO,
    Expression,
    constant,
    derivatives,
    free_symbols,
    is_zero,
    substitute,
    symbol,
)
from tubecert.expression.matrix import Matrix, column, combine, identity, multiply
from tubecert.model import TIME, ControlAffineModel
from tubecert.spec import Knots

PIECE = "piece#"  # no state can have this name


@dataclass(frozen=True)
class Plan:
    """x*(t), shape (n,), and u*(t), shape (m,), as expressions of t over [0, horizon] in s.

    `horizon` None means for ever, which only a constant plan can do.
    """

    x: tuple[Expression, ...]
    u: tuple[Expression, ...]
    horizon: Fraction | None

    @cached_property
    def is_constant(self) -> bool:
        """Whether x* and u* do not depend on t."""
        return not free_symbols([*self.x, *self.u])

    @cached_property
    def time(self) -> dict[str, Range]:
        """The range of t, empty for a constant plan (where time does not matter)."""
        if self.is_constant:
            return {}
        if self.horizon is None:
            raise ValueError("a moving plan needs a horizon")
        return {TIME: (Fraction(0), self.horizon)}

    @cached_property
    def start(self) -> tuple[Expression, ...]:
        """x*(0), free of variables."""
        return tuple(substitute(self.x, {TIME: ZERO}))

    @cached_property
    def slope(self) -> tuple[Expression, ...]:
        """x*' in the variables of the plan."""
        return tuple(derivatives(self.x, TIME))

    @cached_property
    def domain(self) -> Domain:
        """Where the variables of the plan live."""
        return BoxDomain(self.time)

    @property
    def at_start(self) -> Plan:
        """A plan that stays at x*(0), without an input."""
        return Plan(tuple(self.start), tuple(ZERO for _ in self.u), None)

    @property
    def ranges(self) -> dict[str, Range]:
        """Variables of the plan that are independent of x* and of time."""
        return {}

    @property
    def clock(self) -> Expression:
        """The time t, in the variables of the plan."""
        return symbol(TIME)

    @property
    def allowance(self) -> Fraction | None:
        """What the defect is limited to, for plans that are not known; None where it follows from the plan."""
        return None

    def near(self, x: Interval, columns: Sequence[int], points: Array) -> Interval:
        """A point of the plan near to `points` (N, k), where x* (N, n) is enclosed; `columns` are its states."""
        del points
        return x[:, list(columns)]

    @property
    def fixed(self) -> frozenset[str]:
        """Variables that are data, known up to a rounding."""
        return frozenset()

    @property
    def defined(self) -> bool:
        """Whether the curve is known everywhere."""
        return True

    @property
    def knots(self) -> Knots | None:
        """The exact knots that the curve is given by, if it is."""
        return None

    @property
    def spans(self) -> Interval | None:
        """Windows of time, (K,), between which u* jumps; None if it does not."""
        return None

    def moment(self, at: Mapping[str, float]) -> float | None:
        """The time at a point of the domain; None if time does not matter there."""
        return at.get(TIME)

    @cached_property
    def _tapes(self) -> tuple[Tape, Tape]:
        both = [*self.x, *self.u]
        return Tape(both, (TIME,)), Tape(derivatives(both, TIME), (TIME,))

    def enclose(self, lo: Array, hi: Array, span: Array | None = None) -> tuple[Interval, Interval]:
        """x* (N, n) and u* (N, m) over windows [lo, hi] of time, each of shape (N,).

        With numbers of spans (N,), only what lies in that span: at a jump of u*, one side of it.
        """
        assert span is None
        values, slopes = self._tapes
        window = Interval(lo, hi)
        natural = values.run([window], lo.shape)
        middle = np.clip(0.5 * lo + 0.5 * hi, lo, hi)
        reach = np.nextafter(np.maximum(hi - middle, middle - lo), np.inf)
        steep = slopes.run([window], lo.shape) * Interval(-reach, reach)
        centred = (values.run([Interval.exact(middle)], lo.shape) + steep).sanitised()
        both = Interval(np.maximum(natural.lo, centred.lo).T, np.minimum(natural.hi, centred.hi).T)
        n = len(self.x)
        return both[:, :n], both[:, n:]

    def on(self, model: ControlAffineModel, rows: Matrix) -> Matrix:
        """A matrix of the model's expressions along the plan: expressions in the variables of the plan."""
        values = dict(zip((*model.states, *model.inputs), (*self.x, *self.u), strict=True))
        width, entries = len(rows[0]), [e for row in rows for e in row]
        if TIME in free_symbols(entries):
            values[TIME] = self.clock
        flat = substitute(entries, values)
        return tuple(tuple(flat[i : i + width]) for i in range(0, len(flat), width))

    def defect(self, model: ControlAffineModel) -> Matrix:
        """p = x*' - f(x*) - B(x*) u*, (n, 1); entries that are proven to vanish are the constant 0."""
        p = missing(self, model)
        return column([ZERO if is_zero(row[0]) is True else row[0] for row in p])


def missing(plan: Plan, model: ControlAffineModel) -> Matrix:
    """x*' - f(x*) - B(x*) u*, (n, 1)."""
    drift = combine(1, column(model.f), 1, multiply(model.B, column(inputs(model))))
    return combine(1, column(plan.slope), -1, plan.on(model, drift))


def inputs(model: ControlAffineModel) -> list[Expression]:
    """The input names as symbols, standing for u*."""
    return [symbol(name) for name in model.inputs]


def constant_plan(x: Sequence[Fraction], u: Sequence[Fraction], horizon: Fraction | None) -> Plan:
    """A plan that stays at a point."""
    return Plan(tuple(map(constant, x)), tuple(map(constant, u)), horizon)


Ranges = tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True)
class Family(Plan):
    """x*, shape (n,), anywhere in `P`, u*, shape (m,), anywhere in `U`, and |x*' - f(x*) - B(x*) u*| <= `limit`.

    `names` are those of states and inputs; x and u are variables of their own, see `starred`.
    """

    names: tuple[str, ...]
    P: Ranges
    U: Ranges
    limit: Fraction

    @cached_property
    def is_constant(self) -> bool:
        """Nothing depends on t."""
        return True

    @property
    def allowance(self) -> Fraction:
        """The limit of the defect."""
        return self.limit

    @cached_property
    def start(self) -> tuple[Expression, ...]:
        """No start of its own; raises `ValueError`."""
        raise ValueError("a family of plans has no start of its own")

    @property
    def at_start(self) -> Plan:
        """Plans of the family start anywhere in P."""
        return self

    @cached_property
    def slope(self) -> tuple[Expression, ...]:
        """Not known; raises `ValueError`."""
        raise ValueError("the slopes of a family of plans are not known")

    @cached_property
    def domain(self) -> Domain:
        """P and U."""
        return BoxDomain(self._ranges)

    @cached_property
    def ranges(self) -> dict[str, Range]:
        """U by variable: u* is free of x* and of time."""
        inputs = [starred(name) for name in self.names[len(self.x) :]]
        return {name: self._ranges[name] for name in inputs}

    @cached_property
    def _ranges(self) -> dict[str, Range]:
        return dict(zip(map(starred, self.names), (*self.P, *self.U), strict=True))

    def enclose(self, lo: Array, hi: Array, span: Array | None = None) -> tuple[Interval, Interval]:
        """P (N, n) and U (N, m), whatever the windows [lo, hi] of time, each of shape (N,)."""
        del hi, span
        sides = np.array([(fraction_bounds(a)[0], fraction_bounds(b)[1]) for a, b in (*self.P, *self.U)]).T
        both = Interval(*(np.repeat(side[None], len(lo), axis=0) for side in sides))
        return both[:, : len(self.x)], both[:, len(self.x) :]

    def near(self, x: Interval, columns: Sequence[int], points: Array) -> Interval:
        """The nearest point of P, shape of `points`; where no float lies in a range of P, that range."""
        inner = np.array([(fraction_bounds(a)[1], fraction_bounds(b)[0]) for a, b in self.P])[list(columns)]
        low, high = inner[:, 0], inner[:, 1]
        moved, whole = np.clip(points, low, high), x[:, list(columns)]
        return Interval(np.where(low <= high, moved, whole.lo), np.where(low <= high, moved, whole.hi))

    def defect(self, model: ControlAffineModel) -> Matrix:
        """Not known; raises `ValueError`."""
        raise ValueError("the defects of a family of plans are not known")


def starred(name: str) -> str:
    """The variable for a state or an input on the plan; no name has a star."""
    return f"{name}*"


def family(
    states: Sequence[str],
    inputs: Sequence[str],
    boxes: tuple[Ranges, Ranges],
    limit: Fraction,
    horizon: Fraction | None,
) -> Family:
    """The plans in the boxes (P, U) over [0, horizon], or for ever."""
    P, U = boxes
    x, u = (
        tuple(
            constant(low) if low == high else symbol(starred(name))
            for name, (low, high) in zip(names, box, strict=True)
        )
        for names, box in ((states, P), (inputs, U))
    )
    return Family(x, u, horizon, (*states, *inputs), P, U, limit)


Search = Callable[[str, Objective, Domain, Effort], Supremum]
_NEGLIGIBLE = 1e-6


def plain_search(name: str, objective: Objective, domain: Domain, effort: Effort) -> Supremum:
    """The supremum, without any report of progress."""
    del name
    return supremum(objective, domain, effort)


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """The defect p of a plan, (n, 1), to be bounded for a tube of radius `rho`, both in z = S x where there
    are `coordinates` S.

    It matters against rate times rho: what is a millionth of that is not refined further.
    """

    p: Matrix
    plan: Plan
    model: ControlAffineModel
    rho: float
    effort: Effort
    search: Search = plain_search
    coordinates: Coordinates | None = None

    @classmethod
    def of(
        cls,
        plan: Plan,
        model: ControlAffineModel,
        rho: float,
        effort: Effort,
        coordinates: Coordinates | None = None,
    ) -> Defect:
        """The defect of a plan."""
        p = Fields(model, coordinates).of_vector(plan.defect(model))
        return cls(p=p, plan=plan, model=model, rho=rho, effort=effort, coordinates=coordinates)

    @property
    def vanishes(self) -> bool:
        """Whether the plan satisfies the dynamics exactly."""
        return all(row[0] is ZERO for row in self.p)

    @property
    def domain(self) -> Domain:
        """Where the plan's variables live; of a plan that stays, its times, or all of f, where f depends on them."""
        if not self.plan.is_constant or self.model.time is None:
            return self.plan.domain
        horizon = self.plan.horizon
        return BoxDomain({TIME: self.model.time if horizon is None else (Fraction(0), horizon)})

    def in_state(self) -> Supremum:
        """delta_p."""
        small = replace(self.effort, absolute=self._negligible)
        return self.search("plan_defect", SumOfNorms([self.p], self.plan.fixed), self.domain, small)

    def in_metric(self) -> Supremum:
        """Delta; negligible is what is negligible for |p|, in the units of the metric."""
        W = self.plan.on(self.model, Fields(self.model, self.coordinates).W)
        fixed, domain = self.plan.fixed, self.domain
        name, eye = "plan_defect_metric", identity(len(self.p))
        stretch = self.search(name, Pencil(eye, W, fixed=fixed), domain, self.effort)
        absolute = self._negligible * float(np.sqrt(max(stretch.below, 0.0)))
        return self.search(
            name, MetricNorm(self.p, W, fixed), domain, replace(self.effort, absolute=absolute)
        )

    @property
    def _negligible(self) -> float:
        return _NEGLIGIBLE * float(self.model.rate) * self.rho
