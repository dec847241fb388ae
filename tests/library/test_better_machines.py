"""The settings of better machines: each is a specification in which one thing is better, all else being as it was."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest
from systems import SCALAR
from tubecert.library.trading import better_machines, largest

from tubecert.errors import SpecError
from tubecert.spec import load_text
from tubecert.spec.load import load_source
from tubecert.spec.source import Source

LIMITED = "rate: 200, limits: {u: [-4, 6]}"


def changed(text):
    """The specification of each better machine."""
    spec = load_text(text)
    return {
        (each.part, each.gone): load_source(Source.of("s.yaml", text), each.settings)
        for each in better_machines(spec, str)
    }


def test_one_number_is_better_and_limits_that_stand_in_the_machine_stay():
    spec = load_text(SCALAR.replace("rate: 200", LIMITED))
    own = spec.hardware
    found = changed(SCALAR.replace("rate: 200", LIMITED))
    assert spec.limits == (("u", (-4, 6)),)
    half, none = Fraction(1, 2), Fraction(0)
    for key, machine in {
        ("sample_time", False): replace(own, sample_time=own.sample_time / 2),
        ("noise", False): replace(own, noise=own.noise * half),
        ("noise", True): replace(own, noise=none),
    }.items():
        assert found[key].hardware == machine
        assert found[key].limits == spec.limits
    assert found["sample_time", True].hardware.sample_time == max(own.sample_time / 100, own.delay)
    assert found["limits", False].limits == (("u", (-9, 11)),)
    assert found["limits", False].hardware == own


def test_noise_by_state_one_sample_of_delay_and_wind():
    text = SCALAR.replace("rate: 200", "rate: 200, delay: one sample").replace(
        "noise: 0.001", "noise: {x: 0.01}"
    )
    text += "disturbance: {E: [[1]], bound: 0.2}\n"
    spec, found = load_text(text), changed(text)
    assert found["noise", False].hardware.noise == tuple(each / 2 for each in spec.hardware.noise)
    assert found["noise", True].hardware.noise == tuple(0 for _ in spec.hardware.noise)
    assert found["delay", True].hardware.delay == 0
    assert not found["delay", True].hardware.one_sample
    assert found["sample_time", False].hardware.one_sample
    assert (found["wind", False].disturbance.bound, found["wind", True].disturbance.bound) == (
        Fraction(1, 10),
        0,
    )


def test_the_largest_rate_keeps_limits_that_stand_in_the_machine():
    """They were dropped, and the machine that was offered did not keep them."""
    text = SCALAR.replace("rate: 200", LIMITED)
    asked = load_source(Source.of("s.yaml", text), largest(load_text(text), "sample_time"))
    assert asked.limits == (("u", (-4, 6)),)


def test_a_machine_of_which_a_number_is_looked_for_has_none():
    with pytest.raises(SpecError, match="not given by numbers"):
        better_machines(load_text(SCALAR.replace("rate: 200", "sample_time: largest")), str)
