"""What the arithmetic of the controller may lose, where the specification names one: chosen, then searched with.

In: what is bounded, and a loop that serves a computer which loses nothing. Out: a loop that serves one which loses
twice what the exported code is proven to lose there. A number that is too small costs the export, never the proof:
theorem H-R holds for every number, and export proves that its code is within them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any, Final

from tubecert.conditions.decimals import round_up
from tubecert.conditions.hardware import HardwareRecipe, Rounding
from tubecert.conditions.machine import Machine as Known
from tubecert.conditions.proposal import Asked, Proposal
from tubecert.errors import SpecError, TubecertError
from tubecert.export.assembly import assembled, looked_at
from tubecert.export.blocks import Machine
from tubecert.export.followed import UncoveredError
from tubecert.export.rounding import rounding_of
from tubecert.expression import number_text
from tubecert.findings import Finding
from tubecert.search.proposers import PROPOSERS
from tubecert.spec import Arithmetic
from tubecert.stages.bounded import Bounded

_LEAVE: Final = "leave hardware.arithmetic out: the certificate then assumes that the computer is exact"
_ROOM, _DIGITS = (
    2,
    3,
)  # what may be lost, over what is proven to be: the loop that is found with it is another one


def rounded(
    bounded: Bounded, machine: Known, found: Mapping[type, Proposal[Any]], asked: Asked
) -> Mapping[type, Proposal[Any]]:
    """The proposals, that of certificate H with what rounding costs; raises `SpecError` where that is not derived."""
    first = found[HardwareRecipe].decisive
    if machine.asked.arithmetic is None or first is None:
        return found
    lost = _lost(bounded, machine, first, machine.asked.arithmetic)
    again = PROPOSERS[HardwareRecipe].propose(bounded.problem, replace(asked, lost=lost))
    return {**found, HardwareRecipe: again}


def _lost(bounded: Bounded, known: Known, recipe: HardwareRecipe, arithmetic: Arithmetic) -> Rounding:
    """With some room, as decimals."""
    if bounded.question.spec.trajectory.bundle is not None:
        raise _refused(
            bounded,
            "of a plan that is handed in no bound of rounding is derived",
            "certify the plan that the machine follows",
        )
    gain = Fraction(bounded.problem.constants.feedback_gain.above)
    try:
        own = rounding_of(assembled(_machine(bounded, known, recipe, gain)), arithmetic)
    except UncoveredError as error:
        raise _refused(bounded, f"no bound of rounding is known for {error}", error.help) from error
    except TubecertError as error:
        raise _refused(bounded, error.findings[0].message, error.findings[0].help) from error
    return Rounding(
        feedback=_above(own.feedback),
        input=_above(own.input),
        estimate=_above(own.estimate),
        prediction=_above(own.prediction),
    )


def _machine(bounded: Bounded, known: Known, recipe: HardwareRecipe, gain: Fraction) -> Machine:
    """The loop that would be exported."""
    question = bounded.question
    tube = bounded.enclosed.tube
    return Machine(
        name=question.spec.name,
        hash="",
        model=question.model,
        plan=tube.plan,
        recipe=recipe,
        reach=looked_at(recipe, known.constants.noise_metric.above, bounded.problem.constants.upper.above),
        clip=known.clip,
        coordinates=None
        if tube.coordinates is None
        else tuple(tuple(map(number_text, row)) for row in tube.coordinates.rows),
        held=known.asked.held,
        horizon=question.spec.trajectory.horizon,
        ranges=(),
        feedback_gain=gain,
        noise_size=Fraction(known.constants.noise_size.above),
    )


def _refused(bounded: Bounded, reason: str, help: str) -> SpecError:
    spec = bounded.question.spec
    return SpecError(
        [
            Finding(
                code="TC710",
                message=f"hardware.arithmetic: {reason}",
                location=spec.location("hardware.arithmetic"),
                help=f"{help}, or {_LEAVE}" if help else _LEAVE,
            )
        ]
    )


def _above(value: Fraction) -> Fraction:
    return round_up(_ROOM * value, _DIGITS)
