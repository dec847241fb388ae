"""Vectors of what a computer has, and what is made of them where functions of a code are followed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from flint import arb

from tubecert.recheck.balls import Ball, between, larger
from tubecert.recheck.code.run import Value, Vector, numbers
from tubecert.recheck.code.seen import Seen, known
from tubecert.recheck.code.words import UnreadError

Numbers = list[Seen]


def greatest(balls: Sequence[Ball]) -> Ball:
    """The largest of them, and of 0."""
    found = arb(0)
    for own in balls:
        found = larger(found, own)
    return found


def around(size: Ball) -> Ball:
    """Both signs."""
    return between(-size, size)


def named(name: str, row: Value) -> Vector:
    """A vector whose entries know where they come from."""
    return [replace(each, origin=(name, i)) for i, each in enumerate(numbers(row))]


def slackened(found: Vector, slack: Sequence[Ball]) -> Numbers:
    """With more error each."""
    return [replace(x, error=x.error + own) for x, own in zip(numbers(found), slack, strict=True)]


def near(found: Sequence[Seen], side: Ball) -> Seen:
    """What is measured near any of these, exactly."""
    whole = found[0].value
    for own in found[1:]:
        whole = whole.union(own.value)
    return known(whole + around(side))


def row(value: Value) -> Vector:
    """A vector."""
    if not isinstance(value, list):
        raise UnreadError("a number stands where there has to be a row")
    return value


def empty(k: int) -> Vector:
    """A vector that is to be written."""
    return [None] * k
