"""A Lipschitz constant of h in x, for an h that may have kinks (norms, absolute values).

Absolute values have a sign in each branch, in which there are two bounds, and the smaller one counts on each box: the
generalised Jacobian; and, since a norm is 1-Lipschitz in its arguments, |J_0| + sum_k |dh/dn_k| L_k with J_0 the
Jacobian while the norms n_k are kept fixed and L_k that of n_k's arguments. In coordinates z = S x
all derivatives are by z. Implements: Dhx of theory (2.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.boxes import Box, Found, Values
from tubecert.recheck.branches import Signs
from tubecert.recheck.coordinates import Fields
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
    variable,
)

_ANY = Fraction(0)


class _Bound:
    """An upper bound of the spectral norm of a matrix on boxes in more variables than it has."""

    def __init__(self, rows: Rows, variables: Sequence[str], signs: Values) -> None:
        self._test = None if all_zero(rows) else NormsBelow([rows], _ANY, signs)
        self._columns = [variables.index(v) for v in self._test.variables] if self._test else []

    def over(self, box: Box, signs: Values) -> Ball:
        """The bound for a choice of signs."""
        if self._test is None:
            return arb(0)
        return self._test.with_values(signs).bound([box[i] for i in self._columns])


class LipschitzBelow:
    """|h(t, x) - h(t, y)| <= limit |S (x - y)|, branch by branch where there are absolute values."""

    def __init__(self, h: Sequence[Term], fields: Fields, limit: Fraction) -> None:
        self._limit = exact(limit)
        self._signs = Signs(h)
        ones = self._signs.values((1,) * len(self._signs.names))
        entries = self._signs.entries
        direct = _jacobian(entries, fields)
        levels = _levels(entries, fields)
        every = [direct, *(m for own, gains in levels for m in (own, *gains))]
        found = names(e for m in every for row in m for e in row) - ones.keys()
        self.variables = tuple(sorted({*found, *self._signs.variables}))
        self._levels = [
            (_Bound(own, self.variables, ones), [_Bound(gain, self.variables, ones) for gain in gains])
            for own, gains in (levels if len(levels) > 1 else ())  # one alone is the direct bound
        ]
        self._direct = NormsBelow([direct], limit, ones)
        self._columns = [self.variables.index(v) for v in self._direct.variables]
        self._signed = [self.variables.index(v) for v in self._signs.variables]

    def over(self, box: Box) -> Found:
        """Every branch that there is on the box: the smaller of the two bounds."""
        own = [box[i] for i in self._columns]
        for signs in self._signs.over([box[i] for i in self._signed]):
            part = self._signs.part(self._direct.variables, own, signs)
            found = self._direct.with_values(signs).over(part)
            if not found.proven and not self._by_levels(box, signs):
                return self._widened(found, box)
        return Found(True)

    def _by_levels(self, box: Box, signs: Values) -> bool:
        total = arb(0)
        lengths: list[Ball] = []
        for own, gains in self._levels:
            total = own.over(box, signs) + sum(
                (g.over(box, signs) * c for g, c in zip(gains, lengths, strict=False)), start=arb(0)
            )
            lengths.append(total)
        return bool(self._levels) and bool(total <= self._limit)

    def _widened(self, found: Found, box: Box) -> Found:
        """What to split: where there are kinks, whatever is wide in them; else what causes the width."""
        if not found.caused:
            return Found(False)
        kinked = range(len(box)) if self._levels else self._signed
        caused = [hi - lo if i in kinked else 0.0 for i, (lo, hi) in enumerate(box)]
        spread = list(caused)
        for c, i in enumerate(self._columns):
            caused[i] = max(caused[i], found.caused[c])
            spread[i] = max(spread[i], found.spread[c])
        return Found(False, caused, spread)

    def broken(self, point: Sequence[Ball]) -> bool:
        """The Jacobian is too large at a point at which h is smooth."""
        signs = self._signs.at([point[i] for i in self._signed])
        if signs is None:
            return False
        return not self._levels and self._direct.with_values(signs).broken([point[i] for i in self._columns])


def _levels(entries: Sequence[Term], fields: Fields) -> list[tuple[Matrix, list[Matrix]]]:
    """For every norm, then for `entries`: the Jacobian with inner norms kept fixed, and the slopes along these."""
    plain, norms = _apart(entries)
    back = {name: variable(name) for name in norms}
    for name, (whole, _) in norms.items():
        back[name] = whole
    found: list[tuple[Matrix, list[Matrix]]] = []
    earlier: list[str] = []
    for own in [*(args for _, args in norms.values()), plain]:
        gains = [matrix_replaced(matrix_slopes([[e] for e in own], name), back) for name in earlier]
        found.append((matrix_replaced(_jacobian(own, fields), back), gains))
        if len(earlier) < len(norms):
            earlier.append(list(norms)[len(earlier)])
    return found


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


def _jacobian(entries: Sequence[Term], fields: Fields) -> Matrix:
    return fields.jacobian([[e] for e in entries])
