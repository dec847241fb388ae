"""Figures of the tube: the plan, what is proven around it, the safe set, obstacles, witnesses, suprema.

In: `result` of a certificate. Out: one figure per pair of states. Nothing is decided here.
"""

from __future__ import annotations

import math
from dataclasses import replace

from tubecert.bounds.meanings import meaning
from tubecert.certificate.result import Result
from tubecert.digits import near
from tubecert.enclosure.constant import Witness
from tubecert.report.claimed import point
from tubecert.report.figures_axes import Chart, Point
from tubecert.report.figures_scene import Plane, draw_obstacle, scene
from tubecert.report.outline import domain_outline, tube_outline
from tubecert.report.page import Figure
from tubecert.words.claims import title as title_of

_NEAR = 0.25  # places closer than this part of rho share a number


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
    title = f"{plane.names[0]}, {plane.names[1]}"
    witnesses = [
        (plane.of(at.x), f"{title_of(reason.claim)}: {point(result, at)}")
        for reason in result.reasons
        if (at := reason.at) is not None and len(at.x) > max(plane.index)
    ]
    proven = result.tube is not None and result.tube.rho_r is not None
    chart, legend = scene(f"tube-{plane.index[0]}-{plane.index[1]}", plane, [p for p, _ in witnesses], proven)
    for shown in _obstacles(result, plane, chart):
        legend.append(shown)
    if plane.plan:
        chart.dot(plane.plan[0], "start", words=f"start of the plan: {_pair(plane, plane.plan[0])}")
        legend.append(("start", "start of the plan" if len(plane.plan) > 1 else "the plan, an equilibrium"))
    for place, words in witnesses:
        chart.dot(place, "witness", 6, words)
    if witnesses:
        legend.append(("witness", "witness"))
    return Figure(key=chart.key, title=title, svg=chart.text(), legend=tuple(dict.fromkeys(legend)))


def _obstacles(result: Result, plane: Plane, chart: Chart) -> list[tuple[str, str]]:
    shown = []
    for obstacle in result.spec.effective.obstacles:
        if set(obstacle.states) == set(plane.names):
            draw_obstacle(chart, obstacle, plane.names)
            shown = [("obstacle", "obstacle")]
    return shown


# -- suprema


def suprema_figures(result: Result) -> list[Figure]:
    """Where on the tube the constants attain their suprema: numbered places, the numbers explained below."""
    symbols = _places(result)
    if not symbols:
        return []
    numbers = {x: str(i + 1) for i, x in enumerate(symbols)}
    figures = []
    for plane in planes(result):
        if not plane.plan:
            continue
        key = f"suprema-{plane.index[0]}-{plane.index[1]}"
        domain = replace(plane, tube=domain_outline(result, plane.index))
        chart, _ = scene(key, domain, [plane.of(x) for x in symbols])
        for place, found in _close(chart, plane, list(symbols)).items():
            words = "; ".join(f"{numbers[x]}: {', '.join(symbols[x])}" for x in found)
            chart.dot(place, "numbered", 8, words)
            label = ",".join(numbers[x] for x in found) if len(found) < 3 else f"{numbers[found[0]]}+"
            chart.label(place, label, "badge middle", (0.0, 3.5))
        title = f"{plane.names[0]}, {plane.names[1]}"
        figures.append(Figure(key=key, title=title, svg=chart.text()))
    return figures


def places(result: Result) -> tuple[str, ...]:
    """What the numbers in the figures of suprema stand for."""
    return tuple(f"{', '.join(s)} near {point(result, Witness(x=x))}" for x, s in _places(result).items())


def _places(result: Result) -> dict[tuple[float, ...], list[str]]:
    """The symbols of the constants by the state at which they were found largest; those that vanish left out."""
    n = len(result.spec.effective.system.states)
    near = _NEAR * (0.0 if result.tube is None else float(result.tube.rho))
    found: dict[tuple[float, ...], list[str]] = {}
    for name, item in sorted(result.constants.items()):
        at = item.at
        if at is not None and len(at.x) == n and item.above != 0:
            here = tuple(float(f"{value:.4g}") for value in at.x)
            place = next((x for x in found if math.dist(x, here) <= near), here)
            found.setdefault(place, []).append(meaning(name).symbol)
    return found


def _close(
    chart: Chart, plane: Plane, places: list[tuple[float, ...]]
) -> dict[Point, list[tuple[float, ...]]]:
    """Places that would cover each other in the drawing share a mark."""
    groups: dict[Point, list[tuple[float, ...]]] = {}
    for x in places:
        here = plane.of(x)
        near = next((p for p in groups if math.dist(chart.at(p), chart.at(here)) < 14), here)
        groups.setdefault(near, []).append(x)
    return groups


def _pair(plane: Plane, value: Point) -> str:
    return f"{plane.names[0]} = {near(value[0], 4)}, {plane.names[1]} = {near(value[1], 4)}"
