"""What is told of a machine that serves: bounds and the budget. Trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.conditions.arithmetic import (
    quiet,
    sqrt,
)
from tubecert.conditions.hardware.evaluation import Evaluated, evaluated
from tubecert.conditions.hardware.gains import acting
from tubecert.conditions.hardware.loop import HardwareRecipe, loop_of, plant
from tubecert.conditions.hardware.windows import course_of
from tubecert.conditions.problem import TubeProblem
from tubecert.enclosure.interval import Interval

_DUST = 1e-9  # a share that is as good as none


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What fills the level: shares of lambda dhat, each rounded up; 0 for less than 1e-9.

    `plan` delta, `feedforward` beta ups, `wind` beta_w |w|, `wind_estimate` what it does to the estimate, `bias` the
    rest of beta S, `noise_estimate` beta N, `lag` beta s1 (tau + mu), `noise_feedback` ell0, `sampling` ell1 and the
    floor; `gain` the part of beta S that an uncertain gain causes, and beta is beta (1 + D_b) then; `geodesic` the
    parts of ell0 and of beta ups that computed geodesics cause.
    """

    plan: float
    feedforward: float
    wind: float
    wind_estimate: float
    bias: float
    noise_estimate: float
    lag: float
    noise_feedback: float
    sampling: float
    gain: float = 0.0
    geodesic: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """Bounds that follow from a recipe: `supremum` of d, `radius` of |x - x*|, `feedback` |u0 - u* + kappa|, |x'|."""

    supremum: float
    radius: float
    feedback: float
    budget: Budget


@quiet
def told(problem: TubeProblem, recipe: HardwareRecipe) -> Told:
    """What a recipe that is proven says."""
    if recipe.windows:
        return _widest(recipe, told_in_windows(problem, recipe))
    x = evaluated(plant(problem, recipe.clip_radius), loop_of(recipe))
    return _told(x, x.course.supremum(), recipe.level)


@quiet
def told_in_windows(problem: TubeProblem, recipe: HardwareRecipe) -> tuple[Told, ...]:
    """What a recipe that is proven says of each window."""
    found = course_of(problem, recipe)
    return tuple(_told(w.at, w.supremum, own.level) for w, own in zip(found, recipe.windows, strict=True))


def _told(x: Evaluated[Interval], supremum: Interval, level: Fraction) -> Told:
    """What follows from d < dhat: theorem H and (H.16)."""
    dhat = Interval.of(level)
    return Told(
        supremum=float(supremum.hi),
        radius=float((dhat / sqrt(x.plant.n.a)).hi),
        feedback=float((x.estimate.ups + x.estimate.kb).hi),
        budget=_budget(x, dhat),
    )


def _widest(recipe: HardwareRecipe, found: Sequence[Told]) -> Told:
    """The largest of each bound; the budget is that of the first window with the largest level."""
    at = [w.level for w in recipe.windows].index(recipe.level)
    return Told(
        supremum=max(own.supremum for own in found),
        radius=max(own.radius for own in found),
        feedback=max(own.feedback for own in found),
        budget=found[at].budget,
    )


def _budget(x: Evaluated[Interval], dhat: Interval) -> Budget:
    """The terms of A1 in (H.12), by what causes them."""
    n, e, loop, run = x.plant.n, x.estimate, x.loop, x.course
    whole = n.lam * dhat
    beta, biased, bent = acting(x.plant, n.beta), loop.S - e.gust, e.geodesics

    def share(part: Interval) -> float:
        most = float((part / whole).sanitised().hi)
        return most if most > _DUST else 0.0

    return Budget(
        plan=share(n.delta),
        feedforward=share(beta * (e.ups if bent is None else e.ups - bent.input)),
        wind=share(x.plant.beta_w * loop.wbar),
        wind_estimate=share(beta * e.gust),
        bias=share(beta * (biased if x.plant.gain is None else biased - e.mistaken)),
        noise_estimate=share(beta * loop.N),
        lag=share(beta * run.lag),
        noise_feedback=share(run.noisy if bent is None else run.noisy - run.bent),
        sampling=share(run.bound.delta - run.base - run.noisy),
        gain=share(beta * e.mistaken),
        geodesic=share(run.bent if bent is None else run.bent + beta * bent.input),
    )
