"""Problems of certificates B and C that are cut into windows, and recipes for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

from problems import alive
from tubecert.conditions.sampled import SampledRecipe
from tubecert.conditions.stretches import LevelProof

from tubecert.bounds.constants import WindConstants
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import Part, TubeProblem, Wind
from tubecert.enclosure.constant import Constant

F = Fraction
START = ("h_initial", "initial_distance", "lower")  # of the whole tube


def blown(problem: TubeProblem) -> TubeProblem:
    """With a wind of which everything matters."""
    sizes = {"push": 0.4, "size": 0.5, "explained": 0.3}
    constants = WindConstants(**{name: Constant(below=x, above=x) for name, x in sizes.items()})
    return replace(problem, wind=Wind(bound=F(1, 20), constants=constants))


def scaled(constants: Any, share: float, names: Sequence[str]) -> Any:
    """Some constants, smaller."""
    found = {name: getattr(constants, name) for name in names}
    return replace(
        constants,
        **{name: Constant(below=x.below * share, above=x.above * share) for name, x in found.items()},
    )


BY_SHARE = ("h", "h_x", "h_t", "drift_on_plan", "plan_defect_metric", "feedback_gain")
OF_B = ("B", "B_x", "B_pinv", "B_pinv_x", "metric_input_gain")


def cut(problem: TubeProblem, ends: Sequence[Fraction], shares: Sequence[float]) -> TubeProblem:
    """A problem in windows that end at `ends` in s; their constants are shares of those of the whole."""
    parts = tuple(
        Part(
            begin=begin,
            end=end,
            radius=problem.rho,
            constants=scaled(scaled(problem.constants, share, BY_SHARE), 0.5 + share / 2, OF_B),
            wind=None
            if problem.wind is None
            else scaled(problem.wind.constants, share, ("push", "size", "explained")),
            residual=None,
            widths={"x": 1.0},
            inputs={"u": (-share, share)},
        )
        for (begin, end), share in zip(pairwise((F(0), *ends)), shares, strict=True)
    )
    return replace(problem, horizon=ends[-1], parts=parts)


def of_distance(problem: TubeProblem, speeds: Sequence[Fraction], **changes: Any) -> DistanceRecipe:
    """Some gains of B at these speeds, with levels at the ends of the tubes."""
    own = {
        "bandwidth": F(30),
        "adaptation_rate": F(4000),
        "predictor_gain": F("3.5") if problem.A_m is not None else F(30),
        "projection_radius": problem.projection_radius,
        "speed": max(speeds),
        "prediction_error": F(1000),
        "uncertainty": F(1000),
        "settling": F(1, 50),
        "windows": tuple(LevelProof(level=F("0.7"), speed=Y) for Y in speeds),
    }
    return DistanceRecipe(**(own | changes))


def of_samples(problem: TubeProblem, speeds: Sequence[Fraction], **changes: Any) -> SampledRecipe:
    """Some gains of C at these speeds, with levels at the ends of the tubes."""
    own = {
        "sample_time": F(1, 100),
        "bandwidth": F(30),
        "predictor_gain": F(40),
        "projection_radius": problem.clipping_radius,
        "speed": max(speeds),
        "windows": tuple(LevelProof(level=F("0.7"), speed=Y) for Y in speeds),
    }
    return SampledRecipe(**(own | changes))


def some(*shares: float, wind: bool = True, **options: Any) -> TubeProblem:
    """Windows of .3 s of a problem in which every constant matters."""
    whole = blown(alive(**options)) if wind else alive(**options)
    return cut(whole, [F(3 * (k + 1), 10) for k in range(len(shares))], shares)
