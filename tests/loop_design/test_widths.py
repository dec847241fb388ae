"""Widths against the same loop, simulated in small steps: one impulse of every signal, and plain sums."""

from dataclasses import replace

import numpy as np
import pytest
from plants import plant, scalar
from scipy.linalg import expm

from tubecert.loop_design.widths import respond, sample_of, settle, spread

PARTS = 16  # steps of a sample
SAMPLES = 150


def simulated(machine, theta, *, start=0.0, noise=None, step=None, pulse=None, wind=None, at=0):
    """e after every step and delta of every sample: (SAMPLES, PARTS + 1, n), (SAMPLES, m).

    `noise` is that of the first sample; from step `at` on H `step` acts for ever, and H `pulse`, E `wind` in it.
    """
    n, m = machine.B.shape
    dt = machine.sample_time / PARTS
    late = round(machine.delay / dt)
    forced = np.zeros((2 * n, 2 * n))
    forced[:n, :n], forced[:n, n:] = machine.A, np.eye(n)
    flow = expm(forced * dt)
    e, zeta = np.zeros(n) + start, np.zeros(len(theta) - m)
    held = [np.zeros(m)] * (late // PARTS + 2)
    es, deltas = [], []
    for k in range(SAMPLES):
        heard = e + (noise if noise is not None and k == 0 else 0)
        answer = theta @ np.r_[heard, zeta]
        held, zeta = [answer[:m], *held[:-1]], answer[m:]
        deltas.append(answer[:m])
        es.append([e])
        for part in range(PARTS):
            since = k * PARTS + part
            force = machine.B @ held[-(-(late - part) // PARTS) if late > part else 0]
            force = force + (machine.H @ step if step is not None and since >= at else 0)
            if since == at:
                force = force + (0 if pulse is None else machine.H @ pulse)
                force = force + (0 if wind is None else machine.E @ wind)
            e = flow[:n, :n] @ e + flow[:n, n:] @ force
            es[-1].append(e)
    return np.array(es), np.array(deltas)


def outputs(machine, run):
    """(SAMPLES, rows): e at the nodes of every sample, delta."""
    es, deltas = run
    late = round(machine.delay / machine.sample_time * PARTS) % PARTS
    nodes = sorted({PARTS // 2, PARTS} | ({late} if late else set()))
    return np.concatenate([es[:, nodes].reshape(SAMPLES, -1), deltas], axis=1)


def brute(machine, theta):
    """The long run's bounds by sums over impulses; eta is cut where that is best."""
    total = sum(
        np.abs(outputs(machine, simulated(machine, theta, noise=column))).sum(0)
        for column in np.diag(machine.noise)
    )
    for column in np.eye(machine.E.shape[1]):
        runs = [outputs(machine, simulated(machine, theta, wind=column, at=i)) for i in range(PARTS)]
        total = total + np.abs(runs).sum(axis=(0, 1))
    for i, column in enumerate(np.eye(machine.H.shape[1])):
        dt = machine.sample_time / PARTS
        starts = [simulated(machine, theta, step=column, at=at) for at in range(PARTS)]
        slope = np.abs([outputs(machine, run) for run in starts]).sum(0) * machine.rate[i] * dt
        pulses = [simulated(machine, theta, pulse=column, at=at) for at in range(PARTS)]
        level = np.abs([outputs(machine, run) for run in pulses]).sum(0) * machine.magnitude[i]
        entry = np.abs(outputs(machine, starts[0])) * machine.magnitude[i]
        total = total + np.min(
            [slope[:k].sum(0) + entry[k - 1] + level[k:].sum(0) for k in range(1, SAMPLES)], 0
        )
    return total


def controlled(seed):
    """A stable loop of a random plant of two states and a random controller of one."""
    rng = np.random.default_rng(seed)
    while True:
        A, B = rng.normal(0, 0.7, (2, 2)), rng.normal(0, 1, (2, 1))
        machine = plant(A, B, H=rng.normal(0, 1, (2, 1)), E=rng.normal(0, 1, (2, 2)), noise=[0.1, 0.2],
                        wind=[0.3, 0.2], rate=0.2, magnitude=0.5, delay=[0, 0.375, 1, 1.75, 2.5][seed])  # fmt: skip
        theta = rng.normal(0, 0.4, (2, 3))
        found = respond(machine, sample_of(machine), theta)
        if found and 20 < found.lags < 100:
            return machine, theta, found


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_widths_are_the_sums_over_all_impulses(seed):
    machine, theta, found = controlled(seed)
    np.testing.assert_allclose(found.long_run, brute(machine, theta), rtol=0.03)


def test_a_ball_is_narrower_than_its_box_and_wider_than_one_of_its_axes():
    machine, theta, box = controlled(0)
    ball = respond(replace(machine, noise_ball=True, wind_ball=True), sample_of(machine), theta)
    axis = replace(machine, noise=machine.noise * [1, 0], E=machine.E * [1, 0])
    assert (ball.long_run < box.long_run).all()
    assert (ball.long_run > respond(axis, sample_of(axis), theta).long_run).all()


def test_a_start_counts_before_it_is_forgotten():
    machine, theta, _ = controlled(1)
    start, nothing = np.array([9.0, 0]), np.zeros(1)
    alone = replace(machine, noise=0 * start, E=0 * machine.E, rate=nothing, magnitude=nothing, start=start)
    found = respond(alone, sample_of(alone), theta)
    largest = np.abs(outputs(alone, simulated(alone, theta, start=start))).max(0)
    np.testing.assert_allclose(found.ever, largest, rtol=1e-6)
    assert not found.long_run.any()


@pytest.mark.parametrize("fades", [0.9, 0.99, 0.9999])
def test_old_lags_are_looked_at_the_less_the_older_they_are(fades):
    """x' = w with delta = -(1 - fades) x held for a sample: e is w summed over what has not faded."""
    machine = plant([[0.0]], [[1.0]], E=[[1.0]], wind=1.0, H=np.zeros((1, 0)))
    found = respond(machine, sample_of(machine), np.array([[fades - 1]]))
    np.testing.assert_allclose(found.long_run[1:], np.array([1, 1 - fades]) / (1 - fades), rtol=2e-3)
    assert found.lags == pytest.approx(np.log(1e-2) / np.log(fades))


def test_the_fixed_point_is_the_least_root_and_its_absence_is_seen():
    """W = b + g c W^2 by the formula of the quadratic equation."""
    machine = plant([[0]], [[1]], noise=1.0, rho=lambda W, U: np.r_[0.02 * W**2, 0.0])
    found = respond(machine, sample_of(machine), np.array([[-0.5]]))
    (W, _), moved = settle(machine, found.gain, found.long_run, 400)
    b, g = found.long_run[:-1].max(), found.gain[:-1, 0].max()
    assert moved < 1e-6
    np.testing.assert_allclose(W, (1 - np.sqrt(1 - 4 * 0.02 * g * b)) / (2 * 0.02 * g), rtol=1e-2)
    wild = replace(machine, remainder=lambda W, U: np.r_[9 * W**2, 0.0])
    assert settle(wild, found.gain, found.long_run, 400)[1] == np.inf
    size = np.array([W, 0.0])
    assert spread(machine, found.gain, size) == pytest.approx(g * 0.02 * 3 * W)  # (2 W)^2 - W^2


def test_a_loop_that_is_not_stable_has_no_response():
    machine = scalar(1.0)
    assert respond(machine, sample_of(machine), np.zeros((1, 1))) is None
