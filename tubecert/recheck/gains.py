"""Claims about gains: what each section of the certificate states at its printed decimals.

A section whose verdict is not `certified` claims nothing here; its numbers are passed over.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.conditions import (
    DistanceProof,
    Setting,
    derived,
    distance_bound,
    margin,
    margins_26,
    own_distance_proof,
)
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Node, wrong
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.predictor import Gains
from tubecert.recheck.sampling import SampledGains, sampled_margin
from tubecert.recheck.system import System

SECTIONS = ("conditions_26", "distance", "sampled")


def is_certified(section: Node) -> bool:
    """Whether a section claims its gains."""
    verdict = section["verdict"].text()
    if verdict not in ("certified", "refuted", "undecided"):
        raise wrong("TC603", f"{section.path}.verdict is {verdict!r}, which is not known")
    return verdict == "certified"


def _optional(node: Node | None) -> Fraction | None:
    return None if node is None else node.number()


def gains_of(node: Node, predictor_gain: Fraction | None = None) -> Gains:
    """The gains of a pair, or of the section of A with the predictor that it prints as a matrix."""
    return Gains(
        bandwidth=node["bandwidth"].number(),
        adaptation_rate=node["adaptation_rate"].number(),
        predictor_gain=_optional(node.get("predictor_gain")) if predictor_gain is None else predictor_gain,
        projection_radius=node["projection_radius"].number(),
    )


def _sampled_gains(node: Node) -> SampledGains:
    return SampledGains(
        sample_time=node["sample_time"].number(),
        bandwidth=node["bandwidth"].number(),
        predictor_gain=node["predictor_gain"].number(),
        projection_radius=node["projection_radius"].number(),
    )


def _at_least(value: Ball, pair: Node, what: str) -> Outcome:
    """A margin: proven to be at least the lower end that is printed, which is positive."""
    below, above = pair.pair()
    printed = below.number()
    if printed <= 0:
        return stated(False, f"the printed margin of {what} is not positive")
    if above.value is not None and above.number() < printed:
        return stated(False, f"the printed margin of {what} is not an interval")
    if value >= exact(printed):
        return CONFIRMED
    if not value.is_finite():
        return Outcome(verdict="contradicted", why=f"the condition on {what} does not hold at these numbers")
    return Outcome(
        verdict="contradicted" if value < exact(printed) else "undecided",
        why=f"the margin of {what} is {float(value.lower()):.6g}, not {float(printed):.6g}",
    )


def _at_most(value: Ball, node: Node, what: str) -> Outcome:
    if value <= exact(node.number()):
        return CONFIRMED
    verdict = "contradicted" if value > exact(node.number()) or not value.is_finite() else "undecided"
    return Outcome(
        verdict=verdict,  # type: ignore[arg-type]
        why=f"{what} is {float(value.upper()):.12g}, more than {float(node.number()):.12g}",
    )


def _all(outcomes: Iterator[Outcome]) -> Outcome:
    """The first that is not confirmed."""
    return next((item for item in outcomes if not item.holds), CONFIRMED)


# -- certificate A -------------------------------------------------------------------------------------------------


def loop(section: Node, s: System) -> Outcome:
    """The predictor that the section prints: A_m as specified, P = I, Q = -(A_m + A_m')."""
    A, P, Q = ([row.numbers() for row in section[key].entries()] for key in ("A_m", "P", "Q"))
    n = len(s.states)
    if any(len(m) != n or any(len(row) != n for row in m) for m in (A, P, Q)):
        return stated(False, "A_m, P or Q has the wrong size")
    if s.A_m is not None and s.A_m != A:
        return stated(False, "A_m is not that of the specification")
    if s.A_m is None and _scalar(A) is None:
        return stated(False, "A_m is not -g I with g > 0")
    if any(P[i][j] != (i == j) for i in range(n) for j in range(n)):
        return stated(False, "P is not the identity")
    return stated(
        all(Q[i][j] == -(A[i][j] + A[j][i]) for i in range(n) for j in range(n)), "Q is not -(A_m + A_m')"
    )


def _scalar(A: list[list[Fraction]]) -> Fraction | None:
    """The g > 0 of A = -g I."""
    g = -A[0][0]
    same = all(e == (-g if i == j else 0) for i, row in enumerate(A) for j, e in enumerate(row))
    return g if same and g > 0 else None


def section_gains(section: Node) -> Gains:
    """The gains that certificate A prints."""
    return gains_of(section, _scalar([row.numbers() for row in section["A_m"].entries()]))


def margins(section: Node, setting: Setting, gains: Gains) -> Outcome:
    """(26a)-(26c) hold with the margins printed."""
    found = margins_26(setting, gains)
    printed = section["margins"]
    return _all(_at_least(found[claim], printed[claim], f"({claim})") for claim in found)


def derived_constants(constants: Node, setting: Setting, gains: Gains) -> Outcome:
    """The derived constants at these gains."""
    found = derived(setting, gains)
    return _all(_at_most(value, constants[name]["above"], name) for name, value in found.items())


def ultimate_26(section: Node, setting: Setting, gains: Gains) -> Outcome:
    """|x - x*| in the long run, by theorem B at the same gains."""
    node = section.get("ultimate_radius")
    if node is None:
        return CONFIRMED
    return _ultimate(node, setting, gains, own_distance_proof(setting, gains))


def _ultimate(node: Node, setting: Setting, gains: Gains, proof: DistanceProof) -> Outcome:
    bound = distance_bound(setting, gains, proof)
    if bound is None or not bound.supremum() < setting.reach:
        return Outcome(verdict="undecided", why="theorem B could not be shown at these gains")
    return _at_most(bound.ultimate() / root(setting.n.lower), node, "the ultimate radius")


def curve_26(section: Node, setting: Setting) -> Outcome:
    """Every point of the curve is feasible."""
    R_H = section["projection_radius"].number()
    return _all(
        stated(
            all(value > 0 for value in margins_26(setting, _curve_gains(point, R_H)).values()),
            f"{point.path} is not feasible",
        )
        for point in section["curve"].entries()
    )


def _curve_gains(point: Node, R_H: Fraction) -> Gains:
    return Gains(
        bandwidth=point["bandwidth"].number(),
        adaptation_rate=point["adaptation_rate"].number(),
        predictor_gain=_optional(point.get("predictor_gain")),
        projection_radius=R_H,
    )


# -- certificate B -------------------------------------------------------------------------------------------------


def decisive(section: Node) -> tuple[str, Node]:
    """The pair that the verdict of B is about."""
    for name in ("asked", "least_adaptation", "split"):
        if (pair := section.get(name)) is not None:
            return name, pair
    raise wrong("TC603", f"{section.path} has no pair of gains")


def distance_pair(pair: Node, setting: Setting, recipe: Node | None) -> Outcome:
    """Theorem B at a pair: with the recipe, if there is one, which must be for these gains, else with an own proof."""
    gains = gains_of(pair)
    if recipe is None:
        proof = own_distance_proof(setting, gains)
    else:
        if gains_of(recipe) != gains:
            return stated(False, "the recipe is for other gains")
        proof = DistanceProof(
            speed=exact(recipe["speed"].number()),
            prediction_error=exact(recipe["prediction_error"].number()),
            uncertainty=exact(recipe["uncertainty"].number()),
        )
    bound = distance_bound(setting, gains, proof)
    value = arb("nan") if bound is None else margin(setting, bound.supremum())
    found = _at_least(value, pair["margin"], "the distance")
    node = pair.get("ultimate_radius")
    return _ultimate(node, setting, gains, proof) if found.holds and node is not None else found


def distance_curve(section: Node, setting: Setting) -> Outcome:
    """Every point of the curve is feasible."""
    R_H = decisive(section)[1]["projection_radius"].number()

    def feasible(point: Node) -> bool:
        gains = _curve_gains(point, R_H)
        if not gains.sensible:
            return False
        bound = distance_bound(setting, gains, own_distance_proof(setting, gains))
        return bound is not None and bool(bound.supremum() < setting.reach)

    return _all(
        stated(feasible(point), f"{point.path} is not feasible") for point in section["curve"].entries()
    )


# -- certificate C -------------------------------------------------------------------------------------------------


def sampled(section: Node, setting: Setting, recipe: Node | None) -> Outcome:
    """Theorem C at the sample time."""
    gains = _sampled_gains(section)
    speed = None
    if recipe is not None:
        if _sampled_gains(recipe) != gains:
            return stated(False, "the recipe is for other gains")
        speed = exact(recipe["speed"].number())
    value, ultimate = sampled_margin(setting, gains, speed)
    found = _at_least(value, section["margin"], "the distance with sampled adaptation")
    node = section.get("ultimate_radius")
    return _at_most(ultimate, node, "the ultimate radius") if found.holds and node is not None else found


def agreed(section: Node) -> Outcome:
    """The radius in the long run that B prints is that of its pair."""
    own = decisive(section)[1].get("ultimate_radius")
    shown = section.get("ultimate_radius")
    if shown is None:
        return CONFIRMED
    return stated(own is not None and own.number() <= shown.number(), "it is not that of the pair")


def sampled_curve(section: Node, setting: Setting) -> Outcome:
    """Every point of the curve is feasible, at some predictor gain: that of the pair, or those that search proposes."""
    R_H, g = section["projection_radius"].number(), section["predictor_gain"].number()

    def feasible(point: Node) -> bool:
        Ts, omega = point["sample_time"].number(), point["bandwidth"].number()
        for gain in (g, omega, 10 * omega, *((1 / Ts, 10 / Ts) if Ts > 0 else ())):
            own = SampledGains(sample_time=Ts, bandwidth=omega, predictor_gain=gain, projection_radius=R_H)
            if sampled_margin(setting, own, None)[0] > 0:
                return True
        return False

    return _all(
        stated(feasible(point), f"{point.path} is not feasible") for point in section["curve"].entries()
    )
