"""Certificate C: piecewise-constant adaptation with a sample time. Implements: theory 4b, theorem C."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.recheck.balls import exact
from tubecert.recheck.conditions import Setting
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Members, Node
from tubecert.recheck.enclosures import Enclosure, enclosure
from tubecert.recheck.examination import Claim
from tubecert.recheck.kinds import printed
from tubecert.recheck.kinds.bounds import all_of, at_most, margin_at_least, not_shown_to_hold, told
from tubecert.recheck.kinds.kind import VERDICTS, Asked, Ground, Kind, Section, Shares, Statements
from tubecert.recheck.kinds.parts import Level, Parts, ranges, read_levels
from tubecert.recheck.kinds.window_section import WindowSection, read_windows
from tubecert.recheck.legs import of_samples
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.sampling import SampledGains, sampled_margin
from tubecert.recheck.specified.numbers import Range

GAINS = ("sample_time", "bandwidth", "predictor_gain", "projection_radius")


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSection(Section):
    """The gains; the curve is of (omega, Ts)."""

    pair: SampledGains | None
    margin: Enclosure | None
    ultimate_radius: Fraction | None
    curve: tuple[tuple[Fraction, Fraction], ...]
    windows: tuple[WindowSection, ...] = ()


@dataclass(frozen=True, slots=True)
class SampledRecipe:
    """Y of theorem C at its gains; with `windows` the largest of them."""

    gains: SampledGains
    speed: Fraction
    windows: tuple[Level, ...] = ()


class Sampled(Kind[SampledSection, SampledRecipe]):
    """Certificate C."""

    key: ClassVar = "sampled"
    conditions: ClassVar = ("sampled",)
    unread: ClassVar = ("sample_time_limit",)

    def read(self, node: Node, n: int) -> SampledSection:
        """The section `sampled`."""
        del n
        return _section(node)

    def read_recipe(self, node: Node) -> SampledRecipe:
        """Gains and Y."""
        own = node.closed(*GAINS, "speed", optional=("windows",))
        return SampledRecipe(_gains(own), own["speed"].decimal(), own.get("windows", read_levels) or ())

    def asked(self, section: SampledSection, given: Asked) -> Statements:
        """The bandwidth is the one asked for."""
        same = section.pair is None or given.bandwidth in (None, section.pair.bandwidth)
        yield same, f"overrides.bandwidth is not what {self.key} judges"

    def said(self, section: SampledSection) -> dict[str, object]:
        """The margin, and the gain of the predictor."""
        if section.pair is None or section.margin is None:
            return {}
        margins = {self.key: section.margin.below}
        return {"margins": margins, "predictor_gain": section.pair.predictor_gain}

    def ranges(self, section: SampledSection) -> Mapping[str, Range] | None:
        """Those of the windows, if there are any."""
        return ranges(section.windows)

    def shares(self, section: SampledSection, recipe: SampledRecipe, ground: Ground) -> Shares | None:
        """The feedback acts within max(d0, d1, sup D) of theorem C."""
        if section.windows:
            most = _parts(section, recipe, ground).feedback()
            return None if most is None else Shares(most, recipe.gains.projection_radius)
        setting = ground.setting
        margin, _ = sampled_margin(setting, recipe.gains, exact(recipe.speed))
        feedback = setting.n.feedback_gain * (1 - margin) * setting.reach
        return Shares(feedback, recipe.gains.projection_radius)

    def claims(
        self, section: SampledSection, recipe: SampledRecipe | None, ground: Ground
    ) -> Iterator[Claim]:
        """The gains with their margin and radius, the curve."""
        setting, pair, curve = ground.setting, section.pair, section.curve
        if section.windows or (recipe is not None and recipe.windows):
            yield from _in_windows(section, recipe, ground)
            return
        if section.verdict == "certified" and pair is not None:
            words = f"omega = {float(pair.bandwidth):.6g}, Ts = {float(pair.sample_time):.6g}"
            yield ground.claim(
                f"C: sup D < dbar at {words}",
                (section, recipe),
                lambda: _holds(section, pair, recipe, setting),
            )
        if section.verdict != "certified":
            yield ground.claim("C: what is told of it", (section,), lambda: _told(section, ground))
        yield ground.claim(
            "C: the curve is feasible", (curve, pair), lambda: _curve_holds(curve, pair, setting)
        )


# -- reading


def _gains(own: Members) -> SampledGains:
    return SampledGains(*(own[key].decimal() for key in GAINS))


def _section(node: Node) -> SampledSection:
    keys = ("verdict", "margin", "ultimate_radius", "sample_time_limit", "curve", "shortfalls")
    own = node.closed(*GAINS, *keys, optional=("windows",))
    own.known("sample_time_limit", Node.number)
    verdict = own["verdict"].word(*VERDICTS)
    present = [own[key].value is not None for key in (*GAINS, "margin")]
    if any(present) != all(present) or (verdict == "certified" and not all(present)):
        raise node.refused("has a part of its gains only")
    curve = []
    for item in own["curve"].entries():
        point = item.closed("bandwidth", "sample_time")
        curve.append((point["bandwidth"].decimal(), point["sample_time"].decimal()))
    if curve and not all(present):
        raise node.refused("has a curve and no gains")
    windows = own.get("windows", read_windows) or ()
    if windows and (curve or own["ultimate_radius"].value is not None):
        raise node.refused("has a curve or a radius in the long run beside windows")
    return SampledSection(
        verdict=verdict,
        pair=_gains(own) if all(present) else None,
        margin=own.known("margin", enclosure),
        ultimate_radius=own.known("ultimate_radius", Node.number),
        curve=tuple(curve),
        shortfalls=printed.read_shortfalls(own["shortfalls"]),
        windows=windows,
    )


# -- claims


def _parts(section: SampledSection, recipe: SampledRecipe, ground: Ground) -> Parts:
    return Parts(
        windows=section.windows,
        ground=ground,
        letter="C",
        levels=recipe.windows,
        speed=recipe.speed,
        radius=recipe.gains.projection_radius,
        theorem=lambda stays: of_samples(stays, recipe.gains),
    )


def _in_windows(section: SampledSection, recipe: SampledRecipe | None, ground: Ground) -> Iterator[Claim]:
    """Theorem CW in place of theorem C."""
    if section.verdict != "certified":
        silent = not any(window.proves for window in section.windows)
        yield ground.claim(
            "C: what is told of it",
            (section,),
            lambda: (
                _told(section, ground) if silent else stated(False, "windows tell of what is not certified")
            ),
        )
        return
    if recipe is None or recipe.gains != section.pair or not section.windows:
        told_wrongly = stated(False, "its windows have no recipe, or one for other gains")
        yield ground.claim("C: it has a recipe", (section, recipe), lambda: told_wrongly)
        return
    yield from _parts(section, recipe, ground).claims(section.margin, (recipe, section.pair))


def _holds(
    section: SampledSection, at: SampledGains, recipe: SampledRecipe | None, setting: Setting
) -> Outcome:
    """Theorem C at the sample time, by the recipe."""
    shown, radius = section.margin, section.ultimate_radius
    if recipe is None or shown is None:
        return stated(False, "it has no recipe")
    if recipe.gains != at:
        return stated(False, "the recipe is for other gains")
    value, ultimate = sampled_margin(setting, at, exact(recipe.speed))
    found = margin_at_least(value, shown, "the distance with sampled adaptation")
    return at_most(ultimate, radius, "the ultimate radius") if found.holds and radius is not None else found


def _told(section: SampledSection, ground: Ground) -> Outcome:
    """Gains that are not certified: no radius in the long run, and no margin that says that they serve."""
    if section.ultimate_radius is not None:
        return stated(False, "a radius is stated of a tube that is not certified")
    if section.margin is None or section.pair is None:
        return CONFIRMED
    if ground.silent:
        own, _ = sampled_margin(ground.setting, section.pair, None)
        return told(own, section.margin, "the distance with sampled adaptation")
    return not_shown_to_hold([section.margin])


def _curve_holds(
    curve: tuple[tuple[Fraction, Fraction], ...], pair: SampledGains | None, setting: Setting
) -> Outcome:
    """Every point of the curve is feasible, at some predictor gain: that of the pair, or those that search proposes."""
    if pair is None:
        return CONFIRMED
    R_H, g = pair.projection_radius, pair.predictor_gain

    def feasible(omega: Fraction, Ts: Fraction) -> bool:
        proposed = (g, omega, 10 * omega, *((1 / Ts, 10 / Ts) if Ts > 0 else ()))
        return any(
            bool(sampled_margin(setting, SampledGains(Ts, omega, gain, R_H), None)[0] > 0)
            for gain in proposed
        )

    return all_of(
        stated(feasible(omega, Ts), f"the point at bandwidth {float(omega):.6g} is not feasible")
        for omega, Ts in curve
    )
