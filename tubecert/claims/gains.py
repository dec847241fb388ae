"""Claims about gains: they suffice, or a condition of a section is not proven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.claims.family import Claim
from tubecert.enclosure.constant import Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class GainsSuffice(Claim):
    """The gains of a section satisfy its conditions; `margins` are what is proven to be left of each.

    `binds` sets the bandwidth, if one does; `predictor_gain` g where the predictor is -g I by choice of the search.
    """

    tag: ClassVar[str] = "gains_suffice"
    section: str
    margins: Mapping[str, float]
    binds: str | None = None
    predictor_gain: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionHolds(Claim):
    """A condition of a section that is not proven, by `margin`, or by what is `needed` and `allowed`.

    `condition` is one of the section's own (26a, 26b, 26c, distance), or what no gains can help:
    `initial_distance` (d0 < dbar), `plan_defect` (delta/lambda < dbar), `parameters` and `wind` (the same with what
    they add), `wind_not_covered` (the theorem knows no wind), `gain_not_covered` (it knows no uncertain B), `bounded`
    (the constant `constant` is); or `any_gains`: none were found; or `proven_gains`: of those none could be proven.
    `beyond`: the margin is below all floats; `blocked_by` names a condition without which this one has no margin.
    """

    tag: ClassVar[str] = "condition_holds"
    section: str
    condition: str
    constant: str | None = None
    margin: Constant | None = None
    needed: float | None = None
    allowed: float | None = None
    beyond: bool = False
    blocked_by: str | None = None
    predictor_gain: Fraction | None = None
