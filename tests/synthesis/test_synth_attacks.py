"""Attacks on synthesis: what is written was proven as written, what is refuted is impossible, no input is destroyed."""

import json
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import fractions
from systems import plain_model as model
from systems import values

from tubecert import pipeline
from tubecert.claims.advice import LowerDegree
from tubecert.claims.failures import NotProvenAsWritten, NotWritable, RankUnproven
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import scan
from tubecert.metric.verify import verify_metric
from tubecert.model import build
from tubecert.pipeline import Listeners, Options, synthesis, synthesised
from tubecert.spec import Synthesis, load_text
from tubecert.synthesis.coefficients import with_metric_file
from tubecert.synthesis.diagnose import uncontrollable_mode

QUICK = settings(max_examples=30, deadline=None)


def synth(*arguments):
    return run("synth", *arguments)


def certify(*arguments):
    return run("certify", *arguments)


SPEC = """tubecert: 1
name: small
system:
  states: [x, y]
  inputs: [u]
  f: ["-x + y**2/8", "x*y"]
  B: [["0"], ["1"]]
safe_set: {x: [-0.3, 0.3], y: [-0.25, 0.25]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], horizon: 1}
initial_state: {at: [0, 0]}
METRIC
tube: {epsilon: 0.05, rho_a: 0.05}
"""


def small(metric="metric: {synthesise: {rate: 0.5, degree: 0}}"):
    return SPEC.replace("METRIC", metric)


def at_origin(system, rate):
    return uncontrollable_mode(system, [(Fraction(0),) * len(system.states)], Fraction(rate))


def test_the_rate_of_the_mode_itself_is_not_refuted():
    """x' = -x without an input has W = 1 and C2 with equality at rate 1: no proof has room, no refutation is true."""
    system = model("xy", ["-x", "0"], [["0"], ["1"]])
    assert at_origin(system, Fraction(999_999_999, 10**9)) is None
    here, above = at_origin(system, 1), at_origin(system, Fraction(10**9 + 1, 10**9))
    assert not here.excludes(Fraction(1))
    assert above.excludes(Fraction(10**9 + 1, 10**9))
    assert above.limit == 1
    wanted = Synthesis(rate=Fraction(1), objective="condition", degree=0)
    found = pipeline.synthesise(load_text(small()), wanted, Options())
    assert found.verdict == "undecided"
    assert found.reason.claim.failure.limit == 1
    found = pipeline.synthesise(load_text(small()), replace(wanted, rate=Fraction("1.0001")), Options())
    assert found.verdict == "refuted"


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_repeated_modes_are_bounded_truly(order):
    """Eigenvalues of a Jordan block come with errors of 1e-4 and more; the bound that is named must be one."""
    names = [f"v{i}" for i in range(order)]
    chain = [f"-{a} + {b}" for a, b in pairwise(names)] + [f"-{names[-1]}"]
    system = model([*names, "w"], [*chain, "0"], [*([["0"]] * order), ["1"]])
    for rate in (Fraction("1.00000001"), Fraction("1.01"), Fraction(2)):
        mode = at_origin(system, rate)
        assert 1 <= mode.limit <= rate
        assert mode.failure().limit == mode.limit
        if rate > Fraction("1.005"):
            assert mode.excludes(rate)
            assert mode.limit < Fraction("1.005")
    assert at_origin(system, Fraction("0.99999999")) is None


@pytest.mark.slow
@given(entries=st.lists(st.integers(-3, 3), min_size=9, max_size=9), rate=fractions(-4, 4, 9))
@QUICK
def test_what_is_excluded_is_excluded_by_a_mode_that_no_input_reaches(entries, rate):
    """Against eigenvalues of the uncontrollable part, in coordinates that hide it."""
    A = np.array(entries).reshape(3, 3)
    A[2, :2] = 0  # z is reached by nothing
    T = np.array([[1, 0, 2], [1, 1, 0], [0, 1, 1]])
    inverse = np.round(np.linalg.inv(T) * 3).astype(int)  # det T = 3
    moved = T @ A @ inverse
    f = [" + ".join(f"({v}/3)*{name}" for v, name in zip(row, "xyz", strict=True)) for row in moved]
    B = T[:, 0]
    system = model("xyz", f, [[str(b)] for b in B])
    reached = np.column_stack([B, moved / 3 @ B, moved / 3 @ moved / 3 @ B])
    u, s, _ = np.linalg.svd(reached)
    Z = u[:, np.sum(s > 1e-9) :].T
    slowest = np.linalg.eigvals(Z @ (moved / 3) @ np.linalg.pinv(Z)).real.max()
    mode = at_origin(system, rate)
    if rate > -slowest + 1e-6:
        assert mode.excludes(rate)
        assert -slowest - 1e-5 <= mode.bound <= -slowest + 1e-4 * (1 + abs(slowest))
    elif rate < -slowest - 1e-6:
        assert mode is None


def test_a_forced_equilibrium_with_a_moving_input_direction():
    """A = f_x + u b_x there: x' = x - x u is held at 0 by u = 2, where its mode is 1 - 2 = -1 and not 1."""
    moving = model("xy", ["x", "-2"], [["-x"], ["1"]])
    found = at_origin(moving, 3)
    assert found.limit == 1
    assert at_origin(moving, Fraction(1, 2)) is None
    fixed = model("xy", ["x", "-2"], [["x**2"], ["1"]])
    assert at_origin(fixed, Fraction(1, 2)).limit == -1


def test_numbers_beyond_floats_are_passed_over():
    """A mode of 1e300 is one, a mode of 1e400 has no float: neither is a crash."""
    for factor, found in (("1e300", True), ("1e200*1e200", False)):
        system = model("xy", [f"{factor}*x", "0"], [["0"], ["1"]])
        mode = at_origin(system, 1)
        assert (mode is not None and mode.excludes(Fraction(1))) == found


@pytest.mark.slow
def test_a_lost_rank_is_named_with_its_point():
    text = small().replace('[["0"], ["1"]]', '[["0"], ["y"]]')
    found = pipeline.synthesise(
        load_text(text), Synthesis(rate=Fraction(1, 2), objective="condition"), Options()
    )
    assert found.verdict == "refuted"
    assert isinstance(found.reason.claim.failure, RankUnproven)
    assert found.reason.at is not None


WISHES = {
    "condition": Synthesis(rate=Fraction(1, 2), objective="condition", degree=0),
    "a rate that is no decimal": Synthesis(rate=Fraction(1, 3), objective="condition", degree=0),
    "margin": Synthesis(rate=Fraction(1, 2), objective="margin", degree=0, condition_number=Fraction(3)),
    "moving": Synthesis(rate=Fraction(1, 2), objective="condition", degree=2, variables=("x",)),
    "rate": Synthesis(rate=None, objective="rate", degree=0, condition_number=Fraction(2)),
}


def sampled(spec, count=4000):
    """Largest rate, least and largest eigenvalue of W by sampling, from the texts of the metric alone."""
    system = build(spec)
    lo, hi = (np.array([float(side[k]) for side in spec.safe_set]) for k in (0, 1))
    points = lo + np.random.default_rng(0).uniform(0, 1, (count, len(lo))) * (hi - lo)
    W, F = (values(rows, spec.states, points) for rows in (system.W, system.drift_form))
    eigenvalues = np.linalg.eigvalsh(W)
    # B = (0, 1)': the null space is x
    return (-0.5 * F[:, 0, 0] / W[:, 0, 0]).min(), eigenvalues[:, 0].min(), eigenvalues[:, -1].max()


@pytest.mark.slow
@pytest.mark.parametrize("name", WISHES)
def test_the_file_says_what_is_true_of_what_it_holds(name, tmp_path):
    wanted = WISHES[name]
    spec = load_text(small())
    found = pipeline.synthesise(spec, wanted, Options())
    assert found.verdict == "certified"
    target = tmp_path / "m.json"
    file = found.file.to_json()
    target.write_text(json.dumps(file))
    again = with_metric_file(spec, str(target))
    assert build(again).W == build(found.spec).W
    assert again.metric.rate == found.spec.metric.rate
    assert wanted.rate in (None, again.metric.rate)
    assert again.safe_set == spec.safe_set
    assert file["verified_on"] == {"x": [-0.3, 0.3], "y": [-0.25, 0.25]}
    proof = verify_metric(build(again), again.safe_set, Effort())
    assert proof.verdict == "certified"
    low, high = file["margin"]
    rate = float(again.metric.rate)
    true, least, most = sampled(again)
    assert 0 < low <= true - rate + 1e-9
    assert true - rate <= high + 0.02 * (1 + high)
    for key, value in (("lower", 1 / most), ("upper", 1 / least)):
        assert file[key][0] <= file[key][1]
        assert file[key][0] <= value * 1.001
    assert file["lower"][0] <= 1 / most * (1 + 1e-9)
    assert file["upper"][1] >= 1 / least * (1 - 1e-9)
    assert file["condition_number"][1] >= most / least * (1 - 1e-9)
    assert file["condition_number"][0] <= most / least * 1.01
    if wanted.condition_number is not None:
        assert file["condition_number"][1] <= wanted.condition_number


@pytest.mark.slow
def test_the_greatest_margin_falls_back_on_the_metric_at_the_rate(monkeypatch):
    """A metric of a larger rate whose second proof fails is not the end."""
    run = synthesis.SynthesisRun(load_text(small()), WISHES["margin"], Options(), Listeners())
    monkeypatch.setattr(synthesis.SynthesisRun, "_at_rate", lambda self, metric, rate: None)
    found = run.run(table=False)
    assert found.verdict == "certified"
    assert found.file.rate == Fraction(1, 2)


def test_a_metric_too_long_to_be_read_is_not_written(monkeypatch):
    spec = load_text(small())
    monkeypatch.setattr(scan, "MAX_LENGTH", 1)
    found = pipeline.synthesise(spec, WISHES["condition"], Options())
    assert found.verdict == "undecided"
    assert found.file is None
    assert found.reason.claim.failure == NotWritable(code="TC102")
    assert found.reason.relax == (LowerDegree(),)


def test_what_reads_back_differently_is_proven_as_it_reads(monkeypatch):
    """A text that says less than the metric it stands for is caught by the proof of the text."""
    honest = synthesised._data

    def damaged(metric):
        data = honest(metric)
        data["dual_metric"] = [["1", "0.999999"], ["0.999999", "-1"]]
        return data

    monkeypatch.setattr(synthesised, "_data", damaged)
    found = pipeline.synthesise(load_text(small()), WISHES["condition"], Options())
    assert found.verdict == "undecided"
    assert found.file is None
    assert isinstance(found.reason.claim.failure, NotProvenAsWritten)


@pytest.mark.slow
def test_a_certificate_of_a_synthesised_metric_is_consistent(tmp_path):
    spec = tmp_path / "own.yaml"
    spec.write_text(small())
    target = tmp_path / "own.certificate.json"
    done = certify(spec, "-o", target)
    assert done.exit_code in (0, 1, 4), done.output
    assert str(tmp_path / "own.metric.json") in done.output
    written = json.loads(target.read_text())
    result, search = written["result"], written["notes"]["synthesis"]["search"]
    kept = json.loads((tmp_path / "own.metric.json").read_text())
    metric = result["metric"]
    assert metric["verdict"] == "certified"
    for key in ("rate", "dual_metric", "margin"):
        assert kept[key] == metric[key]
    assert kept["lower"] == metric["lower_on_set"]
    assert kept["upper"] == metric["upper_on_set"]
    assert kept["verified_on"] == result["safe_set"]
    assert result["spec"]["effective"]["metric"]["dual_metric"] == kept["dual_metric"]
    assert search["rate"] == metric["rate"]
    assert kept["solver"] == search["solver"]
    assert "seconds" not in json.dumps(search)


def refuses(done, words):
    assert done.exit_code == 2, done.output
    assert "TC120" in done.output
    assert words in done.output
    assert "Traceback" not in done.output


def test_a_kept_metric_replaces_no_specification(tmp_path):
    spec = tmp_path / "arm.metric.json"  # YAML all the same
    spec.write_text(small())
    refuses(certify(spec, "-o", tmp_path / "arm.json"), "is the specification itself")
    assert spec.read_text() == small()


def test_a_kept_metric_replaces_nothing_written_by_hand(tmp_path):
    spec, hand, target = (tmp_path / f"arm.{end}" for end in ("yaml", "metric.json", "certificate.json"))
    spec.write_text(small())
    for text in ('{"format": "tubecert-metric/1", "rate": 1, "dual_metric": [["1"]]}', "no JSON", "[1]"):
        hand.write_text(text)
        refuses(certify(spec, "-o", target), "is no metric file that tubecert wrote")
        refuses(synth(spec, "-o", hand), "is no metric file that tubecert wrote")
        assert hand.read_text() == text
        assert not target.exists()
    hand.unlink()
    hand.mkdir()
    refuses(certify(spec, "-o", target), "it is a folder")
    assert not target.exists()


def test_no_certificate_or_metric_replaces_a_plan(tmp_path):
    spec, table = tmp_path / "arm.yaml", tmp_path / "plan.metric.json"
    rest = "{kind: equilibrium, at: [0, 0], horizon: 1}"
    spec.write_text(small().replace(rest, "{kind: csv, file: plan.metric.json}"))
    table.write_text("t,x,y,u\n0,0,0,0\n1,0,0,0\n")
    before = table.read_text()
    for command in (certify, synth):
        refuses(command(spec, "-o", table), "is the plan itself")
    refuses(certify(spec, "-o", tmp_path / "plan.json"), "is the plan itself")
    assert table.read_text() == before
