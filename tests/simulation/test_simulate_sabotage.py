"""Certificates that lie are found by the default campaign, told with seed, run and time, and the run can be repeated.

That of a sampled loop whose table has another sign is in tests/simulation/test_sampled_attack.py.
"""

import re
from dataclasses import replace
from fractions import Fraction

import pytest
from simulated import setting

from tubecert.library.simulating import RUNS
from tubecert.report.simulation import page_of
from tubecert.report.terminal import Terminal
from tubecert.report.text import screen
from tubecert.simulation.adaptive.campaign import simulate
from tubecert.simulation.adaptive.setting import Choice, loop_of

SEED = 0


def gains(own, part=10):
    """They are a tenth of those that are certified."""
    loop = loop_of(own, "l1", Choice())
    honest = loop.gains
    less = {name: getattr(honest, name) / part for name in ("bandwidth", "adaptation_rate")}
    return own, replace(loop, gains=replace(honest, **less))


def lower_gains(own):
    """A hundredth: no loop of flat leaves the tube, with a thousandth it reaches .63 of it; a tenth breaks nothing."""
    return gains(own, 100)


def uncertainty(own):
    """h is outside of its class: twice as large, and as fast."""
    names = ("h", "h_x", "h_t", "h_initial")
    own = replace(
        own,
        uncertainty=replace(own.uncertainty, **{name: 2 * getattr(own.uncertainty, name) for name in names}),
    )
    return own, loop_of(own, "l1", Choice())


def metric(own):
    """W times .9: distances are 5 % longer than they were certified."""
    W = tuple(tuple(Fraction(9, 10) * entry for entry in row) for row in own.model.W)
    own = replace(own, model=replace(own.model, W=W))
    return own, loop_of(own, "l1", Choice())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "lie", "bound"),
    [
        ("two_state", gains, "tube"),
        ("flat", lower_gains, "xtilde"),
        ("flat", uncertainty, "xtilde"),
        ("flat", metric, "D(t)"),
    ],
)
def test_a_lie_is_found_with_seed_run_and_time(name, lie, bound):
    own, loop = lie(setting(name))
    found = simulate(own, [loop], count=RUNS, seed=SEED)
    assert (found.outcome, found.seed) == ("falsified", SEED)
    random, aimed = (
        part.comparison.violations for part in (found.attacks[0].random, found.attacks[0].adversary)
    )
    assert bound in {item.of for item in aimed}
    broken = next(item for item in random if item.of == bound)
    assert broken.value > broken.bound
    told = Terminal(stream=None, colored=False, width=120, interactive=False).text(
        screen(page_of(found), [], verbose=True)
    )
    assert re.search(rf"falsified l1, .* t = \S+ s, random run {broken.run}, seed {SEED}\n", told), told
    again = simulate(own, [loop], count=0, seed=SEED, replay=broken.run).loops[0].comparison
    same = next(item for item in again.violations if item.of == bound)
    assert same.value == pytest.approx(broken.value, rel=1e-2)
    assert same.t == pytest.approx(broken.t, abs=0.05 * own.horizon)


@pytest.mark.slow
def test_the_truth_is_not_falsified():
    own = setting("flat")
    found = simulate(own, [loop_of(own, "l1", Choice())], count=RUNS, seed=SEED)
    assert found.outcome == "not falsified"
