"""Expressions of angles -> expressions of their sines and cosines, exactly.

sin and cos of combinations of variables become polynomials in (s, c) with s^2 + c^2 = 1: of each variable the sine and
cosine of its unit angle, the largest one that all of its angles are multiples of. So an angle in degrees is as good as
one in radians. What remains (exp, sqrt, sin of other arguments) is named as an atom of its own, or refused.
Untrusted: used to set problems up, never to decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from math import gcd

from tubecert.expression import (
    ONE,
    ZERO,
    Expression,
    coefficient,
    constant,
    rebuild,
    symbol,
    topological,
)

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


def sine_name(variable: str) -> str:
    """The symbol that stands for the sine of a variable's angle; no name of a specification has a #."""
    return f"sin#{variable}"


def cosine_name(variable: str) -> str:
    """The symbol that stands for the cosine of a variable's angle."""
    return f"cos#{variable}"


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
            new[node] = node if args == node.args else rebuild(node, args)
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
        names = circles.setdefault(variable, (sine_name(variable), cosine_name(variable)))
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
