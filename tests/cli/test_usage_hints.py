"""What is said to a command line, or to a file, that means something else."""

import json
from pathlib import Path

import pytest
from commands import run
from mistakes import GOOD

from tubecert.cli.app import start


def said(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> str:
    monkeypatch.setattr("sys.argv", ["tubecert", *words])
    assert start() == 2
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("certify", "a.yaml", "--omega", "3"), "omega is --bandwidth"),
        (("certify", "a.yaml", "--Gamma", "3"), "Gamma is --adaptation-rate"),
        (("certify", "a.yaml", "-rho-a", "0.1"), "begin with two dashes: --rho-a"),
        (("certify", "a.yaml", "-epsilon=0.1"), "begin with two dashes: --epsilon"),
        (("certify", "a.yaml", "b.yaml"), "one specification at a time"),
        (("certify", "a.yaml", "--bandwidth", "10", "rad/s"), "leave rad/s out"),
        (("certify", "a.yaml", "--rate", "1"), "tubecert synth --rate"),
        (("certify", "-"), "nothing is read from stdin"),
        (("certify", "a.yaml", "--conditions", "D"), "'--conditions': 'D' is not one of"),
        (("synth", "a.yaml", "--degree", "3.5"), "--degree: error TC112: 3.5 is not a whole number"),
        (("synth", "a.yaml", "--degree", "-2"), "--degree: error TC112: -2 is not 0 or more"),
        (("init", "plant"), "tubecert init plant.yaml"),
        (("recheck", "README.md"), "not JSON"),
    ],
)
def test_a_command_line_that_means_something_else(
    words: tuple[str, ...], hint: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert hint in said(capsys, monkeypatch, *words)


@pytest.mark.parametrize(("words", "hint"), [
    (("certify", "plant.yml"), "there is plant.yaml"),
    (("certify", "folder/plan.yaml"), "no such file or directory"),
    (("certify", "plant.yaml", "--metric", "plant.json"), "there is plant.metric.json"),
    (("certify", "plant.yaml"), "`tubecert synth plant.yaml` finds one; then `tubecert certify plant.yaml --metric"),
    (("verify", "plant.yaml"), "a metric file after the specification (tubecert synth finds one)"),
    (("report", "plant.yaml"), "`tubecert certify plant.yaml` writes one: plant.certificate.json"),
    (("recheck", "plant.yaml"), "`tubecert certify plant.yaml` writes one: plant.certificate.json"),
    (("recheck", "other.json"), "give a file that tubecert certify wrote"),
])  # fmt: skip
def test_a_file_that_is_another_one(
    words: tuple[str, ...],
    hint: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plant.yaml").write_text(GOOD[: GOOD.index("metric:")], "utf-8")
    Path("plant.metric.json").touch()
    assert hint in said(capsys, monkeypatch, *words)


def test_a_session_is_told_in_its_order() -> None:
    said = run("--help").stdout
    words = "init", "check", "certify", "report", "export"
    order = [said.index(f"  tubecert {word} robot.") for word in words]
    assert order == sorted(order)
    assert "robot.yaml --template machine\n" in said  # as the README leads


def test_nothing_is_guessed_of_an_option_of_one_letter(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "two dashes" not in said(capsys, monkeypatch, "certify", "a.yaml", "-z", "b-c")


@pytest.mark.parametrize(
    ("form", "what"), [("tubecert-certificate/3", "a certificate"), ("tubecert-metric/1", "a metric file")]
)
def test_another_file_of_ours_is_named(tmp_path: Path, form: str, what: str) -> None:
    path = tmp_path / "file.json"
    path.write_text(json.dumps({"format": form, "result": {}}, indent=1))
    result = run("certify", path)
    assert result.exit_code == 2
    assert f"this is {what}, not a specification" in result.stderr
    assert result.stderr.count("error TC") == 1
