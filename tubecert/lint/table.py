"""A plan from a file against the dynamics, in floats: rows that do not belong, times in ms, columns that are exchanged.

The defect of a piece is looked at in its middle, where a cubic with the slopes of the dynamics at its ends misses most.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import number_text
from tubecert.findings import Finding, Location, Severity
from tubecert.lint import codes
from tubecert.model import TIME, ControlAffineModel
from tubecert.spec import Spec, Table
from tubecert.spec.codes import PLAN_TIMES

_FALLS: Final = 0.05  # to which share of it a defect falls where its cause is found
_STANDS_OUT: Final = 20  # times the defect of most pieces: a row that does not belong
_ROWS: Final = 3  # of them that are named
_UNITS: Final = ((1e3, "ms"), (1e6, "us"))
_SHARE: Final = 0.05  # of the speed, where it is not known what a tube can bear


@dataclass(frozen=True, slots=True, kw_only=True)
class _Points:
    """Knots as floats: `t` (K,) in s, `x` (K, n), `u` (K, m); `between` (K - 1, m) where u has rows there."""

    t: Array
    x: Array
    u: Array
    between: Array | None = None

    def exchanged(self, i: int, j: int, *, inputs: bool) -> _Points:
        """The same with two columns of states, or of inputs, in each other's place."""
        columns = list(range((self.u if inputs else self.x).shape[1]))
        columns[i], columns[j] = j, i
        if not inputs:
            return replace(self, x=self.x[:, columns])
        between = None if self.between is None else self.between[:, columns]
        return replace(self, u=self.u[:, columns], between=between)


class _Dynamics:
    """f + B u of a plan, and how far pieces are from it."""

    def __init__(self, model: ControlAffineModel, *, held: bool) -> None:
        self.held = held
        self.tape = Tape([row[0] for row in model.drift_on_plan()], (*model.states, *model.inputs, TIME))

    def rate(self, t: Array, x: Array, u: Array) -> Array:
        """F + B u at points (K,), (K, n), (K, m): (K, n)."""
        return np.asarray(self.tape.run_floats([*x.T, *u.T, t], (len(x),)).T)

    def defect(self, points: _Points) -> Array:
        """|x' - f - B u| in the middle of every piece, (K - 1,), in units of the states per s."""
        return np.asarray(np.nan_to_num(np.linalg.norm(self.missed(points), axis=1), nan=np.inf))

    def missed(self, points: _Points) -> Array:
        """x' - f - B u there, (K - 1, n)."""
        t0, t1 = points.t[:-1], points.t[1:]
        h = (t1 - t0)[:, None]
        x0, x1, u0 = points.x[:-1], points.x[1:], points.u[:-1]
        u1 = u0 if self.held else points.u[1:]
        before, after = self.rate(t0, x0, u0), self.rate(t1, x1, u1)
        u = (u0 + u1) / 2 if points.between is None else points.between
        middle = self.rate((t0 + t1) / 2, (x0 + x1) / 2 + h * (before - after) / 8, u)
        return np.asarray(1.5 * (x1 - x0) / h - (before + after) / 4 - middle)


def rated(spec: Spec, name: str, rate: float) -> str:
    """How fast a state is, in its unit per s."""
    return " ".join(filter(None, (near(abs(rate), 3), dict(spec.units).get(name), "per s")))


def most_of(spec: Spec, missed: Array) -> str:
    """By how much x*' - f - B u* (n,) is missed, and by which state most, beside the width of the safe set."""
    low, high = np.array(spec.safe_set, dtype=float).T
    i = int(np.argmax(np.nan_to_num(np.abs(missed)) / (high - low)))
    most = f"most in {spec.states[i]}' by {rated(spec, spec.states[i], missed[i])}"
    return f"x*' = f + B u* by {near(float(np.linalg.norm(missed)), 3)}, {most}"


def paid(spec: Spec) -> str:
    """What a defect of the plan costs."""
    return f"what is missing is paid for in the {'gains' if spec.hardware is None else 'width of the tube'}"


def table_findings(spec: Spec, table: Table, model: ControlAffineModel, radius: float) -> Iterator[Finding]:
    """What is amiss with a plan file that can be read; `radius` is that of the least tube."""
    knots = table.knots
    if table.begins:
        begins = f"the plan begins at t = {number_text(table.begins)[:40]} s, which is t = 0 from here on"
        help = "horizon, h and every t of the certificate count from there"
        yield replace(_finding(PLAN_TIMES, begins, table.rows[0], help), severity=Severity.NOTE)
    rows = np.array(knots.u, dtype=float)
    each = 2 if knots.interpolation == "hermite-simpson" else 1
    points = _Points(
        t=np.array(knots.t[::each], dtype=float),
        x=np.array(knots.x[::each], dtype=float),
        u=rows[::each],
        between=rows[1::2] if each == 2 else None,
    )
    places = table.rows[::each]
    dynamics = _Dynamics(model, held=knots.interpolation == "hold")
    size = dynamics.defect(points)
    worst = float(size.max())
    speed = float(np.nanmax(np.linalg.norm(dynamics.rate(points.t, points.x, points.u), axis=1), initial=0.0))
    known = spec.metric is not None and radius > 0
    bearable = codes.NOTABLE_DEFECT * float(model.rate) * radius if known else _SHARE * speed
    if not worst > bearable:
        return
    found = _time_unit(table, points, dynamics, worst) or _exchanged(spec, table, points, dynamics, worst)
    if found is not None:
        yield found
        return
    apart = _rows_apart(size)
    for k in apart[:_ROWS]:
        others = "" if len(apart) <= _ROWS else f"; so do {len(apart) - _ROWS} more rows"
        yield _finding(
            codes.PLAN_DEFECT,
            f"the row at t = {near(points.t[k], 4)} s does not belong: the plan misses x*' = f + B u* by "
            f"{near(_beside(size, k), 3)} beside it, and by {near(np.median(size), 3)} elsewhere{others}",
            places[k],
            "correct the row, or leave it out",
        )
    if not apart:
        k = int(np.argmax(size))
        yield _finding(
            codes.PLAN_DEFECT,
            f"the plan misses {most_of(spec, dynamics.missed(points)[k])} between t = {near(points.t[k], 4)} s "
            f"and t = {near(points.t[k + 1], 4)} s",
            places[k],
            f"see whether it is a plan of this system, in its units, and give more knots there; {paid(spec)}",
        )


def _time_unit(table: Table, points: _Points, dynamics: _Dynamics, worst: float) -> Finding | None:
    """Times that are no seconds."""
    tried = [
        (float(dynamics.defect(replace(points, t=points.t / factor)).max()), factor, unit)
        for factor, unit in _UNITS
    ]
    other, factor, unit = min(tried)
    if not other < _FALLS * worst:
        return None
    return _finding(
        codes.PLAN_TIME_UNIT,
        f"the times seem to be in {unit}: the plan misses x*' = f + B u* by {near(worst, 3)}, "
        f"and by {near(other, 3)} with t divided by {near(factor)}",
        table.header,
        f"give t in s, or trajectory.columns: {{t: {{scale: 1/{near(factor)}}}}}",
    )


def _exchanged(
    spec: Spec, table: Table, points: _Points, dynamics: _Dynamics, worst: float
) -> Finding | None:
    """Two columns of states, or of inputs, that are exchanged."""
    tried = [
        (float(dynamics.defect(points.exchanged(i, j, inputs=inputs)).max()), names[i], names[j])
        for names, inputs in ((spec.states, False), (spec.inputs, True))
        for i, j in combinations(range(len(names)), 2)
    ]
    other, one, another = min(tried, default=(worst, "", ""))
    if not other < _FALLS * worst:
        return None
    return _finding(
        codes.PLAN_EXCHANGED,
        f"the columns {one} and {another} seem to be exchanged: the plan misses x*' = f + B u* by "
        f"{near(worst, 3)}, and by {near(other, 3)} with the two exchanged",
        table.header,
        "exchange the two names in the first line",
    )


def _rows_apart(size: Array) -> list[int]:
    """Knots on both sides of which the plan misses far more than in most places, and more than beside them."""
    most = float(np.median(size))
    found = [k for k in range(1, len(size)) if _beside(size, k) > _STANDS_OUT * most]
    return [k for k in found if _beside(size, k) >= max(_beside(size, k - 1), _beside(size, k + 1))]


def _beside(size: Array, k: int) -> float:
    """The lesser defect of the two pieces at an inner knot; 0 at an end."""
    return float(min(size[k - 1], size[k])) if 0 < k < len(size) else 0.0


def _finding(code: str, message: str, location: Location | None, help: str) -> Finding:
    return Finding(code=code, severity=Severity.WARNING, message=message, location=location, help=help)
