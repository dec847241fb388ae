"""A machine for theorem H: its constants, what is promised of it, and the numbers of a recipe."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from fractions import Fraction

from tubecert.recheck.balls import Ball
from tubecert.recheck.specified.hardware import Arcs


@dataclass(frozen=True, slots=True, kw_only=True)
class Bent:
    """The constants of a metric that is not constant, measured by itself, as balls by their names in a certificate."""

    drift_slope: Ball
    form_slope: Ball
    input_slope: Ball
    input_gain: Ball
    drift_metric: Ball
    curvature: Ball


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineNumbers:
    """The constants that only theorem H has, as balls by their names in a certificate; None where one is not stated."""

    feedback_slope: Ball
    feedback_curvature: Ball
    plan_tilt: Ball
    plan_speed: Ball
    plan_defect: Ball
    drift_difference: Ball
    drift_difference_metric: Ball | None
    drift_slope_metric: Ball | None
    drift_explained: Ball
    noise_size: Ball
    noise_metric: Ball
    noise_explained: Ball
    feedback_drift: Ball | None
    drift_rate: Ball | None
    input_rate: Ball | None
    symbols: Ball
    symbols_slope: Ball
    bent: Bent | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """What the specification promises of the machine beside the numbers of a recipe.

    `held`: u* is held between samples; `predicts`: feedback from a predicted state; `drift`: a bound of
    |n_k - n_(k-1)|/Ts in units of noise, if there is one. `arcs`: how geodesics are computed; None: they are exact.
    """

    held: bool
    predicts: bool
    drift: Fraction | None
    arcs: Arcs | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """The numbers of a proof in one window of the plan."""

    level: Fraction
    floor: Fraction
    speed: Fraction
    bias: Fraction
    ripple: Fraction
    prediction: Fraction | None

    def of(self, whole: Digital) -> Digital:
        """The recipe as if this window were all."""
        own = {item.name: getattr(self, item.name) for item in fields(self)}
        return replace(whole, windows=(), **own)


@dataclass(frozen=True, slots=True, kw_only=True)
class Losses:
    """What the arithmetic of the controller may lose: of alpha/2 + c'kappa, the input, sigma, the predicted state."""

    feedback: Fraction
    input: Fraction
    estimate: Fraction
    prediction: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Digital:
    """The numbers of a recipe; times in s. `bandwidth` None: the filter forgets at once (omega is infinite).

    `losses` None: the controller is exact.

    With `windows` those of the proof are the largest of theirs.
    """

    sample_time: Fraction
    delay: Fraction
    feedback_time: Fraction
    bandwidth: Fraction | None
    noise: Fraction
    wind: Fraction
    clip_radius: Fraction
    level: Fraction
    floor: Fraction
    speed: Fraction
    bias: Fraction
    ripple: Fraction
    prediction: Fraction | None
    windows: tuple[Stretch, ...] = ()
    losses: Losses | None = None

    @property
    def sensible(self) -> bool:
        """Whether all are of the sign and order that the theorem asks for."""
        above = (self.sample_time, self.feedback_time, self.level, self.floor, self.speed, self.clip_radius)
        others = (self.delay, self.noise, self.wind, self.bias, self.ripple, self.prediction or Fraction(0))
        filters = self.bandwidth is None or self.bandwidth > 0
        late = self.delay > self.sample_time
        if self.prediction is not None:
            late = late or self.delay > self.feedback_time
        if self.losses is not None:
            others = (*others, *(getattr(self.losses, item.name) for item in fields(Losses)))
        return min(above) > 0 and min(others) >= 0 and filters and not late
