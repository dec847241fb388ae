"""Expressions as a product of powers: what stands in a numerator and in a denominator is cancelled.

What the terms of a sum have in common is taken out of it. For a mechanical system 1/(1/D) is D, and the determinant of
M/det(M) is 1/det(M), whatever the units. Untrusted: used for what is proposed, and proven as it is then written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

from tubecert.expression import ONE, ZERO, Expression, coefficient, constant, rebuild, topological
from tubecert.expression.matrix import Matrix, Rows, matrix
from tubecert.synthesis.lifting import common_divisor


@dataclass(frozen=True, slots=True)
class _Product:
    """A rational number times powers of expressions, no exponent being 0."""

    number: Fraction
    powers: Mapping[Expression, int]

    def times(self, other: _Product, sign: int = 1) -> _Product:
        """The product with another one, or with its inverse."""
        powers = dict(self.powers)
        for base, exponent in other.powers.items():
            powers[base] = powers.get(base, 0) + sign * exponent
        number = self.number * other.number**sign
        return _Product(number, {base: k for base, k in powers.items() if k})

    def raised(self, exponent: int) -> _Product:
        """An integer power."""
        return _Product(self.number**exponent, {base: k * exponent for base, k in self.powers.items()})

    @property
    def expression(self) -> Expression:
        """Numerator over denominator."""
        top, bottom = constant(self.number), ONE
        for base, k in self.powers.items():
            top, bottom = (top * base**k, bottom) if k > 0 else (top, bottom * base**-k)
        return top if bottom is ONE else top / bottom


def reduced(rows: Rows) -> Matrix:
    """The same matrix with entries in which everything is cancelled that can be."""
    known: dict[Expression, _Product] = {}
    for node in topological([e for row in rows for e in row]):
        known[node] = _product(node, known)
    return matrix([[known[e].expression for e in row] for row in rows])


def _product(node: Expression, known: Mapping[Expression, _Product]) -> _Product:
    """A node as a product, its arguments being known."""
    parts = [known[arg] for arg in node.args]
    if node.is_constant:
        return _Product(node.fraction, {})
    if node.op == "mul":
        return parts[0].times(parts[1])
    if node.op == "div":
        return parts[0].times(parts[1], -1)
    if node.op == "pow":
        return parts[0].raised(int(str(node.value)))
    if node.op == "add":
        return _sum(parts)
    return _Product(Fraction(1), {rebuild(node, tuple(part.expression for part in parts)): 1})


def _sum(terms: list[_Product]) -> _Product:
    """What the terms have in common, times the sum of what is left of each, without a factor of all its numbers.

    So that M and 2 M, or what is left of either, are powers of one base.
    """
    bases = dict.fromkeys(base for term in terms for base in term.powers)
    least = {base: min(term.powers.get(base, 0) for term in terms) for base in bases}
    common = _Product(Fraction(1), {base: k for base, k in least.items() if k})
    rest: dict[Expression, Fraction] = {}
    for term in terms:
        for q, e in _addends(term.times(common, -1).expression):
            rest[e] = rest.get(e, Fraction(0)) + q
    kept = sorted((item for item in rest.items() if item[1]), key=lambda item: item[0].serial)
    if not kept:
        return _Product(Fraction(0), {})
    content = reduce(common_divisor, (abs(q) for _, q in kept)) * (1 if kept[0][1] > 0 else -1)
    total = sum((q / content * e for e, q in kept), start=ZERO)
    own = _Product(content, {} if total is ONE else {total: 1})
    return common.times(own)


def _addends(e: Expression) -> Iterator[tuple[Fraction, Expression]]:
    """The terms of a sum, or of a number times one: numbers and what they multiply."""
    q, rest = coefficient(e)
    if rest.op == "add":
        for arg in rest.args:
            yield from ((q * p, part) for p, part in _addends(arg))
    elif q:
        yield q, rest
