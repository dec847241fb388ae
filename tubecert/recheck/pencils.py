"""Statements about pencils over boxes: slopes of M, the feedback gain, the least gain of the inputs.

Implements: theory (2.4), (2.7), (2.8). Weights and shares are proposed at the centre of each box; that they serve is
proven on all of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, between, ceiling, exact, is_indefinite, proposed_largest, whitening
from tubecert.recheck.boxes import Box, Expansion, Field, Found
from tubecert.recheck.monomials import Combinations
from tubecert.recheck.quotients import cancelled
from tubecert.recheck.statements import PositiveDefinite, definite_on, square, weights
from tubecert.recheck.system import System
from tubecert.recheck.terms import Rows, names, plus, variable

_APART, _BENT, _EVEN = 0.25, 0.65, 0.1  # of what is left of a limit: by size, by curvature, to all alike
_INSIDE = 1 - 2.0**-30  # of what is left of a limit: sums of floats stay within it
_RANGES = 40  # of mu, that are looked at on one box
_ALL_RANGES = 2000  # where nothing varies with the states: there are no parts
_DEAR = 4.0  # a range more is passed on to all parts of a box
_RIM = 0.05  # of what varies on a box: vertices are exact, what lies outside the tube is a part


class SlopesBelow:
    """The sum of the largest |eigenvalues| of the pencils (N_k, D) is at most `limit`.

    The share of each N_k is proposed on the box, as an affine function: a_k + g_k'x. That it serves is proven,
    share_k(x) D +- N_k > 0, and that all shares together stay within the limit.
    """

    def __init__(self, matrices: Sequence[Rows], D: Rows, limit: Fraction) -> None:
        self._limit, self._n, self._count = exact(limit), len(D), len(matrices)
        entries = [e for rows in (D, *matrices) for row in rows for e in row]
        self.variables = tuple(sorted(names(entries)))
        self._pencil = Combinations(entries, self.variables)
        self._shares = ["share#", *(f"share#{v}" for v in self.variables)]
        share = sum(
            (variable(g) * variable(v) for g, v in zip(self._shares[1:], self.variables, strict=True)),
            start=variable("share#"),
        )
        tests = [
            PositiveDefinite(plus([[share * e for e in row] for row in D], N, sign), D, self._share_of([0.0]))
            for N in matrices
            for sign in (1, -1)
        ]
        self._tests = [(test, [self.variables.index(v) for v in test.variables]) for test in tests]

    def over(self, box: Box) -> Found:
        """Every share on the whole box."""
        shares = self._proposed(box)
        whole = [between(lo, hi) for lo, hi in box]
        total = [sum((arb(x) for x in column), start=arb(0)) for column in zip(*shares, strict=True)]
        most = sum((g * x for g, x in zip(total[1:], whole, strict=True)), start=total[0])
        if not most <= self._limit:
            return Found(False)
        for k, share in enumerate(shares):
            for test, columns in self._tests[2 * k : 2 * k + 2]:
                found = test.with_values(self._share_of(share)).over([box[i] for i in columns])
                if not found.proven and not found.caused:
                    return Found(False)
                if not found.proven:
                    caused, spread = [0.0] * len(box), [0.0] * len(box)
                    for c, i in enumerate(columns):
                        caused[i], spread[i] = found.caused[c], found.spread[c]
                    return Found(False, caused, spread)
        return Found(True)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether one matrix alone takes more than the limit."""
        whole = {**self._share_of([0.0]), "share#": self._limit}
        return any(
            test.with_values(whole).broken([point[i] for i in columns]) for test, columns in self._tests
        )

    def _share_of(self, share: Sequence[float]) -> dict[str, Ball]:
        """The numbers of an affine function; slopes that are not given are 0."""
        return dict(
            zip(self._shares, map(arb, [*share, *[0.0] * (len(self._shares) - len(share))]), strict=True)
        )

    def _proposed(self, box: Box) -> list[list[float]]:
        """[a_k, g_k] for every matrix: its least share, with its slopes, and of what is left what it bends, and a part.

        A share has a kink where its matrix vanishes: there an affine function has to be above it by what it varies.
        """
        centre = [0.5 * lo + 0.5 * hi for lo, hi in box]
        steps = [0.25 * (hi - lo) for lo, hi in box]
        near = [
            [c + sign * h * (i == j) for j, (c, h) in enumerate(zip(centre, steps, strict=True))]
            for sign in (1, -1)
            for i in range(len(box))
        ]
        least, *further = (
            self._least(entries)
            for entries in self._pencil.run([list(map(arb, at)) for at in (centre, *near)])
        )
        total = sum(least)
        left = (float(self._limit) - total) * _INSIDE
        pairs = list(zip(further[: len(box)], further[len(box) :], steps, strict=True))
        bends = [sum(max(0.0, p[k] + q[k] - 2 * x) for p, q, _ in pairs) for k, x in enumerate(least)]
        parts = [
            _APART * part + _BENT * bend + _EVEN / self._count
            for part, bend in zip(_in_proportion(least), _in_proportion(bends), strict=True)
        ]
        slopes = [
            [(x - y) / (2 * h) if h > 0 else 0.0 for x, y in zip(p, q, strict=True)] for p, q, h in pairs
        ]
        shares = []
        for k, part in enumerate(parts):
            g = [slope[k] - part * sum(slope) for slope in slopes]
            shares.append([least[k] + part * left - sum(q * c for q, c in zip(g, centre, strict=True)), *g])
        return shares

    def _least(self, entries: list[Ball]) -> list[float]:
        """About the least share of each matrix at a point, in floats: |T N T'| where T D T' = I."""
        n = self._n
        D, *slopes = [arb_mat(n, n, entries[k : k + n * n]) for k in range(0, len(entries), n * n)]
        T = arb_mat(whitening([[float(x.mid()) for x in row] for row in D.tolist()]))
        moved = [T * N * T.transpose() for N in slopes]
        squares = [[[float(x.mid()) for x in row] for row in (N * N.transpose()).tolist()] for N in moved]
        return [math.sqrt(proposed_largest(square)) for square in squares]


def _in_proportion(sizes: Sequence[float]) -> list[float]:
    """Parts of 1; equal ones where all sizes are 0."""
    total = sum(sizes)
    return [x / total if total > 0 else 1 / len(sizes) for x in sizes]


class GainBelow:
    """t (B B'/mu + mu W) - F > 0 for all mu in (0, largest], on boxes of states.

    1/mu is replaced by tangents, 2/m - mu/m^2 <= 1/mu, which make S affine in mu: what holds at both ends of a range of
    mu holds between them. B B', W and F are expanded once on a box, and every range takes a combination of them. What
    is left to be proven on a box is passed on to its parts.
    """

    def __init__(self, s: System, limit: Fraction, largest: Fraction) -> None:
        self._limit, self._n = exact(limit), len(s.states)
        self._whole = (0.0, ceiling(exact(largest)))
        n = range(self._n)
        self._field = Field(
            cancelled([rows[i][j] for rows in (s.BBt, s.W, s.F) for i in n for j in n[: i + 1]])
        )
        self.variables = self._field.variables
        self._left: list[tuple[list[tuple[float, float]], list[tuple[float, float]]]] = []

    def over(self, box: Box) -> Found:
        """Every range of mu that is not proven on a larger box, theory 2.1; halved while that promises more."""
        waiting, left = self._waiting(box), []
        near = _tangent(waiting[-1])
        found, caused, spread = self._field.expand(box, lambda at: self._weights(at, near))
        count, enough = len(waiting), _RANGES if box else _ALL_RANGES
        most = _DEAR * max(caused, default=0.0) * near / 2  # in units of W, as the gaps of tangents are
        while waiting:
            ends = waiting.pop()
            if self._holds(found, ends):
                continue
            lo, hi = ends
            m = _tangent(ends)
            gap = float(self._limit) * (hi - m) * (hi - m) / m if lo > 0 else float(self._limit) * hi
            middle = math.sqrt(lo) * math.sqrt(hi) if hi > 4 * lo > 0 else 0.5 * lo + 0.5 * hi
            if lo < middle < hi and count < enough and gap > most:
                count += 2
                waiting += [(lo, middle), (middle, hi)]
            else:
                left.append(ends)
        if left:
            self._left.append((list(box), left))
        return Found(not left, caused, [_RIM * x for x in spread])

    def broken(self, point: Sequence[Ball]) -> bool:
        """At a point, with mu in the middle of the ranges that were left, or the whole."""
        entries = self._field.at(point)
        ranges = self._left[-1][1] if self._left else [self._whole]
        for ends in ranges:
            mu = arb(_tangent(ends))
            if mu > 0 and is_indefinite(self._combined(entries, self._limit / mu, self._limit * mu).tolist()):
                return True
        return False

    def _waiting(self, box: Box) -> list[tuple[float, float]]:
        """What was not proven on the last box that was looked at and contains this one: its parts need no more."""
        while self._left:
            around, left = self._left[-1]
            if all(a <= lo and hi <= b for (lo, hi), (a, b) in zip(box, around, strict=True)):
                return _together(left)
            self._left.pop()
        return [self._whole]

    def _holds(self, expansions: Sequence[Expansion], ends: tuple[float, float]) -> bool:
        """Both ends of a range, with the tangent at its middle."""
        m = _tangent(ends)
        inverse, line = 1 / arb(m), arb(m)
        centre = expansions[0].value.entries()
        unit = self._combined(centre, 2 * inverse, line / 2, 0)
        T = arb_mat(whitening([[float(x.mid()) for x in row] for row in unit.tolist()]))
        for mu in map(arb, ends):
            part = self._limit * (2 - mu * inverse) * inverse
            mixing = self._mixing(part, self._limit * mu)
            sizes = self._mixing(abs(part), abs(self._limit * mu), 1)
            for e in expansions:
                rest = (sizes * arb_mat(len(e.rest), 1, e.rest)).entries()
                if not definite_on(replace(e.mapped(mixing.__mul__), rest=rest), T):
                    return False
        return True

    def _mixing(self, of_input: Ball, of_metric: Ball, of_drift: int = -1) -> arb_mat:
        """The matrix that combines lower triangles of B B', W and F."""
        k = self._n * (self._n + 1) // 2
        mixed = of_input, of_metric, arb(of_drift)
        return arb_mat(k, 3 * k, [w * int(i == j) for i in range(k) for w in mixed for j in range(k)])

    def _combined(
        self, entries: Sequence[Ball], of_input: Ball, of_metric: Ball, of_drift: int = -1
    ) -> arb_mat:
        mixed = self._mixing(of_input, of_metric, of_drift) * arb_mat(len(entries), 1, entries)
        return square(self._n, mixed.entries())

    def _weights(self, centre: Sequence[Ball], m: float) -> list[float]:
        """What an entry of each of the three counts at one mu."""
        k = self._n * (self._n + 1) // 2
        unit = [2 / m * b + m / 2 * w for b, w in zip(centre[:k], centre[k : 2 * k], strict=True)]
        own, t = weights(self._n, unit), float(self._limit)
        return [share * weight for share in (t / m, t * m, 1.0) for weight in own]


def _tangent(ends: tuple[float, float]) -> float:
    """Where 1/mu is touched: the geometric middle of a range of mu."""
    lo, hi = ends
    return math.sqrt(lo) * math.sqrt(hi) if lo > 0 else hi


def _together(ranges: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Ranges of mu; those that reach from one to the next down to 0 as one, with a tangent further off.

    A small one of them is the harder the smaller it is: t B B'/mu is large there, and so is what it varies on a box.
    """
    apart, top = [], 0.0
    for lo, hi in sorted(ranges):
        if lo <= top:
            top = max(top, hi)
        else:
            apart.append((lo, hi))
    return [*apart, (0.0, top)] if top > 0 else list(ranges)
