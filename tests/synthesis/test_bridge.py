"""Solvers through cvxpy: the same programs, the same answers; no warning, no breakdown and no lie gets through."""

import json
import re
import warnings

import cvxpy
import numpy as np
import pytest
from commands import run
from oracle import semidefinite
from systems import SMALL
from texts import ROOT

from tubecert import pipeline
from tubecert.errors import SpecError
from tubecert.spec import canonical, load_text
from tubecert.synthesis import conic
from tubecert.synthesis.conic import ConicProgram, solve

TWO = ROOT / "configs" / "two_state.yaml"
EIGENVALUE = ConicProgram(cost=np.ones(1), semidefinite=[semidefinite([[-1, -2], [-2, -1]], [np.eye(2)])])


def small(solver):
    return load_text(re.sub("metric: .*", f"metric: {{synthesise: {{rate: 0.5, solver: {solver}}}}}", SMALL))


def test_a_solver_without_multipliers_is_believed_as_far_as_its_tolerance(monkeypatch):
    monkeypatch.setattr(conic, "_bound", lambda *_: None)
    found = solve(EIGENVALUE, "cvxpy:CLARABEL", tolerance=1e-6)
    assert found.objective == pytest.approx(3, abs=1e-5)
    assert found.bound == pytest.approx(3, abs=1e-5)
    assert found.bound < found.objective


@pytest.mark.parametrize("kind", [UserWarning, FutureWarning, DeprecationWarning])
def test_warnings_stay_inside(monkeypatch, kind):
    honest = cvxpy.Problem.solve

    def warning(*given, **options):
        warnings.warn("Solution may be inaccurate.", kind, stacklevel=1)
        return honest(*given, **options)

    monkeypatch.setattr(cvxpy.Problem, "solve", warning)
    assert solve(EIGENVALUE, "cvxpy:CLARABEL").objective == pytest.approx(3, abs=1e-5)


@pytest.mark.parametrize(
    "error", [cvxpy.SolverError("no licence"), OSError("libfoo.so"), TypeError(), KeyError("x")]
)
def test_a_solver_that_breaks_down_has_no_solution(monkeypatch, error):
    def broken(*_, **__):
        raise error

    monkeypatch.setattr(cvxpy.Problem, "solve", broken)
    found = solve(EIGENVALUE, "cvxpy:CLARABEL")
    assert found.values is None
    assert found.feasible is None
    assert found.status.startswith("CLARABEL through cvxpy failed: ")


def test_inaccurate_is_said(monkeypatch):
    monkeypatch.setattr(cvxpy.Problem, "status", property(lambda _: cvxpy.OPTIMAL_INACCURATE))
    found = solve(EIGENVALUE, "cvxpy:CLARABEL")
    assert found.feasible
    assert "inaccurate" in found.status


@pytest.mark.parametrize(
    ("solver", "why"),
    [("cvxpy:NONESUCH", "is not installed"), ("cvxpy:OSQP", "does not solve semidefinite programs")],
)
def test_a_solver_that_is_not_there_is_refused_with_those_that_are(solver, why, tmp_path):
    target = tmp_path / "metric.json"
    done = run("synth", TWO, "--rate", "1.5", "--solver", solver, "-o", target)
    assert done.exit_code == 2
    assert f"error TC122: the solver {solver} cannot be used: {solver[6:]} {why}" in done.stderr
    assert "installed: cvxpy:CLARABEL, cvxpy:SCS; also: clarabel, scs" in " ".join(done.stderr.split())
    assert not target.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", ["cvxpy", "cvxpy:", "cvxpy:A B", "CVXPY:SCS", "mosek", "cvxpy:" + 40 * "A", ""]
)
def test_what_names_no_solver_is_refused(text):
    done = run("synth", TWO, "--rate", "1.5", "--solver", text)
    assert done.exit_code == 2
    assert "TC112" in done.stderr
    assert "cvxpy:NAME" in done.stderr


def test_the_specification_names_it_too():
    assert canonical(small("cvxpy:scs"))["metric"]["synthesise"]["solver"] == "cvxpy:SCS"
    with pytest.raises(SpecError, match="cvxpy:NONESUCH cannot be used"):
        pipeline.certify(small("cvxpy:NONESUCH"), pipeline.Options())


@pytest.mark.slow
def test_metrics_are_found_and_proven_as_ever(tmp_path):
    target = tmp_path / "metric.json"
    found = {}
    for solver in ("clarabel", "cvxpy:clarabel"):
        options = ["--rate", "1.7", "--solver", solver, "-o", str(target)]
        done = run("synth", TWO, *options)
        assert done.exit_code == 0, done.output
        found[solver] = json.loads(target.read_text())["condition_number"][1]
    assert found["cvxpy:clarabel"] == pytest.approx(found["clarabel"], rel=0.01)
