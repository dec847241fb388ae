"""The command `simulate`: exit codes, files, bytes, and one clear message per mistake."""

import itertools
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from commands import run
from simulated import FLAT, certified, setting

from tubecert.certificate import dump, seal
from tubecert.executor import Processes, Serial
from tubecert.simulation.adaptive import campaign as campaigns
from tubecert.simulation.adaptive import engine
from tubecert.simulation.adaptive import figures as drawing
from tubecert.simulation.adaptive.campaign import cases
from tubecert.simulation.adaptive.setting import Choice, loop_of, setting_of

LOCATED = re.compile(r"(^|\n)(\S+:\d+:\d+: |--[a-z-]+: )?error TC\d{3}: ")


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch, request):
    """A folder with a specification and its certificate; figures, which take most of the time, only where marked."""
    monkeypatch.chdir(tmp_path)
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr(drawing, "figures", lambda campaign: iter(()))
    (tmp_path / "flat.yaml").write_text(FLAT)
    (tmp_path / "flat.json").write_text(dump(seal(certified("flat")[1].to_json(), {})))
    return tmp_path


def command(*more):
    return run("simulate", "flat.yaml", "--certificate", "flat.json", "--duration", "2", *more)


@pytest.fixture
def drawn():
    """Figures are wanted."""


@pytest.mark.slow
def test_a_campaign_that_finds_nothing(files, drawn):
    result = command("--runs", "8", "--controllers", "ccm,l1,reference")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("not falsified flat: ")
    assert not re.search(r"\b(verified|safe|certified that)\b", result.stdout)
    data = json.loads((files / "flat.simulation" / "summary.json").read_text())
    assert data["outcome"] == "not falsified"
    assert [loop["controller"] for loop in data["loops"]] == ["ccm", "l1", "reference"]
    assert [loop["covered"] for loop in data["loops"]] == [False, True, False]
    assert {attack["random"]["runs"] for attack in data["attacks"]} == {8}
    names = {path.name for path in (files / "flat.simulation").iterdir()}
    assert names == {"summary.json", "runs.npz", *(f"{name}.png" for name in drawing.DRAWERS)}
    with np.load(files / "flat.simulation" / "runs.npz") as data:
        arrays = dict(data)
    assert arrays["l1_x"].shape == (len(arrays["l1_t"]), 2)
    np.testing.assert_allclose(arrays["l1_u"], arrays["l1_u_plan"] + arrays["l1_k"] + arrays["l1_u_a"])
    assert arrays["l1_sample_largest_distance"].shape == (8,)


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes(files, drawn):
    for name in ("one", "two"):
        assert command("--runs", "3", "--controllers", "l1", "-o", name).exit_code == 0
    names = sorted(path.name for path in (files / "one").iterdir())
    assert names == sorted(path.name for path in (files / "two").iterdir())
    for name in names:
        assert (files / "one" / name).read_bytes() == (files / "two" / name).read_bytes(), name


@pytest.mark.slow
def test_json_and_quiet():
    data = json.loads(command("--runs", "0", "--json").stdout)
    assert data["format"] == "tubecert-simulation/1"
    assert data["attacks"] == []
    assert command("--runs", "0", "-q").stdout.count("\n") == 1


@pytest.mark.slow
def test_gains_that_are_far_too_small_leave_the_tube(files):
    text = FLAT.replace("0.2*sin(t)", "1.5*sin(t)").replace("epsilon: 0.2", "epsilon: 0.3")
    (files / "strong.yaml").write_text(text)
    result = run("simulate", "strong.yaml", "--bandwidth", "0.1", "--adaptation-rate", "1", "--runs", "4")
    assert result.exit_code == 1, result.output
    assert result.stdout.startswith("tube left flat: ")
    assert "chosen, not certified" in " ".join(result.stdout.split())
    assert "certifying first" in result.stderr
    assert (files / "strong.simulation" / "certificate.json").exists()


@pytest.mark.slow
def test_a_broken_promise_is_loud_and_can_be_replayed(files):
    """A certificate that promises too much: the tube is made ten times thinner than it was certified."""
    _, result = certified("flat")
    forged = result.to_json()
    forged["metric"]["lower"] = [value / 400 for value in forged["metric"]["lower"]]
    (files / "forged.json").write_text(dump(seal(forged, {})))
    result = run(
        "simulate", "flat.yaml", "--certificate", "forged.json", "--runs", "8", "--controllers", "l1"
    )
    assert result.exit_code == 1, result.output
    assert result.stdout.startswith("falsified flat: ")
    assert "\n  falsified l1, " in result.stdout
    assert re.search(r"t = \S+ s, (random run \d+|adversary|uncertainty)", result.stdout)
    number = re.search(r"--replay (\d+)", result.stdout)
    assert number is not None
    sample = json.loads((files / "flat.simulation" / "summary.json").read_text())["attacks"][0]["random"]
    named = {item["run"]: item["value"] for item in sample["violations"] if item["of"] == "tube"}
    again = run(
        "simulate", "flat.yaml", "--certificate", "forged.json", "--runs", "0", "--controllers", "l1",
        "--replay", next(iter(named)), "--json",
    )  # fmt: skip
    worst = json.loads(again.stdout)["loops"][0]["worst"]["distance"]["value"]
    assert worst == pytest.approx(next(iter(named.values())), rel=1e-3)


@pytest.fixture
def quick(monkeypatch):
    """No evolution: the first random adversary."""
    monkeypatch.setattr(campaigns, "worst", lambda where, loop, seed, *more: cases(where, seed, [0]))


@pytest.mark.slow
def test_runs_do_not_depend_on_how_many_there_are_and_how_they_are_grouped(monkeypatch, quick):
    where = setting("flat", duration="2")
    loops = [loop_of(where, "l1", Choice())]
    whole = campaigns.simulate(where, loops, count=7, seed=5).attacks[0].random.runs
    monkeypatch.setattr(campaigns, "LANES", 3)
    parts = campaigns.simulate(where, loops, count=5, seed=5).attacks[0].random.runs
    close = {"rtol": 0, "atol": 1e-12}  # BLAS sums in another order
    np.testing.assert_allclose(whole.x[:5], parts.x, **close)
    np.testing.assert_allclose(whole.found.peak.distance[:5], parts.found.peak.distance, **close)


@pytest.mark.slow
def test_processes_find_the_same(monkeypatch, quick):
    monkeypatch.setattr(campaigns, "LANES", 2)
    where = setting("flat", duration="1")
    loops = [loop_of(where, "l1", Choice())]
    one, two = (
        campaigns.simulate(where, loops, count=5, seed=5, executor=each).attacks[0].random.runs
        for each in (Serial(), Processes(2))
    )
    np.testing.assert_array_equal(one.x, two.x)
    np.testing.assert_array_equal(one.found.peak.distance, two.found.peak.distance)


def interrupted_at(monkeypatch, call):
    """The engine is interrupted when it is called for the so-manieth time."""
    real, calls = engine.integrate, []

    def integrate(*arguments, **options):
        calls.append(1)
        if len(calls) == call:
            raise KeyboardInterrupt
        return real(*arguments, **options)

    monkeypatch.setattr(campaigns, "integrate", integrate)


@pytest.mark.slow
@pytest.mark.parametrize(("call", "runs"), [(2, 2), (3, 4), (6, 9), (8, 9), (10, 9)])
def test_interruption_keeps_what_is_finished(files, monkeypatch, call, runs):
    """Of five vectors with two runs each, of the four rounds of the adversary, and of its own run."""
    monkeypatch.setattr(campaigns, "LANES", 2)
    monkeypatch.setattr(campaigns, "_POPULATION", 4)
    interrupted_at(monkeypatch, call)
    result = command("--runs", "9")
    assert result.exit_code == 130, result.output
    data = json.loads((files / "flat.simulation" / "summary.json").read_text())
    assert data["outcome"] == "interrupted"
    (found,) = data["attacks"]
    assert (found["random"]["runs"], found["random"]["asked"]) == (runs, 9)
    assert found.get("adversary") is None
    assert [loop["runs"] for loop in data["loops"]] == [1, 1]
    assert f"{runs} of 9" in result.stdout or runs == 9


@pytest.mark.slow
def test_an_interruption_before_anything_is_finished_leaves_nothing(files, monkeypatch):
    interrupted_at(monkeypatch, 1)
    assert command("--runs", "9").exit_code == 130
    assert not (files / "flat.simulation").exists()


@pytest.mark.slow
def test_who_interrupts_the_drawing_has_runs_and_summary_and_no_earlier_figures(files, monkeypatch, drawn):
    assert command("--runs", "0").exit_code == 0

    def figures(campaign):
        yield from itertools.islice(drawing.images(drawing.DRAWERS, campaign), 1)
        raise KeyboardInterrupt

    monkeypatch.setattr(drawing, "figures", figures)
    result = command("--runs", "0")
    assert result.exit_code == 0
    assert "flat.simulation: runs.npz, states.png, summary.json" in result.stdout
    names = {path.name for path in (files / "flat.simulation").iterdir()}
    assert names == {"runs.npz", "states.png", "summary.json"}


@pytest.mark.slow
def test_who_interrupts_while_data_are_compressed_has_them(files, monkeypatch):
    """They were lost: to compress takes longer than to store them as they are."""

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    assert command("--runs", "3", "--controllers", "l1").exit_code == 0
    with np.load(files / "flat.simulation" / "runs.npz") as data:
        assert data["l1_sample_largest_distance"].shape == (3,)


def test_a_folder_that_stays_empty_does_not_stay(files):
    assert command("--certificate", "none.json", "-o", "new").exit_code == 2
    assert not (files / "new").exists()


@pytest.mark.slow
def test_a_loop_that_cannot_be_resolved_is_no_result(monkeypatch):
    def coarse(batches, **options):
        error = np.full(1, 0.02 * setting("flat").rho)
        return [
            replace(each, found=each.found._replace(error=error))
            for each in engine.integrate(batches, **options)
        ]

    monkeypatch.setattr(campaigns, "integrate", coarse)
    result = command("--runs", "0")
    assert result.exit_code == 4, result.output
    assert result.stdout.startswith("no result flat: ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--controllers", "ccm,l2"], "is no controller"),
        (["--runs", "1.5"], "whole number"),
        (["--runs", "-3"], "-3 is not 0 or more"),
        (["--seed", "x"], "--seed"),
        (["--jobs", "0"], "--jobs"),
        (["--duration", "9"], "the plan ends at 4 s"),
        (["--certificate", "flat.yaml"], "`tubecert certify flat.yaml` writes one: flat.certificate.json"),
        (["--certificate", "none.json"], "cannot read"),
        (["-o", "flat.yaml"], "cannot write"),
        (["-o", "/proc/nothing"], "cannot write"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments, words):
    given = ["simulate", "flat.yaml", "--certificate", "flat.json", *arguments]
    result = run(*given)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert "Traceback" not in result.output
    assert LOCATED.search(result.stderr)
    assert words in result.stderr


def test_radii_belong_to_the_certificate():
    result = command("--epsilon", "0.3")
    assert result.exit_code == 2
    assert "a certificate has its own epsilon and rho_a" in result.output


@pytest.mark.slow
def test_an_uncertainty_outside_its_class_ends_the_command(files):
    (files / "flat.yaml").write_text(FLAT + 'simulation: {h: ["0.3*sin(t)"]}\n')
    result = command("--runs", "0", "--controllers", "l1")
    assert result.exit_code == 2, result.output
    assert "leaves the class" in result.stderr
    assert "flat.yaml:" in result.stderr


def test_without_a_tube_the_reason_is_told(files):
    (files / "wide.yaml").write_text(FLAT.replace("epsilon: 0.2", "epsilon: 20"))
    result = run("simulate", "wide.yaml")
    assert result.exit_code == 1, result.output
    assert "there is no tube" in result.stderr
    assert "leaves the safe set" in result.stderr


def test_a_metric_of_its_own(files):
    assert command("--metric", "w.json").exit_code == 2  # a certificate has one
    metric = {"format": "tubecert-metric/1", "rate": 0.1, "dual_metric": [["-1", "0"], ["0", "-1"]]}
    (files / "w.json").write_text(json.dumps(metric))
    result = run("simulate", "flat.yaml", "--metric", "w.json", "--runs", "0")
    assert result.exit_code == 1
    assert "metric" in result.output, result.output


def test_geodesics_are_cubic_where_the_metric_hardly_varies_over_the_tube():
    spec, result = certified("flat")
    degrees = []
    for share in (0.009, 0.011, np.inf):
        lower = result.metric.lower.below
        upper = replace(result.metric.upper, below=lower, above=lower * (1 + share))
        degrees.append(setting_of(spec, replace(result, metric=replace(result.metric, upper=upper))).degree)
    assert degrees == [3, 5, 5]
