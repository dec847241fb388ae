"""Plan, start and obstacles: are they where they can be, and does the plan satisfy the dynamics?

Knots, equilibria and starts are compared exactly, with obstacles where they are near in floats; between knots, and
along expressions of t, in floats at samples.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

import numpy as np

from tubecert.digits import near, up
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import derivatives, number_text
from tubecert.findings import Finding, Severity
from tubecert.lint import codes
from tubecert.lint.codes import finding
from tubecert.lint.names import turned
from tubecert.lint.room import least_radius, room_findings
from tubecert.lint.table import most_of, paid, rated, table_findings
from tubecert.model import TIME, ControlAffineModel, build
from tubecert.spec import Obstacle, Spec
from tubecert.spec.system import Plant, equilibrium

_SAMPLES = 257
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Points of a plan: `t` (K,) in s, `x` (K, n), `u` (K, m), and where the plan stands in the file."""

    t: Array
    x: Array
    u: Array
    path: str


def plan_findings(spec: Spec) -> list[Finding]:
    """Findings about the plan, the start and the obstacles."""
    curve = curve_of(spec)
    start, outside = list(_start(spec)), list(_outside(spec, curve))
    findings = [*held(spec), *start, *outside]
    if not outside and not (start and spec.hardware):
        findings += room_findings(spec, curve.t, curve.x)
    findings += _beyond_limits(spec, curve)
    if not outside and spec.trajectory.written:
        findings += _defect(spec, curve, build(spec))
    findings += of_file(spec)  # exchanged columns leave the safe set, too
    return findings if spec.trajectory.bundle is not None else [*findings, *_obstacles(spec, curve)]


def of_file(spec: Spec) -> list[Finding]:
    """What is amiss with the plan of a file, against the dynamics; nothing of another plan."""
    table = spec.trajectory.table
    return [] if table is None else [*table_findings(spec, table, build(spec), least_radius(spec))]


def curve_of(spec: Spec) -> Curve:
    """Samples of the plan; of a plan that is still to be made, its two ends; of a family, two corners."""
    plan = spec.trajectory
    if plan.table is not None:
        knots = plan.table.knots
        kept = len(knots.t) if plan.horizon is None else bisect_right(knots.t, plan.horizon)
        return Curve(
            t=np.array(knots.t[:kept], dtype=float),
            x=np.array(knots.x[:kept], dtype=float),
            u=np.array(knots.u[:kept], dtype=float),
            path="trajectory.file",
        )
    if plan.task is not None:
        ends = np.array([plan.task.start, plan.task.target], dtype=float)
        last = math.inf if plan.horizon is None else float(plan.horizon)
        here = "trajectory.target" if plan.task.goal else "trajectory.start"
        count = 2 if plan.task.goal else 1
        u = np.zeros((count, len(spec.inputs)))
        return Curve(t=np.array([0.0, last])[:count], x=ends[:count], u=u, path=here)
    if plan.bundle is not None:  # the corners that are farthest out
        corners = np.array(plan.bundle.x, dtype=float).T
        return Curve(t=np.zeros(1), x=corners, u=np.zeros((2, len(spec.inputs))), path="trajectory.x")
    count = 1 if plan.kind == "equilibrium" else _SAMPLES
    t = np.linspace(0.0, float(plan.horizon or Fraction(0)), count)
    tape = Tape([term.expression for term in (*plan.x, *plan.u)], (TIME,))
    both = tape.run_floats([t], t.shape).T
    n = len(spec.states)
    return Curve(t=t, x=both[:, :n], u=both[:, n:], path="trajectory.at" if count == 1 else "trajectory.x")


def held(spec: Spec) -> Iterator[Finding]:
    """What at: auto stands for, and how far that is from the point near which it is."""
    plan = spec.trajectory
    if not plan.about:
        return
    x, u = ([term.expression.fraction for term in terms] for terms in (plan.x, plan.u))
    point, inputs = (_listed(each, 4) for each in (x, u))
    pairs = zip(spec.states, x, plan.about, strict=True)
    moved = [f"{name} by {near(float(own - at), 2)}" for name, own, at in pairs if own != at]
    given = "trajectory.near" if "trajectory.near" in spec.locations else "the middle of the safe set"
    apart = f", which moves {', '.join(moved)} from {given}" if moved else f", which is {given}"
    message, help = f"at: auto holds {point} with input {inputs}{apart}", "they are kept to 20 digits"
    yield finding(spec, codes.HELD, "trajectory.at", message, help, severity=Severity.NOTE)


def _excess(spec: Spec, points: Array) -> tuple[int, int, float]:
    """Where points leave the safe set by most: (point, state, by how much; negative inside)."""
    low, high = np.array(spec.safe_set, dtype=float).T
    beyond = np.nan_to_num(np.maximum(low - points, points - high), nan=np.inf)
    k, i = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    return int(k), int(i), float(beyond[k, i])


def _start(spec: Spec) -> Iterator[Finding]:
    """The initial state, exactly."""
    ends = spec.start_box or tuple((value, value) for value in spec.x0)
    for i, ((least, most), (low, high)) in enumerate(zip(ends, spec.safe_set, strict=True)):
        if spec.within is None and not low <= least <= most <= high:
            value = least if least < low else most
            name = spec.states[i]
            path = f"initial_state.{'box' if spec.start_box else 'at'}[{i}]"
            message = f"the initial state is not in the safe set: {name} = {number_text(value)[:40]}"
            help = f"the safe set has {name} in [{number_text(low)[:40]}, {number_text(high)[:40]}]"
            error = finding(spec, codes.START_OUTSIDE, path, message, help, severity=Severity.ERROR)
            rows = spec.trajectory.table.rows if spec.trajectory.table else ()
            place = error.location or (rows[0] if rows else spec.location("trajectory"))  # that of the plan
            yield replace(error, location=place)


def _outside(spec: Spec, curve: Curve) -> Iterator[Finding]:
    k, i, beyond = _excess(spec, curve.x)
    scale = float(max(abs(end) for ends in spec.safe_set for end in ends))
    if beyond > (0.0 if len(curve.t) == 1 else _ROUNDING * scale):
        when = "" if len(curve.t) == 1 else f" at t = {near(curve.t[k], 4)} s"
        name, help = spec.states[i], f"enlarge safe_set.{spec.states[i]}, or plan inside it"
        low, high = map(float, spec.safe_set[i])
        if spec.trajectory.table and turned(spec, name) and low <= math.radians(curve.x[k, i]) <= high:
            help += f"; a column in degrees is said by trajectory.columns: {{{name}: {{scale: 1 deg}}}}"
        message = f"the plan leaves the safe set{when}: {name} = {near(curve.x[k, i])}"
        yield finding(spec, codes.PLAN_OUTSIDE, curve.path, message, help, severity=Severity.ERROR)


def _beyond_limits(spec: Spec, curve: Curve) -> Iterator[Finding]:
    """Inputs of the plan itself that are not within the limits: what a controller adds comes on top."""
    plan = spec.trajectory
    if plan.task is not None:  # its inputs are still to be found
        return
    values = curve.u
    if plan.bundle is not None:
        values = np.array(plan.bundle.u, dtype=float).T
    for name, (low, high) in spec.limits:
        u = np.nan_to_num(values[:, spec.inputs.index(name)])
        beyond = np.maximum(float(low) - u, u - float(high))
        k = int(np.argmax(beyond))
        if beyond[k] > _ROUNDING * max(abs(float(low)), abs(float(high))):
            when = "" if len(curve.t) == 1 else f" at t = {near(curve.t[k], 4)} s"
            held = plan.kind == "equilibrium"
            message = (
                f"the plan's input {name} is {near(u[k])}{when}, beyond its limits: "
                f"[{number_text(low)[:40]}, {number_text(high)[:40]}]"
            )
            help = (
                f"{'hold another point' if held else 'plan with less of it'}, or give limits.{name} more room: "
                "what a controller adds comes on top"
            )
            path = "trajectory.input" if held else "trajectory.u"
            yield finding(spec, codes.PLAN_BEYOND_LIMITS, path, message, help)


def _defect(spec: Spec, curve: Curve, model: ControlAffineModel) -> Iterator[Finding]:
    """How far the plan is from x*' = f(x*) + B(x*) u*, against what the least tube can bear."""
    x, u = list(curve.x.T), list(curve.u.T)
    drift = Tape([row[0] for row in model.drift_on_plan()], (*model.states, *model.inputs, TIME))
    rate = drift.run_floats([*x, *u, curve.t], curve.t.shape)
    if spec.trajectory.kind != "equilibrium":
        slope = Tape(derivatives([term.expression for term in spec.trajectory.x], TIME), (TIME,))
        rate = slope.run_floats([curve.t], curve.t.shape) - rate
    size = np.linalg.norm(rate, axis=0)
    k = int(np.argmax(np.nan_to_num(size, nan=0.0)))
    worst, largest = float(size[k]), np.max(np.abs(np.concatenate([curve.x[k], curve.u[k], [1.0]])))
    scale = 1e-12 * float(largest)
    if not worst > scale:
        return
    # of a machine it is only known what would cross the safe set in a second
    crossing = float(min(high - low for low, high in spec.safe_set))
    bearable = float(model.rate) * least_radius(spec) if spec.hardware is None else crossing
    notable = worst > codes.NOTABLE_DEFECT * bearable
    if spec.trajectory.kind == "equilibrium":
        pairs = zip(spec.states, rate[:, k], strict=True)
        states = [f"{name} by {rated(spec, name, value)}" for name, value in pairs if abs(value) > scale]
        near_by = held_by(spec)
        message = f"|f + B u| = {near(worst, 3)} there (moves {', '.join(states)})"
        if notable:
            message = f"the point is no equilibrium: {message}"
            exact = f" (at: auto, near: {_listed(curve.x[0], 4)} is that to 20 digits)"
            exact = exact if near_by.startswith("at") else ""
            help = f"write {near_by or 'at and input with f(at) + B(at) input = 0'}{exact}; {paid(spec)}"
        else:
            room = f"{up(100 * worst / bearable, 2)} % of what the tube has room for"
            message = f"the point is an equilibrium up to a rounding: {message}, {room}"
            there = f"input: {_listed(curve.u[0], 12)}"
            digits = "" if near_by == there else f"more digits{near_by and f' ({near_by})'}, or "
            help = f"nothing is wrong: the proof counts it in; {digits}expressions (input: [m*g]) help"
        path = "trajectory.input" if "trajectory.input" in spec.locations else "trajectory.at"
        severity = Severity.WARNING if notable else Severity.NOTE
        yield finding(spec, codes.NO_EQUILIBRIUM, path, message, help, severity=severity)
    elif notable:
        message = f"the plan misses {most_of(spec, rate[:, k])} at t = {near(curve.t[k], 4)} s"
        help = f"correct x or u there; {paid(spec)}"
        yield finding(spec, codes.PLAN_DEFECT, "trajectory.u", message, help)


def held_by(spec: Spec) -> str:
    """What to write for the equilibrium near the point that is held; empty if none is found in the safe set."""
    plan = spec.trajectory
    x, u = (tuple(term.expression.fraction for term in terms) for terms in (plan.x, plan.u))
    found = equilibrium(Plant(spec.states, spec.inputs, spec.f, spec.B, spec.safe_set), x, u)
    if found is None:
        return ""
    at, held = (_listed(each, 12) for each in found)
    return f"input: {held}" if found[0] == x else f"at: {at}, input: {held}"


def _listed(values: Iterable[Fraction | float], digits: int) -> str:
    """Numbers in brackets, as a specification has them."""
    return f"[{', '.join(near(float(value), digits) for value in values)}]"


def _obstacles(spec: Spec, curve: Curve) -> Iterator[Finding]:
    starts = spec.start_box or tuple((value, value) for value in spec.x0)
    for j, obstacle in enumerate(spec.obstacles):
        plane = [spec.states.index(name) for name in obstacle.states]
        path, extents = f"obstacles[{j}]", [_extent(obstacle, axis) for axis in (0, 1)]
        pairs = zip(extents, (spec.safe_set[i] for i in plane), strict=True)
        if any(most < low or least > high for (least, most), (low, high) in pairs):
            message = "the obstacle lies outside the safe set"
            help = "a tube in the safe set cannot meet it"
            yield finding(spec, codes.OBSTACLE_OUTSIDE, path, message, help, severity=Severity.NOTE)
        least, most = np.array(extents, dtype=float).T
        slack, x = _ROUNDING * np.maximum(np.abs(least), np.abs(most)), curve.x[:, plane]
        around = ((least - slack <= x) & (x <= most + slack)).all(axis=1)
        hits = (k for k in np.flatnonzero(around) if obstacle.contains(*map(Fraction, x[k])))
        if (hit := next(hits, None)) is not None:
            message = f"the plan meets the obstacle at t = {near(curve.t[hit], 4)} s"
            help = "plan around it: no tube around this plan keeps away from the obstacle"
            yield finding(spec, codes.COLLISION, path, message, help)
        elif any(obstacle.contains(*at) for at in product(*(starts[i] for i in plane))):
            message, help = "the initial state is in the obstacle", "the tube contains it: start elsewhere"
            yield finding(spec, codes.COLLISION, path, message, help)


def _extent(obstacle: Obstacle, axis: int) -> tuple[Fraction, Fraction]:
    if obstacle.radius is not None:
        return obstacle.center[axis] - obstacle.radius, obstacle.center[axis] + obstacle.radius
    values = [corner[axis] for corner in obstacle.polygon]
    return min(values), max(values)
