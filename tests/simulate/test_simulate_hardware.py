"""Certificate H end to end: at its own numbers no bound breaks, at several times these the bounds do."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import proven
import pytest
from simulated import FLAT

sys.path.insert(0, str(Path(__file__).parents[1] / "harness"))

from hardware_attack import ROWS, WIND, Row, certified, scaled, shares

from tubecert.errors import TubecertError
from tubecert.simulate.campaign import simulate
from tubecert.simulate.setting import setting_of
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.spec import load_text

BOX = Row("two_state_orbit", "{sample_time: 1/1000, delay: 1/2000, noise: {x1: 1/2000, x2: 1/1000}}", WIND)


@lru_cache
def made(name):
    with proven.barely():
        return certified(replace(BOX if name == "box" else ROWS[name], duration="1"))


def attacked(setting, loop, count, seed):
    """Random runs and an adversary."""
    (found,) = simulate(setting, [loop], count=count, seed=seed).attacks
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box", "predicts"])
def test_nothing_breaks_at_the_certified_numbers_and_much_is_used(name):
    found = attacked(*made(name), 20, 5)
    for comparison in (found.comparison, found.worst_comparison):
        assert not comparison.violations
        assert not comparison.unreliable
    used = shares(found.comparison, found.worst_comparison)
    assert used["estimate"] > 0.8
    assert used["sigma_error"] > 0.8


@pytest.mark.slow
def test_four_times_the_hardware_breaks_what_is_known_of_h():
    found = attacked(*scaled(*made("box"), 4), 20, 5)
    assert shares(found.comparison, found.worst_comparison)["estimate"] > 1.3


@pytest.mark.slow
def test_far_beyond_the_hardware_the_level_is_left():
    found = attacked(*scaled(*made("clean"), 10), 20, 5)
    assert shares(found.worst_comparison)["distance"] > 1
    assert "tube" in {item.name for item in found.worst_comparison.violations}


@pytest.mark.slow
def test_a_sample_time_of_ones_own_is_not_certified():
    setting, _ = made("box")
    chosen = loop_of(
        setting, "hardware", Choice(sample_time=made("box")[0].certified.machine.recipe.sample_time * 2)
    )
    assert chosen.promise is None
    assert chosen.problem.machine.delay == pytest.approx(1 / 1000)


@pytest.mark.slow
def test_noise_is_that_of_each_state_and_h_stays_in_the_box_of_the_clip():
    setting, loop = made("box")
    sources = setting.on_machine.sources
    assert np.abs(sources.table).max(axis=0) == pytest.approx([1 / 2000, 1 / 1000])
    found = attacked(setting, loop, 10, 1)
    low, high = sources.box[:, 0]
    assert low <= found.worst.h.min() <= found.worst.h.max() <= high
    assert found.worst.sigma_hat.min() >= low


@pytest.mark.slow
def test_without_certificate_h_there_is_no_such_loop():
    spec = load_text(FLAT)
    setting = setting_of(spec, proven.result(FLAT, bare=True, conditions="distance"))
    with pytest.raises(TubecertError, match="does not certify the controller hardware"):
        loop_of(setting, "hardware", Choice())


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["l1", "sampled"])
def test_a_wind_blows_on_the_loops_of_b_and_c_and_breaks_nothing(controller):
    text = FLAT + "disturbance: {E: [[1, 0], [0, 1]], bound: 1/100}\n"
    setting = setting_of(load_text(text), proven.result(text, bare=True, conditions="all"))
    loop = loop_of(setting, controller, Choice())
    assert loop.promise.decay.defect > 0.009 * setting.certified["wind_push"] > 0  # the plan has none
    found = attacked(setting, loop, 15, 2)
    assert found.worst_comparison.uses["distance"].share > 0.1
    for comparison in (found.comparison, found.worst_comparison):
        assert not comparison.violations
        assert not comparison.unreliable
