"""How far a loop can be driven: for every output the sum over lags of what each signal can do, and what remainders add.

In: a plant and tables. Out: `Response`, and W, U as the least fixed point with the remainder. Without one the sums are
what the worst signals attain at the samples, up to quadrature; between them a proof may find a little more.
Implements: theory of the sampled loop, sections 3 and 5, in floats. Trusted: no.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from scipy.linalg import block_diag

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant, flow

PANELS = 3  # of the midpoint rule in a sample
TAIL = 1e-2  # what the slowest mode may keep after the lags that count
BITS = 6  # of the lags that are looked at one by one, and of those older than half of an age
FAR = 1e4  # a tube that many times wider than without remainders has none
STILL = 1e-6  # a step that widens a tube by less is the last one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """From one sample to the next: s = (e, v_1..v_{q+1}, eta) with v_i = delta_{k-i}; s+ = A s + B delta.

    The first `held` entries are those of e and v. `kernels` (n + r, panels, -): what eta', eta, w and rho do to
    (e, eta) at its end from the midpoint of a panel on, times the panel.
    """

    A: Array
    B: Array
    held: int
    kernels: Array


def sample_of(plant: Plant) -> Sample:
    """One sample of the plant with the queue of its inputs."""
    (n, m), r, span = plant.B.shape, plant.H.shape[1], plant.sample_time
    queue = max(0, math.ceil(plant.delay / span - 1e-9) - 1)
    late, held = plant.delay - queue * span, n + m * (queue + 1)
    A, B = np.eye(held + r), np.eye(held + r, m, -n)
    A[n:held] = np.eye(held - n, held + r, n - m)
    A[n : n + m] = 0.0
    A[:n, :n], A[:n, held:] = flow(plant.A, plant.H, span)
    since, newer = flow(plant.A, plant.B, span - late)
    A[:n, held - m : held] = since @ flow(plant.A, plant.B, late)[1]
    (A[:n, held - 2 * m : held - m] if queue else B[:n])[:] = newer
    K, panel, kernels = np.hstack([plant.H, plant.E, np.eye(n), plant.B]), span / PANELS, []
    for i in range(PANELS):
        phi, lag = flow(plant.A, plant.H, span - (i + 0.5) * panel)
        kernels.append(np.vstack([np.hstack([lag, phi @ K]), np.eye(r, r + K.shape[1])]) * panel)
    return Sample(A=A, B=B, held=held, kernels=np.stack(kernels, axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Bounds of (e, delta) at the samples, (n + m,): `long_run` without the start, `ever` with it.

    rho adds `gain` |rho| to both. `lags`: after how many samples the slowest mode has fallen to `TAIL`.
    """

    long_run: Array
    ever: Array
    gain: Array
    lags: float


def _powers(rows: Array, step: Array, lags: float) -> tuple[Array, Array]:
    """rows step^j (k, rows, -), and for how many lags each stands (k,): of older ones fewer are looked at.

    The first 2^`BITS` one by one; then half as many as often as the age doubles, until it is more than `lags`.
    """
    levels = max(0, math.ceil(math.log2(lags)) - BITS)
    squares = list(accumulate([step] * (BITS + levels), lambda power, _: power @ power))
    blocks, at = [_multiples(rows, squares[:BITS])], [np.arange(2**BITS)]
    for k in range(1, levels + 1):
        blocks.append(_multiples(rows @ squares[BITS + k - 1], squares[k : BITS + k - 1]))
        at.append(2**k * np.arange(2 ** (BITS - 1), 2**BITS))
    return np.concatenate(blocks), np.gradient(np.concatenate(at, dtype=float))


def _multiples(rows: Array, squares: Sequence[Array]) -> Array:
    """Rows times 1, x, x^2, x^3, .. by x, x^2, x^4, .."""
    found = rows[None]
    for square in squares:
        found = np.concatenate([found, found @ square])  # products too small for threads
    return found


def respond(plant: Plant, sample: Sample, theta: Array) -> Response | None:
    """What the signals of the plant can do to the loop, or None if it is not stable.

    `theta` (m + z, n + z) is the controller: (delta, zeta+) = theta (dy, zeta). Each component of eta is cut where that
    is best: up to the cut it is a state that moves with its rate, with its entries in the rows, and all that is older
    is a signal of its magnitude. From the start it need not be cut.
    """
    (n, m), (_, r), k, whole = plant.B.shape, plant.H.shape, plant.E.shape[1], len(sample.A)
    memory = np.eye(len(theta) - m)
    act, hear = block_diag(sample.B, memory), block_diag(np.eye(n, whole), memory)
    step = act @ theta @ hear
    step[:whole, :whole] += sample.A
    moves = np.r_[: sample.held, whole : len(step)]
    if not (slowest := float(np.abs(np.linalg.eigvals(step[np.ix_(moves, moves)])).max())) < 1 - 1e-9:
        return None
    lags = math.log(TAIL) / math.log(max(slowest, 0.3))
    past, weights = _powers(np.vstack([np.eye(n, len(step)), theta[:m] @ hear]), step, 2 * lags)
    eta = past[:, :, sample.held : whole]
    drawn = np.tensordot(np.concatenate([past[:, :, :n], eta], axis=2), sample.kernels, 1)
    slope, level, wind, rest = np.split(drawn, np.cumsum([r, r, k]), axis=-1)
    heard = _size(past @ (act @ theta[:, :n] * plant.noise), plant.noise_ball)
    direct = np.r_[np.zeros(n), _size(theta[:m, :n] * plant.noise, plant.noise_ball)]
    known = direct + _younger(heard + _size(wind, plant.wind_ball).sum(axis=2), weights)
    grown = _younger(np.abs(slope).sum(axis=2) * plant.rate, weights)
    old = _younger(np.abs(level).sum(axis=2) * plant.magnitude, weights)
    entry = np.abs(eta)
    cut = np.minimum.accumulate(grown + entry * plant.magnitude - old, axis=0) + old
    from_start = np.minimum(cut, grown + entry * plant.eta_start).sum(axis=2)
    begun = (known + from_start + np.abs(past[:, :, :n]) @ plant.start).max(axis=0)
    long_run = known[-1] + cut[-1].sum(axis=1)
    gain = np.tensordot(weights, np.abs(rest).sum(axis=2), 1)
    return Response(long_run=long_run, ever=np.maximum(begun, long_run), gain=gain, lags=lags)


def _size(rows: Array, ball: bool) -> Array:
    """What a ball, or a box, of size one can do through the last axis."""
    size: Array = np.sqrt(np.square(rows).sum(-1)) if ball else np.abs(rows).sum(-1)
    return size


def _younger(each: Array, weights: Array) -> Array:
    """Sums over all lags that are younger than each."""
    counted = (each.T * weights).T
    return np.cumsum(counted, axis=0) - counted


def rest_at(plant: Plant, size: Array) -> Array:
    """The remainder of a tube of that size (W, U), a huge number where it is not defined."""
    rho: Array = np.nan_to_num(plant.remainder(*np.split(size, [len(plant.A)])), nan=np.inf)
    return np.minimum(rho, 1e300)


def settle(plant: Plant, gain: Array, rows: Array, steps: int) -> tuple[Array, float]:
    """(W, U) after so many steps of rows + gain rho(W, U), and by which share the last one widened them.

    That is inf where they grow `FAR`, at which they are cut off.
    """
    size, moved = rows, np.inf
    ceiling = FAR * (rows + gain @ rest_at(plant, size))
    for _ in range(steps):
        before, size = size, rows + gain @ rest_at(plant, size)
        if (size > ceiling).any():
            return np.minimum(size, ceiling), np.inf
        moved = float(np.max(size / np.maximum(before, 1e-300))) - 1
        if moved < STILL:
            break
    return size, moved


def spread(plant: Plant, gain: Array, size: Array) -> float:
    """By which factor more of (W, U) comes back through the remainder: far above 1 no tube near `size` closes."""
    more = [rest_at(plant, size + own) - rest_at(plant, size) for own in np.diag(size)]
    back = gain @ np.transpose(more) / np.maximum(size, 1e-300)[:, None]
    return float(np.abs(np.linalg.eigvals(np.nan_to_num(np.minimum(back, 1e100)))).max())
