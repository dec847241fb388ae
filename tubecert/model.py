"""The model: a specification as exact matrices of expressions, checked to be defined where they are used.

In: a `Spec`. Out: a `ControlAffineModel`, or findings about where f, B, W or h are undefined or B loses rank.
Trusted: yes. Implements: F(x) = -d_f W + f_x W + W f_x' + 2 rate W, B^+ = (B'B)^-1 B' and their parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import combinations, islice
from typing import TYPE_CHECKING

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Decision, Effort, decide
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.independence import Dependence
from tubecert.enclosure.interval import PI, Interval, fraction_bounds
from tubecert.enclosure.pencil import scalar
from tubecert.enclosure.tape import Tape
from tubecert.enclosure.taylor import MOST_VERTICES
from tubecert.expression import (
    ZERO,
    Expression,
    Obligation,
    constant,
    free_symbols,
    substitute,
    symbol,
    to_text,
    topological,
)
from tubecert.expression.matrix import (
    Matrix,
    TooLargeError,
    adjugate,
    along,
    combine,
    determinant,
    differentiate,
    identity,
    jacobian,
    multiply,
    null_space,
    transpose,
)
from tubecert.expression.waves import frequencies
from tubecert.findings import Finding
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from tubecert.spec import Spec, Term

TIME = "t"
_RANK_BUDGET = 20_000
_MINORS = 1_000  # of B that are looked at: there may be billions
_PRODUCTS = 200  # of one minor: those of 6 dense rows
_SYMBOLIC_WORK = 12_000  # nodes of minors and of their second derivatives: seconds
_SHORT_DETERMINANT = 3  # columns up to which det(B'B) is written out
_RANK_WORK = 2_000_000  # operations at vertices of boxes for a left inverse of B: about a second


@dataclass(frozen=True)
class ControlAffineModel:
    """xdot = f(x) + B(x)(u + h(t, x)) + E(x) w with dual metric W at a rate, all exact.

    Shapes: f (n,), B (n, m), W (n, n), h (m,). Derived matrices are built when asked for and shared. E (n, k) is empty
    where there is no wind; |w| <= `wind_bound` (None: not given), and |w'| <= `wind_rate` where that is known. Where
    `parameters` lie in ranges, the plant has `drift`, f(x, theta) (n,), in place of f, which the controller knows, and
    `gained`, B(x, theta) (n, m), in place of B, if that is not empty. `time`: the range of t in f(t, x), None if f is
    free of t.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: tuple[Expression, ...]
    B: Matrix
    W: Matrix
    rate: Fraction
    h: tuple[Expression, ...] | None
    E: Matrix = ()
    wind_bound: Fraction | None = None
    wind_rate: Fraction | None = None
    drift: tuple[Expression, ...] = ()
    gained: Matrix = ()
    parameters: tuple[tuple[str, Range], ...] = ()
    time: Range | None = None

    @cached_property
    def f_x(self) -> Matrix:
        """df/dx, (n, n)."""
        return jacobian(self.f, self.states)

    @cached_property
    def columns(self) -> Matrix:
        """The columns b_j of B, as rows (m, n)."""
        return transpose(self.B)

    @cached_property
    def constant_input(self) -> bool:
        """Whether B is a matrix of rational numbers."""
        return all(e.is_constant for row in self.B for e in row)

    @cached_property
    def B_x(self) -> list[Matrix]:
        """dB/dx_i for every state, each (n, m)."""
        return [differentiate(self.B, name) for name in self.states]

    @cached_property
    def b_x(self) -> list[Matrix]:
        """db_j/dx for every input, each (n, n)."""
        return [jacobian(column, self.states) for column in self.columns]

    @cached_property
    def gram(self) -> Matrix:
        """B'B, (m, m); its determinant is positive where B has full column rank."""
        return multiply(self.columns, self.B)

    @cached_property
    def B_pinv(self) -> Matrix:
        """B^+ = (B'B)^-1 B', (m, n)."""
        return divide(multiply(adjugate(self.gram), self.columns), determinant(self.gram))

    @cached_property
    def B_pinv_x(self) -> list[Matrix]:
        """dB^+/dx_i for every state, each (m, n)."""
        return [differentiate(self.B_pinv, name) for name in self.states]

    @cached_property
    def BBt(self) -> Matrix:
        """B B', (n, n)."""
        return multiply(self.B, self.columns)

    @cached_property
    def W_x(self) -> list[Matrix]:
        """dW/dx_i for every state, each (n, n)."""
        return [differentiate(self.W, name) for name in self.states]

    @cached_property
    def drift_form(self) -> Matrix:
        """-d_f W + f_x W + W f_x', (n, n): F without its rate term."""
        product = multiply(self.f_x, self.W)
        return combine(1, combine(1, product, 1, transpose(product)), -1, along(self.W, self.f, self.states))

    @cached_property
    def F(self) -> Matrix:
        """-d_f W + f_x W + W f_x' + 2 rate W, (n, n)."""
        return combine(1, self.drift_form, 2 * self.rate, self.W)

    @cached_property
    def annihilator(self) -> Matrix:
        """B_perp of a constant rational B, (n, n - m): columns spanning {v : B'v = 0}."""
        from tubecert.expression.matrix import constants

        basis = null_space([[e.fraction for e in column] for column in self.columns])
        return transpose(constants(basis)) if basis else ()

    @cached_property
    def projector(self) -> Matrix:
        """I - B B^+, (n, n): its columns span {v : B'v = 0}."""
        return combine(1, identity(len(self.states)), -1, multiply(self.B, self.B_pinv))

    def killing_defect(self, j: int) -> Matrix:
        """d_bj W - (b_j)_x W - W (b_j)_x', (n, n): zero where C3 holds for input j."""
        product = multiply(self.b_x[j], self.W)
        moved = along(self.W, self.columns[j], self.states)
        return combine(1, moved, -1, combine(1, product, 1, transpose(product)))

    @cached_property
    def pivots(self) -> tuple[list[tuple[int, ...]], bool]:
        """Choices of m rows of B that may be independent, and whether these are all there are."""
        rows = [i for i, row in enumerate(self.B) if any(e is not ZERO for e in row)]
        chosen = list(islice(combinations(rows, len(self.inputs)), _MINORS + 1))
        return chosen[:_MINORS], len(chosen) <= _MINORS

    def drift_on_plan(self) -> Matrix:
        """f(x) + B(x) u* as a column, with the input names standing for u*, (n, 1)."""
        u = [(symbol(name),) for name in self.inputs]
        return combine(1, [(e,) for e in self.f], 1, multiply(self.B, u))


def divide(a: Matrix, e: Expression) -> Matrix:
    """Every entry over `e`."""
    return tuple(tuple(x / e for x in row) for row in a)


def build(spec: Spec) -> ControlAffineModel:
    """The model of a specification; without a metric, W is empty."""
    metric = spec.metric
    h, wind = spec.uncertainty.h, spec.disturbance
    return ControlAffineModel(
        states=spec.states,
        inputs=spec.inputs,
        f=tuple(term.expression for term in spec.f),
        B=tuple(tuple(term.expression for term in row) for row in spec.B),
        W=tuple(tuple(term.expression for term in row) for row in metric.dual_metric) if metric else (),
        rate=metric.rate if metric else Fraction(0),
        h=None if h is None else tuple(term.expression for term in h),
        E=() if wind is None else tuple(tuple(term.expression for term in row) for row in wind.E),
        wind_bound=None if wind is None else wind.bound,
        wind_rate=None if wind is None else wind.rate,
        drift=tuple(term.expression for term in spec.drift),
        gained=tuple(tuple(term.expression for term in row) for row in spec.gained),
        parameters=spec.ranges,
        time=_time_of(spec),
    )


def _time_of(spec: Spec) -> Range | None:
    """The times of f, None where it is free of t: the horizon, or one period of all that depends on t.

    The reader takes no f that has neither.
    """
    if TIME not in free_symbols(term.expression for term in spec.f):
        return None
    if spec.trajectory.horizon is not None:
        return Fraction(0), spec.trajectory.horizon
    period = time_period(moving_parts(spec))
    if period is None:
        raise ValueError("f depends on t without a horizon or a period")
    return 0.0, float(period.hi)


def moving_parts(spec: Spec) -> list[Expression]:
    """What may depend on t for all time, h and f, and what must hold for them to be defined."""
    terms = [*(spec.uncertainty.h or ()), *spec.f]
    owed = (duty.argument for term in terms for duty, _ in term.owed())
    return [*(term.expression for term in terms), *owed]


def time_period(h: Iterable[Expression]) -> Interval | None:
    """An enclosure of a common period in t of expressions that depend on t through sin, cos, tan only.

    None if there is none to be seen; [0, 0] if t does not occur.
    """
    found = frequencies(h, TIME)
    if found is None:
        return None
    if not found.rational and not found.of_pi:
        return Interval.exact(0.0)
    if found.period is None:
        return Interval.exact(1.0)  # t occurs, as in sin((t + 1) - t), but changes nothing
    length, of_pi = found.period
    with np.errstate(over="ignore"):
        period = Interval.of(length) * (PI if of_pi else Interval.exact(1.0))
    return period if np.isfinite(period.hi) else None


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
        moving = TIME in free_symbols([term.expression, *(duty.argument for duty, _ in term.owed())])
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
            decision = _nonzero(duty.argument, used, effort)
        if decision.verdict is Verdict.CERTIFIED:
            continue
        code, message = "TC202", f"'{duty.text}' could not be proven to be defined and smooth on {where}"
        remedy = "keep the safe set further away from the singularity"
        if decision.verdict is Verdict.REFUTED:
            code = "TC201"
            message = (
                f"'{duty.text}' is undefined or not smooth on {where}: "
                f"{to_text(duty.argument)} {_wrong(duty, decision.at)} {place(decision.at)}"
            )
            remedy = "shrink the safe set, or rewrite the expression so that it is smooth there"
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
    return "is zero at" if _vanishes(duty.argument, at) else "has a zero near"


def place(at: dict[str, float]) -> str:
    """A point in words."""
    return ", ".join(f"{name} = {near(value)}" for name, value in at.items()) or "every point"


def _nonzero(e: Expression, ranges: dict[str, Range], effort: Effort) -> Decision:
    """Whether e has no zero on a box: proven if it is of one sign, refuted by a point of either sign."""
    domain = BoxDomain(ranges)
    positive = decide(scalar(-e), domain, 0.0, effort)
    if positive.verdict is Verdict.CERTIFIED:
        return positive
    negative = decide(scalar(e), domain, 0.0, effort)
    if negative.verdict is Verdict.CERTIFIED:
        return negative
    if positive.verdict == negative.verdict is Verdict.REFUTED:
        # e <= 0 at one point and e >= 0 at the other, and a box is connected
        at = _between(e, positive.at, negative.at)
        return replace(negative, at=_round_zero(e, at, ranges) or at)
    return replace(negative, verdict=Verdict.UNDECIDED)


def _between(e: Expression, low: dict[str, float], high: dict[str, float]) -> dict[str, float]:
    """A point near a zero of `e` on the segment between points where it is <= 0 and >= 0 (floats: only shown)."""
    names = tuple(high)
    tape = Tape([e], names)
    a, b = (np.array([at[name] for name in names]) for at in (low, high))
    for _ in range(60):
        middle = 0.5 * a + 0.5 * b
        value = tape.run_floats([np.array(x) for x in middle], ())[0]
        a, b = (middle, b) if value <= 0 else (a, middle)
    return dict(zip(names, (float(x) for x in b), strict=True))


def _round_zero(e: Expression, at: dict[str, float], ranges: Mapping[str, Range]) -> dict[str, float] | None:
    """A decimal of few digits near the point where `e` is exactly zero, if there is one in the box."""
    return next((rounded for rounded in _decimals(at, ranges) if _vanishes(e, rounded)), None)


def _decimals(at: dict[str, float], ranges: Mapping[str, Range]) -> Iterator[dict[str, float]]:
    """Decimals of few digits near a point, in the box."""
    for digits in (1, 3, 6):
        rounded = {name: round(value, digits) for name, value in at.items()}
        if all(ranges[v][0] <= Fraction(repr(value)) <= ranges[v][1] for v, value in rounded.items()):
            yield rounded


def _vanishes(e: Expression, at: dict[str, float]) -> bool:
    """Whether `e` is zero, exactly, at the decimals that are shown for a point."""
    exact = {name: constant(Fraction(repr(value))) for name, value in at.items()}
    try:
        return substitute([e], exact)[0] is ZERO
    except ZeroDivisionError:  # a part of it is undefined there
        return False


def rank_decision(model: ControlAffineModel, safe_set: Sequence[Range], effort: Effort) -> Decision:
    """Whether B has full column rank on the safe set; refuted with a point where it has not.

    Proven by a left inverse that serves box by box, by one m x m minor that never vanishes, or by det(B'B) > 0. Refuted
    by a sign change of the only minor, or by an exact evaluation at a rational point. Determinants have a budget of
    their own: of a large B, minors beyond it are not looked at, and det(B'B) is not written out.
    """
    box = dict(zip(model.states, safe_set, strict=True))
    minors, complete = _minors(model)
    for d in minors:
        if d.is_constant:
            return Decision(
                verdict=Verdict.CERTIFIED, at={}, value=fraction_bounds(-abs(d.fraction))[1], boxes=0
            )
    entries = [e for row in model.B for e in row]
    own = BoxDomain({v: box[v] for v in sorted(free_symbols(entries))})
    work = len(entries) * len(model.inputs) * 2 ** min(len(free_symbols(entries)), MOST_VERTICES)
    quick = replace(effort, budget=min(effort.budget, _RANK_WORK // work + 1))
    decision = decide(Dependence(model.B), own, 1.0, quick)
    if decision.verdict is Verdict.CERTIFIED:
        return decision
    short = replace(effort, budget=min(effort.budget, _RANK_BUDGET))
    for d in minors:
        decision = _nonzero(d, {v: box[v] for v in sorted(free_symbols([d]))}, short)
        only = complete and len(minors) == 1
        if decision.verdict is Verdict.CERTIFIED or (decision.verdict is Verdict.REFUTED and only):
            return decision
    if len(model.inputs) <= _SHORT_DETERMINANT:
        return _gram_decision(model, box, short)
    at = _dependent(model.B, box)
    return replace(decision, verdict=Verdict.UNDECIDED if at is None else Verdict.REFUTED, at=at or {})


def _gram_decision(model: ControlAffineModel, box: dict[str, Range], effort: Effort) -> Decision:
    """Whether det(B'B) > 0 on a box."""
    gram = determinant(model.gram)
    decision = decide(scalar(-gram), BoxDomain(box), 0.0, effort)
    if decision.verdict is not Verdict.UNDECIDED:
        return decision
    at = _round_zero(gram, decision.at, box)
    return decision if at is None else replace(decision, verdict=Verdict.REFUTED, at=at)


def _dependent(B: Matrix, ranges: Mapping[str, Range]) -> dict[str, float] | None:
    """A point of few digits at which the columns of B are dependent, exactly: the middle of the box, or 0."""
    for at in ({v: float((a + b) / 2) for v, (a, b) in ranges.items()}, dict.fromkeys(ranges, 0.0)):
        for rounded in _decimals(at, ranges):
            values = _exactly(B, rounded)
            if values is not None and null_space(values):
                return rounded
    return None


def _exactly(rows: Matrix, at: Mapping[str, float]) -> list[list[Fraction]] | None:
    """A matrix at the decimals that are shown for a point; None if an entry has no rational value there."""
    exact = {name: constant(Fraction(repr(value))) for name, value in at.items()}
    try:
        values = [substitute(row, exact) for row in rows]
    except ZeroDivisionError:  # a part of it is undefined there
        return None
    if not all(e.is_constant for row in values for e in row):
        return None
    return [[e.fraction for e in row] for row in values]


def _minors(model: ControlAffineModel) -> tuple[list[Expression], bool]:
    """The m x m minors of B that are not identically zero as written, and whether these are all."""
    chosen, complete = model.pivots
    found: list[Expression] = []
    work = 0
    for rows in chosen:
        try:
            d = determinant([model.B[i] for i in rows], _PRODUCTS)
        except TooLargeError:
            return found, False
        if d is not ZERO:
            found.append(d)
            variables = len(free_symbols([d]))  # there are so many second derivatives of every node
            work += len(topological([d])) * (1 + variables * (variables + 1) // 2)
        if work > _SYMBOLIC_WORK:
            return found, False
    return found, complete
