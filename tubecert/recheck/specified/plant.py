"""The system on its safe set with its outputs, the uncertainty h, and the metric."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from tubecert.recheck.document import Node, digest
from tubecert.recheck.grammar import Owed, is_name
from tubecert.recheck.lookup import Table
from tubecert.recheck.specified.numbers import (
    TIME,
    Column,
    Numbers,
    Range,
    Reader,
    ends,
    not_negative,
    positive,
    whole,
)
from tubecert.recheck.terms import Matrix, Term, names, number, number_of, replaced, slopes


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


_MOST_STATES = 32
_MOST_POINTS = 500  # of a table


@dataclass(frozen=True, slots=True)
class Plant:
    """x' = f + B u on a box; all exact, with what the expressions owe there.

    Where `ranges` of some parameters are given the plant's drift is `unknown`, anywhere in them, and its B is `gained`
    if they stand in it; f and B are those of the middles.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: Column
    B: Matrix
    safe_set: dict[str, Range]
    duties: tuple[Owed, ...]
    ranges: dict[str, Range]
    unknown: Column | None
    gained: Matrix | None
    tables: dict[str, Table] = field(default_factory=dict)
    moving: tuple[Term, ...] = ()  # f and what it owes, if t occurs in them
    outputs: dict[str, Numbers] = field(default_factory=dict)  # by name, the row that is multiplied with x

    @property
    def lengths(self) -> dict[str, Numbers]:
        """What has a half-width: the states, then the outputs."""
        return unit_rows(self.states) | self.outputs

    @property
    def varies(self) -> bool:
        """Whether t occurs in f, or in what f owes."""
        return bool(self.moving)


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """h as expressions of t and x, or declared bounds (h, h_x, h_t), or both; never neither."""

    h: Column | None
    declared: dict[str, Fraction]
    duties: tuple[Owed, ...]

    @property
    def words(self) -> str:
        """What the claim covers: the expression, everything within the bounds, or either.

        Beside an expression the bounds count only if |h| itself is declared: else H0 is that of the expression.
        """
        if self.h is None:
            return "bounds"
        return "expression_or_bounds" if "h" in self.declared else "expression"


def read_plant(node: Node, box: Node) -> Plant:
    """`system` on the `safe_set`."""
    own = node.closed("states", "inputs", "units", "parameters", "f", "B", optional=("tables", "outputs"))
    states, inputs = own["states"].texts(), own["inputs"].texts()
    n, m = len(states), len(inputs)
    if not (0 < m <= n <= _MOST_STATES):
        raise node.refused(f"must name 1 to {_MOST_STATES} states, and at most as many inputs")
    outputs = own.get("outputs", lambda item: read_outputs(item, states)) or {}
    _names(node, [*states, *inputs, *outputs])
    own["units"].closed(optional=(*states, *inputs, *outputs))
    for _, unit in own["units"].items():
        unit.text()
    ranges = _ranges(own["parameters"])
    tables = own.get("tables", _tables) or {}
    _names(own["parameters"], [*states, *inputs, *outputs, *own["parameters"].mapping(), *tables])
    reader = Reader.of((*states, *ranges), tables)
    moving = Reader.of((*states, TIME, *ranges), tables)
    drift, B = moving.column(own["f"], n), reader.matrix(own["B"], n, m)
    whole = (*drift, *(duty.argument for duty in moving.duties))
    gained = not names(e for row in B for e in row).isdisjoint(ranges)
    sides = box.closed(*states)
    return Plant(
        states=states,
        inputs=inputs,
        f=_in_the_middle(own["f"], drift, ranges),
        B=[list(_in_the_middle(own["B"], tuple(row), ranges)) for row in B],
        safe_set={name: ends(sides[name]) for name in states},
        duties=(*moving.duties, *reader.duties),
        ranges=ranges,
        unknown=drift if ranges else None,
        gained=B if gained else None,
        tables=tables,
        moving=whole if TIME in names(whole) else (),
        outputs=outputs,
    )


def _tables(node: Node) -> dict[str, Table]:
    """Functions by their points: x, y and slope, x ascending."""
    found = {}
    for name, value in node.items():
        own = value.closed("interpolation", "points")
        own["interpolation"].word("slopes")
        rows = own["points"].entries()
        if not 2 <= len(rows) <= _MOST_POINTS:
            raise value.refused(f"must have 2 to {_MOST_POINTS} points")
        points: list[tuple[Fraction, Fraction, Fraction]] = []
        for row in rows:
            x, y, slope = (item.exact() for item in row.sized(3))
            if points and x <= points[-1][0]:
                raise row.refused("does not lie above the point before it")
            points.append((x, y, slope))
        found[name] = Table(name, tuple(points))
    return found


def _ranges(node: Node) -> dict[str, Range]:
    """Parameters of which a range is known; expressions are written with the values of all others."""
    found = {}
    for name, value in node.items():
        if isinstance(value.value, list):
            found[name] = ends(value)
        else:
            value.exact()
    return found


def _in_the_middle(node: Node, drift: Column, ranges: dict[str, Range]) -> Column:
    """What the controller knows of f, or of a row of B."""
    if not ranges:
        return drift
    middle = {name: number((low + high) / 2) for name, (low, high) in ranges.items()}
    try:
        return tuple(replaced(drift, middle))
    except ZeroDivisionError:
        raise node.refused("is undefined in the middle of the ranges of its parameters") from None


def _names(node: Node, given: Sequence[str]) -> None:
    """Names that mean one thing each: not a constant, a function or a word of the grammar, and all different."""
    for name in given:
        if not is_name(name):
            raise node.refused(f"has the name {name[:60]!r}, which may not be used")
    if len(set(given)) != len(given):
        raise node.refused("uses a name twice")


def read_uncertainty(node: Node, plant: Plant, *, sudden: bool = False) -> Uncertainty:
    """`uncertainty`; where h may be `sudden`, a bound of its size is enough."""
    own = node.closed(optional=("h", "bounds"))
    reader = Reader.of((*plant.states, TIME), plant.tables, kinks=True)
    h = own.get("h", lambda item: reader.column(item, len(plant.inputs)))
    declared: dict[str, Fraction] = {}
    if "bounds" in own:
        own["bounds"].closed(optional=("h", "h_x", "h_t"))
        declared = {key: not_negative(value) for key, value in own["bounds"].items()}
    if sudden and h is not None and declared:
        raise node.refused("has both h and bounds, which no sampled loop may have")
    if h is None and not declared.keys() >= ({"h"} if sudden else {"h", "h_x", "h_t"}):
        raise node.refused("must give h, or bounds for h, h_x and h_t")
    return Uncertainty(h, declared, tuple(reader.duties))


@dataclass(frozen=True, slots=True)
class Metric:
    """A dual metric at a rate, and bounds of M that are declared for the safe set."""

    dual: Matrix
    texts: tuple[tuple[str, ...], ...]
    rate: Fraction
    lower: Fraction | None
    upper: Fraction | None
    duties: tuple[Owed, ...]


@dataclass(frozen=True, slots=True)
class Wanted:
    """A metric that is still to be found: at this rate, of this degree and in these states, if one says so.

    `content`: a hash of all that is asked for.
    """

    rate: Fraction | None
    condition_number: Fraction | None
    degree: int | None
    variables: tuple[str, ...] | None
    content: str


def read_metric(node: Node, plant: Plant) -> Metric | Wanted:
    """`metric`."""
    if "synthesise" in node.mapping():
        return read_wanted(node.closed("synthesise")["synthesise"], plant)
    own = node.closed("dual_metric", "rate", optional=("bounds",))
    n = len(plant.states)
    reader = Reader.of(plant.states)
    dual = reader.matrix(own["dual_metric"], n, n)
    if any(dual[i][j] is not dual[j][i] for i in range(n) for j in range(i)):
        raise own["dual_metric"].refused("is not symmetric")
    bounds = own.get("bounds", lambda item: item.closed(optional=("lower", "upper")))
    return Metric(
        dual=dual,
        texts=tuple(row.texts() for row in own["dual_metric"].entries()),
        rate=positive(own["rate"]),
        lower=None if bounds is None else bounds.get("lower", positive),
        upper=None if bounds is None else bounds.get("upper", positive),
        duties=tuple(reader.duties),
    )


_OBJECTIVES = {"condition": True, "margin": True, "rate": False, "adaptation": None, "tube": None}
"""What a metric may be best in, and whether that is at a rate that is given: None says either."""

_SOLVER = re.compile(r"clarabel|scs|cvxpy:[A-Z][A-Z0-9_]{0,31}")
_MOST_DEGREE = 8


def read_wanted(node: Node, plant: Plant) -> Wanted:
    """What a metric that is to be synthesised must be, and how it is searched for."""
    keys = ("objective", "degree", "variables", "route", "solver")
    own = node.closed(*keys, optional=("rate", "condition_number", "coordinates", "outputs"))
    objective, outputs = own["objective"].word(*_OBJECTIVES), own.get("outputs", Node.texts)
    own.get("coordinates", lambda item: item.word("auto", "identity"))
    own["route"].word("auto", "sos", "cegis")
    if not _SOLVER.fullmatch(own["solver"].text()):
        raise own["solver"].refused("is no solver")
    degree = None if own["degree"].value == "auto" else whole(own["degree"])
    variables = None if own["variables"].value == "auto" else own["variables"].texts()
    if not set(variables or ()) <= set(plant.states) or (degree or 0) > _MOST_DEGREE:
        raise node.refused("asks for a metric of no such states, or of too large a degree")
    if not set(outputs or ()) <= plant.lengths.keys() or (outputs is not None and objective != "tube"):
        raise node.refused("asks for a small tube in what has no length, or for something else beside it")
    if _OBJECTIVES[objective] not in (None, "rate" in own):
        raise node.refused("has a rate where it is searched for, or none where one is needed")
    rate, condition_number = own.get("rate", positive), own.get("condition_number", positive)
    return Wanted(rate, condition_number, degree, variables, digest(node.value))
