"""Certificate H: noise, wind, sampled and delayed control, a bound of every input. Trusted.

THEOREM H. If dhat + n_M <= dbar, Y > phi + DB (kb + ups + X) + D_E wbar and dhat > max(d0, f0, d1, sup D), then
d(x*, x) < dhat and |x - x*| < dhat/sqrt(a) over the horizon, for every h, every wind and every noise of the class, with
a loop that is sampled, delayed and held. THEOREM H-P is the same for a feedback that acts on the predicted state. A
proof is a recipe, decimals for which (H.6)-(H.12), (H.17) are verified; larger Y, S, N, np prove the same. A recipe
that fails refutes nothing. Implements: theory section 8.
"""

from __future__ import annotations

from tubecert.conditions.hardware.estimation import estimate
from tubecert.conditions.hardware.evaluation import Evaluated, evaluated
from tubecert.conditions.hardware.feedback import metric_gust
from tubecert.conditions.hardware.loop import (
    HardwareRecipe,
    Loop,
    Plant,
    Rounding,
    WindowProof,
    loop_of,
    plant,
)
from tubecert.conditions.hardware.theorem import LEVEL, STAYS, THEOREM, margins_hardware
from tubecert.conditions.hardware.told import Budget, Told, told, told_in_windows

__all__ = [
    "LEVEL",
    "STAYS",
    "THEOREM",
    "Budget",
    "Evaluated",
    "HardwareRecipe",
    "Loop",
    "Plant",
    "Rounding",
    "Told",
    "WindowProof",
    "estimate",
    "evaluated",
    "loop_of",
    "margins_hardware",
    "metric_gust",
    "plant",
    "told",
    "told_in_windows",
]
