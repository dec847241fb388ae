"""What a geodesic costs that is computed of panels with a constant second derivative. Implements: theory 8.12.

At a distance D at most, the exact geodesic g has a speed of r = D/sqrt(a) at most, its second derivative is at most
G r^2, and its third (L + 2 G^2) r^3. A pass over the panels multiplies what is wrong of the second one at their middles
by q, after what lies between the middles is added.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, root, smaller
from tubecert.recheck.program import Program
from tubecert.recheck.specified.hardware import Arcs
from tubecert.recheck.system import System


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


Column = list[Ball]


@dataclass(frozen=True)
class Geometry:
    """The metric of a system at points, and curves of panels between them, (H.39)."""

    system: System

    def speeds(self, arcs: Arcs, x: Column, y: Column) -> tuple[Column, Column]:
        """At both ends of the computed geodesic from x to y."""
        n, h = range(len(x)), arb(1) / arcs.panels
        bent = [[arb(0) for _ in n] for _ in range(arcs.panels)]
        first = self._begun(bent, x, y)
        for _ in range(arcs.passes):
            place, speed, new = x, first, []
            for w in bent:
                middle = [place[i] + h / 2 * speed[i] + h * h / 8 * w[i] for i in n]
                new.append(self.bend(middle, [speed[i] + h / 2 * w[i] for i in n]))
                place = [place[i] + h * speed[i] + h * h / 2 * w[i] for i in n]
                speed = [speed[i] + h * w[i] for i in n]
            bent = new
            first = self._begun(bent, x, y)
        return first, [first[i] + h * sum((w[i] for w in bent), start=arb(0)) for i in n]

    def _begun(self, bent: list[Column], x: Column, y: Column) -> Column:
        """The speed at x with which the curve ends at y: y - x - sum (1 - s_j) h w_j."""
        count, found = len(bent), [b - a for a, b in zip(x, y, strict=True)]
        for j, w in enumerate(bent):
            share = arb(2 * (count - j) - 1) / (2 * count * count)
            found = [a - share * b for a, b in zip(found, w, strict=True)]
        return found

    def bend(self, x: Column, v: Column) -> Column:
        """-Gamma(v, v) = W_v eta - W (eta'W_l eta)_l/2, eta = M v."""
        matrices = self._at(x)
        W, slopes = matrices[0], matrices[1:]
        eta = W.solve(arb_mat([[each] for each in v]))
        moved = [slope * eta for slope in slopes]
        forms = arb_mat([[(eta.transpose() * each)[0, 0]] for each in moved])
        along = sum((s * each for s, each in zip(v, moved, strict=True)), start=0 * eta)
        found = along - W * forms / 2
        return [found[i, 0] for i in range(len(v))]

    def lowered(self, x: Column, v: Column) -> Column:
        """M v."""
        found = self._at(x)[0].solve(arb_mat([[each] for each in v]))
        return [found[i, 0] for i in range(len(v))]

    def _at(self, x: Column) -> list[arb_mat]:
        """W and its derivatives."""
        n, values = len(x), self._entries.run(x)
        return [arb_mat(n, n, values[k : k + n * n]) for k in range(0, len(values), n * n)]

    @cached_property
    def _entries(self) -> Program:
        s = self.system
        return Program([e for matrix in (s.W, *s.W_x) for row in matrix for e in row], s.states)
