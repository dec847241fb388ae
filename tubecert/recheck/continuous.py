"""What the controller of a certificate C answers: (0.5) and (4.5) in ball arithmetic.

In: a certificate, and rows of a time since the last sample, a state and an xhat; where the time is 0, it is a sample.
Out: u and xhat' of every row. What code has to answer, but for its rounding; between samples nothing is integrated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import arb, ctx

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.case import Case
from tubecert.recheck.certificate import read_certificate
from tubecert.recheck.controller import BITS
from tubecert.recheck.document import read
from tubecert.recheck.family import Everyone
from tubecert.recheck.kinds.sampled import Sampled, SampledRecipe, SampledSection
from tubecert.recheck.sampling import SampledGains
from tubecert.recheck.steering import Column, Steering, into_ball

_NO_LOOP = "its certificate C has no gains, or its metric is not constant"


def answers(text: str, file: str, given: Sequence[Sequence[Fraction]]) -> list[Column]:
    """u and xhat' of every row.

    Raises `CertificateError` for what is no certificate, `ValueError` where there is no loop to be examined.
    """
    with ctx.workprec(BITS):
        return list(loop_of(text, file).answers(given))


def loop_of(text: str, file: str) -> Adapted:
    """The loop of a certificate; raises as `answers` does."""
    case = Case(read_certificate(read(text, file)).result, 1)
    if case.result.sections is None:
        raise ValueError(_NO_LOOP)
    section = case.result.sections.by_key.get(Sampled.key)
    recipe = case.result.recipes.get(Sampled.key)
    if not isinstance(section, SampledSection) or not isinstance(recipe, SampledRecipe):
        raise ValueError(_NO_LOOP)
    if section.verdict != "certified" or recipe.gains != section.pair or not case.system.flat:
        raise ValueError(_NO_LOOP)
    return (OfFamily if isinstance(case.curve, Everyone) else Adapted)(case, recipe.gains)


@dataclass(frozen=True)
class Adapted(Steering):
    """The loop of theorem C at its gains."""

    gains: SampledGains

    @property
    def reach(self) -> Ball:
        """dbar = sqrt(a) rho."""
        lower = self.case.metric.lower
        if lower is None or lower.below is None:
            raise ValueError(_NO_LOOP)
        return root(exact(lower.below)) * exact(self.case.tube.rho)

    def answers(self, given: Sequence[Sequence[Fraction]]) -> Iterator[Column]:
        """(0.4), (0.5) and (4.5), row by row."""
        n, m = len(self.case.system.states), len(self.case.system.inputs)
        omega, g = exact(self.gains.bandwidth), exact(self.gains.predictor_gain)
        Ts, sample = self.gains.sample_time, 0
        u_a, sigma, s = [arb(0)] * m, [arb(0)] * m, [arb(0)] * n
        for k, row in enumerate(given):
            since = row[0]
            x, xhat = ([exact(q) for q in part] for part in (row[1 : 1 + n], row[1 + n : 1 + 2 * n]))
            apart = [a - b for a, b in zip(xhat, x, strict=True)]
            if k and since == 0:
                sample += 1
                u_a = _filtered(u_a, sigma, omega * exact(Ts))
                s, sigma = self.adapted(x, apart)
            star, free = self.along(sample * Ts + since, row[1 + 2 * n :])
            kappa = self.least(star, free, x)
            acting = _filtered(u_a, sigma, omega * exact(since))
            u = [a + b + c for a, b, c in zip(free, kappa, acting, strict=True)]
            rate = [a + b - g * c for a, b, c in zip(self.speed(x, u), s, apart, strict=True)]
            yield [*u, *rate]

    def along(self, t: Fraction, handed: Sequence[Fraction]) -> tuple[Column, Column]:
        """x* and u* at a time."""
        del handed
        return self.plan(t)

    def adapted(self, x: Column, apart: Column) -> tuple[Column, Column]:
        """s_hat and sigma_hat, from x and xhat - x at a sample."""
        g = exact(self.gains.predictor_gain)
        grown = g * exact(self.gains.sample_time)
        s = [-g / grown.expm1() * each for each in apart]
        raw = self.explained(x, [grown.exp() * each for each in s])
        return s, into_ball(raw, self.gains.projection_radius)


@dataclass(frozen=True)
class OfFamily(Adapted):
    """The same of a family of plans: rows go on with x* and u*."""

    def along(self, t: Fraction, handed: Sequence[Fraction]) -> tuple[Column, Column]:
        """What is handed in."""
        del t
        n = len(self.case.system.states)
        return [exact(q) for q in handed[:n]], [exact(q) for q in handed[n:]]


def _filtered(u: Column, sigma: Column, angle: Ball) -> Column:
    """u_a after a time of which `angle` is the product with omega."""
    kept = (-angle).exp()
    return [kept * a - (1 - kept) * b for a, b in zip(u, sigma, strict=True)]
