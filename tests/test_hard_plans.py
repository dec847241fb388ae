"""Plans and numbers that are hard for the search: symmetry about the origin, points far away, radii that underflow."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.expression import constant, symbol
from tubecert.model import ControlAffineModel
from tubecert.spec import Knots
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.trajectory.plan import constant_plan
from tubecert.tube import Tube

x, y, z = symbol("x"), symbol("y"), symbol("z")
ZERO, ONE = constant(0), constant(1)
LINEAR = ControlAffineModel(
    states=("x", "y"),
    inputs=("u",),
    f=(y - x, -y),
    B=((ZERO,), (ONE,)),
    W=((ONE, ZERO), (ZERO, ONE)),
    rate=Fraction(1, 2),
    h=None,
)


def knots(*rows: str, interpolation: str = "linear") -> Knots:
    """Knots from lines of t, x, y, u."""
    table = [tuple(map(Fraction, row.split())) for row in rows]
    return Knots(
        t=tuple(row[0] for row in table),
        x=tuple(row[1:3] for row in table),
        u=tuple(row[3:] for row in table),
        interpolation="hold" if interpolation == "hold" else "linear",
    )


def test_a_plan_at_rest_is_no_harder_than_an_equilibrium():
    """About the origin a norm has the same value at opposite vertices: it must be split all the same."""
    plan = piecewise_plan(LINEAR, knots("0 0 0 0", "1 0 0 0"))
    tube = Tube(plan, 0.4, states=("x", "y"), inputs=("u",), time=(Fraction(0), Fraction(1)))
    found = supremum(SumOfNorms([LINEAR.drift_on_plan()]), tube, Effort())
    assert found.above <= 1.01 * found.below
    assert found.boxes < 20_000


@pytest.mark.parametrize(
    "f",
    [(y - x, -y, -z), (-x, -y, -z), (y - x, -y, Fraction(1, 3) - z), (x * y, y * z - Fraction(1, 5), x * z)],
    ids=["coupled", "isotropic", "shifted", "bilinear"],
)
def test_drifts_that_are_symmetric_about_the_plan_are_bounded(f):
    plan = constant_plan([Fraction(0)] * 3, [Fraction(0)], None)
    tube = Tube(plan, 0.4, states=("x", "y", "z"), inputs=("u",), time=None)
    found = supremum(SumOfNorms([tuple((e,) for e in f)]), tube, Effort(budget=200_000))
    assert found.above <= 1.0101 * found.below
