"""A common period in t of expressions that depend on t through sin, cos, tan only, as far as one can be seen."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from math import gcd, lcm

from tubecert.expression.calculus import derivative, free_symbols, rebuild
from tubecert.expression.graph import Expression, symbol, topological


@dataclass(frozen=True, slots=True)
class Frequencies:
    """Of the waves in t that expressions consist of: all `rational`, or all rational multiples `of_pi`, in rad/s."""

    rational: tuple[Fraction, ...]
    of_pi: tuple[Fraction, ...]

    @property
    def period(self) -> tuple[Fraction, bool] | None:
        """The common period as (q, whether times pi), in s; None if nothing changes with t."""
        found = [q for q in self.rational or self.of_pi if q]
        if not found:
            return None
        common = Fraction(
            reduce(gcd, (q.numerator for q in found)), reduce(lcm, (q.denominator for q in found))
        )
        return 2 / abs(common), bool(self.rational)


def frequencies(h: Iterable[Expression], time: str) -> Frequencies | None:
    """The waves of expressions that depend on t through sin, cos, tan only; None if they depend on it otherwise."""
    rational: list[Fraction] = []
    of_pi: list[Fraction] = []
    replaced: dict[Expression, Expression] = {}
    roots = list(h)
    for node in topological(roots):
        args = tuple(replaced[arg] for arg in node.args)
        replaced[node] = rebuild(node, args)
        # a wave of waves is as long as they are
        if node.op in ("sin", "cos", "tan") and time in free_symbols(args):
            slope = derivative(node.args[0], time)
            if slope.is_constant:
                rational.append(slope.fraction)
            elif slope.op == "pi":
                of_pi.append(Fraction(1))
            elif slope.op == "mul" and slope.args[0].is_constant and slope.args[1].op == "pi":
                of_pi.append(slope.args[0].fraction)
            else:
                return None
            # a name of its own: t times a difference of waves must not lose its t
            replaced[node] = symbol(f"wave#{len(replaced)}")
    if time in free_symbols(replaced[root] for root in roots) or (rational and of_pi):
        return None
    return Frequencies(tuple(rational), tuple(of_pi))
