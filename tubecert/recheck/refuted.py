"""Certificates that certify nothing: what of them can be confirmed.

A verdict `refuted` names a claim and, where there is one, a point: the claim is evaluated there. That gains are
refuted rests on the lower sides of the constants, which are not examined. A verdict `undecided` claims nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from flint import arb, ctx

from tubecert.recheck import metric, start, uncontrollable
from tubecert.recheck.balls import Ball, exact, floor, is_indefinite
from tubecert.recheck.case import Case
from tubecert.recheck.cover import Outcome
from tubecert.recheck.curve import Segment
from tubecert.recheck.examination import SHARP, Claim
from tubecert.recheck.kinds.table import KEYS
from tubecert.recheck.metric import CONFIRMED
from tubecert.recheck.program import Program
from tubecert.recheck.reasons import Reason
from tubecert.recheck.result import Result, TubeSection
from tubecert.recheck.specified.metric import Metric
from tubecert.recheck.specified.trajectory import AnyPlan
from tubecert.recheck.terms import Matrix, Rows, plus, scaled, times, turned, unit_matrix

_AT_A_POINT = ("metric_definite", "metric_contraction", "metric_killing", "metric_bound")


def of_others(case: Case) -> Iterator[Claim]:
    """What can be examined of a verdict that is not `certified`."""
    if case.result.verdict != "refuted":
        return
    reasons = [reason for reason in case.result.reasons if reason.verdict == "refuted"]
    if not reasons:
        why = "nothing is named that is refuted"
        yield Claim("refuted", None, lambda: Outcome(verdict="undecided", why=why))
    for reason in reasons:
        yield Claim(
            f"refuted: {reason.claim}",
            (
                *case.whole,
                case.knots,
                repr(reason),
                repr(case.result.tube),
                repr(case.result.sections),
                repr(case.result.specification.limits),  # no part of `whole`
            ),
            lambda reason=reason: _refutation(case, reason),  # type: ignore[misc]
        )


def _refutation(case: Case, reason: Reason) -> Outcome:
    name, result, at = reason.claim, case.result, reason.at
    if name == "metric_found":
        return uncontrollable.excludes(result.specification)
    if not isinstance(result.specification.metric, Metric):
        return Outcome(verdict="undecided", why="refutations of this kind are not examined")
    if name in _AT_A_POINT and at is not None:
        return _metric_fails(case, name, [exact(value) for value in at[1]])
    if name == "tube_in_safe_set" and at is not None:
        return _leaves(case, at[0])
    if name == "input_within_limits":
        return _plan_exceeds(case, str(reason.parameters["input"]), None if at is None else at[0])
    section = str(reason.parameters.get("section"))
    if name == "condition_holds" and section in KEYS and result.sections is not None:
        return _gains_fail(result, section)
    return Outcome(verdict="undecided", why="refutations of this kind are not examined")


def _metric_fails(case: Case, name: str, point: list[Ball]) -> Outcome:
    """A condition on the metric is false at the witness."""
    s = case.system
    if len(point) != len(s.states) or not _inside(case, point):
        return metric.stated(False, "the witness does not lie in the safe set")
    if name == "metric_bound":
        return _if(any(is_indefinite(_value(case, rows, point)) for rows in _declared_bounds(case)))
    if name == "metric_definite":
        return _if(is_indefinite(_value(case, s.W, point)))
    if name == "metric_contraction" and s.varies:
        return Outcome(verdict="undecided", why="refutations at a time are not examined")
    if name == "metric_contraction":
        basis = metric.null_space(s, metric.on_set(s), case.budget)
        if isinstance(basis, Outcome):
            return basis
        return _if(is_indefinite(_value(case, scaled(-1, times(turned(basis), times(s.F, basis))), point)))
    return _if(metric.killing(s).verdict == "contradicted")


def _declared_bounds(case: Case) -> list[Matrix]:
    """Matrices that are positive semidefinite where the declared bounds of M hold: I/a - W and A W - I."""
    declared, s = case.result.specification.metric, case.system
    assert isinstance(declared, Metric)
    eye, found = unit_matrix(len(s.states)), []
    if declared.lower is not None:
        found.append(plus(scaled(1 / declared.lower, eye), s.W, -1))
    if declared.upper is not None:
        found.append(plus(scaled(declared.upper, s.W), eye, -1))
    return found


def _if(holds: bool) -> Outcome:
    return (
        CONFIRMED if holds else Outcome(verdict="undecided", why="it could not be confirmed at the witness")
    )


def _inside(case: Case, point: list[Ball]) -> bool:
    ranges = (case.system.safe_set[name] for name in case.system.states)
    return all(exact(lo) <= x <= exact(hi) for x, (lo, hi) in zip(point, ranges, strict=True))


def _value(case: Case, rows: Rows, point: list[Ball]) -> list[list[Ball]]:
    flat = iter(Program([e for row in rows for e in row], case.system.states).run(point))
    return [[next(flat) for _ in row] for row in rows]


def _leaves(case: Case, at: Fraction | None) -> Outcome:
    """The plan comes closer to a face of the safe set than the radius, near the time of the witness."""
    if case.result.tube is None:
        return metric.stated(False, "no radius is stated")
    if case.result.specification.coordinates:
        return Outcome(verdict="undecided", why="half-widths are bounds of what the tube reaches")
    s, own = case.system, _least_radius(case, case.result.tube)
    rho, family = exact(own), case.result.specification.trajectory
    if isinstance(family, AnyPlan):  # some plan of it is at each face of its box
        pairs = [(family.x[name], s.safe_set[name]) for name in s.states]
        return _if(any(low - own < least or high + own > most for (low, high), (least, most) in pairs))
    _, x, _ = _near(case, at).middle()
    ranges = (s.safe_set[name] for name in s.states)
    return _if(any(v + rho > exact(hi) or v - rho < exact(lo) for v, (lo, hi) in zip(x, ranges, strict=True)))


def _least_radius(case: Case, tube: TubeSection) -> Fraction:
    """The radius that is stated, or what any must have if that is less: A/a is at least 1, theory 2.11."""
    with ctx.workprec(SHARP):
        distance = Fraction(floor(start.offset(case.place)))
    return min(tube.rho, tube.epsilon + tube.rho_a + distance)


def _near(case: Case, at: Fraction | None) -> Segment:
    """A short segment of the plan near a time."""
    t = 0.0 if at is None else float(at)
    segment: Segment = case.curve.root
    while segment.halves:
        segment = min(segment.halves, key=lambda half: max(half.when[0] - t, t - half.when[1], 0.0))
        if segment.when[1] - segment.when[0] < 1e-9:
            break
    return segment


def _plan_exceeds(case: Case, name: str, at: Fraction | None) -> Outcome:
    """u* of the plan is beyond a limit near the time of the witness; of a family nothing of the kind is known."""
    spec, inputs = case.result.specification, case.system.inputs
    if name not in spec.limits or isinstance(spec.trajectory, AnyPlan):
        return metric.stated(False, "it is no input with limits, or of no known plan")
    low, high = spec.limits[name]
    _, _, u = _near(case, at).middle()
    value = u[inputs.index(name)]
    return _if(bool(value > exact(high)) or bool(value < exact(low)))


def _gains_fail(result: Result, name: str) -> Outcome:
    """No margin of the section that is printed is proven; its upper end is not positive."""
    assert result.sections is not None
    section = result.sections.by_key[name]
    if section.verdict == "certified":
        return metric.stated(False, "the section is certified")
    ends = [item.margin.above for item in section.shortfalls]
    refused = any(end is not None and exact(end) <= arb(0) for end in ends)
    why = "the shortfalls rest on the lower sides of constants, which are not examined"
    return (
        Outcome(verdict="undecided", why=why) if refused else metric.stated(False, "no shortfall is stated")
    )
