"""The machine that runs the controller, and the disturbance that acts beside the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node
from tubecert.recheck.grammar import Owed
from tubecert.recheck.reading import Reader
from tubecert.recheck.specified.numbers import Numbers, not_negative, positive
from tubecert.recheck.terms import Matrix

MACHINE = ("hardware", "disturbance")
_ONE_SAMPLE = "one sample"
_MOST_COLUMNS = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """The computer and the sensors, of which no claim is made yet; times in s.

    `delay` None: one sample time. `noise` is a Euclidean length, or one size per state. `arithmetic` that the
    controller computes in; None: it is exact.
    """

    sample_time: Fraction
    delay: Fraction | None
    noise: Fraction | Numbers
    noise_rate: Fraction | None
    arithmetic: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """E(x) w, |w| <= `bound`, |w'| <= `rate` if there is one."""

    E: Matrix
    bound: Fraction
    rate: Fraction | None
    duties: tuple[Owed, ...]


def read_machine(own: Members, states: Sequence[str]) -> tuple[Hardware | None, Disturbance | None]:
    """`hardware` and `disturbance`, where they are."""
    machine = own.get("hardware", lambda item: _hardware(item, states))
    return machine, own.get("disturbance", lambda item: _disturbance(item, states))


def _hardware(node: Node, states: Sequence[str]) -> Hardware:
    own = node.closed("sample_time", "delay", "noise", optional=("noise_rate", "arithmetic"))
    found = Hardware(
        sample_time=positive(own["sample_time"]),
        delay=None if own["delay"].value == _ONE_SAMPLE else not_negative(own["delay"]),
        noise=_noise(own["noise"], states),
        noise_rate=own.get("noise_rate", not_negative),
        arithmetic=own.get("arithmetic", lambda item: item.word("single", "double")),
    )
    if found.delay is not None and found.delay > found.sample_time:
        raise own["delay"].refused("is longer than the sample time")
    return found


def _noise(node: Node, states: Sequence[str]) -> Fraction | Numbers:
    """A length, or a size for every state, in their order."""
    if not isinstance(node.value, dict):
        return not_negative(node)
    own = node.closed(*states)
    return tuple(not_negative(own[name]) for name in states)


def _disturbance(node: Node, states: Sequence[str]) -> Disturbance:
    own = node.closed("E", "bound", optional=("rate",))
    reader = Reader.of(states)
    rows = own["E"].sized(len(states))
    width = len(rows[0].entries())
    if not 0 < width <= _MOST_COLUMNS:
        raise own["E"].refused(f"must have 1 to {_MOST_COLUMNS} columns")
    return Disturbance(
        E=reader.matrix(own["E"], len(states), width),
        bound=not_negative(own["bound"]),
        rate=own.get("rate", not_negative),
        duties=tuple(reader.duties),
    )
