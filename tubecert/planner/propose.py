"""A planning task -> knots of a plan. Untrusted: `trajectory.make` checks what comes out of here.

Knots are rounded to decimals first: what is rounded is what is certified. Between the planner's knots sub-knots are
placed until the proven defect costs less than a thousandth of the tube.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array, fraction_bounds
from tubecert.errors import SpecError
from tubecert.expression import number_text
from tubecert.findings import Finding
from tubecert.model import ControlAffineModel
from tubecert.planner import cache, ilqr
from tubecert.planner.ilqr import Dynamics
from tubecert.progress import Phase, Progress, Step, Unit
from tubecert.release import __version__
from tubecert.spec import Knots, Spec, Task, canonical
from tubecert.trajectory.make import Room, misses
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.trajectory.plan import Defect

_DIGITS = 12
_MOST_PIECES = 20_000
_SAMPLES = 4  # times within a piece at which the defect is guessed
_MOST_SUBSTEPS = 64  # of the integration between two of the planner's knots


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Times (K,) and inputs (K, m) at the planner's knots, exact, and the task that they serve.

    `substeps`: of the integration between two knots that they were planned with.
    """

    t: tuple[Fraction, ...]
    u: tuple[tuple[Fraction, ...], ...]
    task: Task
    substeps: int = ilqr.SUBSTEPS


def course_of(
    spec: Spec,
    task: Task,
    model: ControlAffineModel,
    report: Progress | None = None,
    *,
    substeps: int = ilqr.SUBSTEPS,
) -> Course:
    """Inputs that lead to the target, from the cache if they are there and still do; raises `SpecError` without any."""
    if spec.trajectory.horizon is None:
        raise ValueError("a planning task has a horizon")
    dynamics = Dynamics(model)
    t = grid(spec.trajectory.horizon, task.knots)
    name = cache.key(_content(spec) | {"substeps": substeps})
    course = Course(t=t, u=(), task=task, substeps=substeps)
    kept = _kept(name, course, dynamics)
    if kept is not None:
        return kept
    u = _planned(spec, course, dynamics, report)
    trouble = cache.write(name, tuple(tuple(map(number_text, row)) for row in u))
    if trouble and report is not None:
        report(Step(phase=Phase.PLAN, name=f"not kept ({trouble})", count=len(u), unit=Unit.KNOTS))
    return replace(course, u=u)


def knots_of(
    spec: Spec, course: Course, model: ControlAffineModel, room: Room, report: Progress | None = None
) -> Knots:
    """Knots of the curve that a course steers, as many as its defect asks for; raises `SpecError` if it diverges."""
    try:
        with np.errstate(all="ignore"):
            return _refined(spec, model, course, room, report)
    except FloatingPointError:
        raise SpecError([_diverged(spec)]) from None


def grid(horizon: Fraction, knots: int) -> tuple[Fraction, ...]:
    """Equally spaced times as decimals; the last one is the horizon itself."""
    steps = knots - 1
    return (*(rounded(float(horizon) * k / steps) for k in range(steps)), horizon)


def rounded(value: float) -> Fraction:
    """A decimal of `_DIGITS` significant digits near a float."""
    return Fraction(f"{value:.{_DIGITS - 1}e}")


def _content(spec: Spec) -> dict[str, object]:
    """Everything that a plan follows from."""
    whole = canonical(spec)
    return {
        "version": __version__,
        "numpy": np.__version__,
        "system": {key: whole["system"][key] for key in ("states", "inputs", "f", "B")},
        "trajectory": whole["trajectory"],
    }


def _kept(name: str, course: Course, dynamics: Dynamics) -> Course | None:
    """The course with the inputs of the cache; None if they are not what was written, or lead elsewhere."""
    kept = cache.read(name)
    if kept is None or len(kept) != len(course.t) or any(len(row) != dynamics.m for row in kept):
        return None
    try:
        found = replace(course, u=tuple(tuple(map(Fraction, row)) for row in kept))
        with np.errstate(all="ignore"):
            end = _integrated(dynamics, found, 1).x[-1]
    except (ValueError, ZeroDivisionError, OverflowError, FloatingPointError):
        return None
    return None if course.task.goal and misses(course.task, end) else found


def _planned(
    spec: Spec, course: Course, dynamics: Dynamics, report: Progress | None
) -> tuple[tuple[Fraction, ...], ...]:
    """The inputs at the planner's knots; raises `SpecError` if it finds none."""
    proposal = ilqr.plan(
        dynamics, _problem(course, dynamics), report and (lambda i, cost: report(_step(i, cost)))
    )
    if proposal.outcome is not ilqr.Outcome.FOUND:
        raise SpecError([_failure(spec, proposal)])
    return tuple(tuple(map(rounded, map(float, row))) for row in proposal.u)


def _step(number: int, cost: float) -> Step:
    return Step(phase=Phase.PLAN, name=f"cost {near(cost, 4)}", count=number, unit=Unit.STEPS)


def _problem(course: Course, dynamics: Dynamics) -> ilqr.Problem:
    task = course.task
    target = _floats(task.target)
    return ilqr.Problem(
        t=_floats(course.t),
        start=_floats(task.start),
        target=target,
        input=_holding(dynamics, target, float(course.t[-1])) if task.input is None else _floats(task.input),
        Q=np.array([_floats(row) for row in task.Q]),
        R=np.array([_floats(row) for row in task.R]),
        goal=task.goal,
        held=task.interpolation == "hold",
        substeps=course.substeps,
    )


def _holding(dynamics: Dynamics, target: Array, end: float) -> Array:
    """The input that best holds the target at the time `end`, in the sense of least squares."""
    x = target[:, None]
    drift = dynamics.rate(end, x, np.zeros((dynamics.m, 1)))
    columns = [dynamics.rate(end, x, np.eye(dynamics.m)[:, j : j + 1]) - drift for j in range(dynamics.m)]
    B = np.concatenate(columns, axis=1)
    if not (np.isfinite(B).all() and np.isfinite(drift).all()):
        return np.zeros(dynamics.m)
    return np.asarray(np.linalg.lstsq(B, -drift[:, 0], rcond=None)[0])


def _failure(spec: Spec, proposal: ilqr.Proposal) -> Finding:
    location = spec.location("trajectory.kind")
    if proposal.outcome is ilqr.Outcome.DIVERGED:
        return _diverged(spec)
    return Finding(
        code="TC402",
        message=f"the planner misses the target by {near(proposal.miss, 3)} at the end of the horizon",
        location=location,
        help="lengthen trajectory.horizon, raise trajectory.knots, or set trajectory.goal: false",
    )


def _diverged(spec: Spec) -> Finding:
    return Finding(
        code="TC401",
        message="the planner found no input for which the state stays finite over the horizon",
        location=spec.location("trajectory.kind"),
        help="shorten trajectory.horizon, raise trajectory.knots, or give a plan as CSV",
    )


def _refined(
    spec: Spec, model: ControlAffineModel, course: Course, room: Room, report: Progress | None
) -> Knots:
    """The curve with as many sub-knots as its proven defect asks for (or as many as there may be)."""
    allowed, dynamics = room.allowed(model), Dynamics(model)
    parts, most = 1, max(1, _MOST_PIECES // (len(course.t) - 1))
    while 2 * parts <= most and _guessed_defect(dynamics, _integrated(dynamics, course, parts)) > 0.5 * (
        allowed / np.sqrt(room.lower)
    ):
        parts *= 2
    while True:
        knots = _integrated(dynamics, course, parts)
        if course.task.goal and misses(course.task, knots.x[-1]) and course.substeps < _MOST_SUBSTEPS:
            # these steps are finer than those that were planned with, and lead elsewhere: plan with theirs
            finer = max(parts, 2 * course.substeps)
            course = course_of(spec, course.task, model, report, substeps=finer)
            continue
        plan = piecewise_plan(model, knots)
        if 2 * parts > most or not plan.defined:
            return knots
        if report is not None:
            report(Step(phase=Phase.PLAN, name="defect", count=len(plan.pieces), unit=Unit.PIECES))
        defect = Defect.of(plan, model, fraction_bounds(room.rho)[1], room.effort)
        if defect.in_metric().above < allowed:
            return knots
        parts *= 2


def _integrated(dynamics: Dynamics, course: Course, parts: int) -> Knots:
    """The exact knots of an accurate integration, `parts` of them for every step of the planner.

    Raises `FloatingPointError` if it diverges.
    """
    held = course.task.interpolation == "hold"
    count = max(1, course.substeps // parts)
    x = np.array(course.task.start, dtype=float)[:, None]
    t, states, u = [course.t[0]], [course.task.start], [course.u[0]]
    for k, (begin, end) in enumerate(zip(course.t, course.t[1:], strict=False)):
        left, right = course.u[k], course.u[k if held else k + 1]
        for i in range(1, parts + 1):
            share = Fraction(i, parts)
            time = end if i == parts else rounded(float(begin + share * (end - begin)))
            after = right if i == parts else _between(left, right, share)
            dt = float(time - t[-1])
            ends = [np.array(row, dtype=float)[:, None] for row in (left if held else u[-1], after)]
            x = dynamics.step(float(t[-1]), x, ends[0], ends[1], dt, count=count)
            if not np.isfinite(x).all():
                raise FloatingPointError
            t.append(time)
            states.append(tuple(rounded(float(value)) for value in x[:, 0]))
            u.append(course.u[k + 1] if i == parts else after)
    return Knots(t=tuple(t), x=tuple(states), u=tuple(u), interpolation=course.task.interpolation)


def _between(
    left: tuple[Fraction, ...], right: tuple[Fraction, ...], share: Fraction
) -> tuple[Fraction, ...]:
    if left == right:
        return left
    return tuple(rounded(float(a + share * (b - a))) for a, b in zip(left, right, strict=True))


def _guessed_defect(dynamics: Dynamics, knots: Knots) -> float:
    """sup |p| at a few times of every piece, in floats: only to begin with a sensible number of sub-knots."""
    t, x, u = (np.array(rows, dtype=float) for rows in (knots.t, knots.x, knots.u))
    left, right = u[:-1].T, (u[:-1] if knots.interpolation == "hold" else u[1:]).T
    h, a, b = np.diff(t), x[:-1].T, x[1:].T
    m0, m1, secant = dynamics.rate(t[:-1], a, left), dynamics.rate(t[1:], b, right), (b - a) / h
    a2, a3 = (3 * secant - 2 * m0 - m1) / h, (m0 + m1 - 2 * secant) / h**2
    worst = 0.0
    for share in (np.arange(_SAMPLES) + 0.5) / _SAMPLES:
        tau = share * h
        at = a + tau * (m0 + tau * (a2 + tau * a3))
        p = (
            m0
            + tau * (2 * a2 + 3 * tau * a3)
            - dynamics.rate(t[:-1] + tau, at, left + share * (right - left))
        )
        worst = max(worst, float(np.sqrt((p * p).sum(axis=0)).max()))
    return worst


def _floats(values: tuple[Fraction, ...]) -> Array:
    return np.array([float(value) for value in values])
