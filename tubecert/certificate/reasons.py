"""Why a verdict is what it is, in words: what binds, by how much, what would relax it.

In: the results of the three searches, and what halving a constant does to the least Gamma.
Out: the `reasons` of a certificate.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from tubecert.bounds.constants import TABLE, Constant, Meaning
from tubecert.conditions.verdict import Shortfall, Verdict
from tubecert.search.results import (
    Conditions26,
    DistancePair,
    DistanceResult,
    RatePair,
    SampledPair,
    SampledResult,
)

Reason = dict[str, Any]

EXPLAINED = {
    "26a": "(26a): the initial error and the filter's share must fit into rho_r",
    "26b": "(26b): the metric's lower bound must exceed zeta_2 + zeta_3",
    "26c": "(26c): the adaptation rate must make up for the estimation error",
    "dbar <= d0": "d0, the length of the segment to the start, must be below dbar = sqrt(a) rho",
    "dbar <= delta/lambda": "the plan's defect alone must keep the distance below dbar",
    "distance": "the distance bound sup D(t) must stay below dbar",
    "sampled": "the distance bound with sampled adaptation must stay below dbar",
    "as-printed": "the paper's printed formulas are reproduced; several are wrong, so they certify nothing",
    "nothing found": "gains that seem to serve were found, but none could be proven to; the constants may be too wide "
    "(lower --gap), or the margins too thin for the arithmetic",
}


def defect_advice(defect: Constant, share: float, remedy: str) -> str:
    """What a plan's defect does to the tube: `share` of it, if nothing else disturbed."""
    where = "" if defect.at is None or defect.at.t is None else f" (at t = {defect.at.t:.4g} s)"
    return (
        f"the plan misses x' = f + B u by up to {defect.above:.3g}{where}, which alone takes {100 * share:.2g} % "
        f"of the tube: {remedy}"
    )


def reasons_26(result: Conditions26, halved: Mapping[str, float]) -> list[Reason]:
    """Reasons of certificate A."""
    if result.verdict is not Verdict.CERTIFIED or result.pair is None:
        return _short("conditions_26", result.verdict, result.shortfalls, _gain_of(result.pair))
    margins = ", ".join(f"{claim} {float(margin.lo):.2g}" for claim, margin in result.pair.margins.items())
    binds = {"26a": "(26a)", "26b": "(26b)"}.get(result.binds or "", result.binds)
    message = f"{binds} sets the bandwidth; proven margins: {margins}"
    if result.below_twice_rate:
        message += "; the bandwidth lies below twice the rate"
    if result.binds == "26b":
        message += "; where (26b) binds the rate grows without bound, so 1 % of it is left"
    return [_certified("conditions_26", message, halved)]


def reasons_distance(result: DistanceResult, halved: Mapping[str, float]) -> list[Reason]:
    """Reasons of certificate B."""
    pair = result.decisive
    if result.verdict is not Verdict.CERTIFIED or pair is None:
        return _short("distance", result.verdict, result.shortfalls, _gain_of(pair))
    return [_certified("distance", f"proven margin {float(pair.margin.lo):.2g} of dbar", halved)]


def reasons_sampled(result: SampledResult) -> list[Reason]:
    """Reasons of certificate C."""
    if result.verdict is not Verdict.CERTIFIED or result.pair is None:
        return _short("sampled", result.verdict, result.shortfalls, _gain_of(result.pair))
    gain = float(result.pair.recipe.predictor_gain)
    message = f"proven margin {float(result.pair.margin.lo):.2g} of dbar, with A_m = -{gain:g} I"
    return [_certified("sampled", message, {})]


def _gain_of(pair: RatePair | DistancePair | SampledPair | None) -> str:
    """The predictor that a claim about gains is made with, where it is -g I."""
    if pair is None or pair.recipe.predictor_gain is None:
        return ""
    return f" (with A_m = -{float(pair.recipe.predictor_gain):g} I)"


def _certified(claim: str, message: str, halved: Mapping[str, float]) -> Reason:
    reason: Reason = {"claim": claim, "verdict": str(Verdict.CERTIFIED), "message": message}
    parts = [
        f"halving {TABLE[name].symbol} ({TABLE[name].words}) would lower the least Gamma by {100 * (1 - factor):.0f} %"
        for name, factor in halved.items()
        if factor < 0.995
    ]
    if parts:
        reason["relax"] = ", ".join(parts)
    return reason


UNBOUNDED_RELAX = "raise --budget, or shrink the tube"


def unbounded_text(constant: Meaning) -> str:
    """That a constant has no finite bound."""
    return f"{constant.words} ({constant.symbol}) could not be bounded within the budget of boxes"


def _margin(item: Shortfall, *, no_rate: bool) -> str:
    """The margin of a claim that is not proven, in words where it has no bound; `no_rate` if (26b) is refuted."""
    low, high = float(item.margin.lo), float(item.margin.hi)
    if high == -inf:
        # (26c) divides by what (26b) leaves
        rate = no_rate and item.claim == "26c"
        return (
            "no adaptation rate can, where (26b) fails" if rate else "it fails by more than can be computed"
        )
    if low == -inf:
        below = "its margin could not be bounded from below"
        return below if high == inf else f"{below}; it is {high:.3g} at most"
    if (shown := f"{low:.3g}") == f"{high:.3g}":
        return f"its margin is {shown}"
    return f"its margin lies in [{shown}, {high:.3g}]"


def _short(claim: str, verdict: Verdict, shortfalls: tuple[Shortfall, ...], gain: str) -> list[Reason]:
    """Claims that are not proven; those that depend on the predictor name it, since another one may serve."""
    reasons = []
    no_rate = any(item.claim == "26b" and item.margin.hi <= 0 for item in shortfalls)
    for item in shortfalls:
        message = EXPLAINED.get(item.claim, item.claim)
        if item.allowed is not None and item.needed is not None:
            message += f": {item.needed:.4g} is needed, {item.allowed:.4g} is allowed"
        elif (constant := TABLE.get(item.claim.removeprefix("unbounded: "))) is not None:
            message = unbounded_text(constant)
        elif item.claim not in ("as-printed", "nothing found"):
            message += f": {_margin(item, no_rate=no_rate)}"
            message += gain if item.claim in {"26c", "distance", "sampled"} else ""
        reasons.append({"claim": f"{claim}: {item.claim}", "verdict": str(verdict), "message": message})
        if item.claim.startswith("unbounded: "):
            reasons[-1]["relax"] = UNBOUNDED_RELAX
    return reasons or [
        {
            "claim": claim,
            "verdict": str(verdict),
            "message": "no gains were found that can be proven to serve",
        }
    ]
