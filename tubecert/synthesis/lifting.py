"""Expressions of angles -> expressions of their sines and cosines, exactly.

sin and cos of combinations of variables become polynomials in (s, c) with s^2 + c^2 = 1: of each variable the sine and
cosine of its unit angle, the largest one that all of its angles are multiples of. So an angle in degrees is as good as
one in radians. What remains (exp, sqrt, sin of other arguments) is named as an atom of its own, or refused.
Untrusted: used to set problems up, never to decide.

Expressions as a product of powers: what stands in a numerator and in a denominator is cancelled.

What the terms of a sum have in common is taken out of it. For a mechanical system 1/(1/D) is D, and the determinant of
M/det(M) is 1/det(M), whatever the units. Untrusted: used for what is proposed, and proven as it is then written.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import combinations_with_replacement
from math import gcd, prod

from tubecert.expression import ONE, ZERO, Expression, coefficient, constant, rebuild, symbol, topological
from tubecert.expression.matrix import Matrix, Rows, matrix

_MOST = 6  # multiples of an angle that are expanded
_CIRCULAR = ("sin", "cos", "tan")


class NotLiftedError(Exception):
    """An operation that is no polynomial in variables, sines and cosines."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifted:
    """`expressions` in new symbols.

    `circles` maps a variable to the names of the sine and cosine of its unit angle, `units` to that angle over the
    variable, `atoms` the name of what else was replaced to it.
    """

    expressions: tuple[Expression, ...]
    circles: dict[str, tuple[str, str]]
    units: dict[str, Fraction]
    atoms: dict[str, Expression]


def products(atoms: Sequence[Expression], degree: int) -> Iterator[tuple[tuple[Expression, ...], Expression]]:
    """Choices of at most `degree` atoms, each with its product, without squares of sines (sin^2 = 1 - cos^2)."""
    for d in range(degree + 1):
        for choice in combinations_with_replacement(atoms, d):
            if not any(choice.count(a) > 1 for a in choice if a.op == "sin"):
                yield choice, prod(choice, start=ONE)


def unit_angles(expressions: Iterable[Expression]) -> dict[str, Fraction]:
    """By variable what it is to be multiplied by, so that sines and cosines are taken of small multiples of that.

    The least factor that it has in any angle, where there is no such number.
    """
    factors: dict[str, set[Fraction]] = {}
    for node in topological(expressions):
        if node.op in _CIRCULAR:
            for name, q in (_multiples(node.args[0]) or {}).items():
                factors.setdefault(name, set()).add(abs(q))
    return {name: _unit(own) for name, own in factors.items()}


def _unit(factors: set[Fraction]) -> Fraction:
    unit = reduce(common_divisor, factors)
    return unit if max(factors) <= _MOST * unit else min(factors)


def lift(expressions: Sequence[Expression], *, opaque: bool = False) -> Lifted:
    """Sines and cosines replaced by symbols.

    Raises `NotLiftedError` at what is no polynomial in variables, sines and cosines over another one; with `opaque` it
    is replaced by a symbol instead.
    """
    circles: dict[str, tuple[str, str]] = {}
    units = unit_angles(expressions)
    atoms: dict[str, Expression] = {}
    names: dict[Expression, str] = {}
    new: dict[Expression, Expression] = {}
    for node in topological(expressions):
        pair = _angle(node.args[0], units, circles) if node.op in _CIRCULAR else None
        if pair is not None:
            new[node] = {"sin": pair[0], "cos": pair[1], "tan": pair[0] / pair[1]}[node.op]
        elif node.op in ("const", "symbol", "add", "mul", "div", "pow"):
            args = tuple(new[arg] for arg in node.args)
            new[node] = rebuild(node, args)
        elif opaque:
            name = names.setdefault(node, f"atom#{len(names)}")
            atoms[name] = node
            new[node] = symbol(name)
        else:
            raise NotLiftedError(f"{node.op} of something that is no angle")
    return Lifted(
        expressions=tuple(new[e] for e in expressions),
        circles=circles,
        units={name: units[name] for name in circles},
        atoms=atoms,
    )


def _angle(
    u: Expression, units: dict[str, Fraction], circles: dict[str, tuple[str, str]]
) -> tuple[Expression, Expression] | None:
    """(sin u, cos u) by the addition theorems, if u is a sum of small multiples of unit angles."""
    terms = _multiples(u)
    if terms is None:
        return None
    counts = {name: q / units[name] for name, q in terms.items()}
    if any(count.denominator != 1 or abs(count) > _MOST for count in counts.values()):
        return None
    s, c = ZERO, ONE
    for variable, count in sorted(counts.items()):
        names = circles.setdefault(variable, (f"sin#{variable}", f"cos#{variable}"))
        one_s, one_c = symbol(names[0]), symbol(names[1])
        if count < 0:
            one_s = -one_s
        for _ in range(abs(int(count))):
            s, c = s * one_c + c * one_s, c * one_c - s * one_s
    return s, c


def _multiples(u: Expression) -> dict[str, Fraction] | None:
    """The coefficients of a linear form, without its zeros; None for anything else."""
    total: dict[str, Fraction] = {}
    stack = [(Fraction(1), u)]
    while stack:
        factor, e = stack.pop()
        q, rest = coefficient(e)
        if rest.op == "add":
            stack += [(factor * q, arg) for arg in rest.args]
        elif rest.op == "symbol":
            total[str(rest.value)] = total.get(str(rest.value), Fraction(0)) + factor * q
        else:
            return None
    return {name: q for name, q in total.items() if q}


def common_divisor(a: Fraction, b: Fraction) -> Fraction:
    """The greatest number that both are integer multiples of."""
    return Fraction(
        gcd(a.numerator * b.denominator, b.numerator * a.denominator), a.denominator * b.denominator
    )


def at_point(expressions: Sequence[Expression], values: dict[str, Fraction]) -> list[Fraction]:
    """Exact values of lifted expressions at a rational point; raises `ZeroDivisionError` at a pole."""
    from tubecert.expression import substitute

    return [e.fraction for e in substitute(expressions, {v: constant(q) for v, q in values.items()})]


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
