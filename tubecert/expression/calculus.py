"""Expressions with other variables, and their derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tubecert.expression.graph import (
    FUNCTIONS,
    ONE,
    ZERO,
    Expression,
    add,
    cos,
    cosh,
    direction,
    div,
    mul,
    norm,
    power,
    sin,
    sinh,
    sqrt,
    table,
    topological,
)


def rebuild(e: Expression, args: tuple[Expression, ...]) -> Expression:
    """The operation of `e` applied to other arguments; `e` itself if they are its own."""
    if args == e.args:
        return e
    if e.op in FUNCTIONS:
        return FUNCTIONS[e.op](args[0])
    if e.op == "table":
        return table(e.lookup, args[0])
    if e.op == "add":
        return add(*args)
    if e.op == "mul":
        return mul(*args)
    if e.op == "div":
        return div(*args)
    if e.op == "pow":
        return power(args[0], int(str(e.value)))
    if e.op == "norm":
        return norm(args)
    return direction(args, int(str(e.value)))


def free_symbols(roots: Iterable[Expression]) -> frozenset[str]:
    """Names of the variables that occur."""
    return frozenset(str(node.value) for node in topological(roots) if node.op == "symbol")


def substitute(roots: Iterable[Expression], values: Mapping[str, Expression]) -> list[Expression]:
    """The expressions with variables replaced (simultaneously)."""
    roots = list(roots)
    new: dict[Expression, Expression] = {}
    for node in topological(roots):
        if node.op == "symbol":
            new[node] = values.get(str(node.value), node)
        else:
            new[node] = rebuild(node, tuple(new[arg] for arg in node.args))
    return [new[root] for root in roots]


def derivatives(roots: Iterable[Expression], name: str) -> list[Expression]:
    """d(root)/d(name) for every root; of a norm its generalised gradient (see `direction`), of a table see `Lookup`."""
    roots = list(roots)
    slope: dict[Expression, Expression] = {}
    for node in topological(roots):
        if node.op == "symbol":
            slope[node] = ONE if node.value == name else ZERO
        elif any(slope[arg] is not ZERO for arg in node.args):
            slope[node] = _slope(node, [slope[arg] for arg in node.args])
        else:
            slope[node] = ZERO
    return [slope[root] for root in roots]


def derivative(e: Expression, name: str) -> Expression:
    """de/d(name)."""
    return derivatives([e], name)[0]


def _slope(e: Expression, d: list[Expression]) -> Expression:
    """The chain rule at one node, given the derivatives `d` of its arguments."""
    u = e.args[0]
    match e.op:
        case "add":
            return d[0] + d[1]
        case "mul":
            return d[0] * e.args[1] + u * d[1]
        case "div":
            return d[0] / e.args[1] - e * d[1] / e.args[1]
        case "pow":
            n = int(str(e.value))
            return n * power(u, n - 1) * d[0]
        case "sqrt":
            return d[0] / (2 * e)
        case "sin":
            return cos(u) * d[0]
        case "cos":
            return -sin(u) * d[0]
        case "tan":
            return (1 + e**2) * d[0]
        case "asin":
            return d[0] / sqrt(1 - u**2)
        case "acos":
            return -d[0] / sqrt(1 - u**2)
        case "atan":
            return d[0] / (1 + u**2)
        case "sinh":
            return cosh(u) * d[0]
        case "cosh":
            return sinh(u) * d[0]
        case "tanh":
            return (1 - e**2) * d[0]
        case "exp":
            return e * d[0]
        case "log":
            return d[0] / u
        case "table":
            return table(e.lookup.derivative, u) * d[0]
        case "norm":
            terms = (direction(e.args, i) * slope for i, slope in enumerate(d))
            return sum(terms, start=ZERO)
    raise ValueError(f"{e.op} has no derivative")
