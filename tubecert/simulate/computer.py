"""What a computer does at its samples: the adaptation of certificate C, and with a control rate the whole controller.

Adaptation of C at t = i Ts (4.5): s_hat = -g/(e^{g Ts} - 1) xtilde, sigma_hat = the projection of e^{g Ts} B^+ s_hat to
the ball. Controller at a rate: u = u* + k + u_a is held; the filter is exact for a held sigma_hat; the predictor is
stepped by Euler, xhat+ = xhat + dt (f + B(u + sigma_hat) + A_m xtilde), and then sigma_hat+ = clip(sigma_hat + dt
Gamma Proj(-B'xtilde)) uses the new xtilde, which is stable while dt sqrt(Gamma) |B| < 2 (`held` computes it exactly).
In coordinates z = S x of the tube, B'P stands for B' and B_z^+ S = (B'PB)^-1 B'P for B^+, with P = S'S.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled
from tubecert.simulate.layout import blocks
from tubecert.simulate.small import clip, copy, dot, factor, solve

if TYPE_CHECKING:
    from tubecert.simulate.fast import Fast
    from tubecert.simulate.feedback import Moment, Point


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


class Registers(NamedTuple):
    """What a computer keeps between its samples: the input u (m,) and the predicted state xhat (n,).

    `gram` (m, m) is room for B'PB.
    """

    u: Array
    xhat: Array
    gram: Array


@compiled
def sample(
    fast: Fast, computer: Any, count: int, now: Moment, point: Point, y: Array, kept: Registers
) -> None:
    """What happens at sample `count`; beside a machine, where there is no computer, it is not even compiled."""
    if computer is not None:
        if computer.holds:
            _control(fast, computer, count, now, point, y, kept)
        else:
            _adapt(fast, computer, point.plant.B, y, kept.gram)


@compiled
def _adapt(fast: Fast, computer: Any, B: Array, y: Array, gram: Array) -> None:
    """(4.5): s_hat and sigma_hat from xtilde."""
    own = blocks(y, fast.at)
    for i in range(fast.at.n):
        own.s_hat[i] = -computer.weight * own.xtilde[i]  # s_hat = -g/(e^{g Ts} - 1) xtilde
    explain(fast, B, own.s_hat, gram, own.sigma_hat)
    for j in range(fast.at.m):
        own.sigma_hat[j] *= computer.growth  # e^{g Ts} B^+ s_hat
    clip(own.sigma_hat, fast.radius)


@compiled
def explain(fast: Fast, B: Array, s: Array, gram: Array, sigma: Array) -> None:
    """sigma = (B'PB)^-1 B'P s: what of s (n,) the inputs can make."""
    m = fast.at.m
    for j in range(m):
        sigma[j] = 0.0
        for i in range(fast.at.n):
            sigma[j] += B[i, j] * dot(fast.P[i], s)
        for k in range(m):
            gram[j, k] = 0.0
            for i in range(fast.at.n):
                gram[j, k] += B[i, j] * dot(fast.P[i], B[:, k])
    if factor(gram, gram):
        solve(gram, sigma, sigma)
    else:
        sigma[:] = np.nan  # B has lost rank


@compiled
def _control(
    fast: Fast, computer: Any, count: int, now: Moment, point: Point, y: Array, kept: Registers
) -> None:
    """One sample of the whole controller: the filter, the estimate, the input, and the prediction of the next state."""
    terms, own, B = fast.terms, blocks(y, fast.at), point.plant.B
    if count == 0:
        copy(kept.xhat, now.x)
    for i in range(fast.at.n):
        own.xtilde[i] = kept.xhat[i] - now.x[i]
    if terms.filters and count > 0:
        for j in range(fast.at.m):  # (0.8) for a sigma_hat that was held for dt
            own.u_a[j] = computer.decay * own.u_a[j] - (1.0 - computer.decay) * own.sigma_hat[j]
    if terms.knows:
        copy(own.sigma_hat, point.h)
    elif terms.adapts:
        _integrate(fast, computer.dt, B, y)
    elif terms.samples and count % computer.every == 0:
        _adapt(fast, computer, B, y, kept.gram)
    for j in range(fast.at.m):
        kept.u[j] = now.plan.u[j] + point.k[j] + own.u_a[j]  # (0.4)
    for i in range(fast.at.n):
        speed = point.plant.f[i] + dot(B[i], kept.u)
        if terms.adapts:
            speed += dot(B[i], own.sigma_hat)  # (0.6)
        if terms.samples:
            speed += own.s_hat[i]  # (4.5)
        kept.xhat[i] += computer.dt * (speed + dot(fast.A[i], own.xtilde))


@compiled
def _integrate(fast: Fast, dt: float, B: Array, y: Array) -> None:
    """sigma_hat of (0.7) by one Euler step, then into the ball; Proj is the smooth one of 2.5 if there is a layer."""
    own = blocks(y, fast.at)
    sigma = own.sigma_hat
    square = dot(sigma, sigma)
    outward = 0.0
    for j in range(fast.at.m):
        for i in range(fast.at.n):
            outward -= sigma[j] * B[i, j] * dot(fast.P[i], own.xtilde)
    share = 0.0
    if fast.layer > 0.0 and square > 0.0 and outward > 0.0:
        limit = fast.radius * fast.radius
        share = max(0.0, ((1.0 + fast.layer) * square - limit) / (fast.layer * limit)) * outward / square
    for j in range(fast.at.m):
        pushed = 0.0
        for i in range(fast.at.n):
            pushed += B[i, j] * dot(fast.P[i], own.xtilde)
        sigma[j] -= dt * fast.Gamma * (pushed + share * sigma[j])
    clip(sigma, fast.radius)
