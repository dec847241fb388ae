"""The tube around the planned two-state curve: every constant against dense sampling, from knots of the certificate."""

import numpy as np
import pytest
import simulated

W = np.array([[4.25828, -0.93423], [-0.93423, 3.76692]])
B = np.array([0.5, -2.0])
RATE, RHO = 1.74, 0.5


@pytest.fixture(scope="module")
def result():
    return simulated.certified("two_state", "0.4")[1].to_json()


@pytest.fixture(scope="module")
def samples(result):
    """Values of every constant's function at points within rho of the knots."""
    knots = result["plan"]["knots"]
    t = np.array(knots["t"], dtype=float)
    x = np.array(knots["x"], dtype=float)
    u = np.array(knots["u"], dtype=float)[:, 0]
    angle = np.linspace(0, 2 * np.pi, 121)
    radius = np.linspace(0, RHO, 3)[:, None]
    ball = np.stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()], axis=-1)
    p = x[:, None, :] + ball[None]
    x1, x2 = p[..., 0], p[..., 1]
    f = np.stack([-x1 + 2 * x2, -0.25 * x2**3 - 3 * x1 + 4 * x2], axis=-1)
    f_x = np.empty((*x1.shape, 2, 2))
    f_x[..., 0, 0], f_x[..., 0, 1], f_x[..., 1, 0] = -1, 2, -3
    f_x[..., 1, 1] = 4 - 0.75 * x2**2
    M = np.linalg.inv(W)
    h = np.abs(-2 * np.sin(2 * t)[:, None] - 0.1 * np.hypot(x1, x2))
    return {
        "f": np.linalg.norm(f, axis=-1).max(),
        "f_x": np.linalg.norm(f_x, ord=2, axis=(-2, -1)).max(),
        "drift_on_plan": np.linalg.norm(f + u[:, None, None] * B, axis=-1).max(),
        "u_star": np.abs(u).max(),
        "h": h.max(),
        "h_x": 0.1,
        "h_t": np.abs(4 * np.cos(2 * t)).max(),
        "feedback_gain": sampled_gain(f_x[np.abs(x2) < 0.05]),
        "metric_input_gain": np.sqrt(B @ M @ B),
        "B": np.linalg.norm(B),
        "B_pinv": 1 / np.linalg.norm(B),
        "upper": np.linalg.eigvalsh(M)[-1],
    }


def sampled_gain(jacobians: np.ndarray) -> float:
    """max over sampled states and directions of eta'F eta/(2 |B'eta| sqrt(eta'W eta))."""
    angle = np.linspace(0, np.pi, 20_001)
    eta = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    weight = np.sqrt(np.einsum("ki,ij,kj->k", eta, W, eta))
    gain = np.abs(eta @ B)
    best = 0.0
    for A in jacobians[:: max(1, len(jacobians) // 50)]:
        form = np.einsum("ki,ij,kj->k", eta, A @ W + W @ A.T + 2 * RATE * W, eta)
        best = max(best, float(np.max(np.where(gain > 1e-9, form / (2 * gain * weight + 1e-300), 0.0))))
    return best


@pytest.mark.slow
def test_every_proven_side_is_above_the_samples_and_within_a_hundredth(result, samples):
    assert result["tube"]["rho"] == RHO
    for name, seen in samples.items():
        constant = result["constants"][name]
        assert seen <= constant["above"] * (1 + 1e-12), name
        assert constant["above"] <= 1.01 * max(seen, constant["below"]), name
        assert constant["below"] >= 0.99 * seen, name


@pytest.mark.slow
def test_the_supremum_of_f_is_above_what_a_grid_sees(result):
    # a 400 x 400 grid says 19.846 and finer ones 19.870
    f = result["constants"]["f"]
    assert f["below"] > 19.846
    assert 19.870 < f["above"] < 19.870 * 1.01
