"""Norms of terms with absolute values: the terms are smooth for every choice of signs, abs(e) = s e.

On a box the sign of e may be known, or both are examined. Where e changes its sign the one branch holds on the part of
the box where s e >= 0: to prove it on the whole box is more than is needed. Almost everywhere the Jacobian is that of a
branch, so a bound for all branches is a Lipschitz constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball
from tubecert.recheck.boxes import Box, Field, Found, Test
from tubecert.recheck.statements import NormsBelow
from tubecert.recheck.terms import Matrix, Rows, Term, in_order, matrix_slopes, names, remade, variable

_MOST = 6  # signs


def apart(roots: Sequence[Term]) -> tuple[list[Term], dict[str, Term]] | None:
    """The terms with abs(e) = s e for a name s, and each s with its e; None if there is no abs, or too many."""
    signs: dict[str, Term] = {}
    plain: dict[Term, Term] = {}
    for term in in_order(roots):
        args = tuple(plain[arg] for arg in term.args)
        if term.op == "norm" and len(args) == 1:
            name = f"sign#{len(signs)}"
            signs[name] = term.args[0]
            plain[term] = variable(name) * args[0]
        else:
            plain[term] = remade(term, args) if args else term
    return ([plain[e] for e in roots], signs) if 0 < len(signs) <= _MOST else None


def matrices_apart(matrices: Sequence[Rows]) -> tuple[list[Matrix], dict[str, Term]] | None:
    """The same for matrices."""
    found = apart([e for rows in matrices for row in rows for e in row])
    if found is None:
        return None
    flat = iter(found[0])
    return [[[next(flat) for _ in row] for row in rows] for rows in matrices], found[1]


def norms_below(matrices: Sequence[Rows], limit: Fraction) -> Test:
    """sum_k |G_k(x)| <= limit, branch by branch where there are absolute values."""
    found = matrices_apart(matrices)
    return NormsBelow(matrices, limit) if found is None else BranchesBelow(found[0], found[1], limit)


def slopes_below(h: Rows, name: str, limit: Fraction) -> Test:
    """|dh/d(name)| <= limit almost everywhere, branch by branch where there are absolute values only."""
    found = matrices_apart([h])
    if found is None or any(e.op == "norm" for row in found[0][0] for e in in_order(row)):
        return NormsBelow([matrix_slopes(h, name)], limit)
    return BranchesBelow([matrix_slopes(found[0][0], name)], found[1], limit)


class BranchesBelow:
    """sum_k |G_k(x)| <= limit for every choice of signs that the box admits."""

    def __init__(self, matrices: Sequence[Rows], signs: dict[str, Term], limit: Fraction) -> None:
        self._signs = list(signs)
        self._test = NormsBelow(matrices, limit, dict.fromkeys(self._signs, arb(1)))
        self._inner = Field(list(signs.values()))
        self.variables = tuple(sorted({*self._test.variables, *names(signs.values())}))
        self._columns = [self.variables.index(v) for v in self._test.variables]
        self._inner_columns = [self.variables.index(v) for v in self._inner.variables]

    def over(self, box: Box) -> Found:
        """Every branch that there is on the box."""
        inside = self._inner.hull([box[i] for i in self._inner_columns])
        own = [box[i] for i in self._columns]
        for chosen in product(*map(_possible, inside)):
            found = self._branch(chosen).over(own)
            if not found.proven:
                wide = [hi - lo for lo, hi in box]
                caused, spread = list(wide), list(wide)
                for c, i in enumerate(self._columns):
                    caused[i], spread[i] = found.caused[c], found.spread[c]
                return Found(False, caused, spread)
        return Found(True)

    def broken(self, point: Sequence[Ball]) -> bool:
        """The branch at a point, where all signs are known."""
        choices = [_possible(e) for e in self._inner.at([point[i] for i in self._inner_columns])]
        if any(len(signs) > 1 for signs in choices):
            return False
        return self._branch([signs[0] for signs in choices]).broken([point[i] for i in self._columns])

    def _branch(self, chosen: Sequence[int]) -> NormsBelow:
        return self._test.with_values(dict(zip(self._signs, map(arb, chosen), strict=True)))


def _possible(e: Ball) -> tuple[int, ...]:
    """Signs that e may have on a set of positive measure."""
    if e >= 0:
        return (1,)
    return (-1,) if e <= 0 else (1, -1)
