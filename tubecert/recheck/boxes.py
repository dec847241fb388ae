"""Terms over boxes: what a list of terms can be on a box, by expansions of second order.

On a box with centre c and radii r, d = x - c: G(x) = G(c) + sum d_i G_i(c) + 1/2 sum d_i d_j G_ij(c) + rest with
|rest| <= 1/2 sum r_i r_j sup|G_ij - G_ij(c)|. With s_i = d_i^2 that is affine in every pair (d_i, s_i), and the pair
lies in the hull of (-r, r^2), (-r/2, 0), (r/2, 0), (r, r^2) (edges: tangents of the parabola, and its chord). Norms and
largest eigenvalues are convex, so products of these vertices are all there is to examine. Where they are too many,
s_i = r_i^2/2 +- r_i^2/2. Variables in which every entry is affine are replaced by their ends, exactly. Terms with
kinks: mean value form, then natural extension.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Protocol

from flint import arb

from tubecert.recheck.balls import Ball, between, magnitude
from tubecert.recheck.program import Program
from tubecert.recheck.terms import NOUGHT, Term, in_order, names, slopes

Box = Sequence[tuple[float, float]]
Values = Mapping[str, Ball]

_CORNERS = 5  # variables whose corners are all tried
_VERTICES = 64  # of which curvature may take its share
_STRAIGHT = ((-1.0, 0.0), (1.0, 0.0))
_CURVED = ((-1.0, 1.0), (-0.5, 0.0), (0.5, 0.0), (1.0, 1.0))


@dataclass(frozen=True, slots=True)
class Found:
    """Whether a test is proven on a box, and by how much each variable widens the bound, and varies the value."""

    proven: bool
    caused: list[float] = field(default_factory=list)
    spread: list[float] = field(default_factory=list)


class Test(Protocol):
    """A statement about points of `variables`."""

    variables: tuple[str, ...]

    def over(self, box: Box) -> Found:
        """Whether it is proven on a whole box."""
        ...

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether it is proven false at a point."""
        ...


@dataclass(frozen=True, slots=True)
class Expansion:
    """Entries near the centre of a box, row by row, as a polynomial in d_i/r_i; `rest` bounds what is left.

    `steps[i]` belongs to d_i/r_i, `squares[i]` to (d_i/r_i)^2, `mixed` to products of two different ones.
    """

    value: list[Ball]
    steps: list[list[Ball]]
    squares: dict[int, list[Ball]]
    mixed: dict[tuple[int, int], list[Ball]]
    rest: list[Ball]

    def corners(self) -> Iterator[list[Ball]]:
        """The polynomial at vertices whose hull contains all its values."""
        yield from self._corners(0, self.value, self.steps)

    def _corners(self, i: int, value: list[Ball], steps: list[list[Ball]]) -> Iterator[list[Ball]]:
        """Variable i at each of its vertices; its products with later ones become a part of their steps."""
        if i == len(steps):
            yield value
            return
        for d, s in _CURVED if i in self.squares else _STRAIGHT:
            corner = _added(value, d, steps[i])
            if s:
                corner = _added(corner, s, self.squares[i])
            later = [
                _added(step, d, self.mixed[i, j]) if (i, j) in self.mixed else step
                for j, step in enumerate(steps)
            ]
            yield from self._corners(i + 1, corner, later)

    def ranges(self) -> list[Ball]:
        """An enclosure of every entry."""
        found = []
        for k, (value, r) in enumerate(zip(self.value, self.rest, strict=True)):
            size = sum((magnitude(e[k]) for e in (*self.steps, *self.mixed.values())), start=r)
            total = value + between(-size, size)
            found.append(sum((between(0, q[k]) for q in self.squares.values()), start=total))
        return found


def _added(corner: list[Ball], factor: float, step: list[Ball]) -> list[Ball]:
    if factor == 1:
        return [x + s for x, s in zip(corner, step, strict=True)]
    if factor == -1:
        return [x - s for x, s in zip(corner, step, strict=True)]
    return [x + factor * s for x, s in zip(corner, step, strict=True)]


class Field:
    """Terms as functions on boxes; `values` are numbers for the names that are no variables."""

    def __init__(self, entries: Sequence[Term], values: Values | None = None) -> None:
        self.values = dict(values or {})
        self._entries = list(entries)
        self.variables = tuple(sorted(names(entries) - self.values.keys()))
        inputs = (*self.variables, *self.values)
        ops = {term.op for term in in_order(entries)}
        self._order = 0 if "direction" in ops else 1 if "norm" in ops else 2
        first = {v: slopes(entries, v) for v in self.variables} if self._order else {}
        pure = [
            v for v in self.variables if self._order == 2 and all(e is NOUGHT for e in slopes(first[v], v))
        ]
        self._affine = [self.variables.index(v) for v in pure[:_CORNERS]]
        self._curved = [i for i in range(len(self.variables)) if i not in self._affine]
        curved = [self.variables[i] for i in self._curved]
        self._program = Program(entries, inputs)
        self._slopes = Program([e for v in curved for e in first.get(v, ())], inputs)
        self._pairs: list[tuple[int, int, int]] = []  # place among the outputs, two variables
        second: list[Term] = []
        if self._order == 2:
            for a, v in enumerate(curved):
                for b, w in enumerate(curved[a:], start=a):
                    bent = slopes(first[v], w)
                    if any(e is not NOUGHT for e in bent):
                        self._pairs.append((len(second), a, b))
                        second += bent
        self._curvature = Program(second, inputs)

    def with_values(self, values: Values) -> Field:
        """The same with other numbers for the same names."""
        other = Field.__new__(Field)
        other.__dict__.update(self.__dict__)
        other.values = {name: values[name] for name in self.values}
        return other

    def at(self, point: Sequence[Ball]) -> list[Ball]:
        """Values at a point, or over a box given as balls."""
        return self._program.run([*point, *self.values.values()])

    def hull(self, box: Box) -> list[Ball]:
        """Enclosures over a box."""
        whole = [between(lo, hi) for lo, hi in box]
        plain = self.at(whole)
        if not self._order:
            return plain
        found: list[Ball] | None = None
        for e in self.expand(box)[0]:
            part = e.ranges()
            found = part if found is None else [x.union(y) for x, y in zip(found, part, strict=True)]
        assert found is not None
        return [x.intersection(y) if x.overlaps(y) else x for x, y in zip(found, plain, strict=True)]

    def expand(self, box: Box) -> tuple[list[Expansion], list[float], list[float]]:
        """One expansion for every choice of ends of the affine variables; what each variable causes and varies."""
        d = len(self.variables)
        centre = [min(max(0.5 * lo + 0.5 * hi, lo), hi) for lo, hi in box]
        mid = [arb(c) for c in centre]
        whole = [between(lo, hi) for lo, hi in box]
        radius = [
            larger.upper()
            for (lo, hi), c in zip(box, mid, strict=True)
            for larger in [(arb(hi) - c).max(c - arb(lo))]
        ]
        caused, spread = [0.0] * d, [0.0] * d
        if not self._order:
            wide = [hi - lo for lo, hi in box]
            value = self.at(whole)
            return [Expansion(value, [], {}, {}, [arb(0)] * len(value))], wide, wide
        found = []
        for ends in product((0, 1), repeat=len(self._affine)):
            point, range_ = list(mid), list(whole)
            for end, i in zip(ends, self._affine, strict=True):
                point[i] = range_[i] = arb(box[i][end])
            found.append(self._around(point, range_, radius, caused, spread))
        for place, i in enumerate(self._affine):  # two corners that differ in that variable only
            other = found[1 << (len(self._affine) - 1 - place)]
            spread[i] = sum(
                abs(float((x - y).mid())) for x, y in zip(found[0].value, other.value, strict=True)
            )
        return found, caused, spread

    def _around(
        self, point: list[Ball], box: list[Ball], radius: list[Ball], caused: list[float], spread: list[float]
    ) -> Expansion:
        more = list(self.values.values())
        value = self._program.run([*point, *more])
        count = len(value)
        slope = self._slopes.run([*(point if self._order == 2 else box), *more])
        rest = [arb(0)] * count
        steps: list[list[Ball]] = []
        for a, i in enumerate(self._curved):
            step = [radius[i] * s for s in slope[a * count : (a + 1) * count]]
            size = sum(float(magnitude(s)) for s in step)
            spread[i] = max(spread[i], size)
            if self._order == 2 and a < _CORNERS:
                steps.append(step)
            else:
                rest = [r + magnitude(s) for r, s in zip(rest, step, strict=True)]
                caused[i] += size
        squares: dict[int, list[Ball]] = {}
        mixed: dict[tuple[int, int], list[Ball]] = {}
        bends = self._bends(point, box, radius) if self._pairs else ()
        vertices = 2 ** (len(steps) + len(self._affine))
        for a, b, near, far in bends:
            bend = [magnitude(q) for q in near]
            share: float = 1  # of what bends at the centre: it goes into the rest
            if a == b and a < len(steps) and 2 * vertices <= _VERTICES:
                squares[a], share = near, 0
                vertices *= 2
            elif a == b:  # between 0 and all of it
                value, share = [x + q / 2 for x, q in zip(value, near, strict=True)], 0.5
            elif b < len(steps):
                mixed[a, b], share = near, 0
            rest = [r + f + share * q for r, f, q in zip(rest, far, bend, strict=True)]
            loss = share or 0.25 * (a == b)  # the hull of a parabola is that much larger
            wide = sum(float(f) + loss * float(q) for f, q in zip(far, bend, strict=True))
            for i in {a, b}:
                caused[self._curved[i]] += wide
        return Expansion(value, steps, squares, mixed, [r.upper() for r in rest])

    def _bends(
        self, point: list[Ball], box: list[Ball], radius: list[Ball]
    ) -> Iterator[tuple[int, int, list[Ball], list[Ball]]]:
        """For every two curved variables: r_i r_j G_ij at the centre (half of it if i = j), and how it varies."""
        more = list(self.values.values())
        centre, whole = self._curvature.run([*point, *more]), self._curvature.run([*box, *more])
        count = len(self._program)
        for start, a, b in self._pairs:
            weight = radius[self._curved[a]] * radius[self._curved[b]] * (0.5 if a == b else 1)
            near, far = centre[start : start + count], whole[start : start + count]
            yield (
                a,
                b,
                [weight * x for x in near],
                [magnitude(weight * (y - x)) for x, y in zip(near, far, strict=True)],
            )
