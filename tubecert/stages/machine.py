"""What theorem H knows of the machine: the constants that it needs over the tube, and the range of every input.

In: the constants over a tube whose specification has `hardware`. Out: a `Machine`. Trusted: yes.
"""

from __future__ import annotations

from math import isinf

from tubecert.bounds.constants import BoundConstants
from tubecert.bounds.covariant import CovariantConstants, covariant_constants
from tubecert.bounds.hardware import Box, clip_box, hardware_constants
from tubecert.bounds.suprema import Suprema
from tubecert.conditions.machine import Machine
from tubecert.conditions.problem import TubeProblem
from tubecert.enclosure.constant import printable_above, printable_below
from tubecert.metric.geodesic import GeodesicTest
from tubecert.spec import Spec

_MOST_STATES = 3  # recheck proves covariant constants direction by direction
_SHARP = 1e-4  # of sup |u*|: how closely u* is enclosed at least


def machine_of(spec: Spec, problem: TubeProblem, suprema: Suprema, geodesics: GeodesicTest) -> Machine | None:
    """The machine of a specification; None if it has none."""
    if spec.hardware is None:
        return None
    return Machine(
        constants=hardware_constants(suprema, spec.hardware, geodesics, problem.constants),
        covariant=_covariant(problem, suprema),
        clip=_clip(spec, suprema),
        asked=spec.hardware,
        widths={name: printable_above(width.above) for name, width in suprema.widths().items()},
        inputs=ranges_of(spec, problem.constants, suprema),
    )


def ranges_of(spec: Spec, known: BoundConstants, suprema: Suprema) -> dict[str, tuple[float, float]]:
    """The range of u* on the plan, by input."""
    sharp = _SHARP * max(known.u_star.above, _SHARP)
    ranges = {name: suprema.input_range(i, sharp) for i, name in enumerate(spec.inputs)}
    return {
        name: (printable_below(least.below), printable_above(greatest.above))
        for name, (least, greatest) in ranges.items()
    }


def _covariant(problem: TubeProblem, suprema: Suprema) -> CovariantConstants | None:
    """Those that serve: where the metric is not constant, recheck can prove them, and each has a bound."""
    if len(suprema.model.states) > _MOST_STATES:
        return None
    found = covariant_constants(suprema, problem.constants)
    return None if found is None or any(isinf(value.above) for _, value, _ in found.items()) else found


def _clip(spec: Spec, suprema: Suprema) -> Box:
    """The box of h where that is given as expressions; else empty, which stands for the ball of its size."""
    bounds = spec.uncertainty.bounds
    declared = suprema.model.h is None or (bounds is not None and bounds.h is not None)
    return () if declared else clip_box(suprema)
