"""Figures over time: every state with its proven band, every input with what it does in the loop.

In: `result` of a certificate. Out: one figure per state and per input. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.certificate.follows import InputData
from tubecert.certificate.result import Result
from tubecert.report import planned
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.figures_tube import is_near, view
from tubecert.report.machine import proven
from tubecert.report.outline import widths
from tubecert.report.page import Figure
from tubecert.report.windows import deciding

_HEIGHT = 190


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawing:
    """A curve of the plan, the band around it that is proven (below, above), and the limits of the quantity."""

    key: str
    name: str
    unit: str
    curve: Sequence[Point]
    band: tuple[list[Point], list[Point]] | None
    limits: Point | None
    words: tuple[str, str, str]  # of the limits, the band, the curve

    def figure(self, style: str) -> Figure:
        """The figure; `style` is that of the band."""
        label = f"{self.name} ({self.unit})" if self.unit else self.name
        below, above = self.band or ([], [])
        shown = [value for _, value in [*self.curve, *below, *above]]
        safe = self.limits or (shown[0], shown[0])
        y = view(shown, safe, label, near=is_near(shown, safe))
        time = Axis(label="t (s)", low=self.curve[0][0], high=self.curve[-1][0])
        chart = Chart(self.key, f"{self.name} over time", time, y, height=_HEIGHT)
        if self.limits is not None:
            chart.box((time.low, y.low), (time.high, y.high), "outside")
            chart.box((time.low, self.limits[0]), (time.high, self.limits[1]), "safe")
        if self.band is not None:
            chart.area([*above, *reversed(below)], style)
        chart.line(self.curve, "plan")
        return Figure(
            key=self.key, title=f"{self.name} over time", svg=chart.text(), legend=self._legend(style)
        )

    def _legend(self, style: str) -> tuple[tuple[str, str], ...]:
        drawn = (("safe", self.limits), (style, self.band), ("plan", self.curve))
        return tuple(
            (key, words) for (key, part), words in zip(drawn, self.words, strict=True) if part is not None
        )


def state_figures(result: Result) -> list[Figure]:
    """Every state of the plan with its half-width."""
    known, units = widths(result), result.spec.effective.system.units
    inside = result.tube is not None and result.tube.rho_r is not None
    words = ("safe set", "proven band" if inside else "tube, not proven to stay in the safe set", "plan")
    drawings = [
        _Drawing(
            key=f"state-{i}",
            name=name,
            unit=units.get(name, ""),
            curve=curve,
            band=None if known is None else _state_band(result, name, known[name], curve),
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
        _Drawing(
            key=f"input-{i}",
            name=name,
            unit=units.get(name, ""),
            curve=curve,
            band=_input_band(result, name, own.get(name), curve),
            limits=_range(own[name].limits) if name in own else None,
            words=("limits", "proven range in the loop", "plan"),
        )
        for i, (name, curve) in enumerate(
            zip(result.spec.effective.system.inputs, planned.inputs(result), strict=False)
        )
    ]
    return [drawing.figure("tube") for drawing in drawings]


def _state_band(
    result: Result, name: str, width: float, curve: Sequence[Point]
) -> tuple[list[Point], list[Point]]:
    """The half-width around x*, window by window where what decides has windows."""
    windows = deciding(result)
    if not windows or not all(name in window.half_widths for window in windows):
        return _around(curve, width, width)
    parts = [
        _around(
            _within(curve, float(each.begin), float(each.end)), each.half_widths[name], each.half_widths[name]
        )
        for each in windows
    ]
    below, above = ([point for part in parts for point in part[side]] for side in (0, 1))
    return below, above


def _within(curve: Sequence[Point], begin: float, end: float) -> list[Point]:
    """The part of a curve between two times."""
    t, v = zip(*curve, strict=True)
    ends = [(at, float(np.interp(at, t, v))) for at in (begin, end)]
    return [ends[0], *(point for point in curve if begin < point[0] < end), ends[1]]


def _range(ends: tuple[Fraction, Fraction]) -> Point:
    return float(ends[0]), float(ends[1])


def _around(curve: Sequence[Point], below: float, above: float) -> tuple[list[Point], list[Point]]:
    return [(t, v - below) for t, v in curve], [(t, v + above) for t, v in curve]


def _input_band(
    result: Result, name: str, own: InputData | None, curve: Sequence[Point]
) -> tuple[list[Point], list[Point]] | None:
    """The range in each window; around u* by what feedback and adaptation add at most; else that of H at any time."""
    if windows := [each for each in deciding(result) if name in each.inputs]:
        ends = [(each, float(t)) for each in windows for t in (each.begin, each.end)]
        return [(t, each.inputs[name][0]) for each, t in ends], [
            (t, each.inputs[name][1]) for each, t in ends
        ]
    found = [] if own is None else [own.bounds[key] for key in result.decided_by if key in own.bounds]
    if own is not None and found:
        below = own.plan.least.below - min(each.least for each in found)
        return _around(curve, below, max(each.greatest for each in found) - own.plan.greatest.above)
    machine = proven(result)
    if machine is None or name not in machine.inputs or result.decided_by != (machine.name.key,):
        return None
    low, high = machine.inputs[name]
    return [(t, low) for t, _ in curve], [(t, high) for t, _ in curve]
