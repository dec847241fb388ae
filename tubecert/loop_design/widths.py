"""How far a loop can be driven: for every output the sum over lags of what each signal can do, and what remainders add.

In: a plant and tables. Out: `Response`, and W, U as the least fixed point with the remainder. Without one the sums are
what the worst signals attain, up to quadrature and to what happens between the nodes of a sample.
Implements: theory of the sampled loop, sections 3 and 5, in floats. Trusted: no.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, expm

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant

PANELS = 3  # of the midpoint rule in a sample
NODES = (0.5, 1.0)  # of a sample, and where an input changes
TAIL = 1e-2  # what the slowest mode may keep after the last lag
FAR = 1e4  # a tube that many times wider than without remainders has none


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """From one sample to the next: s = (e, v_1..v_{q+1}) with v_i = delta_{k-i}; s+ = A s + B delta + H eta.

    At nodes of the sample, the last of which is its end, e = `rows` s + `direct` delta + `eta` eta, n rows a node, to
    which wind and eta' of the running sample add `now` and rho `now_rest`. `kernels` (panels, n, -): what eta', eta,
    w / wind and rho do to e at its end from the midpoint of a panel on, times the panel.
    """

    A: Array
    B: Array
    H: Array
    rows: Array
    direct: Array
    eta: Array
    now: Array
    now_rest: Array
    kernels: Array


def flow(A: Array, columns: Array, time: float) -> tuple[Array, Array]:
    """e^(A t) (n, n), and the integral of e^(A r) over [0, t] times the columns."""
    n, width = columns.shape
    block = np.zeros((n + width, n + width))
    block[:n, :n], block[:n, n:] = A, columns
    whole = expm(block * time)
    return whole[:n, :n], whole[:n, n:]


def _kernels(plant: Plant, span: float) -> Array:
    """Those of `Sample`, of a span that may be shorter."""
    length = span / PANELS
    flows = [flow(plant.A, plant.H, span - (i + 0.5) * length) for i in range(PANELS)]
    phi, lag = (length * np.array(each) for each in zip(*flows, strict=True))
    return np.concatenate([lag, phi @ plant.H, phi @ (plant.E * plant.wind), phi, phi @ plant.B], axis=2)


def parts(plant: Plant, kernels: Array) -> list[Array]:
    """What belongs to eta', eta, wind and rho."""
    r, k = plant.H.shape[1], plant.E.shape[1]
    return np.split(kernels, np.cumsum([r, r, k]), axis=-1)


def _size(rows: Array, ball: bool) -> Array:
    """What a ball, or a box, of size one can do through the last axis."""
    size: Array = np.sqrt(np.square(rows).sum(-1)) if ball else np.abs(rows).sum(-1)
    return size


def sample_of(plant: Plant) -> Sample:
    """One sample of the plant with the queue of its inputs."""
    n, m = plant.B.shape
    queue = max(0, math.ceil(plant.delay / plant.sample_time - 1e-9) - 1)
    late = plant.delay - queue * plant.sample_time
    held = n + m * (queue + 1)
    nodes = []
    for time in sorted({node * plant.sample_time for node in NODES} | {late} - {0.0}):
        (phi, eta), after = flow(plant.A, plant.H, time), max(0.0, time - late)
        row, direct = np.zeros((n, held)), np.zeros((n, m))
        since, newer = flow(plant.A, plant.B, after)
        row[:, :n], row[:, held - m :] = phi, since @ flow(plant.A, plant.B, min(time, late))[1]
        (row[:, held - 2 * m : held - m] if queue else direct)[:] = newer
        slope, _, wind, rest = parts(plant, _kernels(plant, time))
        now = np.abs(slope).sum(0) @ plant.rate + _size(wind, plant.wind_ball).sum(0)
        nodes.append((row, direct, eta, now, np.abs(rest).sum(0)))
    rows, direct, eta, now, now_rest = (np.concatenate(each) for each in zip(*nodes, strict=True))
    shift = np.hstack([np.zeros((held - n, n)), np.eye(held - n, held - n, -m)])
    return Sample(
        A=np.vstack([rows[-n:], shift]),
        B=np.vstack([direct[-n:], np.eye(held - n, m)]),
        H=np.vstack([eta[-n:], np.zeros((held - n, plant.H.shape[1]))]),
        rows=rows, direct=direct, eta=eta, now=now, now_rest=now_rest,
        kernels=_kernels(plant, plant.sample_time),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Bounds of e at all nodes, then of delta, n nodes + m rows: `long_run` without the start, `ever` with it.

    rho adds `gain` |rho| to both. `lags`: after how many samples the slowest mode has fallen to `TAIL`.
    """

    long_run: Array
    ever: Array
    gain: Array
    lags: float


def _powers(rows: Array, matrix: Array, count: int) -> Array:
    """rows matrix^j for j = 0..count, by doubling; (count + 1, rows, -)."""
    found, power = rows[None], matrix
    while len(found) <= count:
        found, power = np.concatenate([found, found @ power]), power @ power  # products too small for threads
    return found[: count + 1]


def respond(plant: Plant, sample: Sample, theta: Array, most: int) -> Response | None:
    """What the signals of the plant can do to the loop, or None if it is not stable; at most so many lags.

    `theta` (m + z, n + z) is the controller: (delta, zeta+) = theta (dy, zeta). A loop that forgets more slowly is
    summed as if the rest fell with its slowest mode.
    """
    (n, m), held = plant.B.shape, len(sample.A)
    memory = np.eye(len(theta) - m)
    act, hear = block_diag(sample.B, memory), block_diag(np.eye(n, held), memory)
    loop = act @ theta @ hear
    loop[:held, :held] += sample.A
    if not (slowest := float(np.abs(np.linalg.eigvals(loop)).max())) < 1 - 1e-9:
        return None
    lags = math.log(TAIL) / math.log(max(slowest, 0.3))
    half = math.ceil(min(max(lags, 20), most) / 2)
    direct = np.vstack([sample.direct, np.eye(m)]) @ theta[:m]
    rows = direct @ hear
    rows[:-m, :held] += sample.rows
    powers = _powers(rows, loop, 2 * half)
    past = powers[:-1]
    drawn = past[:, :, :n].reshape(-1, n)
    slope, level, wind, rest = (
        np.stack([drawn @ panel for panel in part]).reshape(PANELS, *past.shape[:2], -1)
        for part in parts(plant, sample.kernels)
    )
    noise = _size(past @ (act @ theta[:, :n] * plant.noise), plant.noise_ball)
    now = np.pad(sample.now, (0, m)) + _size(direct[:, :n] * plant.noise, plant.noise_ball)
    known = now + _summed(noise + _size(wind, plant.wind_ball).sum(0))
    entry = np.pad(sample.eta, ((0, m), (0, 0))) + _summed(past[:, :, :held] @ sample.H)
    lasting, from_start = _of_eta(plant, entry, slope, level)
    begun = (known + from_start + np.abs(powers[:, :, :n]) @ plant.start).max(axis=0)
    known += lasting
    kept = 1 / (1 - slowest**half)  # of what the second half of the lags adds: all the lags that follow
    long_run = known[half] + kept * (known[-1] - known[half])
    rests = np.abs(rest).sum(0)
    gain = np.pad(sample.now_rest, ((0, m), (0, 0))) + rests[:half].sum(0) + kept * rests[half:].sum(0)
    return Response(long_run=long_run, ever=np.maximum(begun, long_run), gain=gain, lags=lags)


def _summed(each: Array) -> Array:
    """Sums of the first 0, 1, .. of them."""
    return np.concatenate([0 * each[:1], np.cumsum(each, axis=0)])


def _of_eta(plant: Plant, entry: Array, slope: Array, level: Array) -> tuple[Array, Array]:
    """The share of eta after 0..L lags, in the long run and from the start; (L + 1, rows) each.

    Each component is cut where that is best: up to the cut it is a state that moves with its rate, with these entries
    of the rows, and all that is older is a signal of its magnitude. From the start it need not be cut.
    """
    panel = plant.sample_time / PANELS
    grown = _summed(np.abs(slope + panel * entry[:-1]).sum(0) * plant.rate)
    old = _summed(np.abs(level).sum(0) * plant.magnitude)
    cut = np.minimum.accumulate(grown + np.abs(entry) * plant.magnitude - old, axis=0) + old
    return cut.sum(axis=2), np.minimum(cut, grown + np.abs(entry) * plant.eta_start).sum(axis=2)


def rest_at(plant: Plant, size: Array) -> Array:
    """The remainder of a tube of that size (W, U), a huge number where it is not defined."""
    rho: Array = np.nan_to_num(plant.remainder(*np.split(size, [len(plant.A)])), nan=np.inf)
    return np.minimum(rho, 1e300)


def sizes(plant: Plant, rows: Array) -> Array:
    """(W, U), W the largest of the nodes."""
    n, m = plant.B.shape
    return np.concatenate([rows[:-m].reshape(-1, n).max(axis=0), rows[-m:]])


def settle(plant: Plant, gain: Array, rows: Array, steps: int) -> tuple[Array, bool]:
    """(W, U) after so many steps of rows + gain rho(W, U), and whether they settled.

    Where they grow `FAR` they are cut off there, times the steps left: a search sees how far from a fixed point it is.
    """
    size = sizes(plant, rows)
    ceiling = FAR * (rows + gain @ rest_at(plant, size))
    for left in range(steps, 0, -1):
        grown = rows + gain @ rest_at(plant, size)
        if (grown > ceiling).any():
            return sizes(plant, np.minimum(grown, ceiling)) * (1 + left), False
        before, size = size, sizes(plant, grown)
        if np.allclose(size, before, rtol=1e-6, atol=0):
            return size, True
    return size, False
