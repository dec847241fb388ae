"""Figures over time: every state with its proven band, every input with what it does in the loop.

In: `result` of a certificate. Out: one figure per state and per input. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.certificate.result import InputData, Result
from tubecert.report import planned
from tubecert.report.figures_axes import Point
from tubecert.report.figures_scene import Drawing
from tubecert.report.outline import widths
from tubecert.report.page import Figure


def state_figures(result: Result) -> list[Figure]:
    """Every state of the plan with its half-width."""
    known, units = widths(result), result.spec.effective.system.units
    inside = result.tube is not None and result.tube.rho_r is not None
    words = ("safe set", "proven band" if inside else "tube, not proven to stay in the safe set", "plan")
    drawings = [
        Drawing(
            key=f"state-{i}",
            name=name,
            unit=units.get(name, ""),
            curve=curve,
            band=None if known is None else _around(curve, known[name], known[name]),
            limits=_range(result.safe_set[name]),
            words=words,
        )
        for i, (name, curve) in enumerate(
            zip(result.spec.effective.system.states, planned.states(result), strict=False)
        )
    ]
    return [drawing.figure("tube" if inside else "unproven") for drawing in drawings]


def input_figures(result: Result) -> list[Figure]:
    """Every input of the plan, and what is proven of it in the loop of what decides."""
    own, units = {each.input: each for each in result.inputs}, result.spec.effective.system.units
    drawings = [
        Drawing(
            key=f"input-{i}",
            name=name,
            unit=units.get(name, ""),
            curve=curve,
            band=_input_band(result, own.get(name), curve),
            limits=_range(own[name].limits) if name in own else None,
            words=("limits", "proven range in the loop", "plan"),
        )
        for i, (name, curve) in enumerate(
            zip(result.spec.effective.system.inputs, planned.inputs(result), strict=False)
        )
    ]
    return [drawing.figure("tube") for drawing in drawings]


def _range(ends: tuple[Fraction, Fraction]) -> Point:
    return float(ends[0]), float(ends[1])


def _around(curve: Sequence[Point], below: float, above: float) -> tuple[list[Point], list[Point]]:
    return [(t, v - below) for t, v in curve], [(t, v + above) for t, v in curve]


def _input_band(
    result: Result, own: InputData | None, curve: Sequence[Point]
) -> tuple[list[Point], list[Point]] | None:
    """Around u* by what feedback and adaptation add at most; None where nothing is proven."""
    found = [] if own is None else [own.bounds[key] for key in result.decided_by if key in own.bounds]
    if own is None or not found:
        return None
    below = own.plan.least.below - min(each.least for each in found)
    return _around(curve, below, max(each.greatest for each in found) - own.plan.greatest.above)
