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
from tubecert.recheck.specified.numbers import Rows
from tubecert.recheck.system import System

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


@dataclass(frozen=True, slots=True)
class Predictor:
    """A_m, P and Q as printed."""

    A_m: Rows
    P: Rows
    Q: Rows


@dataclass(frozen=True, slots=True, kw_only=True)
class RateSection(Section):
    """The pair that the verdict is about, that of least rate, the curve."""

    pair: RatePair | None
    predictor: Predictor | None
    ultimate_radius: Fraction | None
    least_adaptation: RatePair | None
    curve: tuple[Point, ...]
    around: Around | None
    binds: str | None
    below_twice_rate: bool


class Rates(Kind[RateSection, Gains]):
    """Certificate A."""

    key: ClassVar = "conditions_26"
    conditions: ClassVar = CONDITIONS
    unread: ClassVar = ("bandwidth_infimum", "binds")
    elastic: ClassVar = True

    def read(self, node: Node, n: int) -> RateSection:
        """The section `conditions_26`."""
        return _section(node, n)

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
        """Margins, whether omega lies below twice the rate, which condition binds."""
        if section.pair is None:
            return {}
        below = {claim: margin.below for claim, margin in section.pair.margins.items()}
        own: dict[str, object] = {"margins": below, "below_twice_rate": section.below_twice_rate}
        return own if section.binds is None else {**own, "binds": section.binds}

    def shares(self, section: RateSection, recipe: Gains, ground: Ground) -> Shares:
        """Of the distance theorem A says that it stays below dbar."""
        del section
        setting = ground.setting
        return Shares(setting.n.feedback_gain * setting.reach, recipe.projection_radius)

    def claims(self, section: RateSection, recipe: Gains | None, ground: Ground) -> Iterator[Claim]:
        """Predictor, constants, margins, radius, curve."""
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


def _section(node: Node, n: int) -> RateSection:
    gains = ("bandwidth", "adaptation_rate", "projection_radius", "margins")
    own = node.closed(
        "verdict",
        *gains,
        "A_m",
        "P",
        "Q",
        "ultimate_radius",
        "least_adaptation",
        "curve",
        "bandwidth_infimum",
        "binds",
        "below_twice_rate",
        "shortfalls",
        optional=("margins_around",),
    )
    own.known("bandwidth_infimum", Node.number)
    verdict = own["verdict"].word(*VERDICTS)
    matrices = [own.known(key, lambda item: _matrix(item, n)) for key in ("A_m", "P", "Q")]
    A_m, P, Q = matrices
    predictor = None if A_m is None or P is None or Q is None else Predictor(A_m, P, Q)
    present = [own[key].value is not None for key in gains]
    if any(present) != all(present) or (verdict == "certified" and not (all(present) and predictor)):
        raise node.refused("has a part of its gains only")
    pair = None
    if all(present):
        pair = RatePair(
            Gains(
                bandwidth=own["bandwidth"].decimal(),
                adaptation_rate=own["adaptation_rate"].decimal(),
                predictor_gain=None if predictor is None else _scalar(predictor.A_m),
                projection_radius=own["projection_radius"].decimal(),
            ),
            _margins(own["margins"]),
        )
    return RateSection(
        verdict=verdict,
        pair=pair,
        predictor=predictor,
        ultimate_radius=own.known("ultimate_radius", Node.number),
        least_adaptation=own.known("least_adaptation", _pair),
        curve=printed.read_curve(own["curve"]),
        around=own.get("margins_around", lambda item: printed.read_around(item, CONDITIONS)),
        binds=own.known("binds", Node.text),
        below_twice_rate=own["below_twice_rate"].flag(),
        shortfalls=printed.read_shortfalls(own["shortfalls"]),
    )


def _matrix(node: Node, n: int) -> Rows:
    return tuple(tuple(e.decimal() for e in row) for row in node.rows(n, n))


def _scalar(A: Rows) -> Fraction | None:
    """The g > 0 of A = -g I."""
    g = -A[0][0]
    same = all(e == (-g if i == j else 0) for i, row in enumerate(A) for j, e in enumerate(row))
    return g if same and g > 0 else None


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
    predictor, radius = section.predictor, section.ultimate_radius
    if predictor is not None:
        yield ground.claim("A: the predictor", (predictor,), lambda: _loop_holds(predictor, setting.system))
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
    below = at.bandwidth < 2 * setting.system.rate or not section.below_twice_rate
    yield ground.claim(
        "A: below twice the rate",
        (at, section.below_twice_rate),
        lambda: stated(below, "below_twice_rate is not what the bandwidth says"),
    )


def _loop_holds(shown: Predictor, s: System) -> Outcome:
    """The predictor that the section prints: A_m as specified, P = I, Q = -(A_m + A_m')."""
    A, P, Q = shown.A_m, shown.P, shown.Q
    n = len(s.states)
    if s.A_m is not None and s.A_m != A:
        return stated(False, "A_m is not that of the specification")
    if s.A_m is None and (
        A[0][0] >= 0 or any(A[i][j] != (A[0][0] if i == j else 0) for i in range(n) for j in range(n))
    ):
        return stated(False, "A_m is not -g I with g > 0")
    if any(P[i][j] != (i == j) for i in range(n) for j in range(n)):
        return stated(False, "P is not the identity")
    return stated(
        all(Q[i][j] == -(A[i][j] + A[j][i]) for i in range(n) for j in range(n)), "Q is not -(A_m + A_m')"
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
