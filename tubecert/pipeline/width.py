"""How wide a tube is: what metrics are ranked by where outputs are named, and other tubes where radii do not serve."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf
from typing import Final

from tubecert.enclosure.constant import round_down
from tubecert.spec import Spec

_SHARES: Final = (Fraction(1, 2), Fraction(1, 4))  # of the safe set: widths that are tried
_MANY, _APART = 4, 4  # states, and their ranges, that make radii doubtful


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


def otherwise(spec: Spec) -> Iterator[Spec]:
    """The specification with other tubes, where its radii measure states that differ in unit or scale.

    The same radii in coordinates of the tube, if it is a ball; then half-widths, as shares of the safe set.
    """
    tube, units, sizes = spec.tube, dict(spec.units), half_widths(spec)
    known = {units[name] for name in spec.states if name in units}
    alike = len(spec.states) < _MANY and len(known) < 2 and max(sizes) < _APART * min(sizes)
    if tube.half_widths or alike:
        return
    if not tube.auto:
        yield replace(spec, tube=replace(tube, coordinates="auto"))
    for share in _SHARES:
        widths = tuple(round_down(float(share * size), 2) for size in sizes)
        asked = tuple(zip(spec.states, widths, strict=True))
        yield replace(
            spec, tube=replace(tube, epsilon=None, rho_a=None, coordinates="auto", half_widths=asked)
        )
