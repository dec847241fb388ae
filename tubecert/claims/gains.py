"""Claims about gains: they suffice, or a condition of a section is not proven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import inf

from tubecert.claims.bounds import unbounded
from tubecert.claims.conditions import SAYS, SECTIONS, condition_name, equation
from tubecert.claims.family import Claim, Reason
from tubecert.digits import near
from tubecert.enclosure.constant import Constant

_OF_PREDICTOR = ("26c", "distance")  # conditions that another predictor may satisfy
_WITHOUT_MARGIN = ("wind_not_covered", "gain_not_covered", "proven_gains", "any_gains")


@dataclass(frozen=True, slots=True, kw_only=True)
class GainsSuffice(Claim):
    """The gains of a section satisfy its conditions; `margins` are what is proven to be left of each.

    `binds` sets the bandwidth, if one does; `predictor_gain` g where the predictor is -g I by choice of the search.
    """

    section: str
    margins: Mapping[str, float]
    binds: str | None = None
    predictor_gain: Fraction | None = None

    def _title(self) -> str:
        return SECTIONS.get(self.section, self.section)

    def _why(self, reason: Reason) -> str:
        if len(self.margins) == 1:
            (margin,) = self.margins.values()
            predictor = "" if self.predictor_gain is None else f", with A_m = -{near(self.predictor_gain)} I"
            return f"proven margin {near(margin, 2)} of dbar{predictor}"
        margins = ", ".join(f"{name} {near(margin, 2)}" for name, margin in sorted(self.margins.items()))
        binds = "" if self.binds is None else f"{equation(self.binds)} sets the bandwidth; "
        more = "; where (26b) binds the rate grows without bound, so 1 % of it is left"
        return f"{binds}proven margins: {margins}{more if self.binds == '26b' else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionHolds(Claim):
    """A condition of a section that is not proven, by `margin`, or by what is `needed` and `allowed`.

    `condition` is one of the section's own (26a, 26b, 26c, distance), or what no gains can help:
    `initial_distance` (d0 < dbar), `plan_defect` (delta/lambda < dbar), `parameters` and `wind` (the same with what
    they add), `wind_not_covered` (the theorem knows no wind), `gain_not_covered` (it knows no uncertain B), `bounded`
    (the constant `constant` is); or `any_gains`: none were found; or `proven_gains`: of those none could be proven.
    `beyond`: the margin is below all floats; `blocked_by` names a condition without which this one has no margin.
    """

    section: str
    condition: str
    constant: str | None = None
    margin: Constant | None = None
    needed: float | None = None
    allowed: float | None = None
    beyond: bool = False
    blocked_by: str | None = None
    predictor_gain: Fraction | None = None

    def _title(self) -> str:
        section = SECTIONS.get(self.section, self.section)
        if self.condition == self.section:
            return section
        if self.condition.startswith("26"):
            return f"A {equation(self.condition)}"
        if self.condition == "bounded":
            return f"{section}, unbounded: {self.constant}"
        return f"{section}, {condition_name(self.condition)}"

    def _why(self, reason: Reason) -> str:
        if self.condition == "bounded":
            return unbounded(self.constant or "")
        said = SAYS[self.condition]
        if self.needed is not None and self.allowed is not None:
            return f"{said}: {near(self.needed, 4)} is needed, {near(self.allowed, 4)} is allowed"
        if self.condition in _WITHOUT_MARGIN:
            return said
        chosen = self.predictor_gain is not None and self.condition in _OF_PREDICTOR
        predictor = f" (with A_m = -{near(self.predictor_gain or 0)} I)" if chosen else ""
        return f"{said}: {self._missed()}{predictor}"

    def _missed(self) -> str:
        """By how much: a margin m is what is left of what is allowed, so 1 - m of it is needed."""
        if self.blocked_by is not None:
            return f"no adaptation rate can, where {equation(self.blocked_by)} fails"
        if self.beyond:
            return "it fails by more than can be computed"
        low, high = (-inf, inf) if self.margin is None else (self.margin.below, self.margin.above)
        least, most = (f"{near(1 - side, 3)} times" for side in (high, low))
        if low == -inf:
            unknown = "how much it needs could not be bounded"
            return unknown if high == inf else f"{unknown}; it is at least {least} what is allowed"
        if high == inf:
            return f"it needs up to {most} what is allowed"
        return f"it needs {most if least == most else f'{least} to {most}'} what is allowed"
