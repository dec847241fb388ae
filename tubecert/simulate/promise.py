"""What a certificate promises about a loop, as numbers that a run can break.

Implements: theory 4 and 4b, the bounds D(t), |k| <= du dbar, |xtilde| <= Dxt/sqrt(Gamma), |sigma_hat - h| <= Dh + R_H.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.certified import Result, above, number

SECTIONS: Final = {"26": "conditions_26", "distance": "distance", "sampled": "sampled"}
TITLES: Final = {"26": "A (26)", "distance": "B distance", "sampled": "C sampled"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """D(t) of theorem B: d(x*, x) <= D(t), from `delay` on; before it, the bound without any adaptation (theorem C)."""

    rate: float
    bandwidth: float
    start: float  # d0
    beta: float
    defect: float
    first: float  # H0
    rest: float  # S + e_eta
    delay: float = 0.0

    def __call__(self, t: Array) -> Array:
        """D at times t (K,)."""
        before = self._idle(np.minimum(t, self.delay))
        tau = np.maximum(t - self.delay, 0.0)
        start = float(self._idle(np.array(self.delay)))
        settled = (self.beta * self.rest + self.defect) / self.rate
        gap = self.bandwidth - self.rate
        e_rate, e_band = np.exp(-self.rate * tau), np.exp(-self.bandwidth * tau)
        K = tau * e_rate if abs(gap) < 1e-9 * self.rate else (e_rate - e_band) / gap
        after = settled + (start - settled) * e_rate + self.beta * (self.first - self.rest) * K
        return np.asarray(np.where(t < self.delay, before, after))

    def _idle(self, t: Array) -> Array:
        pushed = (self.beta * self.first + self.defect) / self.rate
        return np.asarray(pushed + (self.start - pushed) * np.exp(-self.rate * t))


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """Bounds of one loop: `rho`, `reach` = dbar, per-state `half_widths` (n,), and others by the names of peaks.

    `ultimate` is the radius in the long run, `decay` the bound of the distance over time; either may be missing.
    """

    title: str
    rho: float
    reach: float
    half_widths: tuple[float, ...]
    bounds: Mapping[str, float]
    ultimate: float | None
    decay: Decay | None


def promise(result: Result, which: str) -> Promise | None:
    """What certificate A, B or C (`26`, `distance`, `sampled`) promises; None if it certifies nothing."""
    section = result.get(SECTIONS[which])
    recipe = result["proof"].get(SECTIONS[which])
    if result["formulas"] != "corrected" or not section or section["verdict"] != "certified" or not recipe:
        return None
    proof = {name: number(value) for name, value in recipe.items() if value is not None}
    tube = result["tube"]
    rho = number(tube["rho"])
    reach = math.sqrt(result["metric"]["lower"][0]) * rho
    radius = proof["projection_radius"]
    k = above(result, "feedback_gain") * reach
    bounds = {
        "distance": reach,
        "deviation": rho,
        "k": k,
        "u": above(result, "u_star") + k + radius,
        "sigma_error": above(result, "h") + radius,
    }
    error = _prediction_error(result, which, proof)
    if error is not None:
        bounds["xtilde"] = error
    ultimate = section.get("ultimate_radius")
    return Promise(
        title=TITLES[which],
        rho=rho,
        reach=reach,
        half_widths=tuple(float(width) for width in tube["half_widths"].values()),
        bounds=bounds,
        ultimate=None if ultimate is None else float(ultimate),
        decay=_decay(result, which, proof),
    )


def _prediction_error(result: Result, which: str, proof: Mapping[str, float]) -> float | None:
    """Dxt/sqrt(Gamma); None where it is not proven for these gains."""
    if which == "sampled":
        return None
    if which == "26":
        return above(result, "prediction_error") / math.sqrt(proof["adaptation_rate"])
    if "predictor_gain" not in proof:
        return None
    s1 = above(result, "h_t") + above(result, "h_x") * proof["speed"]
    reach = above(result, "h") + proof["projection_radius"]
    square = 2 * reach * s1 / (2 * proof["predictor_gain"]) + reach**2
    return math.sqrt(square / proof["adaptation_rate"])


def _decay(result: Result, which: str, proof: Mapping[str, float]) -> Decay | None:
    if which == "26":
        return None  # A bounds the tube only
    common: dict[str, Any] = {
        "rate": number(result["metric"]["rate"]),
        "bandwidth": proof["bandwidth"],
        "start": above(result, "initial_distance"),
        "beta": above(result, "metric_input_gain"),
        "defect": above(result, "plan_defect_metric"),
    }
    h0 = above(result, "h_initial")
    if which == "distance":
        return Decay(first=h0, rest=proof["uncertainty"] + proof["prediction_error"], **common)
    Ts, g, omega = proof["sample_time"], proof["predictor_gain"], proof["bandwidth"]
    s1 = above(result, "h_t") + above(result, "h_x") * proof["speed"]
    turned = min(
        above(result, "B_pinv") * above(result, "B_x"), above(result, "B_pinv_x") * above(result, "B")
    )
    age = 1 / g - Ts / math.expm1(g * Ts) if g * Ts > 1e-6 else Ts / 2
    rest = s1 * Ts / -math.expm1(-omega * Ts) + age * (s1 + turned * above(result, "h") * proof["speed"])
    return Decay(first=min(above(result, "h"), h0 + s1 * Ts), rest=rest, delay=Ts, **common)
