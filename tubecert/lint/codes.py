"""The finding codes of this room, which `pages/codes.toml` explains, and how findings are made."""

from __future__ import annotations

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
HELD: Final = "TC417"
EXACT_SENSORS: Final = "TC418"

NOTABLE_DEFECT: Final = 0.02  # share of the tube that a plan's defect may take


def finding(
    spec: Spec, code: str, path: str, message: str, help: str = "", *, severity: Severity = Severity.WARNING
) -> Finding:
    """What is said of the key at a path."""
    return Finding(code=code, severity=severity, message=message, location=spec.location(path), help=help)
