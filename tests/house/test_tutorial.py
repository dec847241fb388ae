"""The tutorial, followed to the letter: its files, its commands in their order, its output."""

import json
import re
import shlex
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from tubecert.cli.app import app

ROOT = Path(__file__).parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text("utf-8")
# the rate that the search ends at; the metric is then that of the tutorial, which it rounds to fewer digits
LESS = {"tubecert synth arm.yaml": "tubecert synth arm.yaml --rate 6.96"}
BLOCKS = re.findall(r"```(yaml|sh|text)\n(.*?)```", TUTORIAL, re.DOTALL)


def shape(line: str) -> str:
    """A line without its numbers, which may differ in their last digits with other versions."""
    return re.sub(r"\s+", " ", re.sub(r"\d[\d.]*(e-?\d+)?", "#", line)).strip()


def numbers(line: str) -> list[float]:
    """The numbers of a line, but margins: what is left of a condition is next to nothing."""
    found = re.findall(r"(?<!margin )(?<![\w.])\d[\d.]*\d(?:e-?\d+)?(?! ?%|[\d.])", line)
    return [float(number) for number in found if number.count(".") < 2]


def told(line: str, real: list[str]) -> bool:
    """Whether a line of the tutorial is a line of the output, to a part in twenty of every number."""
    return any(
        shape(line) == shape(other) and numbers(line) == pytest.approx(numbers(other), rel=0.05)
        for other in real
    )


def found_metric() -> dict[str, object]:
    """The metric that the tutorial copies into its file, as a metric file."""
    text = next(text for kind, text in BLOCKS if kind == "yaml" and text.startswith("metric:"))
    metric = yaml.safe_load(text)["metric"]
    return {"format": "tubecert-metric/1", "rate": metric["rate"], "dual_metric": metric["dual_metric"]}


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_tutorial(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    said = ""
    for kind, text in BLOCKS:
        if kind == "yaml":
            with Path("arm.yaml").open("a", encoding="utf-8") as file:
                file.write(("\n" if file.tell() else "") + text)
        elif kind == "sh":
            program, *arguments = shlex.split(LESS.get(text.strip(), text))
            assert program == "tubecert"
            result = CliRunner().invoke(app, arguments, prog_name="tubecert")
            assert result.exit_code == 0, result.output
            said = result.stdout
            if text.strip() in LESS:
                Path("arm.metric.json").write_text(json.dumps(found_metric()), "utf-8")
        else:
            missing = [line for line in text.splitlines() if not told(line, said.splitlines())]
            assert not missing, (missing, said)
    assert {"arm.yaml", "arm.metric.json", "arm.certificate.json", "arm.html"} <= {
        p.name for p in tmp_path.iterdir()
    }


def test_the_example_is_in_none_of_the_configs():
    names = {yaml.safe_load(path.read_text("utf-8"))["name"] for path in (ROOT / "configs").glob("*.yaml")}
    assert "arm" not in names


def test_the_finding_that_it_shows_is_real(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = next(text for kind, text in BLOCKS if kind == "yaml")
    text, count = re.subn(r'  u: \["-J.*"\]', '  u: ["m*g*l*sin(0.6*sin(t))"]', text)
    assert count == 1
    Path("arm.yaml").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["check", "arm.yaml", "--no-cache", "--format", "text"])
    shown = TUTORIAL.split("it would have said\n\n")[1].split("\n\n")[0]
    expected = [line[4:] for line in shown.splitlines()]
    assert [shape(line) for line in expected] == [
        shape(line) for line in result.stdout.splitlines()[: len(expected)]
    ]
