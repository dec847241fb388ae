"""Figures over time: every state with its proven band, every input with what it does in the loop.

In: `result` of a certificate. Out: one figure per state and per input. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.certificate.follows import InputData
from tubecert.certificate.result import Result
from tubecert.report import planned
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.figures_tube import is_near, view
from tubecert.report.outline import widths
from tubecert.report.page import Figure

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
        _Drawing(
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
