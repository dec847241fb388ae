"""A Lipschitz constant of h in x, for an h that may have kinks (norms, absolute values).

Absolute values have a sign in each branch, in which there are two bounds, and the smaller one counts on each box: the
generalised Jacobian; and, since a norm is 1-Lipschitz in its arguments, |J_0| + sum_k |dh/dn_k| L_k with J_0 the
Jacobian while the norms n_k are kept fixed and L_k that of n_k's arguments. In coordinates z = S x
all derivatives are by z. Implements: Dhx of theory (2.3).

Norms of terms with absolute values: the terms are smooth for every choice of signs, abs(e) = s e.

On a box the sign of e may be known, or both are examined. Where e changes its sign the one branch holds on the part of
the box where s e >= 0: if e is a variable, that part is a box; else to prove it on the whole box is more than needed.
Almost everywhere the Jacobian is that of a branch, so a bound for all branches is a Lipschitz constant.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from fractions import Fraction
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.boxes import Box, Field, Found, Test, Values
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


class Signs:
    """Terms with a sign for every absolute value: `entries` are smooth wherever no norm is 0."""

    def __init__(self, roots: Sequence[Term]) -> None:
        found = apart(roots)
        self.entries, signs = (list(roots), {}) if found is None else found
        self._keep(signs)

    def within(self, entries: Iterable[Term]) -> Signs:
        """The signs that occur in terms made of the entries: the others need not be known for these."""
        used = names(entries)
        found = copy(self)
        found._keep({name: e for name, e in self._of.items() if name in used})
        return found

    def _keep(self, signs: dict[str, Term]) -> None:
        self._of = signs
        self.names = tuple(signs)
        self._inner = Field(list(signs.values()))
        self._bare = {name: str(e.value) for name, e in signs.items() if e.op == "symbol"}
        self.variables = self._inner.variables

    def values(self, chosen: Sequence[int]) -> Values:
        """A choice of signs."""
        return dict(zip(self.names, map(arb, chosen), strict=True))

    def over(self, box: Box) -> Iterator[Values]:
        """Every choice that there is on a box in `variables`."""
        inside = self._inner.hull(box) if self.names else []
        return map(self.values, product(*map(_possible, inside)))

    def part(self, variables: Sequence[str], box: Box, values: Values) -> Box:
        """The part of a box in `variables` where the chosen signs are those of variables."""
        found = list(box)
        for name, variable_ in self._bare.items():
            if variable_ in variables:
                i = variables.index(variable_)
                lo, hi = found[i]
                found[i] = (max(lo, 0.0), hi) if values[name] > 0 else (lo, min(hi, 0.0))
        return found

    def at(self, point: Sequence[Ball]) -> Values | None:
        """The one at a point; None if a sign is not known."""
        choices = [_possible(e) for e in self._inner.at(point)] if self.names else []
        if any(len(signs) > 1 for signs in choices):
            return None
        return self.values([signs[0] for signs in choices])


def _entries(matrices: Sequence[Rows]) -> list[Term]:
    return [e for rows in matrices for row in rows for e in row]


def _like(matrices: Sequence[Rows], entries: Sequence[Term]) -> list[Matrix]:
    flat = iter(entries)
    return [[[next(flat) for _ in row] for row in rows] for rows in matrices]


def norms_below(matrices: Sequence[Rows], limit: Fraction) -> Test:
    """sum_k |G_k(x)| <= limit, branch by branch where there are absolute values."""
    signs = Signs(_entries(matrices))
    return (
        BranchesBelow(_like(matrices, signs.entries), signs, limit)
        if signs.names
        else NormsBelow(matrices, limit)
    )


def slopes_below(h: Rows, name: str, limit: Fraction, beside: Sequence[Rows] = ()) -> Test:
    """|dh/d(name)| + |beside| <= limit almost everywhere, branch by branch where h has absolute values."""
    signs = Signs(_entries([h]))
    slopes = matrix_slopes(_like([h], signs.entries)[0], name)
    every = [slopes, *beside]
    signs = signs.within(_entries([slopes]))
    return BranchesBelow(every, signs, limit) if signs.names else NormsBelow(every, limit)


class BranchesBelow:
    """sum_k |G_k(x)| <= limit for every choice of signs that the box admits."""

    def __init__(
        self, matrices: Sequence[Rows], signs: Signs, limit: Fraction, beside: Iterable[str] = ()
    ) -> None:
        """`beside`: further variables."""
        self._signs = signs
        self._test = NormsBelow(matrices, limit, signs.values((1,) * len(signs.names)))
        self.variables = tuple(sorted({*self._test.variables, *signs.variables, *beside}))
        self._columns = [self.variables.index(v) for v in self._test.variables]
        self._signed = [self.variables.index(v) for v in signs.variables]

    def over(self, box: Box) -> Found:
        """Every branch that there is on the box."""
        own = [box[i] for i in self._columns]
        for values in self._signs.over([box[i] for i in self._signed]):
            part = self._signs.part(self._test.variables, own, values)
            found = self._test.with_values(values).over(part)
            if not found.proven and not self._otherwise(box, values):
                return self._widened(found, box) if found.caused else Found(False)
        return Found(True)

    def _otherwise(self, box: Box, signs: Values) -> bool:
        """Whether a branch is proven in another way."""
        del box, signs
        return False

    def _widened(self, found: Found, box: Box) -> Found:
        """What to split: what the branch has by what it causes, all else by its width."""
        wide = [hi - lo for lo, hi in box]
        caused, spread = list(wide), list(wide)
        for c, i in enumerate(self._columns):
            caused[i], spread[i] = found.caused[c], found.spread[c]
        return Found(False, caused, spread)

    def broken(self, point: Sequence[Ball]) -> bool:
        """The branch at a point, where all signs are known."""
        values = self._signs.at([point[i] for i in self._signed])
        return values is not None and self._test.with_values(values).broken([point[i] for i in self._columns])


def _possible(e: Ball) -> tuple[int, ...]:
    """Signs that e may have on a set of positive measure."""
    if e >= 0:
        return (1,)
    return (-1,) if e <= 0 else (1, -1)


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


class LipschitzBelow(BranchesBelow):
    """|h(t, x) - h(t, y)| <= limit |S (x - y)|, branch by branch: the smaller of the two bounds."""

    def __init__(self, h: Sequence[Term], fields: Fields, limit: Fraction) -> None:
        self._limit = exact(limit)
        signs = Signs(h)
        ones = signs.values((1,) * len(signs.names))
        direct = _jacobian(signs.entries, fields)
        levels = _levels(signs.entries, fields)
        every = [direct, *(m for own, gains in levels for m in (own, *gains))]
        super().__init__([direct], signs, limit, names(_entries(every)) - ones.keys())
        self._levels = [
            (_Bound(own, self.variables, ones), [_Bound(gain, self.variables, ones) for gain in gains])
            for own, gains in (levels if len(levels) > 1 else ())  # one alone is the direct bound
        ]

    def _otherwise(self, box: Box, signs: Values) -> bool:
        """By the levels, if there are any."""
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
        kinked = range(len(box)) if self._levels else self._signed
        caused = [hi - lo if i in kinked else 0.0 for i, (lo, hi) in enumerate(box)]
        spread = list(caused)
        for c, i in enumerate(self._columns):
            caused[i] = max(caused[i], found.caused[c])
            spread[i] = max(spread[i], found.spread[c])
        return Found(False, caused, spread)

    def broken(self, point: Sequence[Ball]) -> bool:
        """The Jacobian is too large at a point at which h is smooth."""
        return not self._levels and super().broken(point)


def _levels(entries: Sequence[Term], fields: Fields) -> list[tuple[Matrix, list[Matrix]]]:
    """For every norm, then for `entries`: the Jacobian with inner norms kept fixed, and the slopes along these."""
    plain, norms = _apart(entries)
    back = {name: whole for name, (whole, _) in norms.items()}
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
