"""Addition theorems: sines, cosines and exponentials of sums and multiples, in those of common parts.

An argument is written as a sum of rational multiples of monomials, every monomial's multiples as whole multiples of a
part that they all share; then sin(a + b) = sin a cos b + cos a sin b, cos(a + b) = cos a cos b - sin a sin b and
exp(a + b) = exp(a) exp(b). Long sums and large multiples are left as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import gcd

from tubecert.recheck.monomials import Monomial, expanded
from tubecert.recheck.terms import NOUGHT, UNIT, Term, function, in_order, number, remade

_WAVES = ("sin", "cos", "tan")
_MULTIPLE = 24  # of a part
_SUMMANDS = 4
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
                self._share[monomial] = _common(self._share.get(monomial, Fraction(0)), q)

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


def _common(p: Fraction, q: Fraction) -> Fraction:
    """The largest number of which both are whole multiples."""
    return Fraction(
        gcd(p.numerator * q.denominator, q.numerator * p.denominator), p.denominator * q.denominator
    )
