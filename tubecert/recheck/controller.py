"""What the controller of a certificate H answers to measurements: (H.4), (H.5) and (0.5) in ball arithmetic.

In: a certificate, and what is measured at t = 0, Ts, 2 Ts, ... Out: the inputs that have to be computed from it, of
which compiled code must differ by its rounding only. Two integrals are computed by fine steps and not enclosed: the
mean of u* over a sample, and the prediction of theorem H-P. So this examines code, and proves nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from flint import arb, arb_mat, ctx

from tubecert.recheck.arcs import Geometry
from tubecert.recheck.balls import Ball, exact, length
from tubecert.recheck.case import Case
from tubecert.recheck.certificate import read_certificate
from tubecert.recheck.curve import CLOCK, Part
from tubecert.recheck.document import read
from tubecert.recheck.kinds.hardware import OfMachines
from tubecert.recheck.kinds.hardware_section import HardwareSection
from tubecert.recheck.program import Program
from tubecert.recheck.recipe import Digital
from tubecert.recheck.terms import names

BITS = 200
_PANELS = 16  # of a sample, for the mean of u*
_STEPS = 64  # of a delay, for the prediction
_NO_MACHINE = "its certificate H has no machine of which every feedback is computed at a sample"

Column = list[Ball]


def answers(text: str, file: str, measured: Sequence[Sequence[Fraction]]) -> list[Column]:
    """The inputs of the start and of every sample; u* is among them where it is held or constant.

    Raises `CertificateError` for what is no certificate, `ValueError` where there is no machine to be examined.
    """
    with ctx.workprec(BITS):
        return list(machine_of(text, file).answers([[exact(q) for q in row] for row in measured]))


def machine_of(text: str, file: str) -> Machine:
    """The machine of a certificate; raises as `answers` does."""
    case = Case(read_certificate(read(text, file)).result, 1)
    if case.result.sections is None:
        raise ValueError(_NO_MACHINE)
    key = OfMachines.key
    section, recipe = case.result.sections.by_key.get(key), case.result.recipes.get(key)
    if not isinstance(section, HardwareSection) or not isinstance(recipe, Digital):
        raise ValueError(_NO_MACHINE)
    hardware = case.result.specification.hardware
    if hardware is None or (recipe.feedback_time / recipe.sample_time).denominator > 1:
        raise ValueError(_NO_MACHINE)
    return Machine(case, section, recipe, held=hardware.held)


@dataclass(frozen=True)
class Machine:
    """The machine of a section and its recipe."""

    case: Case
    section: HardwareSection
    recipe: Digital
    held: bool

    @property
    def whole(self) -> bool:
        """Whether what is computed at a sample contains u*."""
        return self.held or CLOCK not in names(self.case.curve.u)

    def answers(self, measured: Sequence[Column]) -> Iterator[Column]:
        """(H.3)-(H.5), sample by sample."""
        m, Ts, tau = len(self.case.system.inputs), self.recipe.sample_time, self.recipe.delay
        share = exact(tau / Ts)
        feedback = self.feedback(measured[0], Fraction(0))
        before = acting = feedback
        yield acting
        q = [arb(0)] * m
        for k, y in enumerate(measured):
            t = k * Ts
            if k:
                mean = [(1 - share) * a + share * b for a, b in zip(acting, before, strict=True)]
                if not self.whole:
                    mean = [a + b for a, b in zip(mean, self.played(t - Ts, t), strict=True)]
                q = self.filtered(q, self.estimate(y, measured[k - 1], mean))
            if t % self.recipe.feedback_time:
                pass  # it is held
            elif self.section.predict:
                feedback = self.feedback(self.predicted(y, t, feedback), t + tau)
            else:
                feedback = self.feedback(y, t)
            before = acting
            acting = [a - b for a, b in zip(feedback, self.clipped(q), strict=True)]
            yield acting

    def feedback(self, y: Column, t: Fraction) -> Column:
        """kappa of (0.5) at (x*(t), y), or of (H.40), with u* where that is held."""
        x, u = self.plan(t)
        kappa = self._least(x, u, y) if self.case.system.flat else self._swept(x, u, y)
        return [a + b for a, b in zip(kappa, u, strict=True)] if self.whole else kappa

    def _least(self, x: Column, u: Column, y: Column) -> Column:
        """Of a constant metric."""
        z = [a - b for a, b in zip(y, x, strict=True)]
        g = _times(self.metric, z)
        moved = [a - b for a, b in zip(self.speed(y, u), self.speed(x, u), strict=True)]
        excess = _dot(g, moved) + exact(self.case.system.rate) * _dot(g, z)
        c = _times(_turned(self.inputs(y)), g)
        share = excess / _dot(c, c) if excess > 0 else arb(0)
        return [-share * each for each in c]

    def _swept(self, x: Column, u: Column, y: Column) -> Column:
        """By the geodesic that is computed, (H.39), (H.40)."""
        machine = self.case.result.specification.hardware
        arcs = None if machine is None else machine.arcs
        if arcs is None:
            raise ValueError("its metric is not constant, and its geodesics are exact")
        geometry = Geometry(self.case.system)
        first, last = geometry.speeds(arcs, x, y)
        p0, p1 = geometry.lowered(x, first), geometry.lowered(y, last)
        square = _dot(p1, last)
        slope = _dot(p1, self.speed(y, u)) - _dot(p0, self.speed(x, u))
        excess = slope + exact(self.case.system.rate) * square
        c = _times(_turned(self.inputs(x)), p0)
        norm = length(c)
        if not (excess > 0 and norm > 0):
            return [arb(0)] * len(c)
        limit = exact(self.case.bound("feedback_gain")) * square.sqrt()
        share = (excess / norm).min(limit) / norm
        return [-share * each for each in c]

    def estimate(self, y: Column, last: Column, mean: Column) -> Column:
        """sigma of (H.5)."""
        Ts = exact(self.recipe.sample_time)
        moved = [
            (a - b) / Ts - (p + q) / 2
            for a, b, p, q in zip(y, last, self.drift(y), self.drift(last), strict=True)
        ]
        B = self.inputs(y)
        weighed = _times(_turned(B), _times(self.weights, moved))
        gram = arb_mat([[_dot(a, _times(self.weights, b)) for b in _turned(B)] for a in _turned(B)])
        found = gram.solve(arb_mat([[each] for each in weighed]))
        return [found[j, 0] - mean[j] for j in range(len(mean))]

    def filtered(self, q: Column, sigma: Column) -> Column:
        """q_k."""
        if self.recipe.bandwidth is None:
            return sigma
        kept = (-exact(self.recipe.bandwidth * self.recipe.sample_time)).exp()
        return [kept * a + (1 - kept) * b for a, b in zip(q, sigma, strict=True)]

    def clipped(self, q: Column) -> Column:
        """Its projection: to the box, or to the ball."""
        if self.section.clip:
            return [
                each.max(exact(low)).min(exact(high))
                for each, (low, high) in zip(q, self.section.clip, strict=True)
            ]
        size, radius = length(q), exact(self.recipe.clip_radius)
        return [radius / size * each for each in q] if size > radius else q

    def predicted(self, y: Column, t: Fraction, feedback: Column) -> Column:
        """yp at t + tau, theorem H-P."""
        h = self.recipe.delay / _STEPS
        for k in range(_STEPS):
            y = self._step(y, t + k * h, h, feedback)
        return y

    def played(self, begin: Fraction, end: Fraction) -> Column:
        """The mean of u* over a sample, by Simpson's rule on the parts of every piece."""
        ends = {begin, end}
        ends |= {q for q in self.knots if begin < q < end}
        cuts, total = sorted(ends), [arb(0)] * len(self.case.system.inputs)
        for low, high in pairwise(cuts):
            h = (high - low) / _PANELS
            for k in range(_PANELS):
                left = low + k * h
                values = [self.plan(q, low)[1] for q in (left, left + h / 2, left + h)]
                for j, (a, b, c) in enumerate(zip(*values, strict=True)):
                    total[j] += exact(h / 6) * (a + 4 * b + c)
        return [each / exact(end - begin) for each in total]

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
        return [a + _dot(row, u) for a, row in zip(self.drift(x), self.inputs(x), strict=True)]

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
    def knots(self) -> tuple[Fraction, ...]:
        """Where pieces of the plan begin."""
        found = self.case.result.plan.knots
        return () if found is None else found.t

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

    def _step(self, y: Column, t: Fraction, h: Fraction, feedback: Column) -> Column:
        """A step of Runge and Kutta's rule."""

        def slope(x: Column, at: Fraction) -> Column:
            u = feedback if self.whole else [a + b for a, b in zip(feedback, self.plan(at)[1], strict=True)]
            return self.speed(x, u)

        def moved(share: Fraction, v: Column) -> Column:
            return [a + exact(share) * b for a, b in zip(y, v, strict=True)]

        first = slope(y, t)
        second = slope(moved(h / 2, first), t + h / 2)
        third = slope(moved(h / 2, second), t + h / 2)
        last = slope(moved(h, third), t + h)
        mean = [a + 2 * b + 2 * c + d for a, b, c, d in zip(first, second, third, last, strict=True)]
        return moved(h / 6, mean)


def _dot(a: Column, b: Column) -> Ball:
    return sum((x * y for x, y in zip(a, b, strict=True)), start=arb(0))


def _times(rows: list[Column], x: Column) -> Column:
    return [_dot(row, x) for row in rows]


def _turned(rows: list[Column]) -> list[Column]:
    return [list(column) for column in zip(*rows, strict=True)]
