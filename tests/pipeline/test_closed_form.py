"""Designs of a linear loop whose level is known in closed form: none beyond what any controller could do, none missed.

x' = -2 x + u + h + w in a metric of rate 2: nothing is fed back, and every constant of theorem H is a number of the
specification. So the theorem is a few lines, a grid over bandwidths and tubes is its brute force, and what no
controller prevents before its first sample acts is a bound from below.
"""

from __future__ import annotations

from contextlib import contextmanager
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from tubecert.library.trading import better_machines
from tubecert.pipeline.sensitivities import sensitivities

from tubecert.pipeline import Options, certification, certify, design
from tubecert.pipeline.width import Measure, size_of
from tubecert.search import hardware
from tubecert.spec import load_text
from tubecert.spec.load import load_source
from tubecert.spec.source import Source
from tubecert.stages.memory import Memory
from tubecert.stages.result import Explanation

UNSHRUNK = (Phase.explicit, Phase.reuse, Phase.generate)  # an example costs half a second to two
RATE = 2.0
RADIUS = Measure(units={})
TOLERANCE = 0.03  # without noise, wind and change the proof is given up to 2 % to spare, else next to nothing
LINEAR = """
tubecert: 1
name: linear
system: {{states: [x], inputs: [u], f: ["-2*x"], B: [[1]]}}
safe_set: {{x: [-8, 8]}}
uncertainty: {{bounds: {{h: {h}, h_x: 0, h_t: {h_t}}}}}
trajectory: {{kind: equilibrium, at: [0]}}
metric: {{rate: 2, dual_metric: [[1]]}}
tube: {{epsilon: {radius}, rho_a: {radius}}}
hardware: {{sample_time: {Ts}, delay: {tau}, noise: {noise}}}
disturbance: {{E: [[1]], bound: {wind}}}
conditions: {{decides: H}}
"""
ALONE = Options(conditions="hardware")
SAMPLE_TIMES = [Fraction(1, k) for k in (5, 20, 100, 1000)]
SHARES = [Fraction(0), Fraction(1, 2), Fraction(1)]
MACHINES = st.builds(
    lambda h, h_t, Ts, share, noise, wind: {
        "h": h,
        "h_t": h_t,
        "Ts": Ts,
        "tau": share * Ts,
        "noise": noise,
        "wind": wind,
    },
    h=st.sampled_from([Fraction(1, 4), Fraction(1)]),
    h_t=st.sampled_from([0, 1, 3]),
    Ts=st.sampled_from(SAMPLE_TIMES),
    share=st.sampled_from(SHARES),
    noise=st.sampled_from([Fraction(0), Fraction(1, 1000), Fraction(1, 50)]),
    wind=st.sampled_from([Fraction(0), Fraction(1, 10), Fraction(1, 2)]),
)


@contextmanager
def quick():
    """Neither curves nor reasons: neither is asked for here, and they cost most."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hardware, "_curve", lambda *_, **__: ())
        patch.setattr(certification, "explain", lambda judged: Explanation())
        patch.setattr(design, "_FARTHEST", 1)
        patch.setattr(design, "_NARROWINGS", 2)
        yield


def at(machine, scale):
    """A tube of this radius."""
    return load_text(LINEAR.format(radius=scale / 2, **machine))


def least(machine, radius):
    """The level in a tube, by the best of many filters."""
    own = {key: float(value) for key, value in machine.items()}
    omega = np.append(np.geomspace(0.5, 40 / own["Ts"], 300), np.inf)
    return float(needed(float(radius), omega, **own).min())


def unavoidable(machine):
    """Where h + w, of either sign, has pushed the state before an input can know of it."""
    own = {key: float(value) for key, value in machine.items()}
    return (own["h"] + own["wind"]) * -np.expm1(-RATE * (own["Ts"] + own["tau"])) / RATE


def needed(rho, omega, *, h, h_t, Ts, tau, noise, wind):
    """The level of theorem H (docs/theory.md, 8) in a tube of radius rho, for filters omega (K,), inf: none.

    Its formulas, where f_x = -2, F = 0, B = beta = 1, and h(0) is as large as h.
    """
    th = -np.expm1(-omega * Ts)
    lag = np.where(np.isinf(omega), 0.0, (1 - th) / th)
    wait = Ts + tau
    ripple = 2 * th / Ts * noise
    X = h + 0 * th
    for _ in range(50):  # S and N are at most 2 h together: the estimate is clipped at h
        speed = RATE * rho + X + wind
        bias = lag * h_t * Ts + h_t * Ts / 2 + RATE * (speed * Ts / 4 + noise) + wind
        X = np.minimum(2 * h, np.maximum(h, bias + np.maximum(h - bias, 0) + ripple + h_t * wait))
    first = (np.minimum(h, h + h_t * wait) + wind) * -np.expm1(-RATE * wait) / RATE
    inside = Ts / -np.expm1(-RATE * Ts) - 1 / RATE
    final = (bias + ripple + h_t * (tau + inside) + wind) / RATE
    extra = np.maximum(h - bias, 0)
    t = np.concatenate([[0.0], np.geomspace(1e-5, 20, 400)])[:, None]
    fast = np.where(np.isinf(omega), 1e9, omega)
    fast = np.where(np.abs(fast - RATE) < 1e-6, RATE + 1e-6, fast)
    swing = (np.exp(-RATE * t) - np.exp(-fast * t)) / (fast - RATE)
    course = final + (first - final) * np.exp(-RATE * t) + extra * swing
    return np.maximum(first, np.maximum(course.max(axis=0), final))


@pytest.mark.slow
@settings(max_examples=8, deadline=None, phases=UNSHRUNK)
@given(machine=MACHINES, radius=st.sampled_from([Fraction(1, 5), Fraction(1)]))
def test_a_level_is_the_one_of_the_closed_form_and_there_is_none_where_that_does_not_fit(machine, radius):
    with quick():
        size, level = size_of(certify(at(machine, radius), ALONE), RADIUS), least(machine, radius)
    room = float(radius) - float(machine["noise"])
    if size is None:
        assert level > room * (1 - TOLERANCE)
    else:
        assert level < room * (1 + TOLERANCE)
        assert size == pytest.approx(level, rel=TOLERANCE)
        assert size >= unavoidable(machine)


@pytest.mark.slow
@settings(max_examples=2, deadline=None, phases=UNSHRUNK)
@given(machine=MACHINES)
def test_no_grid_of_tubes_and_filters_finds_a_narrower_tube_than_the_design(machine):
    with quick():
        found = design.narrowest(lambda scale: at(machine, scale), ALONE, RADIUS)
    noise = float(machine["noise"])
    levels = [(radius, least(machine, radius)) for radius in np.geomspace(0.01, 2, 60)]
    fit = [level for radius, level in levels if level + noise < radius * (1 - TOLERANCE)]
    if found.best is None:
        tried = [float(each.scale) for each in found.attempts]
        assert all(least(machine, radius) + noise > radius * (1 - TOLERANCE) for radius in tried)
    else:
        assert found.best.size <= min(fit, default=np.inf) * (1 + TOLERANCE)
        assert found.best.size >= unavoidable(machine)


@pytest.mark.slow
def test_what_a_better_machine_buys_is_what_the_closed_form_says():
    own = {"h": Fraction(1, 4), "h_t": 1, "Ts": Fraction(1, 20), "tau": Fraction(1, 40)}
    own |= {"noise": Fraction(1, 100), "wind": Fraction(1, 10)}
    spec, memory = at(own, Fraction(1)), Memory()
    changed = {
        ("noise", True): {"noise": Fraction(0)},
        ("wind", True): {"wind": Fraction(0)},
    }
    machines = [each for each in better_machines(spec, str) if (each.part, each.gone) in changed]
    assert len(machines) == len(changed)
    with quick():
        found = design.narrowest(lambda scale: at(own, scale), ALONE, RADIUS, memory=memory)
        buys = sensitivities(
            found,
            lambda scale, better: load_source(
                Source.of("linear.yaml", LINEAR.format(radius=scale / 2, **own)), better.settings
            ),
            machines,
            options=ALONE,
            measure=RADIUS,
            memory=memory,
        )
    for each in buys:
        other = own | changed[each.better.part, each.better.gone]
        levels = [(radius, least(other, radius)) for radius in np.geomspace(0.01, 2, 60)]
        fit = min(level for radius, level in levels if level + float(other["noise"]) < radius)
        assert fit < 0.7 * found.best.size, "there is something to buy"
        assert each.size == pytest.approx(fit, rel=0.01)
        assert each.size >= unavoidable(other)


def test_the_closed_form_would_notice():
    """Where an input acts at once and knows all, what remains is what wind does unseen; noise and delay add to it."""
    own = {"h": 1.0, "h_t": 0.0, "Ts": 1e-6, "tau": 0.0, "noise": 0.0, "wind": 0.1}
    at_once = np.array([np.inf])
    assert needed(1.0, at_once, **own)[0] == pytest.approx(2 * 0.1 / RATE, rel=1e-3)
    for key, value in (("Ts", 0.1), ("tau", 0.3), ("noise", 1e-3), ("wind", 0.3)):
        assert needed(1.0, at_once, **(own | {key: value}))[0] > 1.01 * 2 * 0.1 / RATE
