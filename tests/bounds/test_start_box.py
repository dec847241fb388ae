"""A box of starts: d0, H0 and the offset are those of the worst start in it, or more."""

from fractions import Fraction

import numpy as np
import pytest
from systems import three_state, two_state

from tubecert.bounds.start import KnownStart, StartBox
from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.trajectory.plan import constant_plan

F = Fraction
FLAT = ((F(-1, 10), F(1, 5)), (F(1, 20), F(1, 20)))
CURVED = ((F(-1, 100), F(1, 50)), (F(0), F(1, 100)), (F(1, 100), F(1, 100)))


def suprema_of(model, rho):
    plan = constant_plan([F(0)] * len(model.states), [F(0)], None)
    return Suprema(model, plan, rho, (F(0), F(1)), Effort())


def points(box, count=40):
    rng = np.random.default_rng(3)
    for part in rng.choice([0.0, 1.0, 0.5, 0.3], size=(count, len(box))):
        yield tuple(low + Fraction(float(p)) * (high - low) for p, (low, high) in zip(part, box, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("case", ["flat", "curved"])
def test_no_start_of_the_box_is_further_away(case):
    model, box = (two_state(), FLAT) if case == "flat" else (three_state(), CURVED)
    suprema = suprema_of(model, 0.4 if case == "flat" else 0.06)
    metric = suprema.metric_bounds()
    start = StartBox(box)
    d0, offset, h0 = start.distance(suprema, metric), start.offset(suprema), start.uncertainty(suprema)
    single = [KnownStart(point) for point in points(box)]
    furthest = max(s.distance(suprema, metric).below for s in single)
    assert furthest <= d0.above
    assert d0.below <= max(s.distance(suprema, metric).above for s in single) * (1 + 1e-9)
    assert max(float(s.offset(suprema).lo) for s in single) <= float(offset.hi)
    assert max(s.uncertainty(suprema).below for s in single) <= h0.above
    if case == "flat":  # attained at a corner
        assert d0.above <= furthest * (1 + 1e-9)
        assert h0.above <= max(s.uncertainty(suprema).above for s in single) * 1.02


def test_a_box_without_width_in_all_but_name_is_the_point():
    model = two_state()
    suprema = suprema_of(model, 0.4)
    metric = suprema.metric_bounds()
    thin = (F(1, 10), F(1, 10) + F(1, 10**30)), (F(0), F(0))
    near = KnownStart((F(1, 10), F(0)))
    exact = near.distance(suprema, metric).above
    assert StartBox(thin).distance(suprema, metric).above == pytest.approx(exact, rel=1e-12)
