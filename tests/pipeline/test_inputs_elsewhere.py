"""Inputs that act elsewhere than those of the middles, written as a wind: theory 8.10, at its end."""

from __future__ import annotations

import numpy as np
import proven
import pytest

K = 0.02  # of B = (k, 1)
KNOWN = """
tubecert: 1
name: elsewhere
system: {states: [x, y], inputs: [u], f: ["-x + y", "-y"], B: [[0], [1]]}
safe_set: {x: [-1, 1], y: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
metric: {rate: 0.8, dual_metric: [[1, "-0.3"], ["-0.3", 2]]}
tube: {epsilon: 0.2, rho_a: 0.1}
hardware: {rate: 500, noise: 0.0001}
disturbance: {E: [[1], [0]], bound: 0.005}
conditions: {decides: H}
"""
UNKNOWN = (
    KNOWN.replace("inputs: [u], ", f"inputs: [u], parameters: {{k: [-{K}, {K}]}}, ")
    .replace("B: [[0], [1]]", 'B: [["k"], [1]]')
    .replace("disturbance: {E: [[1], [0]], bound: 0.005}\n", "")
)


@pytest.mark.slow
@pytest.mark.parametrize("k", [-K, K])
def test_a_wind_that_holds_what_inputs_do_elsewhere_covers_them(k):
    """The bound of the wind against what H proves of the input; and the loop with such an input stays in its ranges."""
    result = proven.proven(KNOWN, bare=True)["result"]
    own, recipe = result["hardware"], result["proof"]["hardware"]
    low, high = own["inputs"]["u"]
    assert own["verdict"] == "certified"
    assert K * (max(-low, high) + result["constants"]["h"]["above"]) <= 0.005
    A, B, M = np.array([[-1.0, 1], [0, -1]]), np.array([k, 1.0]), np.linalg.inv([[1, -0.3], [-0.3, 2]])
    Ts, th = 1 / 500, 1 - np.exp(-recipe["bandwidth"] / 500)
    x, y, q, u, furthest, most = np.zeros(2), np.zeros(2), 0.0, 0.0, 0.0, 0.0
    rng = np.random.default_rng(1)
    for step in range(1500):
        before, y = y, x + 1e-4 * np.array([0.6, 0.8]) * rng.choice([-1, 1])
        if step:
            q += th * (((y - before) / Ts - A @ (y + before) / 2)[1] - u - q)
        c, half = M[1] @ y, y @ M @ A @ y + 0.8 * y @ M @ y
        kappa = -max(half, 0.0) / c if abs(c) > 1e-12 else 0.0
        u = kappa - np.clip(q, -0.1, 0.1)
        for part in range(4):
            h = 0.1 * np.sin(step * Ts + part * Ts / 4)
            x = x + Ts / 4 * (A @ x + B * (u + h))
        furthest, most = max(furthest, float(np.sqrt(x @ M @ x))), max(most, abs(u))
    assert 1e-4 < furthest < own["level"]
    assert 0.09 < most <= max(-low, high)


@pytest.mark.slow
def test_an_input_that_acts_elsewhere_is_told_what_to_write():
    result = proven.proven(UNKNOWN, bare=True)["result"]
    assert result["verdict"] == "undecided"
    assert any("gain_unmatched" in str(reason) for reason in result["reasons"])
