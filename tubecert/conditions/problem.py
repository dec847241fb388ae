"""The question that the conditions answer: constants over a tube, its radii, and the options of the loop.

A `TubeProblem` is exact data. `Numbers` is the same data in one arithmetic: as floats on the safe side
(search), as point intervals on the safe side (what is proven), or as full enclosures (what cannot be
excluded).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Generic

import numpy as np

from tubecert.bounds.constants import (
    TABLE,
    BoundConstants,
    Constant,
    Meaning,
    ResidualConstants,
    WindConstants,
)
from tubecert.conditions.arithmetic import Array, T, minimum
from tubecert.enclosure.constant import next_up, round_up
from tubecert.enclosure.interval import Interval

Side = Callable[[str, Constant], Interval]
_ROUNDING = 1 + Fraction(1, 10**9)  # what a caller who rounds rho may miss; `proven` corrects for it
_LEAST_RADIUS = 1e-12  # of R_H where h vanishes: keeps every quotient defined
RADIUS_DIGITS = 6  # of R_H: more than for the gains, because every digit dropped makes every constant larger


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers(Generic[T]):
    """Constants, radii and options as numbers of one arithmetic; names are the paper's symbols.

    `delta` and `phi` contain what unknown parameters add to them, `rest_speed` (theory 7). What a wind does stands
    beside them: None without wind.
    """

    a: T
    A: T
    Df: T
    Dfx: T
    DB: T
    DBx: T
    Dbx: T
    DBp: T
    DBpx: T
    DMx: T
    Dus: T
    Dh: T
    Dhx: T
    Dht: T
    du: T
    beta: T
    phi: T
    d0: T
    delta: T
    H0: T
    R: T  # the radius of the projection
    lam: T
    rho: T
    rho_a: T
    rho_r: T
    horizon: T | None
    wind_push: T | None = None  # beta_w |w|
    wind_speed: T | None = None  # D_E |w|
    wind_error: T | None = None  # eps_w |w|
    wind_matched: T | None = None  # |B B^+ E w| for a constant B
    rest_speed: T | None = None  # D_r
    rest_matched: T | None = None  # 0 for a constant B


# the name of a constant in the formulas -> its field of `BoundConstants`
FIELDS: Final = {meaning.number: name for name, meaning in TABLE.items() if meaning.number}
_INFIMA: Final = {meaning.number for meaning in TABLE.values() if meaning.side == "below"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wind:
    """What acts beside the inputs, E w: |w| <= `bound`, and what it does per unit of |w|."""

    bound: Fraction
    constants: WindConstants

    @property
    def pushes(self) -> bool:
        """Whether anything of E is left: it may be that all of it is a part of h."""
        return self.constants.size.above > 0 and self.bound != 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeProblem:
    """Constants that hold over O(rho), and everything else that the conditions need.

    `predictor_gain` is the g of the predictor A_m = -g I, None for `auto` (each certificate takes its best). P = I.
    `smooth` is the boundary layer nu of a smooth projection, None for the hard one. `states` is n. `rho_r`
    may be any number with rho_r + rho_a <= rho. `gained`: whether B depends on parameters that are not known, of which
    no theorem here knows. Raises `ValueError` for inconsistent radii or a gain that is not positive.
    """

    constants: BoundConstants
    rate: Fraction
    epsilon: Fraction
    rho_a: Fraction
    rho_r: Interval | Fraction
    rho: Fraction
    horizon: Fraction | None = None
    states: int = 1
    predictor_gain: Fraction | None = None
    smooth: Fraction | None = None
    wind: Wind | None = None
    residual: ResidualConstants | None = None
    gained: bool = False

    def __post_init__(self) -> None:
        if min(self.rate, self.rho_a, self.epsilon) <= 0:
            raise ValueError("rate, epsilon and rho_a must be positive")
        if Fraction(float(_interval(self.rho_r).lo)) + self.rho_a > Fraction(self.rho) * _ROUNDING:
            raise ValueError("rho must be at least rho_r + rho_a")
        if self.constants.lower.below <= 0:
            raise ValueError("the metric must be positive definite on the tube")
        if self.predictor_gain is not None and self.predictor_gain <= 0:
            raise ValueError("A_m = -g I is stable for g > 0 only")

    @property
    def projection_radius(self) -> Fraction:
        """R_H: a decimal >= sqrt(1 + nu) Dh, the least that the projection of A and B needs, (2.10)."""
        least = np.sqrt(float(1 + (self.smooth or 0))) * self.constants.h.above
        if not np.isfinite(least):
            return Fraction(1)  # serves nothing
        radius = round_up(max(least, _LEAST_RADIUS), RADIUS_DIGITS)
        return radius if self.radius_serves(radius) else next_up(radius, RADIUS_DIGITS)

    @property
    def constant_input(self) -> bool:
        """Whether B is proven to be the same everywhere in the tube."""
        return self.constants.B_x.above == 0

    def radius_serves(self, R_H: Fraction) -> bool:
        """Whether R_H >= sqrt(1 + nu) Dh, decided exactly, (2.10)."""
        if not np.isfinite(self.constants.h.above):
            return False
        return R_H > 0 and (1 + (self.smooth or 0)) * Fraction(self.constants.h.above) ** 2 <= R_H**2

    def floats(self, R_H: Fraction | None = None) -> Numbers[Array]:
        """The safe side in floats, for the search."""
        safe = self.proven(R_H)
        values = {
            name: None if (x := getattr(safe, name)) is None else (x.lo if name in _SMALL_IS_SAFE else x.hi)
            for name in Numbers.__slots__
        }
        return Numbers(**values)

    def proven(self, R_H: Fraction | None = None) -> Numbers[Interval]:
        """The safe side: the theorems hold with these numbers, because each bounds its constant.

        As theory 2.11 asks of the radii.
        """
        safe = self._numbers(lambda name, c: Interval.exact(c.below if name in _INFIMA else c.above), R_H)
        rho_r = np.minimum(safe.rho_r.lo, (safe.rho - safe.rho_a).lo)  # the proof needs rho_r + rho_a <= rho
        return replace(safe, rho_r=Interval.exact(rho_r))

    def enclosed(self, R_H: Fraction | None = None) -> Numbers[Interval]:
        """Enclosures of the constants themselves, for what cannot be excluded."""
        return self._numbers(lambda _, c: Interval(c.below, c.above), R_H)

    def _numbers(self, side: Side, R_H: Fraction | None) -> Numbers[Interval]:
        named = {symbol: side(symbol, getattr(self.constants, field)) for symbol, field in FIELDS.items()}
        radius = self.projection_radius if R_H is None else R_H
        found = self._of_problem(named, radius)
        return self._with_residual(self._with_wind(found, side), side)

    def _of_problem(self, named: dict[str, Interval], radius: Fraction) -> Numbers[Interval]:
        return Numbers(
            **named,
            R=Interval.of(radius),
            lam=Interval.of(self.rate),
            rho=_interval(self.rho),
            rho_a=Interval.of(self.rho_a),
            rho_r=_interval(self.rho_r),
            horizon=None if self.horizon is None else Interval.of(self.horizon),
        )

    def _with_wind(self, n: Numbers[Interval], side: Side) -> Numbers[Interval]:
        """Beside the constants of the tube, what the wind does, (7.2), (7.7)."""
        if self.wind is None:
            return n
        own, size = self.wind.constants, Interval.of(self.wind.bound)
        push, speed, error = (
            side(name, value) * size
            for name, value in (("push", own.push), ("size", own.size), ("explained", own.explained))
        )
        return replace(
            n,
            wind_push=push,
            wind_speed=speed,
            wind_error=error,
            wind_matched=minimum(speed, n.DB * error) if self.constant_input else speed,
        )

    def _with_residual(self, n: Numbers[Interval], side: Side) -> Numbers[Interval]:
        """What unknown parameters do beside the inputs is a part of delta and of phi, (7.3), (7.4)."""
        if self.residual is None:
            return n
        push, size = side("push", self.residual.push), side("size", self.residual.size)
        return replace(
            n,
            delta=n.delta + push,
            phi=n.phi + size,
            Df=n.Df + size,
            rest_speed=size,
            rest_matched=0 * size if self.constant_input else size,
        )

    def unbounded_wind(self) -> tuple[str, ...]:
        """What a wind or unknown parameters do, if it has no finite bound, by its name in a certificate."""
        return tuple(name for name, value, _ in self.beside() if not np.isfinite(value.above))

    def beside(self) -> list[tuple[str, Constant, Meaning]]:
        """What is beside the known model: constants of wind and of unknown parameters, as `BoundConstants.items`."""
        wind = [] if self.wind is None else self.wind.constants.items()
        rest = [] if self.residual is None else self.residual.items()
        return wind + rest


_SMALL_IS_SAFE = _INFIMA | {"rho_r", "rho_a", "lam"}


def _interval(value: Interval | Fraction) -> Interval:
    return Interval.of(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shortfall:
    """A claim that is not proven: its margin (relative to what is allowed), both sides where known.

    `claim` is `26a`, `26b`, `26c`, `distance` at gains asked for; `26a`, `initial_distance`, `plan_defect`,
    `parameters`, `wind` where no gains can help; `wind_not_covered` where nothing follows for a wind;
    `gain_not_covered` where nothing follows for an uncertain B; `bounded` where `constant` has no finite bound;
    `proven_gains` where the search failed (see `ConditionHolds`).
    """

    claim: str
    margin: Interval
    constant: str | None = None
    allowed: float | None = None
    needed: float | None = None

    @property
    def missing(self) -> float | None:
        """By how much more is needed than allowed, where both are known."""
        return None if self.allowed is None or self.needed is None else self.needed - self.allowed


UNKNOWN = Interval(-np.inf, np.inf)

NOTHING_FOUND = (Shortfall(claim="proven_gains", margin=UNKNOWN),)


def unbounded(names: Iterable[str]) -> tuple[Shortfall, ...]:
    """One reason per constant without a finite bound: nothing follows from it, either way."""
    return tuple(Shortfall(claim="bounded", constant=name, margin=UNKNOWN) for name in names)
