"""Certificate 0: the feedback alone, without adaptation. Implements: theory 4a, theorem 0."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.conditions import Setting, margin
from tubecert.recheck.cover import Claim, Outcome, in_turn, stated
from tubecert.recheck.document import Enclosure, Node, enclosure, maybe, nullable, reads
from tubecert.recheck.kinds.kind import (
    Ground,
    Kind,
    Section,
    Shares,
    at_least,
    at_most,
    margin_at_least,
    no_radius,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AloneSection(Section):
    """The margin of dbar; an enclosure of sup D; below which |h| the theorem holds."""

    margin: Enclosure | None = reads(nullable(enclosure))
    distance: Enclosure = reads(enclosure)
    uncertainty_limit: Fraction | None = reads(maybe)
    ultimate_radius: Fraction | None = reads(maybe)


NoGains = tuple[()]  # there is nothing to choose


class Alone(Kind[AloneSection, NoGains]):
    """Certificate 0."""

    key: ClassVar = "no_adaptation"
    conditions: ClassVar = ("no_adaptation",)
    adapts: ClassVar = False

    def read(self, node: Node) -> AloneSection:
        """The section `no_adaptation`."""
        found = node.record(AloneSection)
        if found.verdict == "certified" and found.margin is None:
            raise node.refused("is certified without a margin")
        return found

    def read_recipe(self, node: Node) -> NoGains:
        """Nothing."""
        node.closed()
        return ()

    def said(self, section: AloneSection) -> dict[str, object]:
        """The margin."""
        return {} if section.margin is None else {"margins": {self.key: section.margin.below}}

    def shares(self, section: AloneSection, recipe: NoGains, ground: Ground) -> Shares:
        """The feedback acts within sup D; nothing adapts."""
        del section, recipe
        n = ground.setting.n
        return n.feedback_gain * supremum(ground.setting, n.h), Fraction(0)

    def claims(self, section: AloneSection, recipe: NoGains | None, ground: Ground) -> Iterator[Claim]:
        """The margin if it is certified; the bound of the distance and the largest uncertainty in any case."""
        setting, top, limit = ground.setting, section.distance.above, section.uncertainty_limit
        if section.verdict == "certified":
            yield ground.claim(
                "0: sup D < dbar without adaptation",
                (section, recipe),
                lambda: _holds(section, recipe, setting),
            )
        else:
            yield ground.claim("0: what is told of it", (section,), lambda: _told(section, setting))
        if top is not None:
            yield ground.claim(
                f"0: sup D <= {float(top):.6g} without adaptation", (top,), lambda: _reaches(top, ground)
            )
        if limit is not None:
            yield ground.claim(
                f"0: without adaptation for |h| < {float(limit):.6g}",
                (limit,),
                lambda: _serves(limit, setting),
            )


def settled(setting: Setting, h: Ball) -> Ball:
    """A1 of (4.0) for |h| <= h."""
    n = setting.n
    return (n.metric_input_gain * h + setting.pushed) / setting.rate


def supremum(setting: Setting, h: Ball) -> Ball:
    """sup D of (4.0) over the horizon: at one of its ends."""
    return setting.n.initial_distance.max(_at_the_end(setting, h))


def _at_the_end(setting: Setting, h: Ball) -> Ball:
    """(4.0) at the horizon, or A1."""
    d0, A1 = setting.n.initial_distance, settled(setting, h)
    if setting.horizon is None:
        return A1
    left = (-setting.rate * setting.horizon).exp()
    return d0 * left + A1 * (1 - left)


def _reaches(top: Fraction, ground: Ground) -> Outcome:
    """sup D is at most this: d0, which may be the very same decimal, exactly; the end as a ball."""
    d0 = ground.constants["initial_distance"].above
    started = stated(d0 is not None and d0 <= top, "it is less than d0")
    end = _at_the_end(ground.setting, ground.setting.n.h)
    return in_turn((started, at_most(end, top, "sup D without adaptation")))


def _holds(section: AloneSection, recipe: NoGains | None, setting: Setting) -> Outcome:
    """Theorem 0 with the margin and the radius printed."""
    shown, radius = section.margin, section.ultimate_radius
    if recipe is None or shown is None:
        return stated(False, "it has no recipe")
    own = margin_at_least(
        margin(setting, supremum(setting, setting.n.h)), shown, "the distance without adaptation"
    )
    if radius is None:
        return own
    last = settled(setting, setting.n.h) / root(setting.n.lower)
    return in_turn((own, at_most(last, radius, "the ultimate radius")))


def _told(section: AloneSection, setting: Setting) -> Outcome:
    """The margin of a section that is not certified; it has no radius in the long run."""
    below = None if section.margin is None else section.margin.below
    if section.ultimate_radius is not None:
        return no_radius()
    if below is None:
        return stated(True, "")
    own = margin(setting, supremum(setting, setting.n.h))
    return at_least(own, below, "the distance without adaptation")


def _serves(limit: Fraction, setting: Setting) -> Outcome:
    """Whatever |h| is below the limit, sup D < dbar: D rises with h, and d0 < dbar by itself, theory 4a."""
    started = stated(bool(setting.n.initial_distance < setting.reach), "d0 is not below dbar")
    reached = at_most(supremum(setting, exact(limit)) / setting.reach, Fraction(1), "sup D/dbar at that |h|")
    return in_turn((started, reached))
