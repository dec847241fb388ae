"""The inequalities of the sampled loop at every sample: of the errors, of what the controller adds, of its memory.

b(k) bounds an output at sample k if the loop has kept to its boxes before; below what is claimed at every k there is no
first exit. Between two nodes of a sample e is near a chord, d^2/8 sup|c''|. Implements: theory of the sampled loop,
section 5.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain, pairwise

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import Ball, between, exact
from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import CONFIRMED
from tubecert.recheck.sampled_loop.exponential import flow, identity, joined, sizes, zeros
from tubecert.recheck.sampled_loop.loop import Loop
from tubecert.recheck.sampled_loop.record import Recipe, Stage
from tubecert.recheck.sampled_loop.rows import SETUP_BITS, Kernels, Problem, limit, long, summed, units

_FLUSHED = Fraction(1, 10**35)  # what a computer loses that has no subnormal numbers
_PLAN = Fraction(1, 2**24)  # what it misses x* and u* by, of their largest size
_SECOND = 1 + Fraction(1, 2**20)  # rounding of what is a rounding already
_FEW = 4  # panels that are tried before those of the recipe

Added = tuple[tuple[int, int, int], ...]
"""Ways to bound what is between two ends: what is added to either, and to the larger of both."""


@dataclass(frozen=True)
class Rounding:
    """The unit of the controller's arithmetic, and sup |x*_i| (n), sup |u*_j| + |u*_j - ubar_j| (m)."""

    unit: Fraction
    states_above: Sequence[Ball]
    inputs_above: Sequence[Ball]

    def of(
        self, loop: Loop, noise: Sequence[Ball], W: Sequence[Ball], Z: Sequence[Ball]
    ) -> tuple[list[Ball], list[Ball], list[Ball]]:
        """What dy (n), u (m) and zeta (z) are off by."""
        u, k = self.unit, loop.z + loop.n + 3
        gamma, lost = exact(k * u / (1 - k * u)), exact(_FLUSHED)
        measured = [
            (exact(_PLAN) * x + exact(2 * u) * (2 * x + w + s)) * exact(_SECOND) + lost
            for x, w, s in zip(self.states_above, W, noise, strict=True)
        ]
        seen = [w + s + y for w, s, y in zip(W, noise, measured, strict=True)]
        told, kept = (
            (sizes(of_memory) * _column(Z) + sizes(of_measured) * _column(seen)).entries()
            for of_memory, of_measured in ((loop.M, loop.N), (loop.F, loop.G))
        )
        commanded = [gamma * (a + x) + lost for a, x in zip(self.inputs_above, told, strict=True)]
        return measured, commanded, [gamma * x + lost for x in kept]


def phases_of(stages: Sequence[Stage], waiting: int) -> Iterator[tuple[int, Stage, tuple[Fraction, ...]]]:
    """From which sample on one stage lasts and commands of the same stages act or wait, with the most of these (m)."""
    starts = [own.start for own in stages]
    begins = sorted({0, *starts, *(k + waiting for k in starts[1:])})
    for begin, end in pairwise([*begins, begins[-1] + 1]):
        first, last = (bisect_right(starts, max(0, k)) for k in (begin - waiting, end - 1))
        most = zip(*(own.deviations for own in stages[first - 1 : last]), strict=True)
        yield begin, stages[bisect_right(starts, begin) - 1], tuple(map(max, most))


class _Outputs:
    """Outputs c xi_k + what noise and the rounding of u add at once: b(k) of each, in units."""

    def __init__(self, problem: Problem, first: arb_mat, noise: arb_mat, rounding: arb_mat) -> None:
        self._problem, self._first = problem, first
        self._heard = _in_units(measured(problem, noise, rounding))
        self._missed = _in_units(_rows(sizes(first - first.mid()) * problem.boxes))

    def carried(self, cuts: Sequence[Sequence[int]], panels: int) -> list[list[int]]:
        """All b(k), k = 0 .. last."""
        problem = self._problem
        sums = summed(problem, self._first, cuts, panels)
        phases = [problem.phase(k) for k in range(problem.last + 1)]
        return [
            [
                x + self._heard[f][p] + (self._missed[f][p] if k else 0)
                for k, (x, p) in enumerate(zip(sums.of(f), phases, strict=True))
            ]
            for f in range(self._first.nrows())
        ]


def measured(problem: Problem, noise: arb_mat, rounding: arb_mat) -> list[list[Ball]]:
    """What noise, and rounding of dy and u do through columns, row by row and phase by phase."""
    signals, found = problem.signals, []
    for row, a, b in zip(_rows(noise), _rows(sizes(noise)), _rows(sizes(rounding)), strict=True):
        own = long(row) * signals.noise[0] if signals.noise_length else _dot(a, signals.noise)
        found.append([own + _dot(a, x.measured) + _dot(b, x.commanded) for x in problem.grounds])
    return found


class _Errors:
    """e of some states on all of a sample, in pieces."""

    def __init__(self, problem: Problem, recipe: Recipe, panels: int, states: Sequence[int]) -> None:
        self._problem, self._panels, self._states = problem, panels, states
        self._nodes = problem.loop.nodes(recipe.pieces)
        self._cuts = [recipe.cuts[i] for i in states] * len(self._nodes)

    @cached_property
    def _carried(self) -> list[list[int]]:
        """Of e at every node."""
        loop, own = self._problem.loop, _picked(self._states, self._problem.loop.n)
        with ctx.workprec(SETUP_BITS):
            at = [(exact(s), s >= loop.rest) for s in self._nodes]
            rows = joined([[own * loop.error(*node)] for node in at])
            heard = joined([[own * loop.heard(*node)] for node in at])
            outputs = _Outputs(self._problem, rows, heard * loop.N, heard)
        return outputs.carried(self._cuts, self._panels)

    @cached_property
    def _within(self) -> list[tuple[list[list[Ball]], Kernels]]:
        """What acts within the sample up to every node, by state and phase."""
        loop, found = self._problem.loop, []
        with ctx.workprec(SETUP_BITS):
            unit = joined([[identity(loop.n), zeros(loop.n, loop.width - loop.n)]])
            for s in self._nodes:
                kernels = Kernels(self._problem, exact(s), self._panels, step=False)
                bounds, lengths = kernels.of(unit)
                rows = [[x.abs_upper() for x in row] for row in bounds.tolist()]
                found.append((self._by_state(rows, lengths), kernels))
        return found

    def _by_state(self, bounds: list[list[Ball]], more: Sequence[float]) -> list[list[Ball]]:
        """Of rows of bounds those of the states, by phase: what phases have, and what rates of slow signals do."""
        count, r = len(self._problem.grounds), self._problem.loop.r
        return [
            [x + sum(bounds[i][count : count + r], start=arb(more[i])) for x in bounds[i][:count]]
            for i in self._states
        ]

    @cached_property
    def _added(self) -> list[list[list[Added]]]:
        """By piece, state and phase: what acts within the sample, and how far e is from the chord.

        What acts is near a chord as well, d^2/8 sup of its second derivative; or it grows, and is all there at the end.
        """
        problem = self._problem
        with ctx.workprec(SETUP_BITS):
            boxes = problem.boxes.tolist()
            for own, x in zip(boxes, problem.start.error, strict=False):  # at k = 0 the start may lie outside
                own[0] = own[0].max(x.abs_upper() + problem.start.radius)
            return [self._piece(place, arb_mat(boxes)) for place in range(len(self._nodes) - 1)]

    def _piece(self, place: int, boxes: arb_mat) -> list[list[Added]]:
        problem, loop = self._problem, self._problem.loop
        (a, b), ((begun, _), (done, kernels)) = (
            self._nodes[place : place + 2],
            self._within[place : place + 2],
        )
        half, middle, later = exact((b - a) / 2), exact((a + b) / 2), a >= loop.rest
        turned = loop.A * flow(loop.A, between((-half).lower(), half.upper()))[0] * (half * half / 2)
        bent = _rows(sizes(turned * loop.error_rate(middle, later)) * boxes)
        heard = turned * loop.heard_rate(middle, later)
        noisy = measured(problem, heard * loop.N, heard)
        varied = kernels.bent(between(exact(a).lower(), exact(b).upper()), 1) * (half * half / 2)
        swings = self._by_state(varied.tolist(), [0.0] * loop.n)
        found: list[list[Added]] = []
        for i, first, last, swing in zip(self._states, begun, done, swings, strict=True):
            off = [x + y for x, y in zip(bent[i], noisy[i], strict=True)]
            chord = [
                (units(x), units(y), units(z + w)) for x, y, z, w in zip(first, last, swing, off, strict=True)
            ]
            plain = [(0, 0, units(y + w)) for y, w in zip(last, off, strict=True)]
            found.append([*zip(chord, plain, strict=True)])
        return found

    def bounds(self, i: int, k: int) -> Iterator[int]:
        """Of |e_i| on every piece of sample k."""
        place, p = self._states.index(i), self._problem.phase(k)
        at = [self._carried[a * len(self._states) + place][k] for a in range(len(self._nodes))]
        for ends, added in zip(pairwise(at), self._added, strict=True):
            yield min(max(ends[0] + x, ends[1] + y) + z for x, y, z in added[place][p])

    def short(self, i: int) -> int | None:
        """The first sample in which |e_i| is not proven to be below what is claimed."""
        problem = self._problem
        most = [limit(own.stage.half_widths[i]) for own in problem.grounds]
        samples = range(problem.last + 1)
        return next((k for k in samples if not max(self.bounds(i, k)) < most[problem.phase(k)]), None)


class Inequalities:
    """b(k) of every output against what is claimed; with few panels first, then with those of the recipe."""

    def __init__(self, problem: Problem, recipe: Recipe) -> None:
        self.problem, self._recipe = problem, recipe
        self._panels = sorted({min(_FEW, recipe.panels), recipe.panels})
        self._first = _Errors(problem, recipe, self._panels[0], range(problem.loop.n))
        self._kept: dict[int, list[list[int]]] = {}

    def errors(self, i: int) -> Outcome:
        """|e_i| < W_i at all times."""
        finer = (_Errors(self.problem, self._recipe, panels, [i]) for panels in self._panels[1:])
        return _outcome(own.short(i) for own in chain([self._first], finer))

    def deviation(self, j: int) -> Outcome:
        """|delta_j| <= U_j at every sample."""
        return _outcome(
            self._over(panels, j, [own.stage.deviations[j] for own in self.problem.grounds])
            for panels in self._panels
        )

    def memory(self, j: int) -> Outcome:
        """|zeta_j| in its box at every sample after the first."""
        f = self.problem.loop.m + j
        return _outcome(
            self._over(panels, f, [own.stage.memory[j] for own in self.problem.grounds])
            for panels in self._panels
        )

    def _over(self, panels: int, f: int, boxes: Sequence[Fraction]) -> int | None:
        """The first sample at which an output leaves its box; where zeta begins is no matter."""
        problem = self.problem
        if panels not in self._kept:
            self._kept[panels] = self._outputs.carried(self._recipe.cuts[problem.loop.n :], panels)
        most = [limit(own) for own in boxes]
        for k, b in enumerate(self._kept[panels][f]):
            if (k or f < problem.loop.m) and not b <= most[problem.phase(k)]:
                return k
        return None

    @cached_property
    def _outputs(self) -> _Outputs:
        """delta and zeta."""
        loop = self.problem.loop
        noise = joined([[loop.N], [zeros(loop.z, loop.n)]])
        rounding = joined([[identity(loop.m)], [zeros(loop.z, loop.m)]])
        return _Outputs(self.problem, joined([[loop.delta], [loop.memory]]), noise, rounding)


def _picked(places: Sequence[int], n: int) -> arb_mat:
    """The rows of the unit matrix at some places."""
    return arb_mat(len(places), n, [arb(int(i == j)) for i in places for j in range(n)])


def _outcome(levels: Iterator[int | None]) -> Outcome:
    k: int | None = None
    for k in levels:
        if k is None:
            return CONFIRMED
    return Outcome(verdict="undecided", why=f"the bound at sample {k} is not below what is claimed")


def _in_units(rows: Sequence[Sequence[Ball]]) -> list[list[int]]:
    return [[units(x) for x in row] for row in rows]


def _rows(a: arb_mat) -> list[list[Ball]]:
    return a.tolist() if a.ncols() else [[] for _ in range(a.nrows())]


def _column(x: Sequence[Ball]) -> arb_mat:
    return arb_mat(len(x), 1, list(x))


def _dot(a: Sequence[Ball], b: Sequence[Ball]) -> Ball:
    return sum((x * y for x, y in zip(a, b, strict=True)), start=arb(0))
