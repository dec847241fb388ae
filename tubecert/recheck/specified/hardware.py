"""The machine that runs the controller, and the disturbance that acts beside the inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node
from tubecert.recheck.grammar import Owed
from tubecert.recheck.reading import Reader
from tubecert.recheck.specified.numbers import Numbers, not_negative, positive
from tubecert.recheck.terms import Matrix

MACHINE = ("hardware", "disturbance")
_LARGEST, _ONE_SAMPLE, _AUTO = "largest", "one sample", "auto"
_MOST_COLUMNS = 32
_MOST_PANELS, _MOST_PASSES = 256, 32
_MOST_STATES = 12  # with noise of their own: all corners of a box are examined


@dataclass(frozen=True, slots=True, kw_only=True)
class Arcs:
    """Geodesics of so many panels with a constant second derivative each, improved in so many passes."""

    panels: int
    passes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """What a controller is promised of its machine; times in s.

    None where the largest is asked for: then the section states it. `one_sample`: the delay is the sample time. `noise`
    is a Euclidean length, or one size per state. `held`: u* is held like the other inputs; `feedback_time`: the sample
    time of the feedback, if it has one of its own; `predict`: the feedback is that of a predicted state. `bandwidth`
    binds no claim but that it is the one used. `arithmetic` that the controller computes in; None: it is exact. `arcs`:
    how geodesics are computed; None: they are exact.
    """

    sample_time: Fraction | None
    delay: Fraction | None
    one_sample: bool
    noise: Fraction | Numbers | None
    noise_rate: Fraction | None
    held: bool
    feedback_time: Fraction | None
    predict: bool
    bandwidth: Fraction | None
    arithmetic: str | None
    arcs: Arcs | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """E(x) w, |w| <= `bound` (None: the section states the largest), |w'| <= `rate` if there is one."""

    E: Matrix
    bound: Fraction | None
    rate: Fraction | None
    duties: tuple[Owed, ...]


def read_machine(own: Members, states: Sequence[str]) -> tuple[Hardware | None, Disturbance | None]:
    """`hardware` and `disturbance`, where they are; what is not bounded is that of a machine."""
    machine = own.get("hardware", lambda item: _hardware(item, states))
    wind = own.get("disturbance", lambda item: _disturbance(item, states))
    if wind is not None and wind.bound is None and (machine is None or wind.rate is not None):
        raise own["disturbance"].refused("must have a bound, but that of a machine where it has no rate")
    return machine, wind


def _hardware(node: Node, states: Sequence[str]) -> Hardware:
    keys = ("sample_time", "delay", "noise", "feedforward", "predict", "bandwidth")
    own = node.closed(*keys, optional=("noise_rate", "feedback_rate", "arithmetic", "geodesic"))
    feedback = own.get("feedback_rate", positive)
    found = Hardware(
        sample_time=_unless(own["sample_time"], _LARGEST, positive),
        delay=None if own["delay"].value == _ONE_SAMPLE else _unless(own["delay"], _LARGEST, not_negative),
        one_sample=own["delay"].value == _ONE_SAMPLE,
        noise=_noise(own["noise"], states),
        noise_rate=own.get("noise_rate", not_negative),
        held=own["feedforward"].word("continuous", "held") == "held",
        feedback_time=None if feedback is None else 1 / feedback,
        predict=own["predict"].word("true", "false") == "true",
        bandwidth=_unless(own["bandwidth"], _AUTO, positive),
        arithmetic=own.get("arithmetic", lambda item: item.word("single", "double")),
        arcs=own.get("geodesic", _arcs),
    )
    if found.delay is not None and found.sample_time is not None and found.delay > found.sample_time:
        raise own["delay"].refused("is longer than the sample time")
    if found.arcs is not None and found.arithmetic is not None:
        raise own["geodesic"].refused("is about exact arithmetic, and stands beside another one")
    return found


def _arcs(node: Node) -> Arcs:
    own = node.closed("nodes", "sweeps")
    return Arcs(panels=_upto(own["nodes"], _MOST_PANELS), passes=_upto(own["sweeps"], _MOST_PASSES))


def _upto(node: Node, most: int) -> int:
    q = positive(node)
    if q.denominator != 1 or q > most:
        raise node.refused(f"is no whole number from 1 to {most}")
    return int(q)


def _unless(node: Node, word: str, read: Callable[[Node], Fraction]) -> Fraction | None:
    return None if node.value == word else read(node)


def _noise(node: Node, states: Sequence[str]) -> Fraction | Numbers | None:
    """A length, or a size for every state, in their order."""
    if not isinstance(node.value, dict):
        return _unless(node, _LARGEST, not_negative)
    own = node.closed(*states)
    if len(states) > _MOST_STATES:
        raise node.refused(f"has more than {_MOST_STATES} states")
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
        bound=_unless(own["bound"], _LARGEST, not_negative),
        rate=own.get("rate", not_negative),
        duties=tuple(reader.duties),
    )
