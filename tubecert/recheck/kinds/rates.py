"""Certificate A: the corrected conditions (26a)-(26c) at printed gains. Implements: (26a)-(26c)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.recheck.conditions import Setting, derived, margins_26, own_distance_proof
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
from tubecert.recheck.kinds.printed import GAINS, Around, Point, read_gains
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.predictor import Gains

CONDITIONS = ("26a", "26b", "26c")
DERIVED = (
    "speed",
    "uncertainty_rate",
    "prediction_error",
    "filter_error",
    "theta",
    "Psi_x",
    "geodesic_rate",
    "Psi_rate",
    "zeta_1",
    "zeta_2",
    "zeta_3",
)

Margins = dict[str, Enclosure]


@dataclass(frozen=True, slots=True)
class RatePair:
    """A pair with its margins."""

    gains: Gains
    margins: Margins


@dataclass(frozen=True, slots=True, kw_only=True)
class RateSection(Section):
    """The pair that the verdict is about, that of least rate, the curve."""

    pair: RatePair | None
    ultimate_radius: Fraction | None
    least_adaptation: RatePair | None
    curve: tuple[Point, ...]
    around: Around | None
    binds: str | None


class Rates(Kind[RateSection, Gains]):
    """Certificate A."""

    key: ClassVar = "conditions_26"
    conditions: ClassVar = CONDITIONS
    unread: ClassVar = ("bandwidth_infimum", "binds")
    elastic: ClassVar = True

    def read(self, node: Node) -> RateSection:
        """The section `conditions_26`."""
        return _section(node)

    def read_recipe(self, node: Node) -> Gains:
        """The gains: nothing else is needed."""
        return read_gains(node.closed(*GAINS))

    def derived(self, node: Node) -> tuple[str, ...]:
        """What follows from gains, where there are any."""
        return DERIVED if node.mapping().get("bandwidth") is not None else ()

    def projection_radii(self, section: RateSection) -> Iterator[Fraction]:
        """Those of its pairs."""
        for pair in (section.pair, section.least_adaptation):
            if pair is not None:
                yield pair.gains.projection_radius

    def uncovered(self, setting: Setting) -> str | None:
        """A disturbance of any kind."""
        return None if setting.still else "wind_not_covered"

    def asked(self, section: RateSection, given: Asked) -> Statements:
        """The pair is the one asked for."""
        for name in ("bandwidth", "adaptation_rate"):
            wanted: Fraction | None = getattr(given, name)
            same = wanted is None or section.pair is None or getattr(section.pair.gains, name) == wanted
            yield same, f"overrides.{name} is not what {self.key} judges"

    def said(self, section: RateSection) -> dict[str, object]:
        """Margins, and which condition binds."""
        if section.pair is None:
            return {}
        below = {claim: margin.below for claim, margin in section.pair.margins.items()}
        own: dict[str, object] = {"margins": below}
        return own if section.binds is None else {**own, "binds": section.binds}

    def shares(self, section: RateSection, recipe: Gains, ground: Ground) -> Shares:
        """Of the distance theorem A says that it stays below dbar."""
        del section
        setting = ground.setting
        return Shares(setting.n.feedback_gain * setting.reach, recipe.projection_radius)

    def claims(self, section: RateSection, recipe: Gains | None, ground: Ground) -> Iterator[Claim]:
        """Constants, margins, radius, curve."""
        if section.pair is not None:
            yield from _of_pair(section, section.pair, recipe, ground)
        setting, R_H, least = ground.setting, ground.projection_radius, section.least_adaptation
        if least is not None:
            name = f"A: (26a)-(26c) at {words(least.gains)}"
            yield ground.claim(name, (least,), lambda: _margins_hold(least, setting))
        curve, around = section.curve, section.around
        yield ground.claim(
            "A: the curve is feasible", (curve, R_H), lambda: _curve_holds(curve, R_H, setting)
        )
        if around is not None:
            yield ground.claim(
                "A: margins around", (around, R_H), lambda: _around_holds(around, R_H, setting)
            )


# -- reading


def _section(node: Node) -> RateSection:
    gains = (*GAINS, "margins")
    own = node.closed(
        "verdict",
        *gains,
        "ultimate_radius",
        "least_adaptation",
        "curve",
        "bandwidth_infimum",
        "binds",
        "shortfalls",
        optional=("margins_around",),
    )
    own.known("bandwidth_infimum", Node.number)
    verdict = own["verdict"].word(*VERDICTS)
    present = [own[key].value is not None for key in gains]
    if any(present) != all(present) or (verdict == "certified" and not all(present)):
        raise node.refused("has a part of its gains only")
    return RateSection(
        verdict=verdict,
        pair=RatePair(read_gains(own), _margins(own["margins"])) if all(present) else None,
        ultimate_radius=own.known("ultimate_radius", Node.number),
        least_adaptation=own.known("least_adaptation", _pair),
        curve=printed.read_curve(own["curve"]),
        around=own.get("margins_around", lambda item: printed.read_around(item, CONDITIONS)),
        binds=own.known("binds", Node.text),
        shortfalls=printed.read_shortfalls(own["shortfalls"]),
    )


def _pair(node: Node) -> RatePair:
    own = node.closed(*GAINS, "margins")
    return RatePair(read_gains(own), _margins(own["margins"]))


def _margins(node: Node) -> Margins:
    own = node.closed(*CONDITIONS)
    return {claim: enclosure(own[claim]) for claim in CONDITIONS}


# -- claims


def _of_pair(section: RateSection, pair: RatePair, recipe: Gains | None, ground: Ground) -> Iterator[Claim]:
    """What is claimed of the gains that the verdict is about."""
    setting, at = ground.setting, pair.gains
    radius = section.ultimate_radius
    shown = {name: ground.constants[name] for name in DERIVED}
    yield ground.claim("A: derived constants", (at, shown), lambda: _derived_hold(shown, setting, at))
    if section.verdict == "certified":
        yield ground.claim(f"A: (26a)-(26c) at {words(at)}", (pair,), lambda: _margins_hold(pair, setting))
        yield ground.claim(
            "A: its recipe", (pair, recipe), lambda: stated(recipe == at, "it is for other gains")
        )
    elif ground.silent:
        yield ground.claim(
            "A: its margins without a disturbance", (pair,), lambda: _margins_told(pair, setting)
        )
    else:
        yield ground.claim("A: what is told of it", (pair,), lambda: not_shown_to_hold(pair.margins.values()))
    if radius is not None:
        yield ground.claim(
            "A: ultimate radius",
            (at, radius),
            lambda: ultimate(
                radius, setting, at, own_distance_proof(setting, at)
            ),  # theorem B at the same gains
        )


def _margins_hold(pair: RatePair, setting: Setting) -> Outcome:
    """(26a)-(26c) hold with the margins printed."""
    found = margins_26(setting, pair.gains)
    return all_of(margin_at_least(found[claim], pair.margins[claim], f"({claim})") for claim in found)


def _margins_told(pair: RatePair, setting: Setting) -> Outcome:
    """The margins printed, whatever follows from them."""
    found = margins_26(setting, pair.gains)
    return all_of(told(found[claim], pair.margins[claim], f"({claim})") for claim in found)


def _derived_hold(constants: dict[str, Enclosure], setting: Setting, at: Gains) -> Outcome:
    """The derived constants at these gains; one without a bound claims nothing."""
    found = derived(setting, at)
    tops = {name: top for name in found if (top := constants[name].above) is not None}
    return all_of(at_most(found[name], top, name) for name, top in tops.items())


def _curve_holds(curve: tuple[Point, ...], R_H: Fraction, setting: Setting) -> Outcome:
    """Every point of the curve is feasible."""
    return all_of(
        stated(
            all(value > 0 for value in margins_26(setting, point.at(R_H)).values()),
            f"the point at bandwidth {float(point.bandwidth):.6g} is not feasible",
        )
        for point in curve
    )


def _around_holds(around: Around, R_H: Fraction, setting: Setting) -> Outcome:
    """The margins that are printed along the bandwidth."""
    return all_of(_along(around, R_H, setting)) if around.bandwidths else CONFIRMED


def _along(around: Around, R_H: Fraction, setting: Setting) -> Iterator[Outcome]:
    for k, bandwidth in enumerate(around.bandwidths):
        found = margins_26(setting, around.at(k, R_H))
        for claim, values in around.margins.items():
            below = values[k]
            if below is not None:
                yield at_least(found[claim], below, f"({claim}) at bandwidth {float(bandwidth):.6g}")
