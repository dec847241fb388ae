"""Certificate 0: what the metric does without adaptation. Implements: theory 4a, theorem 0."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.conditions import alone
from tubecert.conditions.alone import NoGains
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.enclosure.constant import Constant, printable_below
from tubecert.kernel import judge
from tubecert.kinds import ALONE
from tubecert.kinds.data import Pair, SectionData, margin_data, missing_data
from tubecert.kinds.kind import Kind, Section


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

    def points(self) -> tuple[tuple[float, float], ...]:
        """There is nothing to choose, and no curve."""
        return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class AloneSection(Section[NoGains]):
    """The verdict, and how much uncertainty the feedback alone could take in this tube."""

    name = ALONE

    distance: Constant
    uncertainty_limit: float | None

    def data(self) -> AloneData:
        """The section `no_adaptation` of the certificate."""
        return AloneData(
            verdict=self.verdict,
            margin=None if self.decisive is None else margin_data(self.decisive.margins[ALONE.key]),
            distance=self.distance,
            uncertainty_limit=self.uncertainty_limit,
            ultimate_radius=self.judgement.ultimate_radius,
            shortfalls=missing_data(self.shortfalls),
        )


class Alone(Kind[NoGains]):
    """Certificate 0."""

    name = ALONE
    theorem = alone.THEOREM
    form = AloneData

    def section(self, problem: TubeProblem, proposal: Proposal[NoGains]) -> AloneSection:
        """The section; the proposal is always the same."""
        limit = alone.uncertainty_limit(problem)
        return AloneSection(
            judgement=judge(problem, self.theorem, proposal),
            distance=margin_data(alone.distance(problem)).printable(),
            uncertainty_limit=None if limit is None else printable_below(limit),
        )
