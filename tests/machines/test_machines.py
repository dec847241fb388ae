"""What an adversary attains on small machines, and what a linear program says is the limit, beside what is proven."""

import numpy as np
import pytest
from machines import Attack, Tables, drawn, least, met, nothing, quadratic, slow

LINEAR = [machine for seed in range(12) if not (machine := drawn(seed)).bent]


def by_hand(machine) -> Tables:
    return nothing(machine) if machine.controller == "none" else quadratic(machine)


@pytest.mark.slow
@pytest.mark.parametrize("machine", LINEAR, ids=lambda machine: f"{machine.sizes}")
def test_the_worst_signals_do_in_the_machine_what_the_kernels_say(machine):
    """Kernels by matrix exponentials, the machine by Runge and Kutta, with its queue of commands: nothing in common."""
    for found in met(machine, by_hand(machine), lambda k, name: 1.0, (0, 3, 25)):
        assert found.attained == pytest.approx(found.limit, rel=1e-5, abs=1e-9)


def test_a_slow_signal_does_less_than_its_rate_alone_or_its_size_alone_would_allow():
    rng = np.random.default_rng(5)
    for _ in range(20):
        rates, lengths = rng.normal(size=40), rng.uniform(0.1, 0.2, size=40)
        curve, value = slow(rates * lengths, 0.7, lengths, 0.5, 1.0)
        change = np.diff(curve) / lengths
        assert np.abs(curve).max() <= 0.5 + 1e-9
        assert np.abs(change).max() <= 1 + 1e-9
        assert value == pytest.approx(0.7 * curve[0] + rates * lengths @ change)
        assert value <= 0.7 * 0.5 + np.abs(rates) @ lengths + 1e-9
        by_size = abs(0.7 - rates[0]) + abs(rates[-1]) + np.abs(np.diff(rates)).sum()
        assert value <= 0.5 * by_size + 1e-9
        assert value >= 0.2 * min(0.5 * by_size, np.abs(rates) @ lengths)


def test_what_no_controller_can_promise_is_what_a_pencil_finds_for_one_integrator():
    """x' = u + h, |h'| <= 1, samples of 1 s: T (T + 1)/2 without noise, T = 1 + tau."""
    A, B = np.zeros((1, 1)), np.ones((1, 1))
    for tau in (0.0, 0.5, 1.0):
        found = least(A, B, np.zeros(1), sample_time=1.0, delay=tau, rate=1.0, history=24)
        assert found[0] == pytest.approx((1 + tau) * (2 + tau) / 2, rel=1e-6)


def test_seeds_draw_every_kind_of_machine():
    many = [drawn(seed) for seed in range(200)]
    assert {m.kind for m in many} == {"point", "box", "ball"}
    assert {m.hold for m in many} == {"middle", "left", "continuous"}
    for kind in ("wave", "family", "bent", "varied", "wind_rate", "h_rate", "input_rate"):
        assert sum(bool(getattr(m, kind)) for m in many) >= 8, kind
    assert max(m.delay / m.sample_time for m in many) > 2
    grows = [max(np.linalg.eigvals(m.A).real) for m in many]
    assert sum(g > 0 for g in grows) >= 20
    assert any(Attack(m, nothing(m), 1.0, 3).whole == 2 for m in many)
