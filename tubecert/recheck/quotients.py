"""Terms with divisors as one polynomial over powers of them: what a quotient of quotients is once it is cancelled.

An entry of B of an arm is a quotient, one of its metric a sum of products of quotients; evaluated as they stand, every
quotient varies on a box by itself. Written as P/(d^k e^l) with exact coefficients and sin^2 = 1 - cos^2 they have the
same values wherever they are defined (that divisors are not zero is a claim of its own), and vary on a box as they do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import fmpq
from flint.utils.flint_exceptions import DomainError

from tubecert.recheck.monomials import Polynomial, exponent_of, ring_of
from tubecert.recheck.terms import NOUGHT, UNIT, Term, in_order, number, number_of

_LARGE = 400  # terms of a polynomial
_PRODUCT = 4_000  # products of terms in one of polynomials
_DIVISORS = 4
_POWER = 24  # of a divisor
_LONGER = 4


class _TooLongError(Exception):
    """The terms are left as they are."""


@dataclass(frozen=True, slots=True)
class _Quotient:
    """`top` over the product of the divisors, each to its power."""

    top: Polynomial
    powers: Mapping[int, int]


def cancelled(entries: Sequence[Term]) -> list[Term]:
    """Terms of the same values wherever the given ones are defined; the given ones where these are much longer.

    Sums of products that are written out are longer than what they come from, and their derivatives are shorter.
    """
    order = in_order(entries)
    if not any(_divides(term) for term in order):
        return list(entries)
    try:
        found = _Cancelling(order).terms(entries)
    except _TooLongError:
        return list(entries)
    return found if len(in_order(found)) < _LONGER * len(order) else list(entries)


def _divides(term: Term) -> bool:
    return term.op == "div" or (term.op == "pow" and exponent_of(term) < 0)


class _Cancelling:
    """Quotients over one ring; sines come before all else in its order."""

    def __init__(self, order: Sequence[Term]) -> None:
        atoms = sorted(
            (term for term in order if term.op not in ("const", "add", "mul", "div", "pow")),
            key=lambda term: term.op != "sin",
        )
        ring, generators, self._relations = ring_of(atoms)
        self._one, self._atoms = ring.constant(1), atoms
        self._divisors: list[Polynomial] = []
        self._value: dict[Term, _Quotient] = {}
        for term in order:
            own = [self._value[arg] for arg in term.args]
            self._value[term] = self._of(term, own, generators.get(term))

    def terms(self, entries: Sequence[Term]) -> list[Term]:
        """The entries, written anew."""
        below = [UNIT / self._written(d) for d in self._divisors]
        found = []
        for entry in entries:
            value = self._value[entry]
            term = self._written(value.top)
            for k, n in sorted(value.powers.items()):
                term = term * below[k].raised(n)
            found.append(term)
        return found

    def _of(self, term: Term, args: list[_Quotient], atom: Polynomial) -> _Quotient:
        match term.op:
            case "const":
                q = number_of(term)
                return _Quotient(self._one * fmpq(q.numerator, q.denominator), {})
            case "add":
                return self._sum(*args)
            case "mul":
                return self._product(*args)
            case "div":
                return self._product(args[0], self._inverse(args[1]))
            case "pow":
                return self._power(args[0], exponent_of(term))
        return _Quotient(atom, {})

    def _sum(self, a: _Quotient, b: _Quotient) -> _Quotient:
        powers = {k: max(a.powers.get(k, 0), b.powers.get(k, 0)) for k in {*a.powers, *b.powers}}
        top = self._raised(a, powers) + self._raised(b, powers)
        return self._least(top, powers)

    def _raised(self, a: _Quotient, powers: Mapping[int, int]) -> Polynomial:
        """The numerator over these powers."""
        top = a.top
        for k, n in powers.items():
            for _ in range(n - a.powers.get(k, 0)):
                top = self._times(top, self._divisors[k])
        return top

    def _product(self, a: _Quotient, b: _Quotient) -> _Quotient:
        powers = {k: a.powers.get(k, 0) + b.powers.get(k, 0) for k in {*a.powers, *b.powers}}
        return self._least(self._times(a.top, b.top), powers)

    def _power(self, base: _Quotient, exponent: int) -> _Quotient:
        if exponent < 0:
            base, exponent = self._inverse(base), -exponent
        found = _Quotient(self._one, {})
        for _ in range(exponent):
            found = self._product(found, base)
        return found

    def _inverse(self, a: _Quotient) -> _Quotient:
        """One over it: its numerator becomes a divisor, up to a number."""
        if a.top == 0:
            raise _TooLongError
        top = self._raised(_Quotient(self._one, {}), a.powers)
        leading = a.top.leading_coefficient()
        if a.top.is_constant():
            return _Quotient(top / leading, {})
        base = a.top / leading
        for k, divisor in enumerate(self._divisors):
            rest, n = _divided(base, divisor, _POWER)
            if n and rest.is_constant():
                return _Quotient(top / leading / rest.leading_coefficient(), {k: n})
        if len(self._divisors) >= _DIVISORS:
            raise _TooLongError
        self._divisors.append(base)
        return _Quotient(top / leading, {len(self._divisors) - 1: 1})

    def _least(self, top: Polynomial, powers: Mapping[int, int]) -> _Quotient:
        """Without the divisors that divide the numerator."""
        left = {}
        for k, n in powers.items():
            top, divided = _divided(top, self._divisors[k], n)
            if n - divided > _POWER:
                raise _TooLongError
            if n > divided:
                left[k] = n - divided
        return _Quotient(top, left)

    def _times(self, a: Polynomial, b: Polynomial) -> Polynomial:
        if len(a) * len(b) > _PRODUCT:
            raise _TooLongError
        found = a * b
        for relation in self._relations:
            found = divmod(found, relation)[1]  # twice as many terms at most, as a sine's square is replaced
            if len(found) > _PRODUCT:
                raise _TooLongError
        if len(found) > _LARGE:
            raise _TooLongError
        return found

    def _written(self, p: Polynomial) -> Term:
        """A polynomial as a sum of products."""
        total = NOUGHT
        for exponents, q in p.to_dict().items():
            term = number(Fraction(int(q.p), int(q.q)))
            product = UNIT
            for atom, n in zip(self._atoms, exponents, strict=False):
                product = product * atom.raised(int(n))
            total = total + term * product
        return total


def _divided(p: Polynomial, divisor: Polynomial, most: int) -> tuple[Polynomial, int]:
    """A polynomial without a divisor, and how often it was divided by it."""
    count = 0
    while count < most and p != 0:
        try:
            p, count = p / divisor, count + 1  # stops at once where `divmod` can take hours
        except DomainError:
            break
    return p, count
