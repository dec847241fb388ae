"""Certificate A: the conditions (26a)-(26c) of the paper, with its slips corrected. Implements: (26a)-(26c)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from tubecert.claims import GainsSuffice
from tubecert.conditions import rates
from tubecert.conditions.predictor import Matrix
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal, RateProposal
from tubecert.conditions.rates import RateRecipe
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked, judge
from tubecert.kinds import RATES
from tubecert.kinds.kind import (
    Json,
    Kind,
    Section,
    around_json,
    gain_json,
    gains_json,
    margin_json,
    shortfall_json,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RatesSection(Section[RateRecipe]):
    """The pair of least bandwidth (or asked for), the pair of least rate, the curve.

    `infimum` is the smallest bandwidth that (26a), (26b) admit; where (26b) binds it is not attained, and the pair has
    the smallest bandwidth that leaves 1 % of (26b). `binds` names the condition that sets the bandwidth.
    """

    name = RATES

    problem: TubeProblem
    infimum: float | None
    binds: str | None

    @property
    def pair(self) -> Checked[RateRecipe] | None:
        """The gains that the verdict is about."""
        return self.decisive

    @property
    def least_adaptation(self) -> Checked[RateRecipe] | None:
        """The gains of least adaptation rate."""
        return self.judgement.beside.get("least_adaptation")

    @property
    def A_m(self) -> Matrix | None:
        """The predictor that the pair belongs to, (n, n)."""
        g = None if self.pair is None else self.pair.recipe.predictor_gain
        if self.problem.A_m is not None or g is None:
            return self.problem.A_m
        n = range(self.problem.states)
        return tuple(tuple(-g if i == j else Fraction(0) for j in n) for i in n)

    @property
    def below_twice_rate(self) -> bool:
        """Whether the bandwidth lies in the window below 2 lambda."""
        return self.pair is not None and self.pair.recipe.bandwidth < 2 * self.problem.rate

    def claim(self) -> GainsSuffice:
        """That the gains suffice, and which condition sets the bandwidth."""
        return replace(Section.claim(self), binds=self.binds, below_twice_rate=self.below_twice_rate)

    def to_json(self) -> Json:
        """The section `conditions_26` of the certificate."""
        A_m, pair, least = self.A_m, self.pair, self.least_adaptation
        at = None if pair is None else _pair_json(pair)
        n = range(0 if A_m is None else len(A_m))
        data: Json = {
            "verdict": str(self.verdict),
            "bandwidth": at and at["bandwidth"],
            "adaptation_rate": at and at["adaptation_rate"],
            "A_m": None if A_m is None else [[gain_json(x) for x in row] for row in A_m],
            "P": None if A_m is None else [[float(i == j) for j in n] for i in n],
            # the Lyapunov equation with P = I
            "Q": None if A_m is None else [[gain_json(-(A_m[i][j] + A_m[j][i])) for j in n] for i in n],
            "projection_radius": at and at["projection_radius"],
            "margins": at and at["margins"],
            "ultimate_radius": self.judgement.ultimate_radius,
            "least_adaptation": None if least is None else _pair_json(least),
            "curve": [gains_json(r, "bandwidth", "adaptation_rate", "predictor_gain") for r in self.curve],
            "bandwidth_infimum": self.infimum,
            "binds": self.binds,
            "below_twice_rate": self.below_twice_rate,
            "shortfalls": [shortfall_json(item) for item in self.shortfalls],
        }
        return data | {"margins_around": around_json(self.judgement)} if self.judgement.around_at else data


def _pair_json(pair: Checked[RateRecipe]) -> Json:
    names = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")
    return {
        **gains_json(pair.recipe, *names),
        "margins": {claim: margin_json(margin) for claim, margin in pair.margins.items()},
    }


class Rates(Kind[RateRecipe]):
    """Certificate A."""

    name = RATES
    theorem = rates.THEOREM

    def section(self, problem: TubeProblem, proposal: Proposal[RateRecipe]) -> RatesSection:
        """The section about a proposal."""
        met = proposal if isinstance(proposal, RateProposal) else RateProposal()
        judgement = judge(problem, self.theorem, proposal)
        return RatesSection(judgement=judgement, problem=problem, infimum=met.infimum, binds=met.binds)

    def derived(self, section: Section[RateRecipe]) -> Mapping[str, Constant]:
        """The derived constants of (26a)-(26c) at the pair."""
        if not isinstance(section, RatesSection) or section.pair is None:
            return {}
        return rates.derived_constants(section.problem, section.pair.recipe)
