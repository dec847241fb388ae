"""Where the state may start: at a point, anywhere in a box, or anywhere within a radius of the plan's start.

Either answers with |x*(0) - x(0)|, with d0 (any upper bound of the Riemannian distance), and with a bound of
|h(0, x(0))|.
Implements: d0 and H0 of theory section 4. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Protocol

import numpy as np

from tubecert.bounds.searches import substituted
from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.branch_and_bound import supremum
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Array, Interval, fraction_bounds, sqrt
from tubecert.enclosure.linalg import congruence, eigenvalues_midrad, midrad, whitening
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.tape import Tape
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO, Expression, constant, free_symbols, root_above, symbol
from tubecert.expression.matrix import Matrix, column
from tubecert.model import TIME

_PIECES = 512


class InitialState(Protocol):
    """What the certificates need to know about x(0)."""

    def offset(self, suprema: Suprema) -> Interval:
        """|x*(0) - x(0)| in the coordinates of the tube, at most its upper end."""
        ...

    def distance(self, suprema: Suprema, metric: tuple[Constant, Constant]) -> Constant:
        """d0, given (a, A) over the tube."""
        ...

    def uncertainty(self, suprema: Suprema) -> Constant:
        """H0, a bound of |h(0, x(0))|."""
        return self.largest(suprema, [column(suprema.h)])

    def largest(self, suprema: Suprema, matrices: list[Matrix]) -> Constant:
        """The largest sum of norms of matrices at t = 0 and x(0)."""
        ...


@dataclass(frozen=True, slots=True)
class KnownStart(InitialState):
    """x(0) is the point `x0`, shape (n,)."""

    x0: tuple[Fraction, ...]

    def offset(self, suprema: Suprema) -> Interval:
        """|x*(0) - x(0)|, as in theory 2.11."""
        delta = self._delta(suprema.plan.start)
        if all(d is ZERO for d in delta):
            return Interval.exact(0.0)
        across = suprema.fields.vector(delta)
        found = supremum(SumOfNorms([across]), BoxDomain({}), suprema.effort)
        if np.isfinite(found.above):
            return Interval(found.below, found.above)
        # squares overflow: the sum of magnitudes is larger than the norm; 1e-13 > 900 u (Higham 2002, eq. 3.5)
        parts = Tape([row[0] for row in across], ()).run([], ())
        return Interval(0.0, np.nextafter(parts.magnitude.sum() * (1 + 1e-13), np.inf))

    def distance(self, suprema: Suprema, metric: tuple[Constant, Constant]) -> Constant:
        """The length of the straight segment from x*(0) to x0, (2.6).

        The segment is cut into pieces; on each, delta' M delta lies between its least and largest value.
        """
        start = suprema.plan.start
        delta = self._delta(start)
        if all(d is ZERO for d in delta):
            return Constant.exactly(0.0)
        s = symbol("s#")  # no state can have this name
        along = dict(
            zip(suprema.model.states, (a + s * d for a, d in zip(start, delta, strict=True)), strict=True)
        )
        edges = np.linspace(0.0, 1.0, _PIECES + 1)
        function = MatrixFunction([substituted(suprema.model.W, along), column(delta), ((s,),)])
        with np.errstate(all="ignore"):
            speed = _speed(function, edges[:-1, None], edges[1:, None])
        widths = np.diff(edges)  # exact: the edges are multiples of a power of 2
        # 512 products and their sum: at most 512 u of it, all terms being positive (Higham 2002, eq. 3.5); 900 u
        return Constant(
            below=float((speed.lo * widths).sum() * (1 - 1e-13)),
            above=float((speed.hi * widths).sum() * (1 + 1e-13)),
        )

    def largest(self, suprema: Suprema, matrices: list[Matrix]) -> Constant:
        """It at x0."""
        states = zip(suprema.model.states, map(constant, self.x0), strict=True)
        at_start = {TIME: ZERO, **dict(states)}
        start = SumOfNorms([substituted(rows, at_start) for rows in matrices])
        if start.is_zero:
            return Constant.exactly(0.0)
        found = supremum(start, BoxDomain(dict(suprema.model.parameters)), suprema.effort)
        return Constant(below=found.below, above=found.above)

    def _delta(self, start: Sequence[Expression]) -> list[Expression]:
        return [constant(q) - s for q, s in zip(self.x0, start, strict=True)]


@dataclass(frozen=True, slots=True)
class StartWithin(InitialState):
    """x(0) is any point with |x*(0) - x(0)| <= `radius`, in x whatever the coordinates of the tube."""

    radius: Fraction

    def offset(self, suprema: Suprema) -> Interval:
        """The radius; times |S| in z = S x, as in theory 2.11."""
        if suprema.coordinates is None:
            return Interval.of(self.radius)
        found = supremum(SumOfNorms([suprema.coordinates.S]), BoxDomain({}), suprema.effort)
        return Interval(found.below, found.above) * Interval.of(self.radius)

    def distance(self, suprema: Suprema, metric: tuple[Constant, Constant]) -> Constant:
        """sqrt(A) times the radius, A of M in x: the segment lies in the tube, or d0 is no smaller than dbar.

        Theory 1a.3.
        """
        if suprema.coordinates is not None:
            stretch = suprema.greatest_stretch()
            reach = Interval(stretch.below, stretch.above) * Interval.of(self.radius)
            return Constant(below=float(reach.lo), above=float(reach.hi))
        a, A = metric
        least = sqrt(Interval.exact(a.below)) * Interval.of(self.radius)
        most = sqrt(Interval.exact(A.above)) * Interval.of(self.radius)
        return Constant(below=float(least.lo), above=float(most.hi))

    def largest(self, suprema: Suprema, matrices: list[Matrix]) -> Constant:
        """It over the ball of starts."""
        radius = fraction_bounds(self.radius)[1]
        instant, still = (Fraction(0), Fraction(0)), suprema.plan.at_start
        ball = replace(suprema, plan=still, rho=radius, time=instant, coordinates=None, sides=None)
        return ball.norms("h_initial", matrices)


@dataclass(frozen=True, slots=True)
class StartBox(InitialState):
    """x(0) is any point of a box, `sides` (n pairs): what is convex in x(0) is largest at a corner."""

    sides: tuple[tuple[Fraction, Fraction], ...]

    def offset(self, suprema: Suprema) -> Interval:
        """|x*(0) - x(0)| at the corner where it is largest, as in theory 2.11."""
        found = [KnownStart(corner).offset(suprema) for corner in self._corners()]
        return Interval(max(float(x.lo) for x in found), max(float(x.hi) for x in found))

    def distance(self, suprema: Suprema, metric: tuple[Constant, Constant]) -> Constant:
        """Under a constant metric the length of the longest segment from x*(0) to a corner, (2.6).

        Else that of the segment to the centre, and from there sqrt(A) times the radius of the box.
        """
        if not free_symbols(e for row in suprema.model.W for e in row):
            found = [KnownStart(corner).distance(suprema, metric) for corner in self._corners()]
            return Constant(below=max(c.below for c in found), above=max(c.above for c in found))
        centre = tuple((low + high) / 2 for low, high in self.sides)
        first = KnownStart(centre).distance(suprema, metric)
        square = sum(((high - low) ** 2 / 4 for low, high in self.sides), start=Fraction(0))
        rest = StartWithin(root_above(square)).distance(suprema, metric)
        whole = Interval.exact(first.above) + Interval.exact(rest.above)
        return Constant(below=first.below, above=float(whole.hi))

    def largest(self, suprema: Suprema, matrices: list[Matrix]) -> Constant:
        """It over the box."""
        sides = dict(zip(suprema.model.states, self.sides, strict=True))
        known = {name: constant(low) for name, (low, high) in sides.items() if low == high}
        start = SumOfNorms([substituted(rows, {TIME: ZERO, **known}) for rows in matrices])
        if start.is_zero:
            return Constant.exactly(0.0)
        found = supremum(start, BoxDomain({**sides, **dict(suprema.model.parameters)}), suprema.effort)
        return Constant(below=max(found.below, 0.0), above=found.above)

    def _corners(self) -> Iterator[tuple[Fraction, ...]]:
        return product(*(dict.fromkeys(side) for side in self.sides))


def _speed(function: MatrixFunction, lo: Array, hi: Array) -> Interval:
    """sqrt(delta' M delta) over pieces of the segment: |T delta|^2 over the eigenvalues of T W T', T any matrix.

    (2.6).
    """
    w, delta, _ = function.at(lo, hi)
    mid, rad = midrad(w)
    t = whitening(mid)
    scaled = eigenvalues_midrad(*congruence(t, mid, rad))
    total = Interval.exact(np.zeros(len(lo)))
    for i in range(t.shape[-2]):
        entry = Interval.exact(np.zeros(len(lo)))
        for j in range(t.shape[-1]):
            entry = entry + delta[:, j, 0] * Interval.exact(t[:, i, j])
        total = total + entry**2
    square = total / Interval(scaled.lo[:, 0], scaled.hi[:, -1])
    # where the start is a rounding away from the plan's, squares reach 0 and are rounded below it
    return sqrt(Interval(np.maximum(square.lo, 0.0), square.hi)).sanitised()
