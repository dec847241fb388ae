"""Where claims are examined: the tube around the plan, or the plan itself, part by part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb

from tubecert.recheck.balls import Ball
from tubecert.recheck.coordinates import Coordinates, Fields
from tubecert.recheck.cover import Boxed, Outcome, in_turn, prove
from tubecert.recheck.curve import CLOCK, SINCE, Curve, Part, expressed
from tubecert.recheck.specified.numbers import TIME, Numbers
from tubecert.recheck.statements import NormsBelow, NotNegative, PositiveDefinite
from tubecert.recheck.system import System
from tubecert.recheck.terms import Matrix, Rows, Term, matrix_replaced, names, number, variable
from tubecert.recheck.tube import Ellipsoid, Round, Tube


@dataclass(frozen=True)
class Place:
    """A system with its plan and its tube; `budget` boxes for each claim.

    With `coordinates` S the tube is |S (x - x*)| <= rho, |x_i - x*_i| <= sides_i, else the ball of radius rho.
    """

    system: System
    curve: Curve
    rho: Fraction
    budget: int
    coordinates: Coordinates | None = None
    sides: Numbers | None = None

    @cached_property
    def fields(self) -> Fields:
        """The system in the coordinates of the tube."""
        return Fields(self.system, self.coordinates)

    @cached_property
    def known(self) -> dict[object, tuple[Fraction, Outcome]]:
        """What was confirmed over this tube: terms, the least limit so far, and its outcome (`norms`)."""
        return {}

    @cached_property
    def around(self) -> Round | Ellipsoid:
        """The tube around one point of the plan."""
        if self.coordinates is None or self.sides is None:
            return Round(self.rho)
        return Ellipsoid(self.coordinates, self.rho, self.sides)

    def tube(self) -> Tube:
        """The tube, with the times that matter for h."""
        s, time = self.system, self.system.times
        free = {**self.curve.ranges, **s.ranges, **({} if time is None else {TIME: time})}
        return Tube(self.curve, self.around, s.states, s.inputs, free)

    def on_plan(self, rows: Rows) -> Matrix:
        """A matrix along the plan."""
        s = self.system
        values = dict(zip((*s.states, *s.inputs), (*self.curve.x, *self.curve.u), strict=True))
        return matrix_replaced(rows, values | self._clock)

    @property
    def _clock(self) -> dict[str, Term]:
        """The time in f by the s of the plan: since a knot, or since a plan of one part begins."""
        if TIME not in names(e for row in self.system.f for e in row):
            return {}
        parts = self.curve.parts
        if all(SINCE in part.values for part in parts):
            return {TIME: variable(SINCE) + variable(CLOCK)}
        if not (len(parts) == 1 and not parts[0].values and parts[0].start == 0):
            raise ValueError("f depends on t along a plan whose times are not known")
        return {TIME: variable(CLOCK)}

    def around_plan(self, rows: Rows) -> Matrix:
        """A matrix in s and in x - x*, for every part of a plan: the tube stays there, whatever the plan does."""
        offsets = [variable(name) + x for name, x in zip(self._offsets, self.curve.x, strict=True)]
        s = self.system
        values = dict(zip((*s.states, *s.inputs), (*offsets, *self.curve.u), strict=True))
        return matrix_replaced(rows, values | self._clock)

    def beside_plan(self, rows: Rows, limit: Fraction) -> Outcome:
        """|G| <= limit in s and in x - x*, on every part of the plan."""
        whole = NormsBelow([self.around_plan(rows)], limit, self.numbers)
        return in_turn(
            prove(whole.with_values(part.values), self._ball_of(part), self.budget)
            for part in self.curve.parts
        )

    def _ball_of(self, part: Part) -> Tube:
        """The tube around one part, in its s and in x - x*."""
        nothing = [number(0)] * len(self.system.states)
        return Tube(
            expressed(nothing, (), TIME, None), self.around, self._offsets, (), {CLOCK: (arb(0), part.length)}
        )

    @property
    def _offsets(self) -> list[str]:
        return [f"{name} - {name}*" for name in self.system.states]

    def along(self, test: Callable[[], NormsBelow | PositiveDefinite | NotNegative]) -> Outcome:
        """A test in s on every part of the plan."""
        whole = test()
        return in_turn(
            prove(
                whole.with_values(part.values),
                Boxed({CLOCK: (arb(0), part.length), **self.curve.ranges}),
                self.budget,
            )
            for part in self.curve.parts
        )

    @property
    def numbers(self) -> dict[str, Ball]:
        """The numbers of one part, for a test that is made once for all of them."""
        return self.curve.parts[0].values
