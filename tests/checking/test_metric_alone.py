"""Specifications that ask about a metric alone: read, checked, verified, locked; and refused by whoever needs more."""

import json
from pathlib import Path

import jsonschema
import proven
import pytest
from commands import run
from rechecked import examine, sealed
from systems import SMALL
from texts import ROOT

import tubecert
from tubecert import certificate
from tubecert.checking import compared, outcome
from tubecert.errors import ExitCode, SpecError, TubecertError
from tubecert.spec import canonical, load_text

ALONE = (ROOT / "tests/specs/ok/metric_alone.yaml").read_text("utf-8")
LOCKED = "expect: {metric: holds, largest_rate: [1.2, 1.4]}"
SCHEMA = json.loads((Path(tubecert.__file__).parent / "schemas/spec.schema.json").read_text("utf-8"))


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A file with other words in place of what it locks; the folder of the test is where commands run."""
    monkeypatch.chdir(tmp_path)

    def write(expect=LOCKED, old="", new=""):
        assert old in ALONE
        path = tmp_path / "alone.yaml"
        path.write_text(ALONE.replace(LOCKED, expect).replace(old, new), "utf-8")
        return str(path)

    return write


def told(*arguments):
    done = run(*arguments, "--json")
    return done.exit_code, [(item["code"], item["line"], item["message"]) for item in json.loads(done.stdout)]


def certified(path):
    return told("check", path, "--certify", "--no-cache")


def test_it_is_read_without_what_it_lacks():
    spec = load_text(ALONE, reads="question")
    assert spec.lacks == ("uncertainty", "trajectory")
    assert canonical(spec).keys() == {"tubecert", "name", "system", "safe_set", "metric", "expect"}
    assert canonical(spec)["expect"] == {"metric": "holds", "largest_rate": ["1.2", "1.4"]}


@pytest.mark.slow
def test_check_has_nothing_to_say(written):
    path = written()
    assert told("check", path, "--strict") == (0, [])
    assert certified(path) == (0, [])


@pytest.mark.slow
def test_what_is_not_locked_is_noted_and_must_hold(written):
    path = written("")
    assert [code for code, *_ in told("check", path, "--strict")[1]] == ["TC136"]
    assert certified(path)[0] == 0
    code, found = certified(written("", "rate: 0.8", "rate: 3"))
    assert code == 1
    assert "TC302" in [code for code, *_ in found], (
        "C2 fails at a point: an error where nothing else is expected"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("expect", "rate", "wrong"),
    [
        ("refuted", "0.8", ("TC502", 11, "metric: holds, expected: refuted")),
        ("undecided", "0.8", ("TC502", 11, "metric: holds, expected: undecided")),
        ("refuted", "3", None),
        ("undecided", "1.3", None),  # the supremum itself: nothing is left to prove it with
        ("refuted", "1.3", ("TC502", 11, "metric: undecided, expected: refuted")),
    ],
)
def test_the_verdict_is_locked(written, expect, rate, wrong):
    path = written(f"expect: {{metric: {expect}}}", "rate: 0.8", f"rate: {rate}")
    code, found = certified(path)
    assert [each for each in found if each[0] != "TC302"] == ([] if wrong is None else [wrong])
    assert code == (0 if wrong is None else 1)
    assert run("verify", path, "--expect").exit_code == code


def test_the_largest_rate_is_locked(written):
    code, found = certified(written("expect: {metric: holds, largest_rate: [1.31, 1.4]}"))
    assert (code, [each[:2] for each in found]) == (1, [("TC503", 11)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("locked", "wrong"), [("holds", []), ("refuted", ["metric: holds, expected: refuted"])]
)
def test_in_a_whole_specification_it_is_locked_beside_the_verdict(locked, wrong):
    text = f"{SMALL}expect: {{verdict: certified, metric: {locked}}}\n"
    found = compared(load_text(text), outcome(proven.result(SMALL, bare=True)))
    assert [(each.code, each.message) for each in found] == [("TC502", message) for message in wrong]
    examine(sealed(proven.proven(text, bare=True)), 100)  # and recheck knows the key


@pytest.mark.parametrize(
    "command",
    [["certify"], ["simulate"], ["sweep", "--over", "metric.rate=0.5:1:2"], ["check", "--family"]],
    ids=lambda command: command[0],
)
def test_other_commands_say_what_it_is_about_and_what_to_add(written, command):
    path = written()
    done = run(*command, path, *([path] if command[0] == "check" else []))
    assert done.exit_code == 2
    assert done.output.count("error TC105") == 1
    assert f"{path}:10:9" in done.output
    assert "about a metric alone" in done.output
    assert "add the sections uncertainty, trajectory" in " ".join(done.output.split())


@pytest.mark.slow
def test_no_certificate_is_about_a_metric_alone(written):
    """Neither is one taken for that of such a file, nor is one read that says so."""
    document = proven.proven(SMALL, bare=True)
    Path("small.json").write_text(certificate.dump(document), "utf-8")
    done = run("recheck", "small.json", "--spec", written())
    assert (done.exit_code, "about a metric alone" in done.output) == (2, True)
    effective = document["result"]["spec"]["effective"]
    for key in effective.keys() - canonical(load_text(ALONE, reads="question")).keys():
        del effective[key]
    with pytest.raises(TubecertError) as raised:
        examine(sealed(document), 100)
    assert raised.value.exit_code == ExitCode.INVALID


@pytest.mark.slow
def test_a_metric_found_for_it_is_not_said_to_serve_at_once(written):
    """certify would refuse the file."""
    done = run("synth", written(), "--rate", "0.8")
    said = " ".join(done.output.split())
    assert done.exit_code == 0
    assert "to certify with it, add uncertainty and trajectory to" in said
    assert "tubecert certify" not in said


@pytest.mark.slow
def test_from_code(written):
    path = written()
    spec = tubecert.load(path)
    assert tubecert.specification(spec.data) == spec
    assert "safe set" in spec._repr_html_()
    assert tubecert.check(spec).fine
    assert tubecert.load(spec, settings={"metric.rate": 3}).spec.metric.rate == 3
    assert tubecert.verify(spec).verdict == "certified"
    for needs_more in (spec, path, spec.data):
        with pytest.raises(SpecError, match="about a metric alone"):
            tubecert.certify(needs_more)


def test_the_schema_knows_it():
    """And asks for the plan where there is anything else beside the metric, or none."""
    validator = jsonschema.Draft202012Validator(SCHEMA)
    data = canonical(load_text(ALONE, reads="question"))
    assert validator.is_valid(data)
    for other in (
        {"tube": {"epsilon": 1, "rho_a": 1}},
        {"metric": {"synthesise": {}}},
        {"uncertainty": {"h": ["0"]}},
    ):
        assert not validator.is_valid(data | other)
        with pytest.raises(SpecError, match="lacks"):
            load_text(json.dumps(data | other), reads="question")
