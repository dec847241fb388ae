"""Values of expressions as balls (Arb, `BITS` bits): enclosures, but of tables, which are read at a middle.

Where expressions vanish is found by Newton's method in the middles: a proposal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from tubecert.expression.graph import Expression, topological
from tubecert.expression.matrix import jacobian

if TYPE_CHECKING:
    from flint import arb

BITS: Final = 300
_LEFT: Final = Fraction(1, 10**40)  # of the largest slope: what a root may leave
# of the same, squared: rows that depend on each other have a least step, too
_DAMPED: Final = Fraction(1, 10**20)


def ball(q: Fraction) -> arb:
    """The ball of a rational."""
    from flint import arb, fmpq

    return arb(fmpq(q.numerator, q.denominator))


def middle(value: arb) -> Fraction:
    """The middle of a ball."""
    digits, exponent = value.mid().man_exp()
    return Fraction(int(digits)) * Fraction(2) ** int(exponent)


def values(roots: Sequence[Expression], point: Mapping[str, arb]) -> list[arb] | None:
    """The expressions at a point; None where one may not be defined, or depends on something else."""
    found: dict[Expression, arb] = {}
    for node in topological(roots):
        own = _value(node, [found[arg] for arg in node.args], point)
        if own is None or not own.is_finite():
            return None
        found[node] = own
    return [found[root] for root in roots]


def _value(node: Expression, args: Sequence[arb], point: Mapping[str, arb]) -> arb | None:
    from flint import arb

    match node.op:
        case "const":
            return ball(node.fraction)
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
            at = node.lookup.at(middle(args[0]))
            return None if at is None else ball(at)
    found: arb = getattr(args[0], node.op)()
    return found


def towards_root(
    functions: Sequence[Expression],
    names: Sequence[str],
    start: Sequence[Fraction],
    size: Sequence[Fraction],
    *,
    first: int,
    steps: int,
) -> tuple[list[Fraction], bool]:
    """Where Newton's steps lead, and whether the n `functions` vanish there, but for 1e-40 of their largest slope.

    The variables from `first` on move, by equal shares of their `size`; where the functions cannot vanish, to where
    they are least.
    """
    from flint import arb_mat, ctx

    every, n = range(len(names)), len(functions)
    entries = [*functions, *(slope for row in jacobian(functions, names) for slope in row)]
    with ctx.workprec(BITS):
        z, scale = list(map(ball, start)), list(map(ball, size))
        for _ in range(steps):
            found = values(entries, dict(zip(names, z, strict=True)))
            if found is None:
                break
            slopes = [[found[n + i * len(names) + j] * scale[j] for j in every] for i in range(n)]
            steep = max(abs(own).mid() for row in slopes for own in row)
            if all(abs(own).mid() <= steep * ball(_LEFT) for own in found[:n]):
                return list(map(middle, z)), True
            J = arb_mat([row[first:] for row in slopes])
            damped = arb_mat(n, n, [steep**2 * ball(_DAMPED) * (i == j) for i in range(n) for j in range(n)])
            step = J.transpose() * (J * J.transpose() + damped).solve(arb_mat([[-own] for own in found[:n]]))
            for j in every[first:]:
                z[j] = (z[j] + step[j - first, 0] * scale[j]).mid()
        return list(map(middle, z)), False
