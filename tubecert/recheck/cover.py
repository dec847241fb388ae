"""A statement about every point of a domain: boxes that cover it are split until each one is proven.

What is split first is heuristic; a box is left only when the statement is proven on it, or when it is proven to
contain no point of the domain. A point of the domain at which the statement is proven false contradicts it.

A claim ends, undecided, when the time of an examination is up; somebody may be told how far it is.

A `Claim` is a statement of a certificate with everything that it depends on. Equal keys mean equal outcomes: a memory
of outcomes may be shared between certificates that differ in a field or two.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf
from typing import Any, Literal

from flint import arb, ctx

from tubecert.recheck.balls import Ball, ceiling, exact, floor
from tubecert.recheck.boxes import Found, Test

Told = Callable[[int, float], None]  # how many boxes were examined of a claim, which share of it is proven

_END: ContextVar[float] = ContextVar("end", default=inf)
_TOLD: ContextVar[Told | None] = ContextVar("told", default=None)


@contextmanager
def within(seconds: float | None) -> Iterator[None]:
    """What is examined in this context ends so many seconds from now; None: when it is done."""
    token = _END.set(inf if seconds is None else time.monotonic() + seconds)
    try:
        yield
    finally:
        _END.reset(token)


def time_is_up() -> bool:
    """Whether the end has passed."""
    return time.monotonic() > _END.get()


@contextmanager
def telling(told: Told | None) -> Iterator[None]:
    """`told` hears how far what is examined in this context is."""
    token = _TOLD.set(told)
    try:
        yield
    finally:
        _TOLD.reset(token)


def told() -> Told | None:
    """Who hears it."""
    return _TOLD.get()


_TRIES = 4  # every so many boxes a point is tried
_TELLS = 64  # ... it is told how far the claim is
_UNKNOWN = 1e300

State = tuple[list[tuple[float, float]], Any]  # a box, and what the domain remembers about it


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a claim; `why` says more where it is not confirmed, `boxes` counts the work."""

    verdict: Literal["confirmed", "contradicted", "undecided"]
    why: str = ""
    boxes: int = 0

    @property
    def holds(self) -> bool:
        """Whether the claim is confirmed."""
        return self.verdict == "confirmed"


CONFIRMED = Outcome(verdict="confirmed")


def together(outcomes: Sequence[Outcome]) -> Outcome:
    """Several claims as one: the first that is contradicted, else the first that is undecided."""
    boxes = sum(item.boxes for item in outcomes)
    for verdict in ("contradicted", "undecided"):
        for item in outcomes:
            if item.verdict == verdict:
                return Outcome(verdict=verdict, why=item.why, boxes=boxes)
    return Outcome(verdict="confirmed", boxes=boxes)


def in_turn(outcomes: Iterable[Outcome]) -> Outcome:
    """Several claims as one, each examined only if those before it hold."""
    found: list[Outcome] = []
    for item in outcomes:
        found.append(item)
        if not item.holds:
            break
    return together(found)


def stated(holds: bool, why: str) -> Outcome:
    """A comparison of exact numbers or texts."""
    return CONFIRMED if holds else Outcome(verdict="contradicted", why=why)


class Domain:
    """A set of points, known through boxes; as it stands, one that boxes never leave."""

    def needed(self, variables: tuple[str, ...]) -> tuple[str, ...]:
        """The variables to split: those given, then the domain's own."""
        return variables

    def start(self, variables: tuple[str, ...]) -> list[State]:
        """Boxes that cover it."""
        raise NotImplementedError

    def cut(self, variables: tuple[str, ...], state: State) -> State | None:
        """A smaller box with the same points of the domain; None if there are none."""
        del variables
        return state

    def point(self, variables: tuple[str, ...], state: State) -> list[Ball] | None:
        """A point of the domain in or near the box; None if none is known."""
        raise NotImplementedError

    def pull(
        self, variables: tuple[str, ...], state: State, caused: list[float], spread: list[float]
    ) -> list[float]:
        """How much splitting each variable promises: what causes the width of the bound."""
        del variables, state, spread
        return caused


def prove(test: Test, domain: Domain, budget: int) -> Outcome:
    """Decide whether a test holds on all of a domain."""
    variables = domain.needed(test.variables)
    own, count = len(test.variables), 0
    waiting = domain.start(variables)
    sides = _sides(waiting)
    whole = _volume(waiting, sides)
    while waiting:
        state = domain.cut(variables, waiting.pop())
        if state is None:
            continue
        count += 1
        box = state[0]
        found = test.over(box[:own])
        if count % _TELLS == 0 and (tell := told()) is not None and whole > 0:
            tell(count, 1 - _volume(waiting if found.proven else [*waiting, state], sides) / whole)
        if found.proven:
            continue
        if count % _TRIES == 1:
            at = domain.point(variables, state)
            if at is not None and test.broken(at[:own]):
                return Outcome(verdict="contradicted", why=f"false at {_shown(variables, at)}", boxes=count)
        halves = _halves(state, _priorities(variables, state, found, (domain, sides)))
        late = count % _TRIES == 0 and time_is_up()
        if halves is None or count >= budget or late:
            why = f"not proven near {_shown(variables, [arb(0.5 * lo + 0.5 * hi) for lo, hi in box])}"
            why += ", when the time was up" if late else f" within {count} boxes"
            return Outcome(verdict="undecided", why=why, boxes=count)
        waiting += halves
    return Outcome(verdict="confirmed", boxes=count)


def _volume(states: Sequence[State], sides: Sequence[float]) -> float:
    """Of boxes, in units of the sides: how much is left, in words; nothing is decided by it."""
    return sum(
        math.prod((hi - lo) / side for (lo, hi), side in zip(box, sides, strict=True) if side > 0)
        for box, _ in states
    )


def _sides(states: Sequence[State]) -> list[float]:
    """How wide a domain is in each variable: other widths are compared with these, so that no unit matters."""
    boxes = [box for box, _ in states]
    return [max(hi for _, hi in ends) - min(lo for lo, _ in ends) for ends in zip(*boxes, strict=True)]


def _priorities(
    variables: tuple[str, ...], state: State, found: Found, where: tuple[Domain, list[float]]
) -> list[float]:
    domain, sides = where
    extra = [0.0] * (len(variables) - len(found.caused))
    if found.caused and all(x < _UNKNOWN for x in (*found.caused, *found.spread)):
        pull = domain.pull(variables, state, found.caused + extra, found.spread + extra)
        if any(x > 0 for x in pull):
            return pull
    return [(hi - lo) / side if side > 0 else 0.0 for (lo, hi), side in zip(state[0], sides, strict=True)]


def _halves(state: State, priority: list[float]) -> list[State] | None:
    """The box cut in two where that promises most; None if it cannot be cut."""
    box, memory = state
    for i in sorted(range(len(box)), key=lambda i: -priority[i]):
        lo, hi = box[i]
        middle = math.sqrt(lo) * math.sqrt(hi) if lo > 0 and hi > 4 * lo else 0.5 * lo + 0.5 * hi
        if lo < middle < hi:
            return [([*box[:i], side, *box[i + 1 :]], memory) for side in ((lo, middle), (middle, hi))]
    return None


def _shown(variables: Sequence[str], at: Sequence[Ball]) -> str:
    return (
        ", ".join(f"{v} = {float(x.mid()):.6g}" for v, x in zip(variables, at, strict=True)) or "every point"
    )


Range = tuple[Fraction | Ball, Fraction | Ball]


class Boxed(Domain):
    """A product of closed ranges; `needed` ones only are split."""

    def __init__(self, ranges: Mapping[str, Range]) -> None:
        self._ranges = {v: (as_ball(lo), as_ball(hi)) for v, (lo, hi) in ranges.items()}

    def start(self, variables: tuple[str, ...]) -> list[State]:
        """The box itself, rounded outward."""
        return [([(floor(self._ranges[v][0]), ceiling(self._ranges[v][1])) for v in variables], None)]

    def point(self, variables: tuple[str, ...], state: State) -> list[Ball] | None:
        """The centre, moved inside."""
        found = []
        for v, (lo, hi) in zip(variables, state[0], strict=True):
            low, high = ceiling(self._ranges[v][0]), floor(self._ranges[v][1])
            if low > high:
                return None
            found.append(arb(min(max(0.5 * lo + 0.5 * hi, low), high)))
        return found


def as_ball(x: Fraction | Ball) -> Ball:
    """An end of a range as a ball."""
    return exact(x) if isinstance(x, Fraction) else x


BOXES = 64  # bits, for boxes
SHARP = 160  # bits, for formulas at decimals

Memory = MutableMapping[str, Outcome]


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the certificate, what it depends on (None: it is examined each time), and how to examine it."""

    name: str
    key: tuple[object, ...] | None
    examine: Callable[[], Outcome] = field(repr=False)
    bits: int = BOXES

    def outcome(self, memory: Memory | None = None) -> Outcome:
        """The outcome; what arithmetic cannot represent is undecided."""
        if memory is None or self.key is None:
            return self._examined()
        name = json.dumps([self.name, self.key], default=str, sort_keys=True)
        if name not in memory:
            memory[name] = self._examined()
        return memory[name]

    def _examined(self) -> Outcome:
        with ctx.workprec(self.bits):
            try:
                return self.examine()
            except (ArithmeticError, ValueError) as error:
                return Outcome(verdict="undecided", why=f"it cannot be evaluated: {error}")
