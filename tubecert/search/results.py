"""What a search returns, ready for the certificate: gains as exact decimals, margins, curves, recipes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

from tubecert.conditions.decimals import printed
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.sampled import SampledRecipe
from tubecert.conditions.verdict import Shortfall, Verdict
from tubecert.enclosure.interval import Interval

Json = dict[str, "object"]


def finite(value: float) -> float | None:
    """A number for JSON: None where it is infinite or unknown."""
    return float(value) if math.isfinite(value) and abs(value) < 1e300 else None


def margin_json(margin: Interval) -> list[float | None]:
    """[below, above]; null where there is no bound."""
    return [finite(float(margin.lo)), finite(float(margin.hi))]


def shortfall_json(item: Shortfall) -> Json:
    """One reason as data."""
    return {
        "condition": item.claim,
        **({} if item.constant is None else {"constant": item.constant}),
        "margin": margin_json(item.margin),
        "allowed": item.allowed,
        "needed": item.needed,
        "missing": item.missing,
    }


def _gain(value: Fraction | None) -> float | str | None:
    return None if value is None else printed(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class RatePair:
    """A verified pair of certificate A."""

    recipe: RateRecipe
    margins: dict[str, Interval]
    ultimate_radius: float | None = None

    def to_dict(self) -> Json:
        """The pair as JSON data."""
        return {
            "bandwidth": _gain(self.recipe.bandwidth),
            "adaptation_rate": _gain(self.recipe.adaptation_rate),
            "predictor_gain": _gain(self.recipe.predictor_gain),
            "projection_radius": _gain(self.recipe.projection_radius),
            "margins": {claim: margin_json(margin) for claim, margin in self.margins.items()},
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class DistancePair:
    """A pair of certificate B with its proof."""

    recipe: DistanceRecipe
    margin: Interval
    ultimate_radius: float | None = None

    def to_dict(self) -> Json:
        """The pair as JSON data."""
        return {
            "bandwidth": _gain(self.recipe.bandwidth),
            "adaptation_rate": _gain(self.recipe.adaptation_rate),
            "predictor_gain": _gain(self.recipe.predictor_gain),
            "projection_radius": _gain(self.recipe.projection_radius),
            "margin": margin_json(self.margin),
            "ultimate_radius": self.ultimate_radius,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledPair:
    """A sample time of certificate C with its proof."""

    recipe: SampledRecipe
    margin: Interval
    ultimate_radius: float | None = None

    def to_dict(self) -> Json:
        """The pair as JSON data."""
        return {
            "sample_time": _gain(self.recipe.sample_time),
            "bandwidth": _gain(self.recipe.bandwidth),
            "predictor_gain": _gain(self.recipe.predictor_gain),
            "projection_radius": _gain(self.recipe.projection_radius),
            "margin": margin_json(self.margin),
            "ultimate_radius": self.ultimate_radius,
        }


def recipe_json(recipe: RateRecipe | DistanceRecipe | SampledRecipe) -> Json:
    """Every number of a proof as a decimal."""
    return {name: _gain(getattr(recipe, name)) for name in recipe.__slots__}


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions26:
    """Certificate A: the pair (asked for, or the smallest bandwidth), the pair of least rate, the curve.

    `infimum` is the smallest bandwidth that (26a), (26b) admit; where (26b) binds it is not attained, and
    the pair has the smallest bandwidth that leaves 1 % of (26b). `binds` names the condition that sets the
    bandwidth. `below_twice_rate`: the bandwidth lies in the window below 2 lambda.
    """

    verdict: Verdict
    pair: RatePair | None
    A_m: tuple[tuple[Fraction, ...], ...] | None
    least_adaptation: RatePair | None = None
    curve: tuple[RatePair, ...] = ()
    infimum: float | None = None
    binds: str | None = None
    below_twice_rate: bool = False
    shortfalls: tuple[Shortfall, ...] = ()

    def to_dict(self) -> Json:
        """The section `conditions_26` of the certificate."""
        n = 0 if self.A_m is None else len(self.A_m)
        Q = None if self.A_m is None else _lyapunov(self.A_m)
        pair = None if self.pair is None else self.pair.to_dict()
        return {
            "verdict": str(self.verdict),
            "bandwidth": pair and pair["bandwidth"],
            "adaptation_rate": pair and pair["adaptation_rate"],
            "A_m": None if self.A_m is None else [[_gain(x) for x in row] for row in self.A_m],
            "P": None if self.A_m is None else [[float(i == j) for j in range(n)] for i in range(n)],
            "Q": None if Q is None else [[_gain(x) for x in row] for row in Q],
            "projection_radius": pair and pair["projection_radius"],
            "margins": pair and pair["margins"],
            "ultimate_radius": self.pair and self.pair.ultimate_radius,
            "least_adaptation": self.least_adaptation and self.least_adaptation.to_dict(),
            "curve": [_point(p.recipe) for p in self.curve],
            "bandwidth_infimum": self.infimum,
            "binds": self.binds,
            "below_twice_rate": self.below_twice_rate,
            "shortfalls": [shortfall_json(item) for item in self.shortfalls],
        }


def _lyapunov(A_m: tuple[tuple[Fraction, ...], ...]) -> list[list[Fraction]]:
    n = len(A_m)
    return [[-(A_m[i][j] + A_m[j][i]) for j in range(n)] for i in range(n)]


def _point(recipe: RateRecipe | DistanceRecipe) -> Json:
    return {
        "bandwidth": _gain(recipe.bandwidth),
        "adaptation_rate": _gain(recipe.adaptation_rate),
        "predictor_gain": _gain(recipe.predictor_gain),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceResult:
    """Certificate B: split pair, pair of least rate, pair asked for (which then decides), curve."""

    verdict: Verdict
    split: DistancePair | None = None
    least_adaptation: DistancePair | None = None
    asked: DistancePair | None = None
    curve: tuple[DistancePair, ...] = ()
    shortfalls: tuple[Shortfall, ...] = ()

    @property
    def decisive(self) -> DistancePair | None:
        """The pair that the verdict is about."""
        return self.asked or self.least_adaptation or self.split

    def to_dict(self) -> Json:
        """The section `distance` of the certificate."""
        return {
            "verdict": str(self.verdict),
            "split": self.split and self.split.to_dict(),
            "least_adaptation": self.least_adaptation and self.least_adaptation.to_dict(),
            "asked": self.asked and self.asked.to_dict(),
            "ultimate_radius": self.decisive and self.decisive.ultimate_radius,
            "curve": [_point(p.recipe) for p in self.curve],
            "shortfalls": [shortfall_json(item) for item in self.shortfalls],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledResult:
    """Certificate C: the sample time (largest with omega = 1/Ts, or as asked for), limit and curve.

    `sample_time_limit` is approached as omega grows, at the predictor gain of the pair, and never attained.
    """

    verdict: Verdict
    pair: SampledPair | None = None
    sample_time_limit: float | None = None
    curve: tuple[SampledPair, ...] = ()
    shortfalls: tuple[Shortfall, ...] = field(default=())

    def to_dict(self) -> Json:
        """The section `sampled` of the certificate."""
        pair: Json = dict.fromkeys(
            ("sample_time", "bandwidth", "predictor_gain", "projection_radius", "margin", "ultimate_radius"),
            None,
        )
        return {
            "verdict": str(self.verdict),
            **(pair if self.pair is None else self.pair.to_dict()),
            "sample_time_limit": self.sample_time_limit,
            "curve": [
                {"bandwidth": _gain(p.recipe.bandwidth), "sample_time": _gain(p.recipe.sample_time)}
                for p in self.curve
            ],
            "shortfalls": [shortfall_json(item) for item in self.shortfalls],
        }
