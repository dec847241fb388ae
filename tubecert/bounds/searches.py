"""Searches over a tube and along its plan: how hard to try, who is told, where a supremum was found. Trusted: yes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Self

import numpy as np

from tubecert.bounds.constants import Constant, Witness
from tubecert.coordinates import Coordinates, Fields
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.domain import Domain, Range
from tubecert.enclosure.interval import Array, Interval, fraction_bounds, sqrt
from tubecert.enclosure.objective import Kinks, Lipschitz, Objective, SumOfNorms, size_of
from tubecert.expression import (
    ZERO,
    Expression,
    constant,
    derivatives,
    rebuild,
    substitute,
    symbol,
    topological,
)
from tubecert.expression import sqrt as sqrt_of
from tubecert.expression.matrix import Matrix, column, jacobian
from tubecert.model import TIME, ControlAffineModel
from tubecert.progress import Progress
from tubecert.trajectory import Plan
from tubecert.trajectory.plan import starred
from tubecert.tube import Ball, Ellipsoid, Section, Tube

_CHEAP = 1_000  # boxes with which a constant that has a gap of its own is enclosed closer than that
_WORTH = 30_000  # boxes after which such a constant stays as it is;
_DIGITS = 10  # of what the tube reaches: to these a place is told
_MANY = 8  # of more states than that each box takes longer, and fewer are worth it
Spent = Callable[[str, int], None]


@dataclass(frozen=True)
class Searches:
    """What is searched: a model over the tube of radius `rho` around a plan, with an effort.

    With `coordinates` S, the constants are those of the fields in z = S x, and the tube is the ellipsoid |S (x - x*)|
    <= rho cut to `sides` (n,), what |x_i - x*_i| is at most; without, they are those in x and the tube is a ball.
    `time` is the range of t for h (the horizon, or one period of h); the plan brings its own. `gaps`: the relative gaps
    of constants, by name, that are not enclosed to the gap of the effort. `spent` is told what work each search was.
    """

    model: ControlAffineModel
    plan: Plan
    rho: float
    time: Range | None
    effort: Effort
    report: Progress | None = None
    coordinates: Coordinates | None = None
    sides: tuple[float, ...] | None = None
    gaps: Mapping[str, float] = field(default_factory=dict)
    spent: Spent | None = None

    def effort_for(self, name: str) -> Effort:
        """How hard to try for a constant; one with a gap of its own is as close as few boxes make it."""
        gap, own = self.gaps.get(name), self.effort
        if gap is None:
            return own
        states = len(self.model.states)
        worth = _WORTH if states <= _MANY else int(_WORTH * (_MANY / states) ** 6)
        return replace(own, gap=gap, cheap=min(own.cheap, _CHEAP), budget=min(own.budget, worth))

    def with_radius(self, rho: Fraction, sides: Sequence[Fraction] | None = None) -> Self:
        """The same over another tube."""
        ends = None if sides is None else tuple(fraction_bounds(side)[1] for side in sides)
        return replace(self, rho=fraction_bounds(rho)[1], sides=ends)

    @cached_property
    def fields(self) -> Fields:
        """The fields of the model in the coordinates of the tube."""
        return Fields(self.model, self.coordinates)

    @property
    def section(self) -> Section:
        """The tube at one time."""
        if self.coordinates is None:
            return Ball(self.rho)
        return Ellipsoid(self.coordinates, self.rho, self.sides or (np.inf,) * len(self.model.states))

    @property
    def reach(self) -> Array:
        """How far the states can be from the plan's where half-widths are left out, nearly, (n,)."""
        if self.coordinates is None:
            return np.full(len(self.model.states), self.rho)
        return self.rho * np.sqrt([float(row[i]) for i, row in enumerate(self.coordinates.spread)])

    def over_tube(
        self,
        name: str,
        objective: Objective,
        effort: Effort | None = None,
        extra: dict[str, Range] | None = None,
    ) -> Supremum:
        """A supremum over the tube, with an effort of its own or that for the constant."""
        return self._run(name, objective, self.tube(extra or {}), effort or self.effort_for(name))

    def tube(self, extra: Mapping[str, Range]) -> Tube:
        """The tube as a domain, with further ranges."""
        return Tube(
            self.plan,
            self.section,
            states=self.model.states,
            inputs=self.model.inputs,
            time=self.plan.time.get(TIME, self.time),
            extra={**self.plan.ranges, **dict(self.model.parameters), **extra},
        )

    def _search_plan(self, name: str, objective: Objective, effort: Effort | None = None) -> Supremum:
        return self._run(name, objective, self.plan.domain, effort or self.effort_for(name))

    def _on_plan(self, name: str, objective: SumOfNorms) -> Constant:
        return (
            Constant.exactly(0.0) if objective.is_zero else self._constant(self._search_plan(name, objective))
        )

    def _run(self, name: str, objective: Objective, domain: Domain, effort: Effort) -> Supremum:
        return self._told(name, objective, supremum(objective, domain, self._heard(name, effort)))

    def _heard(self, name: str, effort: Effort) -> Effort:
        if self.report is None:
            return effort
        report = self.report
        return replace(effort, progress=lambda step: report(replace(step, name=name)))

    def _told(self, name: str, objective: Objective, found: Supremum) -> Supremum:
        if self.spent is not None:
            self.spent(name, found.boxes * size_of(objective))
        return found

    def _constant(self, found: Supremum) -> Constant:
        return Constant(below=found.below, above=found.above, at=self._witness(found))

    def _root(self, found: Supremum) -> Constant:
        root = sqrt(Interval(max(0.0, found.below), max(0.0, found.above)))
        return Constant(below=float(root.lo), above=float(root.hi), at=self._witness(found))

    def _witness(self, found: Supremum) -> Witness:
        """Where the value was found, nearly; states that do not matter are taken from the plan.

        The state is told to some digits of what the tube reaches: the last ones are LAPACK's, and differ between
        processors.
        """
        t = self.plan.moment(found.at)
        if t is None and not self.plan.is_constant:  # a part of the plan that stays: any time will do
            t = 0.0
        moment = np.array([0.0 if t is None else t])
        centre, _ = self.plan.enclose(moment, moment)
        states = self.model.states
        origin = np.array([found.at.get(starred(name), centre.mid[0, i]) for i, name in enumerate(states)])
        x = np.array([found.at.get(name, origin[i]) for i, name in enumerate(states)])
        which = [i for i, name in enumerate(states) if name in found.at]
        if isinstance(self.section, Ellipsoid) and which:  # the others are such that the point lies in it
            x = origin + self.section.completed(which, (x - origin)[None, which])[0]
        places = _DIGITS - 1 - np.floor(np.log10(np.maximum(self.reach, 1e-300))).astype(int)
        near = (round(float(far), int(digits)) for far, digits in zip(x - origin, places, strict=True))
        return Witness(t=t, x=tuple(float(a) + far for a, far in zip(origin, near, strict=True)))


_SIGNS = 4  # absolute values of which all branches are looked at


def substituted(rows: Matrix, values: dict[str, Expression]) -> Matrix:
    """A matrix with variables replaced."""
    width = len(rows[0])
    flat = substitute([e for row in rows for e in row], values)
    return tuple(tuple(flat[i : i + width]) for i in range(0, len(flat), width))


def lipschitz_constant(h: tuple[Expression, ...], fields: Fields) -> Lipschitz:
    """The objective |h_x|, with every norm in h taken apart into a level of its own."""
    states = fields.states
    plain: dict[Expression, Expression] = {}  # each node with placeholders for the norms below it
    back: dict[str, Expression] = {}  # placeholder -> the norm it stands for
    arguments: list[tuple[Expression, ...]] = []
    for node in topological(h):
        args = tuple(plain[arg] for arg in node.args)
        plain[node] = rebuild(node, args)
        if plain[node].op == "norm":
            name = f"norm#{len(back)}"
            back[name] = node
            arguments.append(args)
            plain[node] = symbol(name)
    names = list(back)
    levels = []
    for depth, entries in enumerate([*arguments, tuple(plain[e] for e in h)]):
        gains = [substituted(column(derivatives(entries, name)), back) for name in names[:depth]]
        levels.append((fields.by_state(substituted(jacobian(entries, states), back)), gains))
    return Lipschitz(fields.by_state(jacobian(h, states)), levels, _kinks(h, fields))


def _kinks(h: tuple[Expression, ...], fields: Fields) -> Kinks | None:
    """The branches of an h with a few absolute values; None where it has none, or many."""
    signs: dict[str, Expression] = {}
    plain: dict[Expression, Expression] = {}
    for node in topological(h):
        args = tuple(plain[arg] for arg in node.args)
        if node.op == "norm" and len(args) == 1:
            name = f"sign#{len(signs)}"
            signs[name] = node.args[0]
            plain[node] = symbol(name) * args[0]
        elif node.op == "norm":  # as a root it may be differentiated more than once where it is not 0
            plain[node] = sqrt_of(sum((arg * arg for arg in args), start=ZERO))
        else:
            plain[node] = rebuild(node, args)
    if not 0 < len(signs) <= _SIGNS:
        return None
    slopes = fields.by_state(jacobian(tuple(plain[e] for e in h), fields.states))
    every = {chosen: _branch(slopes, signs, chosen) for chosen in product((1, -1), repeat=len(signs))}
    return Kinks(arguments=column(list(signs.values())), branches=every)


def _branch(slopes: Matrix, signs: Iterable[str], chosen: tuple[int, ...]) -> Matrix | None:
    """The slopes with signs chosen; None where a divisor is 0 then, as x + abs(x) is for x < 0."""
    try:
        return substituted(slopes, dict(zip(signs, map(constant, chosen), strict=True)))
    except ZeroDivisionError:
        return None
