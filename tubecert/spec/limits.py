"""Limits of the inputs: what an actuator can do, [low, high] for some of them."""

from __future__ import annotations

from fractions import Fraction

from tubecert.spec import codes
from tubecert.spec.names import Names
from tubecert.spec.reader import Field

Limits = tuple[tuple[str, tuple[Fraction, Fraction]], ...]


def read_limits(field: Field | None, names: Names) -> Limits | None:
    """Limits by input, in the order of the inputs; empty if there are none, None if they are unsound."""
    if field is None:
        return ()
    entries = field.mapping(optional=names.inputs)
    if entries is None:
        return None
    if not field.pairs():
        field.fail(codes.RANGE, f"{field.path} is empty", f"write {{{names.inputs[0]}: [-1, 1]}} or the like")
        return None
    found = [(name, _range(entries[name], names)) for name in names.inputs if name in entries]
    kept = tuple((name, ends) for name, ends in found if ends is not None)
    return kept if len(kept) == len(found) else None


def _range(field: Field, names: Names) -> tuple[Fraction, Fraction] | None:
    """Two ends; with pi in them, the range is rounded inward: what stays in it stays in the one that was written."""
    ends = field.items(2, "numbers")
    if ends is None:
        return None
    low, high = ends[0].number(names.values, side="above"), ends[1].number(names.values, side="below")
    if low is None or high is None:
        return None
    if low >= high:
        field.fail(
            codes.RANGE, f"{field.path}: the lower limit must be below the upper one", "write [lower, upper]"
        )
        return None
    return low, high
