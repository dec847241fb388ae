"""Theorem H and the units of inputs and time, which its constants state; what grows with delay, noise and wind."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from fractions import Fraction

import pytest
from machines import covariant_constants, hardware_constants, windy
from problems import constants as tube_constants
from test_hardware import FORMS, proving, settled, values_of

from tubecert.bounds.constants import TABLE
from tubecert.conditions.hardware import margins_hardware

F = Fraction
OF_RECIPE = {
    "sample_time": "s",
    "delay": "s",
    "feedback_time": "s",
    "bandwidth": "1/s",
    "clip_radius": "u",
    "speed": "x/s",
    "bias": "u",
    "ripple": "u",
}


def factor(unit: str, sizes: dict[str, Fraction]) -> Fraction:
    """What a number in a unit becomes when the units of `sizes` are so many times smaller."""
    above, _, below = unit.replace("(", "").replace(")", "").partition("/")
    found = F(1)
    for part, sign in ((above, 1), (below, -1)):
        for name, power in re.findall(r"([a-z])(?:\^(\d))?", part):
            found *= sizes.get(name, F(1)) ** (sign * int(power or 1))
    return found


def changed(constants, make, sizes):
    units = {item.name: item.metadata["meaning"].unit for item in fields(constants)}
    values = values_of(constants)
    return make(
        **{name: None if v is None else v * float(factor(units[name], sizes)) for name, v in values.items()}
    )


@pytest.mark.parametrize("sizes", [{"u": F(8)}, {"s": F(8)}, {"u": F(1, 4), "s": F(2)}], ids=str)
@pytest.mark.parametrize(
    "name", ["plain", "prediction", "a flat metric", "wind", "covariant in wind", "a horizon", "no filter"]
)
def test_units_of_inputs_and_time_do_not_matter(name, sizes):
    """By the units that the constants state; factors are powers of two, so that every number stays exact."""
    problem, own = FORMS[name][0], proving(name)
    machine, wind = problem.machine, problem.wind
    asked = replace(
        machine.asked,
        **{
            key: None if (value := getattr(machine.asked, key)) is None else value * factor("s", sizes)
            for key in ("sample_time", "delay", "feedback_time")
        },
    )
    known = {item: getattr(problem.constants, item).above for item in TABLE}
    other = replace(
        problem,
        constants=tube_constants(**{k: v * float(factor(TABLE[k].unit, sizes)) for k, v in known.items()}),
        rate=problem.rate / factor("s", sizes),
        horizon=None if problem.horizon is None else problem.horizon * factor("s", sizes),
        machine=replace(
            machine,
            constants=changed(machine.constants, hardware_constants, sizes),
            covariant=None
            if machine.covariant is None
            else changed(machine.covariant, covariant_constants, sizes),
            clip=tuple((low * factor("u", sizes), high * factor("u", sizes)) for low, high in machine.clip),
            asked=asked,
        ),
    )
    if wind is not None:
        units = {item.name: item.metadata["meaning"].unit for item in fields(wind.constants)}
        values = values_of(wind.constants)
        other = windy(other, wind.bound, **{k: v * float(factor(units[k], sizes)) for k, v in values.items()})
    recipe = replace(
        own,
        **{
            key: None if (value := getattr(own, key)) is None else value * factor(unit, sizes)
            for key, unit in OF_RECIPE.items()
        },
    )
    ours, theirs = margins_hardware(problem, own), margins_hardware(other, recipe)
    assert ours[1].lo > 0
    assert [float(m.lo) for m in theirs] == pytest.approx([float(m.lo) for m in ours], rel=1e-9)


def needed(problem, own) -> float:
    """1 less the margin: what the level that is settled for a machine needs of it."""
    return 1 - float(margins_hardware(problem, settled(problem, own))[1].lo)


def with_machine(problem, own, **values):
    """Another machine in the specification, and in the recipe."""
    asked = replace(problem.machine.asked, **values)
    known = {key: value for key, value in values.items() if key != "noise_rate"}
    return replace(problem, machine=replace(problem.machine, asked=asked)), replace(own, **known)


@pytest.mark.parametrize("name", ["plain", "a flat metric", "prediction", "covariant"])
def test_a_later_input_and_more_noise_need_more_and_tend_to_what_none_needs(name):
    problem, own = FORMS[name][0], proving(name)
    for key, most in (("delay", F(1, 1000)), ("noise", F(1, 500))):
        sizes = (most / 10**12, most / 10**9, most / 4, most / 2, most)
        found = [needed(*with_machine(problem, own, **{key: size})) for size in sizes]
        assert found == sorted(found), key
        assert found[1] - found[0] < 1e-6 < found[-1] - found[0], key


@pytest.mark.parametrize("name", ["plain", "a flat metric", "covariant"])
def test_more_wind_needs_more_and_tends_to_what_none_needs(name):
    problem, own = FORMS[name][0], proving(name)
    calm = needed(problem, own)
    sizes = (F(1, 10**12), F(1, 100), F(1, 50))
    found = [needed(windy(problem, size), replace(own, wind=size)) for size in sizes]
    assert calm <= found[0] < calm + 1e-8
    assert calm + 1e-3 < found[1] < found[2]
