"""A plan through knots in the code: the numbers that its tables stand for, and what times near a knot are off."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from flint import arb

from tubecert.recheck.balls import Ball, between, larger, magnitude
from tubecert.recheck.code.reader import Code
from tubecert.recheck.code.run import Machine, Value, Vector, numbers
from tubecert.recheck.code.seen import KINDS, Rounded, Seen
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.curve import CLOCK, Curve, Part
from tubecert.recheck.program import Program
from tubecert.recheck.terms import slopes


def tables_of(code: Code, curve: Curve) -> dict[str, Vector]:
    """The numbers that those of a plan through knots stand for, with what these are off."""
    if "START" not in code.tables:
        return {}
    parts, plain = curve.parts, Machine(code, Rounded(KINDS[code.real], stands=False, rounds=False))
    own = {name: plain.within_tables(name) for name in code.tables}
    # which piece is found depends on nothing but the knots that are not later
    if [plain.call("piece", begin) for begin in own["START"]] != list(range(len(own["START"]))):
        raise UnreadError("the pieces of the plan are not those of their times")
    if set(own) != {"START", "X", "U"} or any(len(table) < len(parts) for table in own.values()):
        raise UnreadError("the tables of the plan are of another one")
    begun = [_meant(v, part.start) for v, part in zip(own["START"], parts, strict=False)]
    return {
        "START": list[Value](begun),
        "X": _coefficients(own["X"], "x", parts),
        "U": _coefficients(own["U"], "u", parts),
    }


def steepest(curve: Curve, beside: Ball) -> list[Ball]:
    """|x*'| and |u*'| on all parts, and a little beyond their ends."""
    terms = slopes([*curve.x, *curve.u], CLOCK)
    found = [arb(0)] * len(terms)
    for part in curve.parts:
        own = Program(terms, (CLOCK, *part.values))
        values = own.run([between(-beside, part.length + beside), *part.values.values()])
        found = [larger(a, magnitude(b)) for a, b in zip(found, values, strict=True)]
    return found


def jumps(curve: Curve) -> list[Ball]:
    """How far x* and u* jump at a knot."""
    terms = [*curve.x, *curve.u]
    found = [arb(0)] * len(terms)
    for last, part in pairwise(curve.parts):
        ends = Program(terms, (CLOCK, *last.values)).run([last.length, *last.values.values()])
        begins = Program(terms, (CLOCK, *part.values)).run([arb(0), *part.values.values()])
        found = [larger(a, magnitude(p - q)) for a, p, q in zip(found, ends, begins, strict=True)]
    return found


def _meant(found: Value, own: Ball) -> Seen:
    (number,) = numbers([found])
    return Seen(own, magnitude(number.value - own))


def _coefficients(table: Vector, letter: str, parts: Sequence[Part]) -> Vector:
    """Those of every part, each with what its number in the table is off."""
    found: Vector = []
    for rows, part in zip(table, parts, strict=False):
        own: Vector = []
        for i, row in enumerate(_list(rows)):
            names = [f"{letter}{i}#{k}" for k in range(len(_list(row)) + 1)]
            if names.pop() in part.values or not part.values.keys() >= set(names):
                raise UnreadError("the pieces of the plan have other powers")
            own.append([_meant(c, part.values[name]) for c, name in zip(_list(row), names, strict=True)])
        found.append(own)
    return found


def _list(value: Value) -> Vector:
    if not isinstance(value, list):
        raise UnreadError("a number stands where there has to be a row")
    return value
