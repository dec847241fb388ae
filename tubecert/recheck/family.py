"""A family of plans: x* anywhere in a box P, u* anywhere in a box U, the defect limited.

Nothing more is known of its members, so that a claim about the plan is one about P and U, and O(rho) is what lies
within rho of P. No claim contains x*', but for the defect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb

from tubecert.recheck.balls import Ball, ceiling, exact, floor
from tubecert.recheck.cover import Range, as_ball
from tubecert.recheck.curve import Curve, Ends, Part, Segment
from tubecert.recheck.specified.trajectory import AnyPlan
from tubecert.recheck.terms import Term, variable


@dataclass(frozen=True)
class Everyone(Curve):
    """All members: x and u are variables, names with a star, in `ranges`; |p| is at most `limit`."""

    boxes: tuple[tuple[tuple[Fraction, Fraction], ...], tuple[tuple[Fraction, Fraction], ...]]
    named: Mapping[str, Range]
    limit: Fraction

    @property
    def ranges(self) -> Mapping[str, Range]:
        """P and U."""
        return self.named

    def somewhere(self) -> list[Ball]:
        """The centre of P, a box: all others are connected with it."""
        return [exact((low + high) / 2) for low, high in self.boxes[0]]

    @cached_property
    def slope(self) -> list[Term]:
        """Not known; raises `ValueError`."""
        raise ValueError("the slopes of a family of plans are not known")

    @cached_property
    def root(self) -> Segment:
        """P and U at once."""
        return Everywhere(*self.boxes)


class Everywhere(Segment):
    """Every plan at every time."""

    def __init__(
        self, P: Sequence[tuple[Fraction, Fraction]], U: Sequence[tuple[Fraction, Fraction]]
    ) -> None:
        self._P, self._U = P, U
        self.when = 0.0, 0.0
        self.x, self.u = _outward(P), _outward(U)

    @property
    def halves(self) -> Sequence[Segment]:
        """None: all of it is as good as any part."""
        return ()

    def middle(self) -> tuple[Ball, list[Ball], list[Ball]]:
        """The centres of P and U."""
        return arb(0), *([exact((low + high) / 2) for low, high in box] for box in (self._P, self._U))  # type: ignore[return-value]

    def nearest(self, state: int, at: float, own: Ball) -> Ball:
        """The nearest x* that a plan can have."""
        del own
        low, high = self._P[state]
        least, most = ceiling(exact(low)), floor(exact(high))
        return arb(min(max(at, least), most)) if least <= most else exact(low)


def _outward(box: Sequence[tuple[Fraction, Fraction]]) -> Ends:
    return [(floor(exact(low)), ceiling(exact(high))) for low, high in box]


def everyone(
    family: AnyPlan, states: Sequence[str], inputs: Sequence[str], times: Range | None = None
) -> Everyone:
    """The plans of a family as a curve; its start is not known. `times`: those of f, from 0 on; None if it has none."""
    P, U = (tuple(box[name] for name in names) for box, names in ((family.x, states), (family.u, inputs)))
    stars = [[f"{name}*" for name in names] for names in (states, inputs)]
    x, u = (tuple(map(variable, names)) for names in stars)
    named = dict(zip([*stars[0], *stars[1]], (*P, *U), strict=True))
    part = Part(exact(0), exact(0) if times is None else as_ball(times[1]), {})
    return Everyone(x, u, (part,), family.horizon, (), (P, U), named, family.defect)
