"""What folding dropped, put back into the text: an expression never loses what it owes.

0*sqrt(x - 5) is 0 in the graph, and yet x must stay above 5. The text of an expression with its obligations ends in
terms that vanish and owe what the rest does not: `0 + 0*sqrt(x - 5)`, `y + 0/x`. Such a text is in the grammar, so
whoever parses it (the checker does) meets the same obligations, and expressions that owe differently differ in text.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from tubecert.expression import graph
from tubecert.expression.graph import Expression, coefficient, topological
from tubecert.expression.parse import Duty, Obligation, within
from tubecert.expression.text import to_text

_Owed = tuple[Duty, Expression]


def full_text(e: Expression, obligations: Iterable[Obligation]) -> str:
    """Text that parses back to `e` and to obligations that hold exactly where these do."""
    shown = {item for node in topological([e]) for item in _of_node(node)}
    missing: dict[_Owed, None] = {}
    for owed in obligations:
        for item in _simplest(owed.kind, owed.argument):
            if item not in shown:
                missing[item] = None
    return " + ".join([to_text(e), *sorted(_term(*item) for item in missing)])


def _term(kind: Duty, argument: Expression) -> str:
    """A term that is 0 and owes this."""
    words = to_text(argument)
    if kind == "positive":
        return f"0*sqrt({words})"
    return f"0/{words}" if argument.op in _CLOSED else f"0/({words})"


_CLOSED = frozenset({"symbol", "sin", "cos", "tan", "norm"})  # texts that need no parentheses
_NEVER_ZERO = frozenset({"const", "pi", "exp", "cosh", "sqrt"})


def _of_node(node: Expression) -> Iterator[_Owed]:
    """What a reader of the node's text will note."""
    match node.op:
        case "div":
            yield from _simplest("nonzero", node.args[1])
        case "pow" if int(str(node.value)) < 0:
            yield from _simplest("nonzero", node.args[0])
        case "tan":
            yield from _simplest("nonzero", graph.cos(node.args[0]))
        case "sqrt" | "log":
            yield from _simplest("positive", node.args[0])
        case "table":
            for argument in within(node.lookup, node.args[0]):
                yield from _simplest("positive", argument)
        case "asin" | "acos":
            yield from _simplest("positive", 1 - node.args[0] ** 2)


def _simplest(kind: Duty, e: Expression) -> Iterator[_Owed]:
    """Obligations on smaller expressions that are equivalent, given what the parts of `e` themselves owe.

    x/(2*y) and 0.5*x/y owe the same: rational factors and powers do not matter, a product is nonzero if its factors
    are, a quotient if its numerator is (its divisor is owed by the quotient), pi, exp(u), cosh(u) and sqrt(u) always.
    """
    q, rest = coefficient(e)
    if kind == "positive":
        if q > 0 and rest.op == "pow" and int(str(rest.value)) % 2 == 1:
            yield from _simplest(kind, rest.args[0])
        else:
            yield kind, rest if q > 0 else -rest
    elif rest.op == "mul":
        for factor in rest.args:
            yield from _simplest(kind, factor)
    elif rest.op in ("pow", "div"):
        yield from _simplest(kind, rest.args[0])
    elif rest.op not in _NEVER_ZERO:
        yield kind, rest
