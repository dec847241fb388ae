"""Windows of time, each with a tube around its part of the plan and the constants of theorems HW, BW and CW over it.

In: what is bounded over the whole tube; radii that a search proposes. Out: the same with windows. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import pairwise
from typing import TypeAlias, TypeVar

from tubecert.bounds.constants import BoundConstants, ResidualConstants, WindConstants
from tubecert.bounds.covariant import CovariantConstants, covariant_constants
from tubecert.bounds.hardware import hardware_constants
from tubecert.bounds.parts import Parts
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.wind import residual_constants, wind_constants
from tubecert.bounds.windows import less, part_constants
from tubecert.conditions.machine import Machine, Window
from tubecert.conditions.problem import Part
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import printable_above
from tubecert.expression import number_text
from tubecert.records import Json
from tubecert.spec.windows import pad_of, windows_of
from tubecert.stages.bounded import Bounded, any_such
from tubecert.stages.machine import ranges_of
from tubecert.trajectory.during import during

T = TypeVar("T")
Tube: TypeAlias = tuple[tuple[Fraction, Fraction], Fraction]
"""A part of the plan, from and to in s, and the radius around it."""
Over: TypeAlias = tuple[Tube, Suprema, Json]
"""A tube, what is searched over it, and what that follows from."""


def with_windows(bounded: Bounded, radii: Sequence[Fraction], gap: float | None = None) -> Bounded:
    """Theorem HW is asked for, in tubes of these radii, one per window of the specification, none beyond the tube.

    With a `gap`, constants are enclosed no closer than that, which takes less time.
    """
    machine, ends = bounded.machine, windows_of(bounded.question.spec)
    if machine is None or not ends:
        return bounded
    pad, noise = pad_of(machine.asked), machine.asked.noise
    asked = _tubes(bounded, radii)
    tubes = [((max(Fraction(0), begin - pad), end), rho) for (begin, end), rho in asked]
    follows = bounded.enclosed.closely | {
        "noise": [*map(number_text, noise if isinstance(noise, tuple) else ())],
        "held": machine.asked.held,
    }
    over = _over(bounded, tubes, gap, follows)
    found = _remembered(bounded, "window", over, partial(_window, bounded, machine))
    windows = tuple(replace(w, begin=begin) for w, ((begin, _), _) in zip(found, asked, strict=True))
    return replace(bounded, machine=replace(machine, windows=windows))


def with_parts(bounded: Bounded, radii: Sequence[Fraction], gap: float | None = None) -> Bounded:
    """Theorems BW and CW are asked for, in the same way."""
    if not windows_of(bounded.question.spec):
        return bounded
    over = _over(bounded, _tubes(bounded, radii), gap, {})
    found = _remembered(bounded, "part", over, partial(_part, bounded))
    return replace(bounded, parts=tuple(found))


def _tubes(bounded: Bounded, radii: Sequence[Fraction]) -> list[Tube]:
    """Begin and end of every window, with its radius."""
    parts = list(pairwise(windows_of(bounded.question.spec)))
    if len(radii) != len(parts) or not all(0 < rho <= bounded.enclosed.tube.rho for rho in radii):
        raise ValueError("a radius for every window, within the tube")
    return list(zip(parts, radii, strict=True))


def _over(bounded: Bounded, tubes: Sequence[Tube], gap: float | None, follows: Json) -> list[Over]:
    """What is searched over each tube; `follows`: from what constants follow beside it."""
    enclosed = bounded.enclosed
    effort = enclosed.suprema.effort
    effort = effort if gap is None else replace(effort, gap=max(effort.gap, gap))
    found = []
    for part, radius in tubes:
        own = {
            "part": [number_text(t) for t in part],
            "radius": number_text(radius),
            "closeness": str(effort.gap),
        }
        tube = part, radius
        found.append((tube, _suprema(bounded, tube, effort), enclosed.tube.ground | follows | own))
    return found


def _remembered(
    bounded: Bounded, name: str, over: Sequence[Over], compute: Callable[[Tube, Suprema], T]
) -> list[T]:
    """What is computed over each tube; what is not known yet, side by side."""
    memory = bounded.question.memory
    new = [suprema for _, suprema, ground in over if not memory.knows(name, ground)]
    together = Parts(bounded.enclosed.tube.plan, new)
    return [
        memory.recall(name, ground, partial(compute, tube, replace(suprema, parts=together)))
        for tube, suprema, ground in over
    ]


def _suprema(bounded: Bounded, tube: Tube, effort: Effort) -> Suprema:
    """Over a part of the plan."""
    enclosed, (part, radius) = bounded.enclosed, tube
    return replace(
        enclosed.suprema,
        plan=during(enclosed.tube.plan, *part),
        time=None if enclosed.suprema.time is None else part,
        effort=effort,
        gaps={},
    ).with_radius(radius)


def _part(bounded: Bounded, tube: Tube, suprema: Suprema) -> Part:
    """Every constant of theorems B and C over a part of the plan."""
    question, problem = bounded.question, bounded.enclosed.problem
    constants = part_constants(suprema, question.start, problem.constants, question.declared_uncertainty)
    wind, residual = _beside(bounded, suprema, constants)
    (begin, end), radius = tube
    return Part(
        begin=begin,
        end=end,
        radius=radius,
        constants=constants,
        wind=wind,
        residual=residual,
        widths={name: printable_above(width.above) for name, width in suprema.widths().items()},
        inputs=ranges_of(question.spec, constants, suprema),
    )


def _beside(
    bounded: Bounded, suprema: Suprema, constants: BoundConstants
) -> tuple[WindConstants | None, ResidualConstants | None]:
    """What a wind and unknown parameters do over a part, where they do anything over the whole."""
    problem = bounded.enclosed.problem
    wind, residual = wind_constants(suprema, constants.metric_input_gain), residual_constants(suprema)
    return (
        None if wind is None or problem.wind is None else less(problem.wind.constants, wind),
        None if residual is None or problem.residual is None else less(problem.residual, residual),
    )


def _window(bounded: Bounded, machine: Machine, tube: Tube, suprema: Suprema) -> Window:
    """Every constant over what a window looks back at, which is as long as the machine asked for makes it."""
    question, problem = bounded.question, bounded.enclosed.problem
    (since, end), radius = tube
    constants = part_constants(suprema, question.start, problem.constants, question.declared_uncertainty)
    own = hardware_constants(suprema, any_such(machine.asked), bounded.geodesics, constants)
    wind, residual = _beside(bounded, suprema, constants)
    return Window(
        begin=since,
        end=end,
        since=since,
        radius=radius,
        constants=constants,
        machine=less(machine.constants, own),
        covariant=_covariant(machine, suprema, constants),
        wind=wind,
        residual=residual,
        inputs=ranges_of(question.spec, constants, suprema),
    )


def _covariant(machine: Machine, suprema: Suprema, constants: BoundConstants) -> CovariantConstants | None:
    """Where those of the whole tube are known."""
    if machine.covariant is None:
        return None
    found = covariant_constants(suprema, constants)
    return machine.covariant if found is None else less(machine.covariant, found)
