"""The equilibrium near a point: f(x) + B(x) u = 0, by Newton's method in numbers of 300 bits.

First the inputs alone move; where none holds the point, states move with them, by equal shares of the safe set. What is
found are decimals, and no more than a proposal: by how much they miss the dynamics is bounded as for any other plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import log10
from typing import TYPE_CHECKING, Final, NamedTuple

from tubecert.expression import ZERO, Expression, symbol
from tubecert.expression.balls import BITS, ball, middle, values
from tubecert.expression.matrix import jacobian
from tubecert.spec.values import Ends, TermMatrix, Vector, out_of_range

if TYPE_CHECKING:
    from flint import arb

    from tubecert.spec.values import Term

DIGITS: Final = 20
_STEPS: Final = 20
_LEFT: Final = Fraction(1, 10**40)  # of the largest slope: what may be left of f + B u
_DAMPED: Final = Fraction(
    1, 10**20
)  # of the same, squared: rows that depend on each other have a least step, too


class Plant(NamedTuple):
    """What an equilibrium is one of: x' = f + B u in the names of states and inputs, and the safe set."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: tuple[Term, ...]
    B: TermMatrix
    box: tuple[Ends, ...]


def equilibrium(plant: Plant, x: Vector, u: Vector) -> tuple[Vector, Vector] | None:
    """x* (n) in the safe set and u* (m) near a point, with `DIGITS` digits of their size; None if none is met."""
    from flint import ctx

    n, names = len(plant.states), (*plant.states, *plant.inputs)
    drift = [
        sum((b.expression * symbol(name) for b, name in zip(row, plant.inputs, strict=True)), start=ZERO)
        + f.expression
        for f, row in zip(plant.f, plant.B, strict=True)
    ]
    entries = [*drift, *(slope for row in jacobian(drift, names) for slope in row)]
    size = [(high - low) / 2 for low, high in plant.box] + [max(abs(own), Fraction(1)) for own in u]
    with ctx.workprec(BITS):
        z = [ball(own) for own in (*x, *u)]
        if _reached(entries, names, z, size, n) or _reached(entries, names, z, size, 0):
            found = [_rounded(own, unit) for own, unit in zip(z, size, strict=True)]
            inside = all(low <= own <= high for own, (low, high) in zip(found, plant.box, strict=False))
            if inside and not any(map(out_of_range, found)):
                return tuple(found[:n]), tuple(found[n:])
    return None


def _reached(
    entries: Sequence[Expression], names: Sequence[str], z: list[arb], size: Sequence[Fraction], first: int
) -> bool:
    """Moves z (n + m), from the variable `first` on, to where the first n of `entries` vanish; the others are their
    slopes. Where they do not, z is where they are least, by inputs alone, or nowhere.
    """
    from flint import arb_mat

    n, scale, every = len(entries) // (len(names) + 1), [ball(own) for own in size], range(len(names))
    for _ in range(_STEPS if first == 0 else 3):  # f + B u is affine in u
        found = values(entries, dict(zip(names, z, strict=True)))
        if found is None:
            return False
        missed = found[:n]
        slopes = [[found[n + i * len(names) + j] * scale[j] for j in every] for i in range(n)]
        steep = max(abs(own).mid() for row in slopes for own in row)
        if all(abs(own).mid() <= steep * ball(_LEFT) for own in missed):
            return True
        J = arb_mat([row[first:] for row in slopes])
        damped = arb_mat(n, n, [steep**2 * ball(_DAMPED) * (i == j) for i in range(n) for j in range(n)])
        step = J.transpose() * (J * J.transpose() + damped).solve(arb_mat([[-own] for own in missed]))
        for j in every[first:]:
            z[j] = (z[j] + step[j - first, 0] * scale[j]).mid()
    return False


def _rounded(value: arb, size: Fraction) -> Fraction:
    return round(middle(value), DIGITS - round(log10(size)))
