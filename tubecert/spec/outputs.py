"""The outputs of a system: linear combinations of its states, by name."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from tubecert.expression import ZERO, derivatives, substitute
from tubecert.spec import codes
from tubecert.spec.names import Names, new_names
from tubecert.spec.reader import Field
from tubecert.spec.values import Output, Term


def with_outputs(names: Names, field: Field | None) -> Names:
    """The names with those of the outputs; one that cannot be read stands for the first state."""
    found: list[Output] = []
    example = f"{names.states[-1]} - 0.5*{names.states[0]}"
    purpose = "of names to linear combinations of states"
    for name, entry, written in new_names(field, purpose, "output", _taken(names), "tip: x + 0.5*y"):
        term = entry.term(names.of_state())
        output = None if term is None else _linear(written, term, names)
        if term is not None and output is None:
            message = f"{entry.path} is not a sum of states times rational numbers"
            help = f"an output is linear: write e.g. {example}, without a constant"
            entry.fail(codes.RANGE, message, help)
        if name is not None:
            first = tuple(Fraction(state == names.states[0]) for state in names.states)
            found.append(output or Output(name=name, row=first))
    return replace(names, outputs=tuple(found))


def _linear(name: str, term: Term, names: Names) -> Output | None:
    """The coefficients, where the term is a sum of states times rational numbers."""
    e = term.expression
    slopes = [derivatives([e], state)[0] for state in names.states]
    if term.obligations or not all(slope.is_constant for slope in slopes):
        return None
    if all(slope is ZERO for slope in slopes) or substitute([e], dict.fromkeys(names.states, ZERO)) != [ZERO]:
        return None
    return Output(name=name, row=tuple(slope.fraction for slope in slopes))


def _taken(names: Names) -> dict[str, str]:
    """What the names of a system stand for."""
    groups = {
        "state": names.states,
        "input": names.inputs,
        "parameter": (*names.values, *dict(names.ranges)),
        "table": dict(names.tables),
        "definition": dict(names.definitions),
    }
    return {name: what for what, group in groups.items() for name in group}
