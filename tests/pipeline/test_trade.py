"""What a tube asks of a machine: every offer is a certificate that rechecks, and a little more is not certified."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rechecked import examine, failing
from systems import SCALAR
from typer.testing import CliRunner

from tubecert import certificate
from tubecert.cli.app import app
from tubecert.pipeline import Options, certify, design, sensitivities, trade
from tubecert.pipeline.width import Measure
from tubecert.spec import Setting, load_text
from tubecert.spec.load import load_source
from tubecert.spec.source import read_source
from tubecert.verdict import Verdict


def run(*arguments):
    words = ["design", "--no-progress", *map(str, arguments)]
    return CliRunner().invoke(app, words, catch_exceptions=False)


def written(path, text=SCALAR):
    Path(path).write_text(text, encoding="utf-8")
    return path


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_the_cheapest_machine_is_proven_for_the_tube_that_was_asked_for(tmp_path):
    spec, target = written(tmp_path / "s.yaml"), tmp_path / "d.json"
    done = run(spec, "--corridor", "0.4", "--set", "hardware.rate=100", "-o", target, "--json")
    assert done.exit_code == 0, done.output
    offers = {each["part"]: each for each in json.loads(done.stdout)}
    assert list(offers) == ["sample_time", "delay", "noise"]
    for part, each in offers.items():
        found = json.loads(Path(each["certificate"]).read_text(encoding="utf-8"))
        assert failing(examine(found)) == []
        own = found["result"]["hardware"]
        assert Fraction(str(own[part])) == Fraction(each["largest"])
        assert own["half_widths"]["x"] <= 0.4
        # it belongs to the file, with what was set
        read = CliRunner().invoke(app, ["recheck", each["certificate"], "--spec", str(spec), "--no-progress"])
        assert read.exit_code == 0, read.output
    more = Fraction(offers["delay"]["largest"]) * Fraction(21, 20)
    tube = {
        "epsilon: 0.5": "epsilon: 0.2",
        "rho_a: 0.5": "rho_a: 0.2",
        "rate: 200": f"rate: 100, delay: {more}",
    }
    text = SCALAR
    for old, new in tube.items():
        text = text.replace(old, new)
    assert more > Fraction(1, 100) or certify(load_text(text), Options()).verdict is Verdict.UNDECIDED


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_on_a_front_every_dot_is_a_certificate_and_a_wider_tube_allows_more(tmp_path, monkeypatch):
    monkeypatch.setattr(trade, "_FARTHEST", 1)
    spec, target = written(tmp_path / "s.yaml"), tmp_path / "f.json"
    done = run(spec, "--pareto", "tube,hardware.rate", "-o", target, "--json")
    assert done.exit_code == 0, done.output
    front = [each for each in json.loads(done.stdout) if each["on_front"]]
    assert len(front) > 1
    assert [each["size"] for each in front] == sorted(each["size"] for each in front)
    times = [Fraction(each["largest"]) for each in front]
    assert all(a < b for a, b in pairwise(times))
    last = json.loads(Path(front[-1]["certificate"]).read_text(encoding="utf-8"))
    assert failing(examine(last)) == []
    assert (tmp_path / "f.csv").read_text(encoding="utf-8").count("\n") == len(front) + 1
    assert "<svg" in (tmp_path / "f.svg").read_text(encoding="utf-8")


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_sensitivities_are_told_and_their_settings_give_the_tube_again(tmp_path, monkeypatch):
    for name in ("_FARTHEST", "_NARROWINGS"):
        monkeypatch.setattr(design, name, 0)
    monkeypatch.setattr(sensitivities, "_NARROWINGS", 0)
    spec = written(tmp_path / "s.yaml", SCALAR.replace("0.001", "0.05"))
    done = run(spec, "--sensitivities", "--json", "-o", tmp_path / "d.json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    buys = {(each["part"], each["gone"]): each for each in told["sensitivities"]}
    assert list(buys) == [(part, gone) for part in ("sample_time", "noise") for gone in (False, True)]
    quiet = buys["noise", True]
    assert quiet["size"] < buys["noise", False]["size"] < told["attempts"][0]["size"]
    scale = float(Fraction(quiet["scale"])) / 2
    settings = [*quiet["settings"], f"tube.epsilon={scale}", f"tube.rho_a={scale}"]
    again = load_source(read_source(str(spec)), [Setting.of(each) for each in settings])
    assert design.size_of(certify(again, Options()), Measure(units={})) == quiet["size"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--pareto", "tube"), "no pair of quantities"),
        (("--pareto", "tube,hardware.weight"), "no pair of quantities"),
        (("--pareto", "tube,disturbance.bound"), "no single number of this machine"),
        (("--corridor", "1", "--pareto", "tube,hardware.rate"), "give one of the two"),
        (("--corridor", "y=0.2"), "y"),
        (("--corridor", "x="), "no list STATE=WIDTH"),
        (("--corridor", "-1"), "not positive"),
        (("--corridor", "1", "--sensitivities"), "those of the narrowest tube"),
        (("--corridor", "x=0.2", "--set", "hardware.sample_time=largest"), "a rate and a sample time"),
    ],
)
def test_what_cannot_be_asked_is_refused(tmp_path, arguments, says):
    done = run(written(tmp_path / "s.yaml"), *arguments, "-o", tmp_path / "x.json")
    assert done.exit_code == 2, done.output
    assert says in done.output
    assert not (tmp_path / "x.json").exists()


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
@settings(max_examples=1, deadline=None)
@given(
    rate=st.sampled_from([1, 5, 30, 200, 1000]),
    share=st.sampled_from([Fraction(0), Fraction(1, 2), Fraction(1)]),
    noise=st.sampled_from([Fraction(0), Fraction(1, 1000), Fraction(1, 20)]),
)
def test_a_design_for_any_machine_certifies_again_and_rechecks(rate, share, noise):
    machine = f"rate: {rate}, delay: {share / rate}, noise: {noise}"
    spec = load_text(SCALAR.replace("rate: 200, noise: 0.001", machine))

    def at(scale):
        return load_text(spec_text(machine, scale))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(design, "_FARTHEST", 1)
        patch.setattr(design, "_NARROWINGS", 0)
        found = design.narrowest(at, Options(), Measure(units={}))
    proven = [each for each in found.attempts if each.size is not None]
    if found.best is None:
        assert all(each.result.verdict is not Verdict.CERTIFIED for each in found.attempts)
        assert certify(spec, Options()).verdict is not Verdict.CERTIFIED
        return
    assert found.best.size == min(each.size for each in proven)
    again = certify(at(found.best.scale), Options()).to_json()
    assert again == found.best.result.to_json()
    sealed = json.loads(certificate.dump(certificate.seal(again, {})))
    assert failing(examine(sealed)) == []


def spec_text(machine, scale):
    """The system with a machine, in a tube so many times as wide."""
    size = f"epsilon: {scale / 2}, rho_a: {scale / 2}"
    return SCALAR.replace("rate: 200, noise: 0.001", machine).replace("epsilon: 0.5, rho_a: 0.5", size)
