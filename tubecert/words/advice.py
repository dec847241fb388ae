"""What would help, as one sentence.

What changes a number is told (`halving Dh ... would lower ...`), what can be done is asked for (`raise --budget, or
lower metric.rate`), and what is wrong with the plan comes last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tubecert.bounds.meanings import EVERY
from tubecert.claims.advice import (
    AskForRateBelow,
    AskForRateUpTo,
    ConstantInputs,
    CorrectPlan,
    DeclareMetricBound,
    DeclareUncertaintyBound,
    EaseHardware,
    EnlargeSafeSet,
    GiveInput,
    HalveConstant,
    HalveHardware,
    HigherDegree,
    Knob,
    LeavePlanRoom,
    LessenCause,
    LowerDegree,
    LowerRate,
    MendPlan,
    MoreKnots,
    NoKnobAlone,
    OtherInterpolation,
    OtherMetric,
    OtherVariables,
    PlanRemedy,
    RaiseBudget,
    RaiseConditionNumber,
    ReduceInitialError,
    ReduceRadii,
    ShrinkSafeSet,
    ShrinkTube,
    TakeWindows,
    TurnKnob,
)
from tubecert.claims.family import Relax
from tubecert.digits import down, near, up
from tubecert.words.machine import CAUSES, PARTS


def advice(items: Sequence[Relax], h: Sequence[str] = ()) -> str:
    """What would help; empty if nothing is known to. `h`: the expressions of the uncertainty, as they are written."""
    about_h = next(
        (item for item in items if isinstance(item, HalveConstant) and item.constant in _OF_H), None
    )
    halvings = ", ".join(
        _halving(item, h if item is about_h else ()) if isinstance(item, HalveConstant) else _better(item)
        for item in items
        if isinstance(item, (HalveConstant, HalveHardware))
    )
    turns = _turns([item for item in items if isinstance(item, TurnKnob)])
    plans = [_plan(item) for item in items if isinstance(item, MendPlan)]
    causes = _filled([item for item in items if isinstance(item, LessenCause)])
    others = [item for item in items if not isinstance(item, _SAID_APART)]
    windows = [_windows(item) for item in items if isinstance(item, TakeWindows)]
    return "; ".join(filter(None, (halvings, turns, _alternatives(others), *windows, causes, *plans)))


def _alternatives(items: Sequence[Relax]) -> str:
    tried = [item for item in items if isinstance(item, _TRIED) and _is_known(item)]
    if tried:
        return "try " + "; or ".join(map(_action, tried))
    said = list(map(_action, items))
    return ", or ".join([", ".join(said[:-1]), said[-1]] if len(said) > 1 else said)


_SAID_APART = (HalveConstant, HalveHardware, LessenCause, TurnKnob, MendPlan, TakeWindows)
_TRIED = (HigherDegree, AskForRateUpTo, ShrinkSafeSet)


def _is_known(item: Relax) -> bool:
    return not isinstance(item, ShrinkSafeSet) or item.factor is not None


_OF_H = ("h", "h_x", "h_t")
_LONGEST = 60  # characters of h


def _halving(item: HalveConstant, h: Sequence[str]) -> str:
    meaning = EVERY[item.constant]
    share = 100 * (1 - item.factor)
    whole = h[0] if len(h) == 1 else f"[{', '.join(h)}]"
    shown = whole if len(whole) <= _LONGEST else f"{whole[:_LONGEST]} ..."
    words = f"{meaning.words}, h = {shown}" if h else meaning.words
    return f"halving {meaning.symbol} ({words}) would lower the least Gamma by {share:.0f} %"


def _better(item: HalveHardware) -> str:
    return f"half of {PARTS[item.part]} would make the tube {100 * (1 - item.factor):.0f} % narrower"


def _easier(item: EaseHardware) -> str:
    unit = " s" if item.part in ("sample_time", "delay") else ""
    rate = f" ({near(1 / item.value, 4)} Hz)" if item.part == "sample_time" else ""
    return f"bring {PARTS[item.part]} down to {near(item.value, 4)}{unit}{rate}, which is proven to serve"


def _windows(item: TakeWindows) -> str:
    return (
        f"tube.windows: {item.windows} may do without a better machine (not tried): "
        "in each part of the plan constants are smaller"
    )


def _filled(items: Sequence[LessenCause]) -> str:
    """What takes too much, together with its sum; the start's distance is no cause of these."""
    if not items:
        return ""
    shares = ", ".join(f"{CAUSES[item.cause]} {100 * item.share:.0f} %" for item in items)
    whole = 100 * sum(item.share for item in items)
    return f"what fills the level of the loop that comes nearest, to {whole:.0f} % (not proven): {shares}"


def _turns(items: Sequence[TurnKnob]) -> str:
    """What certifies, one thing at a time."""
    if not items:
        return ""
    lead = "each of these alone is proven to serve: " if len(items) > 1 else "this is proven to serve: "
    return lead + "; or ".join(map(_turn, items))


def _turn(item: TurnKnob) -> str:
    share = f"{near(100 * item.value, 3)} %"
    match item.knob:
        case "start":
            whole = "start where the plan starts"
            return f"start at {share} of the distance from the plan" if item.value else whole
        case "half_widths":
            return f"all half-widths at {share}"
        case "uncertainty" if item.term is not None:
            return f"{item.term} in the h of {item.input} at {share} of its size"
        case "uncertainty":
            return f"all of h at {share} of its size"
    return f"{_KNOBS[item.knob]} {near(item.value, 4)} in place of {near(item.now, 4)}"


_KNOBS: Mapping[Knob, str] = {
    "epsilon": "epsilon",
    "rho_a": "rho_a",
    "half_widths": "the half-widths",
    "rate": "metric.rate",
    "start": "the start",
    "uncertainty": "h",
    "wind": "disturbance.bound",
    "knots": "trajectory.knots",
    "defect": "trajectory.defect",
    "gap": "--gap",
}


def _none_alone(item: NoKnobAlone) -> str:
    """That nothing serves by itself, and what does together."""
    tried = f"nothing that was tried serves alone ({', '.join(_KNOBS[knob] for knob in item.tried)})"
    if item.uncertainty is None:
        return tried
    tube = [] if item.epsilon is None else [f"epsilon {near(item.epsilon, 4)}"]
    tube += [] if item.half_widths is None else [f"all half-widths at {near(100 * item.half_widths, 3)} %"]
    share = f"all of h at {near(100 * item.uncertainty, 3)} % of its size"
    return f"{tried}; together these are proven to serve: {' and '.join([*tube, share])}"


def _plan(item: MendPlan) -> str:
    where = "" if item.t is None else f" (at t = {near(item.t, 4)} s)"
    return (
        f"the plan misses x' = f + B u by up to {near(item.defect, 3)}{where}, which alone takes "
        f"{near(100 * item.share, 2)} % of the tube: {_remedy(item.remedy)}"
    )


def _remedy(item: PlanRemedy) -> str:
    match item:
        case CorrectPlan():
            return "correct x or u there"
        case OtherInterpolation():
            return f"with interpolation: {item.interpolation} it would be {near(item.defect, 3)}"
        case MoreKnots():
            return "give more knots, or integrate the dynamics between them"
    raise TypeError(item)


def _action(item: Relax) -> str:
    return _ACTIONS[type(item)](item)


def _lower_rate(item: LowerRate) -> str:
    return "lower the rate" if item.to is None else f"lower metric.rate to {down(item.to, 6)}"


def _metric_bound(item: DeclareMetricBound) -> str:
    if item.side is None or item.value is None:
        return "declare metric.bounds"
    rounded = down if item.side == "lower" else up
    return f"declare {item.side}: {rounded(item.value, 6)}"


def _uncertainty_bound(item: DeclareUncertaintyBound) -> str:
    return f"declare {item.constant}: {'-' if item.value is None else up(item.value, 6)}"


def _smaller_set(item: ShrinkSafeSet) -> str:
    if item.factor is None or item.rate is None:
        return "shrink the safe set"
    shrunk = f"the safe set shrunk to {near(item.factor, 3)} of its size about its centre"
    return f"{shrunk}, where {near(item.rate)} works"


_ACTIONS: Mapping[type[Relax], Callable[[Any], str]] = {
    RaiseBudget: lambda item: "raise --budget" + (": a proof ran out of boxes" if item.proof else ""),
    EaseHardware: _easier,
    NoKnobAlone: _none_alone,
    ShrinkTube: lambda item: "shrink the tube",
    ReduceRadii: lambda item: "reduce epsilon, rho_a or the initial error",
    LeavePlanRoom: lambda item: "plan with more room to the limits",
    ReduceInitialError: lambda item: "reduce the initial error",
    EnlargeSafeSet: lambda item: "enlarge the safe set",
    ShrinkSafeSet: _smaller_set,
    LowerRate: _lower_rate,
    OtherMetric: lambda item: "give another dual metric",
    DeclareMetricBound: _metric_bound,
    DeclareUncertaintyBound: _uncertainty_bound,
    AskForRateBelow: lambda item: f"ask for a rate below {near(item.rate)}",
    AskForRateUpTo: lambda item: f"a rate up to {near(item.rate)}, which works on this box",
    GiveInput: lambda item: "give it an input",
    OtherVariables: lambda item: "choose other variables, or leave them to tubecert",
    LowerDegree: lambda item: "ask for a lower degree",
    ConstantInputs: lambda item: (
        "choose inputs in which B is constant, such as the accelerations of joints "
        "(tubecert init --template arm2 shows how)"
    ),
    HigherDegree: lambda item: f"a degree above {item.degree}, or auto",
    RaiseConditionNumber: lambda item: f"raise condition_number to {near(item.to, 4)}",
}
