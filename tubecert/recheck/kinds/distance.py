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
from tubecert.recheck.cover import Claim, Outcome, in_turn, stated
from tubecert.recheck.document import Enclosure, Node, enclosure, maybe, nullable, reads
from tubecert.recheck.kinds.kind import (
    Asked,
    Ground,
    Kind,
    Section,
    Shares,
    Statements,
    margin_at_least,
    no_radius,
    not_shown_to_hold,
    told,
    ultimate,
    words,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DistancePair(Gains):
    """A pair with its margin."""

    margin: Enclosure = reads(enclosure)
    ultimate_radius: Fraction | None = reads(maybe)


_PAIR = nullable(lambda node: node.record(DistancePair))


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceRecipe(Gains):
    """Y, e and S of theorem B at its gains."""

    speed: Fraction = reads(Node.decimal)
    prediction_error: Fraction = reads(Node.decimal)
    uncertainty: Fraction = reads(Node.decimal)

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

    split: DistancePair | None = reads(_PAIR)
    least_adaptation: DistancePair | None = reads(_PAIR)
    asked: DistancePair | None = reads(_PAIR)
    ultimate_radius: Fraction | None = reads(maybe)

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
        found = node.record(DistanceSection)
        if not found.pairs and found.verdict == "certified":
            raise node.refused("has no pair of gains")
        return found

    def read_recipe(self, node: Node) -> DistanceRecipe:
        """Gains, Y, e and S."""
        return node.record(DistanceRecipe)

    def asked(self, section: DistanceSection, given: Asked) -> Statements:
        """There is a pair that was asked for if gains were, and it has them."""
        own = section.asked
        for name, wanted in given.items():
            same = wanted is None or own is None or getattr(own, name) == wanted
            yield same, f"overrides.{name} is not what {self.key} judges"
        anything = any(wanted is not None for wanted in given.values())
        yield own is None or anything, "distance.asked was not asked for"
        other = anything and own is None and section.verdict == "certified"
        yield not other, "distance is certified for gains that were not asked for"

    def said(self, section: DistanceSection) -> dict[str, object]:
        """The margin."""
        pair = next(iter(section.pairs.values()), None)
        return {} if pair is None else {"margins": {self.key: pair.margin.below}}

    def shares(self, section: DistanceSection, recipe: DistanceRecipe, ground: Ground) -> Shares | None:
        """The feedback acts within sup D of theorem B."""
        del section
        bound = distance_bound(ground.setting, recipe, recipe.proof)
        if bound is None:
            return None
        feedback = ground.setting.n.feedback_gain * bound.supremum()
        return feedback, recipe.projection_radius

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


def _pair_claim(
    pair: DistancePair, recipe: DistanceRecipe | None, ground: Ground, *, by_recipe: bool
) -> Claim:
    """Theorem B at a pair: by the recipe, which must be for these gains, or by a proof that is found here."""
    setting = ground.setting

    def examined() -> Outcome:
        if not by_recipe:
            return _pair_holds(pair, setting, own_distance_proof(setting, pair))
        if recipe is None:
            return stated(False, "it has no recipe")
        if not recipe.same(pair):
            return stated(False, "the recipe is for other gains")
        return _pair_holds(pair, setting, recipe.proof)

    parts = (pair, recipe if by_recipe else None, by_recipe)
    return ground.claim(f"B: sup D < dbar at {words(pair)}", parts, examined)


def _pair_holds(pair: DistancePair, setting: Setting, proof: DistanceProof) -> Outcome:
    found = margin_at_least(_margin(setting, pair, proof), pair.margin, "the distance")
    radius = pair.ultimate_radius
    return ultimate(radius, setting, pair, proof) if found.holds and radius is not None else found


def _margin(setting: Setting, at: Gains, proof: DistanceProof) -> Ball:
    bound = distance_bound(setting, at, proof)
    return arb("nan") if bound is None else margin(setting, bound.supremum())


def _own_margin(setting: Setting, at: Gains) -> Ball:
    return _margin(setting, at, own_distance_proof(setting, at)) if at.sensible else arb("nan")


def _told(pair: DistancePair, setting: Setting) -> Outcome:
    """Gains that were asked for and are not certified: their margin is true and not positive."""
    if pair.ultimate_radius is not None:
        return no_radius()
    true = told(_own_margin(setting, pair), pair.margin, "the distance")
    return in_turn((true, not_shown_to_hold([pair.margin])))


def _agreed(section: DistanceSection, radius: Fraction) -> Outcome:
    """The radius in the long run that B prints is that of the pair that the verdict is about."""
    if section.verdict != "certified":
        return no_radius()
    own = next(iter(section.pairs.values())).ultimate_radius
    return stated(own is not None and own <= radius, "it is not that of the pair")
