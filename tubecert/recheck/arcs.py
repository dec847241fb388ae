"""What a geodesic costs that is computed of panels with a constant second derivative. Implements: theory 8.12.

At a distance D at most, the exact geodesic g has a speed of r = D/sqrt(a) at most, its second derivative is at most
G r^2, and its third (L + 2 G^2) r^3. A pass over the panels multiplies what is wrong of the second one at their middles
by q, after what lies between the middles is added.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import arb

from tubecert.recheck.balls import Ball, root, smaller
from tubecert.recheck.specified.hardware import Arcs


@dataclass(frozen=True, slots=True, kw_only=True)
class Along:
    """What is known of the metric, the plan and the law at a distance of `far` at most.

    `symbols` G and `slopes` L; `least` a, `most` A of the metric; `push` bounds |Theta (f + B u*)| at both ends.
    """

    far: Ball
    symbols: Ball
    slopes: Ball
    least: Ball
    most: Ball
    push: Ball
    rate: Ball
    beta: Ball
    du: Ball


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """`loss` per distance, of alpha/2 + c'kappa; `beyond` du d |kappa| may be by so much."""

    loss: Ball
    beyond: Ball


def cost(arcs: Arcs, at: Along) -> Cost | None:
    """None where a curve may leave the tube before it is one (H.41)."""
    r = at.far / root(at.least)
    bend = at.symbols * r
    if not (5 * bend < 2 and bend * bend * at.most < at.least):
        return None
    h = arb(1) / arcs.panels
    shrink = at.slopes * r * r / 8 + bend * (1 + bend / 2)
    middle = (h + h * h * h) / 4 * r * r * r * (at.slopes + 2 * at.symbols * at.symbols)
    # shrink^J |g''|, and of every pass what lay between the middles
    powers = [shrink**k for k in range(arcs.passes + 1)]
    wrong = powers[-1] * at.symbols * r * r + middle * sum(powers, start=arb(0))
    w = root(at.most) * wrong
    alpha = w * at.push + at.rate * w * (at.far + w / 4)
    law = at.beta * at.du * w * (2 * at.far + w / 2)
    return Cost(loss=(alpha + law) / at.far, beyond=at.du * w / 2)


def push(plain: Ball, by_metric: tuple[Ball, Ball, Ball] | None, most: Ball, far: Ball) -> Ball:
    """The least bound of |Theta (f + B u*)|: `plain` of |.|; by the metric: anywhere, on the plan in |.|, its slope."""
    found = root(most) * plain
    if by_metric is None:
        return found
    anywhere, on_plan, slope = by_metric
    return smaller(smaller(found, anywhere), root(most) * on_plan + slope * far)
