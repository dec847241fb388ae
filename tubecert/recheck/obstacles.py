"""Obstacles as a certificate holds them: those of the specification, and what is stated of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.enclosures import Enclosure, enclosure

Point = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A disc (radius) or a polygon (corners) in the plane of two states; whether the verdict asks for clearance."""

    states: tuple[str, str]
    corners: tuple[Point, ...]
    center: Point | None
    radius: Fraction | None
    decides: bool


@dataclass(frozen=True, slots=True)
class Shape:
    """Over the tube: W11, W22 <= `diagonal`, and W12 in `beside`."""

    diagonal: Point
    beside: Point


@dataclass(frozen=True, slots=True)
class Cleared:
    """What is stated of an obstacle."""

    verdict: str
    decides: bool
    clearance: Enclosure
    shape: Shape


def read_obstacle(node: Node, states: Sequence[str]) -> Obstacle:
    """An obstacle of the specification."""
    own = node.closed("states", optional=("polygon", "disc", "decide"))
    plane = own["states"].texts()
    if len(plane) != 2 or plane[0] == plane[1] or not set(plane) <= set(states):
        raise own["states"].refused("must name two states")
    if ("polygon" in own) == ("disc" in own):
        raise node.refused("must be a polygon or a disc")
    if own.get("decide", Node.flag) is True:
        raise own["decide"].refused("is there only where it is false")
    disc = own.get("disc", lambda at: at.closed("center", "radius"))
    corners = own.get("polygon", lambda rows: tuple(_point(row) for row in rows.entries())) or ()
    if disc is None and len(corners) < 3:
        raise node.refused("must have three corners")
    radius = None if disc is None else disc["radius"].exact()
    if radius is not None and radius <= 0:
        raise node.refused("must have a positive radius")
    return Obstacle(
        states=(plane[0], plane[1]),
        corners=corners,
        center=None if disc is None else _point(disc["center"]),
        radius=radius,
        decides="decide" not in own,
    )


def _point(node: Node) -> Point:
    x, y = node.pair()
    return x.exact(), y.exact()


def read_cleared(node: Node) -> Cleared:
    """One of `result.clearance`."""
    own = node.closed("verdict", "decides", "clearance", "t", "shape", optional=("inside",))
    own["t"].number()
    own.get("inside", lambda item: [value.number() for value in item.pair()])
    shape = own["shape"].closed("diagonal", "beside")
    diagonal, beside = (
        (first.number(), second.number())
        for first, second in (shape["diagonal"].pair(), shape["beside"].pair())
    )
    return Cleared(
        verdict=own["verdict"].word("certified", "refuted", "undecided"),
        decides=own["decides"].flag(),
        clearance=enclosure(own["clearance"]),
        shape=Shape(diagonal, beside),
    )
