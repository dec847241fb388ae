"""What a command asks for beside the specification."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from tubecert.conditions.theorem import Asked
from tubecert.spec import Spec


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line asks for beside the specification.

    `by_effect`: whether each constant has a gap of its own, such that closer constants would lower the gains that
    decide by less than `gap`; None: as the specification says.
    """

    rho_a: Fraction | None = None
    epsilon: Fraction | None = None
    metric: Path | None = None
    conditions: str | None = None
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    gap: Fraction = Fraction(1, 100)
    by_effect: bool | None = None
    budget: int = 2_000_000

    def asked(self, *, curve: bool) -> Asked:
        """The gains that are asked for; with `curve`, what else is possible beside them."""
        pair = self.bandwidth, self.adaptation_rate
        return Asked(gains=None if pair[0] is None or pair[1] is None else (pair[0], pair[1]), curve=curve)


def overridden(spec: Spec, options: Options) -> Spec:
    """The specification with the radii of the command line."""
    tube = replace(
        spec.tube,
        epsilon=spec.tube.epsilon if options.epsilon is None else options.epsilon,
        rho_a=spec.tube.rho_a if options.rho_a is None else options.rho_a,
    )
    return replace(spec, tube=tube)
