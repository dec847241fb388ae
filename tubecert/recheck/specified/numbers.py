"""Numbers of a specification, exact, of the kind and size that their place asks for; its expressions as exact terms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.grammar import GrammarError, Owed, read
from tubecert.recheck.lookup import Table
from tubecert.recheck.terms import Matrix, Term, variable

Range = tuple[Fraction, Fraction]
Numbers = tuple[Fraction, ...]
Rows = tuple[Numbers, ...]


def positive(node: Node) -> Fraction:
    """A number above 0."""
    q = node.exact()
    if q <= 0:
        raise node.refused("is not positive")
    return q


def not_negative(node: Node) -> Fraction:
    """A number that is not below 0."""
    q = node.exact()
    if q < 0:
        raise node.refused("is negative")
    return q


def whole(node: Node) -> int:
    """A whole number that is not negative."""
    q = node.exact()
    if q.denominator != 1 or q < 0:
        raise node.refused("is no whole number")
    return int(q)


def several(node: Node, size: int) -> Numbers:
    """A list of a known size."""
    return tuple(item.exact() for item in node.sized(size))


def square(node: Node, size: int) -> Rows:
    """A square matrix."""
    return tuple(several(row, size) for row in node.sized(size))


def ends(node: Node) -> Range:
    """The ends of a range that is more than a point."""
    low, high = (end.exact() for end in node.pair())
    if low >= high:
        raise node.refused("is an empty range")
    return low, high


def ranges(node: Node) -> dict[str, Range]:
    """Names of somebody else's, each with two ends."""
    return {name: (low.exact(), high.exact()) for name, side in node.items() for low, high in [side.pair()]}


def span(node: Node) -> Range:
    """Ends that may be one point."""
    low, high = (end.exact() for end in node.pair())
    if low > high:
        raise node.refused("is an empty range")
    return low, high


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
