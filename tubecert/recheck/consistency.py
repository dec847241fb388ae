"""What the parts of a certificate say about one another, compared exactly: no arithmetic beyond equality.

What is assumed is part of the claim: the list must be that of this format, each with its parameters.
"""

from __future__ import annotations

from collections.abc import Iterator
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
        yield reason["claim"].text() == "gains_suffice", f"{_CLAIMS_ONLY} a reason is not that gains suffice"
        named = reason["section"].text()
        yield named in deciding, f"a reason names {named!r}, which does not decide"
        own = {key: value.number() for key, value in reason["margins"].items()}
        same = own == _margins(named, result[named])
        yield same, f"a reason repeats the margins of {named} otherwise"


def _margins(name: str, section: Node) -> dict[str, Fraction]:
    """The proven side of every margin of a section, at the gains that decide."""
    if name == "conditions_26":
        return {key: pair.pair()[0].number() for key, pair in section["margins"].items()}
    if name == "distance":
        decisive = section.get("asked") or section.get("least_adaptation") or section["split"]
        return {name: decisive["margin"].pair()[0].number()}
    return {name: section["margin"].pair()[0].number()}


def assumptions(result: Node, s: System) -> Outcome:
    """The list of what is assumed is that of this format, each with the parameters of the specification."""
    shown = result["assumptions"].entries()
    wanted = _assumed(s, result["metric"].get("unique_geodesics"))
    for own, (name, parameters) in zip(shown, wanted, strict=False):
        members = {key: node for key, node in own.items() if key != "id"}
        same = own["id"].text() == name and members.keys() == parameters.keys()
        if not (same and all(_says(node, parameters[key]) for key, node in members.items())):
            return stated(False, f"{own.path} is not {name} as the specification has it")
    return stated(len(shown) == len(wanted), "the list has fewer or more entries than this format knows")


Parameters = dict[str, "str | bool | Fraction | list[Fraction | None]"]


def _assumed(s: System, geodesics: Node | None) -> list[tuple[str, Parameters]]:
    return [
        ("least_feedback", {}),
        _geodesics(s, geodesics),
        ("start_at_rest", {}),
        ("hard_projection", {}) if s.smooth is None else ("smooth_projection", {"layer": s.smooth}),
        ("perfect_state", {}),
        ("first_order_filter", {}),
        ("for_all_time", {}) if s.horizon is None else ("up_to_horizon", {"horizon": s.horizon}),
        ("uncertainty_as_declared", {})
        if s.h is None
        else ("uncertainty_as_given", {"any_within_bounds": "h" in s.declared}),
    ]


def _geodesics(s: System, test: Node | None) -> tuple[str, Parameters]:
    if s.flat:
        return "straight_geodesics", {}
    if test is None:
        return "exact_geodesics", {"uniqueness": "assumed"}
    value = [None if end.value is None else end.number() for end in test["value"].pair()]
    uniqueness = "proven" if test["holds"].flag() else "assumed"
    return "exact_geodesics", {"uniqueness": uniqueness, "value": value}


def _says(node: Node, wanted: object) -> bool:
    if isinstance(wanted, bool):
        return node.flag() is wanted
    if isinstance(wanted, str):
        return node.text() == wanted
    if isinstance(wanted, list):
        return [None if end.value is None else end.number() for end in node.pair()] == wanted
    return node.number() == wanted


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
