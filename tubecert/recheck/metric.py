"""Claims on the whole safe set: rank of B, bounds of M, C2 with its margin, C3 exactly; and what f, B, W, h owe.

Implements: theory (1.1)-(1.3), 1.3 (i) for the null space of B'. M >= a I is I/a - W >= 0, M <= A I is A W - I >= 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import combinations, islice

from tubecert.recheck.balls import exact
from tubecert.recheck.cover import CONFIRMED, Boxed, Domain, Outcome, Range, prove, stated, together
from tubecert.recheck.grammar import Owed
from tubecert.recheck.identity import vanish
from tubecert.recheck.program import Program
from tubecert.recheck.specified.numbers import TIME
from tubecert.recheck.statements import NotNegative, PositiveDefinite
from tubecert.recheck.system import System, along
from tubecert.recheck.terms import (
    NOUGHT,
    UNIT,
    Matrix,
    Rows,
    Term,
    matrix_slopes,
    plus,
    scaled,
    times,
    turned,
    unit_matrix,
)

_MINORS = 200
_SHORT = 4  # columns up to which det B is written out
_MOST_MINORS = 5_000  # of one determinant: those of 12 dense rows


def lower_bound(s: System, a: Fraction, domain: Domain, budget: int, unit: Rows | None = None) -> Outcome:
    """M >= a I; M >= a unit^-1 for another constant unit, (1.1)."""
    if a <= 0:
        return stated(False, "it is not positive")
    own = unit_matrix(len(s.states)) if unit is None else unit
    return prove(PositiveDefinite(plus(scaled(1 / a, own), s.W, -1), own), domain, budget)


def upper_bound(s: System, A: Fraction, domain: Domain, budget: int, unit: Rows | None = None) -> Outcome:
    """0 < M <= A I; M <= A unit^-1 for another constant unit."""
    own = unit_matrix(len(s.states)) if unit is None else unit
    return prove(PositiveDefinite(plus(scaled(A, s.W), own, -1), s.W), domain, budget)


def full_rank(s: System, budget: int) -> Outcome:
    """rank(B) = m: no zero of det B where B is square, det(B'B) > 0 by B'B > 0 elsewhere."""
    n, m, domain = len(s.states), len(s.inputs), on_set(s)
    if m > n:
        return stated(False, "there are more inputs than states")
    if m == n <= _SHORT:
        return _never_zero(determinant(s.B), domain, budget)
    gram = times(turned(s.B), s.B)
    return prove(PositiveDefinite(gram, unit_matrix(m)), domain, budget)


def killing(s: System) -> Outcome:
    """C3: d_b W - b_x W - W b_x' vanishes identically for every column b of B."""
    for j, name in enumerate(s.inputs):
        defect = killing_defect(s, j)
        if not vanish([e for row in defect for e in row]):
            return _not_killing(s, defect, name)
    return CONFIRMED


def killing_defect(s: System, j: int) -> Matrix:
    """What C3 asks to vanish for an input, (n, n)."""
    column = [[row[j]] for row in s.B]
    slope = turned([[row[0] for row in matrix_slopes(column, state)] for state in s.states])
    product = times(slope, s.W)
    return plus(along(s.W_x, column), plus(product, turned(product)), -1)


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
    """C2 at the rate plus `margin`: N'(F0 + 2 (rate + margin) W) N < 0 for a basis N of the null space of B', (1.2)."""
    domain = on_set(s)
    found = null_space(s, domain, budget)
    if isinstance(found, Outcome):
        return found
    form = plus(s.contraction, s.W, 2 * (s.rate + margin))
    restricted, unit = (times(turned(found), times(e, found)) for e in (form, s.W))
    return prove(PositiveDefinite(scaled(-1, restricted), unit), domain, budget)


def null_space(s: System, domain: Domain, budget: int) -> Matrix | Outcome:
    """N (n, n - m) with B'N = 0 and full rank, from m rows of B that are proven independent everywhere, theory 1.3."""
    n, m = len(s.states), len(s.inputs)
    centre = [exact((lo + hi) / 2) for lo, hi in (s.safe_set[name] for name in s.states)]
    minors = []
    used = [i for i in range(n) if any(e is not NOUGHT for e in s.B[i])]
    for rows in islice(combinations(used, m), _MINORS):
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
    """det a, by its first row; minors of the same columns are made once, and `ValueError` if there are too many."""
    return _minor(a, 0, tuple(range(len(a))), {})


def _minor(a: Rows, top: int, columns: tuple[int, ...], known: dict[tuple[int, ...], Term]) -> Term:
    """Of the rows from `top` on and as many columns."""
    if not columns:
        return UNIT
    if columns not in known:
        if len(known) >= _MOST_MINORS:
            raise ValueError("the determinant of a matrix of terms is too long")
        total = NOUGHT
        for j, column in enumerate(columns):
            e = a[top][column]
            if e is not NOUGHT:
                minor = _minor(a, top + 1, (*columns[:j], *columns[j + 1 :]), known)
                total = total + (e * minor if j % 2 == 0 else -(e * minor))
        known[columns] = total
    return known[columns]


def adjugate(a: Rows) -> Matrix:
    """The matrix with a adj(a) = det(a) I."""
    n = len(a)

    def minor(i: int, j: int) -> Term:
        d = determinant([[*row[:j], *row[j + 1 :]] for k, row in enumerate(a) if k != i])
        return d if (i + j) % 2 == 0 else -d

    return [[minor(j, i) for j in range(n)] for i in range(n)]


def on_set(s: System) -> Boxed:
    """The safe set, at all times where f depends on them."""
    return Boxed(s.safe_set if s.time is None else {**s.safe_set, TIME: s.time})


def _never_zero(e: Term, domain: Domain, budget: int) -> Outcome:
    """Contradicted where e is not above 0 at one point and not below it at another: between them it is 0."""
    positive = prove(NotNegative(e, strict=True), domain, budget)
    if positive.holds:
        return positive
    negative = prove(NotNegative(-e, strict=True), domain, budget)
    if positive.verdict == "undecided" and negative.verdict == "contradicted":
        return positive
    return negative


def smooth(duties: Sequence[Owed], ranges: Mapping[str, Range], budget: int) -> Outcome:
    """Every operation of f, B, W, h and the plan is defined: divisors are not zero, roots are of positive numbers."""
    outcomes, domain = [], Boxed(ranges)
    for duty in duties:
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
