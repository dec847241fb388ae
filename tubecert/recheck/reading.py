"""Expressions of the specification as exact terms, with what must hold for them to be defined."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from tubecert.recheck.document import Node
from tubecert.recheck.grammar import GrammarError, Owed, read
from tubecert.recheck.lookup import Table
from tubecert.recheck.terms import Matrix, Term, variable

TIME = "t"

Column = tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads expressions in some names; what they owe is added to `duties`."""

    names: tuple[str, ...]
    kinks: bool
    duties: list[Owed]
    tables: Mapping[str, Table]

    @classmethod
    def of(
        cls, names: Iterable[str], tables: Mapping[str, Table] | None = None, *, kinks: bool = False
    ) -> Reader:
        """A reader that knows these names, and these tables."""
        return cls(tuple(names), kinks, [], tables or {})

    def term(self, node: Node) -> Term:
        """One expression."""
        try:
            symbols = {name: variable(name) for name in self.names}
            term, owed = read(node.text(), symbols, tables=self.tables, kinks=self.kinks)
        except GrammarError as error:
            raise node.refused(f"is no expression that may stand there: {error}") from None
        self.duties.extend(owed)
        return term

    def column(self, node: Node, rows: int) -> Column:
        """A list of expressions."""
        return tuple(self.term(item) for item in node.sized(rows))

    def matrix(self, node: Node, rows: int, columns: int) -> Matrix:
        """A matrix of expressions."""
        return [[self.term(item) for item in row] for row in node.rows(rows, columns)]


def upright(column: Sequence[Term]) -> Matrix:
    """A column as a matrix."""
    return [[e] for e in column]
