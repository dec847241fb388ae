"""The machine that a specification asks for, and whether a certificate is about that one."""

from __future__ import annotations

from fractions import Fraction

from tubecert.recheck.cover import Outcome
from tubecert.recheck.kinds.bounds import all_of
from tubecert.recheck.kinds.hardware_section import (
    OF_MACHINE,
    HardwareSection,
)
from tubecert.recheck.kinds.kind import Ground
from tubecert.recheck.metric import stated
from tubecert.recheck.recipe import Digital, Promise
from tubecert.recheck.specified.hardware import Hardware


def agrees(section: HardwareSection, recipe: Digital, ground: Ground) -> Outcome:
    """The section, the recipe and the specification speak of one machine."""
    asked = ground.asked
    for key in OF_MACHINE:
        if section.machine[key] != getattr(recipe, key):
            return stated(False, f"the recipe has another {key}")
    searched = [name for name, value in _given(asked, ground, recipe) if value is None]
    statements = [
        (recipe.bandwidth == section.bandwidth, "the recipe has another bandwidth"),
        (section.deadbeat == (section.bandwidth is None), "`deadbeat` says otherwise than the bandwidth"),
        (section.predict == asked.predict, "`predict` is not that of the specification"),
        (
            asked.predict == (recipe.prediction is not None),
            "the recipe predicts otherwise than the specification",
        ),
        (
            (asked.arithmetic is None) == (recipe.losses is None),
            "the recipe rounds otherwise than the specification",
        ),
        (asked.bandwidth in (None, recipe.bandwidth), "the bandwidth is not that of the specification"),
        (len(recipe.windows) == len(section.windows), "the recipe has other windows"),
        (section.largest == (searched[0] if searched else None), "`largest` is not what is searched for"),
    ]
    own = {
        "sample_time": recipe.sample_time,
        "delay": recipe.delay,
        "noise": recipe.noise,
        "wind": recipe.wind,
    }
    statements += [
        (value is None or value == own[name], f"{name} is not that of the specification")
        for name, value in _given(asked, ground, recipe)
    ]
    feedback = recipe.sample_time if asked.feedback_time is None else asked.feedback_time
    statements.append((recipe.feedback_time == feedback, "feedback_time is not that of the specification"))
    return all_of(stated(*statement) for statement in statements)


def _given(asked: Hardware, ground: Ground, recipe: Digital) -> list[tuple[str, Fraction | None]]:
    """What the specification says of the machine and of the wind; None where the largest is searched for."""
    noise = Fraction(1) if isinstance(asked.noise, tuple) else asked.noise
    wind = ground.specification.disturbance
    return [
        ("sample_time", asked.sample_time),
        ("delay", recipe.sample_time if asked.one_sample else asked.delay),
        ("noise", noise),
        ("wind", Fraction(0) if wind is None else wind.bound),
    ]


def promise(asked: Hardware) -> Promise:
    """What the specification promises of the machine."""
    drift = asked.noise_rate
    if drift is not None and isinstance(asked.noise, tuple):
        # a vector of that length is within so many units of noise: its other entries are 0
        drift = drift / min((size for size in asked.noise if size), default=Fraction(1))
    return Promise(held=asked.held, predicts=asked.predict, drift=drift, arcs=asked.arcs)
