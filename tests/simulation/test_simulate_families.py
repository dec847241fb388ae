"""Random plans of a family: they are members, the certified loop keeps to all of them, and a broken promise is seen."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from commands import run
from proven import proven
from systems import FAMILY_TWO

from tubecert.certificate.result import Certificate
from tubecert.errors import TubecertError
from tubecert.findings import Severity
from tubecert.model import build
from tubecert.pipeline.membership import membership
from tubecert.simulation.adaptive.campaign import follow
from tubecert.simulation.adaptive.families import drawing_of, members_of
from tubecert.simulation.adaptive.setting import Choice, adopted, loop_of, setting_of
from tubecert.spec import Knots, Table, load_text
from tubecert.trajectory.pieces import piecewise_plan

FAMILY = FAMILY_TWO + "conditions: {decides: B}\n"


def drawing(text, seconds):
    spec = load_text(text)
    return drawing_of(spec, build(spec), seconds)


def member(drawing, seed, number):
    ((plan, _),) = members_of(drawing, seed, [number])
    return plan


def followed(count, each, choice=None, *, seconds=1, plans=members_of):
    """Members that the adaptive loop follows, and what the setting of the first one is."""
    result = Certificate.from_json(proven(FAMILY)).result
    spec = adopted(load_text(FAMILY), result)
    drawn = drawing_of(spec, build(spec), float(seconds))
    setting = setting_of(spec, result, Fraction(seconds), member(drawn, 3, 0))
    loop = loop_of(setting, "l1", choice or Choice())
    return setting, follow(
        setting, [loop], plans(drawn, 3, range(1, count)), asked=count - 1, each=each, seed=3
    )


def is_of_the_family(knots, spec):
    table = Table(file="drawn.csv", sha256="", knots=knots)
    trajectory = replace(spec.trajectory, kind="csv", bundle=None, table=table, horizon=knots.t[-1])
    (finding,) = membership(replace(spec, trajectory=trajectory), spec, "drawn")
    assert finding.severity is Severity.NOTE, finding.message


@pytest.mark.slow
def test_what_is_drawn_is_proven_to_be_of_the_family():
    """The proof is that of `check --family`, which knows nothing of how plans are drawn."""
    is_of_the_family(member(drawing(FAMILY, 1.0), 7, 1).data, load_text(FAMILY))


@pytest.mark.slow
def test_plans_use_their_boxes_and_inputs_jump():
    found = [*members_of(drawing(FAMILY, 2.0), 3, range(20))]
    x = np.array([plan.data.x for plan, _ in found], dtype=float)
    u = np.array([plan.data.u for plan, _ in found], dtype=float)[..., 0]
    assert np.abs(x).max(axis=(0, 1)) == pytest.approx([0.6, 0.49], abs=0.1)
    assert (np.abs(u).max(axis=1) > 0.9).mean() > 0.5
    assert (np.abs(np.diff(u)).max(axis=1) > 0.5).mean() > 0.5
    assert 0.5 < np.mean([defect > 0.005 for _, defect in found]) <= 1
    assert max(defect for _, defect in found) <= 0.01


@pytest.mark.slow
def test_x_follows_the_dynamics_as_an_integrator_of_others_says():
    """f depends on t, and no defect is allowed: a wrong time or input would be seen."""
    from scipy.integrate import solve_ivp

    own = drawing(FAMILY.replace("f: [", "f: [sin(2*t) + ", 1).replace("defect: 0.01", "defect: 0"), 1.0)
    plan = member(own, 3, 0)
    t, x, u = (np.array(part, dtype=float) for part in (plan.data.t, plan.data.x, plan.data.u))
    for k in range(0, own.count, 7):

        def speed(time, state, u=u[k]):
            return own.speed(time, state[:, None], u[:, None])[:, 0]

        exact = solve_ivp(speed, t[k : k + 2], x[k], rtol=1e-11, atol=1e-12)
        assert x[k + 1] == pytest.approx(exact.y[:, -1], abs=1e-8)


@pytest.mark.slow
def test_plans_differ_and_can_be_repeated():
    own = drawing(FAMILY, 1.0)
    (first, _), (second, _) = members_of(own, 0, [0, 1])
    assert first.data != second.data
    assert member(own, 0, 1).data == second.data


@pytest.mark.slow
def test_a_family_whose_plans_cannot_be_kept_to_is_told(monkeypatch):
    monkeypatch.setattr("tubecert.simulation.adaptive.families._TRIES", 3)
    own = drawing(FAMILY.replace("u: {u: [-1, 1]}", "u: {u: [0.9, 1]}"), 8.0)
    with pytest.raises(TubecertError, match="no random plan 0 was found"):
        member(own, 0, 0)


@pytest.mark.slow
def test_the_certified_loop_keeps_to_every_plan():
    setting, found = followed(4, 2)
    assert (found.plans, found.runs_each) == (3, 2)
    (loop,) = found.loops
    assert loop.comparison.runs == 6
    assert not loop.comparison.left_the_tube
    assert not loop.comparison.violations
    assert loop.comparison.worst["distance"].bound <= setting.reach
    assert 0 < found.largest_defect <= 0.01
    data = json.loads(json.dumps(found.data))
    assert data["loops"][0]["runs"] == 6
    assert data["largest_defect"] == found.largest_defect


@pytest.mark.slow
def test_an_interruption_keeps_the_plans_that_were_followed(monkeypatch):
    monkeypatch.setattr("tubecert.simulation.adaptive.campaign._PLANS", 2)

    def interrupted(drawing, seed, numbers):
        yield from members_of(drawing, seed, numbers[:2])
        raise KeyboardInterrupt

    _, found = followed(6, 1, plans=interrupted)
    assert (found.asked, found.plans, found.loops[0].comparison.runs) == (5, 2, 2)


@pytest.mark.slow
def test_gains_that_are_too_small_leave_some_tube():
    """What is reported of further plans is measured: a filter that is far too slow leaves the tube along them."""
    slow = Choice(bandwidth=Fraction(1, 20), adaptation_rate=Fraction(100))
    _, found = followed(3, 6, slow, seconds=3)
    assert found.loops[0].comparison.left_the_tube
    assert found.loops[0].comparison.first_exit is not None


@pytest.mark.slow
def test_a_plan_whose_x_jumps_is_not_covered():
    """That x* goes on matters: plans that are given up for others that start elsewhere leave the tube."""

    def jumping(drawing, seed, numbers):
        half, jump = drawing.count // 2, Fraction(1, 10**6)
        drawn = [plan.data for plan, _ in members_of(drawing, seed, range(1, 21))]
        one, *_, other = sorted(drawn, key=lambda knots: knots.x[half])
        joined = Knots(
            t=(*one.t[:half], one.t[half] - jump, *other.t[half:]),
            x=(*one.x[: half + 1], *other.x[half:]),
            u=(*one.u[: half + 1], *other.u[half:]),
            interpolation="hold",
        )
        return iter([(piecewise_plan(drawing.model, joined), 0.0)])

    _, found = followed(2, 3, plans=jumping)
    assert found.loops[0].comparison.left_the_tube


@pytest.mark.parametrize("option", ["--members", "--plan"])
def test_one_plan_has_no_members(option, tmp_path):
    text = FAMILY.split("trajectory:", maxsplit=1)[0] + (
        "trajectory: {kind: equilibrium, at: [0, 0], input: [0]}\ntube: {epsilon: 0.6, rho_a: 0.1}\n"
        "metric: {rate: 1.74, dual_metric: [[4, -1], [-1, 4]]}\n"
    )
    (tmp_path / "one.yaml").write_text(text)
    done = run("simulate", tmp_path / "one.yaml", option, "3")
    assert done.exit_code == 2
    assert "TC708" in done.output
    assert "not a family" in done.output
