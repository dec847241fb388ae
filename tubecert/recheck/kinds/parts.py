"""The windows of certificates B and C: parts of the plan, each with constants and a level of its own.

Implements: theory 4f. A constant that a window states is examined over its tube; every other one is of the whole tube.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.balls import Ball, exact, larger, root
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Node
from tubecert.recheck.enclosures import Enclosure
from tubecert.recheck.examination import Claim
from tubecert.recheck.kinds.bounds import all_of, at_most, margin_at_least
from tubecert.recheck.kinds.window_section import WindowSection
from tubecert.recheck.kinds.windows import (
    Windows,
    above,
    claims_of_constants,
    claims_of_inputs,
    claims_of_states,
    within_tube,
)
from tubecert.recheck.legs import Reached, Stay
from tubecert.recheck.metric import stated
from tubecert.recheck.specified.numbers import Range

_MOST = 200


@dataclass(frozen=True, slots=True)
class Level:
    """The numbers of a recipe in one window."""

    level: Fraction
    speed: Fraction


def read_levels(node: Node) -> tuple[Level, ...]:
    """The numbers of a recipe for every window."""
    items = node.entries()
    if not 0 < len(items) <= _MOST:
        raise node.refused(f"does not have 1 to {_MOST} windows")
    return tuple(map(_level, items))


def _level(node: Node) -> Level:
    own = node.closed("level", "speed")
    return Level(own["level"].decimal(), own["speed"].decimal())


def ranges(windows: Sequence[WindowSection]) -> Mapping[str, Range] | None:
    """Where every input stays, in any window; None without windows that tell."""
    if not windows or not all(window.inputs.keys() == windows[0].inputs.keys() for window in windows):
        return None if not windows else {}
    return {
        name: (
            min(window.inputs[name][0] for window in windows),
            max(window.inputs[name][1] for window in windows),
        )
        for name in windows[0].inputs
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts(Windows):
    """The windows of B or C with what a recipe says of them; `theorem` is BW or CW at its gains, `radius` R_H."""

    levels: tuple[Level, ...]
    speed: Fraction
    radius: Fraction
    theorem: Callable[[Sequence[Stay]], tuple[Reached, ...] | None]

    def reached(self) -> tuple[Reached, ...] | None:
        """What follows in every window; None where the theorem does not hold."""
        if len(self.levels) != len(self.windows):
            return None
        return self.theorem(
            [
                Stay(
                    setting=self.setting(window),
                    level=own.level,
                    speed=own.speed,
                    length=window.end - window.begin,
                )
                for window, own in zip(self.windows, self.levels, strict=True)
            ]
        )

    def feedback(self) -> Ball | None:
        """The largest du sup D of all windows."""
        found = self.reached()
        if found is None:
            return None
        most = exact(Fraction(0))
        for j, own in enumerate(found):
            most = larger(most, self._added(j, own))
        return most

    def _added(self, j: int, own: Reached) -> Ball:
        return self.setting(self.windows[j]).n.feedback_gain * own.top

    def claims(self, margin: Enclosure | None, parts: tuple[object, ...]) -> Iterator[Claim]:
        """Constants, levels, and what follows from these; `parts` are what the section tells of its gains."""
        ground, depends = self.ground, (self.windows, self.levels, self.speed, self.radius, *parts)
        yield from claims_of_constants(self)
        yield ground.claim(
            f"{self.letter}: d stays below its level in each of {len(self.windows)} windows",
            (*depends, margin),
            lambda: self._hold(margin),
        )
        for j, window in enumerate(self.windows, start=1):
            yield from claims_of_states(self, j, window)
            yield from claims_of_inputs(self, j, depends, lambda _, j=j: self._reach(j))  # type: ignore[misc]

    def _hold(self, margin: Enclosure | None) -> Outcome:
        if margin is None:
            return stated(False, "it has no margin")
        if len(self.levels) != len(self.windows):
            return stated(False, "the recipe has other windows")
        if self.speed != max(own.speed for own in self.levels):
            return stated(False, "the speed of the recipe is not the largest of its windows")
        found = self.reached()
        if found is None:
            return stated(False, "a condition of the theorem does not hold at the numbers of the recipe")
        return all_of(self._told(margin, found))

    def _told(self, margin: Enclosure, found: Sequence[Reached]) -> Iterator[Outcome]:
        for window, own, level in zip(self.windows, found, self.levels, strict=True):
            if window.level is None or window.radius is None or window.supremum is None:
                yield stated(False, "what follows from a level is missing")
                return
            setting = self.setting(window)
            yield stated(window.level == level.level, "the recipe has other levels")
            yield within_tube(self, window.level)
            yield stated(window.supremum < window.level, "a window reaches its level")
            yield at_most(own.top, window.supremum, "what d reaches in a window")
            yield at_most(
                exact(window.level) / root(setting.n.lower), window.radius, "the radius of a window"
            )
            yield margin_at_least(1 - own.top / setting.reach, margin, "the distance")

    def _reach(self, j: int) -> tuple[Fraction, Fraction] | None:
        """Du sup D + R_H, on either side: (4.13) in a window."""
        found = self.reached()
        if found is None:
            return None
        added = above(self._added(j - 1, found[j - 1])) + self.radius
        return added, added
