"""A plan through knots in the code: its tables, what times near a knot are off, and the mean of u* over a sample."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from flint import arb

from tubecert.recheck.balls import Ball, between, larger, magnitude
from tubecert.recheck.code.reader import Code, function_of
from tubecert.recheck.code.run import Machine, Value, Vector, numbers
from tubecert.recheck.code.seen import KINDS, Kind, Rounded, Seen
from tubecert.recheck.code.tree import Binary, Function, Loop, Name, Number
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.curve import CLOCK, Curve, Part
from tubecert.recheck.program import Program
from tubecert.recheck.terms import slopes

# what a bound is derived for: every piece that a sample meets, with its share of the sample and u* in its middle
MEAN = """
static void mean_of_plan(real begin, real end, real mean[M])
{
    const real length = end - begin;
    int k = piece(begin), i, j;
    for (i = 0; i < M; i++) {
        mean[i] = 0.0%(suffix)s;
    }
    for (j = 0; j < %(passes)s; j++) {
        const real until = k + 1 < PIECES && START[k + 1] < end ? START[k + 1] : end;
        const real middle = 0.5%(suffix)s * (begin + until) - START[k];
        const real share = (until - begin) / length;
        for (i = 0; i < M; i++) {
            mean[i] = mean[i] + share * (U[k][i][0] + middle * U[k][i][1]);
        }
        begin = until;
        k = begin < end && k + 1 < PIECES ? k + 1 : k;
    }
}
"""

# the last piece that does not begin later: nothing but times of knots decides
SEARCH = """
static int piece(real t)
{
    int low = 0, high = %(count)s - 1, k;
    for (k = 0; k < %(halvings)s; k++) {
        const int middle = (low + high + 1) / 2;
        if (low < high) {
            if (t >= START[middle]) {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
    }
    return low;
}
"""


def searches(code: Code) -> bool:
    """Whether the piece of a time is found in the one way that is known."""
    count = len(code.tables.get("START", ()))
    halvings = max(1, (count - 1).bit_length())
    every = [function_of(SEARCH % {"count": own, "halvings": halvings}) for own in ("PIECES", count)]
    return code.functions.get("piece") in every and code.macros.get("PIECES") == Number(str(count))


def mean_of(own: Function, real: str) -> int:
    """How many pieces the mean of u* looks at; raises `UnreadError` for a function of another form."""
    for each in own.body:
        match each:
            case Loop("j", _, Binary("<", Name("j"), Number(passes)), _):
                wanted = MEAN % {"suffix": "f" if real == "float" else "", "passes": passes}
                if own == function_of(wanted):
                    return int(passes)
    raise UnreadError("the mean of a feedforward through knots is computed in another way")


def mean_rounded(u: Seen, passes: int, kind: Kind) -> Seen:
    """The mean of a `u` in the middles of pieces, of which the shares add to 1: theory (H.43).

    Once the error of u is what u* moves by as times are off, once what u in a middle is off by.
    """
    theta = (1 + kind.unit) ** (passes + 3) / (1 - kind.unit) - 1
    lost = theta * u.most + 2 * passes * kind.least * (u.most + 1)
    return Seen(u.value, 2 * u.error + lost)


def require_passes(passes: int, curve: Curve, sample_time: Ball, off: Ball) -> None:
    """Raises `UnreadError` unless no sample meets more pieces; times are `off` by so much at most."""
    sample = sample_time + 2 * off
    for part in curve.parts:
        shortest = part.length - 2 * off
        if not (shortest > 0 and sample / shortest < passes - 1 and 4 * off < sample_time):
            raise UnreadError("a sample may meet more pieces than the code looks at")


def any_of(rows: Sequence[Sequence[Seen]]) -> list[Seen]:
    """Entry by entry what any of these vectors may be."""
    found = []
    for own in zip(*rows, strict=True):
        value = own[0].value
        for each in own[1:]:
            value = value.union(each.value)
        error = own[0].error
        for each in own[1:]:
            error = larger(error, each.error)
        found.append(Seen(value, error))
    return found


def tables_of(code: Code, curve: Curve) -> dict[str, Vector]:
    """The numbers that those of a plan through knots stand for, with what these are off."""
    if "START" not in code.tables:
        return {}
    parts, plain = curve.parts, Machine(code, Rounded(KINDS[code.real], stands=False, rounds=False))
    own = {name: plain.within_tables(name) for name in code.tables}
    # which piece is found depends on nothing but the knots that are not later
    if not searches(code):
        raise UnreadError("the piece of a time is found in another way")
    if [plain.call("piece", begin) for begin in own["START"]] != list(range(len(own["START"]))):
        raise UnreadError("the pieces of the plan are not those of their times")
    if set(own) != {"START", "X", "U"} or any(len(table) != len(parts) for table in own.values()):
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
        for i, row in enumerate(rows_of(rows)):
            names = [f"{letter}{i}#{k}" for k in range(len(rows_of(row)) + 1)]
            if names.pop() in part.values or not part.values.keys() >= set(names):
                raise UnreadError("the pieces of the plan have other powers")
            own.append([_meant(c, part.values[name]) for c, name in zip(rows_of(row), names, strict=True)])
        found.append(own)
    return found


def rows_of(value: Value) -> Vector:
    """The entries of a table that has rows."""
    if not isinstance(value, list):
        raise UnreadError("a number stands where there has to be a row")
    return value
