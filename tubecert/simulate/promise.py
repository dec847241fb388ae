"""What a certificate promises about a loop, as numbers that a run can break; all that is known here of its kinds.

Implements: theory 4, the bounds D(t), |k| <= du dbar, |xtilde| <= Dxt/sqrt(Gamma), |sigma_hat - h| <= Dh + R_H.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.kinds import ALONE, DISTANCE, RATES, Name
from tubecert.simulate.certified import Certified, Values
from tubecert.simulate.inputs import InputRange
from tubecert.simulate.loops import Controller
from tubecert.simulate.uncertainty import class_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """D(t) of theorems 0 and B: d(x*, x) <= D(t), (2.15)."""

    rate: float
    bandwidth: float
    start: float  # d0
    beta: float
    defect: float
    first: float  # H0
    rest: float  # S
    error: float = 0.0  # e, of the estimate, which is there from the start

    def __call__(self, t: Array) -> Array:
        """D at times t (K,)."""
        settled = (self.beta * (self.rest + self.error) + self.defect) / self.rate
        gap = self.bandwidth - self.rate
        e_rate, e_band = np.exp(-self.rate * t), np.exp(-self.bandwidth * t)
        K = t * e_rate if abs(gap) < 1e-9 * self.rate else (e_rate - e_band) / gap
        return np.asarray(
            settled + (self.start - settled) * e_rate + self.beta * (self.first - self.rest) * K
        )


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
    decay: Decay | None
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
    return Promise(
        title=str(kind.name),
        rho=certified.rho,
        reach=certified.reach,
        half_widths=certified.half_widths,
        bounds=bounds,
        ultimate=section.ultimate,
        decay=kind.decay(certified, recipe),
        ranges=section.ranges,
        output_widths=certified.output_widths,
    )


def _nothing(certified: Certified, recipe: Values) -> None:
    """The kind proves no such bound."""


def _error_of_paper(certified: Certified, recipe: Values) -> float:
    """Dxt/sqrt(Gamma), (2.11), with the certificate's own constant Dxt."""
    return certified["prediction_error"] / math.sqrt(recipe["adaptation_rate"])


def _error_of_speed(certified: Certified, recipe: Values) -> float:
    """Dxt/sqrt(Gamma), (2.11), with s1 = Dht + Dhx Y and q = 2 g, (7.8) beside a wind."""
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
    )
}
# where the kind that was asked for is not about the loop
PREFERRED: Final = (DISTANCE.option, RATES.option, ALONE.option)
