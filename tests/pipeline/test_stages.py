"""Stages are values that cannot exist unproven; what does not depend on a changed key is not computed again."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from tubecert.bounds.compute import Radius
from tubecert.pipeline import Memory, Options, certify, question_of
from tubecert.pipeline.certification import answer
from tubecert.spec import load, load_text
from tubecert.stages.bounded import Bounded
from tubecert.stages.judged import Judged
from tubecert.stages.metric import ProvenMetric
from tubecert.stages.question import Stopped
from tubecert.stages.tube import TubeFound

CONFIGS = Path(__file__).parents[2] / "configs"
THREE = load(str(CONFIGS / "three_state.yaml"))
PLANNED = (CONFIGS / "two_state.yaml").read_text(encoding="utf-8").replace("  knots: 101", "  knots: 51")


def radii(epsilon, rho_a):
    return Options(epsilon=Fraction(epsilon), rho_a=Fraction(rho_a))


def test_other_radii_prove_neither_rank_nor_metric_again():
    memory = Memory()
    results = [
        certify(THREE, radii(e, r), memory=memory).to_json()
        for e, r in ((".01", ".01"), (".012", ".01"), (".01", ".02"))
    ]
    assert memory.computed == {"rank": 1, "metric": 1}
    for result, options in zip(results[1:], (radii(".012", ".01"), radii(".01", ".02")), strict=True):
        assert result == certify(THREE, options).to_json()  # and what is recalled changes nothing


def test_other_radii_plan_once(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    memory, spec = Memory(), load_text(PLANNED, "spec.yaml")
    for epsilon in (".6", ".5"):
        end = answer(question_of(spec, replace(radii(epsilon, ".1"), gap=Fraction(1, 4)), memory=memory))
        assert isinstance(end, Judged)
    assert memory.computed == {"rank": 1, "metric": 1, "plan": 1}


@pytest.mark.parametrize(
    "change",
    [
        ("rate: 0.9999", "rate: 0.99"),
        ("0.20365", "0.20366"),
        ("x1: [-0.1, 0.1]", "x1: [-0.1, 0.11]"),
        ("x1**2", "2*x1**2"),
    ],
)
def test_another_system_metric_or_set_is_proven_anew(change):
    memory = Memory()
    text = THREE.source
    assert change[0] in text
    for each in (text, text.replace(*change)):
        answer(question_of(load_text(each), Options(), memory=memory))
    assert memory.computed["metric"] == 2


def test_another_gap_or_budget_is_proven_anew():
    memory = Memory()
    for options in (Options(), Options(gap=Fraction(1, 50)), Options(budget=1_000_000)):
        answer(question_of(THREE, options, memory=memory))
    assert memory.computed["metric"] == 3


# --- no stage without its proof


@pytest.fixture(scope="module")
def judged():
    return answer(question_of(THREE, Options()))


def test_a_metric_that_is_not_proven_is_no_stage(judged):
    metric = judged.bounded.enclosed.tube.planned.metric
    end = answer(question_of(load_text(THREE.source.replace("rate: 0.9999", "rate: 1.01")), Options()))
    assert isinstance(end, Stopped)
    with pytest.raises(ValueError, match="not proven"):
        ProvenMetric(question=metric.question, proof=end.partial, lower=metric.lower)


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
