"""A planner and a cache that lie: no plan is taken for what it is not."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.kept import kept_folder, seal, user_key
from tubecert.model import build
from tubecert.pipeline import Options, certify
from tubecert.planner import cache, ilqr
from tubecert.planner.propose import course_of, knots_of
from tubecert.spec import load_text
from tubecert.trajectory.make import MISS, Room, misses, plan_of, refusal

TEXT = (Path(__file__).parents[2] / "configs" / "two_state.yaml").read_text(encoding="utf-8")
SHORT = TEXT.replace("  knots: 101", "  knots: 16\n  start: [0.5, -0.3]").replace(
    "  horizon: 5 ", "  horizon: 2 "
)
SPEC = load_text(SHORT.replace("  at: [3.4, -2.4]", "  at: [0.5, -0.3]"), "spec.yaml")
TASK = SPEC.trajectory.task
MODEL = build(SPEC)
ORIGINAL = ilqr.plan
ROOM = Room(rho=Fraction(7, 10), lower=0.2008, effort=Effort())


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def knots():
    return knots_of(SPEC, course_of(SPEC, TASK, MODEL), MODEL, ROOM)


FOUND: dict[int, ilqr.Proposal] = {}


def found(dynamics, problem, *report):
    """What the planner honestly finds for SPEC, once for all lies about it: what it asks differs in its steps only."""
    if problem.substeps not in FOUND:
        FOUND[problem.substeps] = ORIGINAL(dynamics, problem, *report)
    return FOUND[problem.substeps]


def scaled(rows, factor):
    return tuple(tuple(value * factor for value in row) for row in rows)


LIES = {
    "ends elsewhere": lambda k: replace(k, x=(*k.x[:-1], (Fraction(1, 10), Fraction(0)))),
    "ends far away": lambda k: replace(k, u=scaled(k.u, 2), x=(*k.x[:-1], (Fraction(10**9), Fraction(0)))),
    "ends just beyond the tolerance": lambda k: replace(k, x=(*k.x[:-1], (Fraction(0), MISS * 1001 / 1000))),
    "begins elsewhere": lambda k: replace(k, x=((k.x[0][0] + Fraction(1, 10**9), k.x[0][1]), *k.x[1:])),
    "begins late": lambda k: replace(k, t=(k.t[0] + Fraction(1, 1000), *k.t[1:])),
    "ends early": lambda k: replace(k, t=k.t[:-1], x=(*k.x[:-2], k.x[-1]), u=k.u[:-1]),
    "goes back in time": lambda k: replace(k, t=(k.t[0], k.t[2], k.t[1], *k.t[3:])),
    "is linear, not held": lambda k: replace(k, interpolation="linear"),
    "lacks an input": lambda k: replace(k, u=tuple(() for _ in k.u)),
    "has no knots": lambda k: replace(k, t=(), x=(), u=()),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LIES)
def test_knots_that_are_not_the_plan_asked_for_are_refused(name, knots):
    assert refusal(SPEC, TASK, knots) is None
    with pytest.raises((SpecError, AssertionError)) as error:  # some cannot even be written down
        plan_of(SPEC, MODEL, LIES[name](knots))
    assert isinstance(error.value, AssertionError) or "TC4" in str(error.value)


@pytest.mark.slow
def test_a_plan_that_need_not_reach_its_target_may_end_elsewhere(knots):
    free = load_text(SHORT.replace("  goal: true", "  goal: false"), "spec.yaml")
    elsewhere = LIES["ends elsewhere"](knots)
    assert refusal(free, free.trajectory.task, elsewhere) is None


def test_a_miss_is_decided_exactly():
    task = replace(TASK, target=(Fraction(3), Fraction(4)))
    allowed = MISS * 6  # 1 + |target| = 6
    assert not misses(task, (3 + allowed, Fraction(4)))
    assert misses(task, (3 + allowed * (1 + Fraction(1, 10**9)), Fraction(4)))


@pytest.mark.slow
@pytest.mark.parametrize("factor", ["0.9", "1.01", "-1", "1e300"])
def test_inputs_of_the_cache_that_lead_elsewhere_are_planned_anew(factor, knots, monkeypatch):
    """An entry with a right seal: scaled by .9 it once was certified as a plan with a goal (R6)."""
    (path, *_) = sorted(kept_folder(cache.KIND).iterdir())
    for path in kept_folder(cache.KIND).iterdir():
        whole = json.loads(path.read_text(encoding="utf-8").partition("\n")[2])
        data = json.dumps([[str(float(Fraction(v) * Fraction(factor))) for v in row] for row in whole])
        mark = seal(user_key(), f"{cache.KIND}/{path.stem}", data.encode()).hex()
        path.write_text(f"{mark}\n{data}", encoding="utf-8")
    calls = []
    original = ilqr.plan
    monkeypatch.setattr(ilqr, "plan", lambda *a: calls.append(1) or original(*a))
    assert knots_of(SPEC, course_of(SPEC, TASK, MODEL), MODEL, ROOM) == knots
    assert calls


@pytest.mark.slow
@pytest.mark.parametrize(
    "lie",
    [
        lambda p: replace(p, u=0.9 * p.u),
        lambda p: replace(p, u=np.zeros_like(p.u)),
        lambda p: replace(p, u=p.u[::-1]),
    ],
    ids=["scaled", "nothing", "backwards"],
)
def test_a_planner_that_says_found_and_lies_certifies_nothing(lie, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(ilqr, "plan", lambda *a: lie(found(*a)))
    with pytest.raises(SpecError, match=r"TC40[12]"):
        certify(SPEC, Options(conditions="distance"))


@pytest.mark.slow
def test_few_knots_end_where_they_were_planned_to():
    """The planner's own steps were coarser than those of the curve, which then missed the target by 1.4."""
    few = load_text(TEXT.replace("  knots: 101", "  knots: 21"), "spec.yaml")
    found = knots_of(few, course_of(few, few.trajectory.task, MODEL), MODEL, ROOM)
    assert not misses(few.trajectory.task, found.x[-1])
