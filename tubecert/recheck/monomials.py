"""Terms as exact combinations of monomials: what a whole matrix with its derivatives costs is one product.

A factor is a variable, or any operation that is no sum, product or integer power (a wave, a root, one over a
divisor); factors are evaluated by a `Program`, their products one from another. The coefficients are exact: they come
from polynomials over the rationals, with sin^2 = 1 - cos^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

from flint import Ordering, arb, arb_mat, fmpq, fmpq_mpoly_ctx

from tubecert.recheck.balls import Ball, power
from tubecert.recheck.program import Program
from tubecert.recheck.terms import UNIT, Term, in_order, number_of

_CHEAPER = 10  # terms of a product of matrices for each step of a program: a step costs three times that
_LARGE = 4_000  # terms of a polynomial
_CLOSER = 4.0  # times as close, on average, are steps that are worth what they cost
_MOST = 64.0  # what one of many outputs counts at most

Monomial = tuple[tuple[int, int], ...]  # (factor, exponent), factors ascending
Quotient = tuple[int, int]  # of whole numbers without a common divisor
Polynomial = Any  # fmpq_mpoly: flint's classes carry no types


class Combinations:
    """Terms to be evaluated at several points at once; straight lines of steps where that is cheaper."""

    def __init__(self, outputs: Sequence[Term], inputs: Sequence[str]) -> None:
        self._plain = Program(outputs, inputs)
        self._monomials: _Monomials | None = None
        self._boxes = 0
        most = _CHEAPER * len(in_order(outputs))
        found = expanded(outputs, most)
        if found is None:
            return
        factors, polynomials = found
        rows: dict[tuple[tuple[Monomial, Quotient], ...], int] = {}
        self._row = [rows.setdefault(tuple(sorted(p.items())), len(rows)) for p in polynomials]
        monomials = sorted({monomial for p in polynomials for monomial in p})
        if len(rows) * len(monomials) > most:
            return
        place = {monomial: k for k, monomial in enumerate(monomials)}
        table = [[arb(0)] * len(monomials) for _ in rows]
        for line, k in rows.items():
            for monomial, q in line:
                table[k][place[monomial]] = arb(fmpq(*q))
        self._table = arb_mat(len(rows), len(monomials), [e for line in table for e in line])
        self._monomials = _Monomials(monomials, factors, inputs)

    def run(self, points: Sequence[Sequence[Ball]]) -> list[list[Ball]]:
        """Enclosures of the outputs for each point (or box, given as balls)."""
        if self._monomials is None:
            return [self._plain.run(point) for point in points]
        columns = [self._monomials.run(point) for point in points]
        values = (self._table * arb_mat(columns).transpose()).tolist()
        return [[values[row][k] for row in self._row] for k in range(len(points))]

    def over(self, boxes: Sequence[Sequence[Ball]]) -> list[list[Ball]]:
        """The same for boxes, where monomials that cancel are wide: steps take over once they are found much closer."""
        found = self.run(boxes)
        self._boxes += 1
        if self._monomials is None or self._boxes & (self._boxes - 1):  # but for 1, 2, 4, 8, ...
            return found
        steps = [self._plain.run(box) for box in boxes]
        if _times_wider(found, steps) <= _CLOSER:
            return found
        self._monomials = None
        return steps


def _times_wider(found: Sequence[Sequence[Ball]], other: Sequence[Sequence[Ball]]) -> float:
    """How much wider one list of enclosures is than another, on average."""
    ratios = [
        min(float(x.rad()) / float(y.rad()), _MOST) if x.is_finite() else _MOST
        for row, beside in zip(found, other, strict=True)
        for x, y in zip(row, beside, strict=True)
        if y.is_finite() and float(y.rad()) > 0
    ]
    return sum(ratios) / len(ratios) if ratios else 0.0


class _Monomials:
    """Products of powers of factors, each made from the one before."""

    def __init__(self, monomials: Sequence[Monomial], factors: Sequence[Term], inputs: Sequence[str]) -> None:
        used = sorted({factor for monomial in monomials for factor, _ in monomial})
        self._program = Program([factors[k] for k in used], inputs)
        self._powers = sorted({pair for monomial in monomials for pair in monomial})
        column = {factor: k for k, factor in enumerate(used)}
        self._raised = [(column[factor], n) for factor, n in self._powers]
        place: dict[Monomial, int] = {(): 0}
        self._steps: list[tuple[int, int]] = []  # a monomial before, and a power
        power_at = {pair: k for k, pair in enumerate(self._powers)}
        for monomial in monomials:
            for size in range(1, len(monomial) + 1):
                if monomial[:size] not in place:
                    place[monomial[:size]] = len(place)
                    self._steps.append((place[monomial[: size - 1]], power_at[monomial[size - 1]]))
        self._outputs = [place[monomial] for monomial in monomials]

    def run(self, point: Sequence[Ball]) -> list[Ball]:
        """All monomials at a point."""
        factors = self._program.run(point)
        powers = [factors[k] if n == 1 else power(factors[k], n) for k, n in self._raised]
        values = [arb(1)]
        for before, k in self._steps:
            values.append(values[before] * powers[k] if before else powers[k])
        return [values[k] for k in self._outputs]


def expanded(
    outputs: Sequence[Term], most: float = inf
) -> tuple[list[Term], list[dict[Monomial, Quotient]]] | None:
    """Factors, and every output as a polynomial in them; None if there are no factors, or more than `most` terms."""
    order = in_order(outputs)
    place: dict[Term, int] = {}
    for term in sorted(order, key=lambda term: term.op != "sin"):  # sines first in the order of the ring
        factor = _factor(term)
        if factor is not None:
            place.setdefault(factor, len(place))
    factors = list(place)
    if not factors:
        return None
    ring, generators, relations = ring_of(factors)
    value: dict[Term, Polynomial] = {}
    try:
        for term in order:
            factor = _factor(term)
            known = None if factor is None else generators[factor]
            value[term] = _polynomial(term, [value[arg] for arg in term.args], known, ring)
        if sum(len(value[term]) for term in outputs) > most:
            return None
        return factors, [_written(value[term], relations) for term in outputs]
    except OverflowError:
        return None


def ring_of(factors: Sequence[Term]) -> tuple[Any, dict[Term, Polynomial], list[Polynomial]]:
    """Polynomials in factors, sines before all else: the ring, the factors in it, and every sin^2 + cos^2 - 1."""
    ring = fmpq_mpoly_ctx.get([f"v{k}" for k in range(max(1, len(factors)))], Ordering.lex)
    generators = dict(zip(factors, ring.gens(), strict=False))
    pairs = [(own, other) for own in factors for other in factors if (own.op, other.op) == ("sin", "cos")]
    circles = [pair for pair in pairs if pair[0].args == pair[1].args]
    return ring, generators, [generators[sine] ** 2 + generators[cosine] ** 2 - 1 for sine, cosine in circles]


def degree(outputs: Sequence[Term]) -> float:
    """The largest degree of polynomials in variables, waves and what else counts as a factor; infinite if too long."""
    found = expanded(outputs)
    if found is None:
        return 0 if all(term.op == "const" for term in outputs) else inf
    return max((sum(n for _, n in monomial) for p in found[1] for monomial in p), default=0)


def _factor(term: Term) -> Term | None:
    """What a term contributes as a factor: itself, one over the base of its divisor, or nothing."""
    if term.op in ("const", "add", "mul") or (term.op == "pow" and exponent_of(term) > 0):
        return None
    return UNIT / _divisor(term)[0] if term.op in ("div", "pow") else term


def _divisor(term: Term) -> tuple[Term, int]:
    """(e, n) of a division by e^n."""
    divisor = term.args[1] if term.op == "div" else term
    if divisor.op != "pow":
        return divisor, 1
    n = exponent_of(divisor)
    if term.op == "pow":
        return term.args[0], -n
    return (divisor.args[0], n) if n > 0 else (divisor, 1)


def exponent_of(term: Term) -> int:
    """The exponent of a power."""
    return int(str(term.value))


def _polynomial(term: Term, args: list[Polynomial], factor: Polynomial, ring: Any) -> Polynomial:
    """A term from its arguments; raises `OverflowError` where it gets too large."""
    match term.op:
        case "const":
            q = number_of(term)
            return ring.constant(1) * fmpq(q.numerator, q.denominator)
        case "add":
            found = args[0] + args[1]
        case "mul":
            found = _product(*args)
        case "div":
            found = args[0] * factor ** _divisor(term)[1]
        case "pow" if factor is not None:
            found = factor ** _divisor(term)[1]
        case "pow":
            found = ring.constant(1)
            for _ in range(exponent_of(term)):
                found = _product(found, args[0])
        case _:
            found = factor
    _limit(len(found))
    return found


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    _limit(len(a) * len(b))
    return a * b


def _limit(terms: int) -> None:
    if terms > _LARGE:
        raise OverflowError("a polynomial has too many terms")


def _written(p: Polynomial, relations: Sequence[Polynomial]) -> dict[Monomial, Quotient]:
    for relation in relations:
        sine = relation.degrees().index(2)
        _limit(sum(1 + exponents[sine] // 2 for exponents in p.monoms()))  # as many terms, or fewer, are left
        p = divmod(p, relation)[1]
    return {
        tuple((k, int(n)) for k, n in enumerate(exponents) if n): (int(q.p), int(q.q))
        for exponents, q in p.to_dict().items()
    }
