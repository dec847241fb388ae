"""What an installation without the extra `simulate` can do, and what it says of the rest."""

import importlib.util
import subprocess
import sys
import tomllib

import pytest
from commands import run
from systems import SMALL
from texts import ROOT

from tubecert.library.simulating import EXTRA

ORBIT = ROOT / "configs" / "two_state_orbit.yaml"
WITHOUT = f"import sys\nsys.modules[{EXTRA!r}] = None\nfrom tubecert.cli import main\nmain()"


def test_the_extra_is_what_the_command_needs():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {line.split(">")[0] for line in project["optional-dependencies"]["simulate"]}
    assert declared == {EXTRA}


def test_without_it_simulate_says_how_to_install_it(monkeypatch, tmp_path):
    honest = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == EXTRA else honest(name, *rest)
    )
    done = run("simulate", ORBIT, "-o", tmp_path / "out")
    assert done.exit_code == 2
    assert "error TC122: simulate needs matplotlib" in done.stderr
    assert "pip install 'tubecert[simulate]'" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_without_it_everything_else_works(tmp_path):
    spec, target, page = (tmp_path / f"small.{ending}" for ending in ("yaml", "json", "html"))
    spec.write_text(SMALL)
    for command in (
        ["certify", spec, "-q", "-o", target, "--report", page],
        ["check", spec, "--no-cache"],
        ["recheck", target],
        ["synth", spec, "--rate", "0.8", "-q", "-o", tmp_path / "metric.json"],
    ):
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT, *map(str, command)],
            capture_output=True,
            text=True,
            timeout=250,
            check=False,
            cwd=tmp_path,
        )
        assert done.returncode == 0, (command, done.stderr)
    assert page.exists()
