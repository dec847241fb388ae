"""What another machine would do: how much narrower the tube of a better one is, and which easier one would serve.

In floats, for orientation, but for `easier`: what it names was checked by the kernel. Implements: theory section 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf
from typing import Final, get_args

import numpy as np

from tubecert.claims.advice import HardwareCause, HardwarePart
from tubecert.conditions.hardware import HardwareRecipe, told
from tubecert.conditions.machine import Machine
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Asked
from tubecert.kernel import Proof, check
from tubecert.search.hardware import Setting, propose_hardware, setting_at
from tubecert.search.lanes import Lanes, Search

PARTS: Final[tuple[HardwarePart, ...]] = ("sample_time", "delay", "noise", "wind")
"""A wind that is adapted to is a part of h, whose constants are those of its bound: it is none of these."""

CAUSES: Final[tuple[HardwareCause, ...]] = get_args(HardwareCause)
_NOTABLE: Final = 0.01


def halved(
    problem: TubeProblem, recipe: HardwareRecipe, parts: Sequence[HardwarePart] = PARTS
) -> dict[HardwarePart, float]:
    """The least level with a part of the machine halved over the least level, for each part that it has."""
    machine = problem.machine
    if machine is None or machine.windows:  # levels of several windows are not compared with one
        return {}
    now = _setting(recipe, machine)
    others = {part: other for part in parts if (other := _with_half(now, part, machine)) is not None}
    if not others:
        return {}
    lanes = [other.lanes() for other in others.values()]
    joined = Lanes(**{x: np.concatenate([getattr(each, x) for each in lanes]) for x in Lanes.__slots__})
    levels = Search(problem, machine).levels(joined).dhat / float(recipe.level)
    return {part: float(x) for part, x in zip(others, levels, strict=True) if np.isfinite(x)}


def _setting(recipe: HardwareRecipe, machine: Machine) -> Setting:
    """The machine of a recipe; a bandwidth that nobody asked for is chosen anew."""
    return Setting(
        sample_time=recipe.sample_time,
        delay=recipe.delay,
        feedback_time=recipe.feedback_time,
        noise=recipe.noise,
        wind=recipe.wind,
        bandwidth=machine.asked.bandwidth,
    )


def _with_half(now: Setting, part: HardwarePart, machine: Machine) -> Setting | None:
    """The same with half of a part; None where it has none, or where the delay would exceed the sample time."""
    size = getattr(now, part)
    if not size:
        return None
    other = replace(now, **{part: size / 2})
    if part == "sample_time":
        asked = machine.asked
        other = replace(
            other,
            delay=other.delay / 2 if asked.one_sample else other.delay,
            feedback_time=other.feedback_time if asked.feedback_time is not None else size / 2,
        )
    return other if other.delay <= other.sample_time else None


def filled(problem: TubeProblem, recipe: HardwareRecipe | None) -> dict[HardwareCause, float]:
    """What fills the level of a loop that does not serve, the largest share first; small ones left out."""
    if recipe is None:
        return {}
    budget = told(problem, recipe).budget
    shares = {cause: float(getattr(budget, cause)) for cause in CAUSES}
    return {
        cause: share
        for cause, share in sorted(shares.items(), key=lambda item: -item[1])
        if _NOTABLE < share < inf
    }


def easier(problem: TubeProblem, parts: Sequence[HardwarePart] = PARTS) -> dict[HardwarePart, Fraction]:
    """Where the machine does not serve: the largest value of each part, the others as they are, that is proven to."""
    machine = problem.machine
    if machine is None or machine.asked.largest is not None:
        return {}
    problem, machine = _at_once(problem, machine)
    own = setting_at(problem, machine, Fraction(1))
    found: dict[HardwarePart, Fraction] = {}
    for part in parts:
        sought = _sought(problem, machine, part) if getattr(own, part) else None
        recipe = None if sought is None else propose_hardware(sought, Asked(curve=False)).decisive
        if sought is not None and recipe is not None and isinstance(check(sought, recipe), Proof):
            found[part] = getattr(recipe, part)
    return found


def _at_once(problem: TubeProblem, machine: Machine) -> tuple[TubeProblem, Machine]:
    """The same with one window: a machine that serves there serves all the more in several."""
    machine = replace(machine, windows=())
    return replace(problem, machine=machine), machine


def _sought(problem: TubeProblem, machine: Machine, part: HardwarePart) -> TubeProblem | None:
    """The problem in which a part is the largest that serves; None where it is no single number."""
    asked, wind = machine.asked, problem.wind
    if part == "wind":
        if wind is None:
            return None
        changed = replace(asked, largest=part)
        return replace(problem, wind=replace(wind, bound=None), machine=replace(machine, asked=changed))
    if part == "noise" and isinstance(asked.noise, tuple):
        return None
    if part == "sample_time":
        changed = replace(asked, sample_time=None, largest=part)
    elif part == "delay":
        changed = replace(asked, delay=None, one_sample=False, largest=part)
    else:
        changed = replace(asked, noise=None, largest=part)
    return replace(problem, machine=replace(machine, asked=changed))
