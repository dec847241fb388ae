"""`simulate` where a specification has hardware: the command and the call, with the exported C in the loop."""

import json
import shutil

import pytest
from commands import run
from loops import ABOUT, proven

import tubecert as tc
from tubecert.sampled_loop.record import Notes, certificate_text, seal
from tubecert.simulation.sampled import campaign

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("scalar", "pendulum"):
        (tmp_path / f"{name}.yaml").write_text(ABOUT[name][0])
        (tmp_path / f"{name}.json").write_text(certificate_text(seal(proven(name), Notes(), {})))
    return tmp_path


def test_a_campaign_in_twelve_lines_and_a_folder(files):
    found = run("simulate", "scalar.yaml", "--certificate", "scalar.json", "--runs", "5", "--seed", "3")
    assert found.exit_code == 0, found.output
    lines = found.stdout.splitlines()
    assert lines[0].startswith("not falsified scalar: 0 of ")
    assert "adversaries and 5 random runs over " in found.stdout
    assert ", proven: -" in found.stdout
    assert len(lines) <= 12
    data = json.loads((files / "scalar.simulation" / "summary.json").read_text())
    assert data["seed"] == 3
    assert data["controller"] == ("c" if shutil.which("cc") else "floats")
    assert 0.95 < data["states"]["x"]["adversary"]["share"] <= 1
    names = {path.name for path in (files / "scalar.simulation").iterdir()}
    assert names == {"summary.json", "runs.npz", "tube_use.png"}  # one state has no plane


def test_the_same_from_code_of_a_family(files):
    found = tc.simulate("pendulum.json", runs=20, duration=2)
    assert isinstance(found, tc.SampledSimulation)
    assert not found.falsified
    assert "<SampledSimulation: not falsified pendulum" in repr(found)
    assert "attained" in found._repr_html_()
    assert found.figure("plane").axes
    assert len(found.figure("states").axes) == len(found.figure("tube_use").axes)
    with pytest.raises(KeyError, match="there are: inputs, plane, states, tube_use"):
        found.figure("profile")
    names = found.save("a")
    assert found.save("b") == names
    assert all((files / "a" / name).read_bytes() == (files / "b" / name).read_bytes() for name in names)


def test_data_on_stdout_and_the_certificate_of_another_system(files):
    wider = (files / "scalar.yaml").read_text()
    (files / "wider.yaml").write_text(wider.replace("bound: [0.2]", "bound: [0.3]"))
    refused = run("simulate", "wider.yaml", "--certificate", "scalar.json")
    assert refused.exit_code == 2
    assert "disturbance differ" in refused.stderr
    found = run("simulate", "scalar.yaml", "--certificate", "scalar.json", "--runs", "0", "--json")
    assert json.loads(found.stdout)["outcome"] == "not falsified"


@pytest.mark.parametrize("option", ["--controllers ccm", "--members 3", "--gains distance", "--bandwidth 3"])
def test_what_means_nothing_here_is_refused(option):
    found = run("simulate", "scalar.yaml", "--certificate", "scalar.json", *option.split())
    assert found.exit_code == 2
    assert "sampled loop" in found.stderr


@pytest.mark.parametrize("chunks", [0, 1])
def test_who_interrupts_is_told_so_and_has_what_is_finished_without_figures(files, monkeypatch, chunks):
    """The second that is left was spent on figures: 64 runs were lost. Before them not a word was said."""
    asked = ("simulate", "scalar.yaml", "--certificate", "scalar.json", "--runs", "90")
    assert run(*asked).exit_code == 0
    real, left = campaign.resolved, [True] * chunks

    def resolved(*arguments):
        if not left:
            raise KeyboardInterrupt
        left.pop()
        return real(*arguments)

    monkeypatch.setattr(campaign, "resolved", resolved)
    found = run(*asked, *(("-o", "new") if not chunks else ()))
    assert found.exit_code == 130, found.output
    if not chunks:
        assert "tubecert: interrupted" in found.stderr
        assert not (files / "new").exists()
        return
    assert found.stdout.startswith("interrupted scalar: 64 of ")
    assert {path.name for path in (files / "scalar.simulation").iterdir()} == {"runs.npz", "summary.json"}
