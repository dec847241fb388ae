"""Certificate H: sampled, late and noisy control, with wind beside the inputs. Implements: theory 8."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import ClassVar

from tubecert.recheck.along import Passed
from tubecert.recheck.balls import exact, root
from tubecert.recheck.clipping import clips
from tubecert.recheck.conditions import Setting
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.digital import Loop, loop
from tubecert.recheck.document import Node
from tubecert.recheck.examination import Claim
from tubecert.recheck.kinds.bounds import all_of, at_most, margin_at_least, not_shown_to_hold
from tubecert.recheck.kinds.course import Course, claims_of_levels, feedback
from tubecert.recheck.kinds.hardware_section import (
    OF_MACHINE,
    OF_PROOF,
    HardwareSection,
    read_losses,
    read_section,
)
from tubecert.recheck.kinds.kind import Ground, Kind, Shares
from tubecert.recheck.kinds.machine import agrees, promise
from tubecert.recheck.kinds.window_section import read_stretches
from tubecert.recheck.kinds.windows import above, claims_of_constants, covers
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.proposal import proposed
from tubecert.recheck.recipe import Digital
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.numbers import Range
from tubecert.recheck.statements import NotNegative
from tubecert.recheck.terms import number

LEVEL, STAYS = "hardware_level", "hardware"

_DUST = 1e-9  # of the level: a share that is printed as none


class OfMachines(Kind[HardwareSection, Digital]):
    """Certificate H."""

    key: ClassVar = "hardware"
    conditions: ClassVar = (LEVEL, STAYS)

    def applies(self, specification: Specification) -> bool:
        """Where the specification has a machine."""
        return specification.hardware is not None

    def read(self, node: Node, n: int) -> HardwareSection:
        """The section `hardware`."""
        del n
        return read_section(node)

    def read_recipe(self, node: Node) -> Digital:
        """The machine and the numbers of the proof."""
        own = node.closed(*OF_MACHINE, *OF_PROOF, "bandwidth", "prediction", optional=("windows", "rounding"))
        found = {key: own[key].decimal() for key in (*OF_MACHINE, *OF_PROOF)}
        return Digital(
            **found,
            bandwidth=own.known("bandwidth", Node.decimal),
            prediction=own.known("prediction", Node.decimal),
            windows=own.get("windows", read_stretches) or (),
            losses=own.get("rounding", read_losses),
        )

    def uncovered(self, setting: Setting) -> str | None:
        """Nothing: its recipe has the bound of a disturbance."""
        del setting
        return None

    def said(self, section: HardwareSection) -> dict[str, object]:
        """Both margins."""
        if section.margin is None or section.level_margin is None:
            return {}
        return {"margins": {STAYS: section.margin.below, LEVEL: section.level_margin.below}}

    def shares(self, section: HardwareSection, recipe: Digital, ground: Ground) -> Shares | None:
        """Feedback with what u0 differs from u*, and the larger end of the clip of each input."""
        if section.windows:
            added = feedback(_course(section, recipe, ground), recipe)
        else:
            found = _loop(recipe, ground)
            added = None if found is None else found.feedback + found.feedforward
        if added is None:
            return None
        inputs = ground.place.system.inputs
        clipped = {name: max(map(abs, ends)) for name, ends in zip(inputs, section.clip, strict=False)}
        return Shares(added, recipe.clip_radius, clipped)

    def ranges(self, section: HardwareSection) -> Mapping[str, Range]:
        """Those that it states: the clip need not be the same to both sides."""
        return section.inputs

    def claims(self, section: HardwareSection, recipe: Digital | None, ground: Ground) -> Iterator[Claim]:
        """The machine, its clip, the level by the recipe, what follows from it, the curve."""
        if section.windows or ground.specification.windows:
            yield from claims_of_constants(_course(section, recipe, ground))
        if section.verdict != "certified":
            yield ground.claim("H: what is told of it", (section,), lambda: _told(section))
            if section.curve:
                yield ground.claim("H: the curve", (section,), lambda: stated(False, "nothing is certified"))
            return
        if recipe is None:
            yield ground.claim("H: it has a recipe", (), lambda: stated(False, "it has none"))
            return
        parts = (section, recipe)
        yield ground.claim(
            "H: the machine is the one that is asked for", parts, lambda: agrees(section, recipe, ground)
        )
        yield ground.over_tube(
            "H: the estimate is clipped to a set that holds h",
            (section.clip, recipe, ground.constants["h"].above),
            lambda: _clipped(section, recipe, ground),
        )
        if ground.specification.windows:
            yield from _in_windows(section, recipe, ground)
            return
        words = f"Ts = {float(recipe.sample_time):.6g}, tau = {float(recipe.delay):.6g}"
        yield ground.claim(
            f"H: d < {float(recipe.level):.6g} at {words}", parts, lambda: _holds(section, recipe, ground)
        )
        yield from _states(section, recipe, ground)
        yield from _inputs(section, recipe, ground)
        yield ground.claim("H: the curve is feasible", parts, lambda: _curve_holds(section, recipe, ground))


def _course(section: HardwareSection, recipe: Digital | None, ground: Ground) -> Course:
    R = Fraction(0) if recipe is None else recipe.clip_radius
    clip = section.clip or ((-R, R),) * len(ground.place.system.inputs)
    return Course(windows=section.windows, ground=ground, promise=promise(ground.asked), clip=clip)


def _in_windows(section: HardwareSection, recipe: Digital, ground: Ground) -> Iterator[Claim]:
    """Theorem HW in place of theorem H."""
    course = _course(section, recipe, ground)
    yield from claims_of_levels(
        course, recipe, section, lambda found: _told_of_windows(section, recipe, found, ground)
    )
    yield ground.claim(
        "H: what is told of the whole holds in every window", (section,), lambda: _covers(section, ground)
    )


def _covers(section: HardwareSection, ground: Ground) -> Outcome:
    system = ground.place.system
    named = section.half_widths.keys() == set(system.lengths) and section.inputs.keys() == set(system.inputs)
    return all_of(
        (
            stated(named, "half-widths or inputs are of others"),
            stated(not section.curve, "there is a curve beside windows"),
            covers(section.windows, section.radius, section.half_widths, section.inputs),
        )
    )


def _told_of_windows(
    section: HardwareSection, recipe: Digital, found: tuple[Passed, ...], ground: Ground
) -> Outcome:
    """The least margins of all windows, the budget where the level is largest, and where D goes in the last one."""
    if section.margin is None or section.level_margin is None or section.budget is None:
        return stated(False, "what follows from the levels is missing")
    levels = [own.level for own in recipe.windows]
    outcomes = []
    for level, own in zip(levels, found, strict=True):
        room = 1 - (exact(own.level) + own.loop.noise) / own.reach
        outcomes.append(margin_at_least(room, section.level_margin, "the level (H.10)"))
        outcomes.append(
            margin_at_least(1 - own.loop.top / exact(level), section.margin, "the distance (H.12)")
        )
    if section.ultimate_radius is not None:
        last = found[-1].loop.ultimate / root(ground.setting.n.lower)
        outcomes.append(at_most(last, section.ultimate_radius, "the ultimate radius"))
    widest = found[levels.index(max(levels))].loop
    outcomes += [_share(widest, key, share) for key, share in section.budget.items()]
    return all_of(outcomes)


def _share(found: Loop, key: str, share: Fraction) -> Outcome:
    filled = found.shares[key]
    return at_most(filled if share else (filled - _DUST).max(0), share, f"the share of {key}")


# -- reading


# -- claims


def _told(section: HardwareSection) -> Outcome:
    """A section that is not certified: nothing follows from a level, and no margins say that it holds."""
    follows = (section.radius, section.ultimate_radius, section.budget)
    whole = any(item is not None for item in follows) or section.half_widths or section.inputs
    if whole or any(window.proves for window in section.windows):
        return stated(False, "something is stated that would follow from a level")
    margins = [margin for margin in (section.margin, section.level_margin) if margin is not None]
    return not_shown_to_hold(margins) if margins else CONFIRMED


def _clipped(section: HardwareSection, recipe: Digital, ground: Ground) -> Outcome:
    """R bounds the set that the estimate is clipped to, and h lies in that set, R_set of theory 8.1."""
    Dh, place = ground.constants["h"].above, ground.place
    if not section.clip:
        return stated(Dh is not None and Dh <= recipe.clip_radius, "the radius of the clip is less than |h|")
    if len(section.clip) != len(place.system.inputs):
        return stated(False, "there is not one range for each input")
    square = sum(max(low**2, high**2) for low, high in section.clip)
    if square > recipe.clip_radius**2:
        return stated(False, "the radius of the clip is less than a corner of its box")
    return clips(place, section.clip, Dh)


def _loop(recipe: Digital, ground: Ground) -> Loop | None:
    if ground.machine is None:
        return None
    return loop(ground.setting, ground.machine, promise(ground.asked), recipe)


def _holds(section: HardwareSection, recipe: Digital, ground: Ground) -> Outcome:
    """Theorem H by the recipe, with what is printed of it."""
    found = _loop(recipe, ground)
    if found is None:
        return stated(False, "a condition of the theorem does not hold at the numbers of the recipe")
    if section.margin is None or section.level_margin is None:
        return stated(False, "it has no margin")
    level, least = exact(recipe.level), root(ground.setting.n.lower)
    outcomes = [
        margin_at_least(
            1 - (level + found.noise) / ground.setting.reach, section.level_margin, "the level (H.10)"
        ),
        margin_at_least(1 - found.top / level, section.margin, "the distance (H.12)"),
    ]
    if section.radius is None or section.budget is None:
        return stated(False, "what follows from the level is missing")
    outcomes.append(at_most(level / least, section.radius, "the radius"))
    if section.ultimate_radius is not None:
        outcomes.append(at_most(found.ultimate / least, section.ultimate_radius, "the ultimate radius"))
    outcomes += [_share(found, key, share) for key, share in section.budget.items()]
    return all_of(outcomes)


def _states(section: HardwareSection, recipe: Digital, ground: Ground) -> Iterator[Claim]:
    """|c'(x - x*)| < level sup sqrt(c'W c): width^2 >= level^2 c'W c over the tube; c = e_i for a state."""
    place = ground.place
    named = section.half_widths.keys() == set(place.system.lengths)
    yield ground.claim(
        "H: every state has a half-width", (section,), lambda: stated(named, "they are of others")
    )
    for name, row in place.system.lengths.items():
        width = section.half_widths.get(name)
        if width is not None:
            yield ground.over_tube(
                f"H: half-width of {name} <= {float(width):.6g}",
                (row, width, recipe.level, ground.constants["lower"].below),
                lambda row=row, width=width: _within(row, width, recipe.level, ground),  # type: ignore[misc]
            )


def _within(row: Sequence[Fraction], width: Fraction, level: Fraction, ground: Ground) -> Outcome:
    """A half-width at the level, theory 1a.5a."""
    if width <= 0:
        return stated(False, "it is not positive")
    place, a = ground.place, ground.constants["lower"].below
    if place.coordinates is None and a is not None and width**2 * a >= sum(q * q for q in row) * level**2:
        return CONFIRMED  # by the radius of the tube
    square = number(width**2 / level**2)
    return prove(NotNegative(square - place.system.squared(row)), place.tube(), place.budget)


def _inputs(section: HardwareSection, recipe: Digital, ground: Ground) -> Iterator[Claim]:
    """u_i in [inf u*_i - ups - kb - hi_i, sup u*_i + ups + kb - lo_i]."""
    place = ground.place
    named = section.inputs.keys() == set(place.system.inputs)
    yield ground.claim("H: every input has a range", (section,), lambda: stated(named, "they are of others"))
    R = recipe.clip_radius
    clip = section.clip or ((-R, R),) * len(place.system.inputs)
    for i, name in enumerate(place.system.inputs):
        own = section.inputs.get(name)
        if own is not None and i < len(clip):
            yield ground.over_tube(
                f"H: {name} in [{float(own[0]):.6g}, {float(own[1]):.6g}]",
                (own, clip[i], recipe, ground.depends),
                lambda i=i, own=own: _in_range(i, own, clip[i], recipe, ground),  # type: ignore[misc]
            )


def _in_range(i: int, own: Range, clip: Range, recipe: Digital, ground: Ground) -> Outcome:
    """u* of an input leaves room for all that is added to it, (H.16)."""
    found, place = _loop(recipe, ground), ground.place
    if found is None:
        return stated(False, "the level is not proven")
    feedback = above(found.feedback + found.feedforward)
    u = place.curve.u[i]
    rooms = (u - number(own[0] + feedback + clip[1]), number(own[1] - feedback + clip[0]) - u)
    return all_of(place.along(lambda room=room: NotNegative(room, place.numbers)) for room in rooms)  # type: ignore[misc]


def _curve_holds(section: HardwareSection, recipe: Digital, ground: Ground) -> Outcome:
    """Every point of the curve is feasible for the same machine, by a recipe that is found here."""
    if ground.machine is None:
        return stated(False, "there is no machine")
    if recipe.losses is not None and section.curve:
        return stated(False, "what rounding may cost belongs to one sample time, and there are others")
    beside: Digital | None = recipe
    for point in section.curve:
        outcome, beside = _feasible(point, recipe, beside, ground)
        if not outcome.holds:
            return outcome
    return CONFIRMED


def _feasible(
    point: tuple[Fraction, Fraction], recipe: Digital, beside: Digital | None, ground: Ground
) -> tuple[Outcome, Digital | None]:
    """Whether a point is feasible, and by which recipe; `beside`: that of the point before."""
    Ts, level = point
    why = f"the point at Ts = {float(Ts):.6g} is not feasible"
    if Ts <= 0 or level <= 0 or ground.machine is None:
        return stated(False, why), None
    asked = ground.asked
    like = replace(
        recipe,
        sample_time=Ts,
        level=level,
        feedback_time=Ts if asked.feedback_time is None else asked.feedback_time,
        delay=Ts if asked.one_sample else recipe.delay,
    )
    fixed = asked.bandwidth is not None
    found = proposed(ground.setting, ground.machine, promise(asked), like, fixed=fixed, beside=beside)
    if found is None:
        return Outcome(verdict="undecided", why=why), None
    own = loop(ground.setting, ground.machine, promise(asked), found)
    whole = (
        own is not None
        and bool(own.top < exact(level))
        and bool(exact(level) + own.noise <= ground.setting.reach)
    )
    return CONFIRMED if whole else Outcome(verdict="undecided", why=why), found
