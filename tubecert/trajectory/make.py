"""A specification -> its plan. The planner proposes inputs; the curve between its knots is integrated, then certified.

Knots are rounded to decimals first: what is rounded is what is certified. Between the planner's knots sub-knots are
placed until the proven defect costs less than a thousandth of the tube.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

import tubecert
from tubecert.claims import CorrectPlan, MoreKnots, OtherInterpolation, PlanRemedy
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array, fraction_bounds
from tubecert.errors import SpecError
from tubecert.expression import number_text
from tubecert.findings import Finding
from tubecert.model import ControlAffineModel
from tubecert.planner import cache, ilqr
from tubecert.planner.rollout import Dynamics
from tubecert.spec import Interpolation, Knots, Spec, Task, canonical
from tubecert.trajectory.defect import Defect
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan
from tubecert.trajectory.plan import Plan

Report = Callable[[str, int, str], None]  # what is done, how many, of what

_DIGITS = 12
_SHARE = 1e-3  # of the tube that a planned curve's defect may cost
_MOST_PIECES = 20_000
_SAMPLES = 4  # times within a piece at which the defect is guessed
_SUBSTEPS = 4  # of the integration between two of the planner's knots, at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """What a defect is measured against: radius of the tube, and a lower bound of the metric."""

    rho: Fraction
    lower: float
    effort: Effort

    def allowed(self, model: ControlAffineModel) -> float:
        """The defect, in the metric, that costs a thousandth of the tube: delta/rate < 1e-3 sqrt(a) rho."""
        return _SHARE * float(model.rate) * float(np.sqrt(self.lower)) * float(self.rho)


def plan_of(spec: Spec, model: ControlAffineModel, room: Room, report: Report | None = None) -> Plan:
    """The plan of a specification; raises `SpecError` if the planner finds none."""
    trajectory = spec.trajectory
    if trajectory.table is not None:
        return piecewise_plan(model, trajectory.table.knots, trajectory.horizon)
    if trajectory.task is not None:
        return _planned(spec, trajectory.task, model, room, report)
    x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
    return Plan(x, u, trajectory.horizon)


def remedy(plan: Plan, model: ControlAffineModel, room: Room) -> PlanRemedy:
    """What would lower a plan's defect."""
    knots = plan.knots
    if knots is None:
        return CorrectPlan()
    other: Interpolation = "linear" if knots.interpolation == "hold" else "hold"
    mended = piecewise_plan(model, replace(knots, interpolation=other), plan.horizon)
    rho, effort = fraction_bounds(room.rho)[1], replace(room.effort, gap=0.05)
    own, instead = (Defect.of(each, model, rho, effort).in_state().above for each in (plan, mended))
    if instead < 0.5 * own:
        return OtherInterpolation(interpolation=other, defect=instead)
    return MoreKnots()


def _planned(
    spec: Spec, task: Task, model: ControlAffineModel, room: Room, report: Report | None
) -> PiecewisePlan:
    assert spec.trajectory.horizon is not None
    dynamics = Dynamics(model)
    t = grid(spec.trajectory.horizon, task.knots)
    u = _inputs(spec, task, dynamics, t, report)
    try:
        with np.errstate(all="ignore"):
            return _refined(model, dynamics, _Course(t=t, u=u, task=task), room, report)
    except FloatingPointError:
        raise SpecError([_diverged(spec)]) from None


def grid(horizon: Fraction, knots: int) -> tuple[Fraction, ...]:
    """Equally spaced times as decimals; the last one is the horizon itself."""
    steps = knots - 1
    return (*(rounded(float(horizon) * k / steps) for k in range(steps)), horizon)


def rounded(value: float) -> Fraction:
    """A decimal of `_DIGITS` significant digits near a float."""
    return Fraction(f"{value:.{_DIGITS - 1}e}")


def _inputs(
    spec: Spec, task: Task, dynamics: Dynamics, t: tuple[Fraction, ...], report: Report | None
) -> tuple[tuple[Fraction, ...], ...]:
    """The inputs at the planner's knots, from the cache if they are there."""
    whole = canonical(spec)
    content = {
        "version": tubecert.__version__,
        "numpy": np.__version__,
        "system": {key: whole["system"][key] for key in ("states", "inputs", "f", "B")},
        "trajectory": whole["trajectory"],
    }
    name = cache.key(content)
    kept = cache.read(name)
    if kept is not None and len(kept) == len(t) and all(len(row) == dynamics.m for row in kept):
        try:
            return tuple(tuple(map(Fraction, row)) for row in kept)
        except (ValueError, ZeroDivisionError):
            pass  # not what was written: plan again
    proposal = ilqr.plan(
        dynamics,
        _problem(task, dynamics, t),
        report and (lambda i, cost: report(f"plan, cost {cost:.4g}", i, "steps")),
    )
    if proposal.outcome is not ilqr.Outcome.FOUND:
        raise SpecError([_failure(spec, proposal)])
    found = tuple(tuple(map(rounded, map(float, row))) for row in proposal.u)
    trouble = cache.write(name, tuple(tuple(map(number_text, row)) for row in found))
    if trouble and report is not None:
        report(f"plan not kept ({trouble})", len(found), "knots")
    return found


def _problem(task: Task, dynamics: Dynamics, t: tuple[Fraction, ...]) -> ilqr.Problem:
    target = _floats(task.target)
    return ilqr.Problem(
        t=_floats(t),
        start=_floats(task.start),
        target=target,
        input=_holding(dynamics, target) if task.input is None else _floats(task.input),
        Q=np.array([_floats(row) for row in task.Q]),
        R=np.array([_floats(row) for row in task.R]),
        goal=task.goal,
        held=task.interpolation == "hold",
    )


def _holding(dynamics: Dynamics, target: Array) -> Array:
    """The input that best holds the target, in the sense of least squares."""
    x = target[:, None]
    drift = dynamics.rate(x, np.zeros((dynamics.m, 1)))
    columns = [dynamics.rate(x, np.eye(dynamics.m)[:, j : j + 1]) - drift for j in range(dynamics.m)]
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
        message=f"the planner misses the target by {proposal.miss:.3g} at the end of the horizon",
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Course:
    """Times and inputs at the planner's knots, exact, and the task that they serve."""

    t: tuple[Fraction, ...]
    u: tuple[tuple[Fraction, ...], ...]
    task: Task


def _refined(
    model: ControlAffineModel, dynamics: Dynamics, course: _Course, room: Room, report: Report | None
) -> PiecewisePlan:
    """The curve with as many sub-knots as its proven defect asks for (or as many as there may be)."""
    allowed = room.allowed(model)
    parts, most = 1, max(1, _MOST_PIECES // (len(course.t) - 1))
    while 2 * parts <= most and _guessed_defect(dynamics, _integrated(dynamics, course, parts)) > 0.5 * (
        allowed / np.sqrt(room.lower)
    ):
        parts *= 2
    while True:
        plan = piecewise_plan(model, _integrated(dynamics, course, parts))
        if 2 * parts > most or not plan.defined:
            return plan
        if report is not None:
            report("plan, defect", len(plan.pieces), "pieces")
        defect = Defect.of(plan, model, fraction_bounds(room.rho)[1], room.effort)
        if defect.in_metric().above < allowed:
            return plan
        parts *= 2


def _integrated(dynamics: Dynamics, course: _Course, parts: int) -> Knots:
    """The exact knots of an accurate integration, `parts` of them for every step of the planner.

    Raises `FloatingPointError` if it diverges.
    """
    held = course.task.interpolation == "hold"
    count = max(1, _SUBSTEPS // parts)
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
            x = dynamics.step(x, ends[0], ends[1], dt, count)
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
    m0, m1, secant = dynamics.rate(a, left), dynamics.rate(b, right), (b - a) / h
    a2, a3 = (3 * secant - 2 * m0 - m1) / h, (m0 + m1 - 2 * secant) / h**2
    worst = 0.0
    for share in (np.arange(_SAMPLES) + 0.5) / _SAMPLES:
        tau = share * h
        at = a + tau * (m0 + tau * (a2 + tau * a3))
        p = m0 + tau * (2 * a2 + 3 * tau * a3) - dynamics.rate(at, left + share * (right - left))
        worst = max(worst, float(np.sqrt((p * p).sum(axis=0)).max()))
    return worst


def _floats(values: tuple[Fraction, ...]) -> Array:
    return np.array([float(value) for value in values])
