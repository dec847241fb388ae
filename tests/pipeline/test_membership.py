"""Plans and families of plans: a member keeps to the boxes between its knots as well, and to the defect."""

import json
from fractions import Fraction

import numpy as np
import pytest
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from proven import proven

from tubecert.enclosure.branch_and_bound import Supremum
from tubecert.findings import Severity
from tubecert.pipeline import membership as membership_of
from tubecert.pipeline.membership import member_spec, membership
from tubecert.spec import load_text

FAMILY = """
tubecert: 1
name: oscillator
system: {states: [p, v], inputs: [u], f: [v, -p], B: [[0], [1]]}
safe_set: {p: [-3, 3], v: [-3, 3]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: any, x: {p: [-1, 1], v: [-1.2, 1.2]}, u: {u: [-0.5, 0.5]}, defect: 0.05, horizon: 4}
initial_state: {within: 0.1}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.2, rho_a: 0.2}
"""


def with_plan(text, plan):
    """A family with a trajectory in place of its own."""
    return text.replace(text.split("trajectory: ")[1].split("\n", maxsplit=1)[0], plan)


def member(plan):
    """What is found of a plan that is written as a trajectory."""
    text = with_plan(FAMILY, plan).replace("{within: 0.1}", "{at: [0, 0]}")
    return membership(load_text(text), load_text(FAMILY), "it")


def codes(findings):
    return [(item.code, item.severity) for item in findings]


IS = [("TC411", Severity.NOTE)]


@pytest.mark.slow
@pytest.mark.parametrize(("plan", "words"), [
    ('{kind: expressions, x: ["0.9*sin(t)", "0.9*cos(t)"], u: ["0"], horizon: 4}', ""),
    ('{kind: expressions, x: ["0.9*sin(t)", "0.9*cos(t)"], u: ["0"], horizon: 5}', "lasts longer than the 4 s"),
    ('{kind: expressions, x: ["1.1*sin(t)", "1.1*cos(t)"], u: ["0"], horizon: 4}', "p* goes 0.1 beyond"),
    ('{kind: expressions, x: ["-1.1*sin(t)", "-1.1*cos(t)"], u: ["0"], horizon: 2}', "p* goes 0.1 beyond"),
    ('{kind: expressions, x: ["0.4*sin(2*t)", "0.8*cos(2*t)"], u: ["-1.2*sin(2*t)"], horizon: 2}', "u* goes 0.7"),
    ('{kind: expressions, x: ["0.9*sin(t)", "0.9*cos(t)"], u: ["0.06"], horizon: 4}', "up to 0.06"),
    ("{kind: equilibrium, at: [0.5, 0], input: [0.5], horizon: 4}", ""),
    ("{kind: equilibrium, at: [0.5, 0], input: [0.5]}", "lasts longer"),
    ("{kind: equilibrium, at: [0.6, 0], input: [0.6], horizon: 1}", "u* goes 0.1"),
])  # fmt: skip
def test_expressions(plan, words):
    findings = member(plan)
    if words:
        assert any(words in item.message for item in findings), findings
        assert {item.severity for item in findings} == {Severity.ERROR}
    else:
        assert codes(findings) == IS


def table(tmp_path, rows):
    path = tmp_path / "plan.csv"
    path.write_text("t,p,v,u\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    return path


def sampled(a, w, count):
    """Knots of p = a sin(w t) and its v, u; the defect between them is small."""
    t = np.linspace(0, 2, count)
    rows = np.stack([a * np.sin(w * t), a * w * np.cos(w * t), a * (1 - w * w) * np.sin(w * t)], axis=1)
    return [(f"{s:.6f}", *(f"{q:.9f}" for q in row)) for s, row in zip(t, rows, strict=True)]


@pytest.fixture
def family(tmp_path):
    (tmp_path / "any.yaml").write_text(FAMILY)
    return tmp_path / "any.yaml"


@pytest.mark.slow
def test_a_table_is_told_to_belong_or_why_not(tmp_path, family):
    done = run("check", "--family", family, table(tmp_path, sampled(0.9, 1.0, 41)))
    assert (done.exit_code, "is a plan of the family" in done.output) == (0, True), done.output
    wide = run("check", "--family", family, table(tmp_path, sampled(1.1, 1.0, 41)))
    assert (wide.exit_code, "p* goes" in wide.output) == (1, True), wide.output
    coarse = run("check", "--family", family, table(tmp_path, sampled(0.9, 1.0, 2)))
    assert (coarse.exit_code, "misses x' = f + B u" in coarse.output) == (1, True), coarse.output


def test_between_knots_a_curve_may_leave_what_its_knots_keep(tmp_path, family):
    """p = 0.99 at two knots, with slopes that carry it over 1 between them."""
    rows = [(0, 0.99, 0.4, 0), (0.5, 0.99, -0.4, 0)]
    done = run("check", "--family", family, table(tmp_path, rows))
    assert done.exit_code == 1
    assert "p* goes 0.04 beyond its range at t = 0.25 s" in done.output


def test_a_defect_of_nothing_is_decided_at_once(tmp_path, monkeypatch):
    """A plan at rest took 19 s to be undecided: of what is not exactly 0, closer bounds tell no more."""
    gaps, near = [], Supremum(below=0.0, above=1e-14, at={}, boxes=1, reached=True)
    monkeypatch.setattr(membership_of, "supremum", lambda *own: gaps.append(own[2].gap) or near)
    family = load_text(FAMILY.replace("-p]", "-sin(p)]").replace("0.05, h", "0, h"))
    own = member_spec(str(table(tmp_path, [(0, 0, 0, 0), (1, 0, 0, 0)])), family)
    assert (codes(membership(own, family, "it")), gaps) == (IS, [])
    own = member_spec(str(table(tmp_path, [(0, 0, 0, 0), (1, 0.1, 0, 0)])), family)
    assert codes(membership(own, family, "it")) == [("TC412", Severity.ERROR)]
    assert [gap for gap in gaps if gap > 1e-4] == [0.2]


MACHINE = FAMILY[: FAMILY.index("metric:")].replace("0.05, horizon", "5, horizon")
MACHINE += "hardware: {rate: 10, delay: 0.05}\n"
RATED = MACHINE.replace("defect: 5", "input_rate: 2, defect: 5")


@pytest.mark.parametrize(("family", "at", "how", "words"), [
    (MACHINE, (0.05, 0.25), "hold", ""),
    (MACHINE, (0.05, 0.2), "hold", "u* changes while an input is held"),
    (MACHINE, (0.05, 0.25), "linear", "u* changes while an input is held"),
    (RATED, (0.05, 0.25), "linear", ""),
    (RATED, (0.05, 0.15), "linear", "u*' goes 1 beyond its range"),
    (RATED, (0.05, 0.25), "hold", "u* jumps"),
])  # fmt: skip
def test_beside_hardware_inputs_move_as_the_family_says(tmp_path, family, at, how, words):
    """u* = .2 up to one time, .5 from another one on; its last value is that of the end."""
    rows = [(0, 0, 0, 0.2), (at[0], 0, 0, 0.2), (at[1], 0, 0, 0.5), (1, 0, 0, 0.5)]
    if how == "hold":
        rows[1:2] = []
    table(tmp_path, rows)
    own = f"{{kind: csv, file: plan.csv, interpolation: {how}}}"
    text = with_plan(MACHINE, own).replace("initial_state: {within: 0.1}\n", "")
    (found,) = membership(load_text(text, str(tmp_path / "own.yaml")), load_text(family), "it")
    assert (words or "is a plan of the family") in found.message
    (tmp_path / "any.yaml").write_text(MACHINE)
    told = run("check", "--family", tmp_path / "any.yaml", tmp_path / "plan.csv")
    assert told.exit_code == (1 if at[1] == 0.2 else 0)  # as a machine holds it


@pytest.mark.parametrize(("u", "belongs"), [("0", True), ("pi/100", True), ("0.01*t", False)])
def test_an_input_that_does_not_change_belongs_whatever_the_plan_does(u, belongs):
    """A formula that moves was refused for a u* that never changes."""
    plan = f'{{kind: expressions, x: ["0.1*sin(t)", "0.1*cos(t)"], u: ["{u}"], horizon: 1}}'
    text = with_plan(MACHINE, plan).replace("{within: 0.1}", "{at: [0, 0.1]}")
    found = membership(load_text(text), load_text(MACHINE), "it")
    assert any("u* changes while an input is held" in item.message for item in found) != belongs


@pytest.mark.parametrize(("after", "belongs"), [("nothing", True), ("rest", False), ("repeat", False)])
def test_a_plan_that_goes_on_after_its_horizon_is_proven_no_further(after, belongs):
    """It moves at t = 1, where the plant would have to stand still: the family has no such plan, and a defect of 0."""
    plan = '{kind: expressions, x: ["0.1*sin(t)", "0.1*cos(t)"], u: ["0*t"], horizon: 1, afterwards: AFTER}'
    family = load_text(RATED.replace("defect: 5", "defect: 0"))
    text = with_plan(RATED, plan.replace("AFTER", after))
    own = load_text(text.replace("{within: 0.1}", "{at: [0, 0.1]}"))
    (found,) = membership(own, family, "it")
    assert ("is a plan of the family" in found.message) == belongs
    assert ("goes on after its horizon" in found.message) != belongs


def test_the_last_input_of_a_held_plan_is_not_reached(tmp_path, family):
    table(tmp_path, [(0, 0.5, 0, 0.5), (1, 0.5, 0, 0.5), (2, 0.5, 0, 9)])
    plan = tmp_path / "held.yaml"
    own = with_plan(FAMILY, "{kind: csv, file: plan.csv, interpolation: HOW}")
    own = own.replace("initial_state: {within: 0.1}\n", "")
    plan.write_text(own.replace("HOW", "hold"))
    assert run("check", "--family", family, plan).exit_code == 0
    plan.write_text(own.replace("HOW", "linear"))
    done = run("check", "--family", family, plan)
    assert (done.exit_code, "u* goes 8.5" in done.output) == (1, True)


@pytest.mark.slow
@settings(deadline=None, max_examples=12)
@given(a=st.integers(1, 140), w=st.integers(5, 20))
def test_the_answer_is_that_of_dense_samples(a, w):
    """p = a sin(w t) and its derivatives, which satisfy the dynamics."""
    a, w = Fraction(a, 100), Fraction(w, 10)
    u = a * (1 - w * w)
    plan = f'{{kind: expressions, x: ["{a}*sin({w}*t)", "{a * w}*cos({w}*t)"], u: ["{u}*sin({w}*t)"], horizon: 4}}'
    t = np.linspace(0, 4, 4001)
    waves = np.abs(np.sin(float(w) * t)).max()
    room = min(1 - float(a) * waves, 1.2 - float(a * w), 0.5 - abs(float(u)) * waves)
    found = member(plan)
    if room > 1e-4:
        assert codes(found) == IS
    elif room < -1e-4:
        assert ("TC411", Severity.ERROR) in codes(found)  # beside what may be undecided
        assert IS[0] not in codes(found)


@pytest.mark.slow
def test_what_touches_the_end_of_a_box_is_not_said_to_leave_it():
    plan = '{kind: expressions, x: ["sin(t)", "cos(t)"], u: ["0"], horizon: 4}'
    assert all(item.code != "TC411" or item.severity is Severity.NOTE for item in member(plan))


def test_files_that_do_not_fit_are_told(tmp_path, family):
    other = tmp_path / "other.yaml"
    other.write_text(FAMILY.replace("f: [v, -p]", "f: [v, -2*p]"))
    done = run("check", "--family", family, other)
    assert (done.exit_code, "TC604" in done.output) == (2, True)
    assert run("check", "--family", family, family).exit_code == 2
    single = tmp_path / "one.yaml"
    single.write_text(with_plan(FAMILY, "{kind: equilibrium, at: [0, 0], horizon: 4}"))
    done = run("check", "--family", single, family)
    assert (done.exit_code, "is about one plan" in done.output) == (2, True)
    assert run("check", "--family", tmp_path / "none.json", family).exit_code == 2
    assert run("check", "--family", family, tmp_path / "none.csv").exit_code == 2


@pytest.mark.slow
def test_the_family_of_a_certificate(tmp_path):
    target = tmp_path / "any.certificate.json"
    target.write_text(json.dumps(proven(FAMILY, conditions="distance")))
    done = run("check", "--family", target, table(tmp_path, sampled(0.9, 1.0, 41)))
    assert done.exit_code == 0, done.output
