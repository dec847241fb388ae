"""What theorem H knows of the computer beside the constants of B: the machine, and its numbers in one arithmetic.

In: a problem whose specification has `hardware`. Out: numbers for the formulas of `conditions.hardware`. Every one of
these constants is a supremum, so that the safe side is the upper end. Trusted. Implements: theory section 8.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Generic

import numpy as np

from tubecert.bounds.constants import BoundConstants, ResidualConstants, WindConstants
from tubecert.bounds.covariant import CovariantConstants
from tubecert.bounds.hardware import HardwareConstants
from tubecert.conditions.arithmetic import Array, T
from tubecert.conditions.decimals import next_up, round_up
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Interval
from tubecert.spec import Hardware

RADIUS_DIGITS = 6
_LEAST_RADIUS = Fraction(1, 10**12)  # of the clip where h vanishes

Range = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A part of the plan, from `begin` to `end` in s, and every constant in it that theorem HW takes for its own.

    They hold for t in [since, end] and |x - x*| <= radius. `inputs`: the range of u* there.
    """

    begin: Fraction
    end: Fraction
    since: Fraction
    radius: Fraction
    constants: BoundConstants
    machine: HardwareConstants
    covariant: CovariantConstants | None
    wind: WindConstants | None
    residual: ResidualConstants | None
    inputs: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What the specification says of the hardware, with the constants that theorem H needs beside those of B.

    `clip`: per input a range that contains 0 and h over the tube; empty where only |h| <= Dh is known, and the estimate
    is clipped to a ball. `covariant`: where the metric is not constant, if they are known. `widths`: sup sqrt(W_ii) by
    state: |x_i - x_i*| <= widths[i] d; `inputs`: the range of u* on the plan, by input; both may be empty. `windows`:
    where theorem HW is asked for.
    """

    constants: HardwareConstants
    clip: tuple[Range, ...]
    asked: Hardware
    covariant: CovariantConstants | None = None
    widths: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    windows: tuple[Window, ...] = ()

    def __post_init__(self) -> None:
        if not all(low <= 0 <= high for low, high in self.clip):
            raise ValueError("the estimate is clipped to a box that contains 0")

    def clip_radius(self, h: Constant) -> Fraction:
        """R: the least decimal that bounds |v| over the set that the estimate is clipped to (theory 8.1)."""
        square = self._square(h)
        if square is None:
            return Fraction(1)  # serves nothing
        near = round_up(max(np.sqrt(float(square)), float(_LEAST_RADIUS)), RADIUS_DIGITS)
        return near if near**2 >= square else next_up(near, RADIUS_DIGITS)

    def clips_within(self, h: Constant, R: Fraction) -> bool:
        """Whether |v| <= R over the set that the estimate is clipped to, decided exactly, as theory 8.1 asks for."""
        square = self._square(h)
        return square is not None and R > 0 and square <= R**2

    def _square(self, h: Constant) -> Fraction | None:
        """R^2 at least: of the corner of the box that is farthest, or Dh^2; None if there is no bound, theory 8.1."""
        if self.clip:
            return sum((max(low**2, high**2) for low, high in self.clip), Fraction(0))
        return Fraction(h.above) ** 2 if np.isfinite(h.above) else None

    @property
    def unit(self) -> Fraction | None:
        """A radius r such that |n| <= r is within one unit of noise; None where no state is measured with noise."""
        noise = self.asked.noise
        if not isinstance(noise, tuple):
            return Fraction(1)
        return min((value for value in noise if value > 0), default=None)

    @property
    def drift(self) -> Fraction | None:
        """The bound of |n_k - n_(k-1)|/Ts in units of noise, 1/s, where one is given: v of (H.7)."""
        rate, unit = self.asked.noise_rate, self.unit
        if rate is None:
            return None
        return Fraction(0) if unit is None else rate / unit

    def unbounded(self) -> tuple[str, ...]:
        """The constants that have no finite bound, by field name."""
        found = {name: value for name, value, _ in self.constants.items() if name not in _MAY_BE_INFINITE}
        return tuple(name for name, value in found.items() if not np.isfinite(value.above))


_MAY_BE_INFINITE = ("input_rate",)  # where u* jumps; 2 sup |u*| takes its place


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineNumbers(Generic[T]):
    """The constants of `HardwareConstants` as numbers of one arithmetic, by symbol; None where one does not apply.

    Of `bent` there are all or none.
    """

    D_F: T
    D_Fx: T
    D_cx: T
    Ystar: T
    phi_rel: T
    phi_relM: T | None
    D_A: T | None
    D_pf: T
    D_Ft: T | None = None  # None where f is free of t
    D_pt: T | None = None
    n_E: T  # |n| of one unit of noise
    n_M: T  # |Theta n|
    n_B: T  # |B^+ n|
    Lus: T | None
    G: T
    L_G: T
    bent: Bent[T] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Bent(Generic[T]):
    """The constants of `CovariantConstants`, by symbol."""

    D_nX: T
    D_nF: T
    D_nb: T
    beta_O: T
    phi_M: T
    K_R: T


def proven(machine: Machine) -> MachineNumbers[Interval]:
    """The safe side: the theorem holds with these numbers, because each bounds its constant."""
    c = machine.constants
    return MachineNumbers(
        D_F=_most(c.feedback_slope),
        D_Fx=_most(c.feedback_curvature),
        D_cx=_most(c.plan_tilt),
        Ystar=_most(c.plan_speed),
        phi_rel=_most(c.drift_difference),
        phi_relM=None if c.drift_difference_metric is None else _most(c.drift_difference_metric),
        D_A=None if c.drift_slope_metric is None else _most(c.drift_slope_metric),
        D_pf=_most(c.drift_explained),
        D_Ft=None if c.feedback_drift is None else _most(c.feedback_drift),
        D_pt=None if c.drift_rate is None else _most(c.drift_rate),
        n_E=_most(c.noise_size),
        n_M=_most(c.noise_metric),
        n_B=_most(c.noise_explained),
        Lus=None if c.input_rate is None else _most(c.input_rate),
        G=_most(c.symbols),
        L_G=_most(c.symbols_slope),
        bent=None if machine.covariant is None else _bent(machine.covariant),
    )


def _bent(c: CovariantConstants) -> Bent[Interval] | None:
    """None where one has no bound: then nothing is gained by the others."""
    if not all(np.isfinite(value.above) for _, value, _ in c.items()):
        return None
    return Bent(
        D_nX=_most(c.drift_slope),
        D_nF=_most(c.form_slope),
        D_nb=_most(c.input_slope),
        beta_O=_most(c.input_gain),
        phi_M=_most(c.drift_metric),
        K_R=_most(c.curvature),
    )


def _most(constant: Constant) -> Interval:
    return Interval.exact(constant.above)


def floats(numbers: MachineNumbers[Interval]) -> MachineNumbers[Array]:
    """The same in floats, for the search."""
    values = {name: getattr(numbers, name) for name in MachineNumbers.__slots__ if name != "bent"}
    own = numbers.bent
    return MachineNumbers(
        **{name: None if x is None else x.hi for name, x in values.items()},
        bent=None if own is None else Bent(**{name: getattr(own, name).hi for name in Bent.__slots__}),
    )


def ones() -> MachineNumbers[Array]:
    """Every number 1: to record what the formulas ask for beside them."""
    values = {name: np.asarray(1.0) for name in MachineNumbers.__slots__ if name != "bent"}
    return MachineNumbers(**values, bent=None)
