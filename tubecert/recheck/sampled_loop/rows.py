"""Rows of a loop carried back from sample to sample, and what all signals together do through them.

A row r_i is the middle of the enclosed q_i = r_(i-1) AA: any numbers would do, for what they miss is added, |q_i - r_i|
times the box of the state ("free rows"). From a lag of its own on a slow signal is taken for any one ("cut").
Sums are exact: every term is rounded up to a multiple of a small unit. A product of a row with balls around 0 is a sum
of magnitudes. Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, pairwise

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import Ball, between, exact
from tubecert.recheck.clock import time_is_up, told
from tubecert.recheck.sampled_loop.exponential import around_zero, flow, identity, joined, sizes, zeros
from tubecert.recheck.sampled_loop.loop import Loop
from tubecert.recheck.sampled_loop.record import Stage

SETUP_BITS = 128  # of matrices: rows are carried in those of the context
_UNIT_BITS = 160  # sums are whole multiples of 2^-160
_ROUNDED = 1 + 1e-12  # what floats lose in a length, and in a sum of a hundred of them
_TELLS = 64  # lags
_MOST_TERMS = 8_000_000  # kept: outputs x phases x lags


@dataclass(frozen=True)
class Signals:
    """Magnitudes of noise (n), of winds, and of slow signals (r) with their rates and their sizes at t = 0.

    `noise_length`: a Euclidean length, then all entries are that; else a box. A wind has columns (n, k), and is one or
    the other as well.
    """

    noise: Sequence[Ball]
    noise_length: bool
    winds: Sequence[tuple[arb_mat, Sequence[Ball], bool]]
    slow: Sequence[Ball]
    rates: Sequence[Ball]
    first: Sequence[Ball]


@dataclass(frozen=True)
class Start:
    """e(0) as balls (n), a point or a box; within a `radius` beside that."""

    error: Sequence[Ball]
    radius: Ball


@dataclass(frozen=True)
class Ground:
    """What is known at samples of one phase, from `start` on, while `stage` lasts.

    The remainder (n), what comes through B (m), rounding of dy (n), of u (m) and of zeta (z), the box of xi.
    """

    start: int
    stage: Stage
    remainder: Sequence[Ball]
    through_inputs: Sequence[Ball]
    measured: Sequence[Ball]
    commanded: Sequence[Ball]
    remembered: Sequence[Ball]
    box: Sequence[Ball]


@dataclass(frozen=True)
class Problem:
    """A loop with all that acts on it, phase by phase; rows up to sample `last`, over `lags` lags at most."""

    loop: Loop
    signals: Signals
    start: Start
    grounds: Sequence[Ground]
    lags: int
    last: int

    @property
    def boxes(self) -> arb_mat:
        """Those of xi, (width, phases)."""
        return arb_mat([list(own) for own in zip(*(own.box for own in self.grounds), strict=True)])

    def phase(self, k: int) -> int:
        """The phase of a sample; before 0: the first."""
        return bisect_right(self.grounds, max(k, 0), key=lambda own: own.start) - 1


def units(x: Ball) -> int:
    """At least |x| in units; raises for what is not finite."""
    top = x.abs_upper()
    return 0 if top == 0 else math.ceil(math.ldexp(math.nextafter(float(top), math.inf), _UNIT_BITS))


def limit(q: Fraction) -> int:
    """At most q in units."""
    return math.floor(q * (1 << _UNIT_BITS))


def long(row: Sequence[Ball]) -> float:
    """At least the Euclidean length, in floats."""
    return math.hypot(*[float(x.abs_upper()) for x in row]) * _ROUNDED + 1e-150


class Kernels:
    """int_0^T |r Gamma(s)| ds times amplitudes for rows r, by the trapezoid: |g| <= chord + (d^3/12 a panel) sup|g''|.

    Columns of a bound: one per phase, then for every slow signal what its rate does, then what its magnitude does.
    """

    def __init__(self, problem: Problem, until: Ball, panels: int, *, step: bool) -> None:
        """`step`: of a whole sample, with what arrives at its end."""
        self._loop, self._signals, self._grounds = problem.loop, problem.signals, problem.grounds
        self.width = len(problem.grounds) + 2 * problem.loop.r
        self._columns: list[arb_mat] = []
        self._amplitudes: list[arb_mat] = []
        self._rest = zeros(problem.loop.width, self.width)
        self._lengths: list[tuple[slice, float]] = []
        if step:
            self._arriving()
        d = until / panels
        for k in range(panels + 1):
            self._node(d * k, d / 2 if k in (0, panels) else d)
        for k in range(panels):
            self._panel(between((d * k).lower(), (d * (k + 1)).upper()), d)
        self._all = joined([self._columns])
        self._sized = joined([[own] for own in self._amplitudes])

    def of(self, rows: arb_mat) -> tuple[arb_mat, list[float]]:
        """Balls around 0, (rows, width); and what lengths add to each row in every phase."""
        through = rows * self._all
        found = through * self._sized + rows * self._rest
        if not self._lengths:
            return found, [0.0] * rows.nrows()
        own = [
            sum(weight * long(row[at]) for at, weight in self._lengths) * _ROUNDED for row in through.tolist()
        ]
        return found, own

    def _add(self, columns: arb_mat, amplitudes: Sequence[Sequence[Ball]], weight: Ball | int = 1) -> None:
        """Columns (width, c) with their amplitudes for every column of a bound."""
        self._columns.append(columns)
        flat = [x * weight for row in amplitudes for x in row]
        self._amplitudes.append(around_zero(arb_mat(columns.ncols(), self.width, flat)))

    def _add_length(self, columns: range, weight: Ball) -> None:
        before = sum(own.ncols() for own in self._columns)
        size = math.nextafter(float(weight.abs_upper()), math.inf)
        self._lengths.append((slice(before + columns.start, before + columns.stop), size))

    def _arriving(self) -> None:
        signals, loop = self._signals, self._loop
        if signals.noise_length:
            self._add_length(range(loop.n), signals.noise[0])
        noise = [arb(0) if signals.noise_length else x for x in signals.noise]
        own = [
            [*map(arb.__add__, noise, ground.measured), *ground.commanded, *ground.remembered]
            for ground in self._grounds
        ]
        self._add(loop.arriving, self._by_phase(own))

    def _by_phase(self, of: Sequence[Sequence[Ball]]) -> list[list[Ball]]:
        """Amplitudes by phase as rows: nothing for what is slow."""
        return [[*row, *[arb(0)] * (2 * self._loop.r)] for row in zip(*of, strict=True)]

    def _of_slow(self, place: int, of: Sequence[Ball]) -> list[list[Ball]]:
        """Amplitudes of slow signals: each in a column of its own."""
        before = len(self._grounds) + place * self._loop.r
        return [[x if j == before + c else arb(0) for j in range(self.width)] for c, x in enumerate(of)]

    @property
    def _entries(self) -> arb_mat:
        """Through which columns the remainder, what comes through B, and winds act."""
        return joined([[identity(self._loop.n), self._loop.B, *(own for own, _, _ in self._signals.winds)]])

    @property
    def _fast(self) -> list[list[Ball]]:
        """Their amplitudes by phase; winds of a length have none of their own."""
        winds = [arb(0) if is_long else x for _, each, is_long in self._signals.winds for x in each]
        return self._by_phase([[*own.remainder, *own.through_inputs, *winds] for own in self._grounds])

    @property
    def _long(self) -> Iterator[tuple[range, Ball]]:
        """Which of these columns are those of winds of a length."""
        first = self._loop.n + self._loop.m
        for columns, own, is_long in self._signals.winds:
            if is_long:
                yield range(first, first + columns.ncols()), own[0]
            first += columns.ncols()

    def _node(self, age: Ball, weight: Ball) -> None:
        loop, signals = self._loop, self._signals
        moved, steady = flow(loop.A, age)
        below = loop.width - loop.n
        for columns, size in self._long:
            self._add_length(columns, weight * size)
        fast = moved * self._entries
        self._add(joined([[fast], [zeros(below, fast.ncols())]]), self._fast, weight)
        slow = [[steady * loop.H], [zeros(below - loop.r, loop.r)], [identity(loop.r)]]
        self._add(joined(slow), self._of_slow(0, signals.rates), weight)
        sudden = [[moved * loop.H], [zeros(below, loop.r)]]
        self._add(joined(sudden), self._of_slow(1, signals.slow), weight)

    def _panel(self, ages: Ball, d: Ball) -> None:
        """What the chord of one panel leaves, added to the rest."""
        below = zeros(self._loop.width - self._loop.n, self.width)
        self._rest = self._rest + around_zero(joined([[self.bent(ages, 2) * (d * d * d / 12)], [below]]))

    def bent(self, ages: Ball, order: int) -> arb_mat:
        """sup |d^order Gamma/ds^order| times amplitudes over ages, order 1 or 2, (n, width)."""
        loop, signals, slow = self._loop, self._signals, flow(self._loop.A, ages)[0]
        for _ in range(order - 1):
            slow = loop.A * slow
        fast = loop.A * slow
        bent = fast * self._entries
        bends = joined([[bent, slow * loop.H, fast * loop.H]])
        amplitudes = [*self._fast, *self._of_slow(0, signals.rates), *self._of_slow(1, signals.slow)]
        own = sizes(bends) * arb_mat(bends.ncols(), self.width, [x for row in amplitudes for x in row])
        for columns, size in self._long:
            lengths = [size * long(row[columns.start : columns.stop]) for row in bent.tolist()]
            flat = [x if j < len(self._grounds) else arb(0) for x in lengths for j in range(self.width)]
            own = own + arb_mat(loop.n, self.width, flat)
        return own


@dataclass(frozen=True)
class Sums:
    """Of every output c xi, up to `lags` lags, in units.

    `first[f]`: |c xi_0|; `started[f][k - 1]`: |q_k xi_0|; `gathered[f][p]`: what the first i lags gather at samples
    of a phase; `tails[f][p]`: |q_L| times the box.
    """

    problem: Problem
    lags: int
    first: list[int]
    started: list[list[int]]
    gathered: list[list[list[int]]]
    tails: list[list[int]]

    @cached_property
    def _spans(self) -> list[list[tuple[int, int, int]]]:
        """By sample: which lags, from one to another, are of samples of which phase."""
        begins, found = [own.start for own in self.problem.grounds], []
        for k in range(self.problem.last + 1):
            parts, lags = [], min(k, self.lags)
            for p, (begin, end) in enumerate(pairwise([*begins, max(k, begins[-1])])):
                low, high = max(0, k - end), min(lags, k - begin)  # lags i with begin <= k - 1 - i < end
                if low < high:
                    parts.append((p, low, high))
            found.append(parts)
        return found

    def of(self, f: int) -> list[int]:
        """|c xi_k| of an output, k = 0 .. last."""
        own, tails, phase = self.gathered[f], self.tails[f], self.problem.phase
        late = (tails[phase(k - self.lags)] for k in range(self.lags + 1, self.problem.last + 1))
        begun = [self.first[f], *self.started[f], *late]
        return [
            x + sum(own[p][high] - own[p][low] for p, low, high in parts)
            for x, parts in zip(begun, self._spans, strict=True)
        ]


class LateError(ArithmeticError):
    """The time was up."""


def summed(problem: Problem, first: arb_mat, cuts: Sequence[Sequence[int]], panels: int) -> Sums:
    """All outputs (their enclosed rows `first`); raises `LateError`, or for what is not finite."""
    lags = min(problem.lags, problem.last)
    if first.nrows() * len(problem.grounds) * lags > _MOST_TERMS:
        raise ArithmeticError("there are too many rows, phases and lags")
    with ctx.workprec(SETUP_BITS):
        kernels = Kernels(problem, exact(problem.loop.sample), panels, step=True)
        step = problem.loop.step
    found = _Pass(problem, first, cuts)
    for i in range(lags):
        if i % _TELLS == 0:
            if time_is_up():
                raise LateError("the time was up")
            if (tell := told()) is not None:
                tell(i, i / lags)
        found.lag(i, kernels, step)
    return found.sums(lags)


class _Pass:
    """The rows at one lag, and what they have gathered."""

    def __init__(self, problem: Problem, first: arb_mat, cuts: Sequence[Sequence[int]]) -> None:
        loop, phases = problem.loop, len(problem.grounds)
        self._problem, self._loop, self._signals = problem, loop, problem.signals
        self._rows = self._last = first.mid()
        self._slow = loop.width - loop.r  # where eta begins
        self._boxes = joined([[problem.boxes, zeros(loop.width, 2 * loop.r)]])
        still = [arb(0)] * (loop.width - loop.n - loop.r)
        own = [*problem.start.error, *still, *(arb(0, x.abs_upper()) for x in problem.signals.first)]
        self._begun = arb_mat(loop.width, 1, own)
        self._cut_at: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for f, row in enumerate(cuts):
            for c, lag in enumerate(row):
                self._cut_at[lag].append((f, c))
        # columns of a bound that count for slow signals
        self._taken = [[phases + c for c in range(loop.r)] for _ in range(first.nrows())]
        self._gone: list[tuple[int, int]] = []
        self._first = self._starting(first)
        self._started: list[list[int]] = []
        self._terms: list[list[list[int]]] = [[[] for _ in problem.grounds] for _ in range(first.nrows())]

    def lag(self, i: int, kernels: Kernels, step: arb_mat) -> None:
        """From r_i to r_(i+1)."""
        extra = self._cut(i)
        found, added = kernels.of(self._rows)
        self._last = self._rows * step
        for place in self._gone:
            self._last[place] = 0
        self._rows, before = self._last.mid(), self._last
        bounds = (found + (before - self._rows) * self._boxes).tolist()
        self._started.append(self._starting(before))
        for own, terms, taken, f in zip(bounds, self._terms, self._taken, range(len(bounds)), strict=True):
            shared = arb(added[f]) + extra.get(f, 0)
            for c in taken:
                shared += own[c]
            for x, gathered in zip(own, terms, strict=False):
                gathered.append(units(x + shared))

    def _cut(self, i: int) -> dict[int, Ball]:
        """What is taken out of the rows at this lag, at its magnitude."""
        extra: dict[int, Ball] = {}
        for f, c in self._cut_at.get(i, ()):
            place = (f, self._slow + c)
            extra[f] = extra.get(f, arb(0)) + abs(self._rows[place]) * self._signals.slow[c]
            self._rows[place] = 0
            self._gone.append(place)
            self._taken[f][c] += self._loop.r
        return extra

    def _starting(self, rows: arb_mat) -> list[int]:
        """|q xi_0|."""
        found, radius = (rows * self._begun).entries(), self._problem.start.radius
        if radius > 0:
            near = [radius * long(row[: self._loop.n]) for row in rows.tolist()]
            return [units(x.abs_upper() + y) for x, y in zip(found, near, strict=True)]
        return [units(x) for x in found]

    def sums(self, lags: int) -> Sums:
        """What was gathered."""
        tails = sizes(self._last) * self._problem.boxes
        return Sums(
            problem=self._problem,
            lags=lags,
            first=self._first,
            started=[list(own) for own in zip(*self._started, strict=True)] or [[] for _ in self._first],
            gathered=[[list(accumulate(own, initial=0)) for own in terms] for terms in self._terms],
            tails=[[units(x) for x in row] for row in tails.tolist()],
        )
