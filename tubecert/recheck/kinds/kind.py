"""What a kind of certificate offers to the rest of recheck."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar, Generic, TypeVar

from tubecert.recheck.balls import Ball
from tubecert.recheck.conditions import Setting
from tubecert.recheck.cover import Outcome
from tubecert.recheck.document import Node
from tubecert.recheck.enclosures import Enclosure
from tubecert.recheck.examination import SHARP, Claim
from tubecert.recheck.kinds.window_section import WindowSection
from tubecert.recheck.place import Place
from tubecert.recheck.recipe import MachineNumbers
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.hardware import Hardware
from tubecert.recheck.specified.numbers import Range

VERDICTS = ("certified", "refuted", "undecided")

Statements = Iterator[tuple[bool, str]]
"""What must hold, each with what to say where it does not."""


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A condition that is not proven, with its margin."""

    condition: str
    margin: Enclosure


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The section of a kind, read; `windows`: what it tells of each, where it has them."""

    verdict: str
    shortfalls: tuple[Shortfall, ...]
    windows: tuple[WindowSection, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Gains that the command line asked for; None: not asked for."""

    bandwidth: Fraction | None
    adaptation_rate: Fraction | None

    @property
    def anything(self) -> bool:
        """Whether any was."""
        return self.bandwidth is not None or self.adaptation_rate is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """What claims about gains rest on: the constants on their safe sides, and as they are printed.

    `depends` is everything that the setting was made of, `around` everything that the tube, the `place`, was made of;
    `projection_radius` is that of the pairs of A and B; `machine` are the constants of a machine, if there is one.
    `silent`: the section is printed as if there were no disturbance, of which it says that it covers none.
    """

    setting: Setting
    constants: Mapping[str, Enclosure]
    depends: tuple[object, ...]
    projection_radius: Fraction
    place: Place
    around: tuple[object, ...]
    specification: Specification
    machine: MachineNumbers | None
    silent: bool = False

    def claim(self, name: str, parts: tuple[object, ...], examine: Callable[[], Outcome]) -> Claim:
        """A claim about formulas at decimals, which depends on `parts` beside the setting."""
        return Claim(name, (*self.depends, *parts), examine, SHARP)

    def over_tube(self, name: str, parts: tuple[object, ...], examine: Callable[[], Outcome]) -> Claim:
        """A claim about the tube or the plan, which depends on `parts` beside these."""
        return Claim(name, (*self.around, *parts), examine)

    @property
    def asked(self) -> Hardware:
        """The machine of the specification; `ValueError` where there is none."""
        if self.specification.hardware is None:
            raise ValueError("the specification has no machine")
        return self.specification.hardware


@dataclass(frozen=True, slots=True)
class Shares:
    """What is added to u* at most: |k| <= `feedback`, and `adaptation` bounds what adapts (0: nothing does).

    `clipped` bounds it input by input, where the set that it is clipped to is a box.
    """

    feedback: Ball
    adaptation: Fraction
    clipped: Mapping[str, Fraction] = field(default_factory=dict)


S = TypeVar("S", bound=Section)
R = TypeVar("R")


class Kind(ABC, Generic[S, R]):
    """One kind: S is its section, R its recipe.

    `conditions` are those that it may say are not proven, `unread` the members of its section that are shown and not
    verified; `elastic` says whether a certificate tells how its least rate reacts to each constant, `adapts` whether it
    is about the adaptive loop, and so one of those that decide where all do.
    """

    key: ClassVar[str]
    conditions: ClassVar[tuple[str, ...]]
    unread: ClassVar[tuple[str, ...]] = ()
    elastic: ClassVar[bool] = False
    adapts: ClassVar[bool] = True

    @abstractmethod
    def read(self, node: Node, n: int) -> S:
        """The section of a system with n states; raises `CertificateError` for whatever is not of its form."""

    @abstractmethod
    def read_recipe(self, node: Node) -> R:
        """Its recipe in `result.proof`."""

    @abstractmethod
    def said(self, section: S) -> dict[str, object]:
        """What a reason may repeat of a section that is certified, `section` apart."""

    @abstractmethod
    def claims(self, section: S, recipe: R | None, ground: Ground) -> Iterator[Claim]:
        """Everything that is examined of it. One that is not certified does not claim its gains, but the rest."""

    def applies(self, specification: Specification) -> bool:
        """Whether a certificate of a specification has this section: not where its theorem has a B that is known."""
        return specification.plant.gained is None

    def uncovered(self, setting: Setting) -> str | None:
        """The condition that a section names, uncertified, where it does not cover the disturbance; None if it does."""
        searched = setting.wind is not None and setting.wind.bound is None
        return "wind_bound" if searched else None

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

    def ranges(self, section: S) -> Mapping[str, Range] | None:
        """Where each input stays, if the section states it itself; None if it is u* with the shares."""
        del section
        return None

    def projection_radii(self, section: S) -> Iterator[Fraction]:
        """R_H of every pair of gains that shares its controller with A and B."""
        del section
        yield from ()
