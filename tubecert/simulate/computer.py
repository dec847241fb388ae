"""What a computer does at its samples: the adaptation of certificate C, and with a control rate the whole controller.

Adaptation of C at t = i Ts: s_hat = -g/(e^{g Ts} - 1) xtilde, sigma_hat = the projection of e^{g Ts} B^+ s_hat to
the ball. Controller at a rate: u = u* + k + u_a is held; the filter is exact for a held sigma_hat; the predictor is
stepped by Euler, xhat+ = xhat + dt (f + B(u + sigma_hat) + A_m xtilde), and then sigma_hat+ = clip(sigma_hat + dt
Gamma Proj(-B'xtilde)) uses the new xtilde, which is stable while dt sqrt(Gamma) |B| < 2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.simulate.compiled import compiled
from tubecert.simulate.fast import ADAPTIVE, NONE, REFERENCE, SAMPLED
from tubecert.simulate.small import clip, copy, dot, factor, solve


class Computer(NamedTuple):
    """What samples; `holds`: the whole controller is held for `dt` s; of its samples every `every`-th adapts (C).

    `decay` = e^{-omega dt}; `weight` = g/(e^{g Ts} - 1) and `growth` = e^{g Ts} of C.
    """

    holds: bool
    dt: float
    every: int
    decay: float
    weight: float
    growth: float


@compiled
def sample(
    fast: Any,
    computer: Any,
    count: int,
    x: Any,
    plan: Any,
    f: Any,
    B: Any,
    inputs: Any,
    y: Any,
    held: Any,
    gram: Any,
) -> None:
    """What happens at a sample; without a computer it is not even compiled."""
    if computer is not None:
        if computer.holds:
            _control(fast, computer, count, x, plan, f, B, inputs, y, held, gram)
        else:
            _adapt(fast, computer, B, y, gram)


@compiled
def _adapt(fast: Any, computer: Any, B: Any, y: Any, gram: Any) -> None:
    """The adaptation of C: s_hat and sigma_hat from xtilde."""
    n, m = fast.n, fast.m
    held, sigma = y[n + 2 * m : 2 * n + 2 * m], y[n : n + m]
    for i in range(n):
        held[i] = -computer.weight * y[i]
    for j in range(m):
        sigma[j] = 0.0
        for i in range(n):
            sigma[j] += B[i, j] * held[i]
        for k in range(m):
            gram[j, k] = dot(B[:, j], B[:, k])
    if factor(gram, gram):
        solve(gram, sigma, sigma)
    else:
        sigma[:] = np.nan  # B has lost rank
    for j in range(m):
        sigma[j] *= computer.growth
    clip(sigma, fast.radius)


@compiled
def _control(
    fast: Any,
    computer: Any,
    count: int,
    x: Any,
    plan: Any,
    f: Any,
    B: Any,
    inputs: Any,
    y: Any,
    held: Any,
    gram: Any,
) -> None:
    """One sample of the whole controller: `held` becomes u; the last n entries of y hold the predicted xhat."""
    n, m = fast.n, fast.m
    sigma, u_a, xhat = y[n : n + m], y[n + m : n + 2 * m], y[2 * n + 2 * m :]
    if count == 0:
        copy(xhat, x)
    for i in range(n):
        y[i] = xhat[i] - x[i]
    if fast.kind != NONE and count > 0:
        for j in range(m):
            u_a[j] = computer.decay * u_a[j] - (1.0 - computer.decay) * sigma[j]
    if fast.kind == REFERENCE:
        copy(sigma, inputs[0])
    elif fast.kind == ADAPTIVE:
        _integrate(fast, computer.dt, B, y)
    elif fast.kind == SAMPLED and count % computer.every == 0:
        _adapt(fast, computer, B, y, gram)
    for j in range(m):
        held[j] = plan[2 * n + j] + inputs[1, j] + u_a[j]
    for i in range(n):
        speed = f[i] + dot(B[i], held)
        if fast.kind == ADAPTIVE:
            speed += dot(B[i], sigma)
        if fast.kind == SAMPLED:
            speed += y[n + 2 * m + i]
        xhat[i] += computer.dt * (speed + dot(fast.A[i], y[:n]))


@compiled
def _integrate(fast: Any, dt: float, B: Any, y: Any) -> None:
    """sigma_hat by one Euler step, then into the ball."""
    n, m = fast.n, fast.m
    sigma = y[n : n + m]
    square = dot(sigma, sigma)
    outward = 0.0
    for j in range(m):
        outward -= sigma[j] * dot(B[:, j], y[:n])
    share = 0.0
    if fast.layer > 0.0 and square > 0.0 and outward > 0.0:
        limit = fast.radius * fast.radius
        share = max(0.0, ((1.0 + fast.layer) * square - limit) / (fast.layer * limit)) * outward / square
    for j in range(m):
        sigma[j] -= dt * fast.Gamma * (dot(B[:, j], y[:n]) + share * sigma[j])
    clip(sigma, fast.radius)
