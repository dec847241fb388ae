"""Figures of a sampled loop: states and inputs over time, planes with obstacles, what fills the tube.

In: a certificate. Out: figures in floats; nothing is decided here. A family of plans has no curve to be drawn.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.report.figures_axes import WIDTH, Point, blank, path, text
from tubecert.report.figures_scene import Drawing, Outline, Plane, draw_obstacles, scene
from tubecert.report.page import Figure
from tubecert.sampled_loop.record import Certificate, Result, Shares
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import SHARES, percents

_FOR_EVER: Final = 1.0  # s that are drawn of a plan without an end, beyond the start of the last stage
_LEFT, _ROW = 90, 30  # of the bars
_STYLES: Final = dict(zip(SHARES.values(), ("n1", "n4", "n2", "n3", "n5", "n6"), strict=True))
Ends: TypeAlias = Sequence[Fraction | str]


def period(result: Result) -> Fraction:
    """The sample time in s."""
    return Fraction(result.spec.effective.part("hardware")["sample_time"])


def band(certificate: Certificate) -> tuple[Array, Array, Array]:
    """Times (K,) in s, the plan there (K, n), half-widths (K, n); where a later stage begins, a time occurs twice.

    The plan is interpolated between the points that the notes have. Empty for a family, and without a tube.
    """
    result, notes = certificate.result, certificate.notes
    states = result.spec.effective.system.states
    nothing, horizon = np.zeros((0, len(states))), result.claim.horizon
    if not (result.tube and notes.samples_t):
        return np.zeros(0), nothing, nothing
    starts = [float(stage.start * period(result)) for stage in result.tube]
    known = np.array(notes.samples_t)
    last = max(known[-1], starts[-1] + _FOR_EVER) if horizon is None else float(horizon)
    times = [
        np.array([begin, *known[(known > begin) & (known < until)], until])
        for begin, until in pairwise([*starts, max(last, starts[-1])])
    ]
    rows = [[float(stage.half_widths[name]) for name in states] for stage in result.tube]
    t = np.concatenate(times)
    x = np.stack([np.interp(t, known, column) for column in np.array(notes.samples_x).T], axis=1)
    return t, x, np.repeat(rows, [len(each) for each in times], axis=0)


def figures(certificate: Certificate) -> Iterator[Figure]:
    """All of them, as far as there is something to draw."""
    result, (t, x, widths) = certificate.result, band(certificate)
    if t.size:
        style = "tube" if result.verdict is Verdict.CERTIFIED else "unproven"
        yield from (each.figure(style) for each in _over_time(certificate, t, x, widths))
        yield from _planes(result, x, widths)
    if result.tube and result.spec.effective.trajectory.kind != "equilibrium":
        yield from _deviations(result)
    if certificate.notes.filled:
        yield _bars(result.spec.effective.system.ordered(certificate.notes.filled))


def _over_time(certificate: Certificate, t: Array, x: Array, widths: Array) -> Iterator[Drawing]:
    result, notes = certificate.result, certificate.notes
    system, safe = result.spec.effective.system, result.spec.effective.part("safe_set")
    told = "proven in the loop" if result.verdict is Verdict.CERTIFIED else "not proven"

    def drawing(key: str, name: str, curve: Array, ends: Sequence[Array], limits: Ends | None) -> Drawing:
        return Drawing(
            key=key,
            name=name,
            unit=system.units.get(name, ""),
            curve=_points(t, curve),
            band=(_points(t, ends[0]), _points(t, ends[1])),
            limits=None if limits is None else _ends(limits),
            words=("limits" if name in system.inputs else "safe set", told, "plan"),
        )

    for i, name in enumerate(system.states):
        ends = (x[:, i] - widths[:, i], x[:, i] + widths[:, i])
        yield drawing(f"state-{i}", name, x[:, i], ends, safe[name])
    for use in result.inputs:
        i = system.inputs.index(use.input)
        curve = np.interp(t, notes.samples_t, np.array(notes.samples_u)[:, i])
        ends = (np.full(t.shape, float(use.range[0])), np.full(t.shape, float(use.range[1])))
        yield drawing(f"input-{i}", use.input, curve, ends, use.limits)


def _deviations(result: Result) -> Iterator[Figure]:
    """What each state may be off its plan over time: of a plan that moves, too little to be seen beside it."""
    proven, effective = result.verdict is Verdict.CERTIFIED, result.spec.effective
    starts = [float(stage.start * period(result)) for stage in result.tube]
    last = result.claim.horizon
    ends = pairwise([*starts, starts[-1] + _FOR_EVER if last is None else float(last)])
    t = np.array([at for pair in ends for at in pair])
    for i, name in enumerate(effective.system.states):
        widths = np.repeat([float(stage.half_widths[name]) for stage in result.tube], 2)
        wish = effective.tube.half_widths.get(name)
        yield Drawing(
            key=f"deviation-{i}",
            name=f"{name} - {name}*",
            unit=effective.system.units.get(name, ""),
            curve=_points(t, 0 * t),
            band=(_points(t, -widths), _points(t, widths)),
            limits=None if wish is None else (-float(wish), float(wish)),
            words=("wish", "proven in the loop" if proven else "not proven", "plan"),
        ).figure("tube" if proven else "unproven")


def _planes(result: Result, x: Array, widths: Array) -> Iterator[Figure]:
    """The planes in which there are obstacles, with the widest tube."""
    effective = result.spec.effective
    states, units, proven = (
        effective.system.states,
        effective.system.units,
        result.verdict is Verdict.CERTIFIED,
    )
    for names in dict.fromkeys(obstacle.states for obstacle in effective.obstacles):
        i, j = map(states.index, names)
        a, b = map(float, widths[:, [i, j]].max(axis=0))
        (left, right), (low, high) = (_ends(effective.part("safe_set")[name]) for name in names)
        plane = Plane(
            names=names,
            units=(units.get(names[0], ""), units.get(names[1], "")),
            index=(i, j),
            plan=tuple(_points(x[:, i], x[:, j])),
            tube=Outline(turn=((2 * a, 0.0), (0.0, 2 * b)), sides=(a, b)),
            safe=((left, low), (right, high)),
        )
        chart, legend = scene(f"plane-{i}-{j}", plane, [], proven)
        legend += draw_obstacles(chart, effective.obstacles, names)
        title = f"Tube in the plane of {' and '.join(names)}"
        yield Figure(key=chart.key, title=title, svg=chart.text(), legend=tuple(legend))


def _bars(filled: Mapping[str, Shares]) -> Figure:
    """A bar for each state in the long run and each input, of what fills it, as shares of the whole."""
    title, used = "What fills the tube and the inputs", dict[str, None]()
    svg = blank(title, _ROW * len(filled) + 10)
    for row, (name, shares) in enumerate(filled.items()):
        y, x = _ROW * row + 20, float(_LEFT)
        text(svg, (_LEFT - 8, y + 4), name, "axis end")
        for what, part in percents(shares).items():
            end = x + part / 100 * (WIDTH - _LEFT - 10)
            look = {"class": f"curve bar {_STYLES[what]}", "d": path([(x, y), (end, y)])}
            bar = ET.SubElement(svg, "path", look)
            ET.SubElement(bar, "title").text = f"{what} {part} %"
            used[what], x = None, end
    legend = tuple((_STYLES[what], what) for what in SHARES.values() if what in used)
    caption = "Each bar is the whole of a half-width in the long run, or of what is added to an input."
    drawn = ET.tostring(svg, encoding="unicode")
    return Figure(key="shares", title=title, svg=drawn, legend=legend, caption=caption)


def _points(x: Array, y: Array) -> list[Point]:
    return list(zip(x.tolist(), y.tolist(), strict=True))


def _ends(ends: Ends) -> Point:
    return float(Fraction(ends[0])), float(Fraction(ends[1]))
