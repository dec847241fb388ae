"""docs/library.md, followed to the letter: its code in its order, and what it prints."""

import re
from pathlib import Path

import pytest
import yaml
from test_blocks import numbers, shape

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "library.md").read_text("utf-8")
BLOCKS = re.findall(r"```(python|text)\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_page(tmp_path, monkeypatch, capsys):
    import matplotlib as mpl

    mpl.use("agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    said = ""
    for kind, text in BLOCKS:
        if kind == "python":
            exec(compile(text, "docs/library.md", "exec"), names)
            said = capsys.readouterr().out
        else:
            assert [*map(shape, said.splitlines())] == [*map(shape, text.splitlines())], said
            assert numbers(said) == pytest.approx(numbers(text), rel=0.05, abs=1e-3), said
    written = {path.name for path in tmp_path.iterdir()}
    assert {"stage.png", "stage.html", "stage.certificate.json", "stage.simulation"} <= written
    assert names["again"].confirmed
    mpl.pyplot.close("all")


def test_the_system_is_in_none_of_the_configs():
    found = {yaml.safe_load(path.read_text("utf-8"))["name"] for path in (ROOT / "configs").glob("*.yaml")}
    assert "stage" not in found


def test_every_function_is_on_the_page():
    import tubecert as tc

    for name in tc.__all__:
        if callable(getattr(tc, name)) and name.islower():
            assert f"`tc.{name}(" in PAGE, name
