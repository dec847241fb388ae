"""How far a loop can be driven: for every output the sum over lags of what each signal can do, and what remainders add.

In: a plant and tables. Out: `Response`, and W, U as the least fixed point with the remainder. Without one the sums are
what the worst signals attain, up to quadrature and to what happens between the nodes of a sample.
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
NODES = (0.5, 1.0)  # of a sample, and where an input changes
TAIL = 1e-2  # what the slowest mode may keep after the lags that count
BITS = 6  # of the lags that are looked at one by one, and of those older than half of an age
FAR = 1e4  # a tube that many times wider than without remainders has none
STILL = 1e-6  # a step that moves a tube by less is the last one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """From one sample to the next: s = (e, v_1..v_{q+1}, eta) with v_i = delta_{k-i}; s+ = A s + B delta.

    The first `held` entries are those of e and v. At nodes of the sample, the last of which is its end, e = `rows` s +
    `direct` delta, n rows a node, to which wind and eta' of the running sample add `now` and rho `now_rest`. `kernels`
    (n + r, panels, -): what eta', eta, w and rho do to (e, eta) at its end from the midpoint of a panel on,
    times the panel.
    """

    A: Array
    B: Array
    held: int
    rows: Array
    direct: Array
    now: Array
    now_rest: Array
    kernels: Array


def _kernels(plant: Plant, span: float) -> Array:
    """Those of `Sample`, of a span that may be shorter."""
    (n, r), length = plant.H.shape, span / PANELS
    K = np.hstack([plant.H, plant.E, np.eye(n), plant.B])
    found = []
    for i in range(PANELS):
        phi, lag = flow(plant.A, plant.H, span - (i + 0.5) * length)
        found.append(np.vstack([np.hstack([lag, phi @ K]), np.eye(r, r + K.shape[1])]) * length)
    return np.stack(found, axis=1)


def _acted(plant: Plant, rows: Array, kernels: Array) -> tuple[Array, Array, Array, Array]:
    """What rows (.., n + r) get of eta' and of eta, (.., r) each, of wind (..,) and of rho (.., n + m)."""
    r, k = plant.H.shape[1], plant.E.shape[1]
    slope, level, wind, rest = np.split(np.tensordot(rows, kernels, 1), np.cumsum([r, r, k]), axis=-1)
    slope, level, rest = (np.abs(each).sum(-2) for each in (slope, level, rest))
    return slope * plant.rate, level * plant.magnitude, _size(wind, plant.wind_ball).sum(-1), rest


def _size(rows: Array, ball: bool) -> Array:
    """What a ball, or a box, of size one can do through the last axis."""
    size: Array = np.sqrt(np.square(rows).sum(-1)) if ball else np.abs(rows).sum(-1)
    return size


def sample_of(plant: Plant) -> Sample:
    """One sample of the plant with the queue of its inputs."""
    (n, m), r = plant.B.shape, plant.H.shape[1]
    queue = max(0, math.ceil(plant.delay / plant.sample_time - 1e-9) - 1)
    late = plant.delay - queue * plant.sample_time
    held = n + m * (queue + 1)
    nodes = []
    for time in sorted({node * plant.sample_time for node in NODES} | {late} - {0.0}):
        after = max(0.0, time - late)
        row, direct = np.zeros((n, held + r)), np.zeros((n, m))
        row[:, :n], row[:, held:] = flow(plant.A, plant.H, time)
        since, newer = flow(plant.A, plant.B, after)
        row[:, held - m : held] = since @ flow(plant.A, plant.B, min(time, late))[1]
        (row[:, held - 2 * m : held - m] if queue else direct)[:] = newer
        slope, _, wind, rest = _acted(plant, np.eye(n, n + r), _kernels(plant, time))
        nodes.append((row, direct, slope.sum(-1) + wind, rest))
    rows, direct, now, now_rest = (np.concatenate(each) for each in zip(*nodes, strict=True))
    A, B = np.eye(held + r), np.zeros((held + r, m))
    A[n:held] = np.eye(held - n, held + r, n - m)
    A[:n], B[:n], B[n : n + m] = rows[-n:], direct[-n:], np.eye(m)
    A[n : n + m] = 0.0
    kernels = _kernels(plant, plant.sample_time)
    return Sample(A=A, B=B, held=held, rows=rows, direct=direct, now=now, now_rest=now_rest, kernels=kernels)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Bounds of e at all nodes, then of delta, n nodes + m rows: `long_run` without the start, `ever` with it.

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
    (n, m), whole = plant.B.shape, len(sample.A)
    memory = np.eye(len(theta) - m)
    act, hear = block_diag(sample.B, memory), block_diag(np.eye(n, whole), memory)
    step = act @ theta @ hear
    step[:whole, :whole] += sample.A
    moves = np.r_[: sample.held, whole : len(step)]
    if not (slowest := float(np.abs(np.linalg.eigvals(step[np.ix_(moves, moves)])).max())) < 1 - 1e-9:
        return None
    lags = math.log(TAIL) / math.log(max(slowest, 0.3))
    direct = np.vstack([sample.direct, np.eye(m)]) @ theta[:m]
    rows = direct @ hear
    rows[:-m, :whole] += sample.rows
    past, weights = _powers(rows, step, 2 * lags)
    e, eta = past[:, :, :n], past[:, :, sample.held : whole]
    slope, level, wind, rest = _acted(plant, np.concatenate([e, eta], axis=2), sample.kernels)
    noise = _size(past @ (act @ theta[:, :n] * plant.noise), plant.noise_ball)
    now = np.pad(sample.now, (0, m)) + _size(direct[:, :n] * plant.noise, plant.noise_ball)
    known, grown, old = (_younger(each, weights) for each in (noise + wind, slope, level))
    entry = np.abs(eta)
    cut = np.minimum.accumulate(grown + entry * plant.magnitude - old, axis=0) + old
    from_start = np.minimum(cut, grown + entry * plant.eta_start).sum(axis=2)
    begun = (known + from_start + np.abs(e) @ plant.start).max(axis=0)
    long_run = now + known[-1] + cut[-1].sum(axis=1)
    gain = np.pad(sample.now_rest, ((0, m), (0, 0))) + np.tensordot(weights, rest, 1)
    return Response(long_run=long_run, ever=np.maximum(now + begun, long_run), gain=gain, lags=lags)


def _younger(each: Array, weights: Array) -> Array:
    """Sums over all lags that are younger than each."""
    counted = (each.T * weights).T
    return np.cumsum(counted, axis=0) - counted


def rest_at(plant: Plant, size: Array) -> Array:
    """The remainder of a tube of that size (W, U), a huge number where it is not defined."""
    rho: Array = np.nan_to_num(plant.remainder(*np.split(size, [len(plant.A)])), nan=np.inf)
    return np.minimum(rho, 1e300)


def sizes(plant: Plant, rows: Array) -> Array:
    """(W, U), W the largest of the nodes."""
    n, m = plant.B.shape
    return np.concatenate([rows[:-m].reshape(-1, n).max(axis=0), rows[-m:]])


def settle(plant: Plant, gain: Array, rows: Array, steps: int) -> tuple[Array, float]:
    """(W, U) after so many steps of rows + gain rho(W, U), and by which share the last one widened them.

    That is inf where they grow `FAR`, at which they are cut off.
    """
    size, moved = sizes(plant, rows), np.inf
    ceiling = FAR * sizes(plant, rows + gain @ rest_at(plant, size))
    for _ in range(steps):
        before, size = size, sizes(plant, rows + gain @ rest_at(plant, size))
        if (size > ceiling).any():
            return np.minimum(size, ceiling), np.inf
        moved = float(np.max(size / np.maximum(before, 1e-300))) - 1
        if moved < STILL:
            break
    return size, moved


def spread(plant: Plant, gain: Array, size: Array) -> float:
    """By which factor more of (W, U) comes back through the remainder: far above 1 no tube near `size` closes."""
    more = [rest_at(plant, size + own) - rest_at(plant, size) for own in np.diag(size)]
    back = np.transpose([sizes(plant, gain @ own) for own in more]) / np.maximum(size, 1e-300)[:, None]
    return float(np.abs(np.linalg.eigvals(np.nan_to_num(np.minimum(back, 1e100)))).max())
