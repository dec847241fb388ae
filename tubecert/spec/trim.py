"""The equilibrium near a point: f(x) + B(x) u = 0, by Newton's method in numbers of 300 bits.

First the inputs alone move; where none holds the point, states move with them, by equal shares of the safe set. What is
found are decimals, and no more than a proposal: by how much they miss the dynamics is bounded as for any other plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import log10
from typing import TYPE_CHECKING, Final, NamedTuple

from tubecert.expression import ZERO, Expression, symbol, topological
from tubecert.expression.matrix import jacobian
from tubecert.spec.values import Ends, TermMatrix, Vector

if TYPE_CHECKING:
    from flint import arb

    from tubecert.spec.values import Term

DIGITS: Final = 20
_BITS: Final = 300
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
    with ctx.workprec(_BITS):
        z = [_ball(own) for own in (*x, *u)]
        if _reached(entries, names, z, size, n) or _reached(entries, names, z, size, 0):
            found = [_rounded(own, unit) for own, unit in zip(z, size, strict=True)]
            if all(low <= own <= high for own, (low, high) in zip(found, plant.box, strict=False)):
                return tuple(found[:n]), tuple(found[n:])
    return None


def _reached(
    entries: Sequence[Expression], names: Sequence[str], z: list[arb], size: Sequence[Fraction], first: int
) -> bool:
    """Moves z (n + m), from the variable `first` on, to where the first n of `entries` vanish; the others are their
    slopes. Where they do not, z is where they are least, by inputs alone, or nowhere.
    """
    from flint import arb_mat

    n, scale, every = len(entries) // (len(names) + 1), [_ball(own) for own in size], range(len(names))
    for _ in range(_STEPS if first == 0 else 3):  # f + B u is affine in u
        values = _values(entries, dict(zip(names, z, strict=True)))
        if values is None:
            return False
        missed = values[:n]
        slopes = [[values[n + i * len(names) + j] * scale[j] for j in every] for i in range(n)]
        steep = max(abs(own).mid() for row in slopes for own in row)
        if all(abs(own).mid() <= steep * _ball(_LEFT) for own in missed):
            return True
        J = arb_mat([row[first:] for row in slopes])
        damped = arb_mat(n, n, [steep**2 * _ball(_DAMPED) * (i == j) for i in range(n) for j in range(n)])
        step = J.transpose() * (J * J.transpose() + damped).solve(arb_mat([[-own] for own in missed]))
        for j in every[first:]:
            z[j] = (z[j] + step[j - first, 0] * scale[j]).mid()
    return False


def _values(entries: Sequence[Expression], point: Mapping[str, arb]) -> list[arb] | None:
    """Values of expressions at a point, nearly; None where one is not defined, or depends on something else."""
    value: dict[Expression, arb] = {}
    for node in topological(entries):
        found = _value(node, [value[each] for each in node.args], point)
        if found is None or not found.is_finite():
            return None
        value[node] = found.mid()
    return [value[entry] for entry in entries]


def _value(node: Expression, args: Sequence[arb], point: Mapping[str, arb]) -> arb | None:
    from flint import arb

    match node.op:
        case "const":
            return _ball(node.fraction)
        case "symbol":
            return point.get(str(node.value))
        case "pi":
            return arb.pi()
        case "add":
            return args[0] + args[1]
        case "mul":
            return args[0] * args[1]
        case "div":
            return args[0] / args[1]
        case "pow":
            return args[0] ** int(str(node.value))
        case "table":
            at = node.lookup.at(_fraction(args[0]))
            return None if at is None else _ball(at)
    found: arb = getattr(args[0], node.op)()
    return found


def _ball(value: Fraction) -> arb:
    from flint import arb, fmpq

    return arb(fmpq(value.numerator, value.denominator))


def _fraction(value: arb) -> Fraction:
    digits, exponent = value.mid().man_exp()
    return Fraction(int(digits)) * Fraction(2) ** int(exponent)


def _rounded(value: arb, size: Fraction) -> Fraction:
    return round(_fraction(value), DIGITS - round(log10(size)))
