"""Rows of a loop carried back from sample to sample, and what all signals together do through them.

A row r_i is the middle of the enclosed q_i = r_(i-1) AA: any numbers would do, for what they miss is added, |q_i - r_i|
times the box of the state ("free rows"). From a lag of its own on a slow signal is taken for any one ("cut").
A product of a row with balls around 0 is a sum of magnitudes. Implements: theory of the sampled loop, section 3.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, chain, pairwise

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import Ball, between, exact
from tubecert.recheck.clock import time_is_up, told
from tubecert.recheck.sampled_loop.exponential import (
    around_zero,
    column,
    diagonal,
    flow,
    identity,
    joined,
    parted,
    sizes,
    zeros,
)
from tubecert.recheck.sampled_loop.loop import Loop
from tubecert.recheck.sampled_loop.record import Stage
from tubecert.recheck.sampled_loop.remainders import Size, Slow

SETUP_BITS = 128  # of matrices: rows are carried in those of the context
_ROUNDED = 1 + 1e-12  # what floats lose in a length
_TELLS = 64  # lags
_MOST_TERMS = 8_000_000  # kept: outputs x phases x lags


@dataclass(frozen=True)
class Ground:
    """What is known at samples of one phase, from `start` on, while `stage` lasts.

    `acting`: the remainder through R = [I, B] (n + m); `rounding` of dy (n), of u (m), of zeta (z); the box of xi.
    """

    start: int
    stage: Stage
    acting: Sequence[Ball]
    rounding: Sequence[Ball]
    box: Sequence[Ball]


@dataclass(frozen=True)
class Amplitudes:
    """Of signals: balls around 0, one column per phase, then for every slow signal what its rate does, its magnitude.

    Of signals from one to another the Euclidean length is bounded, (1, columns), in place of each of them.
    """

    each: arb_mat
    lengths: Sequence[tuple[range, arb_mat]]

    def of(self, rows: arb_mat) -> arb_mat:
        """What they do through rows (p, signals), at most: balls around 0, (p, columns)."""
        found = rows * self.each
        for own, bound in self.lengths:
            longs = [_long([rows[f, c] for c in own]) for f in range(rows.nrows())]
            found += column(longs) * bound
        return found


@dataclass(frozen=True)
class Problem:
    """A loop with all that acts on it, phase by phase; rows up to sample `last`, over `lags` lags at most.

    `winds`: columns (n, k), and how large. e(0) is in `error` (n), a point or a box, within a `radius` beside that.
    """

    loop: Loop
    noise: Size
    winds: Sequence[tuple[arb_mat, Size]]
    slow: Sequence[Slow]
    error: Sequence[Ball]
    radius: Ball
    grounds: Sequence[Ground]
    lags: int
    last: int

    def phase(self, k: int) -> int:
        """The phase of a sample; before 0: the first."""
        return bisect_right(self.grounds, max(k, 0), key=lambda own: own.start) - 1

    @cached_property
    def boxes(self) -> arb_mat:
        """Those of xi, (width, phases)."""
        return arb_mat([list(own.box) for own in self.grounds]).transpose()

    @cached_property
    def arriving(self) -> Amplitudes:
        """Of rounding of dy (n), of u (m) and of zeta (z), and of noise (n)."""
        known = [own.rounding for own in self.grounds]
        return self._amplitudes(known, [self.noise], zeros(0, 2 * len(self.slow)))

    @cached_property
    def acting(self) -> Amplitudes:
        """Of the remainder (n + m), of winds, of the rates of slow signals (r) and of their magnitudes (r)."""
        slow = diagonal([*(own.rate for own in self.slow), *(own.size for own in self.slow)])
        return self._amplitudes([own.acting for own in self.grounds], [own for _, own in self.winds], slow)

    def _amplitudes(
        self, known: Sequence[Sequence[Ball]], sudden: Sequence[Size], slow: arb_mat
    ) -> Amplitudes:
        """Of signals that are known by phase, of those of a size, and of slow ones."""
        rows, lengths, phases = [list(row) for row in zip(*known, strict=True)], [], len(self.grounds)
        none = zeros(1, slow.ncols())
        for own in sudden:
            if own.length:
                signals, bound = range(len(rows), len(rows) + len(own.each)), arb_mat([own.each[:1] * phases])
                lengths.append((signals, around_zero(joined([[bound, none]]))))
            rows += [[arb(0) if own.length else x] * phases for x in own.each]
        every = [[arb_mat(rows), zeros(len(rows), slow.ncols())], [zeros(slow.nrows(), phases), slow]]
        return Amplitudes(around_zero(joined(every)), lengths)

    def gamma(self, age: Ball) -> arb_mat:
        """What `acting` does to xi in that time, (width, signals)."""
        n, _, _, _, r = self.loop.shape
        moved, steady = flow(self.loop.A, age)
        fast = moved * self._entries
        kept = [zeros(r, fast.ncols()), identity(r), zeros(r, r)]
        top = [fast, steady * self.loop.H, moved * self.loop.H]
        return joined(
            [[joined([top])], [zeros(self.loop.width - n - r, fast.ncols() + 2 * r)], [joined([kept])]]
        )

    def bent(self, ages: Ball, order: int) -> arb_mat:
        """sup |d^order gamma/ds^order| with all amplitudes over ages, order 1 or 2: balls around 0, (n, columns)."""
        slow = flow(self.loop.A, ages)[0]
        for _ in range(order - 1):
            slow = self.loop.A * slow
        fast = self.loop.A * slow
        return self.acting.of(joined([[fast * self._entries, slow * self.loop.H, fast * self.loop.H]]))

    @cached_property
    def _entries(self) -> arb_mat:
        """Through which columns the remainder and winds act."""
        return joined([[identity(self.loop.shape[0]), self.loop.B, *(own for own, _ in self.winds)]])


class Kernels:
    """int_0^T |r gamma(s)| ds with all amplitudes, by the trapezoid: |g| <= chord + (d^3/12 a panel) sup|g''|."""

    def __init__(self, problem: Problem, until: Ball, panels: int) -> None:
        self._acting, d = problem.acting, until / panels
        ages = [d * k for k in range(panels + 1)]
        self._nodes = [problem.gamma(age) * (d / 2 if k in (0, panels) else d) for k, age in enumerate(ages)]
        bends = [problem.bent(between(a.lower(), b.upper()), 2) for a, b in pairwise(ages)]
        own = sum(bends[1:], start=bends[0]) * (d * d * d / 12)
        self._rest = joined([[own], [zeros(problem.loop.width - own.nrows(), own.ncols())]])

    def of(self, rows: arb_mat) -> arb_mat:
        """Of rows (p, width): balls around 0, (p, columns)."""
        return sum((self._acting.of(rows * own) for own in self._nodes), start=rows * self._rest)


def carried(
    problem: Problem, outputs: arb_mat, cuts: Sequence[Sequence[int]], panels: int
) -> list[list[Ball]]:
    """b(k) of every output, its enclosed row at (xi_k, w_k), k = 0 .. last: without what acts within a sample.

    Raises `ArithmeticError` if these are too many, or the time is up.
    """
    lags = min(problem.lags, problem.last)
    if outputs.nrows() * len(problem.grounds) * lags > _MOST_TERMS:
        raise ArithmeticError("there are too many rows, phases and lags")
    found = _Pass(problem, outputs, cuts, panels)
    for i in range(lags):
        if i % _TELLS == 0:
            if time_is_up():
                raise ArithmeticError("the time was up")
            if (tell := told()) is not None:
                tell(i, i / lags)
        found.lag(i)
    return found.sums()


class _Pass:
    """The rows at one lag, and what they have gathered: q is enclosed, its middles are the rows."""

    def __init__(
        self, problem: Problem, outputs: arb_mat, cuts: Sequence[Sequence[int]], panels: int
    ) -> None:
        loop, phases = problem.loop, len(problem.grounds)
        *_, r = loop.shape
        with ctx.workprec(SETUP_BITS):
            self._kernels = Kernels(problem, exact(loop.sample), panels)
            self._step, heard = parted(loop.step, loop.width)
            self._arriving = loop.arriving(heard)
        self._problem, self._count = problem, outputs.nrows()
        self._slow = loop.width - r  # where eta begins
        still = [arb(0)] * (self._slow - len(problem.error))
        begun = [*problem.error, *still, *(arb(0, own.first.abs_upper()) for own in problem.slow)]
        self._begun = arb_mat(loop.width, 1, begun)
        self._boxes = joined([[problem.boxes, zeros(loop.width, 2 * r)]])
        self._cut_at: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for f, row in enumerate(cuts):
            for c, lag in enumerate(row):
                self._cut_at[lag].append((f, c))
        # columns of a bound that count for slow signals
        self._taken = [[phases + c for c in range(r)] for _ in range(self._count)]
        self._gone: list[tuple[int, int]] = []
        self._q, heard = parted(outputs, loop.width)
        self._rows = self._q.mid()
        now = (self._q - self._rows) * self._boxes + problem.arriving.of(loop.shaken(heard))
        self._now = [[x.abs_upper() for x in row[:phases]] for row in now.tolist()]
        self._started = [self._starting()]
        self._terms: list[list[list[Ball]]] = [[[] for _ in range(phases)] for _ in range(self._count)]

    def lag(self, i: int) -> None:
        """From r_i to r_(i+1)."""
        extra = self._cut(i)
        found = self._kernels.of(self._rows) + self._problem.arriving.of(self._rows * self._arriving)
        self._q = self._rows * self._step
        for place in self._gone:
            self._q[place] = 0
        self._rows = self._q.mid()
        found = found + (self._q - self._rows) * self._boxes
        self._started.append(self._starting())
        for f, (own, terms) in enumerate(zip(found.tolist(), self._terms, strict=True)):
            shared = sum((own[c] for c in self._taken[f]), start=extra.get(f, arb(0)))
            for x, gathered in zip(own, terms, strict=False):
                gathered.append((x + shared).abs_upper())

    def _cut(self, i: int) -> dict[int, Ball]:
        """What is taken out of the rows at this lag, at its magnitude."""
        extra: dict[int, Ball] = {}
        for f, c in self._cut_at.get(i, ()):
            place = (f, self._slow + c)
            extra[f] = extra.get(f, arb(0)) + abs(self._rows[place]) * self._problem.slow[c].size
            self._rows[place] = 0
            self._gone.append(place)
            self._taken[f][c] += len(self._problem.slow)
        return extra

    def _starting(self) -> list[Ball]:
        """|q xi_0|."""
        n, radius, near = len(self._problem.error), self._problem.radius, [arb(0)] * self._count
        if radius > 0:
            near = [radius * _long(row[:n]) for row in self._q.tolist()]
        known = (self._q * self._begun).entries()
        return [x.abs_upper() + y for x, y in zip(known, near, strict=True)]

    def sums(self) -> list[list[Ball]]:
        """b(k) of every output: what has been gathered, the tail |q_L| times the box, and what is added at once."""
        problem, lags, found = self._problem, len(self._started) - 1, []
        of, spans = [problem.phase(k) for k in range(problem.last + 1)], self._spans(lags)
        tails, started = (sizes(self._q) * problem.boxes).tolist(), zip(*self._started, strict=True)
        for now, terms, tail, begun in zip(self._now, self._terms, tails, started, strict=True):
            own = [list(accumulate(each, initial=arb(0))) for each in terms]
            late = (tail[p] for p in of[1 : len(of) - lags])
            gathered = (sum((own[j][b] - own[j][a] for j, a, b in parts), start=arb(0)) for parts in spans)
            every = zip(chain(begun, late), gathered, of, strict=True)
            found.append([x + y + now[p] for x, y, p in every])
        return found

    def _spans(self, lags: int) -> list[list[tuple[int, int, int]]]:
        """By sample: which lags, from one to another, are of samples of which phase."""
        begins, found = [own.start for own in self._problem.grounds], []
        for k in range(self._problem.last + 1):
            ends = enumerate(pairwise([*begins, max(k, begins[-1])]))
            parts = [(p, max(0, k - end), min(lags, k - begin)) for p, (begin, end) in ends]
            found.append([(p, low, high) for p, low, high in parts if low < high])
        return found


def _long(row: Sequence[Ball]) -> Ball:
    """At least the Euclidean length, in floats."""
    return arb(math.hypot(*[float(x.abs_upper()) for x in row]) * _ROUNDED + 1e-150)
