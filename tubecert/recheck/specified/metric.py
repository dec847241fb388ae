"""The metric: a dual metric at a rate, or what one that is to be synthesised must be."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.grammar import Owed
from tubecert.recheck.reading import Reader
from tubecert.recheck.specified.numbers import positive
from tubecert.recheck.specified.plant import Plant
from tubecert.recheck.terms import Matrix


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
    """A metric that is still to be found: at this rate, if one is given."""

    rate: Fraction | None
    condition_number: Fraction | None


def read_metric(node: Node, plant: Plant) -> Metric | Wanted:
    """`metric`."""
    if "synthesise" in node.mapping():
        return read_wanted(node.closed("synthesise")["synthesise"])
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


def read_wanted(node: Node) -> Wanted:
    """What a metric that is to be synthesised must be; how it is searched for is idle."""
    keys = ("objective", "degree", "variables", "route", "solver")
    own = node.closed(*keys, optional=("rate", "condition_number", "coordinates", "outputs"))
    own.get("coordinates", Node.text)
    own.get("outputs", Node.texts)
    for key in ("objective", "degree", "route", "solver"):
        own[key].text()
    if own["variables"].value != "auto":
        own["variables"].texts()
    return Wanted(own.get("rate", positive), own.get("condition_number", positive))
