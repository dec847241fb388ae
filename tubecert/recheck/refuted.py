"""Certificates that certify nothing: what of them can be confirmed.

A verdict `refuted` names a claim and, where there is one, a point: the claim is evaluated there. That gains are
refuted rests on the lower sides of the constants, which are not examined. A verdict `undecided` claims nothing.

Why there is no metric: a mode of the linearisation that no input reaches bounds the rate. Exact but for the roots.

Where f(x) + B(x) u = 0, C3 makes the projected C2 that of the linear system (A, B), A = f_x + sum_j u_j (b_j)_x.
With Z a basis of the left null space of [B, AB, ..., A^(n-1) B] and Z A = A_c Z: for A_c'p = s p, v = Z'p has B'v = 0,
and C2 in direction v says 2 (Re s + rate) v'Wv <= 0. So no metric has the rate if some Re s > -rate. f, B and their
slopes must be rational at the point; the roots of the characteristic polynomial of A_c are enclosed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

from flint import arb, ctx, fmpq, fmpq_mat

from tubecert.recheck import metric, start
from tubecert.recheck.balls import Ball, exact, floor, is_indefinite
from tubecert.recheck.claims import Case
from tubecert.recheck.cover import CONFIRMED, SHARP, Claim, Outcome, stated
from tubecert.recheck.curve import Segment
from tubecert.recheck.kinds.table import KEYS
from tubecert.recheck.program import Program
from tubecert.recheck.reasons import Reason
from tubecert.recheck.result import Result, TubeSection
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.numbers import upright
from tubecert.recheck.specified.plant import Metric, Plant, Wanted
from tubecert.recheck.specified.trajectory import AnyPlan, Planned, Resting
from tubecert.recheck.terms import (
    Matrix,
    Rows,
    matrix_replaced,
    matrix_slopes,
    number,
    number_of,
    plus,
    scaled,
    times,
    turned,
    unit_matrix,
)

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
        return excludes(result.specification)
    if not isinstance(result.specification.metric, Metric):
        return Outcome(verdict="undecided", why="refutations of this kind are not examined")
    if name in _AT_A_POINT and at is not None:
        return _metric_fails(case, name, [exact(value) for value in at[1]])
    if name == "tube_in_safe_set" and at is not None:
        return _leaves(case, at[0], (str(reason.parameters["state"]), str(reason.parameters["side"])))
    if name == "plan_in_safe_set" and at is not None:
        own = str(reason.parameters["state"]), str(reason.parameters["side"])
        return _within_none(case, Fraction(0), at[0], own)
    if name == "half_width_fits" and at is not None:
        own = str(reason.parameters["state"]), str(reason.parameters["side"])
        return _too_wide(case, reason.parameters["half_width"], at[0], own)
    if name == "start_in_tube":
        return _starts_outside(case, str(reason.parameters["state"]), reason.parameters["half_width"])
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
        return stated(False, "the witness does not lie in the safe set")
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


def _leaves(case: Case, at: Fraction | None, face: tuple[str, str]) -> Outcome:
    """The plan comes closer to a face of the safe set than the radius, near the time of the witness."""
    if case.result.tube is None:
        return stated(False, "no radius is stated")
    if case.result.specification.coordinates:
        return Outcome(verdict="undecided", why="half-widths are bounds of what the tube reaches")
    return _within_none(case, _least_radius(case, case.result.tube), at, face)


def _within_none(case: Case, own: Fraction, at: Fraction | None, face: tuple[str, str]) -> Outcome:
    """The plan, with a ball of radius `own` around it, is beyond a face of the safe set near a time."""
    s, rho, family, (name, side) = case.system, exact(own), case.result.specification.trajectory, face
    if name not in s.states:
        return stated(False, "no such state is known")
    least, most = s.safe_set[name]
    if isinstance(family, AnyPlan):  # some plan of it is at each face of its box
        low, high = family.x[name]
        return _if(high + own > most if side == "upper" else low - own < least)
    v = _near(case, at).middle()[1][s.states.index(name)]
    return _if(bool(v + rho > exact(most)) if side == "upper" else bool(v - rho < exact(least)))


def _too_wide(case: Case, told: object, at: Fraction | None, face: tuple[str, str]) -> Outcome:
    """The half-width that is asked for is more than the plan leaves to a face of the safe set, near a time."""
    asked = case.result.specification.half_widths.get(face[0])
    if asked is None or told != asked:
        return stated(False, "another half-width is asked for, or none")
    return _within_none(case, asked, at, face)


def _starts_outside(case: Case, name: str, told: object) -> Outcome:
    """A state starts farther from the plan's than the half-width that is asked for."""
    s, asked = case.system, case.result.specification.half_widths
    if name not in s.states or name not in asked:
        return stated(False, "no half-width is asked for")
    if told != asked[name]:
        return stated(False, "another half-width is asked for")
    if s.within is not None:
        return _if(s.within > asked[name])
    i = s.states.index(name)
    most = exact(asked[name])
    apart = [Program([start.off_plan(point, case.curve)[i]], ()).run(())[0] for point in start.points(s)]
    return _if(any(bool(off > most) or bool(-off > most) for off in apart))


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
        return stated(False, "it is no input with limits, or of no known plan")
    low, high = spec.limits[name]
    _, _, u = _near(case, at).middle()
    value = u[inputs.index(name)]
    return _if(bool(value > exact(high)) or bool(value < exact(low)))


def _gains_fail(result: Result, name: str) -> Outcome:
    """No margin of the section that is printed is proven; its upper end is not positive."""
    assert result.sections is not None
    section = result.sections[name]
    if section.verdict == "certified":
        return stated(False, "the section is certified")
    ends = [item.margin.above for item in section.shortfalls]
    refused = any(end is not None and exact(end) <= arb(0) for end in ends)
    why = "the shortfalls rest on the lower sides of constants, which are not examined"
    return Outcome(verdict="undecided", why=why) if refused else stated(False, "no shortfall is stated")


def excludes(spec: Specification) -> Outcome:
    """Whether the rate that the specification asks for is excluded at one of the points that suggest themselves."""
    plant = spec.plant
    if not isinstance(spec.metric, Wanted) or spec.metric.rate is None:
        return Outcome(verdict="undecided", why="no rate is asked for")
    for point in _points(spec):
        if all(low <= x <= high for x, (low, high) in zip(point, plant.safe_set.values(), strict=True)):
            linear = _linearised(plant, point)
            if linear is not None and _has_slow_mode(*linear, spec.metric.rate):
                return CONFIRMED
    return Outcome(verdict="undecided", why="no uncontrollable mode was found that excludes the rate")


def _points(spec: Specification) -> Iterator[Sequence[Fraction]]:
    """Rational points that may be equilibria: the plan's, its target, the centre of the set, the origin."""
    trajectory = spec.trajectory
    if isinstance(trajectory, Resting):
        yield trajectory.at
    if isinstance(trajectory, Planned):
        yield trajectory.target
    yield [(low + high) / 2 for low, high in spec.plant.safe_set.values()]
    yield [Fraction(0)] * len(spec.plant.states)


def _linearised(plant: Plant, point: Sequence[Fraction]) -> tuple[fmpq_mat, fmpq_mat] | None:
    """(A, B) at a point, if it is a (forced) equilibrium and everything is rational there."""
    values = {name: number(q) for name, q in zip(plant.states, point, strict=True)}

    def rational(rows: Rows) -> fmpq_mat | None:
        there: Matrix = matrix_replaced(rows, values)
        if any(e.op != "const" for row in there for e in row):
            return None
        entries = [number_of(e) for row in there for e in row]
        return fmpq_mat(len(rows), len(rows[0]), [fmpq(q.numerator, q.denominator) for q in entries])

    drift = upright(plant.f)
    f, B = rational(drift), rational(plant.B)
    slopes = [[rational(matrix_slopes(rows, name)) for name in plant.states] for rows in (drift, plant.B)]
    if f is None or B is None or any(column is None for columns in slopes for column in columns):
        return None
    n, m = B.nrows(), B.ncols()
    gram = B.transpose() * B
    if gram.rank() < m:
        return None
    u = gram.solve(B.transpose() * f) * fmpq(-1)
    if f + B * u != fmpq_mat(n, 1):
        return None
    columns = [f_k + B_k * u for f_k, B_k in zip(*slopes, strict=True)]
    return fmpq_mat(n, n, [columns[k][i, 0] for i in range(n) for k in range(n)]), B


def _has_slow_mode(A: fmpq_mat, B: fmpq_mat, rate: Fraction) -> bool:
    """Whether some uncontrollable mode s has Re s > -rate."""
    n = A.nrows()
    blocks = [B]
    for _ in range(n - 1):
        blocks.append(A * blocks[-1])
    reached = fmpq_mat(n * B.ncols(), n, [e for block in blocks for e in block.transpose().entries()])
    echelon, rank = reached.rref()
    leading = [next(j for j in range(n) if echelon[i, j] != 0) for i in range(rank)]
    free = [j for j in range(n) if j not in leading]
    if not free:
        return False
    # rows z with z [B, AB, ...] = 0: one for each free column, 1 there and 0 at the others
    Z = fmpq_mat(
        len(free),
        n,
        [
            -echelon[leading.index(j), k] if j in leading else fmpq(int(j == k))
            for k in free
            for j in range(n)
        ],
    )
    image = Z * A
    A_c = fmpq_mat(len(free), len(free), [image[i, k] for i in range(len(free)) for k in free])
    assert image == A_c * Z, "the left null space of the controllability matrix is invariant"
    roots: Any = A_c.charpoly().complex_roots()  # with multiplicities, which flint's types do not say
    return any(bool(s.real + exact(rate) > 0) for s, _ in roots)
