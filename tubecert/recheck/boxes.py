"""Terms over boxes: what a list of terms can be on a box, by expansions of second order.

On a box with centre c and radii r, d = x - c: G(x) = G(c) + sum d_i G_i(c) + 1/2 sum d_i d_j G_ij(c) + rest with
|rest| <= 1/6 sum r_i r_j r_k sup|G_ijk|, or 1/2 sum r_i r_j sup|G_ij - G_ij(c)| where third derivatives are too many.
The polynomial is examined at its vertices; where those are too many, s_i = d_i^2 is r_i^2/2 +- r_i^2/2.
Variables in which every entry is affine are replaced by their ends, exactly. A norm is smooth where it is not 0; on
a box on which it may be: mean value form, then natural extension. A table is smooth where a box meets no knot of it;
elsewhere its function has a Lipschitz gradient, so that it is expanded to second order, its derivative to first.

Polynomials of second order over a box, and vertices whose hull contains their values.

A polynomial in d_i/r_i with d = x - c is affine in every pair (d_i, s_i), s_i = d_i^2, and the pair lies in the hull of
(-r, r^2), (-r/2, 0), (r/2, 0), (r, r^2) (edges: tangents of the parabola, and its chord). Norms and largest eigenvalues
are convex, so products of these vertices are all there is to examine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations_with_replacement, product
from math import factorial, prod
from typing import Protocol, TypeAlias

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, between, column
from tubecert.recheck.lookup import smooth_on
from tubecert.recheck.monomials import Combinations
from tubecert.recheck.program import Program
from tubecert.recheck.terms import (
    Term,
    all_zero,
    function,
    in_order,
    looked_up,
    names,
    remade,
    slopes,
    table_of,
)

Vertices: TypeAlias = tuple[tuple[float, float], ...]  # pairs (d, s)

STRAIGHT: Vertices = ((-1.0, 0.0), (1.0, 0.0))
CURVED: Vertices = ((-1.0, 1.0), (-0.5, 0.0), (0.5, 0.0), (1.0, 1.0))


@dataclass(frozen=True, slots=True)
class Expansion:
    """Entries near the centre of a box as a polynomial in d_i/r_i; `rest` bounds what is left of each of them.

    `steps[i]` belongs to d_i/r_i, `squares[i]` to (d_i/r_i)^2, `mixed` to products of two different ones. Every
    coefficient is a matrix of one shape, by default a column; `rest` lists its entries row by row.
    """

    value: arb_mat
    steps: list[arb_mat]
    squares: dict[int, arb_mat]
    mixed: dict[tuple[int, int], arb_mat]
    rest: list[Ball]

    def mapped(self, linear: Callable[[arb_mat], arb_mat]) -> Expansion:
        """A linear map of the polynomial; the rest is left as it is."""
        return Expansion(
            linear(self.value),
            [linear(step) for step in self.steps],
            {i: linear(square) for i, square in self.squares.items()},
            {ij: linear(product) for ij, product in self.mixed.items()},
            self.rest,
        )

    def vertices(self) -> Iterator[list[Ball]]:
        """The entries of the polynomial, row by row, at points whose hull contains all its values."""
        parts = [self.value, *self.steps, *self.squares.values(), *self.mixed.values()]
        monomials = _at_vertices(len(self.steps), tuple(self.squares), tuple(self.mixed), CURVED)
        count = monomials.ncols()
        coefficients = [x for row in zip(*(part.entries() for part in parts), strict=True) for x in row]
        found = (arb_mat(len(coefficients) // len(parts), len(parts), coefficients) * monomials).entries()
        return (found[k::count] for k in range(count))

    def corners(self) -> Iterator[arb_mat]:
        """The same as matrices."""
        shape = self.value.nrows(), self.value.ncols()
        return (arb_mat(*shape, entries) for entries in self.vertices())

    def ranges(self) -> list[Ball]:
        """An enclosure of every entry."""
        value = self.value.entries()
        sizes = [e.entries() for e in (*self.steps, *self.mixed.values())]
        squares = [q.entries() for q in self.squares.values()]
        found = []
        for k, r in enumerate(self.rest):
            size = sum((e[k].abs_upper() for e in sizes), start=r)
            total = value[k] + between(-size, size)
            found.append(sum((between(0, q[k]) for q in squares), start=total))
        return found


@cache
def _at_vertices(
    count: int, squared: tuple[int, ...], mixed: tuple[tuple[int, int], ...], curved: Vertices
) -> arb_mat:
    """1, d_i, s_i and d_i d_j (rows) at products of vertices (columns): exact numbers."""
    choices = [curved if i in squared else STRAIGHT for i in range(count)]
    columns = [
        [1.0, *(d for d, _ in at), *(at[i][1] for i in squared), *(at[i][0] * at[j][0] for i, j in mixed)]
        for at in product(*choices)
    ]
    return arb_mat([list(row) for row in zip(*columns, strict=True)])


Box = Sequence[tuple[float, float]]
Values = Mapping[str, Ball]
Weighing = Callable[[Sequence[Ball]], Sequence[float]]
"""From the entries at the centre of a box to what one unit of each of them counts: it steers what is split."""

_CORNERS = 5  # variables whose corners are all tried
_VERTICES = 64  # of which curvature may take its share
_SIDES = 3  # tables of different arguments that are looked at on either side of a knot
_TURNING = 4  # curved variables with which third derivatives are looked at


@dataclass(frozen=True, slots=True)
class Found:
    """Whether a test is proven on a box, and by how much each variable widens the bound, and varies the value.

    Where that is not known, both are empty: then the widest side is split, against the whole domain.
    """

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


class Field:
    """Terms as functions on boxes; `values` are numbers for the names that are no variables."""

    def __init__(
        self, entries: Sequence[Term], values: Values | None = None, *, kinked: bool = False
    ) -> None:
        """`kinked`: for boxes on which a norm may be 0, where only slopes, or only values, are known."""
        self.values = dict(values or {})
        self._entries = list(entries)
        self.variables = tuple(sorted(names(entries) - self.values.keys()))
        inputs = (*self.variables, *self.values)
        kinks = [term for term in in_order(entries) if term.op in ("norm", "direction")]
        tables = [term for term in in_order(entries) if term.op == "table"]
        self._order = min([2, *map(_smoothness, (*kinks, *tables))]) if kinked else 2
        self._kinked = Field(entries, values, kinked=True) if (kinks or tables) and not kinked else None
        self._tables = [table_of(term) for term in tables]
        self._sides = [Program(own, inputs) for own in _one_sided(entries)] if not self._order else []
        self._looked_up = Program([term.args[0] for term in tables], inputs)
        self._sizes = Program([function("norm", *term.args) for term in kinks], inputs)
        first = {v: slopes(entries, v) for v in self.variables} if self._order else {}
        # of tables alone: how entries depend on other variables is not touched by their knots
        self._steady = self._order == 2 or (self._order == 1 and not kinks)
        pure = [v for v in self.variables if self._steady and all_zero([slopes(first[v], v)])]
        self._affine = [self.variables.index(v) for v in pure[:_CORNERS]]
        self._curved = [i for i in range(len(self.variables)) if i not in self._affine]
        curved = [self.variables[i] for i in self._curved]
        count = len(curved) if self._order == 2 else 0
        bent = {
            (a, b): slopes(first[curved[a]], curved[b])
            for a, b in combinations_with_replacement(range(count), 2)
        }
        self._pairs = [pair for pair, e in bent.items() if not all_zero([e])]
        second = [e for pair in self._pairs for e in bent[pair]]
        own = [e for v in curved for e in first.get(v, ())]
        self._program = Program(entries, inputs)
        self._centre = Combinations([*entries, *(own if self._order == 2 else ()), *second], inputs)
        self._triples: list[tuple[int, int, int]] = []
        if self._order == 2 and count <= _TURNING and not kinked:
            turning = {(a, b, c): slopes(e, curved[c]) for (a, b), e in bent.items() for c in range(b, count)}
            self._order, self._triples = 3, [key for key, e in turning.items() if not all_zero([e])]
            whole = [e for key in self._triples for e in turning[key]]
        else:
            whole = second if self._order == 2 else own
        self._whole = Combinations(whole, inputs)

    def with_values(self, values: Values) -> Field:
        """The same with other numbers for the same names."""
        other = Field.__new__(Field)
        other.__dict__.update(self.__dict__)
        other.values = {name: values[name] for name in self.values}
        other._kinked = None if self._kinked is None else self._kinked.with_values(values)
        return other

    def at(self, point: Sequence[Ball]) -> list[Ball]:
        """Values at a point, or over a box given as balls."""
        return self._program.run([*point, *self.values.values()])

    def hull(self, box: Box) -> list[Ball]:
        """Enclosures over a box."""
        whole = [between(lo, hi) for lo, hi in box]
        plain = self.at(whole)
        if self._kinked is not None and not self._is_smooth(whole):
            return self._kinked.hull(box)
        if not self._order:
            return plain
        found: list[Ball] | None = None
        for e in self.expand(box)[0]:
            part = e.ranges()
            found = part if found is None else [x.union(y) for x, y in zip(found, part, strict=True)]
        assert found is not None
        return [x.intersection(y) if x.overlaps(y) else x for x, y in zip(found, plain, strict=True)]

    def _is_smooth(self, whole: Sequence[Ball]) -> bool:
        """Whether no norm is 0 on a box, and no table is looked up at a knot."""
        values = [*whole, *self.values.values()]
        if any(not size > 0 for size in self._sizes.run(values)):
            return False
        return all(map(smooth_on, self._tables, self._looked_up.run(values)))

    def expand(
        self, box: Box, weighing: Weighing | None = None
    ) -> tuple[list[Expansion], list[float], list[float]]:
        """One expansion for every choice of ends of the affine variables; what each variable causes and varies.

        Both are sums over the entries, weighed by what these are at the centre (by default all alike).
        """
        d = len(self.variables)
        centre = [min(max(0.5 * lo + 0.5 * hi, lo), hi) for lo, hi in box]
        mid = [arb(c) for c in centre]
        whole = [between(lo, hi) for lo, hi in box]
        if self._kinked is not None and not self._is_smooth(whole):
            return self._kinked.expand(box, weighing)
        radius = [
            larger.upper()
            for (lo, hi), c in zip(box, mid, strict=True)
            for larger in [(arb(hi) - c).max(c - arb(lo))]
        ]
        caused, spread = [0.0] * d, [0.0] * d
        if not self._order:
            sides = [program.run([*whole, *self.values.values()]) for program in self._sides]
            values = sides or [self.at(whole)]
            return [Expansion(column(value), [], {}, {}, [arb(0)] * len(value)) for value in values], [], []
        points, ranges = [], []
        for ends in product((0, 1), repeat=len(self._affine)):
            point, range_ = list(mid), list(whole)
            for end, i in zip(ends, self._affine, strict=True):
                point[i] = range_[i] = arb(box[i][end])
            points.append([*point, *self.values.values()])
            ranges.append([*range_, *self.values.values()])
        at_centre = self._centre.run(points)
        count = len(self._entries)
        weights = [1.0] * count if weighing is None else weighing(at_centre[0][:count])
        around = zip(at_centre, self._whole.over(ranges), strict=True)
        found = [self._around(at, over, radius, weights, (caused, spread)) for at, over in around]
        for place, i in enumerate(self._affine):  # two corners that differ in that variable only
            other = found[1 << (len(self._affine) - 1 - place)]
            spread[i] = _weighed(weights, (found[0].value - other.value).entries())
        return found, caused, spread

    def _around(
        self,
        at: list[Ball],
        over: list[Ball],
        radius: list[Ball],
        weights: Sequence[float],
        steering: tuple[list[float], list[float]],
    ) -> Expansion:
        """Made of values, slopes and curvature at the centre, and of what varies over the box."""
        caused, spread = steering
        count, curved, second = len(self._entries), len(self._curved), self._order >= 2
        own, varied = _parts(at, count), _parts(over, count)
        value, rest = column(own[0]), [arb(0)] * count
        steps: list[arb_mat] = []
        for a, slope in enumerate(own[1 : 1 + curved] if second else varied):
            i = self._curved[a]
            step = [radius[i] * s for s in slope]
            size = _weighed(weights, map(arb.abs_upper, step))
            spread[i] = max(spread[i], size)
            if self._steady and a < _CORNERS:
                steps.append(column(step))
                if not second:  # the slope of a mean value form is a range
                    caused[i] += _weighed(weights, (s.rad() for s in step))
            else:
                rest = [r + s.abs_upper() for r, s in zip(rest, step, strict=True)]
                caused[i] += size
        squares: dict[int, arb_mat] = {}
        mixed: dict[tuple[int, int], arb_mat] = {}
        vertices = 2 ** (len(steps) + len(self._affine))
        for (a, b), bent in zip(self._pairs, own[1 + curved :], strict=True):
            weight = self._weight((a, b), radius)
            bends = [weight * x for x in bent]
            bend, near = [q.abs_upper() for q in bends], column(bends)
            share: float = 1  # of what bends at the centre: it goes into the rest
            if a == b and a < len(steps) and 2 * vertices <= _VERTICES:
                squares[a], share = near, 0
                vertices *= 2
            elif a == b:  # between 0 and all of it
                value, share = value + near * 0.5, 0.5
            elif b < len(steps):
                mixed[a, b], share = near, 0
            rest = [r + share * q for r, q in zip(rest, bend, strict=True)]
            loss = share or 0.25 * (a == b)  # the hull of a parabola is that much larger
            self._blame((a, b), loss * _weighed(weights, bend), caused)
        for key, far in self._variation(own[1 + curved :], varied, radius):
            rest = [r + x for r, x in zip(rest, far, strict=True)]
            self._blame(key, _weighed(weights, far), caused)
        return Expansion(value, steps, squares, mixed, [r.upper() for r in rest])

    def _variation(
        self, bent: list[list[Ball]], varied: list[list[Ball]], radius: list[Ball]
    ) -> Iterator[tuple[tuple[int, ...], list[Ball]]]:
        """What the polynomial of second order leaves, for every choice of curved variables that takes part."""
        if self._order == 3:
            for triple, turning in zip(self._triples, varied, strict=True):
                weight = self._weight(triple, radius)
                yield triple, [(weight * x).abs_upper() for x in turning]
        elif self._order == 2:
            for pair, near, far in zip(self._pairs, bent, varied, strict=True):
                weight = self._weight(pair, radius)
                yield pair, [(weight * (y - x)).abs_upper() for x, y in zip(near, far, strict=True)]

    def _weight(self, key: tuple[int, ...], radius: list[Ball]) -> Ball:
        """Radii over factorials, as in Taylor's formula, for curved variables in ascending order."""
        weight = arb(1)
        for a in key:
            weight = weight * radius[self._curved[a]]
        return weight / prod(factorial(key.count(a)) for a in set(key))

    def _blame(self, key: tuple[int, ...], size: float, caused: list[float]) -> None:
        for a in set(key):
            caused[self._curved[a]] += size


def _smoothness(term: Term) -> int:
    """The order to which a kink, or a table at a knot, may be expanded."""
    return max(0, 2 - table_of(term).order) if term.op == "table" else int(term.op == "norm")


def _one_sided(entries: Sequence[Term]) -> list[list[Term]]:
    """The entries on either side of the knots of their tables, for every choice of sides; none if these are too many.

    What jumps at a knot is on a box what it is on one side of it, at points on that side, or what it is on the other.
    """
    read = dict.fromkeys(
        (term.args[0], table_of(term).points) for term in in_order(entries) if term.op == "table"
    )
    if not 0 < len(read) <= _SIDES:
        return []
    return [
        _sided(entries, dict(zip(read, signs, strict=True))) for signs in product((-1, 1), repeat=len(read))
    ]


def _sided(entries: Sequence[Term], sides: Mapping[tuple[Term, object], int]) -> list[Term]:
    new: dict[Term, Term] = {}
    for term in in_order(entries):
        args = tuple(new[arg] for arg in term.args)
        if term.op == "table":
            table = table_of(term)
            new[term] = looked_up(replace(table, side=sides[term.args[0], table.points]), *args)
        else:
            new[term] = remade(term, args) if args else term
    return [new[e] for e in entries]


def _weighed(weights: Sequence[float], entries: Iterable[Ball]) -> float:
    """The sum of magnitudes, in floats."""
    return sum(weight * abs(float(x.mid())) for weight, x in zip(weights, entries, strict=True))


def _parts(entries: list[Ball], count: int) -> list[list[Ball]]:
    return [entries[k : k + count] for k in range(0, len(entries), count)]
