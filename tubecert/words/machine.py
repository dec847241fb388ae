"""What the parts of a machine are called, and what fills its tube."""

from __future__ import annotations

from collections.abc import Mapping

from tubecert.claims.advice import HardwareCause, HardwarePart

CAUSES: Mapping[HardwareCause | str, str] = {
    "plan": "the plan's own defect",
    "feedforward": "the input of the plan, held between samples",
    "wind": "wind that pushes",
    "wind_estimate": "wind that the estimate takes for uncertainty",
    "bias": "the filter's lag behind the uncertainty",
    "noise_estimate": "noise in the estimate",
    "lag": "the input's lag: delay, and holding between samples",
    "noise_feedback": "noise in the feedback",
    "sampling": "feedback that is sampled and delayed",
    "gain": "the gain of the inputs, that the estimate takes for uncertainty",
    "geodesic": "geodesics that are computed at a few nodes",
}

PARTS: Mapping[HardwarePart | str, str] = {
    "sample_time": "the sample time",
    "delay": "the delay",
    "noise": "the noise",
    "wind": "the wind",
    "limits": "the limits of the inputs",
}
