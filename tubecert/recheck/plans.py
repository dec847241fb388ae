"""The plan as a certificate holds it: its kind, its knots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.numbers import Numbers, Rows
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Resting, Tabled


@dataclass(frozen=True, slots=True)
class Knots:
    """Exact knots of a plan, row by row."""

    t: Numbers
    x: Rows
    u: Rows


@dataclass(frozen=True, slots=True)
class Plan:
    """The plan as it was certified: `interpolation` is None where a certification ended before there was one."""

    kind: str
    interpolation: str | None
    curve: str | None
    knots: Knots | None
    file: str | None
    file_hash: str | None


def read_plan(node: Node, specification: Specification) -> Plan:
    """`result.plan`; the members that it has depend on the kind of trajectory."""
    n, m = len(specification.plant.states), len(specification.plant.inputs)
    optional = ["interpolation"]
    if not isinstance(specification.trajectory, (Resting, Expressed, AnyPlan)):
        optional += ["curve", "knots"]
    if isinstance(specification.trajectory, Tabled):
        optional += ["file", "file_hash"]
    own = node.closed("kind", optional=optional)
    knots = own.get("knots", lambda item: read_knots(item.closed("t", "x", "u"), n, m, Node.exact))
    if "interpolation" in own:
        own.require(*optional)
    return Plan(
        kind=own["kind"].text(),
        interpolation=own.get(
            "interpolation", lambda item: item.word("exact", "hold", "linear", "hermite-simpson")
        ),
        curve=own.get("curve", Node.text),
        knots=knots,
        file=own.get("file", Node.text),
        file_hash=own.get("file_hash", Node.text),
    )


def read_knots(own: Members, n: int, m: int, reads: Callable[[Node], Fraction]) -> Knots:
    """`t`, `x` and `u` of an object, row by row."""
    t = tuple(map(reads, own["t"].entries()))
    x, u = (
        tuple(tuple(map(reads, row)) for row in own[key].rows(len(t), size))
        for key, size in (("x", n), ("u", m))
    )
    return Knots(t, x, u)
