"""Bounds over boxes: what a matrix of terms can be on a box, and tests that hold on all of it or not.

On a box with centre c and radii r: G(x) = G(c) + sum_i (x_i - c_i) G_i(c) + rest, |rest| <= 1/2 sum r_i r_j sup|G_ij|.
Norms and largest eigenvalues are convex, so the affine part is examined at its corners only; variables in which
every entry is affine are replaced by their ends, exactly. Terms with kinks: mean value form, then natural extension.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import Protocol

from flint import arb, arb_mat

from tubecert.recheck.balls import (
    Ball,
    Balls,
    between,
    exact,
    is_indefinite,
    is_positive,
    magnitude,
    spectral_norm,
    whitening,
)
from tubecert.recheck.terms import NOUGHT, Program, Rows, Term, in_order, names, slopes

Box = Sequence[tuple[float, float]]
Values = Mapping[str, Ball]

_CORNERS = 5  # variables whose corners are all tried


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
    """Entries near the centre of a box, row by row: value, steps to the corners, bounds of the rest."""

    value: list[Ball]
    steps: list[list[Ball]]
    rest: list[Ball]

    def corners(self) -> Iterator[list[Ball]]:
        """The affine part at every corner."""
        for signs in product((-1, 1), repeat=len(self.steps)):
            corner = self.value
            for sign, step in zip(signs, self.steps, strict=True):
                corner = [x + s if sign > 0 else x - s for x, s in zip(corner, step, strict=True)]
            yield corner


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
            part = [
                x + sum((between(-magnitude(s[k]), magnitude(s[k])) for s in e.steps), start=between(-r, r))
                for k, (x, r) in enumerate(zip(e.value, e.rest, strict=True))
            ]
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
            return [Expansion(value, [], [arb(0)] * len(value))], wide, wide
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
        if self._pairs:
            bent = self._curvature.run([*box, *more])
            for start, a, b in self._pairs:
                i, j = self._curved[a], self._curved[b]
                weight = radius[i] * radius[j] * (0.5 if i == j else 1)
                part = [weight * magnitude(x) for x in bent[start : start + count]]
                rest = [r + p for r, p in zip(rest, part, strict=True)]
                size = sum(float(p.upper()) for p in part)
                caused[i] += size
                if i != j:
                    caused[j] += size
        return Expansion(value, steps, [r.upper() for r in rest])


class NormsBelow:
    """sum_k |G_k(x)| <= limit, spectral norms (of a column: the Euclidean norm)."""

    def __init__(self, matrices: Sequence[Rows], limit: Fraction, values: Values | None = None) -> None:
        self._shapes = [(len(g), len(g[0])) for g in matrices]
        self._field = Field([e for g in matrices for row in g for e in row], values)
        self.variables = self._field.variables
        self._limit = exact(limit)

    def with_values(self, values: Values) -> NormsBelow:
        """The same with other numbers for the same names."""
        other = NormsBelow.__new__(NormsBelow)
        other.__dict__.update(self.__dict__)
        other._field = self._field.with_values(values)
        return other

    def over(self, box: Box) -> Found:
        """The norms of the affine part at its corners, and of the rest."""
        found, caused, spread = self._field.expand(box)
        proven = all(
            self._norms(corner) + rest <= self._limit
            for e in found
            for rest in [self._norms(e.rest)]
            for corner in e.corners()
        )
        return Found(proven, caused, spread)

    def bound(self, box: Box) -> Ball:
        """An upper bound on a box."""
        found, _, _ = self._field.expand(box)
        tops = [self._norms(corner) + self._norms(e.rest) for e in found for corner in e.corners()]
        return max(tops[1:], key=float, default=tops[0]).max(tops[0]).upper() if _finite(tops) else arb("nan")

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether the columns of the matrices alone are too long at a point."""
        total = arb(0)
        for matrix in self._split(self._field.at(point)):
            v = _long_direction(matrix)
            image = [sum((x * y for x, y in zip(row, v, strict=True)), start=arb(0)) for row in matrix]
            size = arb(sum(x * x for x in v)) * (1 + 1e-12)
            if not size > 0:
                continue
            total = total + (sum((x * x for x in image), start=arb(0)) / size).nonnegative_part().sqrt()
        return bool(total > self._limit)

    def _split(self, entries: Sequence[Ball]) -> list[Balls]:
        matrices, start = [], 0
        for p, q in self._shapes:
            matrices.append([list(entries[start + i * q : start + (i + 1) * q]) for i in range(p)])
            start += p * q
        return matrices

    def _norms(self, entries: Sequence[Ball]) -> Ball:
        return sum((spectral_norm(matrix) for matrix in self._split(entries)), start=arb(0))


def _finite(values: Sequence[Ball]) -> bool:
    return all(value.is_finite() for value in values)


def _long_direction(a: Balls) -> list[float]:
    """A vector that a matrix makes long, a proposal in floats."""
    m = [[float(x.mid()) for x in row] for row in a]
    v = [1.0 / (1 + j) for j in range(len(m[0]))]
    for _ in range(30):
        image = [sum(x * y for x, y in zip(row, v, strict=True)) for row in m]
        back = [sum(m[i][j] * image[i] for i in range(len(m))) for j in range(len(v))]
        size = max((abs(x) for x in back), default=0.0)
        if not 0 < size < float("inf"):
            break
        v = [x / size for x in back]
    return v


class PositiveDefinite:
    """S(x) > 0, with a congruence that makes `unit` (by default S) near the identity at the centre of each box."""

    def __init__(self, S: Rows, unit: Rows | None = None, values: Values | None = None) -> None:
        self._n = len(S)
        self._field = Field([S[i][j] for i in range(self._n) for j in range(self._n)], values)
        self.variables = self._field.variables
        self._unit = None if unit is None else Program([e for row in unit for e in row], self._inputs)

    @property
    def _inputs(self) -> tuple[str, ...]:
        return (*self.variables, *self._field.values)

    def with_values(self, values: Values) -> PositiveDefinite:
        """The same with other numbers for the same names."""
        other = PositiveDefinite.__new__(PositiveDefinite)
        other.__dict__.update(self.__dict__)
        other._field = self._field.with_values(values)
        return other

    def over(self, box: Box) -> Found:
        """Every corner of the affine part, minus the row sums of what the rest can be."""
        found, caused, spread = self._field.expand(box)
        t = self._congruence(box, found[0].value)
        sizes = [[abs(x) for x in row] for row in t]
        T, size = arb_mat(t), arb_mat(sizes)
        turned, size_turned = T.transpose(), size.transpose()
        for e in found:
            rest = size * arb_mat(self._n, self._n, e.rest) * size_turned
            drop = [sum(rest[i, j] for j in range(self._n)) for i in range(self._n)]
            for corner in e.corners():
                S = (T * arb_mat(self._n, self._n, corner) * turned).tolist()
                for i in range(self._n):
                    S[i][i] = S[i][i] - drop[i]
                if not is_positive(S):
                    return Found(False, caused, spread)
        return Found(True)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether S is proven to have a negative eigenvalue at a point."""
        S = self._rows(self._field.at(point))
        t = arb_mat(self._congruence_of([[float(x.mid()) for x in row] for row in S]))
        moved: Balls = (t * arb_mat(S) * t.transpose()).tolist()
        return is_indefinite(moved) or is_indefinite(S)

    def _congruence(self, box: Box, fallback: Sequence[Ball]) -> list[list[float]]:
        unit = fallback
        if self._unit is not None:
            centre = [arb(0.5 * lo + 0.5 * hi) for lo, hi in box]
            unit = self._unit.run([*centre, *self._field.values.values()])
        return self._congruence_of([[float(x.mid()) for x in row] for row in self._rows(unit)])

    @staticmethod
    def _congruence_of(rows: list[list[float]]) -> list[list[float]]:
        return whitening(rows)

    def _rows(self, entries: Sequence[Ball]) -> Balls:
        return [list(entries[i * self._n : (i + 1) * self._n]) for i in range(self._n)]


class NotNegative:
    """e(x) >= 0 for one term."""

    def __init__(self, e: Term, values: Values | None = None, *, strict: bool = False) -> None:
        self._field = Field([e], values)
        self.variables = self._field.variables
        self._strict = strict

    def with_values(self, values: Values) -> NotNegative:
        """The same with other numbers for the same names."""
        other = NotNegative.__new__(NotNegative)
        other.__dict__.update(self.__dict__)
        other._field = self._field.with_values(values)
        return other

    def over(self, box: Box) -> Found:
        """The least corner, minus what the rest can be."""
        found, caused, spread = self._field.expand(box)
        least = [corner[0] - e.rest[0] for e in found for corner in e.corners()]
        proven = all(x > 0 if self._strict else x >= 0 for x in least)
        return Found(proven, caused, spread)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether it is negative (strict: or zero) at a point."""
        value = self._field.at(point)[0]
        return bool(value <= 0 if self._strict else value < 0)
