"""What a kind of certificate offers to the rest of recheck."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Generic, TypeVar

from tubecert.recheck.balls import Ball
from tubecert.recheck.conditions import Setting
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Enclosure, Node, each, enclosure, one_of, reads
from tubecert.recheck.examination import SHARP, Claim

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
