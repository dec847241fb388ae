"""Where the terms of a specification are undefined or not smooth: what they owe, over the set and the horizon."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Effort, decide
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.pencil import scalar
from tubecert.expression import Obligation, free_symbols, to_text
from tubecert.findings import Finding
from tubecert.model.affine import TIME, nonzero, vanishes
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from tubecert.spec import Spec, Term


def domain_findings(spec: Spec, time: Range | None, effort: Effort) -> list[Finding]:
    """What is undefined, not differentiable or rank-deficient on the safe set (and for h and the plan: over `time`)."""
    box: dict[str, Range] = dict(zip(spec.states, spec.safe_set, strict=True))
    over_time: dict[str, Range] = box if time is None else {**box, TIME: time}
    terms = [] if spec.gained else [t for row in spec.B for t in row]
    if spec.metric:
        terms += [t for row in spec.metric.dual_metric for t in row]
    if spec.disturbance:
        terms += [t for row in spec.disturbance.E for t in row]
    findings = [item for term in terms for item in _undefined(term, box, "the safe set", effort)]
    for term in () if spec.drift else spec.f:
        moving = TIME in free_symbols(term.parts)
        where = "the safe set and the horizon" if moving else "the safe set"
        findings += _undefined(term, over_time, where, effort)
    everywhere: dict[str, Range] = {**box, **dict(spec.ranges)}
    for term in (*spec.drift, *(t for row in spec.gained for t in row)):
        findings += _undefined(term, everywhere, "the safe set and the ranges of the parameters", effort)
    for term in spec.uncertainty.h or ():
        findings += _undefined(term, over_time, "the safe set and the horizon", effort)
    for term in (*spec.trajectory.x, *spec.trajectory.u):
        findings += _undefined(term, over_time, "the horizon", effort)
    return findings


def _undefined(term: Term, ranges: dict[str, Range], where: str, effort: Effort) -> list[Finding]:
    findings = []
    for duty, location in term.owed():
        used = {v: ranges[v] for v in sorted(free_symbols([duty.argument])) if v in ranges}
        if duty.kind == "positive":
            decision = decide(scalar(-duty.argument), BoxDomain(used), 0.0, effort)
        else:
            decision = nonzero(duty.argument, used, effort)
        if decision.verdict is Verdict.CERTIFIED:
            continue
        code, message = "TC202", f"'{duty.text}' could not be proven to be defined and smooth on {where}"
        remedy = f"keep {where} further away from the singularity"
        if decision.verdict is Verdict.REFUTED:
            code = "TC201"
            message = (
                f"'{duty.text}' is undefined or not smooth on {where}: "
                f"{to_text(duty.argument)} {_wrong(duty, decision.at)} {place(decision.at)}"
            )
            remedy = "shrink the safe set, or rewrite the expression so that it is smooth there"
            if duty.kind == "nonzero":
                remedy += "; a quotient that has a limit there, as sin(x)/x, is followed closely by a table"
        if duty.table:
            at = f", at {place(decision.at)}" if decision.verdict is Verdict.REFUTED else ""
            message = f"'{duty.text}' may leave its table, which goes {duty.table}, on {where}{at}"
            remedy = "shrink the safe set, or add rows to the table"
        findings.append(Finding(code=code, message=message, location=location, help=remedy))
    return findings


def _wrong(duty: Obligation, at: dict[str, float]) -> str:
    """What is wrong at a point, or near it: a zero is known to lie between points, and may be no float."""
    if duty.kind == "positive":
        return "is not positive at"
    return "is zero at" if vanishes(duty.argument, at) else "has a zero near"


def place(at: dict[str, float]) -> str:
    """A point in words."""
    return ", ".join(f"{name} = {near(value)}" for name, value in at.items()) or "every point"
