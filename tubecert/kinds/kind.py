"""What a kind of certificate has to offer, and what all their sections have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from typing import ClassVar, Generic

from tubecert.claims import GainsSuffice
from tubecert.conditions.decimals import printed
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.conditions.theorem import R, Recipe, Theorem
from tubecert.conditions.verdict import Shortfall, Verdict
from tubecert.enclosure.constant import Constant, printable_below
from tubecert.enclosure.interval import Interval
from tubecert.kernel import Checked, Judgement, Proof
from tubecert.kinds import Name

Json = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section(ABC, Generic[R]):
    """What the kernel decided about one kind, as a section of the certificate."""

    name: ClassVar[Name]
    judgement: Judgement[R]

    @property
    def verdict(self) -> Verdict:
        """On the gains of this kind."""
        return self.judgement.verdict

    @property
    def decisive(self) -> Checked[R] | None:
        """The gains that the verdict is about, with their margins."""
        return self.judgement.decisive

    @property
    def proof(self) -> Proof[R] | None:
        """What a verdict `certified` rests on."""
        return self.judgement.proof

    @property
    def shortfalls(self) -> tuple[Shortfall, ...]:
        """What is missing."""
        return self.judgement.shortfalls

    @property
    def curve(self) -> tuple[R, ...]:
        """Proven gains along the bandwidth."""
        return self.judgement.curve

    def claim(self) -> GainsSuffice:
        """That the decisive gains suffice, with what is proven to be left."""
        margins = {} if self.decisive is None else self.decisive.margins
        return GainsSuffice(
            section=self.name.key, margins={condition: float(m.lo) for condition, m in margins.items()}
        )

    @abstractmethod
    def to_json(self) -> Json:
        """The section, as the certificate holds it."""


class Kind(ABC, Generic[R]):
    """One kind of certificate."""

    name: ClassVar[Name]
    theorem: Theorem[R]

    @property
    def key(self) -> str:
        """The name of its section in a certificate."""
        return self.name.key

    @abstractmethod
    def section(self, problem: TubeProblem, proposal: Proposal[R]) -> Section[R]:
        """The section about what a search proposes."""

    def derived(self, section: Section[R]) -> Mapping[str, Constant]:
        """Constants at the decisive gains that the certificate lists beside those of the tube."""
        del section
        return {}


# -- numbers as JSON


def finite(value: float) -> float | None:
    """A number for JSON: None where it is infinite or unknown."""
    return float(value) if isfinite(value) and abs(value) < 1e300 else None


def margin_json(margin: Interval) -> list[float | None]:
    """[below, above]; null where there is no bound."""
    return [finite(float(margin.lo)), finite(float(margin.hi))]


def gain_json(value: Fraction | None) -> float | str | None:
    """An exact gain."""
    return None if value is None else printed(value)


def shortfall_json(item: Shortfall) -> Json:
    """One reason as data."""
    return {
        "condition": item.claim,
        **({} if item.constant is None else {"constant": item.constant}),
        "margin": margin_json(item.margin),
        "allowed": item.allowed,
        "needed": item.needed,
        "missing": item.missing,
    }


def recipe_json(recipe: Recipe) -> Json:
    """Every number of a proof as a decimal."""
    return {name: gain_json(getattr(recipe, name)) for name in recipe.__slots__}  # type: ignore[attr-defined]


def gains_json(recipe: Recipe, *names: str) -> Json:
    """Some numbers of a recipe as decimals."""
    return {name: gain_json(getattr(recipe, name)) for name in names}


def around_json(judgement: Judgement[R]) -> Json:
    """Margins against the bandwidth, at the rate and the predictor of the decisive gains; bounds from below."""
    recipes = judgement.around_at
    margins = {
        claim: [printable_below(float(value)) if isfinite(value) else None for value in low]
        for claim, low in judgement.around.items()
    }
    return {
        "bandwidth": [gain_json(recipe.bandwidth) for recipe in recipes],
        **gains_json(recipes[0], "adaptation_rate", "predictor_gain"),
        **margins,
    }
