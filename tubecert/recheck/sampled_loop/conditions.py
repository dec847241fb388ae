"""The inequalities of the sampled loop at every sample: of the errors, of what the controller adds, of its memory.

b(k) bounds an output at sample k if the loop has kept to its boxes before; below what is claimed at every k there is no
first exit. Between two nodes of a sample e is near a chord, d^2/8 sup|c''|.
Implements: theory of the sampled loop, section 5.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import Ball, between, exact
from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import CONFIRMED
from tubecert.recheck.sampled_loop.exponential import flow, identity, joined, parted, sizes, zeros
from tubecert.recheck.sampled_loop.record import Recipe, Stage
from tubecert.recheck.sampled_loop.rows import SETUP_BITS, Kernels, Problem, carried


def phases_of(stages: Sequence[Stage], waiting: int) -> Iterator[tuple[int, Stage, tuple[Fraction, ...]]]:
    """From which sample on one stage lasts and commands of the same stages act or wait, with the most of these (m)."""
    starts = [own.start for own in stages]
    begins = sorted({0, *starts, *(k + waiting for k in starts[1:])})
    for begin, end in pairwise([*begins, begins[-1] + 1]):
        first, last = (bisect_right(starts, max(0, k)) for k in (begin - waiting, end - 1))
        most = zip(*(own.deviations for own in stages[first - 1 : last]), strict=True)
        yield begin, stages[bisect_right(starts, begin) - 1], tuple(map(max, most))


class Inequalities:
    """b(k) of every output against what is claimed: e_1 .. e_n at all times, then delta and zeta at every sample."""

    def __init__(self, problem: Problem, recipe: Recipe) -> None:
        self.problem, self._recipe = problem, recipe
        self.nodes, self._n = problem.loop.nodes(recipe.pieces), problem.loop.shape[0]

    def output(self, f: int) -> Outcome:
        """An output stays below what is claimed."""
        problem = self.problem
        most = [exact(own.stage.boxes[f]) for own in problem.grounds]
        for k in range(problem.last + 1):
            if not all(b < most[problem.phase(k)] for b in self.bounds(f, k)):
                return Outcome(
                    verdict="undecided", why=f"the bound at sample {k} is not below what is claimed"
                )
        return CONFIRMED

    def bounds(self, f: int, k: int) -> list[Ball]:
        """Of an output at sample k: of |e_i| on every piece of it."""
        n, last, p = self._n, len(self.nodes) - 1, self.problem.phase(k)
        if f >= n:
            return [self._carried[n * last + f][k]]
        ends = [self._carried[n * a + f][k] + self._within[a][f][p] for a in range(last + 1)]
        return [x.max(y) + off[f][p] for (x, y), off in zip(pairwise(ends), self._off, strict=True)]

    @cached_property
    def _carried(self) -> list[list[Ball]]:
        """Of e at every node, of delta and zeta."""
        loop, cuts, n = self.problem.loop, self._recipe.cuts, self._n
        with ctx.workprec(SETUP_BITS):
            rows = [[loop.error(exact(s), later=s >= loop.rest)] for s in self.nodes]
            outputs = joined([*rows, [loop.delta], [loop.memory]])
        return carried(self.problem, outputs, cuts[:n] * len(rows) + cuts[n:], self._recipe.panels)

    @cached_property
    def _within(self) -> list[list[list[Ball]]]:
        """What acts within the sample up to every node, by state and phase."""
        with ctx.workprec(SETUP_BITS):
            unit = joined([[identity(self._n), zeros(self._n, self.problem.loop.width - self._n)]])
            kernels = [Kernels(self.problem, exact(s), self._recipe.panels) for s in self.nodes]
            return [self._by_phase(own.of(unit)) for own in kernels]

    @cached_property
    def _off(self) -> list[list[list[Ball]]]:
        """How far e, and what acts within the sample, may be from their chords on every piece, by state and phase."""
        problem = self.problem
        with ctx.workprec(SETUP_BITS):
            boxes = problem.boxes.tolist()
            for own, x in zip(boxes, problem.error, strict=False):  # at k = 0 the start may lie outside
                own[0] = own[0].max(x.abs_upper() + problem.radius)
            return [self._piece(a, b, arb_mat(boxes)) for a, b in pairwise(self.nodes)]

    def _piece(self, a: Fraction, b: Fraction, boxes: arb_mat) -> list[list[Ball]]:
        problem, loop = self.problem, self.problem.loop
        half, middle = exact((b - a) / 2), exact((a + b) / 2)
        square = half * half / 2  # (b - a)^2/8
        moved = loop.A * flow(loop.A, between((-half).lower(), half.upper()))[0] * square
        of_xi, heard = parted(moved * loop.error_rate(middle, later=a >= loop.rest), loop.width)
        steady = joined([[boxes, zeros(loop.width, 2 * loop.shape[-1])]])
        swings = problem.bent(between(exact(a).lower(), exact(b).upper()), 1) * square
        return self._by_phase(sizes(of_xi) * steady + problem.arriving.of(loop.shaken(heard)) + swings)

    def _by_phase(self, found: arb_mat) -> list[list[Ball]]:
        """Of bounds those by phase, each with what slow signals do by their rates."""
        phases, r = len(self.problem.grounds), self.problem.loop.shape[-1]
        return [
            [(x + sum(row[phases : phases + r], start=arb(0))).abs_upper() for x in row[:phases]]
            for row in found.tolist()
        ]
