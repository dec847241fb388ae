"""Expressions of angles -> expressions of their sines and cosines, exactly.

sin and cos of integer combinations of variables become polynomials in (s, c) with s^2 + c^2 = 1; what remains
(exp, sqrt, sin of other arguments) is named as an atom of its own, or refused.
Untrusted: used to set problems up, never to decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

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


class NotLiftedError(Exception):
    """An operation that is no polynomial in variables, sines and cosines."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifted:
    """`expressions` in new symbols.

    `circles` maps a variable to the names of its sine and cosine, `atoms` the name of what else was replaced to it.
    """

    expressions: tuple[Expression, ...]
    circles: dict[str, tuple[str, str]]
    atoms: dict[str, Expression]


def sine_name(variable: str) -> str:
    """The symbol that stands for sin(variable); no name of a specification has a #."""
    return f"sin#{variable}"


def cosine_name(variable: str) -> str:
    """The symbol that stands for cos(variable)."""
    return f"cos#{variable}"


def lift(expressions: Sequence[Expression], *, opaque: bool = False) -> Lifted:
    """Sines and cosines replaced by symbols.

    Raises `NotLiftedError` at what is no polynomial in variables, sines and cosines over another one; with `opaque` it
    is replaced by a symbol instead.
    """
    circles: dict[str, tuple[str, str]] = {}
    atoms: dict[str, Expression] = {}
    names: dict[Expression, str] = {}
    new: dict[Expression, Expression] = {}
    for node in topological(expressions):
        pair = _angle(node.args[0], circles) if node.op in ("sin", "cos", "tan") else None
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
    return Lifted(expressions=tuple(new[e] for e in expressions), circles=circles, atoms=atoms)


def _angle(u: Expression, circles: dict[str, tuple[str, str]]) -> tuple[Expression, Expression] | None:
    """(sin u, cos u) by the addition theorems, if u is a sum of small integer multiples of variables."""
    terms = _multiples(u)
    if terms is None:
        return None
    s, c = ZERO, ONE
    for variable, count in sorted(terms.items()):
        names = circles.setdefault(variable, (sine_name(variable), cosine_name(variable)))
        one_s, one_c = symbol(names[0]), symbol(names[1])
        if count < 0:
            one_s = -one_s
        for _ in range(abs(count)):
            s, c = s * one_c + c * one_s, c * one_c - s * one_s
    return s, c


def _multiples(u: Expression) -> dict[str, int] | None:
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
    if any(q.denominator != 1 or abs(q) > _MOST for q in total.values()):
        return None
    return {name: int(q) for name, q in total.items() if q}


def at_point(expressions: Sequence[Expression], values: dict[str, Fraction]) -> list[Fraction]:
    """Exact values of lifted expressions at a rational point; raises `ZeroDivisionError` at a pole."""
    from tubecert.expression import substitute

    return [e.fraction for e in substitute(expressions, {v: constant(q) for v, q in values.items()})]
