"""The windows of certificate H: parts of the plan, each with constants and a level of its own. Implements: theory 8.9.

A constant that a window states is examined over its tube, from its pad on; every other one is that of the whole tube.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from itertools import pairwise

from flint import arb, ctx

from tubecert.recheck import unknown
from tubecert.recheck import wind as disturbed
from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.conditions import Numbers, Setting
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.examination import SHARP, Claim
from tubecert.recheck.kinds.bounds import all_of
from tubecert.recheck.kinds.kind import Ground
from tubecert.recheck.kinds.window_section import WindowSection
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.named import ALONG, bounded
from tubecert.recheck.place import Place
from tubecert.recheck.specified.numbers import Range
from tubecert.recheck.statements import NotNegative
from tubecert.recheck.terms import number

_MORE = 1 + Fraction(1, 2**50)


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """The windows of a section, on the ground of its claims; `letter` is that of the certificate."""

    windows: tuple[WindowSection, ...]
    ground: Ground
    letter: str = "H"

    def pad(self) -> Fraction:
        """How far constants of a window hold before it."""
        return Fraction(0)

    def place(self, window: WindowSection) -> Place:
        """The tube of a window, from its pad on."""
        with ctx.workprec(SHARP):
            return self.ground.place.during(
                max(Fraction(0), window.begin - self.pad()), window.end, window.tube
            )

    def known(self, window: WindowSection, name: str) -> Fraction | None:
        """The safe side of a constant in a window, None where it has no bound."""
        if name in window.constants:
            return window.constants[name]
        whole = self.ground.constants[name]
        return whole.below if name == "lower" else whole.above

    def _ball(self, window: WindowSection, name: str) -> Ball:
        found = self.known(window, name)
        return arb("nan") if found is None else exact(found)

    def setting(self, window: WindowSection) -> Setting:
        """That of the whole, with what the window states in place of it."""
        whole, stated_here = self.ground.setting, window.constants
        own = {
            item.name: self._ball(window, item.name) for item in fields(Numbers) if item.name in stated_here
        }
        rest = whole.rest
        if whole.system.unknown is not None:  # it pushes and drifts as if the plan did
            push, rest = (self._ball(window, name) for name in unknown.CONSTANTS)
            own["plan_defect_metric"] = self._ball(window, "plan_defect_metric") + push
            own["drift_on_plan"] = self._ball(window, "drift_on_plan") + rest
        wind = whole.wind
        if wind is not None:
            push, size, explained = (self._ball(window, name) for name in disturbed.CONSTANTS)
            wind = replace(wind, push=push, size=size, explained=explained)
        return replace(whole, n=replace(whole.n, **own), rho=window.tube, wind=wind, rest=rest)


# -- claims


def claims_of_constants(course: Windows) -> Iterator[Claim]:
    """The windows are those of the specification, and what each states of a constant."""
    ground, windows = course.ground, course.windows
    yield ground.claim(
        f"{course.letter}: windows follow one another", (windows, course.pad()), lambda: _follow(course)
    )
    if not _follow(course).holds:
        return
    machine = ground.specification.hardware
    noise = machine.noise if machine is not None and isinstance(machine.noise, tuple) else None
    for j, window in enumerate(windows, start=1):
        place = course.place(window)

        def known(name: str, window: WindowSection = window) -> Fraction | None:
            return course.known(window, name) if name in ground.constants else None

        rest = tuple(known(name) for name in ("B", "upper", "B_pinv", "f_x", "metric_input_gain"))
        for name, limit in window.constants.items():
            yield ground.over_tube(
                f"{course.letter}: window {j}: {name} {'>=' if name == 'lower' else '<='} {float(limit):.6g}",
                (window.begin, window.end, window.tube, course.pad(), name, limit, rest),
                lambda place=place, name=name, limit=limit, known=known: bounded(  # type: ignore[misc]
                    place, name, limit, noise, known
                ),
            )


def _follow(course: Windows) -> Outcome:
    ground, windows = course.ground, course.windows
    times = ground.specification.windows
    steps = list(pairwise(times))
    if len(steps) != len(windows):
        return stated(False, "there are not as many as the specification has")
    if any((window.begin, window.end) != step for window, step in zip(windows, steps, strict=True)):
        return stated(False, "they are at other times than those of the specification")
    if any(end - begin < course.pad() for begin, end in steps):
        return stated(False, "one is shorter than what it looks back at")
    if any(not 0 < window.tube <= ground.place.rho for window in windows):
        return stated(False, "one has a tube that is not within the tube")
    for window in windows:
        for name in window.constants:
            if name not in ALONG or name not in ground.constants:
                return stated(False, f"{name[:40]} is no constant of a window")
    return CONFIRMED


def within_tube(course: Windows, level: Fraction) -> Outcome:
    """A level is not beyond dbar of the whole tube, which its half-widths and the clearance rest on."""
    return stated(
        bool(exact(level) <= course.ground.setting.reach), "a level is beyond that of the whole tube"
    )


def claims_of_states(course: Windows, j: int, window: WindowSection) -> Iterator[Claim]:
    """The half-widths of a window, by its level."""
    ground = course.ground
    lengths = ground.place.system.lengths
    yield ground.claim(
        f"{course.letter}: window {j}: every state has a half-width",
        (window,),
        lambda: stated(window.half_widths.keys() == set(lengths), "they are of others"),
    )
    lower = course.known(window, "lower")
    for name, row in lengths.items():
        width = window.half_widths.get(name)
        if width is not None and window.level is not None:
            yield ground.over_tube(
                f"{course.letter}: window {j}: half-width of {name} <= {float(width):.6g}",
                (row, window, lower),
                lambda row=row, width=width, level=window.level: _within(  # type: ignore[misc]
                    course.place(window), row, width, level, lower
                ),
            )


def _within(
    place: Place, row: Sequence[Fraction], width: Fraction, level: Fraction, lower: Fraction | None
) -> Outcome:
    """width^2 >= level^2 c'W c over the tube of the window, or |c| times the radius serves."""
    if width <= 0:
        return stated(False, "it is not positive")
    if lower is not None and width**2 * lower >= sum(q * q for q in row) * level**2:
        return CONFIRMED
    square = number(width**2 / level**2)
    return prove(NotNegative(square - place.system.squared(row)), place.tube(), place.budget)


Reach = Callable[[int], tuple[Fraction, Fraction] | None]
"""How far below and above u*_i input i may be in a window; None where the level is not proven."""


def claims_of_inputs(course: Windows, j: int, depends: tuple[object, ...], reach: Reach) -> Iterator[Claim]:
    """The ranges of the inputs in a window: u_i in [inf u*_i - below, sup u*_i + above]."""
    ground, window = course.ground, course.windows[j - 1]
    inputs = ground.place.system.inputs
    yield ground.claim(
        f"{course.letter}: window {j}: every input has a range",
        (window,),
        lambda: stated(window.inputs.keys() == set(inputs), "they are of others"),
    )
    for i, name in enumerate(inputs):
        own = window.inputs.get(name)
        if own is not None:
            yield ground.over_tube(
                f"{course.letter}: window {j}: {name} in [{float(own[0]):.6g}, {float(own[1]):.6g}]",
                (*depends, j, own, ground.depends),
                lambda i=i, own=own: _in_range(course, j, i, own, reach),  # type: ignore[misc]
            )


def _in_range(course: Windows, j: int, i: int, own: Range, reach: Reach) -> Outcome:
    found = reach(i)
    if found is None:
        return stated(False, "the level is not proven")
    below, above = found
    place = course.place(course.windows[j - 1])
    u = place.curve.u[i]
    rooms = (u - number(own[0] + below), number(own[1] - above) - u)
    return all_of(place.along(lambda room=room: NotNegative(room, place.numbers)) for room in rooms)  # type: ignore[misc]


def above(ball: Ball) -> Fraction:
    """A number above a ball."""
    return Fraction(float(ball.upper())) * _MORE


def covers(
    windows: Sequence[WindowSection],
    radius: Fraction | None,
    half_widths: Mapping[str, Fraction],
    inputs: Mapping[str, Range],
) -> Outcome:
    """What is told of the whole is at least what is told of every window."""
    for window in windows:
        if radius is None or window.radius is None or radius < window.radius:
            return stated(False, "the radius is less than that of a window")
        if any(width > half_widths.get(name, Fraction(0)) for name, width in window.half_widths.items()):
            return stated(False, "a half-width is less than that of a window")
        for name, (low, high) in window.inputs.items():
            whole = inputs.get(name)
            if whole is None or low < whole[0] or high > whole[1]:
                return stated(False, f"the range of {name} is less than that of a window")
    return CONFIRMED
