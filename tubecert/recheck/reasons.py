"""Reasons and assumptions of a certificate: ids with parameters, each id with the parameters that it has.

What a reason says of gains is a statement and is compared; of failures of a synthesis only a mode is examined.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node, each, enclosure, maybe
from tubecert.recheck.kinds.kind import VERDICTS
from tubecert.recheck.kinds.table import CONDITIONS
from tubecert.recheck.specified.numbers import Numbers

Reads = Callable[[Node], object]
Form = tuple[Mapping[str, Reads], Mapping[str, Reads]]  # members that must be there, and those that may
Parameters = dict[str, object]


@dataclass(frozen=True, slots=True)
class Reason:
    """A claim by its id and parameters, its verdict, and the point that shows it: (time, if there is one; state)."""

    claim: str
    parameters: Parameters
    verdict: str
    at: tuple[Fraction | None, Numbers] | None


@dataclass(frozen=True, slots=True)
class Assumption:
    """What is not proven, by its id and parameters."""

    id: str
    parameters: Parameters


def _word(*words: str) -> Reads:
    return lambda node: node.word(*words)


def _margins(node: Node) -> dict[str, Fraction]:
    node.closed(optional=CONDITIONS)
    return {key: value.number() for key, value in node.items()}


def _read(
    node: Node, key: str, forms: Mapping[str, Form], beside: tuple[str, ...] = ()
) -> tuple[str, Parameters, Members]:
    """An object whose member `key` names its form; members `beside` may be there whatever it names."""
    named = node.mapping().get(key)
    if not isinstance(named, str) or named not in forms:
        raise node.refused(f"must have {key}, one of {', '.join(forms)}")
    required, optional = forms[named]
    own = node.closed(key, *required, optional=(*optional, *beside))
    found: Parameters = {name: read(own[name]) for name, read in required.items()}
    found |= {name: read(own[name]) for name, read in optional.items() if name in own}
    return named, found, own


def read_reason(node: Node, n: int) -> Reason:
    """One of `result.reasons`."""
    claim, parameters, own = _read(node, "claim", _CLAIMS, ("verdict", "at"))
    return Reason(claim, parameters, own["verdict"].word(*VERDICTS), own.get("at", lambda at: _at(at, n)))


def read_assumption(node: Node) -> Assumption:
    """One of `result.assumptions`."""
    named, parameters, _ = _read(node, "id", _ASSUMPTIONS)
    return Assumption(named, parameters)


def read_outcome(node: Node) -> None:
    """What became of an attempt to find a metric: for orientation."""
    _read(node, "id", _OUTCOMES)


def _at(node: Node, n: int) -> tuple[Fraction | None, Numbers]:
    own = node.closed("x", optional=("t",))
    if len(own["x"].entries()) not in (0, n):  # where the curve is not known there is no point of it
        raise own["x"].refused(f"must have {n} entries")
    return own.get("t", Node.number), each(Node.number)(own["x"])


def _claim(node: Node) -> str:
    return _read(node, "claim", _CLAIMS)[0]


def _texts(node: Node) -> object:
    return node.texts()


_SIDE = _word("lower", "upper")
_NONE: Form = ({}, {})

_CLAIMS: Mapping[str, Form] = {
    "rank_of_B": _NONE,
    "metric_found": ({"failure": lambda node: _read(node, "id", _FAILURES)[:2]}, {}),
    "metric_definite": _NONE,
    "metric_killing": ({"input": Node.text}, {"residual": Node.number}),
    "metric_contraction": ({"rate": Node.decimal, "largest_rate": enclosure}, {}),
    "metric_bound": ({"side": _SIDE, "declared": Node.decimal, "reaches": maybe}, {}),
    "tube_radius": (
        {"obstacle": _word("out_of_range", "metric_unbounded", "not_settled"), "radius": Node.decimal},
        {},
    ),
    "plan_bounded": _NONE,
    "tube_in_safe_set": (
        {"radius": Node.decimal, "state": Node.text, "side": _SIDE, "excess": Node.number},
        {},
    ),
    "plan_in_safe_set": ({"state": Node.text, "side": _SIDE, "excess": Node.number}, {}),
    "start_in_tube": ({"state": Node.text, "off": Node.number, "half_width": Node.decimal}, {}),
    "constant_bounded": ({"constant": Node.text}, {}),
    "uncertainty_bound": ({"constant": Node.text, "declared": Node.number, "reaches": maybe}, {}),
    "obstacle_cleared": ({"obstacle": Node.count, "clearance": enclosure}, {}),
    "input_within_limits": (
        {"input": Node.text, "side": _SIDE, "limit": Node.decimal, "plan": maybe},
        {"section": Node.text, "reaches": Node.number, "feedback": Node.number, "adaptation": Node.number},
    ),
    "gains_suffice": ({"section": Node.text, "margins": _margins}, {"predictor_gain": Node.decimal}),
    "condition_holds": (
        {"section": Node.text, "condition": Node.text},
        {
            "constant": Node.text,
            "margin": enclosure,
            "needed": Node.number,
            "allowed": Node.number,
            "beyond": Node.flag,
            "blocked_by": Node.text,
            "predictor_gain": Node.decimal,
        },
    ),
}

_FAILURES: Mapping[str, Form] = {
    "rank_of_B": _NONE,
    "uncontrollable_mode": (
        {"mode": lambda node: [item.number() for item in node.pair()], "limit": Node.decimal},
        {},
    ),
    "variable_forbidden": ({"variable": Node.text, "permitted": _texts}, {}),
    "no_frame": _NONE,
    "not_writable": ({"code": Node.text}, {}),
    "not_proven_as_written": ({"condition": _claim}, {}),
    "condition_number": ({"rate": Node.decimal, "condition_number": Node.number}, {}),
    "none_certified": (
        {
            "compared": Node.count,
            "slowest": Node.decimal,
            "fastest": Node.decimal,
            "slow": _claim,
            "slow_verdict": _word(*VERDICTS),
            "fast": _claim,
            "fast_verdict": _word(*VERDICTS),
        },
        {},
    ),
    "nothing_found": (
        {
            "attempts": Node.count,
            "routes": _texts,
            "degrees": lambda node: [item.count() for item in node.entries()],
            "last": lambda node: None if node.value is None else read_outcome(node),
        },
        {},
    ),
}

_OUTCOMES: Mapping[str, Form] = {
    "proven": _NONE,
    "no_proposal": ({"route": Node.text, "status": Node.text}, {}),
    "wrong_shape": ({"route": Node.text}, {}),
    "not_proven": ({"route": Node.text, "condition": _claim, "verdict": _word(*VERDICTS)}, {}),
    "condition_unbounded": ({"route": Node.text}, {}),
}

_ASSUMPTIONS: Mapping[str, Form] = {
    "least_feedback": _NONE,
    "straight_geodesics": _NONE,
    "exact_geodesics": ({"uniqueness": _word("proven", "assumed")}, {"value": enclosure}),
    "start_at_rest": _NONE,
    "hard_projection": _NONE,
    "smooth_projection": ({"layer": Node.decimal}, {}),
    "perfect_state": _NONE,
    "first_order_filter": _NONE,
    "for_all_time": _NONE,
    "up_to_horizon": ({"horizon": Node.decimal}, {}),
    "uncertainty_as_declared": _NONE,
    "uncertainty_as_given": ({"any_within_bounds": Node.flag}, {}),
    "parameters_within": _NONE,
    "wind_within": ({"bound": Node.decimal}, {"rate": Node.decimal}),
}
