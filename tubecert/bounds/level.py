"""The tube in coordinates of its own: rho and half-widths such that a curve that leaves it is at least dbar long.

In: what is proposed for rho and the half-widths. Out: numbers that are proven, or why there are none. Trusted: yes.
Implements: theory 1a. The domain |S (x - x*)| <= rho, |x_i - x_i*| <= w_i serves if w_i >= dbar sup sqrt(W_ii)
with dbar = sqrt(a) rho, and a and the suprema are those of the domain itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from tubecert.bounds.compute import Box, Radius, overshoot
from tubecert.bounds.constants import Constant
from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.constant import decimal_above, printable_above
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.tube import containment
from tubecert.verdict import Verdict

_ROUNDS = 20
# what is added to be on the safe side: more in each round
_LEAST, _MOST = (Fraction(1, 10**7), Fraction(1, 200))
_LOOSE = 1 + Fraction(1, 1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposed:
    """What a search proposes for the tube: rho, and what |x_i - x_i*| will be at most. Nothing is believed of it."""

    rho: Fraction
    sides: tuple[Fraction, ...]

    def scaled(self, factor: Fraction) -> Proposed:
        """The same tube, larger or smaller."""
        sides = tuple(decimal_above(factor * side) for side in self.sides)
        return Proposed(rho=decimal_above(factor * self.rho), sides=sides)


def least_level(
    suprema: Suprema, safe_set: Box, offset: Interval, width: Fraction, proposed: Proposed
) -> Radius:
    """The least rho with rho >= sqrt(A/a)|S (x0* - x0)| + width, a and A of the tube itself, as `least_radius`.

    Theory 2.11 in z.
    """
    least = Fraction(float(offset.hi)) + width if math.isfinite(offset.hi) else width
    now = proposed if proposed.rho >= least else proposed.scaled(least / proposed.rho)
    found = Radius(rho=now.rho)
    for k in range(_ROUNDS):
        found = settled(suprema, safe_set, now)
        if found.lower is None or found.upper is None or found.sides is None:
            return found
        right = overshoot(found.lower, found.upper, offset, width)
        if right is None:
            return replace(found, lower=None, upper=None, obstacle="out_of_range")
        if right <= found.rho:
            return found
        factor = right / found.rho * (1 + _added(k))
        now = Proposed(rho=found.rho, sides=found.sides).scaled(factor)
    return replace(found, lower=None, upper=None, obstacle="not_settled")


def greatest_level(
    suprema: Suprema, safe_set: Box, asked: Sequence[Fraction | None], proposed: Proposed
) -> Radius:
    """The greatest rho, but for a thousandth, for which no half-width exceeds the one that was asked for, theory 1a.5.

    `asked` of every state, then of every output of the model. Where the safe set has less room than that, a smaller
    one.
    """
    now, best = proposed, None
    found = Radius(rho=now.rho)
    for k in range(_ROUNDS):
        found = settled(suprema, safe_set, now)
        if found.lower is None or found.sides is None:
            if best is not None or (narrower := _narrower(suprema.model.states, found, k)) is None:
                return best or found
            now = narrower
            continue
        sides = (*found.sides, *_of_outputs(suprema, found, asked[len(found.sides) :]))
        room = min(w / side for w, side in zip(asked, sides, strict=True) if w is not None)
        if room >= 1 and (best is None or found.rho > best.rho):
            best = found
        if best is not None and (room < 1 or room <= _LOOSE):
            return best
        factor = room * (1 - _added(k))
        now = Proposed(rho=found.rho, sides=found.sides).scaled(factor)
    return best or replace(found, lower=None, upper=None, obstacle="not_settled")


def _narrower(states: Sequence[str], found: Radius, k: int) -> Proposed | None:
    """A tube that leaves the safe set, as narrow as that is around the plan; None if that would not help."""
    contained = found.contained
    if contained.verdict is Verdict.CERTIFIED or found.sides is None or contained.room <= 0:
        return None
    share = contained.room / found.sides[states.index(contained.state)]
    return Proposed(rho=found.rho, sides=found.sides).scaled(share * (1 - _added(k)))


def settled(suprema: Suprema, safe_set: Box, proposed: Proposed) -> Radius:
    """The half-widths that go with a radius: raised, or lowered where they are loose, until they are proven, (1.7)."""
    rho, sides = proposed.rho, tuple(map(_printed, proposed.sides))
    best: Radius | None = None
    for k in range(_ROUNDS):
        contained = containment(suprema.plan, sides, suprema.model.states, safe_set, suprema.effort)
        if contained.verdict is not Verdict.CERTIFIED:
            return best or Radius(rho=rho, contained=contained, sides=sides)
        tube = suprema.with_radius(rho, sides)
        a, A = tube.metric_bounds()
        if not (a.below > 0 and math.isfinite(A.above)):
            return Radius(rho=rho, contained=contained, obstacle="metric_unbounded")
        needed = _half_widths(tube, a, rho)
        if needed is None:
            return Radius(rho=rho, contained=contained, obstacle="out_of_range")
        fits = all(least <= side for least, side in zip(needed, sides, strict=True))
        if fits:
            best = Radius(rho=rho, lower=a, upper=A, contained=contained, sides=sides)
            if all(side <= least * _LOOSE for least, side in zip(needed, sides, strict=True)):
                return best
        growth = 1 + _added(k)
        raised = tuple(_printed(least * growth) for least in needed)
        sides = raised if fits else tuple(max(pair) for pair in zip(raised, sides, strict=True))
    return best or Radius(rho=rho, obstacle="not_settled")


def _of_outputs(suprema: Suprema, found: Radius, asked: Sequence[Fraction | None]) -> tuple[Fraction, ...]:
    """The half-widths of the outputs of a tube that is proven, as they will be printed; only if one is asked for.

    (1.8).
    """
    if found.lower is None or not any(asked):
        return (Fraction(0),) * len(asked)
    reach = sqrt(Interval.exact(found.lower.below)) * Interval.of(found.rho)
    widths = suprema.with_radius(found.rho, found.sides).output_widths()
    return tuple(_printed(Fraction(float((Interval.exact(width.above) * reach).hi))) for width in widths)


def _half_widths(tube: Suprema, a: Constant, rho: Fraction) -> tuple[Fraction, ...] | None:
    """Dbar sup sqrt(W_ii) for every state, None if one is not finite, (1.7)."""
    reach = sqrt(Interval.exact(a.below)) * Interval.of(rho)
    ends = [float((Interval.exact(width.above) * reach).hi) for width in tube.half_widths()]
    return tuple(map(Fraction, ends)) if all(map(math.isfinite, ends)) else None


def _added(k: int) -> Fraction:
    return min(_MOST, Fraction(4**k) * _LEAST)


def _printed(value: Fraction) -> Fraction:
    """What a certificate will say of a half-width, read as the exact decimal that it shows."""
    return Fraction(repr(printable_above(value)))
