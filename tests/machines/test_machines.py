"""What an adversary attains on small machines, and what a linear program says is the limit, beside what is proven."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from machines import Attack, Machine, Tables, any_tables, drawn, least, met, slow

from tubecert.loop_design.certification import certify
from tubecert.spec import load, load_text
from tubecert.verdict import Verdict

LINEAR = [machine for seed in range(12) if not (machine := drawn(seed)).bent]
QUESTIONS = sorted((Path(__file__).parent / "questions").glob("*.yaml"))
INTEGRATOR = (np.zeros((1, 1)), np.ones((1, 1)))
DOUBLE = (np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]))


def one_second(plant, tau: str, noise: tuple[float, ...]) -> Machine:
    """Samples of 1 s, |h'| <= 1."""
    A, B = plant
    own = {"sample_time": Fraction(1), "delay": Fraction(tau), "noise": noise, "h": np.inf, "h_rate": 1.0}
    return Machine(A=A, B=B, E=np.zeros((len(A), 0)), **own)


def proven(machine: Machine):
    """Tables and what is proven of a name at a sample, and for how many samples; None if nothing is."""
    result = certify(load_text(machine.text(), "machine.yaml")).result
    if result.verdict is not Verdict.CERTIFIED:
        return None
    own = result.controller
    tables = Tables(own.F, own.G, own.M, own.N)

    def bound(k: int, name: str) -> float:
        stage = max((each for each in result.tube if each.start <= k), key=lambda each: each.start)
        return float({**stage.half_widths, **stage.deviations}[name])

    end = result.claim.horizon
    return tables, bound, 10**6 if end is None else int(end / machine.sample_time) - 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_nothing_leaves_what_is_proven(seed):
    machine = drawn(seed)
    if (found := proven(machine)) is None:
        pytest.skip("not certified")
    tables, bound, end = found
    for one in met(machine, tables, bound, tuple(sorted({min(k, end) for k in (0, 1, 4, 60)}))):
        assert max(one.limit, one.attained) <= one.proven * (1 + 1e-9), one


@pytest.mark.slow
@pytest.mark.parametrize("path", QUESTIONS, ids=lambda path: path.stem)
def test_what_a_new_user_asks_is_answered(path):
    result = certify(load(str(path))).result
    assert result.verdict is Verdict.CERTIFIED
    assert result.claim.horizon is None
    widths = dict(result.tube[-1].half_widths)
    if path.stem == "stable":  # x' = -3 x + w, |w| <= .1: w/3
        assert 1 / 30 < widths["x"] < 0.04


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "low", "high", "history"),
    [
        (one_second(INTEGRATOR, "0", (0.1,)), 1.0, 1.4, 24),
        (one_second(INTEGRATOR, "0.5", (1.0,)), 1.0, 1.4, 60),
        (one_second(DOUBLE, "0", (1.0, 1.0)), 1.9, 2.5, 30),
        (one_second(DOUBLE, "1", (1.0, 1.0)), 1.9, 2.5, 30),
    ],
)
def test_linear_plants_are_near_what_any_controller_can_promise(machine, low, high, history):
    tables, bound, _ = proven(machine)
    names = [f"x{i + 1}" for i in range(len(machine.noise))]
    width = np.array([bound(10**6, name) for name in names])
    ratio = float(np.exp(np.mean(np.log(width / least(machine, history)))))
    assert 1.0 <= ratio <= high
    assert ratio >= low * 0.97
    late = met(machine, tables, bound, (90,))
    for name in names:
        assert 0.95 <= max(one.attained / one.proven for one in late if one.output == name) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("machine", LINEAR, ids=lambda machine: f"{machine.sizes}")
def test_the_worst_signals_do_in_the_machine_what_the_kernels_say(machine):
    """Kernels by matrix exponentials, the machine by Runge and Kutta, with its queue of commands: nothing in common."""
    for found in met(machine, any_tables(machine, 7), lambda k, name: 1.0, (0, 3, 25)):
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


def test_what_no_controller_can_promise_is_known_for_an_integrator():
    """T (T + 1)/2 without noise, T = 1 + tau: a rate that no sample has shown acts until the next command does."""
    for tau in ("0", "1/2", "1"):
        T = 1 + float(Fraction(tau))
        assert least(one_second(INTEGRATOR, tau, (0.0,)), 24)[0] == pytest.approx(T * (T + 1) / 2, rel=1e-6)


def test_seeds_draw_every_kind_of_machine():
    many = [drawn(seed) for seed in range(200)]
    assert {m.kind for m in many} == {"point", "box", "ball"}
    assert {m.hold for m in many} == {"middle", "left", "continuous"}
    for kind in ("wave", "family", "bent", "varied", "wind_rate", "h_rate", "input_rate"):
        assert sum(bool(getattr(m, kind)) for m in many) >= 8, kind
    assert max(m.delay / m.sample_time for m in many) > 2
    grows = [max(np.linalg.eigvals(m.A).real) for m in many]
    assert sum(g > 0 for g in grows) >= 20
    assert any(Attack(m, any_tables(m, 1), 1.0, 3).whole == 2 for m in many)
