"""Inputs with limits: u* on the plan, and what the loop of each kind adds to it at most. Implements: theory 4d.

In: what a certificate states of every input that has limits. Out: claims. u_i stays in [inf u*_i - du D - R, sup u*_i +
du D + R], where d(x*, x) <= D by the theorem of the kind and R is the radius of its projection.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.cover import Outcome, in_turn, stated, together
from tubecert.recheck.document import Enclosure, Node, enclosure, reads
from tubecert.recheck.kinds.kind import VERDICTS, Section, Shares, Statements, at_most
from tubecert.recheck.kinds.table import KEYS
from tubecert.recheck.place import Place
from tubecert.recheck.specified.numbers import Range
from tubecert.recheck.statements import NotNegative
from tubecert.recheck.terms import number


@dataclass(frozen=True, slots=True)
class InputBound:
    """What is stated of an input in the loop of one kind."""

    least: Fraction = reads(Node.number)
    greatest: Fraction = reads(Node.number)
    feedback: Fraction = reads(Node.number)
    adaptation: Fraction = reads(Node.number)


@dataclass(frozen=True, slots=True)
class Limited:
    """What is stated of an input that has limits; `bounds` by the key of the kind."""

    name: str
    limits: Range
    verdict: str
    least: Enclosure
    greatest: Enclosure
    bounds: Mapping[str, InputBound]


def read_limited(node: Node, inputs: Sequence[str]) -> Limited:
    """One of `result.inputs`, of an input that there is."""
    own = node.closed("input", "limits", "verdict", "plan", "bounds")
    low, high = own["limits"].pair()
    plan = own["plan"].closed("least", "greatest")
    bounds = own["bounds"].closed(optional=KEYS)
    return Limited(
        name=own["input"].word(*inputs),
        limits=(low.decimal(), high.decimal()),
        verdict=own["verdict"].word(*VERDICTS),
        least=enclosure(plan["least"]),
        greatest=enclosure(plan["greatest"]),
        bounds={key: bounds[key].record(InputBound) for key in KEYS if key in bounds},
    )


def agrees(
    limits: Mapping[str, Range],
    found: Sequence[Limited],
    sections: Mapping[str, Section],
    deciding: Collection[str],
) -> Statements:
    """Every input with limits has its entry, and stays within them in the loop of every kind that decides."""
    yield tuple(limits) == tuple(own.name for own in found), "inputs are not those that have limits"
    for own in found:
        yield (
            own.limits == limits.get(own.name),
            f"inputs: the limits of {own.name} are not the specification's",
        )
        yield own.verdict == "certified", f"{own.name} is not certified to stay within its limits"
        yield own.least.is_interval and own.greatest.is_interval, "what u* does is not an interval"
        yield set(deciding) <= own.bounds.keys(), f"{own.name} has no bound by a kind that decides"
        low, high = own.limits
        for key, bound in own.bounds.items():
            by = sections.get(key)
            proven = by is not None and by.verdict == "certified"
            yield proven, f"{own.name} is bounded by {key}, which is not certified"
            inside = key not in deciding or (low <= bound.least and bound.greatest <= high)
            yield inside, f"{own.name} is not within its limits by {key}"
            yield _follows(own, bound), f"the bound of {own.name} by {key} is not what it consists of"


def _follows(own: Limited, bound: InputBound) -> bool:
    """Whether a bound leaves room for u* on the plan and all that is added, (4.13)."""
    least, greatest, added = own.least.below, own.greatest.above, bound.feedback + bound.adaptation
    if least is None or greatest is None or min(bound.feedback, bound.adaptation) < 0:
        return False
    return bound.least <= least - added and greatest + added <= bound.greatest


def on_plan(place: Place, own: Limited) -> Outcome:
    """u* of the input stays in the range that is stated, at all times of the plan, (4.13)."""
    low, high = own.least.below, own.greatest.above
    if low is None or high is None:
        return stated(False, "no range is stated")
    u = place.curve.u[place.system.inputs.index(own.name)]
    sides = (u - number(low), number(high) - u)
    return together([place.along(lambda room=room: NotNegative(room, place.numbers)) for room in sides])  # type: ignore[misc]


def added(shares: Shares | None, bounds: Mapping[str, InputBound]) -> Outcome:
    """What feedback and adaptation add is at most what is stated with every input."""
    if shares is None:
        return Outcome(verdict="undecided", why="this kind says nothing of inputs")
    feedback, adaptation = shares
    return in_turn(
        outcome
        for bound in bounds.values()
        for outcome in (
            at_most(feedback, bound.feedback, "what feedback adds"),
            stated(adaptation <= bound.adaptation, "adaptation may add more: R_H"),
        )
    )
