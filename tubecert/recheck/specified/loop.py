"""The loop of adaptation, the machine that runs a controller, and the disturbance that acts beside the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from tubecert.recheck.document import Node
from tubecert.recheck.grammar import Owed
from tubecert.recheck.specified.numbers import Numbers, Reader, not_negative, positive
from tubecert.recheck.terms import Matrix

LETTERS: Final = {"0": "no_adaptation", "A": "conditions_26", "B": "distance"}
"""The key of every kind of certificate by the letter that a specification names it with, in the order of the table."""

DECIDES: Final = (*LETTERS, "all")


@dataclass(frozen=True, slots=True)
class Loop:
    """The g of the predictor -g I (None: that of each pair), the smooth layer of the projection.

    `decides`: the letter of the kind that the specification wants to decide, None if it does not say.
    """

    predictor_gain: Fraction | None
    smooth: Fraction | None
    decides: str | None


def read_loop(adaptation: Node, conditions: Node) -> Loop:
    """`adaptation` and `conditions`."""
    own, chosen = adaptation.closed("A_m", "projection"), conditions.closed(optional=("decides",))
    projection = own["projection"]
    return Loop(
        predictor_gain=_gain(own["A_m"]),
        smooth=None if projection.value == "hard" else positive(projection.closed("smooth")["smooth"]),
        decides=chosen.get("decides", lambda item: item.word(*DECIDES)),
    )


def _gain(node: Node) -> Fraction | None:
    """The g of A_m = -g I, written as the number -g; None for auto."""
    if node.value == "auto":
        return None
    value = node.exact()
    if value >= 0:
        raise node.refused("must be auto or a negative number")
    return -value


_ONE_SAMPLE = "one sample"
_MOST_COLUMNS = 32
_MOST_LATE = 64  # samples of delay


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """The computer and the sensors; times in s.

    `noise` is a Euclidean length, or one size per state. `arithmetic`, single or double, that the controller computes
    in; `hold`, middle, left or continuous: where in the time in which an input acts u* is read.
    """

    sample_time: Fraction
    delay: Fraction
    noise: Fraction | Numbers
    arithmetic: str
    hold: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """E(x) w, |w| <= `bound`, or |w_i| <= `bound`[i]; |w'|, or every |w_i'|, <= `rate` if there is one."""

    E: Matrix
    bound: Fraction | Numbers
    rate: Fraction | None
    duties: tuple[Owed, ...]

    @property
    def length(self) -> Fraction:
        """The bound of |w| of a loop in continuous time, which has no other."""
        assert isinstance(self.bound, Fraction)
        return self.bound


def read_hardware(node: Node, states: Sequence[str]) -> Hardware:
    """`hardware`."""
    own = node.closed("sample_time", "delay", "noise", "arithmetic", "hold")
    sample_time, delay = positive(own["sample_time"]), own["delay"]
    found = Hardware(
        sample_time=sample_time,
        delay=sample_time if delay.value == _ONE_SAMPLE else not_negative(delay),
        noise=_noise(own["noise"], states),
        arithmetic=own["arithmetic"].word("single", "double"),
        hold=own["hold"].word("middle", "left", "continuous"),
    )
    if found.delay > _MOST_LATE * sample_time:
        raise delay.refused(f"is longer than {_MOST_LATE} samples")
    return found


def _noise(node: Node, states: Sequence[str]) -> Fraction | Numbers:
    """A length, or a size for every state, in their order."""
    if not isinstance(node.value, dict):
        return not_negative(node)
    own = node.closed(*states)
    return tuple(not_negative(own[name]) for name in states)


def read_disturbance(node: Node, states: Sequence[str], *, sampled: bool = False) -> Disturbance:
    """`disturbance`; of a sampled loop it may be bounded component by component."""
    own = node.closed("E", "bound", optional=("rate",))
    reader = Reader.of(states)
    rows = own["E"].sized(len(states))
    width = len(rows[0].entries())
    if not 0 < width <= _MOST_COLUMNS:
        raise own["E"].refused(f"must have 1 to {_MOST_COLUMNS} columns")
    return Disturbance(
        E=reader.matrix(own["E"], len(states), width),
        bound=_sizes(own["bound"], width) if sampled else not_negative(own["bound"]),
        rate=own.get("rate", not_negative),
        duties=tuple(reader.duties),
    )


def _sizes(node: Node, width: int) -> Fraction | Numbers:
    """A length, or a size for every column of E."""
    if not isinstance(node.value, list):
        return not_negative(node)
    return tuple(not_negative(item) for item in node.sized(width))
