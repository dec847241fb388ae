"""Attacks on theorem HW: no run leaves the level of its window, and levels that are too low are left."""

from __future__ import annotations

import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import proven
import pytest
from systems import IN_WINDOWS

from tubecert.simulate.compare import compare
from tubecert.simulate.monte_carlo import monte_carlo
from tubecert.simulate.promise import Levels
from tubecert.simulate.setting import setting_of
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.spec import load_text

sys.path.insert(0, str(Path(__file__).parents[1] / "harness"))

from hardware_attack import by_window


@pytest.mark.slow
def test_no_run_leaves_the_level_of_its_window():
    spec = load_text(IN_WINDOWS)
    setting = setting_of(spec, proven.result(IN_WINDOWS, bare=True, conditions="hardware"), Fraction(2))
    loop = loop_of(setting, "hardware", Choice())
    sample = monte_carlo(setting, loop, 8, 1)
    assert sample is not None
    met = by_window(loop, sample.runs)
    assert len(met) == 3
    assert 0 < min(met) <= max(met) < 1
    found = compare(setting, sample.runs, loop.promise)
    assert found.violations == ()
    # a last level that is less than what was met is left
    own = loop.promise.decay
    assert isinstance(own, Levels)
    low = replace(own, levels=(*own.levels[:-1], own.levels[-1] * met[-1] * 0.9))
    found = compare(setting, sample.runs, replace(loop.promise, decay=low))
    assert any(item.name == "D(t)" for item in found.violations)
