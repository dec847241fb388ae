"""Values of expressions as balls (Arb, `BITS` bits): enclosures, but of tables, which are read at a middle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from tubecert.expression.graph import Expression, topological

if TYPE_CHECKING:
    from flint import arb

BITS: Final = 300


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
