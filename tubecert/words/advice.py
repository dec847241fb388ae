"""What would help, as one sentence.

What changes a number is told (`halving Dh ... would lower ...`), what can be done is asked for (`raise --budget, or
lower metric.rate`), and what is wrong with the plan comes last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tubecert.bounds.constants import EVERY
from tubecert.claims.advice import (
    AskForRateBelow,
    AskForRateUpTo,
    ConstantInputs,
    CorrectPlan,
    DeclareMetricBound,
    DeclareUncertaintyBound,
    EnlargeSafeSet,
    GiveInput,
    HalveConstant,
    HigherDegree,
    LeavePlanRoom,
    LowerDegree,
    LowerRate,
    MendPlan,
    MoreKnots,
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
)
from tubecert.claims.family import Relax
from tubecert.digits import down, near, up


def advice(items: Sequence[Relax], h: Sequence[str] = ()) -> str:
    """What would help; empty if nothing is known to. `h`: the expressions of the uncertainty, as they are written."""
    about_h = next(
        (item for item in items if isinstance(item, HalveConstant) and item.constant in _OF_H), None
    )
    halvings = ", ".join(
        _halving(item, h if item is about_h else ()) for item in items if isinstance(item, HalveConstant)
    )
    plans = [_plan(item) for item in items if isinstance(item, MendPlan)]
    others = [item for item in items if not isinstance(item, _SAID_APART)]
    return "; ".join(filter(None, (halvings, _alternatives(others), *plans)))


def _alternatives(items: Sequence[Relax]) -> str:
    tried = [item for item in items if isinstance(item, _TRIED) and _is_known(item)]
    if tried:
        return "try " + "; or ".join(map(_action, tried))
    said = list(map(_action, items))
    return ", or ".join([", ".join(said[:-1]), said[-1]] if len(said) > 1 else said)


_SAID_APART = (HalveConstant, MendPlan)
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
