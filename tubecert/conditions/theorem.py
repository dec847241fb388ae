"""A theorem as the kernel sees it: what its recipes are, and what has to be positive for a recipe to prove it.

A `Proposal` is what a search hands over: recipes to be checked, and what it met on the way. None of it is believed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from fractions import Fraction
from typing import Any, ClassVar, Generic, Protocol, TypeVar, cast

import numpy as np

from tubecert.conditions.arithmetic import Array
from tubecert.conditions.inputs import InputShares
from tubecert.conditions.problem import FIELDS, Numbers, Shortfall, TubeProblem
from tubecert.enclosure.interval import Interval

Margins = Mapping[str, Interval]
"""By condition, shape `(len(recipes),)`: (allowed - needed)/allowed, a proven lower end and what it can be at most."""


class Recipe(Protocol):
    """The gains that a claim is about, and the auxiliary numbers of its proof: a dataclass of exact decimals.

    Where the loop has a predictor A_m = -g I its gain g is called `predictor_gain`.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


R = TypeVar("R", bound=Recipe)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopGains:
    """The gains of an adaptive loop: omega in rad/s, Gamma in 1/s^2, the g of A_m = -g I in 1/s, R_H."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction

    @property
    def gains(self) -> dict[str, Fraction]:
        """The gains alone, by name."""
        return {item.name: getattr(self, item.name) for item in fields(LoopGains)}


def _nothing(problem: TubeProblem) -> tuple[Shortfall, ...]:
    del problem
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Theorem(Generic[R]):
    """What is proven in docs/theory, as functions of a problem and a recipe.

    `margins`: the theorem holds with a recipe if each is positive. `ceilings`: bounds from above that hold for every
    recipe with the same gains, so that one that is not positive refutes the gains. `obstacles`: what no gains can
    overcome. `provisos`: why the formulas that the problem asks for prove nothing, if so. `formula`: everything that
    the margins contain, in floats at some gains, to record which constants it needs. `ultimate`: |x - x*| is at most
    this in the long run, for a recipe that is proven. `inputs`: what the loop adds to u* at most, for a recipe that is
    proven; without it inputs have no bound. `sizes`: what of a recipe may be 0, all else being gains.
    """

    recipe: type[R]
    margins: Callable[[TubeProblem, Sequence[R]], Margins]
    ceilings: Callable[[TubeProblem, R], Mapping[str, float]]
    formula: Callable[[TubeProblem, Numbers[Array]], object]
    obstacles: Callable[[TubeProblem], tuple[Shortfall, ...]] = _nothing
    provisos: Callable[[TubeProblem], tuple[Shortfall, ...]] = _nothing
    ultimate: Callable[[TubeProblem, R], float | None] | None = None
    inputs: Callable[[TubeProblem, R], InputShares | None] | None = None
    sizes: tuple[str, ...] = ("speed", "prediction_error", "uncertainty")

    def states(self, problem: TubeProblem, recipe: object) -> bool:
        """Whether the theorem is stated for a recipe: its kind, its signs, its predictor.

        The theorems are stated for positive gains; a negative g would make q = 2 g, and with it the bound of the
        prediction error, smaller than it is.
        """
        if type(recipe) is not self.recipe:
            return False
        numbers = {item.name: getattr(recipe, item.name) for item in fields(recipe)}
        signed = all(
            isinstance(x, Fraction) and (x >= 0 if name in self.sizes else x > 0)
            for name, x in numbers.items()
        )
        given = problem.predictor_gain
        return signed and (given is None or numbers.get("predictor_gain", given) == given)

    def needs(self, problem: TubeProblem) -> frozenset[str]:
        """The constants that the formulas contain with the options of the problem, by field name; recorded."""
        recorder = _Recorder()
        self.formula(problem, cast("Numbers[Array]", recorder))
        return frozenset(FIELDS[symbol] for symbol in recorder.asked if symbol in FIELDS)

    def unbounded(self, problem: TubeProblem) -> tuple[str, ...]:
        """The constants that it needs and that have no finite bound, by field name."""
        constants = problem.constants
        beside = problem.unbounded_wind()
        if all(np.isfinite(getattr(constants, field).above) for field in FIELDS.values()):
            return beside
        own = sorted(x for x in self.needs(problem) if not np.isfinite(getattr(constants, x).above))
        return (*own, *beside)


class _Recorder:
    """Stands for `Numbers`: every number is 1, and it is remembered which were asked for."""

    def __init__(self) -> None:
        self.asked: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        if name not in Numbers.__slots__:
            raise AttributeError(name)
        if name == "horizon" or name.startswith(("wind_", "rest_")):
            return None
        # R_H is chosen from sup |h|
        self.asked.add("Dh" if name == "R" else name)
        return np.asarray(1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """`gains` that a user fixes, omega in rad/s and Gamma in 1/s^2; without them they are searched for.

    `curve`: whether one is wanted.
    """

    gains: tuple[Fraction, Fraction] | None = None
    curve: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal(Generic[R]):
    """Recipes of one theorem.

    `decisive`: the one that the verdict is to be about, in the `role` that it has among the gains of its kind.
    `beside`: others by role. `companion`: a recipe of another theorem at the decisive gains, for their ultimate radius.
    `curve`: a trade-off; `around`: other bandwidths at the decisive gains; each of them shares one projection radius.
    `infimum`: the least bandwidth that (26a), (26b) admit, and which of them `binds` there.
    """

    decisive: R | None = None
    role: str = ""
    beside: Mapping[str, R] = field(default_factory=dict)
    companion: Any = None
    curve: tuple[R, ...] = ()
    around: tuple[R, ...] = ()
    infimum: float | None = None
    binds: str | None = None
