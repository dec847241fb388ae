"""Inputs with limits in runs: every loop keeps to what is proven of it, and a bound that is too small is broken."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import proven
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import FLAT

from tubecert.letters import name_of
from tubecert.simulation.adaptive.campaign import simulate
from tubecert.simulation.adaptive.judge import compare
from tubecert.simulation.adaptive.setting import Choice, loop_of, setting_of
from tubecert.spec import load_text
from tubecert.verdict import Verdict

LIMITED = FLAT + "limits: {u: [-3, 4]}\n"
CONTROLLERS = {"A": "l1", "B": "l1"}


def made(text, kinds="all"):
    spec = load_text(text)
    result = proven.result(text, bare=True, conditions=kinds)
    assert result.verdict is Verdict.CERTIFIED
    return setting_of(spec, result), result


def of_all(found):
    """The comparisons of a campaign with one loop, which falsified nothing."""
    assert found.outcome == "not falsified"
    (drawn,), (attack,) = found.loops, found.attacks
    return drawn.comparison, attack.random.comparison, attack.adversary.comparison


@pytest.fixture(scope="module")
def limited():
    return made(LIMITED)


@pytest.mark.slow
@pytest.mark.parametrize("letter", CONTROLLERS)
def test_random_runs_and_an_adversary_stay_within_what_is_proven(limited, letter):
    setting, result = limited
    loop = loop_of(setting, CONTROLLERS[letter], Choice(source=name_of(letter).option))
    found = simulate(setting, [loop], count=20, seed=3)
    (own,) = result.inputs
    for comparison in of_all(found):
        (use,) = comparison.went.values()
        assert use.proven[0] <= use.least <= use.greatest <= use.proven[1]
        # the plan is at rest: u is all of the loop's
        assert own.plan.least.above == own.plan.greatest.above == 0
        assert use.greatest - use.least > 0.05  # and it does something
    told = found.summary("sha256:0")
    assert {name for part in told["loops"] for name in part["went"]} == {"u"}
    assert told["attacks"][0]["random"]["went"]["u"]["proven"] == list(use.proven)


@pytest.mark.slow
@pytest.mark.parametrize("end", ["least", "greatest"])
def test_a_bound_that_is_too_small_is_broken_by_a_run(limited, end):
    setting, _ = limited
    loop = loop_of(setting, "l1", Choice(source="distance"))
    runs = simulate(setting, [loop], count=0, seed=0).loops[0].runs
    fair = compare(setting, runs, loop.promise)
    assert not fair.violations
    use = fair.went["u"]
    met = getattr(use, end)
    proven = replace(loop.promise.ranges["u"], **{end: 0.9 * met})
    forged = replace(loop.promise, ranges={"u": proven})
    (broken,) = compare(setting, runs, forged).violations
    assert broken.of == ("input u" if end == "greatest" else "input -u")
    assert broken.value == pytest.approx(abs(met))
    assert broken.bound == pytest.approx(0.9 * abs(met))


@pytest.mark.slow
def test_a_loop_that_is_not_covered_is_told_and_not_compared(limited):
    setting, _ = limited
    loop = loop_of(setting, "ccm", Choice())
    (drawn,) = simulate(setting, [loop], count=0, seed=0).loops
    use = drawn.comparison.went["u"]
    assert use.proven is None
    assert use.greatest == drawn.runs.found.greatest.max() >= drawn.runs.u.max()


@pytest.mark.slow
def test_without_limits_nothing_is_told():
    setting, _ = made(FLAT, "distance")
    loop = loop_of(setting, "l1", Choice(source="distance"))
    found = simulate(setting, [loop], count=0, seed=0)
    assert found.loops[0].comparison.went == {}
    assert all("went" not in part for part in found.summary("sha256:0")["loops"])


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(
    st.fractions("1/10", "2/5", max_denominator=50),
    st.fractions(1, 8, max_denominator=20),
    st.integers(0, 1000),
)
def test_a_moving_plan_with_two_inputs_stays_within(size, frequency, seed):
    """Two inputs of unlike size, one of them with limits; the plan moves and its input does too."""
    size, frequency = Fraction(size), Fraction(frequency)
    text = f"""
tubecert: 1
name: pair
system: {{states: [x, y], inputs: [u, v], f: ["-x + y**3/5", "-2*y + x/4"], B: [[1, "1/5"], [0, 2]]}}
safe_set: {{x: [-3, 3], y: [-3, 3]}}
uncertainty: {{h: ["{size}*sin({frequency}*t)*cos(y)", "{size}*cos({frequency}*t)/2"]}}
trajectory:
  kind: expressions
  x: ["sin(t)/2", "0"]
  u: ["(cos(t) + sin(t))/2 + sin(t)/80", "-sin(t)/16"]
  horizon: 2
initial_state: {{at: [0.05, 0.02]}}
metric: {{rate: 0.5, dual_metric: [[1, 0], [0, 1]]}}
tube: {{epsilon: 0.3, rho_a: 0.2}}
limits: {{v: [-9, 9]}}
"""
    setting, result = made(text, "distance")
    loop = loop_of(setting, "l1", Choice(source="distance"))
    found = simulate(setting, [loop], count=10, seed=seed)
    (own,) = result.inputs
    assert own.input == "v"
    bound = own.bounds["distance"]
    for comparison in of_all(found):
        (use,) = comparison.went.values()
        assert use.proven == (bound.least, bound.greatest)
        assert bound.least <= use.least <= use.greatest <= bound.greatest
    runs = found.loops[0].runs
    planned = runs.u_plan[:, 1]
    assert own.plan.least.below <= planned.min() <= own.plan.least.above + 1e-3
    assert own.plan.greatest.below - 1e-3 <= planned.max() <= own.plan.greatest.above
    assert np.abs(runs.u[..., 1] - planned).max() <= bound.feedback + bound.adaptation
