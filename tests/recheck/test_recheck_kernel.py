"""The kernel of recheck where a ball cannot tell the case: c s0 = s1 is common, as for h = sin(t) at rate 1/2."""

from __future__ import annotations

import random

import numpy as np
import pytest
from flint import arb

from tubecert.conditions.kernels import tight_kernel as of_the_producer
from tubecert.recheck.filtering import tight_kernel


def ball(low: float, high: float) -> arb:
    return arb(low).union(arb(high))


@pytest.mark.parametrize(("c", "w"), [(1.0, 162.6), (2.0, 2.0), (3.0, 0.5), (1.0, 1.0000001)])
def test_a_start_that_adds_nothing_costs_nothing(c, w):
    s0 = arb("0.0100030133249")  # a decimal: no ball of it is a point
    found = tight_kernel(arb(c), arb(w), s0, s0 * min(c, w))
    assert not found.is_exact()
    assert float(found.upper()) == pytest.approx(float(s0) * min(c, w) / (c * w), rel=1e-9)


def test_balls_hold_every_value_of_their_arguments():
    draw = random.Random(1)
    undecided = 0
    for _ in range(300):
        c, w, s0 = (10 ** draw.uniform(-2, 2) for _ in range(3))
        wide = 10 ** draw.uniform(-12, -1)
        s1 = min(c, w) * s0 * (1 + wide * draw.uniform(-3, 3))
        low = [x * (1 - wide) for x in (s0, s1)]
        high = [x * (1 + wide) for x in (s0, s1)]
        found = tight_kernel(arb(c), arb(w), ball(low[0], high[0]), ball(low[1], high[1]))
        undecided += bool(low[0] * min(c, w) < high[1] and high[0] * min(c, w) > low[1])
        for _ in range(5):
            inside = [draw.uniform(a, b) for a, b in zip(low, high, strict=True)]
            value = float(of_the_producer(*map(np.float64, (c, w, *inside))))
            assert found.overlaps(ball(value * (1 - 1e-9), value * (1 + 1e-9)))
    assert undecided > 100
