"""Searches side by side come to what each comes to alone, and what is remembered is what was asked."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import systems
from tubecert.bounds.parts import Parts
from tubecert.trajectory.during import during

from tubecert.bounds import suprema
from tubecert.bounds.suprema import Suprema
from tubecert.enclosure import together
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.objective import Lipschitz, SumOfNorms
from tubecert.enclosure.pencil import FirstFinite, Pencil, SumOfPencils
from tubecert.expression import constant, symbol
from tubecert.expression.matrix import identity
from tubecert.spec import Knots
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.tube import Tubes

F = Fraction
x, y = symbol("x"), symbol("y")
BENT = [[x * y + 1, x * x], [x * x, y - x * x * y]]
D = [[2 + x * x, x], [x, constant(3)]]
OBJECTIVES = {
    "norm": lambda: SumOfNorms([BENT]),
    "pencil": lambda: Pencil(BENT, D),
    "pencils": lambda: SumOfPencils([D, identity(2)], D),
    "two bounds": lambda: FirstFinite(Pencil(BENT, D), Pencil(BENT, D)),
    "slope": lambda: Lipschitz(BENT, [(BENT, [])]),
}
BOXES = [((F(-1), F(2)), (F(0), F(1))), ((F(1), F(3)), (F(-2), F(-1))), ((F(0), F(0)), (F(1), F(1)))]


@pytest.mark.slow
@pytest.mark.parametrize("name", OBJECTIVES)
def test_side_by_side_is_as_alone(name):
    effort = Effort(gap=1e-2, budget=3000)
    domains = [BoxDomain({"x": own, "y": other}) for own, other in BOXES]
    found = together.suprema(OBJECTIVES[name](), domains, effort)
    assert found == [supremum(OBJECTIVES[name](), domain, effort) for domain in domains]
    assert len({each.boxes for each in found}) == 3, "searches that end at different times"


def test_answers_do_not_depend_on_how_many_are_given_at_once(monkeypatch):
    effort = Effort(gap=1e-2, budget=3000)
    domains = [BoxDomain({"x": own, "y": other}) for own, other in BOXES]
    found = together.suprema(OBJECTIVES["norm"](), domains, effort)
    monkeypatch.setattr(together, "_MOST", 3)
    assert together.suprema(OBJECTIVES["norm"](), domains, effort) == found


def test_an_empty_domain_is_told():
    nowhere = BoxDomain({"x": (F(2), F(1)), "y": (F(0), F(1))})
    with pytest.raises(ValueError, match="empty"):
        together.suprema(Nothing(), [nowhere, nowhere], Effort())


class Nothing(SumOfNorms):
    """An objective that bounds nothing."""

    def __init__(self):
        super().__init__([[[x]]])

    def upper(self, lo, hi, target):
        found = super().upper(lo, hi, target)
        return replace(found, upper=np.full(len(lo), -np.inf))

    def lower(self, lo, hi):
        return np.full(len(lo), -np.inf)


def test_objectives_are_told_apart():
    for name, make in OBJECTIVES.items():
        assert make().made_of == make().made_of, name
    assert SumOfNorms([BENT]).made_of != SumOfNorms([BENT], frozenset({"x"})).made_of
    assert SumOfNorms([BENT]).made_of != SumOfNorms([BENT, D]).made_of
    assert SumOfNorms([[[x, y]]]).made_of != SumOfNorms([[[x], [y]]]).made_of
    assert Pencil(BENT, D).made_of != Pencil(D, BENT).made_of


KNOTS = Knots(
    t=(F(0), F("0.2"), F("0.4"), F("0.6")),
    x=((F(1), F(-1)), (F("0.7"), F("-0.8")), (F("0.6"), F("-0.4")), (F("0.5"), F("-0.2"))),
    u=((F(1),), (F("0.5"),), (F("-0.5"),), (F(0),)),
    interpolation="hold",
)
TUBES = ((F(0), F("0.2"), "0.3"), (F("0.15"), F("0.4"), "0.25"), (F("0.3"), F("0.6"), "0.1"))
ASKED = {
    "feedback_gain": Suprema.feedback_gain,
    "drift_on_plan": Suprema.drift_on_plan,
    "uncertainty": Suprema.uncertainty,
    "excess": Suprema.contraction_excess,
    "metric": Suprema.metric_bounds,
}


def members(plan, model):
    effort = Effort(gap=0.2)
    return [
        Suprema(model, during(plan, since, until), float(rho), (since, until), effort)
        for since, until, rho in TUBES
    ]


@pytest.fixture(scope="module")
def model():
    return systems.two_state()


@pytest.fixture(scope="module", params=["written", "knots"])
def whole(request, model):
    return systems.moving() if request.param == "written" else piecewise_plan(model, KNOTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", ASKED)
def test_parts_of_a_plan_are_found_at_once_and_as_alone(name, whole, model, monkeypatch):
    own = members(whole, model)
    alone = [ASKED[name](each) for each in own]
    together_ = Parts(whole, own)
    first, *others = (replace(each, parts=together_) for each in own)
    assert ASKED[name](first) == alone[0]
    monkeypatch.setattr(suprema, "supremum", None)  # nothing more is searched
    assert [ASKED[name](each) for each in others] == alone[1:]
    assert len(set(map(repr, alone))) == len(own) or name == "metric", "tubes that differ"


def test_what_was_found_is_for_the_tube_and_the_effort_that_were_asked_for(model):
    whole = systems.moving()
    own = members(whole, model)
    found = Parts(whole, own)
    objective = SumOfNorms([model.f_x])
    effort = own[0].effort
    assert found.over_tube(own[1], objective, effort, {}) is None, "it is not the first"
    assert found.over_tube(own[0], objective, effort, {}) is not None
    for other in (
        replace(own[1], rho=0.2),
        replace(own[1], time=(F(0), F(1))),
        replace(own[1], plan=during(whole, F("0.15"), F("0.4"))),
    ):
        assert found.over_tube(other, objective, effort, {}) is None
    assert found.over_tube(own[1], objective, replace(effort, gap=0.06), {}) is None
    assert found.over_tube(own[1], SumOfNorms([model.f_x, model.f_x]), effort, {}) is None
    assert found.over_tube(own[1], objective, effort, {"mu#": (0.0, 1.0)}) is None
    assert found.over_tube(own[1], objective, effort, {}) == supremum(objective, own[1].tube({}), effort)


def test_a_point_outside_its_part_proves_nothing(model):
    whole = systems.moving()
    tubes = [each.tube({}) for each in members(whole, model)]
    variables = tubes[0].variables(("x1", "x2"))
    points = np.array([[9.0, 9.0, 5.0], [9.0, 9.0, 5.0]])
    left, (lo, hi) = Tubes(whole, tubes).inside(variables, np.array([2, 0]), points)
    assert left.tolist() == [0, 1]
    for place, low, high in zip((2, 0), lo, hi, strict=True):
        assert TUBES[place][0] <= low[2] == high[2] <= TUBES[place][1]
        (near,), _ = whole.enclose(low[2:3], low[2:3])
        assert np.hypot(*(low[:2] - near.mid)) <= float(TUBES[place][2])
