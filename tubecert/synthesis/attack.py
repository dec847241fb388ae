"""Attacks on given coefficients by sampling: points at which the conditions fail, and what holds on the samples.

Untrusted: floats, and what is missed is found by branch and bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import finite, whitening
from tubecert.synthesis.forms import FormsTape
from tubecert.synthesis.problem import Floor, SynthesisProblem
from tubecert.synthesis.sampling import Region, floats, worst

_SAMPLES = 800  # for every variable that varies freely
_KEPT = 16  # points of C2; of C1 fewer


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """What was found about given coefficients.

    Points (N, n) at which they fail, by condition; by how much the rate falls short; kappa and the scale that makes W
    exceed the floor.
    """

    low: Array
    high: Array
    contraction: Array
    shortfall: float
    kappa: float
    scale: float

    @property
    def failed(self) -> bool:
        """Whether the rate is missed, or W is not positive."""
        return not (self.shortfall <= 0 and np.isfinite(self.kappa))


@dataclass(frozen=True, slots=True, kw_only=True)
class Attacker:
    """Where conditions are asked: C1 on `bounded`, C2 on `contracting`."""

    forms: FormsTape = field(repr=False)
    rate: float
    floor: Floor
    bounded: Region
    contracting: Region
    generator: np.random.Generator = field(repr=False)

    @staticmethod
    def of(
        problem: SynthesisProblem, forms: FormsTape, symmetries: Array, generator: np.random.Generator
    ) -> Attacker:
        """For a problem with sign symmetries (S, n)."""
        lo, hi = floats(problem.safe_set)
        own = set(forms.metric_variables)
        own |= set(forms.input_variables) if problem.floor == "input" else set()
        bounded = Region(lo=lo, hi=hi, variables=tuple(sorted(own)), symmetries=symmetries)
        contracting = replace(bounded, variables=forms.variables, at_ends=forms.affine_variables(lo, hi))
        return Attacker(
            forms=forms,
            rate=problem.rate,
            floor=problem.floor,
            bounded=bounded,
            contracting=contracting,
            generator=generator,
        )

    def attack(self, coefficients: Array, ceiling: float) -> Attack:
        """The worst points for these coefficients (of the changed functions); W <= `ceiling` is asked for."""
        c2, short = self._worst(self.contracting, lambda x: self.rate - self.rates(coefficients, x), _KEPT)
        low, least = self._worst(self.bounded, lambda x: -self.floors(coefficients, x), _KEPT // 3)
        high, most = self._worst(self.bounded, lambda x: self.tops(coefficients, x), _KEPT // 3)
        floor, top = -float(least[0]), float(most[0])
        return Attack(
            low=low[least > -1],
            high=high[most > ceiling],
            contraction=c2[short > 0],
            shortfall=float(short[0]),
            kappa=top / floor if floor > 0 else np.inf,
            scale=1 / floor if floor > 0 else 1.0,
        )

    def rates(self, coefficients: Array, points: Array) -> Array:
        """The largest rate that C2 permits at each point (N,); -inf where W is not positive, inf where C2 is void."""
        F, W = self.forms(points).contraction(coefficients)
        if not F.shape[-1]:
            return np.full(len(points), np.inf)
        t = whitening(W)
        rate = -0.5 * largest(t @ F @ np.swapaxes(t, -1, -2))
        return np.where(largest(-W) < 0, rate, -np.inf)

    def floors(self, coefficients: Array, points: Array) -> Array:
        """The largest multiple of the floor below W at each point; negative where W is not positive."""
        here = self.forms(points)
        W = here.metric(coefficients)
        if self.floor == "identity":
            return -largest(-W)
        t = whitening(W)
        reached = largest(t @ here.input @ np.swapaxes(t, -1, -2))
        return np.where(largest(-W) < 0, 1 / reached, -1.0)

    def tops(self, coefficients: Array, points: Array) -> Array:
        """The largest eigenvalue of W at each point."""
        return largest(self.forms(points).metric(coefficients))

    def _worst(self, region: Region, score: Callable[[Array], Array], keep: int) -> tuple[Array, Array]:
        samples = _SAMPLES * (1 + len(region.inner))
        return worst(score, region, self.generator, samples=samples, climbers=2 * keep, keep=keep)


def largest(matrices: Array) -> Array:
    """The largest eigenvalues of symmetric matrices; inf where they are not finite."""
    known = finite(matrices)
    safe = np.where(known[:, None, None], matrices, 0.0)
    return np.where(known, np.linalg.eigvalsh(safe)[:, -1], np.inf)
