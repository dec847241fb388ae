"""How wide a tube is proven to be: what designs, and metrics for a machine, are ranked by.

In: the section of certificate H, or a result. Out: one number, less is narrower, that means the same for every metric.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf

from tubecert.certificate.result import Result
from tubecert.kinds.hardware import HardwareData
from tubecert.letters import HARDWARE
from tubecert.spec import Spec
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """The states whose half-widths count, each with the unit that it is compared in; none of them: the radius in x."""

    units: Mapping[str, float]

    def of(self, half_widths: Mapping[str, float], radius: float | None) -> float:
        """The largest of the half-widths that count, each in its unit; inf where nothing is known."""
        if self.units:
            return max(half_widths.get(name, inf) / unit for name, unit in self.units.items())
        return inf if radius is None else radius


def measure_of(spec: Spec) -> Measure:
    """What a specification counts: the half-widths that it asks for; without any, its radius.

    A radius in coordinates of the tube means another length for every metric: there all states count, in half-widths
    of the safe set.
    """
    asked = {name: float(width) for name, width in spec.tube.half_widths}
    if not asked and spec.tube.auto:
        box = zip(spec.states, spec.safe_set, strict=True)
        asked = {name: float(high - low) / 2 for name, (low, high) in box}
    return Measure(units=asked)


def measure_in(spec: Spec, outputs: Sequence[str]) -> Measure | None:
    """The states that were named, each in its own unit or that of its half-width; None where none were."""
    asked = dict(spec.tube.half_widths)
    return Measure(units={name: float(asked.get(name, 1)) for name in outputs}) if outputs else None


def machine_of(result: Result) -> HardwareData | None:
    """The section of certificate H, if that is what decides."""
    found = result.sections.get(HARDWARE.key)
    return found if isinstance(found, HardwareData) and result.decided_by == (HARDWARE.key,) else None


def size_of(result: Result, measure: Measure) -> float | None:
    """How wide a tube is proven to be; None unless it is certified."""
    if result.verdict is not Verdict.CERTIFIED or result.tube is None:
        return None
    own = machine_of(result)
    if own is None:
        return measure.of(result.tube.half_widths or {}, float(result.tube.rho))
    return measure.of(own.half_widths, own.radius)


def need_of(section: HardwareData, measure: Measure) -> float:
    """What a metric comes to with certificate H: the tube, or what is searched for, the more of it the better.

    Where it is not certified, by how much it is not, as a factor above 1: to be compared with its like only.
    """
    if section.verdict is not Verdict.CERTIFIED:
        return inf if section.margin is None or section.margin.below is None else 1 - section.margin.below
    if section.largest is None:
        return measure.of(section.half_widths, section.radius)
    largest = getattr(section, section.largest)
    return 1 / float(largest) if largest else inf


def half_widths(spec: Spec) -> tuple[Fraction, ...]:
    """What the states are measured in: the tube's half-widths where all are asked for, else the safe set's."""
    asked = dict(spec.tube.half_widths)
    if all(name in asked for name in spec.states):
        return tuple(asked[name] for name in spec.states)
    return tuple((high - low) / 2 for low, high in spec.safe_set)
