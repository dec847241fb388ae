"""The windows that a specification cuts its plan into."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

from tubecert.recheck.document import Node
from tubecert.recheck.specified.hardware import Disturbance, Hardware
from tubecert.recheck.specified.numbers import Numbers, positive, whole
from tubecert.recheck.specified.trajectory import AnyPlan, Trajectory

KEY = "windows"
_MOST = 200


def read_windows(
    node: Node, trajectory: Trajectory, machine: Hardware | None, wind: Disturbance | None
) -> Numbers:
    """The times 0 = T_0 < ... < T_J, the horizon, in s; of a machine and a disturbance that are given, if any."""
    searched = machine is not None and (
        (machine.delay is None and not machine.one_sample) or None in (machine.sample_time, machine.noise)
    )
    if searched or (wind is not None and wind.bound is None):
        raise node.refused("is there beside a number that is searched for")
    horizon = trajectory.horizon
    if horizon is None or isinstance(trajectory, AnyPlan):
        raise node.refused("is there without a plan that has an end")
    if isinstance(node.value, str):
        count = whole(node)
        if not 0 < count <= _MOST:
            raise node.refused(f"is not from 1 to {_MOST}")
        return tuple(horizon * Fraction(j, count) for j in range(count + 1))
    between = tuple(positive(item) for item in node.entries())
    if not 0 < len(between) < _MOST:
        raise node.refused(f"does not have 1 to {_MOST - 1} times")
    times = (Fraction(0), *between, horizon)
    if any(later <= earlier for earlier, later in pairwise(times)):
        raise node.refused("does not increase up to the horizon")
    return times
