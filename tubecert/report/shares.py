"""What fills the tube, by cause, for every kind that is certified: shares of what the contraction can make good.

In: `result` of a certificate. Out: shares, each an upper bound by outward-rounded arithmetic from the printed constants
and the printed recipe. No claim rests on them.

At the edge of the tube contraction shortens the distance by lambda dbar per second. The causes lengthen it by what
they are told here (theory 4, 4a, 7); what is left is for the start, until the filter has learned the
uncertainty, and for the margin.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

from tubecert.bounds.constants import EVERY
from tubecert.certificate.result import Result
from tubecert.conditions.alone import NoGains
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import FIELDS, Numbers
from tubecert.conditions.theorem import Recipe
from tubecert.conditions.wind import taken
from tubecert.enclosure.interval import Interval
from tubecert.verdict import Verdict

_LEAST = 5e-5  # a smaller share is not told
_CAUSES: Mapping[str, str] = {
    "plan": "the plan's own defect",
    "parameters": "what unknown parameters do that no input reaches",
    "wind": "wind that pushes",
    "uncertainty": "the uncertainty, which nothing compensates",
    "bias": "the filter's lag behind the uncertainty",
    "adaptation": "the error of the adaptation",
    "wind_estimate": "wind that the estimate takes for uncertainty",
}


def filled(result: Result) -> dict[str, dict[str, float]]:
    """What each cause takes at most, the most first, for every kind that is certified and whose causes are known.

    These are 0 and B.
    """
    found = {key: dict(_of_kind(result, key)) for key in result.sections}
    return {key: shares for key, shares in found.items() if shares}


def _of_kind(result: Result, key: str) -> list[tuple[str, float]]:
    section, recipe, n = result.sections[key], result.proof.of.get(key), _numbers(result)
    pair = section.decisive(asked=result.asked)
    if section.verdict is not Verdict.CERTIFIED or recipe is None or n is None or pair is None:
        return []
    whole = n.lam * reach(n)
    causes = {name: push / whole for name, push in _pushes(result, n, recipe)}
    if not causes:
        return []
    used = 1 - min(margin.below for margin in pair.margins.values())
    start = used - float(sum(causes.values(), Interval.of(0)).lo)
    parts = [*((_CAUSES[name], float(each.hi)) for name, each in causes.items()), (_began(recipe), start)]
    return sorted((each for each in parts if each[1] > _LEAST), key=lambda each: -each[1])


def _began(recipe: Recipe) -> str:
    alone, adapting = "feedback has made it good", "filter has learned the uncertainty"
    return f"the start, until the {alone if isinstance(recipe, NoGains) else adapting}"


def _pushes(result: Result, n: Numbers[Interval], recipe: Recipe) -> Iterator[tuple[str, Interval]]:
    """What lengthens the distance once the filter has learned what it can, in units of distance per second."""
    match recipe:
        case NoGains():
            yield "uncertainty", n.beta * n.Dh
        case DistanceRecipe(uncertainty=S, prediction_error=e):
            yield "bias", n.beta * Interval.of(S)
            yield "adaptation", n.beta * (Interval.of(e) - taken(n))
            yield "wind_estimate", n.beta * taken(n)
        case _:
            return
    yield "plan", n.delta
    yield "parameters", _constant(result, "residual_push") or Interval.of(0)
    yield "wind", n.wind_push if n.wind_push is not None else Interval.of(0)


def _numbers(result: Result) -> Numbers[Interval] | None:
    """The constants of a certificate on the side that its theorems use; None where one is missing."""
    known = {symbol: _constant(result, name) for symbol, name in FIELDS.items()}
    named = {symbol: value for symbol, value in known.items() if value is not None}
    tube, wind = result.tube, result.claim.wind
    if len(named) != len(known) or result.metric is None or tube is None:
        return None

    def blown(name: str) -> Interval | None:
        value = _constant(result, name)
        return None if value is None or wind is None else value * Interval.of(Fraction(wind.bound))

    return Numbers(
        **named,
        R=Interval.of(0),
        lam=Interval.of(result.metric.rate),
        rho=Interval.of(tube.rho),
        rho_a=Interval.of(tube.rho_a),
        rho_r=Interval.of(tube.rho - tube.rho_a),
        horizon=None,
        wind_push=blown("wind_push"),
        wind_speed=blown("wind_size"),
        wind_error=blown("wind_explained"),
        rest_speed=_constant(result, "residual_size"),
    )


def _constant(result: Result, name: str) -> Interval | None:
    """A constant on its safe side."""
    item, meaning = result.constants.get(name), EVERY.get(name)
    if item is None:
        return None
    side = item.below if meaning is not None and meaning.side == "below" else item.above
    return None if side is None else Interval.exact(side)
