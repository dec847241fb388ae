"""Small machines with a computer in the loop: drawn at random, written as specifications, attacked from outside.

Shares nothing with the package: the plant by Runge and Kutta with delays and holds, kernels by matrix exponentials of
parts of a sample, the worst signals by their signs and, where a signal has a size and a rate, by a linear program.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import linprog
from scipy.sparse import diags, identity, vstack

Array = NDArray[np.float64]
REACH = 20  # of x* of a family


@dataclass(frozen=True, kw_only=True)
class Machine:
    """x' = A x + bent x_j**3 + B (u + h) + E w about a plan; every number is a decimal of few digits.

    `varied`: entry (i, j) of A, or of B if j >= n, times p in `range`. `wave`: x* and u* as a sin + b cos, else a plan
    at rest at 0; `family`: any plan with |u*| <= it, held or with `input_rate`. `start`: how large, of which `kind`.
    """

    A: Array
    B: Array
    E: Array
    sample_time: Fraction
    delay: Fraction = Fraction(0)
    hold: str = "middle"
    noise: tuple[float, ...] = ()  # one number: a length
    wind: tuple[float, ...] = ()
    wind_is_length: bool = False
    wind_rate: float | None = None
    h: float = 0.0  # infinite: any size, but 0 at first
    h_rate: float = 0.0
    bent: tuple[tuple[int, int, float], ...] = ()
    varied: tuple[int, int] | None = None
    range: tuple[float, float] = (1.0, 1.0)
    wave: tuple[float, Array, Array] | None = None  # frequency, (n, 2), (m, 2)
    family: float = 0.0
    input_rate: float | None = None
    defect: float = 0.0
    afterwards: str = "nothing"
    horizon: float = 0.0
    kind: str = "point"
    start: tuple[float, ...] = ()
    controller: str = "auto"

    @property
    def sizes(self) -> tuple[int, int, int]:
        """n, m, k."""
        return len(self.A), self.B.shape[1], self.E.shape[1]

    def at(self, p: float) -> tuple[Array, Array]:
        """A and B of a parameter."""
        both = np.hstack([self.A, self.B])
        if self.varied is not None:
            both[self.varied] *= p
        return both[:, : len(self.A)], both[:, len(self.A) :]

    def field(self, p: float, x: Array, u: Array) -> Array:
        """f + B u of many states, (.., n), and inputs, (.., m)."""
        A, B = self.at(p)
        value: Array = x @ A.T + u @ B.T
        for i, j, c in self.bent:
            value[..., i] += c * x[..., j] ** 3
        return value

    def text(self) -> str:
        """The specification."""
        n, m, k = self.sizes
        x, u = [f"x{i + 1}" for i in range(n)], [f"u{j + 1}" for j in range(m)]
        both = [[f"({v})" for v in row] for row in np.hstack([self.A, self.B]).tolist()]
        if self.varied:
            both[self.varied[0]][self.varied[1]] += "*p"
        f = [" + ".join(f"{a}*{name}" for a, name in zip(row, x, strict=False)) for row in both]
        for i, j, c in self.bent:
            f[i] += f" + ({c})*{x[j]}**3"
        system = {"states": x, "inputs": u, "f": f, "B": [row[n:] for row in both]}
        noise: object = (
            self.noise[0] if len(self.noise) == 1 else dict(zip(x, self.noise, strict=bool(self.noise)))
        )
        machine = {"sample_time": float(self.sample_time), "delay": float(self.delay), "hold": self.hold}
        given: dict[str, object] = {
            "tubecert": 1,
            "name": "machine",
            "system": system | ({"parameters": {"p": self.range}} if self.varied else {}),
            "safe_set": dict.fromkeys(x, (-60, 60)),
            "trajectory": self._plan(x, u),
            "hardware": machine | ({"noise": noise} if self.noise else {}),
            "controller": self.controller,
        }
        if self.h and np.isfinite(self.h):
            given["uncertainty"] = {"bounds": {"h": self.h, "h_x": 0, "h_t": self.h_rate}}
        elif self.h:  # any size, from 0 on
            given["uncertainty"] = {"h": [f"100*{self.h_rate}*sin(t/100)"] * m}
        if k:
            wind = {"E": self.E.tolist(), "bound": self.wind[0] if self.wind_is_length else self.wind}
            given["disturbance"] = wind | ({"rate": self.wind_rate} if self.wind_rate is not None else {})
        if self.start:
            zero, size = self.planned(np.zeros(1))[0][0], self.start
            ends = {"point": {"at": (zero + size).tolist()}, "ball": {"within": size[0]}}
            box = zip(x, np.stack([zero - size, zero + size], axis=1).tolist(), strict=True)
            given["initial_state"] = ends.get(self.kind) or {"box": dict(box)}
        return json.dumps(given)

    def _plan(self, x: list[str], u: list[str]) -> dict[str, object]:
        if self.wave is not None:
            w, *curves = self.wave
            texts = [[f"({a})*sin({w}*t) + ({b})*cos({w}*t)" for a, b in curve.tolist()] for curve in curves]
            times = {"horizon": self.horizon, "afterwards": self.afterwards}
            return {"kind": "expressions", "x": texts[0], "u": texts[1], **times}
        if self.family:
            boxes = {
                "x": dict.fromkeys(x, (-REACH, REACH)),
                "u": dict.fromkeys(u, (-self.family, self.family)),
            }
            rate = {} if self.input_rate is None else {"input_rate": self.input_rate}
            return {"kind": "any", **boxes, "defect": self.defect, **rate}
        return {"kind": "equilibrium", "at": [0] * len(x), "input": [0] * len(u)}

    def planned(self, t: Array) -> tuple[Array, Array]:
        """x* and u* of a wave, or of a point, at times (..)."""
        n, m, _ = self.sizes
        if self.wave is None:
            return np.zeros((*t.shape, n)), np.zeros((*t.shape, m))
        w, x, u = self.wave
        basis = np.stack([np.sin(w * t), np.cos(w * t)], axis=-1)
        return basis @ x.T, basis @ u.T


class Tables(NamedTuple):
    """delta = M zeta + N dy, zeta+ = F zeta + G dy."""

    F: Array
    G: Array
    M: Array
    N: Array


def any_tables(machine: Machine, seed: int) -> Tables:
    """A controller with two states that need not stabilise anything."""
    rng, (n, m, _) = np.random.default_rng(seed), machine.sizes
    return Tables(*(0.5 * rng.normal(size=size) for size in ((2, 2), (2, n), (m, 2), (m, n))))


class Signals(NamedTuple):
    """What an adversary does in K samples of s parts: noise (K, n), gusts (K, s, b), eta (K, s + 1, r), start."""

    noise: Array
    gusts: Array
    eta: Array
    start: Array


@dataclass(frozen=True)
class Attack:
    """One machine, its tables and one value of its parameter, on parts of a sample of which tau' is an end."""

    machine: Machine
    tables: Tables
    p: float
    samples: int
    fine: int = 2

    @cached_property
    def parts(self) -> list[float]:
        """Their lengths."""
        ends = sorted({Fraction(0), self.machine.delay % self.machine.sample_time, self.machine.sample_time})
        return [float(b - a) / self.fine for a, b in pairwise(ends) for _ in range(self.fine)]

    @property
    def whole(self) -> int:
        """q."""
        return int(self.machine.delay // self.machine.sample_time)

    def late(self, part: int) -> int:
        """How many commands after the newest one the actuators are in a part of a sample."""
        rest = float(self.machine.delay % self.machine.sample_time)
        return self.whole + (sum(self.parts[: part + 1]) <= rest * (1 + 1e-9))

    @property
    def sudden(self) -> list[tuple[Array, Array, bool]]:
        """Columns, sizes, whether one size is a length: winds without a rate, what a family's plan misses."""
        m, n = self.machine, len(self.machine.A)
        blocks = []
        if m.wind and m.wind_rate is None:
            blocks.append((m.E, np.array(m.wind), m.wind_is_length))
        if m.family and m.defect:
            blocks.append((-np.eye(n), np.full(n, m.defect), False))
        return blocks

    @property
    def smooth(self) -> list[tuple[Array, float, float]]:
        """Column, size and rate of what moves at a rate: h, then winds."""
        m, (_, B) = self.machine, self.machine.at(self.p)
        found = []
        if m.h:
            found += [(B[:, j], m.h, m.h_rate) for j in range(B.shape[1])]
        if m.wind and m.wind_rate is not None:
            # a length is spread over the components
            k = m.E.shape[1]
            share = 1 / np.sqrt(k) if m.wind_is_length else 1.0
            sizes = np.array(m.wind) * share * np.ones(k)
            found += [(m.E[:, i], sizes[i], m.wind_rate * share) for i in range(k)]
        return found

    @property
    def columns(self) -> tuple[Array, Array]:
        """Those of all that is sudden, and of all that moves at a rate."""
        none = np.zeros((len(self.machine.A), 0))
        sudden, smooth = ([block[0] for block in blocks] for blocks in (self.sudden, self.smooth))
        return np.hstack([none, *sudden]), np.column_stack([none, *smooth])

    def kernels(self) -> "Kernels":
        """Of e_i at the end of every part of a sample, and of delta, back over all samples."""
        A, B = self.machine.at(self.p)
        n, m, t = len(A), B.shape[1], self.tables
        z, queue, r = len(t.F), m * (self.whole + 2), len(self.smooth)
        size = n + z + queue + r
        gusts, H = self.columns
        sample, noise = np.eye(size), np.zeros((size, n))
        sample[n : n + z] = np.hstack([t.G, t.F, np.zeros((z, queue + r))])
        sample[n + z : n + z + queue] = 0
        sample[n + z : n + z + m, : n + z] = np.hstack([t.N, t.M])
        sample[n + z + m : n + z + queue, n + z : n + z + queue - m] = np.eye(queue - m)
        noise[n : n + z], noise[n + z : n + z + m] = t.G, t.N
        steps = []
        for part, length in enumerate(self.parts):
            place = n + z + m * self.late(part)
            flow = np.zeros((size + gusts.shape[1] + r,) * 2)
            flow[:n, :n], flow[:n, place : place + m], flow[:n, size - r : size] = A, B, H
            flow[:n, size : size + gusts.shape[1]] = gusts
            flow[size - r : size, size + gusts.shape[1] :] = np.eye(r)
            steps.append(np.split(expm(flow * length)[:size], [size, size + gusts.shape[1]], axis=1))
        first = np.zeros((n * len(steps) + m, size))
        first[: n * len(steps), :n] = np.tile(np.eye(n), (len(steps), 1))
        first[n * len(steps) :, n + z : n + z + m] = np.eye(m)
        return _backward(steps, sample, noise, first, self.samples)

    def worst(self, kernels: "Kernels", k: int, row: int, *, sign: float = 1.0) -> tuple[float, Signals]:
        """The most that an output at sample k can be, with a sign, beside what is known, and the signals that do it."""
        lags = slice(k, None, -1)
        s = len(self.parts)
        sizes = np.array(self.machine.noise or (0.0,))
        noise, value = _largest(kernels.noise[lags, row], (sizes, len(sizes) == 1))
        gusts, at = np.zeros((k + 1, s, kernels.gusts.shape[-1])), 0
        for columns, sizes, length in self.sudden:
            own = slice(at, at := at + columns.shape[1])
            gusts[..., own], more = _largest(kernels.gusts[lags, row][..., own], (sizes, length))
            value += more
        eta = np.zeros((k + 1, s + 1, len(self.smooth)))
        for c, (_, most, rate) in enumerate(self.smooth):
            first = kernels.eta[k, row, c]
            rates, lengths = kernels.rate[lags, row, :, c].ravel(), np.tile(self.parts, k + 1)
            curve, more = slow(rates, first, lengths, most, rate)
            eta[..., c] = np.lib.stride_tricks.sliding_window_view(curve, s + 1)[::s]
            value += more
        start, more = self._start(kernels.e[k, row], sign)
        return value + more, Signals(sign * noise, sign * gusts, sign * eta, start)

    def still(self, kernels: "Kernels") -> Signals:
        """Nothing that is not known: the start, if it is a point."""
        count, s, n = self.samples + 1, len(self.parts), len(self.machine.A)
        gusts, eta = np.zeros((count, s, kernels.gusts.shape[-1])), np.zeros((count, s + 1, len(self.smooth)))
        known = self.machine.start if self.machine.kind == "point" and self.machine.start else [0.0] * n
        return Signals(np.zeros((count, n)), gusts, eta, np.array(known))

    def _start(self, row: Array, sign: float) -> tuple[Array, float]:
        given = np.array(self.machine.start or (0.0,) * len(row))
        if self.machine.kind == "point":
            return given, 0.0  # known: it is in `still`
        if self.machine.kind == "box":
            return sign * np.sign(row) * given, float(np.abs(row) @ given)
        size = float(np.linalg.norm(row))
        return sign * row / (size or 1.0) * given[0], size * given[0]

    def run(self, signals: Signals, steps: int = 4) -> tuple[Array, Array]:
        """e at the nodes, (K, s + 1, n), and delta, (K, m), of the true plant, by Runge and Kutta."""
        m, t, ts, inputs = self.machine, self.tables, float(self.machine.sample_time), self.machine.sizes[1]
        n, count = len(m.A), len(signals.noise)
        gusts, H = self.columns
        own = gusts.shape[1] - n * bool(m.family and m.defect)  # columns that push x; the others push x*
        middle = float(np.mean(m.range))
        x, plan = m.planned(np.zeros(1))[0][0] + signals.start, m.planned(np.zeros(1))[0][0]
        zeta, sent = np.zeros(len(t.F)), [np.zeros(inputs)] * (self.whole + 2)
        e, delta = np.zeros((count, len(self.parts) + 1, n)), np.zeros((count, inputs))
        for k in range(count):
            now, e[k, 0] = k * ts, x - plan
            dy = e[k, 0] + signals.noise[k]
            delta[k] = t.M @ zeta + t.N @ dy
            zeta, sent = t.F @ zeta + t.G @ dy, [delta[k], *sent[:-1]]
            for part, length in enumerate(self.parts):
                command, w = k - self.late(part), signals.gusts[k, part]
                acting, held, h = sent[self.late(part)], self.held(command), length / steps
                push, miss = gusts[:, :own] @ w[:own], w[own:] if own < len(w) else 0.0
                a, b = signals.eta[k, part], signals.eta[k, part + 1]
                y = np.concatenate([x, plan])
                for i in range(steps):
                    slopes, base = [np.zeros(2 * n)], y
                    for share in (0.0, 0.5, 0.5, 1.0):
                        s, at = (i + share) * h, base + share * h * slopes[-1]
                        wanted = self.input(now + s, command)
                        u = acting + (wanted if m.hold == "continuous" else held)
                        real = m.field(self.p, at[:n], u) + push + H @ (a + (b - a) * s / length)
                        slopes.append(np.concatenate([real, m.field(middle, at[n:], wanted) + miss]))
                    y = base + h / 6 * (slopes[1] + 2 * slopes[2] + 2 * slopes[3] + slopes[4])
                now += length
                x, plan = y[:n], y[n:] if m.family else m.planned(np.array([now]))[0][0]
                e[k, part + 1] = x - plan
                assert np.abs(plan).max() <= REACH, "a plan that is none of the family"
        return e, delta

    def input(self, t: float, command: int) -> Array:
        """u*(t), where a command acts: of a family a triangle, or what the planner has drawn for the command."""
        m = self.machine
        if not m.family:
            return m.planned(np.array([t]))[1][0]
        inputs = m.sizes[1]
        if m.input_rate is None:
            return m.family * np.where(np.random.default_rng(1000 + command).random(inputs) < 0.5, -1.0, 1.0)
        phase = m.input_rate * t / m.family + np.arange(inputs)
        return m.family * np.asarray(np.abs((phase % 4) - 2) - 1)

    def held(self, command: int) -> Array:
        """ubar of a command: u* at the middle or the left end of its part from 0 on."""
        m, ts = self.machine, float(self.machine.sample_time)
        begin = command * ts + float(m.delay)
        left, right = max(0.0, begin), max(0.0, begin + ts)
        return self.input((left + right) / 2 if m.hold == "middle" else left, command)


class Kernels(NamedTuple):
    """By lag, output (R) and part (s): of noise (L, R, n), gusts (L, R, s, b), rates (L, R, s, r); rows."""

    noise: Array
    gusts: Array
    rate: Array
    e: Array
    eta: Array


def _backward(steps: list[list[Array]], sample: Array, noise: Array, first: Array, count: int) -> Kernels:
    """Rows of the outputs pulled back through the parts of a sample, then from sample to sample."""
    size, s, rows = len(sample), len(steps), first
    n = noise.shape[1]
    since = np.array([*np.repeat(np.arange(s), n), *np.full(len(first) - n * s, -1)])  # after which part
    found: list[tuple[Array, ...]] = []
    for lag in range(count + 1):
        pushed = []
        for part in reversed(range(s)):
            flow, gusts, rate = steps[part]
            there = (since >= part)[:, None] if lag == 0 else True
            pushed.append((np.where(there, rows @ gusts, 0), np.where(there, rows @ rate, 0)))
            rows = np.where(there, rows @ flow, rows)
        w, r = (np.stack(each[::-1], axis=1) for each in zip(*pushed, strict=True))
        at_sample, rows = rows @ noise, rows @ sample
        found.append((at_sample, w, r, rows[:, :n], rows[:, size - r.shape[-1] :]))
    own = [np.stack(each) for each in zip(*found, strict=True)]
    return Kernels(noise=own[0], gusts=own[1], rate=own[2], e=own[3], eta=own[4])


def _largest(kernel: Array, size: tuple[Array, bool]) -> tuple[Array, float]:
    """The signal (.., b) within sizes, or within a length, that makes sum kernel signal largest, and how large."""
    sizes, length = size
    if not length:
        return np.sign(kernel) * sizes, float((np.abs(kernel) * sizes).sum())
    long = np.linalg.norm(kernel, axis=-1, keepdims=True)
    return kernel / np.where(long > 0, long, 1.0) * sizes[0], float(long.sum() * sizes[0])


def slow(rates: Array, first: float, lengths: Array, most: float, rate: float) -> tuple[Array, float]:
    """The curve (N + 1,) with |eta| <= most, |eta'| <= rate that makes first eta(0) + sum rates eta' largest.

    A linear program in eta at the nodes: the coefficients of eta' per part are those of its ends.
    """
    slope = rates / lengths
    cost = np.concatenate([[first], np.zeros(len(rates))])
    cost[:-1] -= slope
    cost[1:] += slope
    count = len(cost)
    ahead = diags([np.ones(count - 1)], [1], shape=(count - 1, count)) - identity(count).tocsr()[:-1]
    limits = np.concatenate([rate * lengths] * 2)
    both = vstack([ahead, -ahead]).tocsr()
    ends = [(-most, most) if np.isfinite(most) else (0.0, 0.0), *[(-most, most)] * len(rates)]
    done = linprog(-cost, A_ub=both, b_ub=limits, bounds=ends, method="highs")
    assert done.status == 0, done.message
    return np.asarray(done.x), -float(done.fun)


class Met(NamedTuple):
    """An output at a sample: the most that any signals can do in the model, what they did, what is proven."""

    sample: int
    output: str
    limit: float
    attained: float
    proven: float


def met(
    machine: Machine, tables: Tables, proven: Callable[[int, str], float], samples: tuple[int, ...]
) -> list[Met]:
    """Every output at the ends of both parts of a sample and delta, under the signals that are worst for it.

    `proven` gives the half-width of a state, or the deviation of an input, that holds at a sample.
    """
    found = []
    n, m, _ = machine.sizes
    for p in machine.range if machine.varied else (1.0,):
        attack = Attack(machine, tables, p, max(samples))
        kernels, s = attack.kernels(), len(attack.parts)
        errors, deltas = attack.run(attack.still(kernels))
        rows = [*range(n * (s // 2), n * (s // 2 + 1)), *range(n * (s - 1), n * s + m)]
        for k, row in product(samples, rows):
            known = deltas[k, row - n * s] if row >= n * s else errors[k, row // n + 1, row % n]
            limit, signals = attack.worst(kernels, k, row, sign=1.0 if known >= 0 else -1.0)
            e, delta = attack.run(signals)
            attained = abs(float(delta[k, row - n * s] if row >= n * s else e[k, row // n + 1, row % n]))
            name = f"u{row - n * s + 1}" if row >= n * s else f"x{row % n + 1}"
            most = attained if machine.bent else abs(known) + limit
            found.append(Met(k, name, most, attained, proven(k, name)))
    return found


def least(machine: Machine, history: int) -> Array:
    """Half-widths (n,) that no controller of any kind can go below, for an h of this rate and of any size.

    Signals that no sample tells from none lead to the same inputs, and so do their opposites: one of both loops is off
    by as much as they move the state until the next command has acted.
    """
    (n, _, _), parts, length = machine.sizes, 8, float(machine.sample_time) / 8
    flow = np.zeros((n + 2, n + 2))
    flow[:n, :n], flow[:n, n], flow[n, n + 1] = machine.A, machine.B[:, 0], machine.h_rate
    step = expm(flow * length)
    count = history * parts + round(float(machine.sample_time + machine.delay) / length)
    reach, rows = np.zeros((n + 1, count)), [np.zeros((n, count))]
    for i in range(count):
        reach = step[: n + 1, : n + 1] @ reach
        reach[:, i] += step[: n + 1, n + 1]
        rows.append(reach[:n].copy())
    seen = np.vstack([rows[j * parts] for j in range(1, history + 1)])
    both, limits = np.vstack([seen, -seen]), np.tile(machine.noise, 2 * history) + 1e-12
    ends = [linprog(-row, A_ub=both, b_ub=limits, bounds=(-1, 1), method="highs") for row in rows[-1]]
    assert all(end.status == 0 for end in ends)
    return np.array([-float(end.fun) for end in ends])


def drawn(seed: int) -> Machine:
    """A machine by its seed: 1-3 states, 1-2 inputs, 0 to 2.5 samples of delay, stable or not, of every kind."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    m = int(rng.integers(1, min(n, 2) + 1))
    pick = lambda *values: values[int(rng.integers(len(values)))]  # noqa: E731
    ts = Fraction(pick("0.02", "0.05", "0.1", "0.2"))
    delay = ts * Fraction(pick("0", "0", "0.3", "0.5", "1", "1.3", "2", "2.5"))
    A = rng.normal(size=(n, n))
    grows = float(np.linalg.eigvals(A).real.max())
    alone = rng.random() < 0.2
    most = -0.5 if alone else float(rng.uniform(-1, 0.25 / float(ts + delay)))
    A = np.round(A + (min(most, 1.5) - grows) * np.eye(n), 2)
    B = np.round(rng.normal(size=(n, m)) + np.eye(n)[:, :m], 2)
    k = int(rng.integers(0, 3))
    E = np.round(rng.normal(size=(n, k)), 2)
    own: dict[str, object] = {"controller": "none" if alone else "auto"}
    own |= {"hold": pick("middle", "left", "continuous")}
    if rng.random() < 0.8:
        own["noise"] = tuple(np.round(rng.uniform(0.001, 0.02, size=pick(1, n)), 4).tolist())
    if k:
        length = bool(rng.random() < 0.5)
        own |= {"wind": tuple(np.round(rng.uniform(0.01, 0.1, size=1 if length else k), 2).tolist())}
        own |= {"wind_is_length": length, "wind_rate": pick(None, None, 0.2)}
    if rng.random() < 0.6:
        own |= {"h": pick(0.05, 0.1), "h_rate": pick(0.1, 0.5, 3.0)}
    kind = pick("rest", "rest", "wave", "family")
    if kind == "wave":
        own |= _wave(A, B, pick, rng)
    elif kind == "family" and float(np.linalg.eigvals(A).real.max()) < -0.1:
        own |= {"family": pick(0.1, 0.3), "defect": pick(0.0, 0.005), "input_rate": pick(None, 0.5)}
    if rng.random() < 0.3:
        own |= {"varied": (int(rng.integers(n)), int(rng.integers(n + m)))}
        own |= {"range": pick((0.97, 1.03), (0.9, 1.1))}
    if rng.random() < 0.3:
        own["bent"] = ((int(rng.integers(n)), int(rng.integers(n)), pick(-0.5, 0.3)),)
    own["kind"] = "ball" if "family" in own else pick("point", "box", "ball")
    size = np.round(rng.uniform(0.0, 0.1, size=1 if own["kind"] == "ball" else n), 2) + 0.01
    own["start"] = tuple(np.round(size, 2).tolist())
    return Machine(A=A, B=B, E=E, sample_time=ts, delay=delay, **own)  # type: ignore[arg-type]


def _wave(A: Array, B: Array, pick, rng: np.random.Generator) -> dict[str, object]:
    w = float(pick(0.5, 1.0, 2.0))
    n, m = B.shape
    u = np.round(rng.uniform(-0.3, 0.3, size=(m, 2)), 2)
    # x = a sin + b cos with x' = A x + B u: (A, w; -w, A) (a; b) = -B (of sin; of cos)
    whole = np.block([[A, w * np.eye(n)], [-w * np.eye(n), A]])
    x = np.linalg.solve(whole, -np.concatenate([B @ u[:, 0], B @ u[:, 1]])).reshape(2, n).T
    x, size = np.round(x, 6), float(np.abs(x).max())
    return {
        "wave": (w, x, u) if size < 2 else None,
        "horizon": float(np.ceil(2 * np.pi / w)),
        "afterwards": pick("nothing", "repeat", "repeat"),
    }
