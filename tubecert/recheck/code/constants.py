"""The numbers of exported C: those that the certificate names, and what a compiler made of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, larger
from tubecert.recheck.code.pieces import rows_of, tables_of
from tubecert.recheck.code.reader import Code, Table
from tubecert.recheck.code.run import numbers
from tubecert.recheck.code.seen import KINDS, Kind, Seen
from tubecert.recheck.code.shape import ball_of, box_of, law_of
from tubecert.recheck.code.tree import (
    Assign,
    Declare,
    Do,
    Expr,
    Loop,
    Number,
    Return,
    Statement,
    Test,
    parts,
)
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.controller import Machine
from tubecert.recheck.curve import Curve
from tubecert.recheck.family import Everyone
from tubecert.recheck.steering import Steering
from tubecert.recheck.terms import in_order, table_of

_OF_PLAN = ("START", "X", "U")
_NEAR, _ROUNDED = 8, 64  # units of rounding: of the times of knots, and of coefficients
_SLIGHT = 2.0**-34


def otherwise(code: Code, formulas: Machine) -> Iterator[str]:
    """Names of numbers that are not those of the certificate, to the bit."""
    recipe, case, big = formulas.recipe, formulas.case, code.name.upper()
    wanted = {"SAMPLE_TIME": recipe.sample_time, "DELAY": recipe.delay, "LEVEL": recipe.level}
    if f"{big}_HORIZON" in code.macros and case.curve.horizon is not None:
        wanted["HORIZON"] = case.curve.horizon
    for name, value in wanted.items():
        if not is_number(code, code.macros.get(f"{big}_{name}"), value):
            yield name
    every = recipe.feedback_time / recipe.sample_time
    if code.macros.get(f"{big}_EVERY", Number("1")) != Number(str(every)):
        yield "EVERY"
    yield from of_tables(code, formulas)
    yield from of_boxes(code, formulas)
    yield from of_plan(code, case.curve, exact(recipe.speed * recipe.sample_time))
    own, m = code.functions["estimator"], len(case.system.inputs)
    box = box_of(own, m)
    ends = [(Number(low), Number(high)) for low, high in box or ()]
    if box is None:
        if not is_number(code, Number(ball_of(own, m)), recipe.clip_radius):
            yield "the radius of the clip"
    elif len(ends) != len(formulas.section.clip) or not all(
        is_number(code, low, a) and is_number(code, high, b)
        for (low, high), (a, b) in zip(ends, formulas.section.clip, strict=True)
    ):
        yield "the clip"
    if recipe.losses is not None and not is_number(
        code, Number(law_of(code.functions["law"], m).gain), case.bound("feedback_gain")
    ):
        yield "the gain"


def of_tables(code: Code, formulas: Steering) -> Iterator[str]:
    """Names of functions given by tables of which a number in the code is another one, or is missing."""
    system, curve = formulas.case.system, formulas.case.curve
    roots = [*(row[0] for row in system.f), *(e for row in system.B for e in row), *curve.x, *curve.u]
    tables = {table_of(term) for term in in_order(roots) if term.op == "table"}
    for table in sorted(tables, key=lambda own: own.name):
        count = len(table.points) - 1
        begins = [x for x, _, _ in table.points[:count]]
        cubics = [q for i in range(count) for q in table.polynomial(i)]
        for kind, wanted in (("at", begins), ("cubic", cubics)):
            found = list(entries(code.tables.get(f"{kind}_{table.name}", ())))
            if len(found) != len(wanted) or not all(
                is_number(code, Number(text), value) for text, value in zip(found, wanted, strict=True)
            ):
                yield f"{kind}_{table.name}"


def of_plan(code: Code, curve: Curve, size: Ball) -> Iterator[str]:
    """Names of tables of a plan through knots of which a number is another one.

    Coefficients are rounded from ranges: what they are off counts over the length of their piece, beside their row;
    of a slope f + B u, in which large terms may cancel, beside a `size` of what the loop does.
    """
    if "START" not in code.tables:
        return
    try:
        own = tables_of(replace(code, tables={name: code.tables[name] for name in _OF_PLAN}), curve)
    except (UnreadError, KeyError):
        yield "the pieces of the plan"
        return
    kind = KINDS[code.real]
    if not all(each.error <= _NEAR * kind.unit * each.most + kind.least for each in numbers(own["START"])):
        yield "START"
    for name, slight in (("X", _SLIGHT * size), ("U", arb(0))):
        pairs = zip(rows_of(own[name]), curve.parts, strict=True)
        rows = ((numbers(row), part.length) for entries, part in pairs for row in rows_of(entries))
        if not all(_is_near(row, length, slight, kind) for row, length in rows):
            yield name


def _is_near(row: Sequence[Seen], length: Ball, slight: Ball, kind: Kind) -> bool:
    """Of a polynomial on [0, length]; what is `slight` is none of its numbers' fault."""
    most = arb(0)
    for k, each in enumerate(row):
        most = larger(most, each.most * length**k)
    return all(
        each.error * length**k <= _ROUNDED * kind.unit * most + slight + kind.least
        for k, each in enumerate(row)
    )


def of_boxes(code: Code, formulas: Steering) -> Iterator[str]:
    """Names of ends of the boxes of a family that are others in the code."""
    curve = formulas.case.curve
    if not isinstance(curve, Everyone):
        return
    for name, box in zip("XU", curve.boxes, strict=True):
        for words, k in (("LEAST", 0), ("MOST", 1)):
            found = list(entries(code.tables.get(f"{words}_{name}", ())))
            if len(found) != len(box) or not all(
                is_number(code, Number(text), ends[k]) for text, ends in zip(found, box, strict=True)
            ):
                yield f"{words}_{name}"


def is_number(code: Code, tree: Expr | None, value: Fraction) -> bool:
    """Whether a number of the code is the one of its kind that is nearest to another one."""
    if not isinstance(tree, Number):
        return False
    found, kind = KINDS[code.real].nearest(tree.text), KINDS[code.real]
    return bool(found == kind.nearest_to(value))


def literals(code: Code) -> tuple[str, ...]:
    """Every number of the type that stands in a function or a macro, once, as it is written."""
    found: dict[str, None] = {}
    trees = list(code.macros.values())
    for function in code.functions.values():
        trees += _trees(function.body)
    while trees:
        tree = trees.pop()
        if isinstance(tree, Number) and not tree.text.isdigit():
            found[tree.text] = None
        trees += parts(tree)
    return tuple(sorted(found))


def _trees(body: Sequence[Statement]) -> Iterator[Expr]:
    for own in body:
        match own:
            case Declare(_, _, sizes, value):
                yield from sizes
                yield from () if value is None else (value,)
            case Assign(target, value):
                yield from (target, value)
            case Loop(_, first, test, inner):
                yield from (first, test, *_trees(inner))
            case Test(test, yes, no):
                yield from (test, *_trees(yes), *_trees(no))
            case Return(value):
                yield from () if value is None else (value,)
            case Do(call):
                yield call


def entries(table: Table) -> Iterator[str]:
    """The numbers of a table, in the order in which they lie in memory."""
    if isinstance(table, str):
        yield table
    else:
        for own in table:
            yield from entries(own)


def miscompiled(
    code: Code, found: Mapping[str, float], tables: Mapping[str, Sequence[float]]
) -> Iterator[str]:
    """Numbers of which a compiler made others: literals, and entries of tables as they lie in the object."""
    kind = KINDS[code.real]
    for text in literals(code):
        if text not in found or exact(Fraction(found[text])) != kind.nearest(text):
            yield text
    for name, table in code.tables.items():
        wanted, own = list(entries(table)), tables.get(name, ())
        if len(wanted) != len(own) or not all(
            exact(Fraction(value)) == kind.nearest(text) for text, value in zip(wanted, own, strict=True)
        ):
            yield name
