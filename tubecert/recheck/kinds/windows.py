"""The windows of certificate H: parts of the plan, each with constants and a level of its own. Implements: theory 8.9.

A constant that a window states is examined over its tube, from its pad on; every other one is that of the whole tube.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from itertools import pairwise

from flint import arb, ctx

from tubecert.recheck import covariant, unknown
from tubecert.recheck import wind as disturbed
from tubecert.recheck.along import Passed, Window, along
from tubecert.recheck.balls import Ball, exact, larger, root
from tubecert.recheck.conditions import Numbers, Setting
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.digital import Bent, Digital, MachineNumbers, Promise, Stretch
from tubecert.recheck.document import Node
from tubecert.recheck.examination import SHARP, Claim
from tubecert.recheck.kinds.bounds import all_of, at_most
from tubecert.recheck.kinds.kind import Ground
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.named import ALONG, bounded
from tubecert.recheck.place import Place
from tubecert.recheck.specified.hardware import Hardware
from tubecert.recheck.specified.numbers import Range
from tubecert.recheck.statements import NotNegative
from tubecert.recheck.terms import number

_PROOF = ("level", "floor", "speed", "bias", "ripple")
_MORE = 1 + Fraction(1, 2**50)
_MOST = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSection:
    """What is told of one window, times in s: `tube` is its radius, the other numbers are None without a proof."""

    begin: Fraction
    end: Fraction
    tube: Fraction
    level: Fraction | None
    radius: Fraction | None
    supremum: Fraction | None
    half_widths: dict[str, Fraction]
    inputs: dict[str, Range]
    constants: dict[str, Fraction]

    @property
    def proves(self) -> bool:
        """Whether it tells anything of a level."""
        told = (self.level, self.radius, self.supremum)
        return any(item is not None for item in told) or bool(self.half_widths or self.inputs)


def read_windows(node: Node) -> tuple[WindowSection, ...]:
    """The windows that a section tells of."""
    items = node.entries()
    if not 0 < len(items) <= _MOST:
        raise node.refused(f"does not have 1 to {_MOST} windows")
    return tuple(map(_window, items))


def _window(node: Node) -> WindowSection:
    told = ("level", "radius", "supremum", "half_widths", "inputs", "constants")
    own = node.closed("begin", "end", "tube", *told)
    return WindowSection(
        begin=own["begin"].decimal(),
        end=own["end"].decimal(),
        tube=own["tube"].decimal(),
        level=own.known("level", Node.decimal),
        radius=own.known("radius", Node.number),
        supremum=own.known("supremum", Node.number),
        half_widths={name: item.number() for name, item in own["half_widths"].items()},
        inputs={name: read_range(item) for name, item in own["inputs"].items()},
        constants={name: item.number() for name, item in own["constants"].items()},
    )


def read_range(node: Node) -> Range:
    """Two ends."""
    low, high = node.pair()
    return low.decimal(), high.decimal()


def read_stretches(node: Node) -> tuple[Stretch, ...]:
    """The numbers of a recipe for every window."""
    items = node.entries()
    if not 0 < len(items) <= _MOST:
        raise node.refused(f"does not have 1 to {_MOST} windows")
    return tuple(map(_stretch, items))


def _stretch(node: Node) -> Stretch:
    own = node.closed(*_PROOF, "prediction")
    return Stretch(
        **{key: own[key].decimal() for key in _PROOF}, prediction=own.known("prediction", Node.decimal)
    )


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
    """Two samples of the slower clock, and the delay; `ValueError` where one of them is searched for."""
    Ts = asked.sample_time
    delay = Ts if asked.one_sample else asked.delay
    if Ts is None or delay is None:
        raise ValueError("windows need a machine that is given")
    return 2 * max(Ts, asked.feedback_time or Ts) + delay


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
    for key in _PROOF:
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


def within_tube(course: Windows, level: Fraction) -> Outcome:
    """A level is not beyond dbar of the whole tube, which its half-widths and the clearance rest on."""
    return stated(
        bool(exact(level) <= course.ground.setting.reach), "a level is beyond that of the whole tube"
    )


def claims_of_states(course: Windows, j: int, window: WindowSection) -> Iterator[Claim]:
    """The half-widths of a window, by its level."""
    ground = course.ground
    states = ground.place.system.states
    yield ground.claim(
        f"{course.letter}: window {j}: every state has a half-width",
        (window,),
        lambda: stated(window.half_widths.keys() == set(states), "they are of others"),
    )
    lower = course.known(window, "lower")
    for i, name in enumerate(states):
        width = window.half_widths.get(name)
        if width is not None and window.level is not None:
            yield ground.over_tube(
                f"{course.letter}: window {j}: half-width of {name} <= {float(width):.6g}",
                (window, lower),
                lambda i=i, width=width, level=window.level: _within(  # type: ignore[misc]
                    course.place(window), i, width, level, lower
                ),
            )


def _within(place: Place, state: int, width: Fraction, level: Fraction, lower: Fraction | None) -> Outcome:
    """width^2 >= level^2 W_ii over the tube of the window, or the width is the radius."""
    if width <= 0:
        return stated(False, "it is not positive")
    if lower is not None and width**2 * lower >= level**2:
        return CONFIRMED
    square = number(width**2 / level**2)
    return prove(NotNegative(square - place.system.W[state][state]), place.tube(), place.budget)


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


def _reach(course: Course, j: int, recipe: Digital, i: int) -> tuple[Fraction, Fraction] | None:
    """Ups + kb, and what h is clipped to, by what acts in the window's pad."""
    found = course.passed(recipe)
    if found is None or i >= len(course.clip):
        return None
    low, high = course.clip[i]
    loop = found[j - 1].loop
    added = above(loop.feedback + loop.feedforward)
    return added + high, added - low


def above(ball: Ball) -> Fraction:
    """A number above a ball."""
    return Fraction(float(ball.upper())) * _MORE


def feedback(course: Course, recipe: Digital) -> Ball | None:
    """The largest |u0 - u* + kappa| of all windows."""
    found = course.passed(recipe)
    if found is None:
        return None
    most = arb(0)
    for own in found:
        most = larger(most, own.loop.feedback + own.loop.feedforward)
    return most


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
