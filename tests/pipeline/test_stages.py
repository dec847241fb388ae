"""Stages are values that cannot exist unproven; what does not depend on a changed key is not computed again."""

from dataclasses import fields, replace
from fractions import Fraction

import pytest
from systems import ONE
from texts import CONFIGS

from tubecert.bounds.compute import Radius
from tubecert.enclosure.interval import Interval
from tubecert.pipeline import Memory, Options, certification, certify, question_of
from tubecert.pipeline.certification import answer
from tubecert.spec import Setting, canonical, load, load_text
from tubecert.spec.load import load_source
from tubecert.spec.source import Source
from tubecert.stages.bounded import Bounded
from tubecert.stages.judged import Judged
from tubecert.stages.metric import ProvenMetric, prove_metric
from tubecert.stages.question import Stopped
from tubecert.stages.tube import TubeFound

THREE = load(str(CONFIGS / "three_state.yaml"))
PLANNED = (CONFIGS / "two_state.yaml").read_text(encoding="utf-8").replace("  knots: 101", "  knots: 26")


def radii(epsilon, rho_a):
    return Options(epsilon=Fraction(epsilon), rho_a=Fraction(rho_a), gap=Fraction(1, 4))


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_other_radii_prove_neither_rank_nor_metric_again():
    memory = Memory()
    results = [
        certify(THREE, radii(e, r), memory=memory).to_json()
        for e, r in ((".01", ".01"), (".012", ".01"), (".01", ".02"))
    ]
    assert (memory.computed["rank"], memory.computed["metric"], memory.computed["constants"]) == (1, 1, 3)
    for result, options in zip(results[1:], (radii(".012", ".01"), radii(".01", ".02")), strict=True):
        assert result == certify(THREE, options).to_json()  # and what is recalled changes nothing


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_other_radii_plan_once(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    memory, spec = Memory(), load_text(PLANNED, "spec.yaml")
    for epsilon in (".6", ".5"):
        end = answer(question_of(spec, radii(epsilon, ".1"), memory=memory))
        assert isinstance(end, Judged)
    names = "rank", "metric", "plan", "knots", "constants"
    assert [memory.computed[name] for name in names] == [1, 1, 1, 2, 2]


def set_in(text, *words):
    return load_source(Source.of("spec.yaml", text), [Setting.of(each) for each in words])


def bounded(spec, memory=None):
    """All stages but the last: to judge is most of the work, and nothing of it is remembered."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(certification, "judge", lambda stage: stage)
        end = answer(question_of(spec, Options(), memory=memory))
    assert isinstance(end, Bounded)
    return end


def numbers(stage):
    """All that the theorems are told."""
    told = {field.name: getattr(stage.problem, field.name) for field in fields(stage.problem)}
    ends = {name: (value.lo, value.hi) for name, value in told.items() if isinstance(value, Interval)}
    return told | ends, stage.half_widths, stage.clearances, stage.inputs


OVER_THE_TUBE = ("radius", "constants", "geodesics")


@pytest.mark.parametrize(("one", "other"), [
    ("adaptation.A_m=-1", "adaptation.A_m=-2"), ("conditions.decides=A", "conditions.decides=B"),
    ("limits.u=[-1, 1]", "limits.u=[-2, 1]"),
])  # fmt: skip
@pytest.mark.slow
def test_what_the_constants_do_not_rest_on_computes_none_again(one, other):
    memory = Memory()
    for words in (one, other):
        spec = set_in(ONE, words)
        found = bounded(spec, memory)
    assert numbers(found) == numbers(bounded(spec))
    assert [memory.computed[name] for name in OVER_THE_TUBE] == [1, 1, 1]


@pytest.mark.slow
@pytest.mark.parametrize("words", [
    "uncertainty.h[0]=0.1*cos(t)", "initial_state.at[0]=0.04", "tube.rho_a=0.2", "system.parameters.k=2",
    "metric.rate=0.4",
])  # fmt: skip
def test_what_they_rest_on_computes_them_again(words):
    memory = Memory()
    for settings in ((), (words,)):
        spec = set_in(ONE, *settings)
        found = bounded(spec, memory)
    assert numbers(found) == numbers(bounded(spec))
    assert [memory.computed[name] for name in OVER_THE_TUBE] == [2, 2, 2]


def test_only_sections_that_are_named_are_left_out_of_what_constants_rest_on():
    ground = question_of(set_in(ONE, "limits.u=[-1, 1]"), Options()).ground
    rest = {"name", "conditions", "adaptation", "limits", "expect", "simulation", "obstacles"}
    assert ground.keys() == canonical(set_in(ONE)).keys() - rest | {"gap", "budget"}


@pytest.mark.slow
def test_other_knots_of_a_file_are_another_plan(tmp_path):
    rows = "t,x,u\n0,0,0\n5,0,0\n10,{},0\n"
    text = ONE.replace("{kind: equilibrium, at: [0], horizon: 10}", "{kind: csv, file: plan.csv}")
    memory, found = Memory(), []
    for last in ("0", "0.01"):
        (tmp_path / "plan.csv").write_text(rows.format(last))
        spec = load_source(Source.of(str(tmp_path / "one.yaml"), text))
        found.append(certify(spec, Options(), memory=memory).to_json())
        assert found[-1] == certify(spec, Options()).to_json()
    assert found[0]["tube"] != found[1]["tube"] or found[0]["constants"] != found[1]["constants"]


@pytest.mark.slow
@pytest.mark.parametrize("change", [
    ("rate: 0.9999", "rate: 0.99"), ("0.20365", "0.20366"), ("x1: [-0.1, 0.1]", "x1: [-0.1, 0.11]"),
    ("x1**2", "2*x1**2"),
])  # fmt: skip
def test_another_system_metric_or_set_is_proven_anew(change):
    memory = Memory()
    text = THREE.source
    assert change[0] in text
    for each in (text, text.replace(*change)):
        prove_metric(question_of(load_text(each), Options(), memory=memory))
    assert memory.computed["metric"] == 2


@pytest.mark.slow
def test_another_gap_or_budget_is_proven_anew():
    memory = Memory()
    for options in (Options(), Options(gap=Fraction(1, 50)), Options(budget=1_000_000)):
        prove_metric(question_of(THREE, options, memory=memory))
    assert memory.computed["metric"] == 3


@pytest.fixture(scope="module")
def judged():
    return answer(question_of(THREE, Options()))


@pytest.mark.slow
def test_a_metric_that_is_not_proven_is_no_stage(judged):
    metric = judged.bounded.enclosed.tube.planned.metric
    end = answer(question_of(load_text(THREE.source.replace("rate: 0.9999", "rate: 1.01")), Options()))
    assert isinstance(end, Stopped)
    with pytest.raises(ValueError, match="not proven"):
        ProvenMetric(question=metric.question, proof=end.partial, lower=metric.lower)


@pytest.mark.slow
def test_a_tube_that_leaves_the_safe_set_is_no_stage(judged):
    end = answer(question_of(THREE, radii(".01", ".09")))
    assert isinstance(end, Stopped)
    assert isinstance(end.partial, Radius)
    tube = judged.bounded.enclosed.tube
    with pytest.raises(ValueError, match="not proven"):
        TubeFound(
            planned=tube.planned,
            rho=end.partial.rho,
            lower=tube.lower,
            upper=tube.upper,
            contained=end.partial.contained,
            radii=tube.radii,
        )


@pytest.mark.slow
def test_constants_without_a_bound_are_no_stage(judged):
    enclosed = judged.bounded.enclosed
    endless = replace(enclosed.constants.h, above=float("inf"))
    problem = replace(enclosed.problem, constants=replace(enclosed.constants, h=endless))
    with pytest.raises(ValueError, match="no bound"):
        Bounded(
            enclosed=replace(enclosed, problem=problem),
            half_widths=judged.bounded.half_widths,
            geodesics=judged.bounded.geodesics,
        )
