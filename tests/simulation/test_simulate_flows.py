"""The fast part against its right-hand sides, written out; the projection of its law against closed forms."""

from typing import get_args

import numpy as np
import pytest

from tubecert.simulation.adaptive.flows import Fast
from tubecert.simulation.adaptive.loops import Controller, LoopGains
from tubecert.spec.scene import CONTROLLERS

GAINS = LoopGains(bandwidth=7.0, projection_radius=100.0, predictor_gain=3.0, adaptation_rate=11.0)
B = np.array([[1.0, 0.5], [-0.25, 2.0]])


def fast(controller="l1", gains=GAINS, forces=4):
    return Fast(controller == "l1", gains, np.eye(2), 2, forces)


@pytest.mark.parametrize("controller", ["reference", "l1"])
def test_a_short_flow_is_the_right_hand_side_of_the_theory(controller):
    """(0.6) less (0.1), (0.7), (0.8), written out; the wind is what h is not."""
    rng = np.random.default_rng(3)
    xt, sigma, u_a, h, wind = (rng.normal(size=2) for _ in range(5))
    zero, length = np.zeros(2), 1e-8
    rates = {
        "reference": [zero, zero, -7 * (u_a + h), u_a],
        "l1": [-3 * xt + B @ (sigma - h) - wind, -11 * B.T @ xt, -7 * (u_a + sigma), u_a],
    }[controller]
    own = fast(controller)
    y = np.concatenate([own.root * xt, sigma, u_a, zero])
    z = np.concatenate([y, h, wind, np.zeros(8)])[:, None]
    rate = (own.advance(own.flow(B, length, 0), z)[0][:, 0] - y) / length
    np.testing.assert_allclose(rate[:2] / own.root, rates[0], atol=1e-5)
    np.testing.assert_allclose(rate[2:], np.concatenate(rates[1:]), atol=1e-5)


def test_a_B_of_every_lane_is_that_lane_alone():
    """Flows and the projection; the lanes whose sigma_hat comes to the ball are some only."""
    gains = LoopGains(bandwidth=7.0, projection_radius=0.8, predictor_gain=3.0, adaptation_rate=400.0)
    own, rng = fast(gains=gains), np.random.default_rng(4)
    z = 0.3 * rng.normal(size=(8 + 12, 5))
    z[2:4] *= [0.1, 0.1, 2, 0.1, 0.1]
    moving = np.repeat(B[..., None], 5, axis=2) * [1.0, 1.1, 1.2, 1.3, 1.4]
    together, _ = own.advance(own.flow(moving, 0.1, 0), z)
    for lane in range(5):
        flow = own.flow(moving[..., [lane]], 0.1, 1)  # caught twice as often
        alone = own.advance(flow, z[:, [lane]])[0][:, 0]
        np.testing.assert_allclose(together[:, lane], alone, atol=0.05)
        shared = own.flow(moving[..., lane], 0.1, 1)
        np.testing.assert_allclose(own.advance(shared, z[:, [lane]])[0][:, 0], alone, atol=1e-12)
    assert np.linalg.norm(together[2:4], axis=0).max() == pytest.approx(0.8)


@pytest.mark.parametrize("radius", [100.0, 0.4])
def test_what_is_largest_within_a_step_is_seen(radius):
    """xtilde and sigma_hat turn by 12 rad in the step; the same in 500 steps, whose ends are looked at."""
    gains = LoopGains(bandwidth=7.0, projection_radius=radius, predictor_gain=3.0, adaptation_rate=4e3)
    own, rng, count = fast(gains=gains), np.random.default_rng(5), 500
    z = np.concatenate(
        [0.2 * rng.normal(size=(6, 1)), np.zeros((2, 1)), rng.normal(size=(4, 1)), np.zeros((8, 1))]
    )
    _, most = own.advance(own.flow(B, 0.1, 1), z)
    short, sizes = own.flow(B, 0.1 / count, 0), []
    for _ in range(count):
        z[:8] = own.advance(short, z)[0]
        sizes.append([np.linalg.norm(z[:2]) / own.root, np.linalg.norm(z[2:4] - z[8:10])])
    assert most[:, 0] == pytest.approx(np.max(sizes, axis=0), rel=0.05)
    assert (most[:, 0] > 1.1 * np.array(sizes[-1])).all()


@pytest.mark.parametrize("smooth", [None, 0.5])
def test_an_estimate_pushed_outward_slides_along_the_ball(smooth):
    """Under a steady push (a, 0) sigma_hat = r (cos v, sin v) at the rim turns by v' = -a sin(v)/r; by closed form."""
    gains = LoopGains(
        bandwidth=1.0, adaptation_rate=1.0, projection_radius=1.0, predictor_gain=1.0, smooth=smooth
    )
    own = Fast(True, gains, np.eye(2), 2, 2)
    v, ends = np.array(1.2), []
    for count in (16, 64):
        flow = own.flow(np.eye(2), 0.5 / count, 4)
        sigma, turned = np.array([np.cos(v), np.sin(v)])[:, None], 0.0
        for _ in range(count):
            z = np.concatenate([[[-1.0], [0.0]], sigma, np.zeros((10, 1))])
            sigma = own.advance(flow, z)[0][2:4]  # xi starts anew each time: the push stays
        turned = np.arctan2(*sigma[::-1, 0])
        assert np.linalg.norm(sigma) == pytest.approx(1.0, abs=0.02)
        ends.append(abs(turned - 2 * np.arctan(np.tan(v / 2) * np.exp(-0.5))))
    assert ends[1] < ends[0] / 3 < 0.01


def test_loops_are_named_alike_everywhere():
    assert get_args(Controller) == CONTROLLERS
