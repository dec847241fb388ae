"""A Lipschitz constant of h in x, for an h that may have kinks (norms, absolute values).

With absolute values only: the Jacobians of all branches. Else two bounds, and the smaller one counts on each box: the
generalised Jacobian; and, since a norm is 1-Lipschitz in its arguments, |J_0| + sum_k |dh/dn_k| L_k with J_0 the
Jacobian while the norms n_k are kept fixed and L_k that of n_k's arguments. Implements: Dhx of theory (2.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.boxes import Box, Found
from tubecert.recheck.branches import BranchesBelow, apart
from tubecert.recheck.statements import NormsBelow
from tubecert.recheck.terms import (
    Matrix,
    Rows,
    Term,
    all_zero,
    in_order,
    matrix_replaced,
    matrix_slopes,
    names,
    remade,
    turned,
    variable,
)

_ANY = Fraction(0)


class _Bound:
    """An upper bound of the spectral norm of a matrix on boxes in more variables than it has."""

    def __init__(self, rows: Rows, variables: Sequence[str]) -> None:
        self._test = None if all_zero(rows) else NormsBelow([rows], _ANY)
        self._columns = [variables.index(v) for v in self._test.variables] if self._test else []

    def over(self, box: Box) -> Ball:
        """The bound."""
        return self._test.bound([box[i] for i in self._columns]) if self._test else arb(0)


class LipschitzBelow:
    """|h(t, x) - h(t, y)| <= limit |x - y|."""

    def __init__(self, h: Sequence[Term], states: Sequence[str], limit: Fraction) -> None:
        self._limit = exact(limit)
        plain, norms = _apart(h)
        back = {name: variable(name) for name in norms}
        for name, (whole, _) in norms.items():
            back[name] = whole
        smooth = apart(h)
        self._branches = None
        if smooth is not None and not any(e.op == "norm" for e in in_order(smooth[0])):
            self._branches = BranchesBelow([_jacobian(smooth[0], states)], smooth[1], limit)
        direct = _jacobian(h, states)
        levels: list[tuple[Matrix, list[Matrix]]] = []
        earlier: list[str] = []
        for entries in [*(args for _, args in norms.values()), plain]:
            gains = [matrix_replaced(matrix_slopes([[e] for e in entries], name), back) for name in earlier]
            levels.append((matrix_replaced(_jacobian(entries, states), back), gains))
            if len(earlier) < len(norms):
                earlier.append(list(norms)[len(earlier)])
        every = [direct, *(m for own, gains in levels for m in (own, *gains))]
        more = () if self._branches is None else self._branches.variables
        self.variables = tuple(sorted({*names(e for m in every for row in m for e in row), *more}))
        self._direct = _Bound(direct, self.variables)
        self._levels = [
            (_Bound(own, self.variables), [_Bound(gain, self.variables) for gain in gains])
            for own, gains in levels
        ]
        self._smooth = NormsBelow([direct], limit) if not norms and not all_zero(direct) else None

    def over(self, box: Box) -> Found:
        """The smaller of the two bounds."""
        if self._smooth is not None:
            return self._smooth.over(box)
        wide = [hi - lo for lo, hi in box]
        if self._branches is not None:
            columns = [self.variables.index(v) for v in self._branches.variables]
            found = self._branches.over([box[i] for i in columns])
            if not found.proven:
                for c, i in enumerate(columns):
                    wide[i] = max(wide[i], found.caused[c])
            return Found(found.proven, wide, wide)
        total = arb(0)
        lengths: list[Ball] = []
        for own, gains in self._levels:
            total = own.over(box) + sum(
                (g.over(box) * c for g, c in zip(gains, lengths, strict=False)), start=arb(0)
            )
            lengths.append(total)
        return Found(bool(total <= self._limit or self._direct.over(box) <= self._limit), wide, wide)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Known for smooth h and its branches: the Jacobian is too large at a point."""
        if self._branches is not None:
            return self._branches.broken([point[self.variables.index(v)] for v in self._branches.variables])
        return self._smooth is not None and self._smooth.broken(point)


def _apart(h: Sequence[Term]) -> tuple[list[Term], dict[str, tuple[Term, list[Term]]]]:
    """`h` with a name for every norm, and per name: the norm, and its arguments with names for the norms in them."""
    plain: dict[Term, Term] = {}
    norms: dict[str, tuple[Term, list[Term]]] = {}
    for term in in_order(h):
        args = tuple(plain[arg] for arg in term.args)
        if term.op == "norm":
            name = f"norm#{len(norms)}"
            norms[name] = term, list(args)
            plain[term] = variable(name)
        else:
            plain[term] = remade(term, args) if args else term
    return [plain[e] for e in h], norms


def _jacobian(entries: Sequence[Term], states: Sequence[str]) -> Matrix:
    columns = [[row[0] for row in matrix_slopes([[e] for e in entries], name)] for name in states]
    return turned(columns)
