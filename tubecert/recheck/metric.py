"""Claims about the metric on the whole safe set: bounds of M, C2 with its margin, C3 exactly; and what f, B, W, h owe.

Implements: theory (1.1)-(1.3), 1.3 (i) for the null space of B'. M >= a I is I/a - W >= 0, M <= A I is A W - I >= 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import combinations, islice

from flint import arb

from tubecert.recheck.balls import exact
from tubecert.recheck.cover import Boxed, Domain, Outcome, Range, prove
from tubecert.recheck.identity import vanish
from tubecert.recheck.program import Program
from tubecert.recheck.reading import TIME, Duty
from tubecert.recheck.statements import NotNegative, PositiveDefinite
from tubecert.recheck.system import System, along
from tubecert.recheck.terms import (
    NOUGHT,
    UNIT,
    Matrix,
    Rows,
    Term,
    in_order,
    matrix_slopes,
    names,
    plus,
    scaled,
    slopes,
    times,
    turned,
    unit_matrix,
)

_MINORS = 200
CONFIRMED = Outcome(verdict="confirmed")


def together(outcomes: Sequence[Outcome]) -> Outcome:
    """Several claims as one: the first that is contradicted, else the first that is undecided."""
    boxes = sum(item.boxes for item in outcomes)
    for verdict in ("contradicted", "undecided"):
        for item in outcomes:
            if item.verdict == verdict:
                return Outcome(verdict=verdict, why=item.why, boxes=boxes)
    return Outcome(verdict="confirmed", boxes=boxes)


def stated(holds: bool, why: str) -> Outcome:
    """A comparison of exact numbers or texts."""
    return CONFIRMED if holds else Outcome(verdict="contradicted", why=why)


def lower_bound(s: System, a: Fraction, domain: Domain, budget: int) -> Outcome:
    """M >= a I."""
    if a <= 0:
        return stated(False, "it is not positive")
    eye = unit_matrix(len(s.states))
    return prove(PositiveDefinite(plus(scaled(1 / a, eye), s.W, -1), eye), domain, budget)


def upper_bound(s: System, A: Fraction, domain: Domain, budget: int) -> Outcome:
    """0 < M <= A I."""
    eye = unit_matrix(len(s.states))
    return prove(PositiveDefinite(plus(scaled(A, s.W), eye, -1), s.W), domain, budget)


def killing(s: System) -> Outcome:
    """C3: d_b W - b_x W - W b_x' vanishes identically for every column b of B."""
    for j, name in enumerate(s.inputs):
        column = [[row[j]] for row in s.B]
        slope = turned([[row[0] for row in matrix_slopes(column, state)] for state in s.states])
        product = times(slope, s.W)
        defect = plus(along(s.W_x, column), plus(product, turned(product)), -1)
        if not vanish([e for row in defect for e in row]):
            return _not_killing(s, defect, name)
    return CONFIRMED


def _not_killing(s: System, defect: Matrix, name: str) -> Outcome:
    """A point where the defect is not zero, or no conclusion."""
    flat = [e for row in defect for e in row]
    program = Program(flat, s.states)
    for share in (Fraction(1, 2), Fraction(31, 100), Fraction(77, 100)):
        point = [exact(lo + share * (hi - lo)) for lo, hi in (s.safe_set[state] for state in s.states)]
        if any(value > 0 or value < 0 for value in program.run(point)):
            return Outcome(verdict="contradicted", why=f"its residual for input {name} is not zero")
    return Outcome(verdict="undecided", why=f"its residual for input {name} could not be shown to vanish")


def contraction(s: System, margin: Fraction, budget: int) -> Outcome:
    """C2 at the rate plus `margin`: N'(F0 + 2 (rate + margin) W) N < 0 for a basis N of the null space of B'."""
    domain = on_set(s)
    found = null_space(s, domain, budget)
    if isinstance(found, Outcome):
        return found
    form = plus(s.contraction, s.W, 2 * (s.rate + margin))
    restricted, unit = (times(turned(found), times(e, found)) for e in (form, s.W))
    return prove(PositiveDefinite(scaled(-1, restricted), unit), domain, budget)


def null_space(s: System, domain: Domain, budget: int) -> Matrix | Outcome:
    """N (n, n - m) with B'N = 0 and full rank, from m rows of B that are proven independent everywhere."""
    n, m = len(s.states), len(s.inputs)
    centre = [exact((lo + hi) / 2) for lo, hi in (s.safe_set[name] for name in s.states)]
    minors = []
    for rows in islice(combinations(range(n), m), _MINORS):
        d = determinant([s.B[i] for i in rows])
        if d is not NOUGHT:
            minors.append((-abs(float(Program([d], s.states).run(centre)[0].mid())), rows, d))
    for _, rows, d in sorted(minors, key=lambda item: item[:2])[:3]:
        if not _never_zero(d, domain, budget).holds:
            continue
        pivot = turned([s.B[i] for i in rows])  # B_1'
        gain = times(adjugate(pivot), turned([s.B[i] for i in range(n) if i not in rows]))
        others = [i for i in range(n) if i not in rows]
        return [
            [-e for e in gain[rows.index(i)]] if i in rows else [d if i == j else NOUGHT for j in others]
            for i in range(n)
        ]
    return Outcome(
        verdict="undecided", why="no rows of B could be shown to be independent on the whole safe set"
    )


def determinant(a: Rows) -> Term:
    """det a, by its first row."""
    if not a:
        return UNIT
    total = NOUGHT
    for j, e in enumerate(a[0]):
        if e is not NOUGHT:
            minor = determinant([[*row[:j], *row[j + 1 :]] for row in a[1:]])
            total = total + (e * minor if j % 2 == 0 else -(e * minor))
    return total


def adjugate(a: Rows) -> Matrix:
    """The matrix with a adj(a) = det(a) I."""
    n = len(a)

    def minor(i: int, j: int) -> Term:
        d = determinant([[*row[:j], *row[j + 1 :]] for k, row in enumerate(a) if k != i])
        return d if (i + j) % 2 == 0 else -d

    return [[minor(j, i) for j in range(n)] for i in range(n)]


def on_set(s: System) -> Boxed:
    """The safe set."""
    return Boxed(s.safe_set)


def _never_zero(e: Term, domain: Domain, budget: int) -> Outcome:
    positive = prove(NotNegative(e, strict=True), domain, budget)
    return positive if positive.holds else prove(NotNegative(-e, strict=True), domain, budget)


def smooth(duties: Sequence[Duty], ranges: Mapping[str, Range], budget: int) -> Outcome:
    """Every operation of f, B, W, h and the plan is defined: divisors are not zero, roots are of positive numbers."""
    outcomes = []
    for duty in duties:
        domain = Boxed({**ranges, **({} if TIME in ranges else {TIME: (arb(0), arb(0))})})
        if duty.kind == "positive":
            found = prove(NotNegative(duty.argument, strict=True), domain, budget)
        else:
            found = _never_zero(duty.argument, domain, budget)
        if not found.holds:
            return Outcome(
                verdict="undecided", why=f"'{duty.text}' may be undefined: {found.why}", boxes=found.boxes
            )
        outcomes.append(found)
    return together(outcomes)


def time_range(s: System) -> Range | None:
    """The times that matter for h: the horizon, one period where there is none, None if h is free of t.

    Raises `ValueError` if h depends on t with no horizon and no period that can be seen.
    """
    if s.h is None or TIME not in names(row[0] for row in s.h):
        return None
    if s.horizon is not None:
        return Fraction(0), s.horizon
    return Fraction(0), period([row[0] for row in s.h])


def period(terms: Sequence[Term]) -> arb:
    """A common period in t of terms in which t occurs in sin, cos, tan of q t + c (all q rational, or all over pi)."""
    rational: list[Fraction] = []
    of_pi: list[Fraction] = []
    bare: dict[Term, bool] = {}  # whether t can be reached without passing through a wave
    for term in in_order(terms):
        if term.op in ("sin", "cos", "tan") and bare[term.args[0]]:
            slope = slopes([term.args[0]], TIME)[0]
            frequency = _frequency(slope)
            if frequency is None:
                raise ValueError("h depends on t without a period that can be seen, so a horizon is needed")
            (of_pi if frequency[1] else rational).append(frequency[0])
            bare[term] = False
        else:
            bare[term] = term.value == TIME if term.op == "symbol" else any(bare[arg] for arg in term.args)
    if any(bare[term] for term in terms) or (rational and of_pi):
        raise ValueError("h depends on t without a period that can be seen, so a horizon is needed")
    steps = [abs(q) for q in (rational or of_pi) if q]
    if not steps:
        return arb(0)
    common = steps[0]
    for q in steps[1:]:
        common = _common(common, q)
    return 2 * (arb.pi() if rational else arb(1)) / exact(common)


def _frequency(slope: Term) -> tuple[Fraction, bool] | None:
    """q of the slope q, or q of q pi."""
    if slope.op == "const":
        return Fraction(str(slope.value)), False
    if slope.op == "pi":
        return Fraction(1), True
    if slope.op == "mul" and {e.op for e in slope.args} == {"const", "pi"}:
        q = next(e for e in slope.args if e.op == "const")
        return Fraction(str(q.value)), True
    return None


def _common(p: Fraction, q: Fraction) -> Fraction:
    """The largest number of which both are integer multiples."""
    while q:
        p, q = q, p % q
    return p
