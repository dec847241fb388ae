"""Certificates that certify nothing: what of them can be confirmed.

A verdict `refuted` names a claim and, where there is one, a point: the claim is evaluated there. That gains are
refuted rests on the lower sides of the constants, which are not examined. A verdict `undecided` claims nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

from flint import arb

from tubecert.recheck import metric, uncontrollable
from tubecert.recheck.balls import Ball, exact, is_indefinite
from tubecert.recheck.claims import Case, Claim
from tubecert.recheck.cover import Outcome
from tubecert.recheck.curve import Segment
from tubecert.recheck.document import Node, digest
from tubecert.recheck.gains import SECTIONS, is_certified
from tubecert.recheck.metric import CONFIRMED
from tubecert.recheck.program import Program
from tubecert.recheck.terms import Matrix, Rows, plus, scaled, times, turned, unit_matrix

_AT_A_POINT = ("metric_definite", "metric_contraction", "metric_killing", "metric_bound")


def of_others(case: Case) -> Iterator[Claim]:
    """What can be examined of a verdict that is not `certified`."""
    same = case.result["spec"]["effective_hash"].text() == digest(case.effective.value)
    outcome = metric.stated(same, "spec.effective_hash is not that of spec.effective")
    yield Claim("the specification and its hash", (same,), lambda: outcome)
    if case.result["verdict"].text() != "refuted":
        return
    for reason in case.result["reasons"].entries():
        if reason["verdict"].text() == "refuted":
            name = reason["claim"].text()
            yield Claim(
                f"refuted: {name}",
                (*case.whole, digest(reason.value)),
                lambda name=name, reason=reason: _refutation(case, name, reason),  # type: ignore[misc]
            )


def _refutation(case: Case, name: str, reason: Node) -> Outcome:
    if name == "metric_found":
        return uncontrollable.excludes(case.effective)
    s, at = case.system, reason.get("at")
    if name in _AT_A_POINT and at is not None:
        point = [exact(value) for value in at["x"].numbers()]
        if len(point) != len(s.states) or not _inside(case, point):
            return metric.stated(False, "the witness does not lie in the safe set")
        if name == "metric_bound":
            return _if(any(is_indefinite(_value(case, rows, point)) for rows in _declared_bounds(case)))
        if name == "metric_definite":
            return _if(is_indefinite(_value(case, s.W, point)))
        if name == "metric_contraction":
            basis = metric.null_space(s, metric.on_set(s), case.budget)
            if isinstance(basis, Outcome):
                return basis
            return _if(
                is_indefinite(_value(case, scaled(-1, times(turned(basis), times(s.F, basis))), point))
            )
        return _if(metric.killing(s).verdict == "contradicted")
    if name == "tube_in_safe_set" and at is not None:
        return _leaves(case, at)
    if name == "condition_holds" and (section := reason["section"].text()) in SECTIONS:
        return _gains_fail(case, case.result[section])
    return Outcome(verdict="undecided", why="refutations of this kind are not examined")


def _declared_bounds(case: Case) -> list[Matrix]:
    """Matrices that are positive semidefinite where the declared bounds of M hold: I/a - W and A W - I."""
    bounds, s = case.effective["metric"].get("bounds"), case.system
    if bounds is None:
        return []
    eye, found = unit_matrix(len(s.states)), []
    lower, upper = (
        None if (node := bounds.get(key)) is None else node.number() for key in ("lower", "upper")
    )
    if lower is not None and lower > 0:
        found.append(plus(scaled(1 / lower, eye), s.W, -1))
    if upper is not None:
        found.append(plus(scaled(upper, s.W), eye, -1))
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


def _leaves(case: Case, at: Node) -> Outcome:
    """The plan comes closer to a face of the safe set than the radius, near the time of the witness."""
    rho, s = exact(case.result["tube"]["rho"].number()), case.system
    t = float(at["t"].number()) if at.get("t") is not None else 0.0
    segment: Segment = case.curve.root
    while segment.halves:
        segment = min(segment.halves, key=lambda half: max(half.when[0] - t, t - half.when[1], 0.0))
        if segment.when[1] - segment.when[0] < 1e-9:
            break
    _, x, _ = segment.middle()
    ranges = (s.safe_set[name] for name in s.states)
    return _if(any(v + rho > exact(hi) or v - rho < exact(lo) for v, (lo, hi) in zip(x, ranges, strict=True)))


def _gains_fail(case: Case, section: Node) -> Outcome:
    """No margin of the section that is printed is proven; its upper end is not positive."""
    if is_certified(section):
        return metric.stated(False, "the section is certified")
    margins = [item["margin"] for item in section["shortfalls"].entries()]
    ends = [margin.pair()[1] for margin in margins]
    refused = any(end.value is not None and exact(end.number()) <= arb(0) for end in ends)
    why = "the shortfalls rest on the lower sides of constants, which are not examined"
    return (
        Outcome(verdict="undecided", why=why) if refused else metric.stated(False, "no shortfall is stated")
    )
