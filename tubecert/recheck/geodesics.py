"""Unique geodesics: G rho + L_G rho^2/8 stays below what the certificate states. Implements: theory (5.1), (5.2).

With eta = M v: Gamma(v, v) = -W_v eta + W (eta'W_l eta)_l/2, and dM/dx_m = -M W_m M. A multilinear norm is at most the
spectral norm of any unfolding of the tensor into a matrix; the least of several is taken on each box.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, exact, spectral_norm
from tubecert.recheck.boxes import Box, Field, Found
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import Outcome, in_turn, prove, stated
from tubecert.recheck.curve import Segment
from tubecert.recheck.place import Place
from tubecert.recheck.terms import all_zero

# to propose how the bound is shared by G and L
_SEGMENTS = 24
_DIRECTIONS = 80
_PARTS = (0.5, 0.2, 0.8, 0.05, 0.95)  # of what is left, for G
_FIRST = 3_000  # boxes for each of them
Tensor = dict[tuple[int, ...], Ball]


def unique(place: Place, limit: Fraction) -> Outcome:
    """G rho + L rho^2/8 <= limit over the tube, (5.1)."""
    s, rho = place.system, place.rho
    if s.flat:
        return stated(limit >= 0, "it is negative")
    symbols, slopes = (SymbolsBelow(place.fields, order, Fraction(0)) for order in (0, 1))
    found = [_sampled(test, place) for test in (symbols, slopes)]
    weights = float(rho), float(rho) ** 2 / 8
    slack = float(limit) - sum(w * x for w, x in zip(weights, found, strict=True))
    if not slack > 0:
        return Outcome(verdict="undecided", why="samples leave no room below the stated value")
    first = min(_FIRST, place.budget)
    tries = [(part, first) for part in _PARTS] + [(_PARTS[0], place.budget)] * (place.budget > first)
    found_out = Outcome(verdict="undecided", why="no split of the stated value was found")
    for part, budget in tries:
        split = zip((part, 1 - part), found, weights, strict=True)
        shares = [Fraction(x + share * 0.998 * slack / w) for share, x, w in split]
        if shares[0] * rho + shares[1] * rho**2 / 8 > limit:
            continue
        found_out = _below(place, shares, budget)
        if found_out.holds:
            break
    return found_out


def _below(place: Place, shares: Sequence[Fraction], budget: int) -> Outcome:
    """|Gamma| and |dGamma| are at most their shares of the bound."""
    return in_turn(
        prove(SymbolsBelow(place.fields, order, share), place.tube(), budget)
        for order, share in enumerate(shares)
    )


def _sampled(test: SymbolsBelow, place: Place) -> float:
    """The largest value at points along the plan, at its ends in every direction: a proposal."""
    if not test.variables:
        return float(test.bound([]).mid())
    columns = [place.system.states.index(v) for v in test.variables]
    sides = [d for d in product((-1.0, 0.0, 1.0), repeat=len(columns)) if any(d)][:_DIRECTIONS]
    best = 0.0
    for segment in _along(place):
        _, x, _ = segment.middle()
        # of a family of plans, half of its box: else next to nothing
        half = [0.5 * (high - low) if place.curve.ranges else 0.0 for low, high in segment.x]
        for side in ([0.0] * len(columns), *sides):
            size = math.hypot(*side) or 1.0
            at = [
                x[i] + place.around.extent(i) * d / size + half[i] * d
                for i, d in zip(columns, side, strict=True)
            ]
            value = float(test.bound(at).mid())
            best = max(best, value) if math.isfinite(value) else best
    return best


def _along(place: Place) -> list[Segment]:
    """Segments of the plan, about as many as are looked at."""
    level: list[Segment] = [place.curve.root]
    while len(level) < _SEGMENTS and place.curve.moves:
        halves = [half for segment in level for half in (segment.halves or (segment,))]
        if len(halves) == len(level):
            break
        level = halves
    return level


class SymbolsBelow:
    """|Gamma| (order 0) or |dGamma| (order 1) is at most `limit`."""

    def __init__(self, fields: Fields, order: int, limit: Fraction) -> None:
        self._n, self._order, self._limit = len(fields.system.states), order, exact(limit)
        self._moving = [i for i, slope in enumerate(fields.W_x) if not all_zero(slope)]
        first = [fields.W_x[i] for i in self._moving]
        bent = [fields.slopes(w) for w in first] if order else []
        second = [slopes[m] for m in self._moving for slopes in bent]
        self._field = Field([e for matrix in (fields.W, *first, *second) for row in matrix for e in row])
        self.variables = self._field.variables

    def over(self, box: Box) -> Found:
        """The tensors over the box, as balls."""
        return Found(bool(self._of(self._field.hull(box)) <= self._limit))

    def broken(self, point: Sequence[Ball]) -> bool:
        """An upper bound that is too large refutes nothing."""
        del point
        return False

    def bound(self, point: Sequence[Ball]) -> Ball:
        """The bound at a point."""
        return self._of(self._field.at(point))

    def _of(self, entries: Sequence[Ball]) -> Ball:
        n, count = self._n, len(self._moving)
        matrices = [arb_mat(n, n, entries[k : k + n * n]) for k in range(0, len(entries), n * n)]
        try:
            M = matrices[0].inv()
        except ZeroDivisionError:
            return arb("nan")
        D = {i: w * M for i, w in zip(self._moving, matrices[1:], strict=False)}
        S = {i: M * d for i, d in D.items()}
        if self._order:
            tensor = self._slopes(matrices[: count + 1], matrices[count + 1 :], M, D, S)
        else:
            tensor = self._assembled(D, self._forms(matrices[0], S))  # Gamma^k_ij as [k, i, j], (5.2)
        unfoldings = ((0,), (2,), (3,), (0, 3), (0, 2)) if self._order else ((0,), (2,))
        norms = [spectral_norm(_unfolded(tensor, rows)) for rows in unfoldings]
        best = norms[0]
        for value in norms[1:]:
            best = best if best <= value else value
        return best

    def _forms(self, W: arb_mat, S: dict[int, arb_mat]) -> Tensor:
        """sum_l W_kl (S_l)_ij, a term of (5.2)."""
        return {
            (k, i, j): sum((W[k, l] * S[l][i, j] for l in S), start=arb(0))
            for k, i, j in product(range(self._n), repeat=3)
        }

    def _assembled(self, D: dict[int, arb_mat], forms: Tensor) -> Tensor:
        """(5.2) from its terms."""
        nothing = arb(0)
        return {
            (k, i, j): (value - (D[i][k, j] if i in D else nothing) - (D[j][k, i] if j in D else nothing)) / 2
            for (k, i, j), value in forms.items()
        }

    def _slopes(
        self,
        values: Sequence[arb_mat],
        second: Sequence[arb_mat],
        M: arb_mat,
        D: dict[int, arb_mat],
        S: dict[int, arb_mat],
    ) -> Tensor:
        """dGamma^k_ij/dx_m as [k, i, j, m], (5.2) differentiated; `values` are W and its slopes."""
        (W, *first), moving, count = values, self._moving, len(self._moving)
        found: Tensor = {}
        for place, m in enumerate(moving):
            bent = dict(zip(moving, second[place * count : (place + 1) * count], strict=True))
            D_m = {i: bent[i] * M - D[i] * D[m] for i in moving}
            S_m = {i: M * bent[i] * M - S[m] * D[i] - (S[m] * D[i]).transpose() for i in moving}
            one, two = self._forms(first[place], S), self._forms(W, S_m)
            part = self._assembled(D_m, {key: one[key] + two[key] for key in one})
            found |= {(*key, place): value for key, value in part.items()}
        return found


def _unfolded(tensor: Tensor, rows: tuple[int, ...]) -> list[list[Ball]]:
    """The tensor as a matrix, the axes `rows` against all others."""
    lines: dict[tuple[int, ...], list[Ball]] = {}
    for key in sorted(tensor):
        lines.setdefault(tuple(key[axis] for axis in rows), []).append(tensor[key])
    return [lines[row] for row in sorted(lines)]
