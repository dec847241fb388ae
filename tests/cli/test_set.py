"""`--set`: in certificates, in recheck, in simulate; what cannot go together is refused before any work."""

import copy
import json

import proven
import pytest
from commands import run
from systems import SMALL
from texts import ROOT

from tubecert.certificate import dump, seal
from tubecert.certificate.result import Result
from tubecert.errors import ExitCode
from tubecert.recheck.run import recheck
from tubecert.simulation.adaptive.setting import adopted
from tubecert.spec import canonical, load
from tubecert.spec.document import compose
from tubecert.spec.override import Setting, put
from tubecert.spec.source import Source

pytestmark = pytest.mark.timeout(120)
SPEC = ROOT / "configs" / "three_state.yaml"
SETTINGS = ("--set", "tube.rho_a=1/100", "--set", "metric.rate=.99", "--set", "initial_state.at[0]=0.009")


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """A certificate that was made with --set, and one of the file that says the same."""
    folder = tmp_path_factory.mktemp("set")
    edited = SPEC.read_text(encoding="utf-8")
    for old, new in (("rate: 0.9999", "rate: 0.99"), ("[0.01,", "[0.009,")):
        assert edited.count(old) == 1
        edited = edited.replace(old, new)
    assert "rho_a: 0.01" in edited
    (folder / "edited.yaml").write_text(edited, encoding="utf-8")
    for spec, options, name in ((SPEC, SETTINGS, "set.json"), (folder / "edited.yaml", (), "edited.json")):
        with proven.barely():
            done = run("certify", spec, *options, "-q", "-o", folder / name)
        assert done.exit_code == 0, done.output
    return folder


@pytest.mark.slow
def test_a_key_that_is_set_gives_the_certificate_of_the_file_that_says_so(certified):
    names = ("set.json", "edited.json")
    one, other = (json.loads((certified / name).read_text())["result"] for name in names)
    assert one["overrides"].pop("settings") == dict(word.split("=") for word in SETTINGS[1::2])
    assert one["spec"].pop("file_hash") != other["spec"].pop("file_hash")
    assert one == other


@pytest.mark.slow
def test_it_rechecks_and_belongs_to_the_file_it_was_set_for(certified):
    done = run("recheck", certified / "set.json", "--spec", SPEC)
    assert done.exit_code == 0, done.output
    words = "initial_state.at[0] = 0.009, metric.rate = .99, tube.rho_a = 1/100 given on the command line"
    assert words in " ".join(done.output.split())
    other = certified / "other.yaml"
    other.write_text(SPEC.read_text(encoding="utf-8").replace("- -x2", "- -2*x2"), encoding="utf-8")
    done = run("recheck", certified / "set.json", "--spec", other)
    assert (done.exit_code, "TC604" in done.output) == (2, True)


@pytest.mark.slow
def test_simulation_takes_the_specification_as_it_was_set(certified):
    result = Result.from_json(json.loads((certified / "set.json").read_text())["result"])
    assert canonical(adopted(load(str(SPEC)), result)) == result.spec.effective.data


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "text"), [("tube.rho_a", "0.02"), ("metric.rate", "1"), ("initial_state.at[0]", "1")]
)
def test_a_number_that_the_specification_does_not_have_is_contradicted(certified, path, text):
    result = copy.deepcopy(json.loads((certified / "set.json").read_text())["result"])
    result["overrides"]["settings"][path] = text
    report = recheck(dump(seal(result, {})), "c.json", budget=100)
    assert report.exit_code is ExitCode.NOT_CERTIFIED
    assert f"overrides.settings.{path} is not what spec.effective has" in str(report)


def test_two_words_about_one_key_are_refused():
    for options in (
        ("--set", "tube.epsilon=1", "--epsilon", "1"),
        ("--set", "tube={epsilon: 1, rho_a: 1}", "--rho-a", "1"),
        ("--set", "metric.rate=1", "--metric", "m.json"),
        ("--set", "name=a", "--set", "name=b"),
    ):
        done = run("certify", SPEC, *options)
        assert (done.exit_code, "TC104" in done.output) == (2, True), done.output
    done = run("simulate", SPEC, "--certificate", "c.json", "--set", "tube.epsilon=1")
    assert (done.exit_code, "--set goes without it" in " ".join(done.output.split())) == (2, True)


@pytest.mark.parametrize("command", ["certify", "synth", "simulate", "check"])
def test_every_command_names_the_option_as_the_place(command):
    done = run(command, SPEC, "--set", "tube.epsilom=1", "--set", "foo")
    assert done.exit_code == 2
    assert "--set: error TC106" in done.output
    done = run(command, SPEC, "--set", "tube.epsilom=1")
    assert (done.exit_code, "--set tube.epsilom: error TC103" in done.output) == (2, True)
    assert "did you mean epsilon?" in done.output


def test_files_are_checked_and_metrics_verified_as_they_are_set(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "s.yaml").write_text(SMALL, encoding="utf-8")
    spec = str(tmp_path / "s.yaml")
    for _ in range(2):  # what is found of the file as it is set is not remembered for the file
        assert run("check", spec).exit_code == 0
        done = run("check", spec, "--set", "initial_state.at[0]=100")
        assert (done.exit_code, "TC" in done.output) == (1, True), done.output
    done = run("check", spec, "--family", spec, "--set", "name=a")
    assert (done.exit_code, "--set" in done.output) == (2, True)
    assert run("verify", spec).exit_code == 0
    assert run("verify", spec, "--set", "metric.rate=1000").exit_code == 1
    done = run("verify", spec, "--set", "metric.rat=1")
    assert (done.exit_code, "did you mean rate?" in done.output) == (2, True)


@pytest.mark.parametrize(("key", "where"), [("k", "system.parameters"), ("a", "system.definitions")])
def test_a_name_of_the_users_own_is_found_where_it_stands(key, where):
    text = SMALL.replace("  f:", "  parameters: {k: 2}\n  definitions: {a: 2*k}\n  f:", 1)
    _, (finding,) = put(compose(Source.of("spec.yaml", text))[0], [Setting.of(f"{key}=3")])
    assert (finding.code, finding.help) == ("TC103", f"write --set {where}.{key}=...")
