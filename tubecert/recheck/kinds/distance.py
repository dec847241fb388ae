"""Certificate B: a bound of the Riemannian distance to the plan. Implements: theory 4, theorem B."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.conditions import (
    DistanceProof,
    Gains,
    Setting,
    distance_bound,
    margin,
    own_distance_proof,
)
from tubecert.recheck.cover import Outcome, stated
from tubecert.recheck.document import Enclosure, Node, enclosure
from tubecert.recheck.examination import Claim
from tubecert.recheck.kinds.bounds import (
    all_of,
    margin_at_least,
    no_radius,
    not_shown_to_hold,
    told,
    ultimate,
    words,
)
from tubecert.recheck.kinds.kind import (
    GAINS,
    VERDICTS,
    Asked,
    Ground,
    Kind,
    Section,
    Shares,
    Statements,
    read_gains,
    read_shortfalls,
)


@dataclass(frozen=True, slots=True)
class DistancePair:
    """A pair with its margin."""

    gains: Gains
    margin: Enclosure
    ultimate_radius: Fraction | None


@dataclass(frozen=True, slots=True)
class DistanceRecipe:
    """Y, e and S of theorem B at its gains."""

    gains: Gains
    speed: Fraction
    prediction_error: Fraction
    uncertainty: Fraction

    @property
    def proof(self) -> DistanceProof:
        """As balls."""
        return DistanceProof(
            speed=exact(self.speed),
            prediction_error=exact(self.prediction_error),
            uncertainty=exact(self.uncertainty),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceSection(Section):
    """The pairs of least bandwidth, of least rate, the one asked for."""

    split: DistancePair | None
    least_adaptation: DistancePair | None
    asked: DistancePair | None
    ultimate_radius: Fraction | None

    @property
    def pairs(self) -> dict[str, DistancePair]:
        """By name, the one that the verdict is about first."""
        named = {"asked": self.asked, "least_adaptation": self.least_adaptation, "split": self.split}
        return {name: pair for name, pair in named.items() if pair is not None}


class Distance(Kind[DistanceSection, DistanceRecipe]):
    """Certificate B."""

    key: ClassVar = "distance"
    conditions: ClassVar = ("distance",)

    def read(self, node: Node) -> DistanceSection:
        """The section `distance`."""
        return _section(node)

    def read_recipe(self, node: Node) -> DistanceRecipe:
        """Gains, Y, e and S."""
        own = node.closed(*GAINS, "speed", "prediction_error", "uncertainty")
        speed, error, uncertainty = (
            own[key].decimal() for key in ("speed", "prediction_error", "uncertainty")
        )
        return DistanceRecipe(read_gains(own), speed, error, uncertainty)

    def asked(self, section: DistanceSection, given: Asked) -> Statements:
        """There is a pair that was asked for if gains were, and it has them."""
        own = section.asked
        for name in ("bandwidth", "adaptation_rate"):
            wanted: Fraction | None = getattr(given, name)
            same = wanted is None or own is None or getattr(own.gains, name) == wanted
            yield same, f"overrides.{name} is not what {self.key} judges"
        yield own is None or given.anything, "distance.asked was not asked for"
        other = given.anything and own is None and section.verdict == "certified"
        yield not other, "distance is certified for gains that were not asked for"

    def said(self, section: DistanceSection) -> dict[str, object]:
        """The margin."""
        pair = next(iter(section.pairs.values()), None)
        return {} if pair is None else {"margins": {self.key: pair.margin.below}}

    def shares(self, section: DistanceSection, recipe: DistanceRecipe, ground: Ground) -> Shares | None:
        """The feedback acts within sup D of theorem B."""
        del section
        bound = distance_bound(ground.setting, recipe.gains, recipe.proof)
        if bound is None:
            return None
        feedback = ground.setting.n.feedback_gain * bound.supremum()
        return Shares(feedback, recipe.gains.projection_radius)

    def claims(
        self, section: DistanceSection, recipe: DistanceRecipe | None, ground: Ground
    ) -> Iterator[Claim]:
        """Every pair with its margin and radius."""
        certified = section.verdict == "certified"
        for k, (name, pair) in enumerate(section.pairs.items()):
            if name == "asked" and not certified:
                yield ground.claim(
                    "B: what is told of it",
                    (pair,),
                    lambda pair=pair: _told(pair, ground.setting),  # type: ignore[misc]
                )
            else:
                yield _pair_claim(pair, recipe, ground, by_recipe=k == 0 and certified)
        radius = section.ultimate_radius
        if radius is not None:
            yield ground.claim("B: ultimate radius", (section,), lambda: _agreed(section, radius))


# -- reading


def _section(node: Node) -> DistanceSection:
    keys = ("verdict", "split", "least_adaptation", "asked", "ultimate_radius", "shortfalls")
    own = node.closed(*keys)
    found = DistanceSection(
        verdict=own["verdict"].word(*VERDICTS),
        split=own.known("split", _pair),
        least_adaptation=own.known("least_adaptation", _pair),
        asked=own.known("asked", _pair),
        ultimate_radius=own.known("ultimate_radius", Node.number),
        shortfalls=read_shortfalls(own["shortfalls"]),
    )
    if not found.pairs and found.verdict == "certified":
        raise node.refused("has no pair of gains")
    return found


def _pair(node: Node) -> DistancePair:
    own = node.closed(*GAINS, "margin", "ultimate_radius")
    radius = own.known("ultimate_radius", Node.number)
    return DistancePair(read_gains(own), enclosure(own["margin"]), radius)


# -- claims


def _pair_claim(
    pair: DistancePair, recipe: DistanceRecipe | None, ground: Ground, *, by_recipe: bool
) -> Claim:
    """Theorem B at a pair: by the recipe, which must be for these gains, or by a proof that is found here."""
    setting = ground.setting

    def examined() -> Outcome:
        if not by_recipe:
            return _pair_holds(pair, setting, own_distance_proof(setting, pair.gains))
        if recipe is None:
            return stated(False, "it has no recipe")
        if recipe.gains != pair.gains:
            return stated(False, "the recipe is for other gains")
        return _pair_holds(pair, setting, recipe.proof)

    parts = (pair, recipe if by_recipe else None, by_recipe)
    return ground.claim(f"B: sup D < dbar at {words(pair.gains)}", parts, examined)


def _pair_holds(pair: DistancePair, setting: Setting, proof: DistanceProof) -> Outcome:
    found = margin_at_least(_margin(setting, pair.gains, proof), pair.margin, "the distance")
    radius = pair.ultimate_radius
    return ultimate(radius, setting, pair.gains, proof) if found.holds and radius is not None else found


def _margin(setting: Setting, at: Gains, proof: DistanceProof) -> Ball:
    bound = distance_bound(setting, at, proof)
    return arb("nan") if bound is None else margin(setting, bound.supremum())


def _own_margin(setting: Setting, at: Gains) -> Ball:
    return _margin(setting, at, own_distance_proof(setting, at)) if at.sensible else arb("nan")


def _told(pair: DistancePair, setting: Setting) -> Outcome:
    """Gains that were asked for and are not certified: their margin is true and not positive."""
    if pair.ultimate_radius is not None:
        return no_radius()
    true = told(_own_margin(setting, pair.gains), pair.margin, "the distance")
    return all_of((true, not_shown_to_hold([pair.margin])))


def _agreed(section: DistanceSection, radius: Fraction) -> Outcome:
    """The radius in the long run that B prints is that of the pair that the verdict is about."""
    if section.verdict != "certified":
        return no_radius()
    own = next(iter(section.pairs.values())).ultimate_radius
    return stated(own is not None and own <= radius, "it is not that of the pair")
