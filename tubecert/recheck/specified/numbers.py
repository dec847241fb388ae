"""Numbers of a specification: exact, of the kind and size that their place asks for."""

from __future__ import annotations

from fractions import Fraction

from tubecert.recheck.document import Node

Range = tuple[Fraction, Fraction]
Numbers = tuple[Fraction, ...]
Rows = tuple[Numbers, ...]


def positive(node: Node) -> Fraction:
    """A number above 0."""
    q = node.exact()
    if q <= 0:
        raise node.refused("is not positive")
    return q


def not_negative(node: Node) -> Fraction:
    """A number that is not below 0."""
    q = node.exact()
    if q < 0:
        raise node.refused("is negative")
    return q


def whole(node: Node) -> int:
    """A whole number that is not negative."""
    q = node.exact()
    if q.denominator != 1 or q < 0:
        raise node.refused("is no whole number")
    return int(q)


def several(node: Node, size: int) -> Numbers:
    """A list of a known size."""
    return tuple(item.exact() for item in node.sized(size))


def square(node: Node, size: int) -> Rows:
    """A square matrix."""
    return tuple(several(row, size) for row in node.sized(size))


def ends(node: Node) -> Range:
    """The ends of a range that is more than a point."""
    low, high = (end.exact() for end in node.pair())
    if low >= high:
        raise node.refused("is an empty range")
    return low, high


def span(node: Node) -> Range:
    """Ends that may be one point."""
    low, high = (end.exact() for end in node.pair())
    if low > high:
        raise node.refused("is an empty range")
    return low, high
