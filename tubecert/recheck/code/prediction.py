"""What a predicted state is off by: the rule of Runge and Kutta, its rounding, and the input that it is given.

Implements: theory 8.11 (H.46).

That is r_p of theorem H-R where a state is predicted. The text is followed over all four steps, as every
function is; how far four exact steps are from the solution is bounded from the terms of the certificate: the error of
a step and four of its derivatives vanish at length 0, so the fifth derivative bounds it. Derivatives are coefficients
of power series.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from flint import arb, arb_series, ctx

from tubecert.recheck.balls import Ball, between, exact, length, magnitude, power
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.curve import CLOCK
from tubecert.recheck.program import Program
from tubecert.recheck.terms import Term, in_order, number_of, slopes, variable

STEPS = 4
_LAST = 5  # order of the derivative that bounds a step
_LONG: Final = "a prediction over so long a delay has no bound here"
_ROOM = Fraction(1, 500)  # of the narrowest half-width
_SERIES = ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sqrt")


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """What is integrated: f + B u over a delay, u being constant but for `u`, terms of time, empty where it is."""

    states: tuple[str, ...]
    f: tuple[Term, ...]
    B: tuple[tuple[Term, ...], ...]
    delay: Fraction
    u: tuple[Term, ...] = ()

    def speed(self, u: Sequence[Term]) -> list[Term]:
        """f + B u."""
        found = []
        for own, row in zip(self.f, self.B, strict=True):
            total = own
            for b, each in zip(row, u, strict=True):
                total = total + b * each
            found.append(total)
        return found


def cut(model: Model, near: Sequence[Ball], acting: Sequence[Ball], narrow: Ball, until: Ball) -> Ball:
    """How far exact steps are from the solution after the delay; `near` holds what is measured, at times up to `until`.

    `acting` is the constant part of the inputs. Raises `UnreadError` where there is no bound.
    """
    room = exact(_ROOM) * narrow
    x = [own + between(-room, room) for own in near]
    h = exact(model.delay / STEPS)
    inputs = [variable(f"u#{j}") for j in range(len(acting))]
    kept = [variable(CLOCK), *inputs]
    played = [a + b for a, b in zip(inputs, model.u, strict=True)] if model.u else inputs
    speed = model.speed(played)
    time = between(0, until + exact(model.delay))
    known = [*x, time, *acting]
    names = [*model.states, *(str(own.value) for own in kept)]
    turned = [each for name in model.states for each in slopes(speed, name)]
    steep = length([magnitude(each) for each in Program(turned, names).run(known)])
    with _capped():
        try:
            bent = _bent(speed, dict(zip(names, known, strict=True)), h)
        except UnreadError:
            raise
        except ValueError as error:  # a divisor that may vanish, on so wide a box
            raise UnreadError(_LONG) from error
    found = STEPS * h**_LAST * length(bent) * (steep * exact(model.delay)).exp()
    if not found < room:
        raise UnreadError(_LONG)
    return found.upper()


@contextmanager
def _capped() -> Iterator[None]:
    """Series up to the fifth power."""
    before, ctx.cap = ctx.cap, _LAST + 1
    try:
        yield
    finally:
        ctx.cap = before


def _bent(speed: Sequence[Term], known: Mapping[str, Ball], h: Ball) -> list[Ball]:
    """|[s^5]| of a step less the solution, over all lengths s from 0 to h; states come first of what is known."""
    s, n = _series(between(0, h), arb(1)), len(speed)
    names, x, t = list(known), list(known.values())[:n], _series(known[CLOCK])
    held = [_series(own) for own in list(known.values())[n + 1 :]]

    def at(state: Sequence[arb_series], t: arb_series) -> list[arb_series]:
        return _run(speed, dict(zip(names, [*state, t, *held], strict=True)))

    def ahead(share: Fraction, v: Sequence[arb_series]) -> list[arb_series]:
        return [own + exact(share) * s * each for own, each in zip(begin, v, strict=True)]

    begin, half = [_series(own) for own in x], Fraction(1, 2)
    k1 = at(begin, t)
    k2 = at(ahead(half, k1), t + exact(half) * s)
    k3 = at(ahead(half, k2), t + exact(half) * s)
    k4 = at(ahead(Fraction(1), k3), t + s)
    rule = ahead(Fraction(1, 6), [a + 2 * b + 2 * c + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)])
    rows = [[own] for own in x]
    for k in range(_LAST):
        v = at([arb_series(row) for row in rows], t + s)
        for row, each in zip(rows, v, strict=True):
            row.append(each[k] / (k + 1))
    return [magnitude(own[_LAST]) + magnitude(row[_LAST]) for own, row in zip(rule, rows, strict=True)]


def _series(value: Ball, slope: Ball | None = None) -> arb_series:
    return arb_series([value] if slope is None else [value, slope])


def _run(roots: Sequence[Term], given: Mapping[str, arb_series]) -> list[arb_series]:
    """Terms on series."""
    value: dict[Term, arb_series] = {}
    for term in in_order(roots):
        args = [value[arg] for arg in term.args]
        value[term] = _of(term, args, given)
    return [value[root] for root in roots]


def _of(term: Term, args: list[arb_series], given: Mapping[str, arb_series]) -> arb_series:
    match term.op:
        case "const":
            return _series(exact(number_of(term)))
        case "pi":
            return _series(arb.pi())
        case "symbol":
            return given[str(term.value)]
        case "add":
            return args[0] + args[1]
        case "mul":
            return args[0] * args[1]
        case "div":
            return args[0] / args[1]
        case "pow":
            return _power(args[0], int(str(term.value)))
        case "norm":
            return sum((each * each for each in args), start=_series(arb(0))).sqrt()
    if term.op in _HYPERBOLIC:
        return _HYPERBOLIC[term.op](args[0])
    if term.op in _SERIES:
        found: arb_series = getattr(args[0], term.op)()
        return found
    raise UnreadError(f"the integration of a prediction with {term.op} in it has no bound here")


def _power(base: arb_series, n: int) -> arb_series:
    """By products; its first coefficient as sharp as a power of a ball is."""
    found = base
    for _ in range(abs(n) - 1):
        found = found * base
    own = [found[k] for k in range(_LAST + 1)]
    own[0] = power(base[0], abs(n))
    found = arb_series(own)
    return found if n > 0 else 1 / found


def _exponential(sign: int) -> Callable[[arb_series], arb_series]:
    return lambda a: (a.exp() + sign * (-a).exp()) / 2


_HYPERBOLIC: Mapping[str, Callable[[arb_series], arb_series]] = {
    "sinh": _exponential(-1),
    "cosh": _exponential(1),
    "tanh": lambda a: 1 - 2 / ((2 * a).exp() + 1),
}
