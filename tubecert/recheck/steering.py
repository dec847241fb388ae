"""The plan of a certificate and the feedback (0.5) around it, in ball arithmetic: what every controller has."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, exact, length
from tubecert.recheck.case import Case
from tubecert.recheck.curve import CLOCK, Part
from tubecert.recheck.program import Program

Column = list[Ball]


@dataclass(frozen=True)
class Steering:
    """Plan, plant and feedback of a certificate."""

    case: Case

    def least(self, x: Column, u: Column, y: Column) -> Column:
        """k of (0.5) at (x, y), u being u*; of a constant metric."""
        z = [a - b for a, b in zip(y, x, strict=True)]
        g = times(self.metric, z)
        moved = [a - b for a, b in zip(self.speed(y, u), self.speed(x, u), strict=True)]
        excess = dot(g, moved) + exact(self.case.system.rate) * dot(g, z)
        c = times(turned(self.inputs(y)), g)
        share = excess / dot(c, c) if excess > 0 else arb(0)
        return [-share * each for each in c]

    def explained(self, y: Column, speed: Column) -> Column:
        """(S B)^+ S of a speed, B being that at y."""
        B = self.inputs(y)
        weighed = times(turned(B), times(self.weights, speed))
        gram = arb_mat([[dot(a, times(self.weights, b)) for b in turned(B)] for a in turned(B)])
        found = gram.solve(arb_mat([[each] for each in weighed]))
        return [found[j, 0] for j in range(len(weighed))]

    def plan(self, t: Fraction, within: Fraction | None = None) -> tuple[Column, Column]:
        """x* and u* at a time, of the piece that the time `within` lies in; beyond the horizon those at its end."""
        horizon = self.case.curve.horizon
        t = t if horizon is None else min(t, horizon)
        part = self._part(t if within is None else within)
        inside = {CLOCK: exact(t) - part.start, **part.values}
        found = self._plan.run([inside[name] for name in self._names])
        n = len(self.case.system.states)
        return found[:n], found[n:]

    def speed(self, x: Column, u: Column) -> Column:
        """f + B u."""
        return [a + dot(row, u) for a, row in zip(self.drift(x), self.inputs(x), strict=True)]

    def drift(self, x: Column) -> Column:
        """f."""
        return self._plant.run(x)[: len(x)]

    def inputs(self, x: Column) -> list[Column]:
        """B."""
        found, m = self._plant.run(x)[len(x) :], len(self.case.system.inputs)
        return [found[i * m : (i + 1) * m] for i in range(len(x))]

    @cached_property
    def dual(self) -> list[Column]:
        """W."""
        W = self.case.system.W
        values = Program([e for row in W for e in row], ()).run([])
        return [values[i * len(W) : (i + 1) * len(W)] for i in range(len(W))]

    @cached_property
    def metric(self) -> list[Column]:
        """M = W^-1."""
        rows: list[Column] = arb_mat(self.dual).inv().tolist()
        return rows

    @cached_property
    def weights(self) -> list[Column]:
        """S'S of the coordinates of the tube."""
        S, n = self.case.tube.coordinates, range(len(self.case.system.states))
        if S is None:
            return [[arb(int(i == j)) for j in n] for i in n]
        return [[exact(sum((row[i] * row[j] for row in S), Fraction(0))) for j in n] for i in n]

    @cached_property
    def _plant(self) -> Program:
        s = self.case.system
        return Program([*(row[0] for row in s.f), *(e for row in s.B for e in row)], s.states)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return (CLOCK, *self.case.curve.parts[0].values)

    @cached_property
    def _plan(self) -> Program:
        return Program([*self.case.curve.x, *self.case.curve.u], self._names)

    def _part(self, t: Fraction) -> Part:
        """The part that a time lies in; at a knot the one that begins there."""
        parts = self.case.curve.parts
        return next((part for part in reversed(parts) if not exact(t) < part.start), parts[0])


def into_ball(q: Column, radius: Fraction) -> Column:
    """The projection onto the ball of a radius."""
    size, most = length(q), exact(radius)
    return [most / size * each for each in q] if size > most else q


def dot(a: Column, b: Column) -> Ball:
    """a'b."""
    return sum((x * y for x, y in zip(a, b, strict=True)), start=arb(0))


def times(rows: list[Column], x: Column) -> Column:
    """Of a matrix, by rows, and a vector."""
    return [dot(row, x) for row in rows]


def turned(rows: list[Column]) -> list[Column]:
    """The transpose."""
    return [list(column) for column in zip(*rows, strict=True)]
