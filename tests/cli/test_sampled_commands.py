"""Commands on a specification with hardware: what is proven is stood in for by hand, but for one small loop."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import sampled
from commands import run

import tubecert
from tubecert.loop_design import certification
from tubecert.sampled_loop.record import Lack

TANK = """
tubecert: 1
name: tank
system: {states: [x], inputs: [u], f: [-3*x], B: [[1]]}
safe_set: {x: [-1, 1]}
trajectory: {kind: equilibrium, at: [0], input: [0]}
initial_state: {at: [0.1]}
hardware: {rate: 1}
controller: none
disturbance: {E: [[1]], bound: 0.3}
"""
EXPECT = "expect: {verdict: certified, half_widths: {p: [0.1, 0.2], v: [0, 0.1]}, inputs: [0, 0.4]}\n"
NARROW = "limits.F=[-2,2]"
OF_METRICS = {
    "conditions", "kernel", "kinds", "search", "stages", "pipeline", "metric", "synthesis", "tube", "bounds",
}  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cart.yaml").write_text(sampled.SPEC)


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    """What certifies, until a test puts something else in its place."""

    def certify(spec, report=None):
        lacks = [Lack(kind="inputs", where="F", needed=9.0, allowed=2.0)] if spec.limits[0][1][1] < 3 else []
        text = spec.source.replace("rate: 500", f"rate: {1 / spec.hardware.sample_time}")
        settings = dict(spec.settings)
        return sampled.undecided(*lacks, settings=settings) if lacks else sampled.certificate(text, settings)

    monkeypatch.setattr(certification, "certify", certify)


@pytest.mark.slow
def test_certify_writes_and_shows():
    done = run("certify", "cart.yaml", "--report", "cart.html")
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-5:] == [
        "  certificate cart.certificate.json",
        "  page        cart.html",
        "  next        tubecert recheck cart.certificate.json",
        "              tubecert simulate cart.yaml --certificate cart.certificate.json",
        "              tubecert export cart.certificate.json -o cart.controller",
    ]
    Path("wagon.yaml").write_text(sampled.SPEC)
    # named by their files, as the certificate is, not by their system
    next_one = "tubecert export wagon.certificate.json -o wagon.controller\n"
    assert run("certify", "wagon.yaml").stdout.endswith(next_one)
    assert json.loads(Path("cart.certificate.json").read_text())["format"] == "tubecert-sampled-loop/1"
    assert "<h1>cart" in Path("cart.html").read_text()
    assert len(run("certify", "cart.yaml", "-q").stdout.splitlines()) == 1
    assert "Assumed, not proven" in run("certify", "cart.yaml", "-v").stdout
    for asked in (["--json"], ["-o", "-"]):
        assert json.loads(run("certify", "cart.yaml", *asked).stdout)["result"]["verdict"] == "certified"


def test_undecided_is_told_by_the_exit_code_and_leads_nowhere():
    done = run("certify", "cart.yaml", "--set", NARROW)
    assert done.exit_code == 4
    assert done.stdout.startswith(
        "undecided cart: the input F has too little room: beside the plan it needs 9 N of 2 N"
    )
    assert "tubecert recheck" not in done.stdout
    assert "tubecert report cart.certificate.json" in done.stdout


def test_times_that_seem_to_be_in_ms_are_told_where_nothing_is_certified():
    rows = [f"{100 * k},{math.sin(k / 10):.9f},{math.cos(k / 10):.9f},0" for k in range(9)]
    Path("plan.csv").write_text("\n".join(["t,p,v,F", *rows]))
    own = sampled.SPEC.replace(sampled.POINT, "{kind: csv, file: plan.csv}").replace("[0.1, 0]", "[0, 1]")
    Path("cart.yaml").write_text(own.replace('[v, "-v"]', "[v, -p]"))
    done = run("certify", "cart.yaml", "--set", NARROW)
    assert "\n  plan        the times seem to be in ms: " in done.stdout


def test_all_that_is_about_a_metric_is_refused_at_once():
    given = dict.fromkeys(("rho-a", "epsilon", "budget", "bandwidth", "adaptation-rate"), "1")
    given |= {"gap": "0.1", "conditions": "B", "metric": "m.json"}
    done = run("certify", "cart.yaml", *(f"--{name}={value}" for name, value in given.items()))
    assert done.exit_code == 2
    for name in given:
        assert f"--{name}: error TC112: --{name} is about a certificate with a metric" in done.stderr
        assert f"leave --{name} out, or leave hardware out" in done.stderr
    for name, value in (("jobs", "2"), ("scheduler", "tcp://a:1")):
        done = run("certify", "cart.yaml", f"--{name}={value}")
        assert f"--{name}: error TC112: --{name} is about a long search; the sampled loop" in done.stderr
    assert not Path("cart.certificate.json").exists()


@pytest.mark.slow
def test_there_is_no_metric_to_be_found():
    done = run("synth", "cart.yaml")
    assert done.exit_code == 2
    assert "cart.yaml:8:11" in done.stderr
    assert "tubecert certify cart.yaml" in done.stderr


def test_check_compares_with_what_is_expected():
    narrow = sampled.SPEC.replace("[-8, 8]", "[-2, 2]")
    for text, code, told in (
        (sampled.SPEC + EXPECT, 1, "TC503: half_widths.v is 0.13201, expected: [0, 0.1]"),
        (sampled.SPEC + EXPECT.replace("0.1]}", "0.2]}"), 0, ""),
        (narrow, 4, "TC505: undecided: inputs: the input F has too little room"),
    ):
        Path("cart.yaml").write_text(text)
        done = run("check", "--certify", "--no-cache", "cart.yaml")
        assert done.exit_code == code
        assert done.stdout.count("TC5") == bool(code)
        assert told in done.stdout


def test_report_compare_and_recheck_know_it():
    run("certify", "cart.yaml")
    run("certify", "cart.yaml", "--set", "hardware.rate=400", "-o", "slow.json")
    assert run("report", "cart.certificate.json", "-o", "a.md").exit_code == 0
    assert "| p (m) | 0.1321 | 0.034 | 0.15 |" in Path("a.md").read_text()
    told = run("compare", "cart.certificate.json", "slow.json").stdout
    assert "half width of p" in told
    assert "hardware.sample_time" in told
    data = json.loads(run("compare", "cart.certificate.json", "slow.json", "--format", "json").stdout)
    assert data["quantities"]["half_width.p"] == [0.13201, 0.13201]


@pytest.mark.slow
def test_a_sampled_loop_has_a_deadline_as_a_command_has():
    assert run("certify", "cart.yaml", "--deadline", "100").exit_code == 0


@pytest.mark.slow
def test_a_certificate_of_another_file_is_told():
    from tubecert.library.rechecking import _specified

    run("certify", "cart.yaml")
    text = Path("cart.certificate.json").read_text()
    assert _specified(text, "it", "cart.yaml") == "belongs to cart.yaml"
    Path("cart.yaml").write_text(sampled.SPEC.replace("bound: 0.05", "bound: 0.06"))
    told = "TC604: it does not belong to cart.yaml: disturbance differ"
    with pytest.raises(tubecert.SpecError, match=told):
        _specified(text, "it", "cart.yaml")


@pytest.mark.slow
def test_sweep_keeps_one_for_every_point():
    asked = ("sweep", "cart.yaml", "--over", "hardware.rate=400,500")
    done = run(*asked, "-o", "s")
    assert done.exit_code == 0, done.output
    assert "2 certified" in done.stdout
    assert "verdict    half-widths, or what lacks" in done.stdout
    assert "p 0.1321, v 0.1321; in the long run p 0.034" in done.stdout
    assert "half-widths, or what lacks" in Path("s/sweep.html").read_text()
    rows = Path("s/table.csv").read_text().splitlines()
    assert "half_width.p" in rows[0]
    assert len(rows) == 3
    assert run(*asked, "-o", "s").stdout == done.stdout
    refused = run(*asked, "--conditions", "B", "-o", "t")
    assert refused.exit_code == 2
    assert "--conditions is about a certificate with a metric" in refused.stderr
    narrow = run(*asked, "--set", "limits.F=[-2,2]", "-o", "u").stdout
    assert "the input F has too little room" in " ".join(narrow.split())


@pytest.mark.slow
def test_a_swept_rate_is_drawn(monkeypatch):
    """A tube that is narrower at a higher rate: half-widths of both states in one figure, now and in the long run."""

    def certify(spec):
        text = spec.source.replace("rate: 500", f"rate: {1 / spec.hardware.sample_time}")
        scale, (own, *_) = spec.hardware.sample_time * 500, sampled.certificate().result.tube
        widths = {name: scale * width for name, width in own.half_widths.items()}
        stages = replace(own, half_widths=widths), replace(own, start=9, half_widths=widths)
        return sampled.certificate(text, dict(spec.settings), tube=stages)

    monkeypatch.setattr(certification, "certify", certify)
    run("sweep", "cart.yaml", "--over", "hardware.rate=200:500:4", "-o", "s")
    assert {"half_width.svg", "half_width_in_the_long_run.svg"} <= set(os.listdir("s/figures"))
    assert "half width of v" in Path("s/sweep.html").read_text()


@pytest.mark.slow
def test_a_small_loop_is_certified_and_no_room_of_metrics_is_loaded():
    """In a process of its own, from the command line to the page."""
    Path("tank.yaml").write_text(TANK)
    code = (
        "import sys; from tubecert.cli.app import app\n"
        "try: app(['certify', 'tank.yaml', '--report', 'tank.html', '--no-progress'])\n"
        "except SystemExit as end: print('exit', end.code)\n"
        "print(*sys.modules)"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(tubecert.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True, env=environment
    )
    said, _, modules = done.stdout.partition("exit 0")
    assert said.startswith("certified tank: ")
    assert "tubecert export" not in said  # there is no controller
    loaded = {name for name in modules.split() if name.startswith("tubecert.")}
    assert not {name for name in loaded if name.split(".")[1] in OF_METRICS}
    assert "tubecert.certificate.result" not in loaded
