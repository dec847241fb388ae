"""The finding codes of this room, each with its one-line meaning, and how findings are made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tubecert.findings import Finding, Severity
from tubecert.spec import Spec

UNUSED: Final = "TC130"
CONFUSABLE: Final = "TC131"
UNITS: Final = "TC132"
IDLE_STATE: Final = "TC133"
EMPTY_EXPECTATION: Final = "TC134"
NOT_POSITIVE: Final = "TC135"
METRIC_ALONE: Final = "TC136"
NO_UNCERTAINTY: Final = "TC205"
LOOSE_BOUND: Final = "TC206"
BROKEN_BOUND: Final = "TC207"
SLOW_MODE: Final = "TC208"
INDEFINITE: Final = "TC301"
NOT_CONTRACTING: Final = "TC302"
NOT_KILLING: Final = "TC303"
LOOSE_METRIC_BOUND: Final = "TC304"
BROKEN_METRIC_BOUND: Final = "TC305"
PLAN_OUTSIDE: Final = "TC403"
NO_EQUILIBRIUM: Final = "TC404"
START_OUTSIDE: Final = "TC405"
NO_ROOM: Final = "TC406"
PLAN_DEFECT: Final = "TC407"
COLLISION: Final = "TC408"
OBSTACLE_OUTSIDE: Final = "TC409"
PLAN_TIME_UNIT: Final = "TC413"
PLAN_EXCHANGED: Final = "TC414"
PLAN_BEYOND_LIMITS: Final = "TC415"
LEFT_OUT: Final = "TC416"

NOTABLE_DEFECT: Final = 0.02  # share of the tube that a plan's defect may take

CODES: Final[Mapping[str, str]] = {
    UNUSED: "a parameter or a definition is never used",
    CONFUSABLE: "two names, or a name and a function, are easily confused",
    UNITS: "some states or inputs have no unit, or one that the expressions do not suit",
    IDLE_STATE: "a state cannot change",
    EMPTY_EXPECTATION: "an expectation that expects nothing",
    NOT_POSITIVE: "a mass, an inertia or a length is not positive",
    METRIC_ALONE: "the question is about a metric alone",
    NO_UNCERTAINTY: "there is no uncertainty: h is zero",
    LOOSE_BOUND: "a declared bound of h is larger than its expression needs",
    BROKEN_BOUND: "the expression of h breaks a declared bound",
    SLOW_MODE: "a mode that inputs cannot reach is slower than the rate",
    INDEFINITE: "the dual metric is not positive definite at a point (C1)",
    NOT_CONTRACTING: "the metric does not contract at its rate at a point (C2)",
    NOT_KILLING: "the metric is not compatible with an input (C3)",
    LOOSE_METRIC_BOUND: "a declared bound of the metric is larger than needed",
    BROKEN_METRIC_BOUND: "the metric breaks a declared bound at a point",
    PLAN_OUTSIDE: "the plan leaves the safe set",
    NO_EQUILIBRIUM: "the point to be held is no equilibrium",
    START_OUTSIDE: "the initial state is not in the safe set",
    NO_ROOM: "the tube cannot lie in the safe set",
    PLAN_DEFECT: "the plan misses the dynamics by a part of the tube that matters",
    COLLISION: "the plan meets an obstacle",
    OBSTACLE_OUTSIDE: "an obstacle lies outside the safe set",
    PLAN_TIME_UNIT: "the times of a plan file seem to be no seconds",
    PLAN_EXCHANGED: "two columns of a plan file seem to be exchanged",
    PLAN_BEYOND_LIMITS: "an input of the plan is beyond the limits",
    LEFT_OUT: "what is read and no part of what is proven",
}


def finding(
    spec: Spec, code: str, path: str, message: str, help: str = "", *, severity: Severity = Severity.WARNING
) -> Finding:
    """What is said of the key at a path."""
    return Finding(code=code, severity=severity, message=message, location=spec.location(path), help=help)
