"""Certificate B: a bound of the Riemannian distance to the plan. Implements: theory 4, theorem B."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.conditions import DistanceProof, Setting, distance_bound, margin, own_distance_proof
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Node
from tubecert.recheck.enclosures import Enclosure, enclosure
from tubecert.recheck.examination import Claim
from tubecert.recheck.kinds import printed
from tubecert.recheck.kinds.bounds import (
    all_of,
    at_least,
    at_most,
    margin_at_least,
    not_shown_to_hold,
    told,
    ultimate,
    words,
)
from tubecert.recheck.kinds.kind import VERDICTS, Asked, Ground, Kind, Section, Shares, Statements
from tubecert.recheck.kinds.parts import Level, Parts, ranges, read_levels
from tubecert.recheck.kinds.printed import GAINS, Around, Point, read_gains
from tubecert.recheck.kinds.window_section import WindowSection, read_windows
from tubecert.recheck.legs import of_distance
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.predictor import Gains
from tubecert.recheck.specified.numbers import Range


@dataclass(frozen=True, slots=True)
class DistancePair:
    """A pair with its margin."""

    gains: Gains
    margin: Enclosure
    ultimate_radius: Fraction | None


@dataclass(frozen=True, slots=True)
class DistanceRecipe:
    """Y, e and S of theorem B at its gains; with `windows`, which wait for `settling`, the largest of them."""

    gains: Gains
    speed: Fraction
    prediction_error: Fraction
    uncertainty: Fraction
    settling: Fraction | None = None
    windows: tuple[Level, ...] = ()

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
    """The pairs of least bandwidth, of least rate, the one asked for; the curve."""

    split: DistancePair | None
    least_adaptation: DistancePair | None
    asked: DistancePair | None
    ultimate_radius: Fraction | None
    curve: tuple[Point, ...]
    around: Around | None
    windows: tuple[WindowSection, ...] = ()

    @property
    def pairs(self) -> dict[str, DistancePair]:
        """By name, the one that the verdict is about first."""
        named = {"asked": self.asked, "least_adaptation": self.least_adaptation, "split": self.split}
        return {name: pair for name, pair in named.items() if pair is not None}


class Distance(Kind[DistanceSection, DistanceRecipe]):
    """Certificate B."""

    key: ClassVar = "distance"
    conditions: ClassVar = ("distance",)
    elastic: ClassVar = True

    def read(self, node: Node, n: int) -> DistanceSection:
        """The section `distance`."""
        del n
        return _section(node)

    def read_recipe(self, node: Node) -> DistanceRecipe:
        """Gains, Y, e and S."""
        own = node.closed(
            *GAINS, "speed", "prediction_error", "uncertainty", optional=("settling", "windows")
        )
        speed, error, uncertainty = (
            own[key].decimal() for key in ("speed", "prediction_error", "uncertainty")
        )
        windows = own.get("windows", read_levels) or ()
        settling = own.get("settling", Node.decimal)
        if bool(windows) != (settling is not None):
            raise node.refused("has windows or settling, and not the other")
        return DistanceRecipe(read_gains(own), speed, error, uncertainty, settling, windows)

    def projection_radii(self, section: DistanceSection) -> Iterator[Fraction]:
        """Those of its pairs."""
        for pair in section.pairs.values():
            yield pair.gains.projection_radius

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
        if section.windows:
            most = _parts(section, recipe, ground).feedback()
            return None if most is None else Shares(most, recipe.gains.projection_radius)
        bound = distance_bound(ground.setting, recipe.gains, recipe.proof)
        if bound is None:
            return None
        feedback = ground.setting.n.feedback_gain * bound.supremum()
        return Shares(feedback, recipe.gains.projection_radius)

    def ranges(self, section: DistanceSection) -> Mapping[str, Range] | None:
        """Those of the windows, if there are any."""
        return ranges(section.windows)

    def claims(
        self, section: DistanceSection, recipe: DistanceRecipe | None, ground: Ground
    ) -> Iterator[Claim]:
        """Every pair with its margin and radius, the curve; or the windows."""
        certified = section.verdict == "certified"
        if section.windows or (recipe is not None and recipe.windows):
            yield from _in_windows(section, recipe, ground)
            return
        for k, (name, pair) in enumerate(section.pairs.items()):
            decides = k == 0
            if name == "asked" and not certified:
                yield ground.claim(
                    "B: what is told of it",
                    (pair,),
                    lambda pair=pair: _told(pair, ground),  # type: ignore[misc]
                )
                continue
            yield _pair_claim(pair, recipe, ground, by_recipe=decides and certified)
            if decides:
                yield ground.claim(
                    "B: ultimate radius",
                    (section, pair),
                    lambda pair=pair: _agreed(section, pair),  # type: ignore[misc]
                )
        setting, R_H, curve, around = (
            ground.setting,
            ground.projection_radius,
            section.curve,
            section.around,
        )
        yield ground.claim(
            "B: the curve is feasible", (curve, R_H), lambda: _curve_holds(curve, R_H, setting)
        )
        if around is not None:
            yield ground.claim(
                "B: margins around", (around, R_H), lambda: _around_holds(around, R_H, setting)
            )


# -- reading


def _section(node: Node) -> DistanceSection:
    keys = ("verdict", "split", "least_adaptation", "asked", "ultimate_radius", "curve", "shortfalls")
    own = node.closed(*keys, optional=("margins_around", "windows"))
    found = DistanceSection(
        verdict=own["verdict"].word(*VERDICTS),
        split=own.known("split", _pair),
        least_adaptation=own.known("least_adaptation", _pair),
        asked=own.known("asked", _pair),
        ultimate_radius=own.known("ultimate_radius", Node.number),
        curve=printed.read_curve(own["curve"]),
        around=own.get("margins_around", lambda item: printed.read_around(item, ("margin",))),
        shortfalls=printed.read_shortfalls(own["shortfalls"]),
        windows=own.get("windows", read_windows) or (),
    )
    if found.windows and (found.curve or found.around or found.split or found.ultimate_radius is not None):
        raise node.refused("has a curve, other gains or a radius in the long run beside windows")
    if not found.pairs and (found.verdict == "certified" or found.curve or found.around):
        raise node.refused("has no pair of gains")
    return found


def _pair(node: Node) -> DistancePair:
    own = node.closed(*GAINS, "margin", "ultimate_radius")
    radius = own.known("ultimate_radius", Node.number)
    return DistancePair(read_gains(own), enclosure(own["margin"]), radius)


# -- claims


def _parts(section: DistanceSection, recipe: DistanceRecipe, ground: Ground) -> Parts:
    settling = recipe.settling or Fraction(0)
    return Parts(
        windows=section.windows,
        ground=ground,
        letter="B",
        levels=recipe.windows,
        speed=recipe.speed,
        radius=recipe.gains.projection_radius,
        theorem=lambda stays: of_distance(stays, recipe.gains, settling),
    )


def _in_windows(section: DistanceSection, recipe: DistanceRecipe | None, ground: Ground) -> Iterator[Claim]:
    """Theorem BW in place of theorem B."""
    pair = next(iter(section.pairs.values()), None)
    if section.verdict != "certified":
        yield ground.claim("B: what is told of it", (section,), lambda: _says_nothing(section, pair))
        return
    if recipe is None or pair is None or recipe.gains != pair.gains or not section.windows:
        told_wrongly = stated(False, "its windows have no recipe, or one for other gains")
        yield ground.claim("B: it has a recipe", (section, recipe), lambda: told_wrongly)
        return
    parts = _parts(section, recipe, ground)
    yield ground.claim("B: S, e and the radius", (section, recipe), lambda: _sizes_hold(parts, recipe, pair))
    yield from parts.claims(pair.margin, (recipe, pair))


def _sizes_hold(parts: Parts, recipe: DistanceRecipe, pair: DistancePair) -> Outcome:
    """S and e of the recipe are at least those of every window; no radius is stated for ever."""
    found = parts.reached()
    if found is None:
        return stated(False, "a condition of the theorem does not hold at the numbers of the recipe")
    outcomes = [stated(pair.ultimate_radius is None, "windows have an end")]
    for own in found:
        outcomes.append(at_most(own.S, recipe.uncertainty, "S in a window"))
        outcomes.append(at_most(own.e, recipe.prediction_error, "e in a window"))
    return all_of(outcomes)


def _says_nothing(section: DistanceSection, pair: DistancePair | None) -> Outcome:
    if any(window.proves for window in section.windows):
        return stated(False, "windows tell of what is not certified")
    return CONFIRMED if pair is None else not_shown_to_hold([pair.margin])


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


def _told(pair: DistancePair, ground: Ground) -> Outcome:
    """Gains that were asked for and are not certified."""
    if not ground.silent:
        return not_shown_to_hold([pair.margin])
    return told(_own_margin(ground.setting, pair.gains), pair.margin, "the distance")


def _agreed(section: DistanceSection, decisive: DistancePair) -> Outcome:
    """The radius in the long run that B prints is that of its pair."""
    own, shown = decisive.ultimate_radius, section.ultimate_radius
    return stated(shown is None or (own is not None and own <= shown), "it is not that of the pair")


def _curve_holds(curve: tuple[Point, ...], R_H: Fraction, setting: Setting) -> Outcome:
    """Every point of the curve is feasible."""
    return all_of(
        stated(
            bool(_own_margin(setting, point.at(R_H)) > 0),
            f"the point at bandwidth {float(point.bandwidth):.6g} is not feasible",
        )
        for point in curve
    )


def _around_holds(around: Around, R_H: Fraction, setting: Setting) -> Outcome:
    """The margins that are printed along the bandwidth."""
    return all_of(
        at_least(
            _own_margin(setting, around.at(k, R_H)),
            below,
            f"the distance at bandwidth {float(around.bandwidths[k]):.6g}",
        )
        for k, below in enumerate(around.margins["margin"])
        if below is not None
    )
