"""What a certificate promises about a loop, as numbers that a run can break; all that is known here of its kinds.

Implements: theory 4 and 4b, the bounds D(t), |k| <= du dbar, |xtilde| <= Dxt/sqrt(Gamma), |sigma_hat - h| <= Dh + R_H.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.kinds import ALONE, DISTANCE, HARDWARE, RATES, SAMPLED, Name
from tubecert.simulate.certified import Certified, Own, Section, Values
from tubecert.simulate.inputs import InputRange
from tubecert.simulate.loops import Controller
from tubecert.simulate.uncertainty import class_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """D(t) of theorem B: d(x*, x) <= D(t), from `delay` on; before it, the bound without any adaptation (theorem C)."""

    rate: float
    bandwidth: float
    start: float  # d0
    beta: float
    defect: float
    first: float  # H0
    rest: float  # S
    error: float = 0.0  # e, of the estimate, which is there from the start
    delay: float = 0.0

    def __call__(self, t: Array) -> Array:
        """D at times t (K,)."""
        before = self._idle(np.minimum(t, self.delay))
        tau = np.maximum(t - self.delay, 0.0)
        start = float(self._idle(np.array(self.delay)))
        settled = (self.beta * (self.rest + self.error) + self.defect) / self.rate
        gap = self.bandwidth - self.rate
        e_rate, e_band = np.exp(-self.rate * tau), np.exp(-self.bandwidth * tau)
        K = tau * e_rate if abs(gap) < 1e-9 * self.rate else (e_rate - e_band) / gap
        after = settled + (start - settled) * e_rate + self.beta * (self.first - self.rest) * K
        return np.asarray(np.where(t < self.delay, before, after))

    def _idle(self, t: Array) -> Array:
        pushed = (self.beta * self.first + self.defect) / self.rate
        return np.asarray(pushed + (self.start - pushed) * np.exp(-self.rate * t))


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """The levels of theorems HW, BW and CW: d(x*, x) is below the one of each window, at its ends too."""

    ends: tuple[float, ...]
    levels: tuple[float, ...]

    def __call__(self, t: Array) -> Array:
        """The level at times t (K,), the last one afterwards."""
        window = np.minimum(np.searchsorted(np.array(self.ends), t, side="left"), len(self.ends) - 1)
        return np.asarray(np.array(self.levels)[window])


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """Bounds of one loop: `rho`, `reach` = dbar, per-state `half_widths` (n,), and others by the names of peaks.

    `ultimate` is the radius in the long run, `decay` the bound of the distance over time; either may be missing.
    `ranges`: those of inputs that have limits; `output_widths` those of the outputs, in the order of the specification.
    """

    title: str
    rho: float
    reach: float
    half_widths: tuple[float, ...]
    bounds: Mapping[str, float]
    ultimate: float | None
    decay: Decay | Levels | None
    ranges: tuple[InputRange, ...] = ()
    output_widths: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """All that simulation needs to know of a kind of certificate.

    `controller` is the loop that it is about. `prediction_error` is the bound of |xtilde| and `decay` D(t), from what
    is certified and the recipe of the section; either is None where the kind proves none.
    """

    name: Name
    controller: Controller
    prediction_error: Callable[[Certified, Values], float | None]
    decay: Callable[[Certified, Values], Decay | None]


def kind_for(controller: Controller, wanted: str) -> Kind:
    """The kind whose gains a loop takes: the wanted one, but for a loop that it is not about the first that is."""
    own = KINDS[wanted]
    if controller == own.controller or all(controller != kind.controller for kind in KINDS.values()):
        return own
    return next(KINDS[key] for key in PREFERRED if KINDS[key].controller == controller)


def promise(certified: Certified, kind: Kind) -> Promise | None:
    """What a kind of certificate promises about its loop; None if it certifies nothing."""
    section = certified.proven(kind.name.key)
    if section is None:
        return None
    if section.own is not None:
        return _promise_of_machine(certified, kind, section, section.own)
    recipe = section.recipe
    k = certified["feedback_gain"] * certified.reach  # (2.3) |k| <= du dbar
    bounds = {
        "distance": certified.reach,  # d(x*, x) < dbar
        "deviation": certified.rho,  # 1.4 (i)
        "k": k,
        "u": certified["u_star"] + k,  # (0.4)
    }
    if kind.name.adapts:
        radius = recipe["projection_radius"]  # R_H
        bounds["u"] += radius  # |u_a| <= R_H
        bounds["sigma_error"] = certified["h"] + radius  # (2.10)
    error = kind.prediction_error(certified, recipe)
    if error is not None:
        bounds["xtilde"] = error
    whole = Promise(
        title=str(kind.name),
        rho=certified.rho,
        reach=certified.reach,
        half_widths=certified.half_widths,
        bounds=bounds,
        ultimate=section.ultimate,
        decay=None if section.windows else kind.decay(certified, recipe),
        ranges=section.ranges,
        output_widths=certified.output_widths,
    )
    return _in_windows(section, whole) if section.windows else whole


def _in_windows(section: Section, whole: Promise) -> Promise:
    """Theorems BW and CW: the widest of the windows, their levels, and |x'| <= Y."""
    own = section.windows
    narrower = {
        "distance": max(each.level for each in own),
        "deviation": max(each.radius for each in own),
        "speed": section.recipe["speed"],
    }
    return replace(
        whole,
        half_widths=tuple(map(max, zip(*(each.half_widths for each in own), strict=True))),
        bounds={**whole.bounds, **narrower},
        decay=Levels(ends=tuple(each.end for each in own), levels=tuple(each.level for each in own)),
    )


def _promise_of_machine(certified: Certified, kind: Kind, section: Section, own: Own) -> Promise:
    """Theorem H: d <= dhat, |kappa| <= kb, |h - q^| <= X, |x'| <= Y, and |q - h| of (H.6), (H.7) at the samples."""
    r, h, feedback = own.recipe, class_of(certified), certified["feedback_gain"] * certified.raised
    noise = float(r.noise) * certified["noise_metric"]  # n_M, and n_P of (H.17)
    noise = max(noise, math.sqrt(certified.upper or 0.0) * float(r.prediction or 0))
    moved = h.rate_at(float(r.speed)) * float(r.sample_time + r.delay)
    settled = max(float(r.bias), h.h_initial) + float(r.ripple)
    wait = float(max(r.sample_time, r.feedback_time) + r.delay)
    late = min(certified.constants.get("input_rate", 0.0) * wait, 2 * certified["u_star"])  # ups
    bounds = {
        "distance": float(r.level),
        "deviation": own.radius,
        "k": feedback * (float(r.level) + noise) + late,
        "sigma_error": min(h.h + float(r.clip_radius), max(min(h.h, h.h_initial + moved), settled + moved)),
        "estimate": settled,
        "speed": float(r.speed),
    }
    ends, levels = (tuple(column) for column in zip(*own.levels, strict=True)) if own.levels else ((), ())
    return Promise(
        title=str(kind.name),
        rho=certified.rho,
        reach=certified.reach,
        half_widths=own.half_widths,
        bounds=bounds,
        ultimate=section.ultimate,
        decay=Levels(ends=ends, levels=levels) if own.levels else None,
        ranges=section.ranges,
        output_widths=certified.output_widths,
    )


def _nothing(certified: Certified, recipe: Values) -> None:
    """The kind proves no such bound."""


def _error_of_paper(certified: Certified, recipe: Values) -> float:
    """Dxt/sqrt(Gamma), (2.11), with the certificate's own constant Dxt."""
    return certified["prediction_error"] / math.sqrt(recipe["adaptation_rate"])


def _error_of_speed(certified: Certified, recipe: Values) -> float | None:
    """Dxt/sqrt(Gamma), (2.11), with s1 = Dht + Dhx Y and q = 2 g, (7.8) beside a wind; None if A_m is not -g I."""
    if "predictor_gain" not in recipe:
        return None
    h = class_of(certified)
    s1, reach = h.rate_at(recipe["speed"]), h.h + recipe["projection_radius"]
    q, rate = 2 * recipe["predictor_gain"], recipe["adaptation_rate"]
    drag = certified.beside.size / q
    if not drag:
        return math.sqrt((2 * reach * s1 / q + reach**2) / rate)
    return math.hypot(reach / math.sqrt(rate), drag + math.sqrt(drag**2 + 2 * reach * s1 / (q * rate)))


def _decay_alone(certified: Certified, recipe: Values) -> Decay:
    """Theorem 0: (2.15) with nothing filtered away, H0 = S = Dh."""
    del recipe
    return Decay(
        bandwidth=2 * certified.rate, first=certified["h"], rest=certified["h"], **_common(certified)
    )


def _decay_of_distance(certified: Certified, recipe: Values) -> Decay:
    """(2.15) with H0, and S and e of the recipe."""
    return Decay(
        bandwidth=recipe["bandwidth"],
        first=certified["h_initial"],
        rest=recipe["uncertainty"],
        error=recipe["prediction_error"],
        **_common(certified),
    )


def _decay_of_sampled(certified: Certified, recipe: Values) -> Decay:
    """Theorem C: (2.15) from the first sample on, with H1 and S_T of (4.8) in place of H0 and S."""
    Ts, g, omega, Y = (recipe[name] for name in ("sample_time", "predictor_gain", "bandwidth", "speed"))
    h = class_of(certified)
    s1 = h.rate_at(Y)
    turned = min(certified["B_pinv"] * certified["B_x"], certified["B_pinv_x"] * certified["B"])  # b/Dh
    age = 1 / g - Ts / math.expm1(g * Ts) if g * Ts > 1e-6 else Ts / 2  # m of (4.6)
    rest = s1 * Ts / -math.expm1(-omega * Ts) + age * (s1 + turned * h.h * Y)  # S_T
    rest += certified.beside.taken + certified["B_pinv_x"] * certified.beside.size * age * Y  # (7.6)
    first = min(h.h, h.h_initial + s1 * Ts)  # H1
    return Decay(bandwidth=omega, first=first, rest=rest, delay=Ts, **_common(certified))


def _common(certified: Certified) -> dict[str, float]:
    """What D(t) has of the metric and of the plan, whatever adapts."""
    return {
        "rate": certified.rate,
        "start": certified["initial_distance"],
        "beta": certified["metric_input_gain"],
        "defect": certified["plan_defect_metric"] + certified.beside.push,
    }


KINDS: Final[Mapping[str, Kind]] = {
    kind.name.option: kind
    for kind in (
        Kind(
            name=ALONE,
            controller="ccm",
            prediction_error=_nothing,
            decay=_decay_alone,
        ),
        Kind(
            name=RATES,
            controller="l1",
            prediction_error=_error_of_paper,
            decay=_nothing,  # A bounds the tube only
        ),
        Kind(
            name=DISTANCE,
            controller="l1",
            prediction_error=_error_of_speed,
            decay=_decay_of_distance,
        ),
        Kind(
            name=SAMPLED,
            controller="sampled",
            prediction_error=_nothing,
            decay=_decay_of_sampled,
        ),
        Kind(
            name=HARDWARE,
            controller="hardware",
            prediction_error=_nothing,
            decay=_nothing,
        ),
    )
}
PREFERRED: Final = (
    DISTANCE.option,
    SAMPLED.option,
    RATES.option,
    ALONE.option,
    HARDWARE.option,
)  # where the kind that was asked for is not about the loop
