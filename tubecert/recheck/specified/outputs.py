"""The outputs of a system: linear combinations of the states, each by its row of rational numbers."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.reading import Reader
from tubecert.recheck.specified.numbers import Numbers
from tubecert.recheck.terms import Term, number, number_of, replaced, slopes


def read_outputs(node: Node, states: Sequence[str]) -> dict[str, Numbers]:
    """Every output, by name; one that is not linear and homogeneous is refused."""
    found = {}
    for name, value in node.items():
        reader = Reader.of(states)
        term = reader.term(value)
        row = [slopes([term], state)[0] for state in states]
        bent = any(e.op != "const" for e in row) or bool(reader.duties)
        if bent or not _is(replaced([term], dict.fromkeys(states, number(0)))[0], 0):
            raise value.refused("is not a sum of states times rational numbers")
        found[name] = tuple(map(number_of, row))
        if not any(found[name]):
            raise value.refused("is nothing")
    return found


def unit_rows(states: Sequence[str]) -> dict[str, Numbers]:
    """The states as outputs."""
    return {name: tuple(Fraction(name == other) for other in states) for name in states}


def _is(term: Term, value: int) -> bool:
    return term.op == "const" and number_of(term) == value
