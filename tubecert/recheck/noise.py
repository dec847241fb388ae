"""What one unit of noise is: |S n|, |Theta n|, |(S B)^+ S n|, at every corner where n is in a box."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball, exact, length, sharp_norm
from tubecert.recheck.branches import norms_below
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.metric import stated, together, upper_bound
from tubecert.recheck.place import Place
from tubecert.recheck.relative import left_inverse
from tubecert.recheck.specified.numbers import Numbers
from tubecert.recheck.terms import (
    NOUGHT,
    UNIT,
    Matrix,
    Term,
    all_zero,
    number,
    plus,
    scaled,
    times,
    turned,
)
from tubecert.recheck.turning import bordered, definite


def _corners(sizes: Numbers) -> Iterator[Matrix]:
    """The corners of a box around 0 in x, one of every two opposite ones, as columns."""
    signs = [(1,) if not size or i == 0 else (1, -1) for i, size in enumerate(sizes)]
    for chosen in product(*signs):
        yield [[number(sign * size)] for sign, size in zip(chosen, sizes, strict=True)]


def noise_size(place: Place, limit: Fraction, noise: Numbers | None) -> Outcome:
    """|S n|, n_E of theory 8.2."""
    S = None if place.coordinates is None else [[exact(q) for q in row] for row in place.coordinates.S]
    if noise is None:
        most = arb(1) if S is None else sharp_norm(S)
        return stated(bool(most <= exact(limit)), "it is less than |S|")
    within = all(_length(place.fields.vector(corner)) <= exact(limit) for corner in _corners(noise))
    return stated(within, "a corner of the box of noise is longer")


def _length(column: Matrix) -> Ball:
    """The length of a column of numbers."""
    return length([exact(_number(e)) for (e,) in column])


def _number(e: Term) -> Fraction:
    assert isinstance(e.value, Fraction)
    return e.value


def noise_metric(place: Place, limit: Fraction, noise: Numbers | None) -> Outcome:
    """|Theta n|: M <= limit^2, or at every corner, n_M of theory 8.2."""
    if noise is None:
        return upper_bound(place.system, limit**2, place.tube(), place.budget)
    if not any(noise):
        return stated(True, "")
    if not limit:
        return stated(False, "there is noise")
    W, corner = place.system.W, [[number(limit**2)]]
    nothing = [[NOUGHT] for _ in place.system.states]
    unit = bordered(W, nothing, corner)
    return together([definite(place, bordered(W, n, corner), unit) for n in _corners(noise)])


def noise_explained(place: Place, limit: Fraction, noise: Numbers | None) -> Outcome:
    """|(S B)^+ S n|: B'S' S S' S B <= limit^2 (B'S'S B)^2, or at every corner, n_B of theory 8.2."""
    fields = place.fields
    B = fields.B
    if noise is None:
        gram = times(turned(B), B)
        stretched = times(turned(B), fields.vector(_unit(place)))
        square = times(gram, gram)
        S = plus(scaled(limit**2, square), times(stretched, turned(stretched)), -1)
        return definite(place, S, square)
    inverse = left_inverse(place)
    columns = [times(inverse, fields.vector(n)) for n in _corners(noise)]
    outcomes = [
        stated(True, "") if all_zero(a) else prove(norms_below([a], limit), place.tube(), place.budget)
        for a in columns
    ]
    return together(outcomes)


def _unit(place: Place) -> Matrix:
    n = range(len(place.system.states))
    return [[UNIT if i == j else NOUGHT for j in n] for i in n]
