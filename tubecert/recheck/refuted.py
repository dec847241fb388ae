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

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from flint import arb, ctx, fmpq, fmpq_mat

from tubecert.recheck import metric, start
from tubecert.recheck.balls import Ball, exact, floor, is_indefinite
from tubecert.recheck.claims import Case
from tubecert.recheck.cover import CONFIRMED, SHARP, Claim, Outcome, stated
from tubecert.recheck.kinds.table import KEYS
from tubecert.recheck.program import Program
from tubecert.recheck.reasons import Reason
from tubecert.recheck.result import Result, TubeSection
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.numbers import Numbers, Range, upright
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

# to which modes are known, of 1 + their size: repeated ones are known to few digits
_ROUGH = Fraction(1, 1000)
_CLOSE = Fraction(1, 10**6)  # of a number, and of a thousandth of its scale: three digits of it are told


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
    """The claim is false, and what is said of where and by how much is what is found again."""
    name, result = reason.claim, case.result
    if name == "metric_found":
        return excludes(result.specification, reason)
    section = str(reason.parameters.get("section"))
    if name == "condition_holds" and section in KEYS and result.sections is not None:
        return _gains_fail(result, section)
    if name not in _FALSE or not isinstance(result.specification.metric, Metric):
        return Outcome(verdict="undecided", why="refutations of this kind are not examined")
    try:
        return _FALSE[name](_Told(case, reason))
    except _AnotherError as wrong:
        return stated(False, str(wrong))


class _AnotherError(Exception):
    """What is told is not what is found."""


class _Told:
    """What is told of a claim that is false, beside what is found: raises `_AnotherError` for what is another."""

    def __init__(self, case: Case, reason: Reason) -> None:
        self.case = case
        self.parameters: dict[str, Any] = reason.parameters
        self.t, self.x = reason.at or (None, ())

    def word(self, key: str, *among: str) -> str:
        """One of several words."""
        if self.parameters[key] not in among:
            raise _AnotherError(f"{key} is none that is known there")
        return str(self.parameters[key])

    def same(self, key: str, own: Fraction | None) -> None:
        """A number is that of the specification, or of the tube."""
        if self.parameters[key] != own:
            raise _AnotherError(f"{key} is another one")

    def close(
        self, what: str, told: Fraction | None, own: Ball, ends: Range = (Fraction(0), Fraction(0))
    ) -> None:
        """A number is there, and the one that is found, on the scale of a range."""
        far = exact(_CLOSE) * (abs(own) + exact((ends[1] - ends[0]) / 1000))
        if told is None or not abs(exact(told) - own) <= far:
            raise _AnotherError(f"{what} is not {float(own.mid()):.9g}")

    @property
    def moment(self) -> Fraction:
        """The time of the witness: 0 if it names none."""
        t, horizon = self.t or Fraction(0), self.case.system.horizon
        if t < 0 or (horizon is not None and t > horizon):
            raise _AnotherError("the witness is at no time of the plan")
        return t

    def there(self, x: Sequence[Ball]) -> None:
        """The witness is the point that is found, if it is one."""
        for own, told, ends in zip(x, self.x, self.case.system.safe_set.values(), strict=bool(self.x)):
            self.close("the witness", told, own, ends)

    def value(self, rows: Rows) -> list[list[Ball]]:
        """A matrix at the witness, which lies in the safe set."""
        ranges = self.case.system.safe_set.values()
        if not self.x or not all(lo <= x <= hi for x, (lo, hi) in zip(self.x, ranges, strict=True)):
            raise _AnotherError("the witness does not lie in the safe set")
        program = Program([e for row in rows for e in row], self.case.system.states)
        flat = iter(program.run([exact(x) for x in self.x]))
        return [[next(flat) for _ in row] for row in rows]


def _if(holds: bool) -> Outcome:
    why = "it could not be confirmed at the witness"
    return CONFIRMED if holds else Outcome(verdict="undecided", why=why)


def _too_slow(told: _Told) -> Outcome:
    """C2 fails at the rate that is asked for, and at the largest there is."""
    s, largest = told.case.system, told.parameters["largest_rate"]
    told.same("rate", s.rate)
    if s.varies:
        return Outcome(verdict="undecided", why="refutations at a time are not examined")
    basis = metric.null_space(s, metric.on_set(s), told.case.budget)
    if isinstance(basis, Outcome):
        return basis
    if largest.above is None or not largest.is_interval:
        raise _AnotherError("no largest rate is told")
    forms = (
        plus(s.contraction, s.W, 2 * rate) for rate in (s.rate, largest.above + _CLOSE * abs(largest.above))
    )
    values = (told.value(scaled(-1, times(turned(basis), times(form, basis)))) for form in forms)
    return _if(len(s.inputs) < len(s.states) and all(map(is_indefinite, values)))


def _not_killing(told: _Told) -> Outcome:
    """An entry of the defect of an input is not 0; the one that is told, if one is."""
    s, residual = told.case.system, told.parameters.get("residual")
    defect = metric.killing_defect(s, s.inputs.index(told.word("input", *s.inputs)))
    shown = [x for row in told.value(defect) for x in row if x > 0 or x < 0]
    if shown and residual is not None:
        near = min(shown, key=lambda x: abs(float(x.mid()) - float(residual)))
        told.close("residual", residual, near)
    return _if(bool(shown))


def _beyond_declared(told: _Told) -> Outcome:
    """I/a - W, or A W - I, is not positive semidefinite; nor is it with the number that is reached."""
    s, declared, reaches = told.case.system, told.case.result.specification.metric, told.parameters["reaches"]
    assert isinstance(declared, Metric)
    below, eye = told.word("side", "lower", "upper") == "lower", unit_matrix(len(s.states))
    own = declared.lower if below else declared.upper
    told.same("declared", own)
    if own is None or min(own, own if reaches is None else reaches) <= 0:
        raise _AnotherError("a bound is not positive")
    bounds = [own] if reaches is None else [own, reaches * (1 + (_CLOSE if below else -_CLOSE))]
    forms = (plus(scaled(1 / a, eye), s.W, -1) if below else plus(scaled(a, s.W), eye, -1) for a in bounds)
    return _if(all(is_indefinite(told.value(form)) for form in forms))


def _tube_leaves(told: _Told) -> Outcome:
    """The ball around the plan of the radius that is told is beyond a face of the safe set at a time.

    That radius is the certificate's own word: the ball must be beyond it at the least that it can have.
    """
    result = told.case.result
    if result.specification.coordinates or result.tube is None:
        return Outcome(verdict="undecided", why="half-widths are bounds of what the tube reaches")
    least = _least_radius(told.case, result.tube)
    told.same("radius", result.tube.rho)
    return _leaves(told, result.tube.rho, least)


_OF_NO_PLAN = Outcome(verdict="undecided", why="the question is about no plan that is known")


def _leaves(told: _Told, radius: Fraction, least: Fraction) -> Outcome:
    """The plan, with `least` around it, is beyond the face that is told; the witness is `radius` beyond the plan."""
    if isinstance(told.case.result.specification.trajectory, AnyPlan | Planned):
        return _OF_NO_PLAN
    s = told.case.system
    name, above = told.word("state", *s.states), told.word("side", "lower", "upper") == "upper"
    i, (low, high) = s.states.index(name), s.safe_set[name]
    sign, limit = (1, high) if above else (-1, -low)
    x, _ = told.case.curve.at(told.moment)
    beyond = sign * x[i] - exact(limit)
    if not beyond + exact(least) > 0:
        return _if(False)
    x[i] += sign * exact(radius)
    told.close("excess", told.parameters["excess"], beyond + exact(radius), (low, high))
    told.there(x)
    return CONFIRMED


def _starts_outside(told: _Told) -> Outcome:
    """A state starts farther from the plan's than the half-width that is asked for."""
    s, asked, off = told.case.system, told.case.result.specification.half_widths, told.parameters["off"]
    name = told.word("state", *(state for state in s.states if state in asked))
    told.same("half_width", asked[name])
    if s.within is not None:
        told.close("off", off, exact(s.within))
        return _if(s.within > asked[name] and not told.x and not told.t)
    if isinstance(told.case.result.specification.trajectory, Planned):
        return _OF_NO_PLAN
    i = s.states.index(name)
    for point in start.points(s):
        apart = abs(Program([start.off_plan(point, told.case.curve)[i]], ()).run(())[0])
        if told.x == _shown(point) and not told.t:
            told.close("off", off, apart)
            return _if(bool(apart > exact(asked[name])))
    raise _AnotherError("the witness is no start")


def _shown(point: Sequence[Fraction]) -> Numbers:
    """A point as it is told: in floats."""
    return tuple(Fraction(repr(float(q))) for q in point)


def _plan_exceeds(told: _Told) -> Outcome:
    """u* of the plan is beyond a limit at the time of the witness; of a family nothing of the kind is known."""
    spec, inputs = told.case.result.specification, told.case.system.inputs
    if isinstance(spec.trajectory, AnyPlan | Planned):
        return _OF_NO_PLAN
    name, side = told.word("input", *spec.limits), told.word("side", "lower", "upper")
    low, high = ends = spec.limits[name]
    told.same("limit", ends[side == "upper"])
    if told.parameters.keys() > {"input", "side", "limit", "plan"}:
        raise _AnotherError("it says what nothing examines")
    x, u = told.case.curve.at(told.moment)
    value = u[inputs.index(name)]
    told.close("plan", told.parameters["plan"], value, ends)
    told.there(x)
    return _if(bool(value > exact(high)) if side == "upper" else bool(value < exact(low)))


_FALSE: Mapping[str, Callable[[_Told], Outcome]] = {
    "metric_definite": lambda told: _if(is_indefinite(told.value(told.case.system.W))),
    "metric_contraction": _too_slow,
    "metric_killing": _not_killing,
    "metric_bound": _beyond_declared,
    "tube_in_safe_set": _tube_leaves,
    "plan_in_safe_set": lambda told: _leaves(told, Fraction(0), Fraction(0)),
    "start_in_tube": _starts_outside,
    "input_within_limits": _plan_exceeds,
}


def _least_radius(case: Case, tube: TubeSection) -> Fraction:
    """The radius that is stated, or what any must have if that is less: A/a is at least 1, theory 2.11."""
    with ctx.workprec(SHARP):
        distance = Fraction(floor(start.offset(case.place)))
    return min(tube.rho, tube.epsilon + tube.rho_a + distance)


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


def excludes(spec: Specification, reason: Reason) -> Outcome:
    """Whether the rate that is asked for is excluded by the mode that is told, at a point that suggests itself."""
    plant, failure = spec.plant, reason.parameters["failure"]
    assert isinstance(failure, tuple)
    kind, told = failure
    if not isinstance(spec.metric, Wanted) or spec.metric.rate is None or kind != "uncontrollable_mode":
        return Outcome(verdict="undecided", why="no rate is asked for, or there is no mode that excludes it")
    for point in _points(spec):
        if all(low <= x <= high for x, (low, high) in zip(point, plant.safe_set.values(), strict=True)):
            linear = _linearised(plant, point) if reason.at in (None, (None, _shown(point))) else None
            if linear is not None and _has_slow_mode(*linear, spec.metric.rate, **told):
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


def _has_slow_mode(A: fmpq_mat, B: fmpq_mat, rate: Fraction, limit: Fraction, mode: Numbers) -> bool:
    """Whether some uncontrollable mode s, about `mode`, has Re s > -rate, and Re s >= -limit but for rounding."""
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
    most, (real, imaginary) = min(rate, limit + _CLOSE * (1 + abs(limit))), map(exact, mode)
    return any(
        s.real + exact(most) > 0
        and max(abs(s.real - real), abs(abs(s.imag) - imaginary)) <= exact(_ROUGH) * (1 + abs(s))
        for s, _ in roots
    )
