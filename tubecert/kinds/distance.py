"""Certificate B: a sharper bound of the Riemannian distance to the plan. Implements: theory 4, theorem B."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.conditions import distance
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.kernel import Checked, judge
from tubecert.kinds import DISTANCE
from tubecert.kinds.kind import Json, Kind, Section, around_json, gains_json, margin_json, shortfall_json


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceSection(Section[DistanceRecipe]):
    """The pair of least bandwidth, the pair of least rate, the pair asked for (which then decides), the curve."""

    name = DISTANCE

    def at(self, role: str) -> Checked[DistanceRecipe] | None:
        """The gains in a role."""
        return self.decisive if role == self.judgement.role else self.judgement.beside.get(role)

    @property
    def split(self) -> Checked[DistanceRecipe] | None:
        """The gains of least bandwidth."""
        return self.at("split")

    @property
    def least_adaptation(self) -> Checked[DistanceRecipe] | None:
        """The gains of least adaptation rate."""
        return self.at("least_adaptation")

    @property
    def asked(self) -> Checked[DistanceRecipe] | None:
        """The gains asked for."""
        return self.at("asked")

    def to_json(self) -> Json:
        """The section `distance` of the certificate."""
        data: Json = {
            "verdict": str(self.verdict),
            **{role: _pair_json(self.at(role)) for role in ("split", "least_adaptation", "asked")},
            "ultimate_radius": self.judgement.ultimate_radius,
            "curve": [gains_json(r, "bandwidth", "adaptation_rate", "predictor_gain") for r in self.curve],
            "shortfalls": [shortfall_json(item) for item in self.shortfalls],
        }
        if not self.judgement.around_at:
            return data
        around = around_json(self.judgement)
        around["margin"] = around.pop("distance")
        return data | {"margins_around": around}


def _pair_json(pair: Checked[DistanceRecipe] | None) -> Json | None:
    if pair is None:
        return None
    names = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")
    return {
        **gains_json(pair.recipe, *names),
        "margin": margin_json(pair.margins["distance"]),
        "ultimate_radius": pair.ultimate_radius,
    }


class Distance(Kind[DistanceRecipe]):
    """Certificate B."""

    name = DISTANCE
    theorem = distance.THEOREM

    def section(self, problem: TubeProblem, proposal: Proposal[DistanceRecipe]) -> DistanceSection:
        """The section about a proposal."""
        return DistanceSection(judgement=judge(problem, self.theorem, proposal))
