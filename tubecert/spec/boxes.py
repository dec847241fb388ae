"""Boxes and units by name: a side for every state, a unit where one is given."""

from __future__ import annotations

from fractions import Fraction

from tubecert.expression import (
    MAX_NAME_LENGTH,
    suggestion,
)
from tubecert.spec import codes
from tubecert.spec.instead import glued
from tubecert.spec.names import Names, key_field
from tubecert.spec.reader import Field


def read_units(field: Field | None, names: Names) -> tuple[tuple[str, str], ...]:
    """Units of states, inputs and outputs, as printed."""
    units: list[tuple[str, str]] = []
    if field is None:
        return ()
    for key, node in field.pairs("of names to units") or []:
        unit = field.child(key, node).text("a unit")
        known = [*names.lengths, *names.inputs]
        if key.text not in known:
            message = f"{key.text[:60]} is neither a state nor an input"
            help = glued(key.text, known) or suggestion(key.text, known)
            key_field(field, key).fail(codes.UNKNOWN_KEY, message, help)
        elif unit is not None and (not unit.isprintable() or not 0 < len(unit) <= MAX_NAME_LENGTH):
            field.child(key, node).fail(
                codes.RANGE, f"a unit has 1 to {MAX_NAME_LENGTH} printable characters"
            )
        elif unit is not None:
            units.append((key.text, unit))
    return tuple(units)


def read_box(field: Field, names: Names) -> tuple[tuple[Fraction, Fraction], ...] | None:
    """The safe set, in the order of the states."""
    entries = field.mapping(required=names.states)
    if entries is None:
        return None
    sides = [_side(entries.get(name), names) for name in names.states]
    kept = tuple(side for side in sides if side)
    return kept if len(kept) == len(names.states) else None


def _side(field: Field | None, names: Names) -> tuple[Fraction, Fraction] | None:
    ends = field.items(2, "numbers") if field else None
    if field is None or ends is None:
        return None
    lower = ends[0].number(
        names.values, side="above"
    )  # inward: the set that is asked for contains the one that counts
    upper = ends[1].number(names.values, side="below")
    if lower is None or upper is None:
        return None
    if lower >= upper:
        field.fail(
            codes.RANGE, f"{field.path}: the lower end must be below the upper end", "write [lower, upper]"
        )
        return None
    return lower, upper
