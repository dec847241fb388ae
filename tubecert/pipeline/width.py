"""How wide a tube is proven to be: what metrics are ranked by where outputs are named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf

from tubecert.spec import Spec


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """The states whose half-widths count, each with the unit that it is compared in."""

    units: Mapping[str, float]

    def of(self, half_widths: Mapping[str, float]) -> float:
        """The largest of the half-widths that count, each in its unit; inf where nothing is known."""
        return max(half_widths.get(name, inf) / unit for name, unit in self.units.items())


def measure_in(spec: Spec, outputs: Sequence[str]) -> Measure | None:
    """The states that were named, each in its own unit or that of its half-width; None where none were."""
    asked = dict(spec.tube.half_widths)
    return Measure(units={name: float(asked.get(name, 1)) for name in outputs}) if outputs else None


def half_widths(spec: Spec) -> tuple[Fraction, ...]:
    """What the states are measured in: the tube's half-widths where all are asked for, else the safe set's."""
    asked = dict(spec.tube.half_widths)
    if all(name in asked for name in spec.states):
        return tuple(asked[name] for name in spec.states)
    return tuple((high - low) / 2 for low, high in spec.safe_set)
