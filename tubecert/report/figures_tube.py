"""Figures of the tube: plan, what is proven around it, safe set, obstacles, witnesses; states and inputs over time.

In: `result` of a certificate. Out: a figure per pair of states, per state and per input. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TypeAlias

from tubecert.certificate.result import InputData, Result
from tubecert.report import planned
from tubecert.report.claimed import point
from tubecert.report.figures_axes import Point
from tubecert.report.figures_scene import Drawing, Plane, draw_obstacles, scene
from tubecert.report.outline import tube_outline, widths
from tubecert.report.page import Figure

Band: TypeAlias = tuple[list[Point], list[Point]] | None


def planes(result: Result) -> list[Plane]:
    """The planes to draw: all pairs of up to three states, else neighbours two by two and those of obstacles."""
    states = list(result.spec.effective.system.states)
    n = len(states)
    if n <= 3:
        pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    else:
        pairs = [(i, i + 1) if i + 1 < n else (i - 1, i) for i in range(0, n, 2)]
    for obstacle in result.spec.effective.obstacles:
        own = [i for i, name in enumerate(states) if name in obstacle.states]
        if len(own) == 2 and (own[0], own[1]) not in pairs:
            pairs.append((own[0], own[1]))
    return [plane(result, states, pair) for pair in pairs]


def plane(result: Result, states: list[str], pair: tuple[int, int]) -> Plane:
    """What is known in the plane of two states, by their places."""
    i, j = pair
    units = result.spec.effective.system.units
    samples = () if result.plan.samples is None else result.plan.samples.x
    low, high = zip(*(map(float, result.safe_set[states[k]]) for k in pair), strict=True)
    return Plane(
        names=(states[i], states[j]),
        units=(units.get(states[i], ""), units.get(states[j], "")),
        index=pair,
        plan=tuple((float(x[i]), float(x[j])) for x in samples),
        tube=tube_outline(result, pair),
        safe=((low[0], low[1]), (high[0], high[1])),
    )


def tube_figures(result: Result) -> list[Figure]:
    """The tube in each plane, with the obstacles that lie in it and the witnesses of what was refuted."""
    return [_tube(result, plane) for plane in planes(result)]


def _tube(result: Result, plane: Plane) -> Figure:
    title = f"Tube in the plane of {plane.names[0]} and {plane.names[1]}"
    witnesses = [
        (plane.of(at.x), f"{reason.claim.title}: {point(result, at)}")
        for reason in result.reasons
        if (at := reason.at) is not None and len(at.x) > max(plane.index)
    ]
    proven = result.tube is not None and result.tube.rho_r is not None
    chart, legend = scene(f"tube-{plane.index[0]}-{plane.index[1]}", plane, [p for p, _ in witnesses], proven)
    legend += draw_obstacles(chart, result.spec.effective.obstacles, plane.names)
    if plane.plan:
        chart.dot(plane.plan[0], "start", words="start of the plan")
        legend.append(("start", "start of the plan" if len(plane.plan) > 1 else "the plan, an equilibrium"))
    for place, words in witnesses:
        chart.dot(place, "witness", 6, words)
    if witnesses:
        legend.append(("witness", "witness"))
    return Figure(key=chart.key, title=title, svg=chart.text(), legend=tuple(dict.fromkeys(legend)))


def state_figures(result: Result) -> list[Figure]:
    """Every state of the plan with its half-width."""
    known, inside = widths(result), result.tube is not None and result.tube.rho_r is not None
    words = ("safe set", "proven band" if inside else "tube, not proven to stay in the safe set", "plan")
    system = result.spec.effective.system
    drawings = (
        Drawing(
            key=f"state-{i}",
            name=name,
            unit=system.units.get(name, ""),
            curve=curve,
            band=None if known is None else _around(curve, known[name], known[name]),
            limits=_range(result.safe_set[name]),
            words=words,
        )
        for i, (name, curve) in enumerate(zip(system.states, planned.states(result), strict=False))
    )
    return [drawing.figure("tube" if inside else "unproven") for drawing in drawings]


def input_figures(result: Result) -> list[Figure]:
    """Every input of the plan, and what is proven of it in the loop of what decides."""
    own, system = {each.input: each for each in result.inputs}, result.spec.effective.system
    drawings = (
        Drawing(
            key=f"input-{i}",
            name=name,
            unit=system.units.get(name, ""),
            curve=curve,
            band=_input_band(result, own.get(name), curve),
            limits=_range(own[name].limits) if name in own else None,
            words=("limits", "proven range in the loop", "plan"),
        )
        for i, (name, curve) in enumerate(zip(system.inputs, planned.inputs(result), strict=False))
    )
    return [drawing.figure("tube") for drawing in drawings]


def _range(ends: tuple[Fraction, Fraction]) -> Point:
    return float(ends[0]), float(ends[1])


def _around(curve: Sequence[Point], below: float, above: float) -> Band:
    return [(t, v - below) for t, v in curve], [(t, v + above) for t, v in curve]


def _input_band(result: Result, own: InputData | None, curve: Sequence[Point]) -> Band:
    """Around u* by what feedback and adaptation add at most; None where nothing is proven."""
    found = [] if own is None else [own.bounds[key] for key in result.decided_by if key in own.bounds]
    if own is None or not found:
        return None
    below = own.plan.least.below - min(each.least for each in found)
    return _around(curve, below, max(each.greatest for each in found) - own.plan.greatest.above)
