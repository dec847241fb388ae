"""Theorem HW: certificate H window by window along the plan, each with a level and constants of its own. Trusted.

THEOREM HW. If in every window dhat > sup D, the greater of its own level and of the one before it + n_M is at most
sqrt(a) rho, and (H.6), (H.7), (H.11), (H.17) hold with the constants of the window, then d(x*, x) < dhat in each. What
a window looks back at lies within a pad of two samples and the delay; its constants hold there. Implements: theory 8.9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Generic

from tubecert.conditions.arithmetic import T, decay_mean, exp, expm1, maximum, number, quiet
from tubecert.conditions.hardware.course import Course, course, mean_wait, resumed
from tubecert.conditions.hardware.estimation import Past, estimate
from tubecert.conditions.hardware.evaluation import Evaluated
from tubecert.conditions.hardware.feedback import loss
from tubecert.conditions.hardware.loop import HardwareRecipe, Loop, Plant, loop_of, plant
from tubecert.conditions.machine import Window
from tubecert.conditions.problem import TubeProblem
from tubecert.enclosure.interval import Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class InWindow(Generic[T]):
    """A recipe in a window: every formula, the largest D(t) in it, and what it leaves to the next one.

    `end` is D at its end; `left` bounds |q - h| but for noise, at the first sample that the next window looks back at.
    """

    at: Evaluated[T]
    supremum: T
    end: T
    left: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Span(Generic[T]):
    """How long a window is, and how far back what happens in it may reach, both in s."""

    length: T
    pad: T


@quiet
def first(p: Plant[T], loop: Loop[T], span: Span[T]) -> InWindow[T]:
    """The first window, in which the loop starts as in theorem H, (H.24)."""
    e = estimate(p, loop)
    cost = loss(p, loop, e)
    run = course(p, loop, e, cost)
    t_a = maximum(loop.Ts, loop.Tf) + loop.tau
    x = Evaluated(plant=p, loop=loop, estimate=e, loss=cost, course=run)
    highest = maximum(maximum(run.start, run.d1), _highest(run, span.length))
    return InWindow(at=x, supremum=highest, end=_at(run, span.length - t_a), left=_left(p, loop, span))


@quiet
def following(p: Plant[T], loop: Loop[T], span: Span[T], before: InWindow[T]) -> InWindow[T]:
    """A window after another one, (H.24)."""
    x = entered(p, loop, before)
    run = resumed(x.plant, loop, x.estimate, x.loss, maximum(arrival(x, before), loop.f0))
    return closed(replace(x, course=run), span)


@quiet
def entered(p: Plant[T], loop: Loop[T], before: InWindow[T]) -> Evaluated[T]:
    """All but the course of D, which depends on the floor alone beside this."""
    # the estimate comes from the window before, in place of rest at t = 0
    own = replace(p, n=replace(p.n, H0=before.left))
    e = estimate(own, loop, Past(acts=before.at.estimate.acts, sensed=before.at.estimate.sensed))
    cost = loss(own, loop, e)
    return Evaluated(plant=own, loop=loop, estimate=e, loss=cost, course=before.at.course)


@quiet
def closed(x: Evaluated[T], span: Span[T]) -> InWindow[T]:
    """The largest D in a later window, and its end."""
    return InWindow(
        at=x,
        supremum=_highest(x.course, span.length),
        end=_at(x.course, span.length),
        left=_left(x.plant, x.loop, span),
    )


@quiet
def arrival(x: Evaluated[T], before: InWindow[T]) -> T:
    """D where a window begins: a saw-tooth that grows steeper is ahead of its mean by so much at most.

    The jump of (H.24).
    """
    n, loop, last = x.plant.n, x.loop, before.at
    nought = number(0, loop.Ts)
    lag = n.beta * x.estimate.s1 - last.plant.n.beta * last.estimate.s1
    age = x.loss.ell1 - last.loss.ell1
    return (
        before.end
        + maximum(nought, lag) * _swing(n.lam, loop.Ts)
        + maximum(nought, age) * _swing(n.lam, loop.Tf)
    )


def _swing(rate: T, period: T) -> T:
    """(mu/lambda)(1 - e^(-lambda T)) >= max Pi - min Pi of the periodic solution of Pi' = -lambda Pi + saw.

    This is w of (H.24).
    """
    return mean_wait(rate, period) * period * decay_mean(rate * period)


def _left(p: Plant[T], loop: Loop[T], span: Span[T]) -> T:
    """z of the next window: S + (z - S)_+ e^(-omega (L - pad)); nothing is remembered without a filter, (H.22)."""
    nought = number(0, loop.S)
    if loop.omega is None:
        return nought
    return loop.S + maximum(nought, p.n.H0 - loop.S) * exp(-loop.omega * (span.length - span.pad))


def _highest(run: Course[T], length: T) -> T:
    """sup D from where the bound begins, over a length of time."""
    if run.omega is None:
        return maximum(run.bound.d0, _without_filter(run, length))
    return replace(run.bound, horizon=length).supremum()


def _at(run: Course[T], t: T) -> T:
    """D at a time after the beginning of its bound."""
    return _without_filter(run, t) if run.omega is None else run.bound.at(t)


def _without_filter(run: Course[T], t: T) -> T:
    """A1 + (d0 - A1) e^(-lambda t), (2.15) with K = 0."""
    D = run.bound
    return D.d0 * exp(-D.lam * t) - D.ultimate() * expm1(-D.lam * t)


def along(
    plants: Sequence[Plant[T]], loops: Sequence[Loop[T]], spans: Sequence[Span[T]]
) -> tuple[InWindow[T], ...]:
    """Every window, one after another; `loops` have the greater of two levels for dhat."""
    found: list[InWindow[T]] = []
    for p, loop, span in zip(plants, loops, spans, strict=True):
        found.append(following(p, loop, span, found[-1]) if found else first(p, loop, span))
    return tuple(found)


# -- a recipe over a problem


def windows_in(problem: TubeProblem) -> tuple[Window, ...]:
    """The windows that the constants of a problem are known in; empty for one constant each."""
    return () if problem.machine is None else problem.machine.windows


def over(problem: TubeProblem, window: Window) -> TubeProblem:
    """The problem with the constants of a window, as if its tube were all."""
    machine, wind = problem.machine, problem.wind
    if machine is None:
        raise ValueError("windows are those of a machine")
    half, constants = window.radius / 2, window.constants
    if machine.asked.arithmetic is not None:  # exported code cuts its feedback by du of the whole tube
        constants = replace(constants, feedback_gain=problem.constants.feedback_gain)
    return replace(
        problem,
        constants=constants,
        machine=replace(
            machine,
            constants=window.machine,
            covariant=window.covariant,
            inputs=window.inputs,
            windows=(),
        ),
        wind=None if wind is None or window.wind is None else replace(wind, constants=window.wind),
        residual=window.residual,
        rho=window.radius,
        # theorem H knows of rho alone
        epsilon=half,
        rho_a=half,
        rho_r=half,
        horizon=window.end - window.begin,
    )


def pad(recipe: HardwareRecipe) -> Fraction:
    """What a window looks back at: two samples of the slower clock, and the delay, (H.20)."""
    return 2 * max(recipe.sample_time, recipe.feedback_time) + recipe.delay


def cover(problem: TubeProblem, recipe: HardwareRecipe) -> bool:
    """Whether windows follow one another over the horizon, none shorter than the pad, each with its constants, (H.20).

    Each is within the tube; its constants reach back by the pad at least, and not beyond the window before.
    """
    windows, most = windows_in(problem), pad(recipe)
    if len(windows) != len(recipe.windows) or not windows:
        return False
    return (
        windows[0].begin == 0
        and windows[0].since == 0
        and windows[-1].end == problem.horizon
        and all(w.end - w.begin >= most and 0 < w.radius <= problem.rho for w in windows)
        and all(b.begin == a.end and a.begin <= b.since <= b.begin - most for a, b in pairwise(windows))
    )


def is_the_widest(recipe: HardwareRecipe) -> bool:
    """Whether the numbers of a recipe are the largest of its windows."""
    own = recipe.windows
    predictions = [w.prediction for w in own]
    widest = None if None in predictions else max(x for x in predictions if x is not None)
    return (
        recipe.level == max(w.level for w in own)
        and recipe.floor == max(w.floor for w in own)
        and recipe.speed == max(w.speed for w in own)
        and recipe.bias == max(w.bias for w in own)
        and recipe.ripple == max(w.ripple for w in own)
        and recipe.prediction == widest
        and (widest is not None or all(x is None for x in predictions))
    )


def within(recipe: HardwareRecipe) -> tuple[HardwareRecipe, ...]:
    """The recipe of each window, with the greater of its level and of the one before it."""
    own = recipe.windows
    before = [own[0], *own[:-1]]
    levels = [max(w.level, last.level) for w, last in zip(own, before, strict=True)]
    return tuple(
        replace(
            recipe,
            windows=(),
            level=level,
            floor=w.floor,
            speed=w.speed,
            bias=w.bias,
            ripple=w.ripple,
            prediction=w.prediction,
        )
        for level, w in zip(levels, own, strict=True)
    )


def course_of(problem: TubeProblem, recipe: HardwareRecipe) -> tuple[InWindow[Interval], ...]:
    """Every formula in every window, with outward rounding, (H.21)-(H.24)."""
    windows, most = windows_in(problem), Interval.of(pad(recipe))
    return along(
        [plant(over(problem, w), recipe.clip_radius) for w in windows],
        [loop_of(own) for own in within(recipe)],
        [Span(length=Interval.of(w.end - w.begin), pad=most) for w in windows],
    )
