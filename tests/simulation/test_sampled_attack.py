"""Adversaries: what they attain on loops without remainders, what they never exceed, and that they find lies."""

from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from loops import proven, setting
from scipy.optimize import linprog

from tubecert.controller.recursion import linear
from tubecert.simulation.sampled import campaign
from tubecert.simulation.sampled.attack import Attack, Lanes, goals, worst_of
from tubecert.simulation.sampled.campaign import Campaign, simulate
from tubecert.simulation.sampled.loop import resolved


def followed(aims, size, rate):
    """What a signal comes to that goes where it is sent: values at the ends of samples, the oldest first."""
    h = [aims[-1]]
    for aim in aims[::-1]:
        h.append(np.clip(aim, h[-1] - rate, h[-1] + rate))
    return np.clip(h, -size, size)


@pytest.mark.parametrize("rate", [0.02, 0.3, 5.0, np.inf])
def test_a_slow_signal_does_its_worst_as_a_linear_program_says(rate):
    weights = np.random.default_rng(3).normal(size=60).cumsum()
    h = followed(goals(weights, 1.0, rate), 1.0, rate)
    cost = np.append(weights[::-1] / 2, 0) + np.append(0, weights[::-1] / 2)
    steps = np.eye(60, 61, 1) - np.eye(60, 61)
    most = np.full(120, min(rate, 2.0))
    best = linprog(-cost, A_ub=np.vstack([steps, -steps]), b_ub=most, bounds=(-1, 1))
    assert cost @ h == pytest.approx(-best.fun, rel=0.03)
    assert cost @ h <= -best.fun * (1 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["scalar", "cart"])
def test_a_loop_without_remainders_is_driven_to_its_edge_and_not_beyond(name):
    found = simulate(setting(name), "hash", runs=30, seed=0)
    assert found.outcome == "not falsified"
    assert 0 < found.error < 1e-6
    assert (found.by_stage[1, :, -1] > 0.93).all()
    for i in range(len(found.setting.names)):
        assert 0.95 < found.peak(i, found.aimed).share <= 1
        assert found.peak(i, ~found.aimed).share <= 1


@pytest.mark.slow
def test_signals_and_starts_keep_to_their_bounds_however_small_kernels_are():
    """A long run forgets its start to 1e-170, whose squares are no numbers."""
    np.testing.assert_allclose(worst_of(np.array([[3e-170, -4e-170]]), True), [[0.6, -0.8]])
    attack = Attack(setting("pendulum", duration="3"), seed=0)
    lanes = Lanes(attack, range(len(attack.aims) + 20))
    assert 0.3 < np.isin(lanes.parameters, [0.9, 1.1]).mean() < 0.7, "half of the parameters are corners"
    starts = np.linalg.norm(lanes.off, axis=0)
    assert starts[lanes.aimed] == pytest.approx(0.02, rel=1e-12)
    assert starts.max() <= 0.02 * (1 + 1e-12)
    for k in (0, 1, 149):
        assert np.linalg.norm(lanes.signals(k)[0], axis=0).max() <= 0.0005 * (1 + 1e-12)


@pytest.mark.slow
def test_an_adversary_begins_again_after_its_aim():
    attack = Attack(setting("scalar"), seed=0)
    [number, *_] = np.flatnonzero(attack.aims[:, 1] == 8)
    lanes = Lanes(attack, range(number, number + 1))
    noise = np.array([lanes.signals(k)[0] for k in range(18)])
    np.testing.assert_array_equal(noise[:9], noise[9:])
    assert noise.any()


@pytest.mark.slow
def test_an_h_of_which_only_the_size_is_known_may_jump():
    own = setting("cart", ('{h: ["0.2*sin(t)"]}', "{bounds: {h: 0.2}}"))
    assert (own.slow.size, own.slow.rate, own.slow.first) == (0.2, np.inf, 0.2)


@pytest.mark.slow
def test_one_run_that_is_not_resolved_is_no_result():
    attack = Attack(setting("scalar"), seed=0)
    seen = resolved(attack, partial(linear, attack.setting.tables), range(2))
    for error, outcome in ((0.009, "not falsified"), (0.011, "no result")):
        found = Campaign(attack, "h", 2, "floats", [seen._replace(error=np.array([0.0, error]))])
        assert found.outcome == outcome


def sabotaged(how):
    """A loop whose certificate is a lie."""
    if how == "h":
        return setting("cart", ("0.2*sin", "0.3*sin"))
    result = proven("cart")
    if how == "sign":
        return setting("cart", controller=replace(result.controller, N=result.controller.N * [[1, -1]]))
    narrow = [{name: w * Fraction(9, 10) for name, w in own.half_widths.items()} for own in result.tube]
    tube = (replace(own, half_widths=w) for own, w in zip(result.tube, narrow, strict=True))
    return setting("cart", tube=tuple(tube))


@pytest.mark.slow
@pytest.mark.parametrize("how", ["h", "sign", "width"])
def test_a_lie_is_found_with_seed_run_and_time(how):
    own = sabotaged(how)
    found = simulate(own, "hash", runs=20, seed=4)
    assert (found.outcome, found.summary["seed"]) == ("falsified", 4)
    first = found.violations[0]
    run, attack = first.run, Attack(own, seed=4)
    again, of = (
        resolved(attack, partial(linear, own.tables), range(run, run + 1)),
        own.names.index(first.of),
    )
    assert own.t[again.node[of, 0]] == first.t
    assert again.most[of, 0] == pytest.approx(first.share, rel=1e-9)


@pytest.mark.slow
def test_what_is_finished_stays_and_the_same_seed_says_the_same(monkeypatch):
    monkeypatch.setattr(campaign, "LANES", 32)
    told = []

    def stop(step):
        told.append(step.done)
        if step.done >= 64:
            raise KeyboardInterrupt

    own = setting("scalar")
    whole, some = simulate(own, "h", runs=60, seed=1), simulate(own, "h", runs=60, seed=1, report=stop)
    assert (some.outcome, some.runs, told) == ("interrupted", 64, [0, 32, 64])
    np.testing.assert_array_equal(whole.peaks["share"][:, :64], some.peaks["share"])
    assert whole.summary["states"]["x"]["random_by_stage"]
    assert (simulate(own, "h", runs=60, seed=2).peaks["share"] != whole.peaks["share"])[:, 60:].any()


@pytest.mark.slow
def test_inputs_and_obstacles_are_judged_as_well():
    own = setting("cart")
    use = own.result.inputs[0]
    near = setting("cart", inputs=(replace(use, range=(Fraction(-1, 10), use.range[1])),))
    assert simulate(near, "h", runs=0, seed=0).outcome == "falsified"
    assert simulate(own, "h", runs=0, seed=0).obstacles[0].clearance > 1
    touched = setting("cart", ("center: [2, 0]", "center: [0.5, 0]"))
    assert proven("cart").clearance[0].verdict.value == "certified"
    assert simulate(touched, "h", runs=0, seed=0).outcome == "falsified"
