"""Theorem H as the kernel asks it: margins of a recipe. Trusted."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tubecert.conditions import machine as machines
from tubecert.conditions.arithmetic import (
    Array,
    minimum,
    quiet,
    sqrt,
)
from tubecert.conditions.hardware import windows
from tubecert.conditions.hardware.evaluation import Evaluated, evaluated
from tubecert.conditions.hardware.gains import uncovered
from tubecert.conditions.hardware.loop import (
    HardwareRecipe,
    Loop,
    Plant,
    Rounding,
    loop_of,
    machine_in,
    plant,
)
from tubecert.conditions.obstacles import obstacles, reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import Margins, Theorem
from tubecert.conditions.verdict import Shortfall, unbounded
from tubecert.enclosure.interval import Interval

_LOST = tuple(Rounding.__slots__)
LEVEL, STAYS = "hardware_level", "hardware"  # the conditions (H.10) and (H.12)


@quiet
def margins_hardware(problem: TubeProblem, recipe: HardwareRecipe) -> tuple[Interval, Interval]:
    """The margins of (H.10) and (H.12), scalars; -inf below where a side condition is not proven."""
    nothing = Interval(-np.inf, np.inf)
    if problem.machine is None or uncovered(problem) or not _describes_a_loop(recipe):
        return nothing, nothing
    if not problem.machine.clips_within(problem.constants.h, recipe.clip_radius):
        return nothing, nothing
    several, computed = problem.machine.windows or recipe.windows, problem.machine.asked.geodesic is not None
    # theorems HW, H-R and H-G are stated for a known B, and H-G for one window
    if problem.gain is not None and (several or computed or recipe.rounding):
        return nothing, nothing
    if several:
        if computed:
            return nothing, nothing
        return _margins_in_windows(problem, recipe)
    x = evaluated(plant(problem, recipe.clip_radius), loop_of(recipe))
    if not _side_conditions(x):
        return nothing, nothing
    return _from_below(_level(x)), _from_below(1 - x.course.supremum() / x.loop.dhat)


def _margins_in_windows(problem: TubeProblem, recipe: HardwareRecipe) -> tuple[Interval, Interval]:
    """The least margins over the windows of theorem HW."""
    nothing = Interval(-np.inf, np.inf)
    # theorem H-R is for the du of the whole tube, which `over` takes where the problem is about rounding
    if recipe.rounding and machine_in(problem).asked.arithmetic is None:
        return nothing, nothing
    if not (windows.cover(problem, recipe) and windows.is_the_widest(recipe)):
        return nothing, nothing
    if not all(_describes_a_loop(own) for own in windows.within(recipe)):
        return nothing, nothing
    # half-widths of the whole tube and the clearance rest on d < dbar of the whole, whatever a is in a window
    if not Interval.of(recipe.level).hi <= reach(problem.proven()).lo:
        return nothing, nothing
    found = windows.course_of(problem, recipe)
    if not all(_side_conditions(w.at) for w in found):
        return nothing, nothing
    level, stays = _level(found[0].at), 1 - found[0].supremum / Interval.of(recipe.windows[0].level)
    for w, own in zip(found[1:], recipe.windows[1:], strict=True):
        level, stays = minimum(level, _level(w.at)), minimum(stays, 1 - w.supremum / Interval.of(own.level))
    return _from_below(level), _from_below(stays)


def _level(x: Evaluated[Interval]) -> Interval:
    """The margin of (H.10)."""
    return 1 - (x.loop.dhat + x.estimate.n_fb) / reach(x.plant.n)


def _from_below(margin: Interval) -> Interval:
    """What is proven of a margin: a recipe that fails refutes nothing."""
    return Interval(margin.sanitised().lo, np.asarray(np.inf))


def _describes_a_loop(r: HardwareRecipe) -> bool:
    """What section 1 asks of the numbers: 0 <= delay <= Ts, and with prediction delay <= Tf."""
    positive = (r.sample_time, r.feedback_time, r.clip_radius, r.level, r.floor, r.speed)
    lost = [x for each in r.rounding for x in (each.feedback, each.input, each.estimate, each.prediction)]
    sizes = (r.delay, r.noise, r.wind, r.bias, r.ripple, *lost)
    return (
        all(x > 0 for x in positive)
        and all(x >= 0 for x in sizes)
        and len(r.rounding) <= 1
        and (r.bandwidth is None or r.bandwidth > 0)
        and r.delay <= r.sample_time
        and (r.prediction is None or (r.prediction >= 0 and r.delay <= r.feedback_time))
    )


def _side_conditions(x: Evaluated[Interval]) -> bool:
    """(5.1), (H.6), (H.7), (H.11), (H.17) and (H.41)."""
    e, loop = x.estimate, x.loop
    predicted = e.prediction is None or loop.np is None or bool(e.prediction.sanitised().hi <= loop.np.lo)
    computed = e.geodesics is None or bool(e.geodesics.within.sanitised().lo > 0)
    return (
        computed
        and bool(x.loss.chi.sanitised().lo > 0)  # (5.1)
        and bool(e.bias.sanitised().hi <= loop.S.lo)  # (H.6)
        and bool(e.ripple.sanitised().hi <= loop.N.lo)  # (H.7)
        and bool(e.speed.sanitised().hi < loop.Y.lo)  # (H.11)
        and predicted  # (H.17)
    )


def _margins(problem: TubeProblem, recipes: Sequence[HardwareRecipe]) -> Margins:
    found = [margins_hardware(problem, recipe) for recipe in recipes]
    return {
        name: Interval(
            np.array([float(pair[i].lo) for pair in found]), np.array([float(pair[i].hi) for pair in found])
        )
        for i, name in enumerate((LEVEL, STAYS))
    }


def is_the_machine(problem: TubeProblem, recipe: HardwareRecipe) -> bool:
    """Whether a recipe is about the machine, the noise and the wind of the problem, where they are given."""
    if problem.machine is None:
        return False
    asked, wind = problem.machine.asked, problem.wind
    feedback_time = recipe.sample_time if asked.feedback_time is None else asked.feedback_time
    delay = recipe.sample_time if asked.one_sample else asked.delay
    noise = Fraction(1) if isinstance(asked.noise, tuple) else asked.noise
    given = (
        (asked.sample_time, recipe.sample_time),
        (delay, recipe.delay),
        (feedback_time, recipe.feedback_time),
        (noise, recipe.noise),
        (Fraction(0) if wind is None else wind.bound, recipe.wind),
        (asked.bandwidth, recipe.bandwidth),
    )
    alike = asked.predict == (recipe.prediction is not None) and (asked.arithmetic is None) == (
        not recipe.rounding
    )
    return alike and all(wanted is None or wanted == own for wanted, own in given)


def is_a_machine_like(problem: TubeProblem, own: HardwareRecipe | None, other: HardwareRecipe) -> bool:
    """Whether another recipe is about the same machine but for its sample time, and what follows from that."""
    if problem.machine is None or own is None:
        return False
    asked, Ts = problem.machine.asked, other.sample_time
    same = (
        (other.noise, own.noise),
        (other.wind, own.wind),
        (other.clip_radius, own.clip_radius),
        (other.delay, Ts if asked.one_sample else own.delay),
        (other.feedback_time, Ts if asked.feedback_time is None else asked.feedback_time),
        (other.prediction is None, own.prediction is None),
        (other.rounding, own.rounding),
    )
    return asked.bandwidth in (None, other.bandwidth) and all(a == b for a, b in same)


def stands_in_the_way(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """What no machine can overcome, and constants of the machine without a bound."""
    if problem.machine is None:
        return ()
    # what fills the tube in the long run need not fill a window
    lasting = () if problem.machine.windows else obstacles(problem)
    return unbounded(problem.machine.unbounded()) or uncovered(problem) or lasting


def ultimate_radius(problem: TubeProblem, recipe: HardwareRecipe) -> float:
    """A1/sqrt(a): |x - x*| is at most this in the long run, proven; that of the last window (A1 of (H.12))."""
    x = last(problem, recipe)
    return float((x.course.bound.ultimate() / sqrt(x.plant.n.a)).hi)


def last(problem: TubeProblem, recipe: HardwareRecipe) -> Evaluated[Interval]:
    """The formulas of the last window, or of the only one."""
    if recipe.windows:
        return windows.course_of(problem, recipe)[-1].at
    return evaluated(plant(problem, recipe.clip_radius), loop_of(recipe))


def _at_once(problem: TubeProblem, n: Numbers[Array]) -> object:
    """Everything that theorem H compares, at some machine."""
    del problem
    one = np.asarray(1.0)
    p = Plant(n=n, m=machines.ones(), beta_w=one, D_E=one, eps_w=one, rest=one, held=True)
    loop = Loop(
        Ts=one,
        tau=one,
        Tf=one,
        omega=one,
        nu=one,
        wbar=one,
        dhat=one,
        f0=one,
        Y=one,
        S=one,
        N=one,
        np=one,
        late=one,
        off=one,
    )
    x = evaluated(p, loop)
    return x.course.supremum() < reach(n), x.estimate.speed


THEOREM = Theorem(
    recipe=HardwareRecipe,
    margins=_margins,
    # a recipe that fails refutes nothing, nor do all of them
    ceilings=lambda problem, recipe: {LEVEL: np.inf, STAYS: np.inf},
    formula=_at_once,
    obstacles=stands_in_the_way,
    ultimate=ultimate_radius,
    about=is_the_machine,
    alike=is_a_machine_like,
    sizes=("delay", "noise", "wind", "speed", "bias", "ripple", "prediction", *_LOST),
    optional=("bandwidth", "prediction"),
    parts=("windows", "rounding"),
)
