"""The constants of certificates A, B and C that theorem HW needs over a part of the tube.

Each is the smaller of what is bounded over the part and of the bound over the whole tube, which holds there too.
In: suprema over the part, the constants of the whole. Out: constants, each an enclosure. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TypeVar

from tubecert.bounds.constants import TABLE, BoundConstants, Constant
from tubecert.bounds.start import InitialState
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.wind import Beside, uncertainty_constants

R = TypeVar("R")


def part_constants(
    suprema: Suprema, start: InitialState, whole: BoundConstants, declared: Mapping[str, Constant]
) -> BoundConstants:
    """The constants of theorem H over a part of the tube; what it does not need, and the start, are of the whole."""
    lower, upper = suprema.metric_bounds()
    delta_p, delta = suprema.plan_defect()
    found = {
        "lower": lower,
        "upper": upper,
        "u_star": suprema.input_on_plan(),
        "feedback_gain": suprema.feedback_gain(),
        "metric_input_gain": suprema.metric_input_gain(),
        "drift_on_plan": suprema.drift_on_plan(),
        "plan_defect": delta_p,
        "plan_defect_metric": delta,
        **_of_input(suprema),
        **_of_uncertainty(suprema, start, declared),
    }
    return less(whole, replace(whole, **{name: value.printable() for name, value in found.items()}))


def _of_input(suprema: Suprema) -> dict[str, Constant]:
    """Those of B, where it is not the same everywhere."""
    if suprema.model.constant_input:
        return {}
    own = suprema.fields
    return {
        "B": suprema.norms("B", [own.B]),
        "B_x": suprema.norms("B_x", own.B_x),
        "B_pinv": suprema.norms("B_pinv", [own.B_pinv]),
        "B_pinv_x": suprema.norms("B_pinv_x", own.B_pinv_x),
    }


def _of_uncertainty(
    suprema: Suprema, start: InitialState, declared: Mapping[str, Constant]
) -> dict[str, Constant]:
    """Those of h; what is declared holds for the whole tube."""
    if Beside(suprema.fields).joins_uncertainty:
        found = uncertainty_constants(suprema, start, declared)
    elif suprema.model.h is not None:
        found = dict(zip(("h", "h_x", "h_t"), suprema.uncertainty(), strict=True))
    else:
        found = {}
    return {name: value for name, value in found.items() if name in ("h", "h_x", "h_t")}


def less(whole: R, part: R) -> R:
    """Of two records of constants, the sharper bound of each: from above, but for infima from below."""
    changed: dict[str, Constant] = {}
    for item in fields(part):  # type: ignore[arg-type]
        old, new = getattr(whole, item.name), getattr(part, item.name)
        if old is None or new is None:
            continue
        infimum = isinstance(part, BoundConstants) and TABLE[item.name].side == "below"
        changed[item.name] = replace(
            new,
            below=max(old.below, new.below) if infimum else new.below,
            above=new.above if infimum else min(old.above, new.above),
        )
    return replace(part, **changed)  # type: ignore[type-var]
