"""Machines for tests of theorem H: constants of the reference systems as they were proven once, and a synthetic one."""

from __future__ import annotations

from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

from problems import alive
from tubecert.bounds.covariant import CovariantConstants
from tubecert.bounds.hardware import HardwareConstants
from tubecert.conditions.machine import Machine

from tubecert.bounds.constants import WindConstants
from tubecert.conditions.problem import TubeProblem, Wind
from tubecert.enclosure.constant import Constant
from tubecert.spec import Hardware

# every term of every formula is alive
ALIVE = {
    "feedback_slope": 2.1,
    "feedback_curvature": 0.7,
    "plan_tilt": 0.3,
    "plan_speed": 1.9,
    "drift_difference": 1.1,
    "drift_difference_metric": None,
    "drift_slope_metric": None,
    "drift_explained": 0.6,
    "feedback_drift": 0.4,
    "drift_rate": 0.5,
    "noise_size": 1.0,
    "noise_metric": 1.25,
    "noise_explained": 1.05,
    "input_rate": 0.9,
    "symbols": 0.06,
    "symbols_slope": 0.08,
}


def hardware_constants(**values: float | None) -> HardwareConstants:
    """Constants by name; what is not named is 0, and None where that is allowed."""
    found: dict[str, Any] = {}
    for item in fields(HardwareConstants):
        value = values.get(item.name, None if item.default is None else 0.0)
        found[item.name] = None if value is None else Constant(below=value, above=value)
    return HardwareConstants(**found)


def asked_of(**values: Any) -> Hardware:
    """What a specification says of the hardware; a sample time of 1 ms unless said otherwise."""
    given = {"sample_time": Fraction(1, 1000)} | values
    for key in ("sample_time", "delay", "noise"):
        if values.get("largest") == key or (key == "delay" and values.get("one_sample")):
            given[key] = None
    return Hardware(**given)


def asking(problem: TubeProblem, **values: Any) -> TubeProblem:
    """The same problem, with other hardware."""
    assert problem.machine is not None
    return replace(problem, machine=replace(problem.machine, asked=asked_of(**values)))


COVARIANT = {
    "drift_slope": 1.4,
    "form_slope": 0.4,
    "input_slope": 0.2,
    "input_gain": 1.6,
    "drift_metric": 3.3,
    "curvature": 0.3,
}
WIND = {"push": 1.2, "size": 0.9, "explained": 0.7}


def covariant_constants(**values: float) -> CovariantConstants:
    """The covariant constants by name."""
    return CovariantConstants(
        **{name: Constant(below=x, above=x) for name, x in (COVARIANT | values).items()}
    )


def windy(problem: TubeProblem, bound: Fraction | None, **values: float) -> TubeProblem:
    """The same problem, with a wind."""
    known = {name: Constant(below=x, above=x) for name, x in (WIND | values).items()}
    return replace(problem, wind=Wind(bound=bound, constants=WindConstants(**known)))


def alive_machine(values: dict[str, float | None] | None = None, **asked: Any) -> TubeProblem:
    """The synthetic problem in which every constant matters, with a machine."""
    defaults: dict[str, Any] = {
        "delay": Fraction(1, 2000),
        "noise": Fraction(1, 1000),
        "held": True,
    }
    machine = Machine(
        constants=hardware_constants(**(ALIVE | (values or {}))),
        clip=((Fraction("-0.3"), Fraction("0.35")), (Fraction("-0.1"), Fraction("0.05"))),
        asked=asked_of(**(defaults | asked)),
    )
    return replace(alive(values={"initial_distance": 0.05}), machine=machine)
