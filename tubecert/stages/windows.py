"""Windows of time, each with a tube around its part of the plan and the constants of theorems HW, BW and CW over it.

In: what is bounded over the whole tube; radii that a search proposes. Out: the same with windows. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

from tubecert.bounds.constants import BoundConstants, ResidualConstants, WindConstants
from tubecert.bounds.covariant import CovariantConstants, covariant_constants
from tubecert.bounds.hardware import hardware_constants
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.wind import residual_constants, wind_constants
from tubecert.bounds.windows import less, part_constants
from tubecert.conditions.machine import Machine, Window
from tubecert.conditions.problem import Part
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import printable_above
from tubecert.expression import number_text
from tubecert.spec.windows import pad_of, windows_of
from tubecert.stages.bounded import Bounded, any_such
from tubecert.stages.machine import ranges_of
from tubecert.trajectory.during import during


def with_windows(bounded: Bounded, radii: Sequence[Fraction], gap: float | None = None) -> Bounded:
    """Theorem HW is asked for, in tubes of these radii, one per window of the specification, none beyond the tube.

    With a `gap`, constants are enclosed no closer than that, which takes less time.
    """
    machine, ends = bounded.machine, windows_of(bounded.question.spec)
    if machine is None or not ends:
        return bounded
    parts, effort = _tubes(bounded, radii), _effort(bounded, gap)
    found = [_window(bounded, machine, part, rho, effort) for part, rho in parts]
    return replace(bounded, machine=replace(machine, windows=tuple(found)))


def with_parts(bounded: Bounded, radii: Sequence[Fraction], gap: float | None = None) -> Bounded:
    """Theorems BW and CW are asked for, in the same way."""
    if not windows_of(bounded.question.spec):
        return bounded
    effort = _effort(bounded, gap)
    found = [_part(bounded, part, rho, effort) for part, rho in _tubes(bounded, radii)]
    return replace(bounded, parts=tuple(found))


def _tubes(bounded: Bounded, radii: Sequence[Fraction]) -> list[tuple[tuple[Fraction, Fraction], Fraction]]:
    """Begin and end of every window, with its radius."""
    parts = list(pairwise(windows_of(bounded.question.spec)))
    if len(radii) != len(parts) or not all(0 < rho <= bounded.enclosed.tube.rho for rho in radii):
        raise ValueError("a radius for every window, within the tube")
    return list(zip(parts, radii, strict=True))


def _effort(bounded: Bounded, gap: float | None) -> Effort:
    effort = bounded.enclosed.suprema.effort
    return effort if gap is None else replace(effort, gap=max(effort.gap, gap))


def _suprema(bounded: Bounded, part: tuple[Fraction, Fraction], radius: Fraction, effort: Effort) -> Suprema:
    """Over a part of the plan."""
    enclosed = bounded.enclosed
    return replace(
        enclosed.suprema,
        plan=during(enclosed.tube.plan, *part),
        time=None if enclosed.suprema.time is None else part,
        effort=effort,
        gaps={},
    ).with_radius(radius)


def _part(bounded: Bounded, part: tuple[Fraction, Fraction], radius: Fraction, effort: Effort) -> Part:
    ground = {
        "part": [number_text(t) for t in part],
        "radius": number_text(radius),
        "closeness": str(effort.gap),
    }
    return bounded.question.memory.recall(
        "part",
        bounded.enclosed.tube.ground | ground,
        lambda: _known(bounded, part, radius, _suprema(bounded, part, radius, effort)),
    )


def _known(bounded: Bounded, part: tuple[Fraction, Fraction], radius: Fraction, suprema: Suprema) -> Part:
    """Every constant of theorems B and C over a part of the plan."""
    question, problem = bounded.question, bounded.enclosed.problem
    constants = part_constants(suprema, question.start, problem.constants, question.declared_uncertainty)
    wind, residual = _beside(bounded, suprema, constants)
    return Part(
        begin=part[0],
        end=part[1],
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


def _window(
    bounded: Bounded, machine: Machine, part: tuple[Fraction, Fraction], radius: Fraction, effort: Effort
) -> Window:
    """One window; what it looks back at is as long as the machine of the specification makes it."""
    question = bounded.question
    begin, end = part
    since = max(Fraction(0), begin - pad_of(machine.asked))
    noise = machine.asked.noise if isinstance(machine.asked.noise, tuple) else ()
    found = question.memory.recall(
        "window",
        bounded.enclosed.tube.ground
        | bounded.enclosed.closely
        | {
            "noise": [*map(number_text, noise)],
            "held": machine.asked.held,
            "part": [number_text(t) for t in (since, end)],
            "radius": number_text(radius),
            "closeness": str(effort.gap),
        },
        lambda: _bounded(bounded, machine, (since, end), radius, effort),
    )
    return replace(found, begin=begin)


def _bounded(
    bounded: Bounded, machine: Machine, part: tuple[Fraction, Fraction], radius: Fraction, effort: Effort
) -> Window:
    """Every constant over a part of the plan."""
    question, problem, since = bounded.question, bounded.enclosed.problem, part[0]
    suprema = _suprema(bounded, part, radius, effort)
    constants = part_constants(suprema, question.start, problem.constants, question.declared_uncertainty)
    own = hardware_constants(suprema, any_such(machine.asked), bounded.geodesics, constants)
    wind, residual = _beside(bounded, suprema, constants)
    return Window(
        begin=since,
        end=part[1],
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
