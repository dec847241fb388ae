"""Functions of tables in a code: of one form, and how far what they give is off. Implements: theory 8.11 (H.45)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

from flint import arb

from tubecert.recheck.balls import Ball, between, exact, larger, magnitude
from tubecert.recheck.code.reader import Code, function_of
from tubecert.recheck.code.rows import greatest
from tubecert.recheck.code.run import Machine, Own, Value, numbers
from tubecert.recheck.code.seen import Rounded, Seen, known
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.lookup import Table, over
from tubecert.recheck.terms import Term, in_order, table_of

# what a bound is derived for: the last piece that does not begin later, and Horner's rule
FORM = """
static real table_%(name)s(real x)
{
    int low = 0, high = %(last)s, k;
    real s;
    for (k = 0; k < %(halvings)s; k++) {
        const int middle = (low + high + 1) / 2;
        if (low < high) {
            if (x >= at_%(name)s[middle]) {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
    }
    s = x - at_%(name)s[low];
    return cubic_%(name)s[low][0] + s * (cubic_%(name)s[low][1] + s * (cubic_%(name)s[low][2] + s * cubic_%(name)s[low][3]));
}
"""  # noqa: E501 - a line of C


def form_of(name: str, count: int) -> str:
    """The function of a table of so many pieces."""
    return FORM % {"name": name, "last": count - 1, "halvings": max(1, (count - 1).bit_length())}


def tables_in(roots: Sequence[Term]) -> tuple[Table, ...]:
    """The tables that terms read."""
    return tuple({table_of(term) for term in in_order(roots) if term.op == "table"})


def looked_up(code: Code, tables: Sequence[Table], a: Rounded) -> dict[str, Own]:
    """Their functions in arithmetic `a`; raises `UnreadError` for functions of another form."""
    return {f"table_{own.name}": _function(code, own, a) for own in tables}


def _function(code: Code, table: Table, a: Rounded) -> Own:
    count, name = len(table.points) - 1, table.name
    wanted = function_of(form_of(name, count))
    if code.functions.get(wanted.name) != wanted:
        raise UnreadError(f"the function of the table {name} is of another form")
    plain = Machine(code, a)
    begins = numbers(plain.within_tables(f"at_{name}"))
    cubics = [numbers(row) for row in plain.within_tables(f"cubic_{name}")]
    knots = [x for x, _, _ in table.points]
    if len(begins) != count or len(cubics) != count or any(len(own) != 4 for own in cubics):
        raise UnreadError(f"the table {name} has other pieces")
    near = 2 * greatest([own.error for own in begins])
    if not all(4 * near < exact(q - p) for p, q in pairwise(knots)):
        raise UnreadError(f"the knots of the table {name} have no digit that is right")
    seam = _seam(table, near)

    def function(*given: Value) -> Value:
        (x,) = numbers(list(given))
        wide = x.value + between(-x.error, x.error)
        slope = magnitude(over(table.slope, wide))
        value = over(table, x.value)
        if not (wide.is_finite() and slope.is_finite() and value.is_finite()):
            return Seen(value, arb("inf"))
        worst = exact(0)
        for i in range(count):
            begin = wide.lower() if i == 0 else wide.lower().max(exact(knots[i]) - near)
            end = wide.upper() if i == count - 1 else wide.upper().min(exact(knots[i + 1]) + near)
            if begin <= end:
                worst = larger(worst, _cubic(a, known(between(begin, end)), begins[i], cubics[i]).error)
        return Seen(value, (slope * x.error + worst + seam).upper())

    return function


def _cubic(a: Rounded, x: Seen, begin: Seen, c: Sequence[Seen]) -> Seen:
    """As the text has it."""
    s = a.both("-", x, begin)
    found = c[3]
    for own in (c[2], c[1], c[0]):
        found = a.both("+", own, a.both("*", s, found))
    return found


def _seam(table: Table, near: Ball) -> Ball:
    """Cubics that meet in value and slope, so little beyond their knot."""
    pieces = [table.polynomial(i) for i in range(len(table.points) - 1)]
    widths = [q[0] - p[0] for p, q in pairwise(table.points)]
    worst = exact(0)
    for p, q, w in zip(pieces, pieces[1:], widths, strict=False):
        own = exact(abs(p[2]) + 3 * abs(p[3]) * w + abs(q[2])) * near**2
        worst = larger(worst, own + exact(Fraction(abs(p[3]) + abs(q[3]))) * near**3)
    return worst
