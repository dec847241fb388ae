"""Certificate A: the corrected conditions (26a)-(26c) at printed gains. Implements: (26a)-(26c)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import ClassVar

from tubecert.recheck.conditions import Gains, Setting, derived, margins_26, own_distance_proof
from tubecert.recheck.cover import Claim, Outcome, in_turn, stated
from tubecert.recheck.document import Enclosure, Node, enclosure, maybe, nullable, reads
from tubecert.recheck.kinds.kind import (
    Asked,
    Ground,
    Kind,
    Section,
    Shares,
    Statements,
    at_most,
    margin_at_least,
    no_radius,
    not_shown_to_hold,
    told,
    ultimate,
    words,
)

CONDITIONS = ("26a", "26b", "26c")
DERIVED = (
    "speed", "uncertainty_rate", "prediction_error", "filter_error", "theta", "Psi_x", "geodesic_rate", "Psi_rate",
    "zeta_1", "zeta_2", "zeta_3",
)  # fmt: skip

Margins = dict[str, Enclosure]


def _margins(node: Node) -> Margins:
    own = node.closed(*CONDITIONS)
    return {claim: enclosure(own[claim]) for claim in CONDITIONS}


@dataclass(frozen=True, slots=True, kw_only=True)
class RatePair(Gains):
    """A pair with its margins."""

    margins: Margins = reads(_margins)


@dataclass(frozen=True, slots=True, kw_only=True)
class RateSection(Section):
    """The pair that the verdict is about, that of least rate."""

    pair: RatePair | None
    ultimate_radius: Fraction | None = reads(maybe)
    least_adaptation: RatePair | None = reads(nullable(lambda node: node.record(RatePair)))


class Rates(Kind[RateSection, Gains]):
    """Certificate A."""

    key: ClassVar = "conditions_26"
    conditions: ClassVar = CONDITIONS

    def read(self, node: Node) -> RateSection:
        """The section `conditions_26`."""
        return _section(node)

    def read_recipe(self, node: Node) -> Gains:
        """The gains: nothing else is needed."""
        return node.record(Gains)

    def derived(self, node: Node) -> tuple[str, ...]:
        """What follows from gains, where there are any."""
        return DERIVED if node.mapping().get("bandwidth") is not None else ()

    def uncovered(self, setting: Setting) -> str | None:
        """A disturbance of any kind."""
        return None if setting.still else "wind_not_covered"

    def asked(self, section: RateSection, given: Asked) -> Statements:
        """The pair is the one asked for."""
        for name, wanted in given.items():
            same = wanted is None or section.pair is None or getattr(section.pair, name) == wanted
            yield same, f"overrides.{name} is not what {self.key} judges"

    def said(self, section: RateSection) -> dict[str, object]:
        """Margins."""
        if section.pair is None:
            return {}
        return {"margins": {claim: margin.below for claim, margin in section.pair.margins.items()}}

    def shares(self, section: RateSection, recipe: Gains, ground: Ground) -> Shares:
        """Of the distance theorem A says that it stays below dbar."""
        del section
        setting = ground.setting
        return setting.n.feedback_gain * setting.reach, recipe.projection_radius

    def claims(self, section: RateSection, recipe: Gains | None, ground: Ground) -> Iterator[Claim]:
        """Constants, margins, radius."""
        if section.pair is not None:
            yield from _of_pair(section, section.pair, recipe, ground)
        setting, least, radius = ground.setting, section.least_adaptation, section.ultimate_radius
        if radius is not None:
            yield ground.claim(
                "A: ultimate radius", (section,), lambda: _radius_holds(section, radius, setting)
            )
        if least is not None:
            name = f"A: (26a)-(26c) at {words(least)}"
            yield ground.claim(name, (least,), lambda: _margins_hold(least, setting))


# -- reading


def _section(node: Node) -> RateSection:
    """The gains that the verdict is about stand in the section itself, all of them or none."""
    beside, gains = ("verdict", "ultimate_radius", "least_adaptation", "shortfalls"), fields(RatePair)
    own = node.closed(*beside, *(item.name for item in gains))
    present = [own[item.name].value is not None for item in gains]
    section = RateSection(
        pair=node.without(*beside).record(RatePair) if all(present) else None,
        **{
            item.name: item.metadata["reads"](own[item.name]) for item in fields(RateSection) if item.metadata
        },
    )
    if any(present) != all(present) or (section.verdict == "certified" and not all(present)):
        raise node.refused("has a part of its gains only")
    return section


# -- claims


def _of_pair(section: RateSection, pair: RatePair, recipe: Gains | None, ground: Ground) -> Iterator[Claim]:
    """What is claimed of the gains that the verdict is about."""
    setting, at = ground.setting, pair
    shown = {name: ground.constants[name] for name in DERIVED}
    yield ground.claim("A: derived constants", (at, shown), lambda: _derived_hold(shown, setting, at))
    if section.verdict == "certified":
        yield ground.claim(f"A: (26a)-(26c) at {words(at)}", (pair,), lambda: _margins_hold(pair, setting))
        yield ground.claim(
            "A: its recipe",
            (pair, recipe),
            lambda: stated(recipe is not None and at.same(recipe), "it is for other gains"),
        )
    else:
        name = "A: its margins without a disturbance" if ground.silent else "A: what is told of it"
        yield ground.claim(name, (pair,), lambda: _told(pair, ground))


def _margins_hold(pair: RatePair, setting: Setting) -> Outcome:
    """(26a)-(26c) hold with the margins printed."""
    found = margins_26(setting, pair)
    return in_turn(margin_at_least(found[claim], pair.margins[claim], f"({claim})") for claim in found)


def _told(pair: RatePair, ground: Ground) -> Outcome:
    """The margins printed of what is not certified: each is true, and not all are positive but for a disturbance."""
    found = margins_26(ground.setting, pair)
    true = in_turn(told(found[claim], pair.margins[claim], f"({claim})") for claim in found)
    return true if ground.silent else in_turn((true, not_shown_to_hold(pair.margins.values())))


def _radius_holds(section: RateSection, radius: Fraction, setting: Setting) -> Outcome:
    """The radius in the long run, by theorem B at the same gains."""
    if section.pair is None or section.verdict != "certified":
        return no_radius()
    at = section.pair
    return ultimate(radius, setting, at, own_distance_proof(setting, at))


def _derived_hold(constants: dict[str, Enclosure], setting: Setting, at: Gains) -> Outcome:
    """The derived constants at these gains; one without a bound claims nothing."""
    found = derived(setting, at)
    tops = {name: top for name in found if (top := constants[name].above) is not None}
    return in_turn(at_most(found[name], top, name) for name, top in tops.items())
