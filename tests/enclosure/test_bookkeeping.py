"""What a search may forget of its boxes: nothing. Objectives by hand, whose bounds say what they are told to say."""

import numpy as np
import pytest

from tubecert.enclosure.branch_and_bound import Effort, decide, supremum
from tubecert.enclosure.objective import Estimate
from tubecert.verdict import Verdict


class Pieces:
    """Boxes [i, i + 1] for i < count."""

    def __init__(self, count=1):
        self.count = count

    def variables(self, needed):
        return needed

    def boxes(self, variables):
        lo = np.arange(self.count, dtype=float)[:, None]
        return lo, lo + 1

    def contract(self, variables, lo, hi):
        return lo, hi, np.ones(len(lo), dtype=bool)

    def inside(self, variables, points):
        return points, points

    def priorities(self, variables, lo, hi, estimate):
        return hi - lo


class Nothing(Pieces):
    """Boxes that hold no point."""

    def contract(self, variables, lo, hi):
        return lo, hi, np.zeros(len(lo), dtype=bool)

    def inside(self, variables, points):
        return points[:0], points[:0]


class Told:
    """`upper` of the lower ends and widths of boxes, `lower` of points."""

    variables = ("x",)

    def __init__(self, upper, lower):
        self._upper, self._lower = upper, lower

    def upper(self, lo, hi, target):
        width = hi - lo
        bound = np.broadcast_to(self._upper(lo[:, 0], width[:, 0]), (len(lo),)).astype(float)
        return Estimate(bound, 0.5 * (lo + hi), width, width)

    def lower(self, lo, hi):
        return np.broadcast_to(self._lower(lo[:, 0]), (len(lo),)).astype(float)


FEW = Effort(budget=50)


@pytest.mark.parametrize(
    ("upper", "lower", "verdict"),
    [
        (1.0, 0.5, Verdict.UNDECIDED),  # < is asked for: a bound that is the threshold proves nothing
        (1.0, 1.0, Verdict.REFUTED),  # nor does it hold where the threshold is reached
        (np.nextafter(1.0, 0.0), 0.5, Verdict.CERTIFIED),
    ],
)
def test_a_threshold_that_is_met_is_not_kept(upper, lower, verdict):
    found = decide(Told(lambda x, w: upper, lambda x: lower), Pieces(), 1.0, FEW)
    assert found.verdict is verdict


def test_a_bound_that_is_the_threshold_is_looked_into():
    objective = Told(lambda x, w: np.where(w > 0.5, 1.0, 0.9), lambda x: 0.5)
    assert decide(objective, Pieces(), 1.0, FEW).verdict is Verdict.CERTIFIED


def test_a_box_is_bounded_by_what_bounds_the_one_it_is_a_part_of():
    found = supremum(Told(lambda x, w: np.where(w > 0.5, 1.0, 2.0), lambda x: 0.0), Pieces(), FEW)
    assert found.above == 1.0


@pytest.mark.parametrize("left", [True, False])
def test_both_parts_keep_the_bound_of_the_whole(left):
    objective = Told(lambda x, w: np.where((w > 0.5) | ((x < 0.5) == left), 1.0, 0.1), lambda x: 0.0)
    assert supremum(objective, Pieces(), FEW).above == 1.0


def test_an_absolute_gap_suffices_where_the_supremum_is_nothing():
    objective = Told(lambda x, w: w**2, lambda x: 0.0)
    found = supremum(objective, Pieces(), Effort(absolute=0.1))
    assert found.reached
    assert 0.0 <= found.above <= 0.1
    assert found.boxes < 20


def test_what_is_not_worth_a_look_counts():
    """Boxes from 1024 on are bounded by 1.4; then 1 is found among the first ones, and half of it is gap enough."""

    def upper(x, width):
        first = np.where(width == 1.0, 3.0, np.where(width == 0.5, 3.0, 1.0))
        return np.where(x < 1024, first, 1.4)

    def lower(x):
        return np.where((x > 100) & (x < 1024) & (np.mod(x, 1.0) == 0.25), 1.0, 0.0)

    found = supremum(Told(upper, lower), Pieces(2000), Effort(gap=0.5, cheap=0, budget=20_000))
    assert found.below == 1.0
    assert found.above >= 1.4


def test_parts_of_a_box_leave_no_point_between_them():
    seen = []

    def upper(x, width):
        seen.extend(zip(x.tolist(), (x + width).tolist(), strict=True))
        return 1.0

    supremum(Told(upper, lambda x: 0.0), Pieces(), FEW)
    lows, highs = ({ends[side] for ends in seen} for side in (0, 1))
    assert lows - {0.0} == highs - {1.0}
    assert len(seen) == len(set(seen)) > 20


def test_the_point_that_is_told_is_one_whose_value_was_found():
    found = supremum(Told(lambda x, w: 2.0, lambda x: x), Pieces(), FEW)
    assert found.at["x"] == found.below


def test_a_point_that_is_worse_is_not_told():
    found = supremum(Told(lambda x, w: 1.0, lambda x: -np.abs(x - 0.5) * 1e-4), Pieces(), FEW)
    assert (found.below, found.at["x"]) == (0.0, 0.5)


def test_points_of_which_nothing_is_known_hide_no_other():
    objective = Told(lambda x, w: 1.0, lambda x: np.where(x < 1.0, np.nan, 1.0))
    assert supremum(objective, Pieces(2), FEW).below == 1.0


def test_unknown_values_are_never_taken_for_bounds():
    found = supremum(Told(lambda x, w: np.inf, lambda x: np.nan), Pieces(), FEW)
    assert (found.below, found.above) == (-np.inf, np.inf)


def test_of_no_points_there_is_no_supremum():
    with pytest.raises(ValueError, match="the domain is empty"):
        supremum(Told(lambda x, w: 1.0, lambda x: 0.0), Nothing(3), FEW)


@pytest.mark.parametrize("budget", [1, 7, 50])
def test_a_gap_that_is_not_reached_is_not_said_to_be(budget):
    found = supremum(Told(lambda x, w: 1.0, lambda x: 0.0), Pieces(), Effort(budget=budget))
    assert not found.reached
    assert (found.below, found.above) == (0.0, 1.0)
    assert found.boxes <= 2 * budget + 1
