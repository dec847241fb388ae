"""Random plans of a family: they are members, the certified loop keeps to all of them, and a broken promise is seen."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from proven import proven
from systems import FAMILY_TWO
from typer.testing import CliRunner

from tubecert.certificate.result import Certificate
from tubecert.cli.app import app
from tubecert.errors import TubecertError
from tubecert.findings import Severity
from tubecert.model import build
from tubecert.pipeline.membership import membership
from tubecert.records import to_json
from tubecert.simulate import members
from tubecert.simulate.campaign import follow
from tubecert.simulate.members import drawing_of, member, members_of
from tubecert.simulate.reading import adopted
from tubecert.simulate.record import members_data
from tubecert.simulate.replanning import joined
from tubecert.simulate.setting import Choice, loop_of, setting_of
from tubecert.spec import load_text
from tubecert.spec.types import Table

FAMILY = FAMILY_TWO + "conditions: {decides: B}\n"


def followed(count, each, choice=None, *, seconds=1, replan=None, plans=None):
    """Members that the adaptive loop follows, and what the setting of the first one is."""
    result = Certificate.from_json(proven(FAMILY)).result
    spec = adopted(load_text(FAMILY), result)
    drawing = drawing_of(spec, build(spec), float(seconds), replan)
    setting = setting_of(spec, result, Fraction(seconds), member(drawing, 3, 0))
    loop = loop_of(setting, "l1", choice or Choice())
    plans = members_of(drawing, 3, count) if plans is None else plans(drawing)
    return setting, follow(setting, [loop], plans, asked=count - 1, each=each, seed=3)


def is_of_the_family(knots, spec):
    table = Table(file="drawn.csv", sha256="", knots=knots)
    trajectory = replace(spec.trajectory, kind="csv", bundle=None, table=table, horizon=knots.t[-1])
    (finding,) = membership(replace(spec, trajectory=trajectory), spec, "drawn")
    assert finding.severity is Severity.NOTE, finding.message


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_what_is_drawn_is_proven_to_be_of_the_family(number):
    """The proof is that of `check --family`, which knows nothing of how plans are drawn."""
    spec = load_text(FAMILY)
    plan = member(drawing_of(spec, build(spec), 2.0), 7, number)
    is_of_the_family(plan.data, spec)
    x = np.array(plan.data.x, dtype=float)
    assert np.ptp(x, axis=0).max() > 0.2  # it goes somewhere


@pytest.mark.slow
def test_a_segment_is_walked_as_an_integrator_of_others_walks_it():
    """f depends on t: a wrong time, share of u* or defect would be seen."""
    from scipy.integrate import solve_ivp

    spec = load_text(FAMILY.replace("f: [", "f: [sin(2*t) + ", 1))
    drawing = drawing_of(spec, build(spec), 1.0)
    x, u = np.array([[0.1, -0.2], [-0.3, 0.2]]), np.array([[[0.5], [-0.1]], [[-1.0], [0.3]]])
    p = np.array([[0.01, 0.0], [-0.02, 0.03]])
    found = drawing.walk(0.7, x, (u[0], u[1]), p, 0.4, 40)
    for lane in range(2):

        def speed(t, state, lane=lane):
            own = u[0] + (u[1] - u[0]) * (t - 0.7) / 0.4
            return drawing.speed(t, state[None], own[lane : lane + 1])[0] + p[lane]

        times = np.linspace(0.7, 1.1, 41)
        exact = solve_ivp(speed, (0.7, 1.1), x[lane], t_eval=times, rtol=1e-11, atol=1e-12)
        assert found[lane] == pytest.approx(exact.y.T, abs=1e-8)


@pytest.mark.slow
def test_plans_differ_and_can_be_repeated():
    spec = load_text(FAMILY)
    drawing = drawing_of(spec, build(spec), 1.0)
    first, second = member(drawing, 0, 0), member(drawing, 0, 1)
    assert first.data != second.data
    assert member(drawing, 0, 0).data == first.data


@pytest.mark.slow
def test_a_family_whose_plans_cannot_be_kept_to_is_told(monkeypatch):
    monkeypatch.setattr(members, "_STARTS", 2)
    monkeypatch.setattr(members, "_AGAIN", 3)
    text = FAMILY.replace("u: {u: [-1, 1]}", "u: {u: [0.9, 1]}")
    spec = load_text(text)
    with pytest.raises(TubecertError, match="no random plan 0 was found"):
        member(drawing_of(spec, build(spec), 60.0), 0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("replan", [None, Fraction(1, 4)])
def test_the_certified_loop_keeps_to_every_plan_and_to_those_given_up_for_others(replan):
    setting, found = followed(4, 2, replan=replan)
    assert (found.plans, found.each) == (3, 2)
    (loop,) = found.followed
    assert loop.comparison.runs == 6
    assert not loop.comparison.left_the_tube
    assert not loop.comparison.violations
    assert loop.comparison.worst["distance"].bound <= setting.reach
    assert (0.005 if replan is None else 0) < found.defect <= 0.01
    data = json.loads(json.dumps(to_json(members_data(found))))
    assert data["loops"][0]["runs"] == 6
    assert data["largest_defect"] == found.defect


@pytest.mark.slow
def test_gains_that_are_too_small_leave_some_tube():
    """What is reported of further plans is measured: a filter that is far too slow leaves the tube along them."""
    slow = Choice(bandwidth=Fraction(1, 20), adaptation_rate=Fraction(100))
    _, found = followed(3, 6, slow, seconds=3)
    assert found.followed[0].comparison.left_the_tube
    assert found.followed[0].comparison.first_exit is not None


@pytest.mark.slow
def test_a_new_plan_starts_where_the_old_one_is():
    """x* goes on, u* jumps, f(x*) + B u* = x*' on both sides; what is not reached of a plan is no part of it."""
    spec = load_text(FAMILY.replace("defect: 0.01", "defect: 0"))
    plan = member(drawing_of(spec, build(spec), 1.0, Fraction(2, 5)), 3, 1)
    assert plan.since == (0, Fraction(2, 5), Fraction(4, 5))
    assert [part.horizon for part in plan.parts] == [Fraction(2, 5), Fraction(2, 5), Fraction(1, 5)]
    assert plan.horizon == 1
    switch = np.array([0.4, 0.8])
    before, after = (plan.enclose(switch, switch, np.array(side)) for side in ([0, 1], [1, 2]))
    assert before[0].mid == pytest.approx(after[0].mid, abs=1e-12)
    assert np.abs(before[1].mid - after[1].mid).max() > 0.05
    times = np.linspace(0, 1, 41)
    x, u = (part.mid for part in plan.enclose(times, times))
    assert (np.abs(x) <= [1, 0.5]).all()
    assert (np.abs(u) <= 1).all()
    knots = plan.knots
    assert list(knots.t) == sorted(set(knots.t))
    assert knots.t[-1] >= 1


@pytest.mark.slow
def test_every_plan_of_a_planner_is_proven_to_be_of_the_family():
    spec = load_text(FAMILY)
    plan = member(drawing_of(spec, build(spec), 0.5, Fraction(1, 4)), 7, 2)
    knots = plan.parts[1].data
    assert knots.x[0] == plan.parts[0].data.x[len(plan.parts[0].data.t) // 2]
    is_of_the_family(knots, spec)


@pytest.mark.slow
def test_a_plan_that_starts_elsewhere_is_not_covered():
    """That a new plan starts where the old one is matters: jumps of x* across its box leave the tube."""

    def jumping(drawing):
        drawn = sorted(
            (member(drawing, 3, number).parts for number in range(1, 9)), key=lambda parts: parts[1].data.x[0]
        )
        yield joined([drawn[0][0], drawn[-1][1], drawn[0][2], drawn[-1][3]]), 0.0

    _, found = followed(2, 3, replan=Fraction(1, 4), plans=jumping)
    assert found.followed[0].comparison.left_the_tube


@pytest.mark.parametrize("option", ["--members", "--plan", "--replan"])
def test_one_plan_has_no_members(option, tmp_path):
    text = FAMILY.split("trajectory:", maxsplit=1)[0] + (
        "trajectory: {kind: equilibrium, at: [0, 0], input: [0]}\ntube: {epsilon: 0.6, rho_a: 0.1}\n"
        "metric: {rate: 1.74, dual_metric: [[4, -1], [-1, 4]]}\n"
    )
    (tmp_path / "one.yaml").write_text(text)
    done = CliRunner().invoke(app, ["simulate", str(tmp_path / "one.yaml"), option, "3"])
    assert done.exit_code == 2
    assert "TC708" in done.output
    assert "not a family" in done.output
