"""Terms that vanish identically: quotients of polynomials over the rationals, exact.

Variables, roots and transcendental terms are indeterminates; the relations used are the addition theorems,
sin^2 = 1 - cos^2, sqrt(u)^2 = u, the hyperbolic functions in terms of exp, and the values at 0 (of sqrt: at squares of
rationals). A term whose numerator reduces to 0 vanishes wherever it is defined; nothing is concluded from one that does
not.

Addition theorems: sines, cosines and exponentials of sums and multiples, in those of common parts.

An argument is written as a sum of rational multiples of monomials, every monomial's multiples as whole multiples of a
part that they all share; then sin(a + b) = sin a cos b + cos a sin b, cos(a + b) = cos a cos b - sin a sin b and
exp(a + b) = exp(a) exp(b). Long sums and large multiples are left as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, isqrt
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

from tubecert.recheck.monomials import Monomial, Polynomial, expanded, exponent_of
from tubecert.recheck.terms import NOUGHT, UNIT, Term, function, in_order, number, operation, remade

_WAVES = ("sin", "cos", "tan")
_MULTIPLE = 24  # of a part
_SUMMANDS = 4
_MOST = 2_000_000  # products of terms for one question
Sum = Mapping[Monomial, Fraction]


def by_addition(terms: Sequence[Term]) -> list[Term]:
    """Terms of the same values, with as few different arguments of sin, cos and exp as these theorems give."""
    order = in_order(terms)
    arguments = list(dict.fromkeys(term.args[0] for term in order if term.op in (*_WAVES, "exp")))
    found = expanded(arguments)
    if found is None:
        return list(terms)
    factors, polynomials = found
    written = [{monomial: Fraction(*q) for monomial, q in p.items()} for p in polynomials]
    parts = _Parts(factors, written)
    sums = dict(zip(arguments, written, strict=True))
    new: dict[Term, Term] = {}
    for term in order:
        own = sums.get(term.args[0]) if term.op in (*_WAVES, "exp") else None
        new[term] = remade(term, tuple(new[arg] for arg in term.args)) if term.args else term
        if own is not None and parts.reach(own):
            new[term] = parts.exponential(own) if term.op == "exp" else _wave(term.op, *parts.circle(own))
    return [new[term] for term in terms]


def _wave(op: str, cosine: Term, sine: Term) -> Term:
    if op == "tan":
        return sine / cosine
    return sine if op == "sin" else cosine


class _Parts:
    """For every monomial the largest number of which all its multiples are whole multiples."""

    def __init__(self, factors: Sequence[Term], sums: Sequence[Sum]) -> None:
        self._factors = factors
        self._share: dict[Monomial, Fraction] = {}
        for own in sums:
            for monomial, q in own.items():
                self._share[monomial] = common_part(self._share.get(monomial, Fraction(0)), q)

    def reach(self, own: Sum) -> bool:
        """Whether the theorems are used for an argument."""
        return len(own) <= _SUMMANDS and all(abs(self._count(*item)) <= _MULTIPLE for item in own.items())

    def circle(self, own: Sum) -> tuple[Term, Term]:
        """(cos, sin) of a sum."""
        total = UNIT, NOUGHT
        for monomial, q in own.items():
            total = _turned(total, self._multiple(monomial, q))
        return total

    def exponential(self, own: Sum) -> Term:
        """exp of a sum."""
        total = UNIT
        for monomial, q in own.items():
            total = total * function("exp", self._part(monomial)).raised(self._count(monomial, q))
        return total

    def _multiple(self, monomial: Monomial, q: Fraction) -> tuple[Term, Term]:
        """(cos, sin) of q times a monomial."""
        if self._is_pi(monomial) and (2 * q).denominator == 1:  # quarter turns
            c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[int(2 * q) % 4]
            return number(c), number(s)
        count, part = self._count(monomial, q), self._part(monomial)
        sine = function("sin", part)
        once = function("cos", part), sine if count > 0 else -sine
        total = UNIT, NOUGHT
        for _ in range(abs(count)):
            total = _turned(total, once)
        return total

    def _count(self, monomial: Monomial, q: Fraction) -> int:
        return int(q / self._share[monomial])

    def _part(self, monomial: Monomial) -> Term:
        part = number(self._share[monomial])
        for k, n in monomial:
            part = part * self._factors[k].raised(n)
        return part

    def _is_pi(self, monomial: Monomial) -> bool:
        return [(self._factors[k].op, n) for k, n in monomial] == [("pi", 1)]


def _turned(a: tuple[Term, Term], b: tuple[Term, Term]) -> tuple[Term, Term]:
    """(cos, sin) of the sum of two angles."""
    return a[0] * b[0] - a[1] * b[1], a[1] * b[0] + a[0] * b[1]


def common_part(p: Fraction, q: Fraction) -> Fraction:
    """The largest number of which both are whole multiples."""
    top = gcd(p.numerator * q.denominator, q.numerator * p.denominator)
    return Fraction(top, p.denominator * q.denominator)


_INDETERMINATES = frozenset(
    {"symbol", "pi", "asin", "acos", "atan", "exp", "log", "sqrt", "table", "norm", "direction"}
)


@dataclass(frozen=True, slots=True)
class _Quotient:
    top: Polynomial
    bottom: Polynomial


def vanish(terms: Sequence[Term]) -> bool:
    """Whether every term is proven to be zero wherever all of them are defined (a root may be told by another term)."""
    terms = by_addition(_exponentials(terms))
    order = in_order(terms)
    waves = [term for term in order if term.op in ("sin", "cos", "tan")]
    others = [term for term in order if term.op in _INDETERMINATES]
    labels = [f"v{k}" for k in range(2 * len(waves) + len(others))] or ["v0"]
    ring = fmpq_mpoly_ctx.get(labels, Ordering.lex)
    field = _Field(ring, ring.gens())
    value: dict[Term, _Quotient] = {}
    try:
        for term in order:
            value[term] = field.of(term, [value[arg] for arg in term.args])
    except OverflowError:
        return False
    return all(value[term].top == 0 for term in terms)


def _exponentials(terms: Sequence[Term]) -> list[Term]:
    """sinh u = (e - 1/e)/2, cosh u = (e + 1/e)/2 and tanh u = sinh u/cosh u, with e = exp(u)."""
    new: dict[Term, Term] = {}
    for term in in_order(terms):
        args = tuple(new[arg] for arg in term.args)
        if term.op in ("sinh", "cosh", "tanh"):
            e = operation("exp", *args)
            odd, even = e - UNIT / e, e + UNIT / e
            new[term] = odd / even if term.op == "tanh" else (odd if term.op == "sinh" else even) / number(2)
        else:
            new[term] = remade(term, args) if args else term
    return [new[term] for term in terms]


class _Field:
    """Quotients over a ring in which what is found later comes first: a relation leads with its square.

    Raises `OverflowError` after `_MOST` products of terms: then nothing is known.
    """

    def __init__(self, ring: Any, generators: Sequence[Polynomial]) -> None:
        self._left = _MOST
        self._one, self._zero = ring.constant(1), ring.constant(0)
        self._free = list(generators)
        self._atoms: dict[tuple[object, ...], _Quotient] = {}
        self._waves: dict[tuple[str, str], tuple[Polynomial, Polynomial]] = {}
        self._relations: list[Polynomial] = []
        self._roots: list[_Quotient] = []

    def of(self, term: Term, args: list[_Quotient]) -> _Quotient:
        """A term, given its arguments."""
        match term.op:
            case "const":
                q = term.value
                return self._whole(self._one * fmpq(q.numerator, q.denominator))  # type: ignore[union-attr]
            case "add":
                a, b = args
                top = self._times(a.top, b.bottom) + self._times(b.top, a.bottom)
                return self._reduced(top, self._times(a.bottom, b.bottom))
            case "mul":
                return self._product(*args)
            case "div":
                return self._product(args[0], _Quotient(args[1].bottom, args[1].top))
            case "pow":
                return self._power(args[0], exponent_of(term))
            case "sin" | "cos" | "tan":
                sine, cosine = self._wave(args[0])
                if term.op == "tan":
                    return _Quotient(sine, cosine)
                return self._whole(sine if term.op == "sin" else cosine)
            case "exp" if args[0].top == 0:
                return self._whole(self._one)
            case "sqrt" if (known := _root(args[0])) is not None:
                return self._whole(self._one * known)
            case "sqrt" if (same := self._same_root(args[0])) is not None:
                return same
        key = (term.op, str(term.value), *((str(a.top), str(a.bottom)) for a in args))
        if key not in self._atoms:
            atom = self._free.pop()
            self._atoms[key] = self._whole(atom)
            if term.op == "sqrt" and (bottom := args[0].bottom) != 0:  # the atom is bottom sqrt(top/bottom)
                square = self._reduced(self._times(args[0].top, bottom), self._one).top
                self._relations.append(atom * atom - square)
                self._atoms[key] = _Quotient(atom, bottom)
                self._roots.append(self._atoms[key])
        return self._atoms[key]

    def _same_root(self, argument: _Quotient) -> _Quotient | None:
        """The root that is known already whose square is the argument: both are at least 0."""
        for root in self._roots if argument.bottom != 0 else ():
            ratio = self._product(self._product(root, root), _Quotient(argument.bottom, argument.top))
            if self._reduced(ratio.top - ratio.bottom, self._one).top == 0:
                return root
        return None

    def _wave(self, argument: _Quotient) -> tuple[Polynomial, Polynomial]:
        """The sine and the cosine of an argument; both are the same for every term with that argument."""
        if argument.top == 0:
            return self._zero, self._one
        key = str(argument.top), str(argument.bottom)
        if key not in self._waves:
            cosine, sine = self._free.pop(), self._free.pop()  # sine before cosine in the order of the ring
            self._waves[key] = sine, cosine
            self._relations.append(sine * sine + cosine * cosine - self._one)
        return self._waves[key]

    def _power(self, base: _Quotient, exponent: int) -> _Quotient:
        if exponent < 0:
            base, exponent = _Quotient(base.bottom, base.top), -exponent
        result = self._whole(self._one)
        for _ in range(exponent):
            result = self._product(result, base)
        return result

    def _product(self, a: _Quotient, b: _Quotient) -> _Quotient:
        return self._reduced(self._times(a.top, b.top), self._times(a.bottom, b.bottom))

    def _times(self, a: Polynomial, b: Polynomial) -> Polynomial:
        self._spend(len(a) * len(b))
        return a * b

    def _spend(self, products: int) -> None:
        self._left -= products
        if self._left < 0:
            raise OverflowError("there are too many products")

    def _whole(self, p: Polynomial) -> _Quotient:
        return _Quotient(p, self._one)

    def _reduced(self, top: Polynomial, bottom: Polynomial) -> _Quotient:
        for relation in reversed(self._relations):
            self._spend((len(top) + len(bottom)) * len(relation))
            top, bottom = divmod(top, relation)[1], divmod(bottom, relation)[1]
        return _Quotient(top, bottom)


def _root(argument: _Quotient) -> fmpq | None:
    """The square root of a constant that is the square of a rational."""
    if argument.bottom == 0 or not (argument.top.is_constant() and argument.bottom.is_constant()):
        return None
    value = fmpq(0) if argument.top == 0 else argument.top.coefficient(0) / argument.bottom.coefficient(0)
    if value < 0:
        return None
    top, bottom = isqrt(int(value.p)), isqrt(int(value.q))
    root = fmpq(top, bottom)
    return root if root * root == value else None
