"""Claims about gains: what each section of the certificate states at its printed decimals.

A section whose verdict is not `certified` does not claim its own gains; what it states beside them is examined.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.certificate import (
    Around,
    DistancePair,
    DistanceRecipe,
    DistanceSection,
    Pair,
    Point,
    Predictor,
    RateSection,
    SampledRecipe,
    SampledSection,
)
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
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.predictor import Gains
from tubecert.recheck.reasons import Enclosure
from tubecert.recheck.sampling import SampledGains, sampled_margin
from tubecert.recheck.system import System

SECTIONS = ("conditions_26", "distance", "sampled")


def gains_of(pair: Pair) -> Gains:
    """The gains of a pair."""
    return Gains(
        bandwidth=pair.bandwidth,
        adaptation_rate=pair.adaptation_rate,
        predictor_gain=pair.predictor_gain,
        projection_radius=pair.projection_radius,
    )


def _of_point(point: Point, R_H: Fraction) -> Gains:
    return gains_of(Pair(point.bandwidth, point.adaptation_rate, point.predictor_gain, R_H))


def _at_least(value: Ball, printed: Enclosure, what: str) -> Outcome:
    """A margin: proven to be at least the lower end that is printed, which is positive."""
    below = printed.below
    if below is None or below <= 0:
        return stated(False, f"the printed margin of {what} is not positive")
    if not printed.is_interval:
        return stated(False, f"the printed margin of {what} is not an interval")
    return _above(value, below, what)


def _above(value: Ball, below: Fraction, what: str) -> Outcome:
    if value >= exact(below):
        return CONFIRMED
    if not value.is_finite():
        return Outcome(verdict="contradicted", why=f"the condition on {what} does not hold at these numbers")
    return Outcome(
        verdict="contradicted" if value < exact(below) else "undecided",
        why=f"the margin of {what} is {float(value.lower()):.6g}, not {float(below):.6g}",
    )


def _at_most(value: Ball, printed: Fraction, what: str) -> Outcome:
    if value <= exact(printed):
        return CONFIRMED
    verdict = "contradicted" if value > exact(printed) or not value.is_finite() else "undecided"
    return Outcome(
        verdict=verdict,  # type: ignore[arg-type]
        why=f"{what} is {float(value.upper()):.12g}, more than {float(printed):.12g}",
    )


def _all(outcomes: Iterable[Outcome]) -> Outcome:
    """The first that is not confirmed."""
    return next((item for item in outcomes if not item.holds), CONFIRMED)


# -- certificate A -------------------------------------------------------------------------------------------------


def loop(printed: Predictor, s: System) -> Outcome:
    """The predictor that the section prints: A_m as specified, P = I, Q = -(A_m + A_m')."""
    A, P, Q = printed.A_m, printed.P, printed.Q
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


def margins(printed: dict[str, Enclosure], setting: Setting, gains: Gains) -> Outcome:
    """(26a)-(26c) hold with the margins printed."""
    found = margins_26(setting, gains)
    return _all(_at_least(found[claim], printed[claim], f"({claim})") for claim in found)


def derived_constants(constants: dict[str, Enclosure], setting: Setting, gains: Gains) -> Outcome:
    """The derived constants at these gains; one without a bound claims nothing."""
    found = derived(setting, gains)
    tops = {name: top for name in found if (top := constants[name].above) is not None}
    return _all(_at_most(found[name], top, name) for name, top in tops.items())


def ultimate_26(radius: Fraction, setting: Setting, gains: Gains) -> Outcome:
    """|x - x*| in the long run, by theorem B at the same gains."""
    return _ultimate(radius, setting, gains, own_distance_proof(setting, gains))


def _ultimate(radius: Fraction, setting: Setting, gains: Gains, proof: DistanceProof) -> Outcome:
    bound = distance_bound(setting, gains, proof)
    if bound is None or not bound.supremum() < setting.reach:
        return Outcome(verdict="undecided", why="theorem B could not be shown at these gains")
    return _at_most(bound.ultimate() / root(setting.n.lower), radius, "the ultimate radius")


def curve_26(curve: Iterable[Point], R_H: Fraction, setting: Setting) -> Outcome:
    """Every point of the curve is feasible."""
    return _all(
        stated(
            all(value > 0 for value in margins_26(setting, _of_point(point, R_H)).values()),
            f"the point at bandwidth {float(point.bandwidth):.6g} is not feasible",
        )
        for point in curve
    )


def around_26(around: Around, R_H: Fraction, setting: Setting) -> Outcome:
    """The margins that are printed along the bandwidth."""
    outcomes = []
    for k, bandwidth in enumerate(around.bandwidths):
        found = margins_26(
            setting, gains_of(Pair(bandwidth, around.adaptation_rate, around.predictor_gain, R_H))
        )
        printed = {claim: values[k] for claim, values in around.margins.items()}
        outcomes += [
            _above(found[claim], below, f"({claim}) at bandwidth {float(bandwidth):.6g}")
            for claim, below in printed.items()
            if below is not None
        ]
    return _all(outcomes)


# -- certificate B -------------------------------------------------------------------------------------------------


def distance_pair(pair: DistancePair, setting: Setting, recipe: DistanceRecipe | None) -> Outcome:
    """Theorem B at a pair: with the recipe, if there is one, which must be for these gains, else with an own proof."""
    gains = gains_of(pair.gains)
    if recipe is None:
        proof = own_distance_proof(setting, gains)
    elif recipe.gains != pair.gains:
        return stated(False, "the recipe is for other gains")
    else:
        proof = DistanceProof(
            speed=exact(recipe.speed),
            prediction_error=exact(recipe.prediction_error),
            uncertainty=exact(recipe.uncertainty),
        )
    found = _at_least(_distance_margin(setting, gains, proof), pair.margin, "the distance")
    radius = pair.ultimate_radius
    return _ultimate(radius, setting, gains, proof) if found.holds and radius is not None else found


def _distance_margin(setting: Setting, gains: Gains, proof: DistanceProof) -> Ball:
    bound = distance_bound(setting, gains, proof)
    return arb("nan") if bound is None else margin(setting, bound.supremum())


def _own_margin(setting: Setting, gains: Gains) -> Ball:
    return (
        _distance_margin(setting, gains, own_distance_proof(setting, gains)) if gains.sensible else arb("nan")
    )


def agreed(section: DistanceSection, decisive: DistancePair) -> Outcome:
    """The radius in the long run that B prints is that of its pair."""
    own, shown = decisive.ultimate_radius, section.ultimate_radius
    return stated(shown is None or (own is not None and own <= shown), "it is not that of the pair")


def distance_curve(curve: Iterable[Point], R_H: Fraction, setting: Setting) -> Outcome:
    """Every point of the curve is feasible."""
    return _all(
        stated(
            bool(_own_margin(setting, _of_point(point, R_H)) > 0),
            f"the point at bandwidth {float(point.bandwidth):.6g} is not feasible",
        )
        for point in curve
    )


def around_distance(around: Around, R_H: Fraction, setting: Setting) -> Outcome:
    """The margins that are printed along the bandwidth."""
    return _all(
        _above(
            _own_margin(
                setting, gains_of(Pair(bandwidth, around.adaptation_rate, around.predictor_gain, R_H))
            ),
            below,
            f"the distance at bandwidth {float(bandwidth):.6g}",
        )
        for bandwidth, below in zip(around.bandwidths, around.margins["margin"], strict=True)
        if below is not None
    )


# -- certificate C -------------------------------------------------------------------------------------------------


def sampled(section: SampledSection, setting: Setting, recipe: SampledRecipe) -> Outcome:
    """Theorem C at the sample time."""
    pair, printed = section.pair, section.margin
    assert pair is not None
    assert printed is not None
    if recipe.gains != pair:
        return stated(False, "the recipe is for other gains")
    gains = SampledGains(pair.sample_time, pair.bandwidth, pair.predictor_gain, pair.projection_radius)
    value, ultimate = sampled_margin(setting, gains, exact(recipe.speed))
    found = _at_least(value, printed, "the distance with sampled adaptation")
    radius = section.ultimate_radius
    return _at_most(ultimate, radius, "the ultimate radius") if found.holds and radius is not None else found


def sampled_curve(section: SampledSection, setting: Setting) -> Outcome:
    """Every point of the curve is feasible, at some predictor gain: that of the pair, or those that search proposes."""
    if section.pair is None:
        return CONFIRMED
    R_H, g = section.pair.projection_radius, section.pair.predictor_gain

    def feasible(omega: Fraction, Ts: Fraction) -> bool:
        proposed = (g, omega, 10 * omega, *((1 / Ts, 10 / Ts) if Ts > 0 else ()))
        return any(
            bool(sampled_margin(setting, SampledGains(Ts, omega, gain, R_H), None)[0] > 0)
            for gain in proposed
        )

    return _all(
        stated(feasible(omega, Ts), f"the point at bandwidth {float(omega):.6g} is not feasible")
        for omega, Ts in section.curve
    )


def below_twice_rate(section: RateSection, rate: Fraction) -> Outcome:
    """The bandwidth lies below twice the rate, if that is said."""
    lies = section.pair is not None and section.pair.gains.bandwidth < 2 * rate
    return stated(lies or not section.below_twice_rate, "below_twice_rate is not what the bandwidth says")
