"""Proves that an expression vanishes identically, by exact algebra.

The expression becomes a quotient of polynomials over the rationals in *atoms* (variables, pi, sin, cos, exp,
sqrt, log and inverse functions of canonical arguments, norms) with sin^2 = 1 - cos^2, sqrt(u)^2 = u, tan = sin/cos,
the hyperbolic functions in terms of exp, and the addition theorems.
Every rule holds wherever the expression is defined, so a numerator without terms is a proof;
anything else proves nothing, unless only variables (and pi, which is transcendental) are left.
"""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from typing import Final

from tubecert.expression.graph import Expression, rational_root, topological

Monomial = tuple[tuple[int, int], ...]  # (atom, exponent > 0), atoms ascending
Polynomial = dict[Monomial, Fraction]
Quotient = tuple[Polynomial, Polynomial]

_UNIT: Final[Monomial] = ()
_ONE: Final[Polynomial] = {_UNIT: Fraction(1)}
_MULTIPLE = 12  # addition theorems are used for at most this multiple of an angle,
_TERMS = 4  # and for at most so many terms


class _BudgetError(Exception):
    """More terms than allowed."""


class _UndefinedError(Exception):
    """A divisor vanishes identically."""


def is_zero(e: Expression, budget: int = 200_000) -> bool | None:
    """True if `e` is proven to vanish wherever it is defined, False if proven not to, None if neither is.

    `budget` bounds the number of terms that are formed.
    """
    algebra = _Algebra(budget)
    try:
        numerator, _ = algebra.expand(e)
    except (_BudgetError, _UndefinedError):
        return None
    if not numerator:
        return True
    return False if algebra.plain(numerator) else None


class _Algebra:
    """Polynomials in a growing table of atoms."""

    def __init__(self, budget: int) -> None:
        self.budget = budget
        self.atoms: dict[object, int] = {}
        self.squares: dict[int, Polynomial] = {}  # what the square of an atom is replaced by
        self.polynomial_atoms: set[int] = set()

    def expand(self, e: Expression) -> Quotient:
        """`e` as (numerator, divisor)."""
        value: dict[Expression, Quotient] = {}
        for node in topological([e]):
            value[node] = self._node(node, [value[arg] for arg in node.args])
        return value[e]

    def plain(self, p: Polynomial) -> bool:
        """Whether only variables and pi occur."""
        return all(atom in self.polynomial_atoms for monomial in p for atom, _ in monomial)

    def _node(self, e: Expression, args: list[Quotient]) -> Quotient:
        match e.op:
            case "const":
                return _number(e.fraction), _ONE
            case "pi" | "symbol":
                atom = self._atom((e.op, e.value))
                self.polynomial_atoms.add(atom)
                return _variable(atom), _ONE
            case "add":
                return self._sum(*args)
            case "mul":
                return self._product(*args)
            case "div":
                return self._product(args[0], _inverse(args[1]))
            case "pow":
                return self._power(args[0], int(str(e.value)))
            case "sin":
                return self._angle(args[0])[0]
            case "cos":
                return self._angle(args[0])[1]
            case "tan":
                sine, cosine = self._angle(args[0])
                return self._product(sine, _inverse(cosine))
            case "exp":
                return self._exponential(args[0])
            case "sinh" | "cosh" | "tanh":
                return self._hyperbolic(e.op, args[0])
            case "asin" | "acos" | "atan" | "log" | "table":
                return self._new(e.op, e.value, _settled(*args[0]))
            case "sqrt":
                return self._root(args[0])
            case "norm":
                return self._norm(args)
        return _variable(self._atom(e)), _ONE  # direction: known by its node only

    # polynomials

    def _new(self, op: str, value: object, u: Quotient) -> Quotient:
        """A function of `u` of which nothing more is known."""
        return _variable(self._atom((op, value, _frozen(u)))), _ONE

    def _atom(self, key: object) -> int:
        return self.atoms.setdefault(key, len(self.atoms))

    def _add(self, p: Polynomial, q: Polynomial) -> Polynomial:
        self._spend(len(q))
        total = dict(p)
        for monomial, c in q.items():
            _accumulate(total, monomial, c)
        return total

    def _times(self, p: Polynomial, q: Polynomial) -> Polynomial:
        self._spend(len(p) * len(q))
        total: Polynomial = {}
        for a, c in p.items():
            for b, d in q.items():
                monomial = _merge(a, b)
                if any(n > 1 and atom in self.squares for atom, n in monomial):
                    for reduced, factor in self._reduce(monomial).items():
                        _accumulate(total, reduced, c * d * factor)
                else:
                    _accumulate(total, monomial, c * d)
        return total

    def _reduce(self, monomial: Monomial) -> Polynomial:
        """Squares of sines, roots and norms replaced."""
        result: Polynomial = {
            tuple((atom, 1 if atom in self.squares else n) for atom, n in monomial
                  if atom not in self.squares or n % 2): Fraction(1)
        }  # fmt: skip
        for atom, n in monomial:
            for _ in range(n // 2 if atom in self.squares else 0):
                result = self._times(result, self.squares[atom])
        return result

    def _spend(self, terms: int) -> None:
        self.budget -= terms
        if self.budget < 0:
            raise _BudgetError

    # quotients

    def _sum(self, a: Quotient, b: Quotient) -> Quotient:
        if a[1] == b[1]:
            return self._add(a[0], b[0]), a[1]
        top = self._add(self._times(a[0], b[1]), self._times(b[0], a[1]))
        return top, self._times(a[1], b[1])

    def _product(self, a: Quotient, b: Quotient) -> Quotient:
        if a[0] == b[1]:
            return _settled(b[0], a[1])
        if a[1] == b[0]:
            return _settled(a[0], b[1])
        return _settled(self._times(a[0], b[0]), self._times(a[1], b[1]))

    def _power(self, base: Quotient, n: int) -> Quotient:
        base = _inverse(base) if n < 0 else base
        result: Quotient = _ONE, _ONE
        for bit in bin(abs(n))[2:]:
            result = self._product(result, result)
            if bit == "1":
                result = self._product(result, base)
        return result

    # functions

    def _angle(self, u: Quotient) -> tuple[Quotient, Quotient]:
        """(sin u, cos u), by the addition theorems where `u` is a short sum of small multiples."""
        terms = _multiples(u)
        if terms is None:
            sign, key = _signed(u)
            sine, cosine = self._basic_angle(("angle", key))
            return (_scaled(sine, sign), _ONE), (cosine, _ONE)
        s: Polynomial = {}
        c = _ONE
        for unit, count in terms:
            sine, cosine = self._unit_angle(unit)
            sine = _scaled(sine, Fraction(1 if count > 0 else -1))
            for _ in range(abs(count)):
                s, c = (
                    self._add(self._times(s, cosine), self._times(c, sine)),
                    self._add(self._times(c, cosine), _scaled(self._times(s, sine), Fraction(-1))),
                )
        return (s, _ONE), (c, _ONE)

    def _unit_angle(self, unit: tuple[Monomial, int]) -> tuple[Polynomial, Polynomial]:
        monomial, divisor = unit
        if monomial == ((self.atoms.get(("pi", None)), 1),) and divisor <= 2:
            sine, cosine = ((0, -1), (1, 0))[divisor - 1]
            return _number(Fraction(sine)), _number(Fraction(cosine))
        return self._basic_angle(("unit angle", unit))

    def _basic_angle(self, key: object) -> tuple[Polynomial, Polynomial]:
        cosine, sine = self._atom(("cos", key)), self._atom(("sin", key))
        self.squares[sine] = {_UNIT: Fraction(1), ((cosine, 2),): Fraction(-1)}
        return _variable(sine), _variable(cosine)

    def _exponential(self, u: Quotient) -> Quotient:
        terms = _multiples(u)
        if terms is None:
            sign, key = _signed(u)
            atom = _variable(self._atom(("exp", key))), _ONE
            return atom if sign > 0 else _inverse(atom)
        result: Quotient = _ONE, _ONE
        for unit, count in terms:
            factor = _variable(self._atom(("unit exp", unit))), _ONE
            result = self._product(result, self._power(factor, count))
        return result

    def _hyperbolic(self, op: str, u: Quotient) -> Quotient:
        """sinh u = (e - 1/e)/2 and cosh u = (e + 1/e)/2 with e = exp(u); tanh is their quotient."""
        e = self._exponential(u)
        square = self._product(e, e)
        minus = self._sum(square, (_number(Fraction(-1)), _ONE))
        plus = self._sum(square, (_ONE, _ONE))
        if op == "tanh":
            return self._product(minus, _inverse(plus))
        return self._product(minus if op == "sinh" else plus, _inverse((_scaled(e[0], Fraction(2)), e[1])))

    def _root(self, u: Quotient) -> Quotient:
        if not u[0]:
            return {}, _ONE
        if u[1] == _ONE and list(u[0]) == [_UNIT] and (exact := rational_root(u[0][_UNIT])) is not None:
            return _number(exact), _ONE
        atom = self._atom(("sqrt", _frozen(u)))
        if u[1] == _ONE:
            self.squares[atom] = u[0]
        return _variable(atom), _ONE

    def _norm(self, args: list[Quotient]) -> Quotient:
        kept = [arg for arg in args if arg[0]]
        if not kept:
            return {}, _ONE
        atom = self._atom(("norm", frozenset(Counter(_signed(arg)[1] for arg in kept).items())))
        if all(arg[1] == _ONE for arg in kept):
            total: Polynomial = {}
            for arg in kept:
                total = self._add(total, self._times(arg[0], arg[0]))
            self.squares[atom] = total
        return _variable(atom), _ONE


def _number(value: Fraction) -> Polynomial:
    return {_UNIT: value} if value else {}


def _variable(atom: int) -> Polynomial:
    return {((atom, 1),): Fraction(1)}


def _scaled(p: Polynomial, factor: Fraction) -> Polynomial:
    return {monomial: factor * c for monomial, c in p.items()}


def _accumulate(total: Polynomial, monomial: Monomial, c: Fraction) -> None:
    value = total.get(monomial, Fraction(0)) + c
    if value:
        total[monomial] = value
    else:
        total.pop(monomial, None)


def _merge(a: Monomial, b: Monomial) -> Monomial:
    if not a or not b:
        return a or b
    powers = dict(a)
    for atom, n in b:
        powers[atom] = powers.get(atom, 0) + n
    return tuple(sorted(powers.items()))


def _inverse(a: Quotient) -> Quotient:
    if not a[0]:
        raise _UndefinedError
    return _settled(a[1], a[0])


def _settled(top: Polynomial, bottom: Polynomial) -> Quotient:
    """The divisor made monic in its leading monomial, so that equal divisors are recognised."""
    if not bottom:
        raise _UndefinedError  # a product of divisors such as (sqrt(x**2) - x)(sqrt(x**2) + x)
    lead = bottom[max(bottom)]
    if lead == 1:
        return top, bottom
    return _scaled(top, 1 / lead), _scaled(bottom, 1 / lead)


def _signed(u: Quotient) -> tuple[Fraction, object]:
    """The sign of the leading coefficient, and a key that `u` and -`u` share."""
    top, bottom = _settled(*u)
    sign = Fraction(1) if not top or top[max(top)] > 0 else Fraction(-1)
    return sign, _frozen((_scaled(top, sign), bottom))


def _frozen(u: Quotient) -> object:
    return frozenset(u[0].items()), frozenset(u[1].items())


def _multiples(u: Quotient) -> list[tuple[tuple[Monomial, int], int]] | None:
    """`u` as a short sum of small integer multiples of unit angles (monomial / divisor), or None."""
    top, bottom = u
    if bottom != _ONE or len(top) > _TERMS:
        return None
    if any(abs(c.numerator) > _MULTIPLE for c in top.values()):
        return None
    return [((monomial, c.denominator), c.numerator) for monomial, c in sorted(top.items())]
