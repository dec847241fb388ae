"""How far a loop can be driven: for every output the sum over lags of what each signal can do, and what remainders add.

In: a plant and tables. Out: `Response`, and W, U as the least fixed point with the remainder. Without remainders the
sums are what the worst signals attain, up to quadrature and to outputs that are taken at `NODES` of a sample only.
Implements: (D.8) and (D.9') of docs/theory-sampled-loop.md, in floats. Trusted: no.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from tubecert.enclosure.interval import Array
from tubecert.loop_design.plant import Plant

__all__ = ["Response", "Sample", "Table", "respond", "settle", "step_of"]

PANELS = 3  # of the midpoint rule in a sample
NODES = (0.5, 1.0)  # of a sample, and where an input changes
FAR = 1e4
TAIL = 1e-4  # what the slowest mode may keep after the last lag


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """delta = M zeta + N dy, zeta+ = F zeta + G dy: F (z, z), G (z, n), M (m, z), N (m, n)."""

    F: Array
    G: Array
    M: Array
    N: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Kernels:
    """What a signal in force since a midpoint of a span does at its end, times the panel's length; (panels, n, -).

    `slope` is of eta', `level` of eta, `wind` of w per unit of its bound, `rest` of rho.
    """

    slope: Array
    level: Array
    wind: Array
    rest: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """From one sample to the next: s = (e, v_1..v_{q+1}) with v_i = delta_{k-i}; s+ = A s + B delta + H eta.

    At nodes of the sample, the last of which is its end, e = `rows` s + `direct` delta + `eta` eta, n rows a node;
    `now` and `now_rest` are what wind, eta' and rho of the running sample add to each row.
    """

    A: Array
    B: Array
    H: Array
    rows: Array
    direct: Array
    eta: Array
    now: Array
    now_rest: Array
    kernels: Kernels


def _flow(A: Array, columns: Array, time: float) -> tuple[Array, Array]:
    """e^(A t) (n, n), and the integral of e^(A r) over [0, t] times the columns."""
    n, width = columns.shape
    block = np.zeros((n + width, n + width))
    block[:n, :n], block[:n, n:] = A, columns
    whole = expm(block * time)
    return whole[:n, :n], whole[:n, n:]


def _kernels(plant: Plant, span: float) -> Kernels:
    n, m = plant.B.shape
    length = span / PANELS
    flows = [_flow(plant.A, plant.H, span - (i + 0.5) * length) for i in range(PANELS)]
    pushed = [length * phi for phi, _ in flows]
    return Kernels(
        slope=np.array([length * lag for _, lag in flows]),
        level=np.array([phi @ plant.H for phi in pushed]),
        wind=np.array([phi @ plant.E * plant.wind for phi in pushed]),
        rest=np.array([phi @ np.hstack([np.eye(n), plant.B]) for phi in pushed]).reshape(PANELS, n, n + m),
    )


def _length(rows: Array, ball: bool) -> Array:
    """The dual norm over the last axis: what a ball, or a box, of size one can do."""
    return np.sqrt(np.square(rows).sum(-1)) if ball else np.abs(rows).sum(-1)


def step_of(plant: Plant) -> Sample:
    """One sample of the plant with the queue of its inputs."""
    n, m = plant.B.shape
    queue = max(0, math.ceil(plant.delay / plant.sample_time - 1e-9) - 1)
    late = plant.delay - queue * plant.sample_time
    held = n + m * (queue + 1)
    times = {node * plant.sample_time for node in NODES} | ({late} if late > 0 else set())
    rows, direct, eta, now, rest = [], [], [], [], []
    for time in sorted(times):
        before, after = min(time, late), max(0.0, time - late)
        row, add = np.zeros((n, held)), np.zeros((n, m))
        row[:, :n], from_eta = _flow(plant.A, plant.H, time)
        row[:, held - m :] = _flow(plant.A, plant.B, after)[0] @ _flow(plant.A, plant.B, before)[1]
        newer = _flow(plant.A, plant.B, after)[1]
        if queue:
            row[:, held - 2 * m : held - m] += newer
        else:
            add = newer
        kernels = _kernels(plant, time)
        rows.append(row), direct.append(add), eta.append(from_eta)
        now.append(np.abs(kernels.slope).sum(0) @ plant.rate + _length(kernels.wind, plant.wind_ball).sum(0))
        rest.append(np.abs(kernels.rest).sum(0))
    shift = np.eye(held - n, held - n, -m)
    return Sample(
        A=np.vstack([rows[-1], np.hstack([np.zeros((held - n, n)), shift])]),
        B=np.vstack([direct[-1], np.eye(held - n, m)]),
        H=np.vstack([eta[-1], np.zeros((held - n, plant.H.shape[1]))]),
        rows=np.vstack(rows),
        direct=np.vstack(direct),
        eta=np.vstack(eta),
        now=np.concatenate(now),
        now_rest=np.vstack(rest),
        kernels=_kernels(plant, plant.sample_time),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Bounds of e at all nodes, then of delta: rows (nodes n + m,).

    `long_run` without the start, `ever` with it; rho adds `gain` |rho| to both. `eigenvalue`: the largest of the
    loop; `lags`: after how many samples its mode has fallen to `TAIL`.
    """

    long_run: Array
    ever: Array
    gain: Array
    eigenvalue: float
    lags: float

    def split(self, rows: Array, n: int) -> tuple[Array, Array]:
        """W (n,), the largest over the nodes, and U (m,)."""
        m = self.gain.shape[1] - n
        return rows[:-m].reshape(-1, n).max(axis=0), rows[-m:]


def _powers(rows: Array, matrix: Array, count: int) -> Array:
    """rows matrix^j for j = 0..count, by doubling; (count + 1, rows, -)."""
    found, power = rows[None], matrix
    while len(found) <= count:
        later = found.reshape(-1, len(matrix)) @ power
        found, power = np.concatenate([found, later.reshape(found.shape)]), power @ power
    return found[: count + 1]


def respond(plant: Plant, step: Sample, table: Table, most: int) -> Response | None:
    """What the signals of the plant can do to the loop, or None if it is not stable; at most so many lags.

    A loop that forgets more slowly is summed as if the rest fell with its slowest mode.
    """
    (n, m), held, size = plant.B.shape, len(step.A), len(step.A) + len(table.F)
    read = np.hstack([table.N, np.zeros((m, held - n)), table.M])
    loop, noise = np.zeros((size, size)), np.vstack([step.B @ table.N, table.G]) * plant.noise
    loop[:held, :held], loop[held:, :n], loop[held:, held:] = step.A, table.G, table.F
    loop[:held] += step.B @ read
    if not (eigenvalue := float(np.abs(np.linalg.eigvals(loop)).max())) < 1 - 1e-9:
        return None
    forgets = math.log(TAIL) / math.log(max(eigenvalue, 0.3))
    half = math.ceil(min(max(forgets, 20), most) / 2)
    direct = np.vstack([step.direct, np.eye(m)])
    rows = direct @ read
    rows[:-m, :held] += step.rows
    powers = _powers(rows, loop, 2 * half)
    past, pad = powers[:-1], ((0, 0), (0, m), (0, 0))
    heard = _length(past @ noise, plant.noise_ball)
    blown = _length(_through(past, step.kernels.wind), plant.wind_ball).sum(0)
    still = np.pad(step.now, (0, m)) + _length(direct @ table.N * plant.noise, plant.noise_ball)
    known = still + np.vstack([np.zeros(len(rows)), np.cumsum(heard + blown, axis=0)])
    lasting, from_start = _of_eta(plant, step, past)
    rest = np.abs(_through(past, step.kernels.rest)).sum(0)
    kept = 1 / (1 - eigenvalue**half)  # of what the second half of the lags adds, for the lags that follow
    begun = known + np.abs(powers[:, :, :n]) @ plant.start + from_start
    known += lasting
    long_run = known[half] + kept * (known[-1] - known[half])
    now_rest = np.pad(step.now_rest[None], pad)[0]
    return Response(
        long_run=long_run,
        ever=np.maximum(begun.max(axis=0), long_run),
        gain=now_rest + rest[:half].sum(0) + kept * rest[half:].sum(0),
        eigenvalue=eigenvalue,
        lags=forgets,
    )


def _through(past: Array, kernels: Array) -> Array:
    """What a signal of one sample does through every row; (panels, lags, rows, columns)."""
    return np.stack([past[:, :, : len(kernel)] @ kernel for kernel in kernels])


def _of_eta(plant: Plant, step: Sample, past: Array) -> tuple[Array, Array]:
    """The share of eta after 0..L lags, in the long run and from the start, (L + 1, rows) each.

    Each component is cut where that is best: up to the cut it is a state that moves with its rate, and all that is
    older is a signal of its magnitude. From the start it need not be cut.
    """
    m = plant.B.shape[1]
    first = np.vstack([step.eta, np.zeros((m, plant.H.shape[1]))])
    entry = first + np.concatenate([0 * first[None], np.cumsum(past[:, :, : len(step.H)] @ step.H, axis=0)])
    panel = plant.sample_time / PANELS
    slope = np.abs(_through(past, step.kernels.slope) + panel * entry[:-1]).sum(0) * plant.rate
    level = np.abs(_through(past, step.kernels.level)).sum(0) * plant.magnitude
    grown, old = (np.concatenate([0 * first[None], np.cumsum(x, axis=0)]) for x in (slope, level))
    best = np.minimum.accumulate(grown + np.abs(entry) * plant.magnitude - old, axis=0)
    cut = best + old
    return cut.sum(axis=2), np.minimum(cut, grown + np.abs(entry) * plant.eta_start).sum(axis=2)


def settle(plant: Plant, response: Response, rows: Array, steps: int) -> tuple[Array, Array, bool]:
    """W, U after so many steps of rows + gain rho(W, U), and whether they settled.

    Where they grow `FAR` beyond the first step they are cut off there, times the steps left: a search sees how far
    from a fixed point it is.
    """
    n = len(plant.A)
    W, U = response.split(rows, n)
    ceiling = np.inf
    for done in range(steps):
        rho = np.minimum(np.nan_to_num(plant.remainder(W, U), nan=np.inf, posinf=np.inf), 1e300)
        grown = rows + response.gain @ rho
        ceiling = FAR * grown if done == 0 else ceiling
        if (grown > ceiling).any():
            return *response.split(np.minimum(grown, ceiling) * (1 + steps - done), n), False
        before, (W, U) = np.r_[W, U], response.split(grown, n)
        if np.allclose(np.r_[W, U], before, rtol=1e-6, atol=0):
            return W, U, True
    return W, U, False
