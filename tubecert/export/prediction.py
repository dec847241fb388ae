"""What a predicted state is off by: its integration by Runge and Kutta's rule, its rounding, and its inputs. Trusted.

Implements: theory 8.11 (H.46).

That is r_p of theorem H-R where a state is predicted. In: what can go in, as intervals over the whole plan. Of the
error of a step four derivatives vanish at length 0, so that the fifth one bounds it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, TypeAlias

import numpy as np

from tubecert.enclosure.interval import Interval, exp, sqrt
from tubecert.export.blocks import INTEGRATION
from tubecert.export.controller import Controller
from tubecert.export.followed import Followed, UncoveredError, largest_of, length_of, over_pieces
from tubecert.export.program import Program
from tubecert.export.series import ORDER, Series, added, constant, moving, multiplied, run

Followed_: TypeAlias = Mapping[str, Sequence[Followed]]
Runner: TypeAlias = Callable[[Program, Followed_], Mapping[str, list[Followed]]]

_UNPREDICTED: Final = "leave hardware.predict out"
_ROOM = Fraction(1, 1000)  # of the narrowest half-width: so far from the model the code may be on its way


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicted:
    """What goes in, over the whole plan: `near` what is measured, `us` u*, `feedback` bounds |kappa|.

    `wrong`: how far the input that the code integrates with is from u0 + kappa. `narrow`: the least half-width.
    """

    near: Sequence[Followed]
    us: Sequence[Followed]
    feedback: Interval
    wrong: Interval
    narrow: Interval
    horizon: Fraction


def off(c: Controller, given: Predicted, follow: Runner) -> Interval:
    """r_p; raises `UncoveredError` where it has no bound."""
    if c.predictor is None or c.steep is None:
        raise UncoveredError("the integration of a prediction with the function of a table", _UNPREDICTED)
    if c.pieces is not None and not c.adds_plan:
        raise UncoveredError(
            "a prediction in which a feedforward through knots is played", "write hardware.feedforward: held"
        )
    room = given.narrow * Interval.of(_ROOM)
    y = [_widened(_whole(x), room) for x in given.near]
    us = [_whole(u) for u in given.us]
    kappa = [_around(given.feedback + given.wrong) for _ in us]  # of the loop, and of the code
    acting = [_sum(u, k) for u, k in zip(us, kappa, strict=True)]
    slopes = follow(c.steep, {"x": y, "u": acting})
    D, B = (_frobenius([x.value for x in slopes[name]]) for name in ("J", "B"))
    # the input is what the code has, where u* is in it; else u* is added, with the error that it has
    kept = [replace(u, error=0 * u.error) for u in acting] if c.adds_plan else acting
    (stepped,) = follow(c.predictor, {"y": y, "a": kept, "b": kept, "c": kept}).values()
    rounded = length_of(stepped)
    h, tau = Interval.of(c.delay / INTEGRATION), Interval.of(c.delay)
    held = [u.value for u in acting] if c.adds_plan else kappa
    cut = _frobenius(_cut(c, [x.value for x in y], held, given))
    lost = exp(D * tau) * (B * given.wrong * tau + INTEGRATION * (h**ORDER * cut + rounded))
    if not bool(np.all(lost.sanitised().hi < room.lo)):
        raise UncoveredError(
            "a prediction over so long a delay",
            f"shorten hardware.delay, for which f is too steep, or {_UNPREDICTED}",
        )
    return largest_of(lost) * Interval.of(c.stretch)


def _cut(c: Controller, x: Sequence[Interval], kappa: Sequence[Interval], given: Predicted) -> list[Interval]:
    """[s^5] of a step of Runge and Kutta's rule less that of the solution, at every length s up to h."""
    begin = Interval.of(0).hull(Interval.of(given.horizon + c.delay))
    h = Interval.of(0).hull(Interval.of(c.delay / INTEGRATION))
    nothing, one, half = Interval.of(0), Interval.of(1), Interval.of(Fraction(1, 2))
    acting = [constant(k) for k in kappa]

    def speed(state: Sequence[Series], t: Series) -> list[Series]:
        u = acting
        if not c.adds_plan and c.plan is not None:
            _, played = run(c.plan, {"t": [t]}).values()
            u = [added(k, own) for k, own in zip(acting, played, strict=True)]
        (v,) = run(c.flow, {"x": state, "u": u}).values()
        return v

    def ahead(share: Interval, v: Sequence[Series]) -> list[Series]:
        s = moving(share * h, share)
        return [added(p, multiplied(s, q)) for p, q in zip(start, v, strict=True)]

    start = [constant(value) for value in x]
    middle, end = moving(begin + half * h, half), moving(begin + h, one)
    first = speed(start, moving(begin, nothing))
    second = speed(ahead(half, first), middle)
    third = speed(ahead(half, second), middle)
    last = speed(ahead(one, third), end)
    mean = [
        added(added(p, s), [2 * (a + b) for a, b in zip(q, r, strict=True)])
        for p, q, r, s in zip(first, second, third, last, strict=True)
    ]
    rule = ahead(Interval.of(Fraction(1, 6)), mean)
    solution = [[value, *[nothing] * ORDER] for value in x]
    for k in range(ORDER):
        for own, v in zip(solution, speed(solution, end), strict=True):
            own[k + 1] = v[k] / Interval.of(k + 1)
    return [a[ORDER] - b[ORDER] for a, b in zip(rule, solution, strict=True)]


def _whole(x: Followed) -> Followed:
    """Over all pieces of the plan."""
    own = over_pieces(x)
    return Followed(value=own.value[:1], error=own.error[:1])


def _widened(x: Followed, room: Interval) -> Followed:
    return Followed(value=x.value + Interval(-room.hi, room.hi), error=0 * x.error)


def _around(size: Interval) -> Interval:
    return Interval(-size.hi, size.hi)


def _sum(u: Followed, kappa: Interval) -> Followed:
    """Exactly; what the sum itself is rounded by is part of `wrong`."""
    return Followed(value=u.value + kappa, error=u.error)


def _frobenius(entries: Sequence[Interval]) -> Interval:
    sizes = [Interval.exact(x.sanitised().magnitude) for x in entries]
    total = sum((x * x for x in sizes), Interval.of(0))
    return sqrt(Interval(np.maximum(total.lo, 0.0), total.hi))
