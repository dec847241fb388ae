"""Statements about pencils over boxes: slopes of M, the feedback gain, the least gain of the inputs.

Implements: theory (2.4), (2.7), (2.8). Weights and shares are proposed at the centre of each box; that they serve is
proven on all of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import sqrt

from flint import arb, arb_mat

from tubecert.recheck.balls import (
    Ball,
    between,
    exact,
    is_indefinite,
    proposed_largest,
    whitening,
)
from tubecert.recheck.boxes import Box, Found
from tubecert.recheck.monomials import Combinations
from tubecert.recheck.program import Program
from tubecert.recheck.statements import PositiveDefinite
from tubecert.recheck.system import System
from tubecert.recheck.terms import Rows, names, number, plus, scaled, times, turned, unit_matrix, variable

_INSIDE = 1 - 2.0**-30  # of what is left of a limit: sums of floats stay within it
MU, _CURVE_MU, _LINE_MU = "mu#", "p#", "q#"  # no state can have these names


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
        wide = [hi - lo for lo, hi in box]
        shares = self._proposed(box)
        whole = [between(lo, hi) for lo, hi in box]
        total = [sum((arb(x) for x in column), start=arb(0)) for column in zip(*shares, strict=True)]
        most = sum((g * x for g, x in zip(total[1:], whole, strict=True)), start=total[0])
        if not most <= self._limit:
            return Found(False, wide, wide)
        for k, share in enumerate(shares):
            for test, columns in self._tests[2 * k : 2 * k + 2]:
                found = test.with_values(self._share_of(share)).over([box[i] for i in columns])
                if not found.proven:
                    caused, spread = list(wide), list(wide)
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
        """[a_k, g_k] for every matrix: its least share, with its slopes, and what is left in proportion to it."""
        centre = [0.5 * lo + 0.5 * hi for lo, hi in box]
        steps = [0.25 * (hi - lo) for lo, hi in box]
        near = [
            [c + h * (i == j) for j, (c, h) in enumerate(zip(centre, steps, strict=True))]
            for i in range(len(box))
        ]
        least, *further = (
            self._least(entries)
            for entries in self._pencil.run([list(map(arb, at)) for at in (centre, *near)])
        )
        total = sum(least)
        left = (float(self._limit) - total) * _INSIDE
        parts = [x / total if total > 0 else 1 / self._count for x in least]
        slopes = [
            [(x - y) / h if h > 0 else 0.0 for x, y in zip(there, least, strict=True)]
            for there, h in zip(further, steps, strict=True)
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
        return [sqrt(proposed_largest(square)) for square in squares]


class GainBelow:
    """t (B B'/mu + mu W) - F > 0 on boxes of states and mu; 1/mu is replaced by a tangent, which lies below it."""

    def __init__(self, s: System, limit: Fraction) -> None:
        mu, p, q = (variable(name) for name in (MU, _CURVE_MU, _LINE_MU))
        inverse = q - mu * p  # 2/m - mu/m^2 <= 1/mu
        bound = [
            [number(limit) * (inverse * b + mu * w) for b, w in zip(br, wr, strict=True)]
            for br, wr in zip(s.BBt, s.W, strict=True)
        ]
        unit = [
            [q * b + w / q for b, w in zip(br, wr, strict=True)] for br, wr in zip(s.BBt, s.W, strict=True)
        ]
        self._test = PositiveDefinite(plus(bound, s.F, -1), unit, _tangent(1.0))
        self.variables = self._test.variables
        self._place = self.variables.index(MU) if MU in self.variables else None
        centre = [exact((lo + hi) / 2) for lo, hi in (s.safe_set[name] for name in s.states)]
        entries = Program([e for row in s.W for e in row], s.states).run(centre)
        self._size = float(limit) * sum(abs(float(e.mid())) for e in entries)

    def over(self, box: Box) -> Found:
        """With the tangent at the geometric middle of mu, theory 2.1."""
        if self._place is None:
            return self._test.over(box)
        lo, hi = box[self._place]
        low = max(lo, 0.0)
        middle = (low * hi) ** 0.5 if low > 0 else hi
        found = self._test.with_values(_tangent(middle)).over(
            [*box[: self._place], (low, hi), *box[self._place + 1 :]]
        )
        if not found.proven and hi > low:  # the gap of the tangent, where B B'/mu and mu W are of one size
            ratio = (hi - middle) / middle if low > 0 else 1.0
            found.caused[self._place] = ratio**2 * middle * self._size
        return found

    def broken(self, point: Sequence[Ball]) -> bool:
        """At a point the tangent at mu itself is exact."""
        if self._place is None:
            return self._test.broken(point)
        mu = float(point[self._place])
        return mu > 0 and self._test.with_values(_tangent(mu)).broken(
            [*point[: self._place], arb(mu), *point[self._place + 1 :]]
        )


def _tangent(m: float) -> dict[str, Ball]:
    return {_CURVE_MU: 1 / (arb(m) * arb(m)), _LINE_MU: 2 / arb(m)}


class LeastGain:
    """smin(Theta B) >= limit, where W > 0: then B'M B >= B'Y + Y'B - Y'W Y for any Y.

    Y = M B at the centre of the box is a proposal, with which nothing is lost there.
    """

    def __init__(self, s: System, limit: Fraction) -> None:
        self._n, self._m = n, m = len(s.states), len(s.inputs)
        self._names = [f"y{i}_{j}#" for i in range(n) for j in range(m)]
        Y = [[variable(name) for name in self._names[i * m : (i + 1) * m]] for i in range(n)]
        half = times(turned(s.B), Y)
        square = times(turned(Y), times(s.W, Y))
        S = plus(plus(half, turned(half)), plus(square, scaled(limit**2, unit_matrix(m))), -1)
        self._test = PositiveDefinite(S, values=dict.fromkeys(self._names, arb(0)))
        self.variables = self._test.variables
        self._system = Program([e for rows in (s.W, s.B) for row in rows for e in row], self.variables)
        self._square = exact(limit**2)

    def over(self, box: Box) -> Found:
        """The bound from below, on the whole box."""
        W, B = self._matrices([arb(0.5 * lo + 0.5 * hi) for lo, hi in box])
        try:
            Y = [arb(float(y.mid())) for y in W.solve(B).entries()]
        except ZeroDivisionError:
            wide = [hi - lo for lo, hi in box]
            return Found(False, wide, wide)
        return self._test.with_values(dict(zip(self._names, Y, strict=True))).over(box)

    def broken(self, point: Sequence[Ball]) -> bool:
        """B'M B - limit^2 at a point."""
        W, B = self._matrices(point)
        try:
            gram = (B.transpose() * W.solve(B)).tolist()
        except ZeroDivisionError:
            return False
        for i in range(self._m):
            gram[i][i] = gram[i][i] - self._square
        return is_indefinite(gram)

    def _matrices(self, point: Sequence[Ball]) -> tuple[arb_mat, arb_mat]:
        entries, split = self._system.run(point), self._n * self._n
        return arb_mat(self._n, self._n, entries[:split]), arb_mat(self._n, self._m, entries[split:])
