"""Figures of a sampled loop: states and inputs over time, planes with obstacles, what fills the tube.

In: a certificate. Out: figures in floats; nothing is decided here. A family of plans has no curve to be drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import pairwise
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.report.claimed import labelled
from tubecert.report.figures_axes import BOTTOM, TOP, Axis, Chart, Point
from tubecert.report.figures_scene import Plane, over_time
from tubecert.sampled_loop.record import Certificate, Result, Shares
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import causes, percents

_FOR_EVER: Final = 1.0  # s that are drawn of a plan without an end, beyond the start of the last stage
_ROW: Final = 30  # units of the viewport that a bar takes
_STYLES: Final = ("n1", "n4", "n2", "n3", "n5", "n6")  # of the shares


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


def figures(certificate: Certificate) -> Iterator[Chart]:
    """All of them, as far as there is something to draw."""
    result, effective = certificate.result, certificate.result.spec.effective
    yield from state_figures(certificate)
    t, *_ = band(certificate)
    if t.size:
        yield from _inputs(certificate, t)
        for names in dict.fromkeys(obstacle.states for obstacle in effective.obstacles):
            i, j = map(effective.system.states.index, names)
            yield plane_figure(certificate, (i, j))
    if result.tube and effective.trajectory.kind != "equilibrium":
        yield from _deviations(result)
    if certificate.notes.filled:
        yield _bars(effective.system.ordered(certificate.notes.filled), causes(result))


def state_figures(certificate: Certificate) -> Iterator[Chart]:
    """Every state of the plan with its half-width; none of a family, nor without a tube."""
    result, (t, x, widths) = certificate.result, band(certificate)
    system, safe, proven, told = result.spec.effective.system, _safe_set(result), *_proven(result)
    for i, name in enumerate(system.states if t.size else ()):
        sides, label = (x[:, i] - widths[:, i], x[:, i] + widths[:, i]), labelled(name, system)
        words = "safe set", told
        yield over_time(
            f"state-{i}", name, label, (t, x[:, i]), band=sides, limits=safe[name], words=words, proven=proven
        )


def _inputs(certificate: Certificate, t: Array) -> Iterator[Chart]:
    """Every input of the plan, and what it stays within."""
    result, notes = certificate.result, certificate.notes
    system, (proven, told) = result.spec.effective.system, _proven(result)
    for use in result.inputs:
        i, words, label = system.inputs.index(use.input), ("limits", told), labelled(use.input, system)
        u = np.interp(t, notes.samples_t, np.array(notes.samples_u)[:, i])
        sides = np.full(t.shape, float(use.range[0])), np.full(t.shape, float(use.range[1]))
        limits = None if use.limits is None else (float(use.limits[0]), float(use.limits[1]))
        yield over_time(
            f"input-{i}", use.input, label, (t, u), band=sides, limits=limits, words=words, proven=proven
        )


def _proven(result: Result) -> tuple[bool, str]:
    """Whether the tube is proven, and what its band is called."""
    proven = result.verdict is Verdict.CERTIFIED
    return proven, "proven in the loop" if proven else "not proven"


def _safe_set(result: Result) -> Mapping[str, Point]:
    told = result.spec.effective.part("safe_set")
    return {name: (float(Fraction(low)), float(Fraction(high))) for name, (low, high) in told.items()}


def _deviations(result: Result) -> Iterator[Chart]:
    """What each state may be off its plan over time: of a plan that moves, too little to be seen beside it."""
    effective, (proven, told) = result.spec.effective, _proven(result)
    starts = [float(stage.start * period(result)) for stage in result.tube]
    last = result.claim.horizon
    ends = pairwise([*starts, starts[-1] + _FOR_EVER if last is None else float(last)])
    t = np.array([at for pair in ends for at in pair])
    for i, name in enumerate(effective.system.states):
        widths = np.repeat([float(stage.half_widths[name]) for stage in result.tube], 2)
        wish = effective.tube.half_widths.get(name)
        limits, off = None if wish is None else (-float(wish), float(wish)), f"{name} - {name}*"
        label, words = labelled(name, effective.system, off), ("wish", told)
        sides = -widths, widths
        yield over_time(
            f"deviation-{i}", off, label, (t, 0 * t), band=sides, limits=limits, words=words, proven=proven
        )


def plane_figure(certificate: Certificate, pair: tuple[int, int]) -> Chart:
    """The widest tube in the plane of two states, by their places; of a family, or without one, what is beside it."""
    result, (_, x, widths) = certificate.result, band(certificate)
    effective, safe = result.spec.effective, _safe_set(result)
    one, other = (safe[effective.system.states[i]] for i in pair)
    plane = Plane(
        effective=effective,
        pair=pair,
        plan=x[:, pair],
        tube=widths[:, pair].max(axis=0, initial=0) * [(1, 1), (-1, 1), (-1, -1), (1, -1)],
        safe=(one, other),
        proven=_proven(result)[0],
    )
    return plane.chart(f"plane-{pair[0]}-{pair[1]}")


def _bars(filled: Mapping[str, Shares], words: Mapping[str, str]) -> Chart:
    """A bar for each state in the long run and each input, of what fills it, as shares of the whole."""
    names, title = tuple(filled)[::-1], "What fills the tube and the inputs"  # the first one above
    rows = Axis(label="", low=-0.5, high=len(names) - 0.5, names=names)
    share, height = Axis(label="share (%)", low=0, high=100), _ROW * len(names) + TOP + BOTTOM
    caption = "Each bar is the whole of a half-width in the long run, or of what is added to an input."
    chart = Chart(key="shares", title=title, x=share, y=rows, height=height, caption=caption)
    styles = dict(zip(words.values(), _STYLES, strict=True))
    for row, name in enumerate(names):
        at = 0
        for what, part in percents(filled[name], words).items():
            low, high = (at, row - 0.3), (at + part, row + 0.3)
            chart.box(low, high, f"bar {styles[what]}", what, f"{what} {part} %")
            at += part
    return chart
