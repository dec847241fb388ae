"""Expressions of the specification as exact terms, with what must hold for them to be defined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from tubecert.expression import Expression, ExpressionError, parse, symbol
from tubecert.recheck.document import Node, wrong
from tubecert.recheck.terms import Matrix, Term, from_expressions, number_of

TIME = "t"


@dataclass(frozen=True, slots=True)
class Duty:
    """What must hold for an expression to be defined: `argument` is nonzero, or positive."""

    kind: str
    argument: Term
    text: str
    over: str  # "set", "time"


class Reader:
    """Expressions of the specification, and what they owe."""

    def __init__(self, states: Iterable[str]) -> None:
        self._states = {name: symbol(name) for name in states}
        self.duties: list[Duty] = []

    def term(
        self, node: Node, over: str, *, time: bool = False, states: bool = True, kinks: bool = False
    ) -> Term:
        """One expression; `over` is where it must be defined."""
        allowed: dict[str, Expression] = dict(self._states) if states else {}
        if time:
            allowed[TIME] = symbol(TIME)
        try:
            parsed = parse(node.text(), symbols=allowed, kinks=kinks)
        except ExpressionError as error:
            raise wrong("TC603", f"{node.path} is no expression of the specification: {error}") from None
        arguments = from_expressions([parsed.expression, *(duty.argument for duty in parsed.obligations)])
        for duty, argument in zip(parsed.obligations, arguments[1:], strict=True):
            self.duties.append(Duty(duty.kind, argument, duty.text, over))
        return arguments[0]

    def column(self, node: Node, rows: int, over: str, **options: bool) -> Matrix:
        """A list of expressions as a column."""
        return [[self.term(item, over, **options)] for item in sized(node, rows)]


def sized(node: Node, size: int) -> list[Node]:
    """The items of a list of a known size."""
    items = node.entries()
    if len(items) != size:
        raise wrong("TC603", f"{node.path} has {len(items)} entries, not {size}")
    return items


def rows_of(node: Node, p: int, q: int) -> list[list[Node]]:
    """The items of a matrix of known size."""
    return [sized(row, q) for row in sized(node, p)]


def constants(node: Node) -> list[Fraction] | None:
    """A list of expressions as exact numbers; None if one of them is no rational constant."""
    reader = Reader(())
    terms = [reader.term(item, "time", time=True) for item in node.entries()]
    return [number_of(e) for e in terms] if all(e.op == "const" for e in terms) else None
