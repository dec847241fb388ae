"""The windows of certificate H: the level of each by its recipe, and what follows from it. Implements: theory 8.9."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction

from flint import arb

from tubecert.recheck import covariant
from tubecert.recheck.along import Passed, Window, along
from tubecert.recheck.balls import Ball, exact, larger, root
from tubecert.recheck.cover import Outcome
from tubecert.recheck.examination import Claim
from tubecert.recheck.kinds.bounds import all_of, at_most
from tubecert.recheck.kinds.window_section import PROOF, WindowSection
from tubecert.recheck.kinds.windows import Windows, above, claims_of_inputs, claims_of_states, within_tube
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.recipe import Bent, Digital, MachineNumbers, Promise, Stretch
from tubecert.recheck.specified.hardware import Hardware
from tubecert.recheck.specified.numbers import Range


@dataclass(frozen=True, slots=True, kw_only=True)
class Course(Windows):
    """The windows of certificate H, with the `promise` and the `clip` of its machine."""

    promise: Promise
    clip: tuple[Range, ...]

    def pad(self) -> Fraction:
        """How far a window looks back."""
        return pad_of(self.ground.asked)

    def passed(self, recipe: Digital) -> tuple[Passed, ...] | None:
        """Theorem HW by a recipe."""
        if not recipe.windows or len(recipe.windows) != len(self.windows):
            return None
        # what rounds cuts its feedback by du of the whole tube, whatever is known of du in a window
        if recipe.losses is not None and any("feedback_gain" in own.constants for own in self.windows):
            return None
        pairs = zip(self.windows, recipe.windows, strict=True)
        return along([self._stage(window, own, recipe) for window, own in pairs], self.promise)

    def _stage(self, window: WindowSection, own: Stretch, recipe: Digital) -> Window:
        ground = self.ground
        assert ground.machine is not None
        return Window(
            setting=self.setting(window),
            machine=self._machine(window, ground.machine),
            at=own.of(recipe),
            length=window.end - window.begin,
        )

    def _machine(self, window: WindowSection, whole: MachineNumbers) -> MachineNumbers:
        own = {
            item.name: self._ball(window, item.name)
            for item in fields(MachineNumbers)
            if item.name in window.constants
        }
        bent = whole.bent
        if bent is not None:
            bent = Bent(**{name: self._ball(window, name) for name in covariant.NAMES})
        return replace(whole, **own, bent=bent)


def pad_of(asked: Hardware) -> Fraction:
    """Two samples of the slower clock, and the delay; `ValueError` where one of them is searched for, (H.20)."""
    Ts = asked.sample_time
    delay = Ts if asked.one_sample else asked.delay
    if Ts is None or delay is None:
        raise ValueError("windows need a machine that is given")
    return 2 * max(Ts, asked.feedback_time or Ts) + delay


def claims_of_levels(
    course: Course, recipe: Digital, section: object, margins: Callable[..., Outcome]
) -> Iterator[Claim]:
    """Every window's level by the recipe, and what follows from it; `margins` examines what `section` tells of all."""
    ground, windows = course.ground, course.windows
    parts = (windows, recipe)
    yield ground.claim("H: the recipe is that of the windows", parts, lambda: _agrees(windows, recipe))
    yield ground.claim(
        f"H: d stays below its level in each of {len(windows)} windows",
        (section, recipe),
        lambda: _hold(course, recipe, margins),
    )
    for j, window in enumerate(windows, start=1):
        yield from claims_of_states(course, j, window)
        depends = (windows, course.clip, recipe)
        yield from claims_of_inputs(
            course,
            j,
            depends,
            lambda i, j=j: _reach(course, j, recipe, i),  # type: ignore[misc]
        )


def _agrees(windows: Sequence[WindowSection], recipe: Digital) -> Outcome:
    """Levels are those of the recipe, whose own numbers are the largest of its windows."""
    own = recipe.windows
    if len(own) != len(windows):
        return stated(False, "the recipe has other windows")
    if any(item.level != window.level for item, window in zip(own, windows, strict=True)):
        return stated(False, "the recipe has other levels")
    for key in PROOF:
        if getattr(recipe, key) != max(getattr(item, key) for item in own):
            return stated(False, f"the {key} of the recipe is not the largest of its windows")
    predictions = [item.prediction for item in own]
    known = [item for item in predictions if item is not None]
    if len(known) not in (0, len(own)) or recipe.prediction != max(known, default=None):
        return stated(False, "the prediction of the recipe is not the largest of its windows")
    return CONFIRMED


def _hold(course: Course, recipe: Digital, margins: Callable[..., Outcome]) -> Outcome:
    found = course.passed(recipe)
    if found is None:
        return stated(False, "a condition of the theorem does not hold at the numbers of the recipe")
    outcomes = [margins(found)]
    for window, own in zip(course.windows, found, strict=True):
        if window.level is None or window.radius is None or window.supremum is None:
            return stated(False, "what follows from a level is missing")
        least = root(course.setting(window).n.lower)
        outcomes.append(at_most(own.loop.top, window.supremum, "what d reaches in a window"))
        outcomes.append(stated(window.supremum < window.level, "a window reaches its level"))
        outcomes.append(within_tube(course, window.level))
        outcomes.append(at_most(exact(window.level) / least, window.radius, "the radius of a window"))
    return all_of(outcomes)


def _reach(course: Course, j: int, recipe: Digital, i: int) -> tuple[Fraction, Fraction] | None:
    """Ups + kb, and what h is clipped to, by what acts in the window's pad: (H.16) in a window."""
    found = course.passed(recipe)
    if found is None or i >= len(course.clip):
        return None
    low, high = course.clip[i]
    loop = found[j - 1].loop
    added = above(loop.feedback + loop.feedforward)
    return added + high, added - low


def feedback(course: Course, recipe: Digital) -> Ball | None:
    """The largest |u0 - u* + kappa| of all windows."""
    found = course.passed(recipe)
    if found is None:
        return None
    most = arb(0)
    for own in found:
        most = larger(most, own.loop.feedback + own.loop.feedforward)
    return most
