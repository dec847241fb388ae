"""What the controller of a certificate H answers to measurements: (H.4), (H.5) and (0.5) in ball arithmetic.

In: a certificate, and what is measured at t = 0, Ts, 2 Ts, ... Out: the inputs that have to be computed from it, of
which compiled code must differ by its rounding only. Two integrals are computed by fine steps and not enclosed: the
mean of u* over a sample, and the prediction of theorem H-P. So this examines code, and proves nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from flint import arb, ctx

from tubecert.recheck.arcs import Geometry
from tubecert.recheck.balls import exact, length
from tubecert.recheck.case import Case
from tubecert.recheck.certificate import read_certificate
from tubecert.recheck.curve import CLOCK
from tubecert.recheck.document import read
from tubecert.recheck.family import Everyone
from tubecert.recheck.kinds.hardware import OfMachines
from tubecert.recheck.kinds.hardware_section import HardwareSection
from tubecert.recheck.recipe import Digital
from tubecert.recheck.steering import Column, Steering, dot, into_ball, times, turned
from tubecert.recheck.terms import names

BITS = 200
_PANELS = 16  # of a sample, for the mean of u*
_STEPS = 64  # of a delay, for the prediction
_NO_MACHINE = "its certificate H has no machine of which every feedback is computed at a sample"


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
    if isinstance(case.curve, Everyone):
        return OfFamily(case, section, recipe, held=hardware.held)
    return Machine(case, section, recipe, held=hardware.held)


@dataclass(frozen=True)
class Machine(Steering):
    """The machine of a section and its recipe; a prediction is integrated by so many `steps`."""

    section: HardwareSection
    recipe: Digital
    held: bool
    steps: int = _STEPS

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
        kappa = self.least(x, u, y) if self.case.system.flat else self._swept(x, u, y)
        return [a + b for a, b in zip(kappa, u, strict=True)] if self.whole else kappa

    def _swept(self, x: Column, u: Column, y: Column) -> Column:
        """By the geodesic that is computed, (H.39), (H.40)."""
        machine = self.case.result.specification.hardware
        arcs = None if machine is None else machine.arcs
        if arcs is None:
            raise ValueError("its metric is not constant, and its geodesics are exact")
        geometry = Geometry(self.case.system)
        first, last = geometry.speeds(arcs, x, y)
        p0, p1 = geometry.lowered(x, first), geometry.lowered(y, last)
        square = dot(p1, last)
        slope = dot(p1, self.speed(y, u)) - dot(p0, self.speed(x, u))
        excess = slope + exact(self.case.system.rate) * square
        c = times(turned(self.inputs(x)), p0)
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
        return [a - b for a, b in zip(self.explained(y, moved), mean, strict=True)]

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
        return into_ball(q, self.recipe.clip_radius)

    def predicted(self, y: Column, t: Fraction, feedback: Column) -> Column:
        """yp at t + tau, theorem H-P."""
        h = self.recipe.delay / self.steps
        for k in range(self.steps):
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

    @cached_property
    def knots(self) -> tuple[Fraction, ...]:
        """Where pieces of the plan begin."""
        found = self.case.result.plan.knots
        return () if found is None else found.t

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


@dataclass(frozen=True)
class OfFamily(Machine):
    """The machine of a family of plans: rows of what is measured go on with x*, u* and, if it is played, its mean."""

    plans: tuple[tuple[Column, Column, Column], ...] = ()

    @property
    def whole(self) -> bool:
        """Whether u* is held."""
        return self.held

    def answers(self, measured: Sequence[Column]) -> Iterator[Column]:
        """(H.3)-(H.5), for the plan that is handed in."""
        parts = [self.split(row) for row in measured]
        own = replace(self, plans=tuple((x, u, mean) for _, x, u, mean in parts))
        yield from Machine.answers(own, [y for y, *_ in parts])

    def split(self, row: Column) -> tuple[Column, Column, Column, Column]:
        """What is measured, x*, u*, and the mean of u*, if there is any."""
        n, m = len(self.case.system.states), len(self.case.system.inputs)
        return row[:n], row[n : 2 * n], row[2 * n : 2 * n + m], row[2 * n + m :]

    def plan(self, t: Fraction, within: Fraction | None = None) -> tuple[Column, Column]:
        """x* and u* at a sample."""
        x, u, _ = self.plans[self._sample(t)]
        return x, u

    def played(self, begin: Fraction, end: Fraction) -> Column:
        """The mean of u* up to a sample."""
        return self.plans[self._sample(end)][2]

    def _sample(self, t: Fraction) -> int:
        k = t / self.recipe.sample_time
        if k.denominator > 1:
            raise ValueError("a plan that is handed in is known at samples only")
        return int(k)
