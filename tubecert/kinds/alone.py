"""Certificate 0: what the metric does without adaptation. Implements: theory 4a, theorem 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from tubecert.conditions import alone
from tubecert.conditions.alone import NoGains
from tubecert.enclosure.constant import Constant, printable_below
from tubecert.kinds import ALONE
from tubecert.kinds.kind import Kind, Pair, Section, SectionData, margin_data, missing_data


@dataclass(frozen=True, slots=True, kw_only=True)
class AloneData(SectionData):
    """Certificate 0: `margin` of dbar; `distance` is sup D; it holds for every |h| below
    `uncertainty_limit`, h with all that joins it (wind with a rate, what inputs can reach of unknown parameters).
    """

    name = ALONE
    margin: Constant | None
    distance: Constant
    uncertainty_limit: float | None

    def pairs(self, *, asked: bool) -> tuple[Pair, ...]:
        """One row, without gains."""
        del asked
        margins = {} if self.margin is None else {ALONE.key: self.margin}
        return (Pair(role="feedback", bandwidth=None, margins=margins),)


def _data(section: Section[NoGains]) -> AloneData:
    """With how much uncertainty the feedback alone could take in this tube."""
    at, limit = section.decisive, alone.uncertainty_limit(section.problem)
    return AloneData(
        verdict=section.verdict,
        margin=None if at is None else margin_data(at.margins[ALONE.key]),
        distance=margin_data(alone.distance(section.problem)).printable(),
        uncertainty_limit=None if limit is None else printable_below(limit),
        ultimate_radius=section.ultimate_radius,
        shortfalls=missing_data(section.shortfalls),
    )


KIND: Final = Kind(name=ALONE, theorem=alone.THEOREM, form=AloneData, data=_data)
