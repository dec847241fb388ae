"""What a search hands over: recipes to be checked, and what it met on the way. None of it is believed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Generic

from tubecert.conditions.theorem import R


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Gains that a user fixes, in rad/s and 1/s^2; what is None is searched for. `curve`: whether one is wanted."""

    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    curve: bool = True

    def __bool__(self) -> bool:
        return not (self.bandwidth is None and self.adaptation_rate is None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal(Generic[R]):
    """Recipes of one theorem.

    `decisive`: the one that the verdict is to be about, in the `role` that it has among the gains of its kind.
    `hopeless`: where there is none, one that stands for all that could still be chosen (a rate without bound): if it is
    refuted, so is what was asked for. `beside`: others by role. `companion`: a recipe of
    another theorem at the decisive gains, for their ultimate radius. `curve`: a trade-off; `around`: other bandwidths
    at the decisive gains; each of them shares one projection radius. `infimum`: the least bandwidth that (26a), (26b)
    admit, and which of them `binds` there.
    """

    decisive: R | None = None
    role: str = ""
    hopeless: R | None = None
    beside: Mapping[str, R] = field(default_factory=dict)
    companion: Any = None
    curve: tuple[R, ...] = ()
    around: tuple[R, ...] = ()
    infimum: float | None = None
    binds: str | None = None

    def at(self, role: str) -> R | None:
        """The recipe in a role."""
        return self.decisive if role == self.role else self.beside.get(role)
