"""Slopes of h: through its kinks, branch by branch. Trusted: yes."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

from tubecert.coordinates import Fields
from tubecert.enclosure.objective import Kinks, Lipschitz
from tubecert.expression import (
    ZERO,
    Expression,
    constant,
    derivatives,
    rebuild,
    substitute,
    symbol,
    topological,
)
from tubecert.expression import sqrt as sqrt_of
from tubecert.expression.matrix import Matrix, column, jacobian

_SIGNS = 4  # absolute values of which all branches are looked at


def substituted(rows: Matrix, values: dict[str, Expression]) -> Matrix:
    """A matrix with variables replaced."""
    width = len(rows[0])
    flat = substitute([e for row in rows for e in row], values)
    return tuple(tuple(flat[i : i + width]) for i in range(0, len(flat), width))


def lipschitz_constant(h: tuple[Expression, ...], fields: Fields) -> Lipschitz:
    """The objective |h_x|, with every norm in h taken apart into a level of its own."""
    states = fields.states
    plain: dict[Expression, Expression] = {}  # each node with placeholders for the norms below it
    back: dict[str, Expression] = {}  # placeholder -> the norm it stands for
    arguments: list[tuple[Expression, ...]] = []
    for node in topological(h):
        args = tuple(plain[arg] for arg in node.args)
        plain[node] = node if args == node.args else rebuild(node, args)
        if plain[node].op == "norm":
            name = f"norm#{len(back)}"
            back[name] = node
            arguments.append(args)
            plain[node] = symbol(name)
    names = list(back)
    levels = []
    for depth, entries in enumerate([*arguments, tuple(plain[e] for e in h)]):
        gains = [substituted(column(derivatives(entries, name)), back) for name in names[:depth]]
        levels.append((fields.by_state(substituted(jacobian(entries, states), back)), gains))
    return Lipschitz(fields.by_state(jacobian(h, states)), levels, _kinks(h, fields))


def _kinks(h: tuple[Expression, ...], fields: Fields) -> Kinks | None:
    """The branches of an h with a few absolute values; None where it has none, or many."""
    signs: dict[str, Expression] = {}
    plain: dict[Expression, Expression] = {}
    for node in topological(h):
        args = tuple(plain[arg] for arg in node.args)
        if node.op == "norm" and len(args) == 1:
            name = f"sign#{len(signs)}"
            signs[name] = node.args[0]
            plain[node] = symbol(name) * args[0]
        elif node.op == "norm":  # as a root it may be differentiated more than once where it is not 0
            plain[node] = sqrt_of(sum((arg * arg for arg in args), start=ZERO))
        else:
            plain[node] = node if args == node.args else rebuild(node, args)
    if not 0 < len(signs) <= _SIGNS:
        return None
    slopes = fields.by_state(jacobian(tuple(plain[e] for e in h), fields.states))
    every = {chosen: _branch(slopes, signs, chosen) for chosen in product((1, -1), repeat=len(signs))}
    return Kinks(arguments=column(list(signs.values())), branches=every)


def _branch(slopes: Matrix, signs: Iterable[str], chosen: tuple[int, ...]) -> Matrix | None:
    """The slopes with signs chosen; None where a divisor is 0 then, as x + abs(x) is for x < 0."""
    try:
        return substituted(slopes, dict(zip(signs, map(constant, chosen), strict=True)))
    except ZeroDivisionError:
        return None
