"""Figures of the tube: plan, what is proven around it, safe set, obstacles, witnesses; states and inputs over time.

In: `result` of a certificate. Out: a figure per pair of states, per state and per input. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from tubecert.certificate.result import InputData, Result
from tubecert.enclosure.interval import Array
from tubecert.report import planned
from tubecert.report.claimed import labelled, point
from tubecert.report.figures_axes import Chart, Point
from tubecert.report.figures_scene import Plane, over_time
from tubecert.report.outline import tube_outline, widths


def tube_figures(result: Result) -> Iterator[Chart]:
    """The tube in each plane, with the obstacles that lie in it and the witnesses of what was refuted."""
    for pair in _pairs(result):
        yield plane_figure(result, pair)


def _pairs(result: Result) -> list[tuple[int, int]]:
    """The planes to draw: all pairs of up to three states, else neighbours two by two and those of obstacles."""
    states = result.spec.effective.system.states
    n = len(states)
    if n <= 3:
        pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    else:
        pairs = [(i, i + 1) if i + 1 < n else (i - 1, i) for i in range(0, n, 2)]
    for obstacle in result.spec.effective.obstacles:
        i, j = sorted(map(states.index, obstacle.states))
        if (i, j) not in pairs:
            pairs.append((i, j))
    return pairs


def plane_figure(result: Result, pair: tuple[int, int]) -> Chart:
    """The tube in the plane of two states, by their places."""
    effective, samples = result.spec.effective, result.plan.samples
    names = effective.system.states
    x = np.array(() if samples is None else samples.x, dtype=float).reshape(-1, len(names))
    own = Plane(
        effective=effective,
        pair=pair,
        plan=x[:, pair],
        tube=tube_outline(result, pair),
        safe=(_range(result.safe_set[names[pair[0]]]), _range(result.safe_set[names[pair[1]]])),
        proven=_is_proven(result),
    )
    witnesses = [
        ((float(at.x[pair[0]]), float(at.x[pair[1]])), f"{reason.claim.title}: {point(result, at)}")
        for reason in result.reasons
        if (at := reason.at) is not None and len(at.x) > max(pair)
    ]
    chart = own.chart(f"tube-{pair[0]}-{pair[1]}", [place for place, _ in witnesses])
    if len(own.plan):
        words = "start of the plan" if len(own.plan) > 1 else "the plan, an equilibrium"
        chart.dot(own.plan[0], "start", words, tip="start of the plan")
    for place, words in witnesses:
        chart.dot(place, "witness", "witness", tip=words, size=6)
    return chart


def state_figures(result: Result) -> Iterator[Chart]:
    """Every state of the plan with its half-width."""
    known, proven = widths(result), _is_proven(result)
    words = "safe set", "proven band" if proven else "tube, not proven to stay in the safe set"
    system, (t, curves) = result.spec.effective.system, planned.states(result)
    for i, (name, x) in enumerate(zip(system.states, curves, strict=False)):
        band = None if known is None else (x - known[name], x + known[name])
        safe, label = _range(result.safe_set[name]), labelled(name, system)
        yield over_time(f"state-{i}", name, label, (t, x), band=band, limits=safe, words=words, proven=proven)


def input_figures(result: Result) -> Iterator[Chart]:
    """Every input of the plan, and what is proven of it in the loop of what decides."""
    known, system = {each.input: each for each in result.inputs}, result.spec.effective.system
    words, (t, curves) = ("limits", "proven range in the loop"), planned.inputs(result)
    for i, (name, u) in enumerate(zip(system.inputs, curves, strict=False)):
        own, label = known.get(name), labelled(name, system)
        band, limits = (None, None) if own is None else (_band(result, own, u), _range(own.limits))
        yield over_time(f"input-{i}", name, label, (t, u), band=band, limits=limits, words=words, proven=True)


def _is_proven(result: Result) -> bool:
    """Whether the tube is proven to lie in the safe set."""
    return result.tube is not None and result.tube.rho_r is not None


def _range(ends: tuple[Fraction, Fraction]) -> Point:
    return float(ends[0]), float(ends[1])


def _band(result: Result, own: InputData, u: Array) -> tuple[Array, Array] | None:
    """Around u* by what feedback and adaptation add at most; None where nothing is proven."""
    found = [own.bounds[key] for key in result.decided_by if key in own.bounds]
    if not found:
        return None
    below = own.plan.least.below - min(each.least for each in found)
    return u - below, u + max(each.greatest for each in found) - own.plan.greatest.above
