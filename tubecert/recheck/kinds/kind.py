"""What a kind of certificate offers to the rest of recheck.

Printed numbers are held against what is proven here, each on the side that is claimed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Generic, TypeVar

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.conditions import DistanceProof, Gains, Setting, distance_bound
from tubecert.recheck.cover import CONFIRMED, SHARP, Claim, Outcome, stated
from tubecert.recheck.document import Enclosure, Node, each, enclosure, one_of, reads

VERDICTS = ("certified", "refuted", "undecided")

Statements = Iterator[tuple[bool, str]]
"""What must hold, each with what to say where it does not."""


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A condition that is not proven, with its margin."""

    condition: str = reads(Node.text)
    margin: Enclosure = reads(enclosure)


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The section of a kind, read."""

    verdict: str = reads(one_of(*VERDICTS))
    shortfalls: tuple[Shortfall, ...] = reads(each(lambda node: node.record(Shortfall)))


Asked = Mapping[str, Fraction | None]
"""Gains that the command line asked for, by name; None: not asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """What claims about gains rest on: the constants on their safe sides, and as they are printed.

    `depends` is everything that the setting was made of. `silent`: the section is printed as if there were no
    disturbance, of which it says that it covers none.
    """

    setting: Setting
    constants: Mapping[str, Enclosure]
    depends: tuple[object, ...]
    silent: bool = False

    def claim(self, name: str, parts: tuple[object, ...], examine: Callable[[], Outcome]) -> Claim:
        """A claim about formulas at decimals, which depends on `parts` beside the setting."""
        return Claim(name, (*self.depends, *parts), examine, SHARP)


Shares = tuple[Ball, Fraction]
"""What is added to u* at most: the bound of |k|, and what bounds what adapts (0: nothing does)."""

S = TypeVar("S", bound=Section)
R = TypeVar("R")


class Kind(ABC, Generic[S, R]):
    """One kind: S is its section, R its recipe.

    `conditions` are those that it may say are not proven; `adapts` says whether it is about the adaptive loop, and so
    one of those that decide where all do.
    """

    key: ClassVar[str]
    conditions: ClassVar[tuple[str, ...]]
    adapts: ClassVar[bool] = True

    @abstractmethod
    def read(self, node: Node) -> S:
        """The section; raises `CertificateError` for whatever is not of its form."""

    @abstractmethod
    def read_recipe(self, node: Node) -> R:
        """Its recipe in `result.proof`."""

    @abstractmethod
    def said(self, section: S) -> dict[str, object]:
        """What a reason may repeat of a section that is certified, `section` apart."""

    @abstractmethod
    def claims(self, section: S, recipe: R | None, ground: Ground) -> Iterator[Claim]:
        """Everything that is examined of it. One that is not certified does not claim its gains, but the rest."""

    def uncovered(self, setting: Setting) -> str | None:
        """The condition that a section names, uncertified, where it does not cover the disturbance; None if it does."""
        del setting
        return None

    def asked(self, section: S, given: Asked) -> Statements:
        """That what was asked for is what is judged."""
        del section, given
        yield from ()

    def derived(self, node: Node) -> tuple[str, ...]:
        """Constants that stand beside those of the tube because of this section, which is not read yet."""
        del node
        return ()

    def shares(self, section: S, recipe: R, ground: Ground) -> Shares | None:
        """What is added to u*, where the recipe is a proof; None if the theorem does not say."""
        del section, recipe, ground
        return None


def margin_at_least(value: Ball, printed: Enclosure, what: str) -> Outcome:
    """A margin: proven to be at least the lower end that is printed, which is positive."""
    below = printed.below
    if below is None or below <= 0:
        return stated(False, f"the printed margin of {what} is not positive")
    if not printed.is_interval:
        return stated(False, f"the printed margin of {what} is not an interval")
    return at_least(value, below, what)


def at_least(value: Ball, below: Fraction, what: str) -> Outcome:
    """A margin that is at least this."""
    if value >= exact(below):
        return CONFIRMED
    if not value.is_finite():
        return Outcome(verdict="contradicted", why=f"the condition on {what} does not hold at these numbers")
    return Outcome(
        verdict="contradicted" if value < exact(below) else "undecided",
        why=f"the margin of {what} is {float(value.lower()):.6g}, not {float(below):.6g}",
    )


def told(value: Ball, printed: Enclosure, what: str) -> Outcome:
    """A margin of what is not certified for another reason: an interval, and proven to be at least its lower end."""
    if not printed.is_interval:
        return stated(False, f"the printed margin of {what} is not an interval")
    return CONFIRMED if printed.below is None else at_least(value, printed.below, what)


def at_most(value: Ball, printed: Fraction, what: str) -> Outcome:
    """A number that is at most this."""
    if value <= exact(printed):
        return CONFIRMED
    verdict = "contradicted" if value > exact(printed) or not value.is_finite() else "undecided"
    return Outcome(
        verdict=verdict,  # type: ignore[arg-type]
        why=f"{what} is {float(value.upper()):.12g}, more than {float(printed):.12g}",
    )


def ultimate(radius: Fraction, setting: Setting, gains: Gains, proof: DistanceProof) -> Outcome:
    """|x - x*| is at most `radius` in the long run, by theorem B."""
    bound = distance_bound(setting, gains, proof)
    if bound is None or not bound.supremum() < setting.reach:
        return Outcome(verdict="undecided", why="theorem B could not be shown at these gains")
    return at_most(bound.ultimate() / root(setting.n.lower), radius, "the ultimate radius")


def not_shown_to_hold(margins: Iterable[Enclosure]) -> Outcome:
    """Gains that are not certified: their margins do not say that every condition holds."""
    ends = [margin.below for margin in margins]
    holds = any(below is None or below <= 0 for below in ends)
    return stated(holds, "by its margins it holds, and yet it is not certified")


def no_radius() -> Outcome:
    """A radius in the long run is one of what is certified."""
    return stated(False, "a radius is stated of a tube that is not certified")


def words(at: Gains) -> str:
    """Gains, to name a claim by."""
    return f"omega = {float(at.bandwidth):.6g}, Gamma = {float(at.adaptation_rate):.6g}"
