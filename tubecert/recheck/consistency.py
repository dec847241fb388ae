"""What the parts of a certificate say about one another, compared exactly: no arithmetic beyond equality.

The statements of assumptions are part of the claim: they must be those of this format, word for word.
"""

from __future__ import annotations

from collections.abc import Iterator
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from fractions import Fraction
from typing import Any

from tubecert.recheck.conditions import USED
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Node, digest, wrong
from tubecert.recheck.gains import SECTIONS, is_certified
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.system import System

OTHERS = ("f", "plan_defect", "input_gain_least", "contraction_excess")
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
_CLAIMS_ONLY = "the verdict is certified, but"


def specification(result: Node, s: System) -> Outcome:
    """What is repeated from the specification is the same there."""
    return _first(_specification(result, s))


def _specification(result: Node, s: System) -> Iterator[tuple[bool, str]]:
    spec, metric, tube = result["spec"], result["metric"], result["tube"]
    effective = spec["effective"]
    yield (
        spec["effective_hash"].text() == digest(effective.value),
        "spec.effective_hash is not that of spec.effective",
    )
    ranges = {name: tuple(item.number() for item in side.pair()) for name, side in result["safe_set"].items()}
    yield ranges == s.safe_set, "safe_set is not that of the specification"
    own = effective["metric"]
    if "dual_metric" in own.mapping():
        same = metric["dual_metric"].value == own["dual_metric"].value
        yield same, "metric.dual_metric is not that of the specification"
    yield metric["rate"].number() == s.rate, "metric.rate is not that of the specification"
    yield metric["verdict"].text() == "certified", f"{_CLAIMS_ONLY} metric.verdict is not"
    yield tube["epsilon"].number() == s.epsilon, "tube.epsilon is not that of the specification"
    yield tube["rho_a"].number() == s.rho_a, "tube.rho_a is not that of the specification"
    yield tube["rho_r"].number() == tube["rho"].number() - s.rho_a, "tube.rho_r is not rho - rho_a"
    yield set(tube["half_widths"].mapping()) == set(s.states), "tube.half_widths are not those of the states"
    kind = effective["trajectory"]["kind"].text()
    yield result["plan"]["kind"].text() == kind, "plan.kind is not that of the specification"
    if kind in ("equilibrium", "expressions"):
        yield result["plan"]["interpolation"].text() == "exact", "plan.interpolation is not `exact`"
    declared = {name: value.number() for name, value in result["declared"].items()}
    wanted = s.declared if s.h is None else {}
    yield declared.keys() == wanted.keys(), "declared is not what the specification declares"
    for name, value in wanted.items():  # rounded up where a float lies below the decimal
        used = result["constants"][name]["above"].number()
        yield (
            value <= declared[name] <= used,
            f"declared.{name} is not between the specification's and the constant",
        )
    yield from _overrides(result["overrides"], s, result["conditions_26"])


def _overrides(overrides: Node, s: System, section: Node) -> Iterator[tuple[bool, str]]:
    for name, value in (("epsilon", s.epsilon), ("rho_a", s.rho_a)):
        given = overrides.get(name)
        yield given is None or given.number() == value, f"overrides.{name} is not what spec.effective has"
    for name in ("bandwidth", "adaptation_rate"):
        given, shown = overrides.get(name), section.get(name)
        same = given is None or shown is None or given.number() == shown.number()
        yield same, f"overrides.{name} is not what conditions_26 judges"


def bounds(result: Node) -> Outcome:
    """Every constant is there, as an interval; those of the metric agree with the section on it."""
    return _first(_bounds(result))


def _bounds(result: Node) -> Iterator[tuple[bool, str]]:
    constants, metric = result["constants"], result["metric"]
    for name in (*USED, *OTHERS, *(DERIVED if is_certified(result["conditions_26"]) else ())):
        ends = [end for side in ("below", "above") if (end := constants[name][side]).value is not None]
        yield len(ends) < 2 or ends[0].number() <= ends[1].number(), f"constants.{name} is not an interval"
    for name in ("lower", "upper"):
        pair = [item.number() for item in metric[name].pair()]
        own = [constants[name][side].number() for side in ("below", "above")]
        yield pair == own, f"metric.{name} is not constants.{name}"
    for name in ("lower_on_set", "upper_on_set"):
        low, high = (item.number() for item in metric[name].pair())
        yield low <= high, f"metric.{name} is not an interval"
    margin = metric.get("margin")
    if margin is not None:
        low, high = (item.number() for item in margin.pair())
        rates = [item.number() for item in metric["largest_rate"].pair()]
        yield 0 < low <= high, "metric.margin is not a positive interval"
        yield rates[0] <= rates[1], "metric.largest_rate is not an interval"


def verdict(result: Node) -> Outcome:
    """The verdict is that of the sections that decide it, by the corrected formulas, and so are its reasons."""
    return _first(_verdict(result))


def _verdict(result: Node) -> Iterator[tuple[bool, str]]:
    yield result["formulas"].text() == "corrected", f"{_CLAIMS_ONLY} formulas is not `corrected`"
    deciding = result["decided_by"].texts()
    yield bool(deciding) and len(set(deciding)) == len(deciding), "decided_by is not a list of sections"
    for name in deciding:
        if name not in SECTIONS:
            raise wrong("TC603", f"{result.path}.decided_by names {name!r}, which is no section")
        section = result[name]
        yield is_certified(section), f"{_CLAIMS_ONLY} {name}, which decides, is not"
        yield not section["shortfalls"].entries(), f"{_CLAIMS_ONLY} {name} lists shortfalls"
    for reason in result["reasons"].entries():
        yield reason["verdict"].text() == "certified", f"{_CLAIMS_ONLY} a reason says otherwise"
        claim = reason["claim"].text()
        yield claim in deciding, f"a reason names {claim!r}, which does not decide"


def assumptions(result: Node, s: System) -> Outcome:
    """The list of what is assumed is complete, in the words of the format."""
    shown = result["assumptions"].texts()
    geodesics = result["metric"].get("unique_geodesics")
    for wanted in _assumed(s, geodesics):
        if wanted not in shown:
            return stated(False, f"the list lacks: {wanted}")
    return stated(len(shown) == 8, "the list has other entries than this format knows")


def _assumed(s: System, geodesics: Node | None) -> list[str]:
    covers = "h" in s.declared
    return [
        "the feedback is the least k of the quadratic program with this metric and rate (docs/theory, section 0); the "
        "controller acts in continuous time and exactly (certificate C: with sampled adaptation), evaluates "
        "f(x*) + B(x*) u* itself and never the derivative of a stored plan",
        _geodesics(s, geodesics),
        "xhat(0) = x(0), the filter starts at rest (u_a(0) = 0), and sigma_hat(0) lies in the projection's ball",
        "the projection is hard"
        if s.smooth is None
        else f"the projection is smooth with layer {float(s.smooth):g}",
        "the full state is measured without noise or delay, and inputs do not saturate",
        "the filter is first order, C(s) = omega/(s + omega)",
        "the claim is for all t >= 0"
        if s.horizon is None
        else f"the claim is for 0 <= t <= {float(s.horizon):g} s",
        "the uncertainty obeys its declared bounds on the tube"
        if s.h is None
        else "the uncertainty is the expression of the specification"
        + (", or any other within the bounds h, h_x, h_t of this certificate" if covers else ""),
    ]


def _geodesics(s: System, test: Node | None) -> str:
    if s.flat:
        return "minimising geodesics are straight lines, which the constant metric makes unique"
    exact = "the controller finds the minimising geodesic exactly"
    if test is None:
        return f"{exact}, and it is unique in the tube (not proven here)"
    below, above = test["value"].pair()
    if test["holds"].flag():
        most = _six_digits(above.number(), ROUND_CEILING)
        return f"{exact}; it is unique in the tube: proven, G rho + L_G rho^2/8 <= {most}"
    reaches = below.number()
    size = (
        "could not be bounded by less than 1"
        if reaches < 1
        else f"reaches {_six_digits(reaches, ROUND_FLOOR)}"
    )
    return f"{exact}, and it is unique in the tube (not proven: G rho + L_G rho^2/8 {size})"


def _six_digits(value: Fraction, rounding: str) -> str:
    return f"{float(Context(prec=6, rounding=rounding).divide(value.numerator, value.denominator)):.6g}"


def _first(statements: Iterator[tuple[bool, str]]) -> Outcome:
    for holds, why in statements:
        if not holds:
            return stated(False, why)
    return CONFIRMED


def unread(result: Node) -> list[str]:
    """Members of the result that are for orientation: nothing rests on them, nothing here looks at them."""
    known: set[str] = {
        "assumptions",
        "conditions_26",
        "constants",
        "decided_by",
        "declared",
        "distance",
        "formulas",
        "metric",
        "overrides",
        "plan",
        "proof",
        "reasons",
        "safe_set",
        "sampled",
        "spec",
        "tube",
        "verdict",
    }
    members: dict[str, Any] = result.mapping()
    return sorted(set(members) - known)
