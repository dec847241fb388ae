"""The command line: exit codes, streams, files; one located error per mistake, and never a traceback."""

import json
import os
import re
from pathlib import Path

import certificates
import pytest
from commands import run
from texts import ROOT

from tubecert import __version__, pipeline
from tubecert.certificate import digest
from tubecert.certificate.belonging import ForeignError
from tubecert.certificate.notes import joined
from tubecert.certificate.result import Result
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.spec import canonical

SPEC = ROOT / "configs" / "three_state.yaml"
TEXT = SPEC.read_text(encoding="utf-8")
LOCATED = re.compile(r"^(\S+:\d+:\d+|--[a-z-]+): error TC\d{3}: ", re.MULTILINE)

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.timeout(60)]  # a hang guard


@pytest.fixture
def proven(monkeypatch):
    """Certification that answers at once; gives access to what it was asked."""
    asked = {"result": certificates.certified()}

    def certify(spec, options, progress=None, **_):
        asked.update(spec=spec, options=options)
        if isinstance(asked["result"], BaseException):
            raise asked["result"]
        return Result.from_json(asked["result"])

    monkeypatch.setattr(pipeline, "certify", certify)
    return asked


def quiet_failure(result, code):
    assert result.exit_code == code, result.output
    assert "Traceback" not in result.output
    assert result.stdout == ""


def test_alone_it_prints_help():
    alone, asked = run(), run("--help")
    assert alone.exit_code == asked.exit_code == 0
    assert alone.stdout == asked.stdout
    assert "certify" in alone.stdout


@pytest.mark.parametrize(
    "arguments", [["--version"], ["certify", "--version"], ["version"], ["-q", "version"]]
)
def test_version(arguments):
    result = run(*arguments)
    assert (result.exit_code, result.stdout) == (0, f"tubecert {__version__}\n")


def test_version_of_what_results_rest_on():
    assert "numpy" in run("version", "-v").stdout
    assert json.loads(run("--json", "version").stdout)["tubecert"] == __version__


@pytest.mark.parametrize("arguments", [
    ["certfy"], ["certify"], ["certify", SPEC, "--rho"], ["certify", SPEC, "--rho-a"],
    ["certify", SPEC, "--conditions", "27"], ["certify", SPEC, "--bandwidth", "5"],
    ["certify", SPEC, "--adaptation-rate", "5"], ["certify", SPEC, "-q", "-v"], ["-q", "certify", SPEC, "-v"],
    ["check"], ["--color", "sometimes", "version"],
])  # fmt: skip
def test_usage_errors(arguments, folder):
    quiet_failure(run(*arguments), 2)
    assert not list(folder.iterdir())


def test_a_certificate_is_written_and_reported(folder, proven):
    result = run("certify", SPEC)
    assert result.exit_code == 0
    assert result.stderr == ""
    assert result.stdout.startswith(
        "certified pendulum: the state stays in the tube around the plan for all t >= 0\n"
    )
    assert "\x1b" not in result.stdout
    [file] = folder.iterdir()
    assert file.name == "three_state.certificate.json"
    certificate = json.loads(file.read_text(encoding="utf-8"))
    assert set(certificate) == {"format", "hash", "result", "notes", "run"}
    assert certificate["hash"] == digest(certificate["result"])
    assert certificate["run"]["versions"]["tubecert"] == __version__


@pytest.mark.slow
@pytest.mark.parametrize(("result", "code"), [
    (certificates.certified(), 0), (certificates.refuted_metric(), 1), (certificates.refuted_gains(), 1),
    (certificates.undecided(), 4),
])  # fmt: skip
@pytest.mark.parametrize("how", [(), ("-q",), ("-v",), ("--json",)])
def test_every_verdict_has_its_code_and_its_certificate(folder, proven, result, code, how):
    proven["result"] = result
    answer = run("certify", SPEC, *how)
    assert answer.exit_code == code
    told = json.loads(next(folder.iterdir()).read_text())
    assert joined(told["result"], told["notes"]) == result
    assert result["verdict"] in answer.stdout


def test_quiet_is_one_line(proven):
    for arguments in (["-q", "certify", SPEC], ["certify", SPEC, "-q"]):
        assert run(*arguments).stdout.count("\n") == 1


def test_json_is_the_certificate(folder, proven):
    result = run("certify", SPEC, "--json", "-o", "x.json")
    assert json.loads(result.stdout) == json.loads((folder / "x.json").read_text())
    assert result.stderr.startswith("certified pendulum")
    assert run("certify", SPEC, "--json", "-q").stderr == ""


def test_the_certificate_can_go_to_stdout(folder, proven):
    result = run("certify", SPEC, "-o", "-")
    assert json.loads(result.stdout)["result"]["verdict"] == "certified"
    assert not list(folder.iterdir())


def test_colour_can_be_forced(proven):
    assert "\x1b[" in run("certify", SPEC, "--color", "always").stdout
    assert "\x1b[" in run("--color", "always", "certify", SPEC).stdout
    assert "\x1b[" not in run("--color", "always", "certify", SPEC, "--color", "never").stdout


def test_options_are_exact(proven):
    numbers = ["--rho-a", "1/3", "--epsilon", "1e-2", "--bandwidth", "50", "--adaptation-rate", "2e7"]
    assert run("certify", SPEC, *numbers, "--gap", "0.5", "--budget", "1e4").exit_code == 0
    options = proven["options"]
    assert [str(getattr(options, name)) for name in ("rho_a", "epsilon", "bandwidth", "adaptation_rate")] == [
        "1/3", "1/100", "50", "20000000",
    ]  # fmt: skip
    assert (str(options.gap), options.budget) == ("1/2", 10000)
    run("certify", SPEC, "--conditions", "all")
    assert proven["options"] == pipeline.Options(conditions="all")


@pytest.mark.slow
@pytest.mark.parametrize("option", ["--rho-a", "--epsilon", "--gap", "--budget"])
@pytest.mark.parametrize("text", [
    "nan", "inf", "-1", "0", "abc", "", "1e10000000", "0x10", "1_000", "--", "1/0", "9**9**9",
    "__import__('os')",
])  # fmt: skip
def test_bad_numbers(folder, option, text):
    result = run("certify", SPEC, option, text)
    quiet_failure(result, 2)
    assert len(LOCATED.findall(result.stderr)) == 1
    assert result.stderr.startswith(f"{option}: error TC")
    assert not list(folder.iterdir())


def test_a_word_that_may_stand_for_a_number_is_told():
    assert "only deg is one), or auto" in run("certify", SPEC, "--gap", "automatic").stderr


def test_all_bad_numbers_at_once():
    result = run("certify", SPEC, "--rho-a", "x", "--epsilon", "-1", "--gap", "1", "--budget", "0.5")
    assert len(LOCATED.findall(result.stderr)) == 4
    assert result.stderr.endswith("4 errors\n")


def replaced(old, new):
    assert old in TEXT
    return TEXT.replace(old, new)


# every refusal of the reader itself: tests/spec
BAD = {
    "malformed YAML": (TEXT + "x: [1, 2\n", ["not YAML"]),
    "two": (replaced("x1**2 -", "x1^2 -").replace("rate: 0.9999", "rate: no"), ["write **", "rate"]),
    "B of rank zero": (replaced("[[0], [0], [1]]", "[[0], [0], [0]]"), ["B is zero"]),
    "200 000 brackets": (replaced("[[0], [0], [1]]", "[" * 200_000), ["nested"]),
}


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("command", ["certify", "check"])
def test_bad_specifications(folder, tmp_path, name, command):
    text, fragments = BAD[name]
    file = tmp_path / "plant.yaml"
    file.write_text(text, encoding="utf-8")
    result = run(command, file)
    assert result.exit_code == 2, result.output
    found = LOCATED.findall(result.output)
    assert len(found) == len(fragments), result.output
    assert all(place.startswith(f"{file}:") for place in found), "the place is the file's"
    assert all(fragment in result.output for fragment in fragments)
    assert "Traceback" not in result.output
    assert len(result.output) < 5_000
    assert not list(folder.iterdir())


@pytest.mark.parametrize("command", ["certify", "check"])
def test_unreadable_files(folder, tmp_path, command):
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"tubecert: 1\nname: \xff\xfe")
    for path in (tmp_path / "none.yaml", binary, "", "a\0b"):
        result = run(command, path)
        assert result.exit_code == 2, path
        assert "error TC100: " in result.output
        assert result.output.endswith("1 error\n")
        assert "Traceback" not in result.output
    assert not list(folder.iterdir())


METRIC = {
    "format": "tubecert-metric/1",
    "rate": 0.25,
    "dual_metric": [["1", "0", "0.1*x1"], ["0", "1/3", "0"], ["0.1*x1", "0", 2]],
    "margin": 1e9,
    "lower": "believed by nobody",
    "solver": {"name": "any"},
}


def test_a_metric_file_takes_the_place_of_the_metric(folder, proven):
    (folder / "w.json").write_text(json.dumps(METRIC, indent=1))
    assert run("certify", SPEC, "--metric", "w.json").exit_code == 0
    assert proven["options"].metric == Path("w.json")
    data = canonical(proven["spec"])["metric"]
    W = [["1", "0", "0.1*x1"], ["0", "1/3", "0"], ["0.1*x1", "0", "2"]]
    assert data == {"rate": "0.25", "dual_metric": W}
    assert proven["spec"].metric.lower is None


ONE = ["1", "0", "0"], ["0", "1", "0"]


@pytest.mark.parametrize(("content", "said"), [
    ("", ""),
    ("{", "this is not JSON: "),
    ("hello", "the metric file must be a mapping with the keys format, rate, dual_metric"),
    ({key: METRIC[key] for key in METRIC if key != "rate"}, "the metric file lacks rate"),
    (METRIC | {"rate": -1}, "error TC112: rate is -1; it must be > 0"),
    (METRIC | {"rate": "fast"}, "unknown symbol"),
    (METRIC | {"format": "tubecert-metric/9"}, "tubecert-metric/1"),
    (METRIC | {"dual_metric": [["1"]]}, "dual_metric"),
    (METRIC | {"dual_metric": [*ONE, ["x4", "0", "1"]]}, "unknown symbol x4"),
    (METRIC | {"dual_metric": [*ONE, ["x1", "0", "1"]]}, "not symmetric"),
    (METRIC | {"rates": 1}, "unknown key rates"),
    ({"format": "tubecert-certificate/3", "hash": "", "result": {}}, "this is a certificate, not a metric"),
    (TEXT, "this is a specification, not a metric file"),
])  # fmt: skip
def test_bad_metric_files(folder, unused, content, said):
    (folder / "w.json").write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
    result = run("certify", SPEC, "--metric", "w.json")
    quiet_failure(result, 2)
    assert len(LOCATED.findall(result.stderr)) == 1, result.stderr
    assert result.stderr.startswith("w.json:")
    assert said in result.stderr
    assert result.stderr.endswith("1 error\n")


@pytest.mark.parametrize(("change", "claim"), [
    ({"rate": 5}, "metric, contraction"),
    ({"dual_metric": [["1", "0", "x3"], ["0", "1", "0"], ["x3", "0", "2"]]}, "metric, inputs"),
    ({"dual_metric": [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "-1"]]}, "metric, definiteness"),
])  # fmt: skip
def test_a_metric_file_is_verified(folder, change, claim):
    (folder / "w.json").write_text(json.dumps(METRIC | change))
    result = run("certify", SPEC, "--metric", "w.json")
    assert result.exit_code == 1
    assert result.stdout.startswith(f"refuted three_state: {claim}: ")


@pytest.fixture
def unused(monkeypatch):
    """Certification that must not be reached."""

    def certify(*_, **__):
        raise AssertionError("the target is checked before the work starts")

    monkeypatch.setattr(pipeline, "certify", certify)


@pytest.mark.parametrize("target", [
    "missing/x.json", ".", "/", "w.json/x.json", "plant.yaml", "./plant.yaml", "link.json", "w.json",
])  # fmt: skip
def test_targets_are_checked_first(folder, unused, target):
    (folder / "plant.yaml").write_text(TEXT, encoding="utf-8")
    (folder / "link.json").symlink_to(folder / "plant.yaml")
    (folder / "w.json").write_text(json.dumps(METRIC))
    before = {path: path.read_bytes() for path in folder.iterdir()}
    result = run("certify", "plant.yaml", "--metric", "w.json", "-o", target)
    quiet_failure(result, 2)
    assert result.stderr.startswith("error TC120: ")
    assert result.stderr.endswith("1 error\n")
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("target", ["/dev/full", "/proc/x.json"])
def test_targets_that_take_nothing(folder, proven, target):
    if not Path(target).parent.is_dir() or (target == "/dev/full" and not Path(target).exists()):
        pytest.skip(f"there is no {target}")
    result = run("certify", SPEC, "-o", target)
    quiet_failure(result, 2)
    assert result.stderr.startswith(f"error TC120: cannot write {target}: ")
    assert not list(folder.iterdir())


def test_a_disk_that_fills_up_leaves_no_part(folder, proven, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    older = '{"format": 1, "hash": 1, "result": 1}'
    (folder / "x.json").write_text(older)
    result = run("certify", SPEC, "-o", "x.json")
    quiet_failure(result, 2)
    assert "no space left" in result.stderr.lower()
    assert [file.name for file in folder.iterdir()] == ["x.json"]
    assert (folder / "x.json").read_text() == older


@pytest.mark.parametrize("gain", ["1e-300", "1e300", "1e60"])
def test_gains_that_nothing_can_have_are_refused(unused, gain):
    for omega, rate in ((gain, "1"), ("1", gain)):
        result = run("certify", SPEC, "--bandwidth", omega, "--adaptation-rate", rate)
        quiet_failure(result, 2)
        assert f"{gain} is not a gain that anything can have" in result.stderr
        assert "write a number between 1e-60 and 1e60" in result.stderr


@pytest.mark.parametrize("error", [ZeroDivisionError("oops"), RecursionError("deep"), AssertionError()])
def test_internal_errors_leave_a_log_if_they_can_and_show_where_if_asked(
    folder, tmp_path, proven, error, monkeypatch
):
    proven["result"] = error
    assert "Traceback" in run("--debug", "certify", SPEC).stderr
    result = run("certify", SPEC)
    quiet_failure(result, 3)
    assert result.stderr.startswith("tubecert: internal error: ")
    assert "this is a defect of tubecert" in result.stderr
    [log] = (each for each in (tmp_path / "state" / "tubecert").iterdir() if str(each) in result.stderr)
    assert "Traceback" in log.read_text()
    assert not list(folder.iterdir())
    monkeypatch.setattr(Path, "mkdir", lambda *_, **__: (_ for _ in ()).throw(OSError(13, "no")))
    result = run("certify", SPEC)
    quiet_failure(result, 3)
    assert "no log could be written" in result.stderr


def test_errors_bring_their_code(proven):
    finding = Finding(code="TC203", message="B loses rank")
    for error, code in ((SpecError([finding]), 2), (ForeignError([finding]), 2)):
        proven["result"] = error
        result = run("certify", SPEC)
        quiet_failure(result, code)
        assert result.stderr == "error TC203: B loses rank\n1 error\n"


def test_check_folders(folder):
    (folder / "sub").mkdir()
    (folder / ".hidden").mkdir()
    for name in ("b.yaml", "sub/a.yml", ".hidden/c.yaml", "notes.txt"):
        (folder / name).write_text(TEXT if name != "b.yaml" else "tubecert: 1\n", encoding="utf-8")
    result = run("check", folder, folder / "b.yaml")
    assert result.exit_code == 2
    assert "2 specifications checked: " in result.stdout
    assert str(folder / "b.yaml") in result.stdout
    assert "hidden" not in result.stdout
    quiet = run("check", folder, "-q")
    assert quiet.exit_code == 2
    assert quiet.stdout.count("\n") == 1
    [first, *_] = json.loads(run("check", folder, "--json").stdout)
    assert first["code"] == "TC105"
    assert first["file"] == str(folder / "b.yaml")


@pytest.mark.slow
def test_a_real_certificate(folder):
    first, second = run("certify", SPEC, "-o", "1.json"), run("certify", SPEC, "-o", "2.json", "-q")
    assert (first.exit_code, second.exit_code) == (0, 0)
    gains = second.stdout.rstrip().partition("; ")[2]
    assert f"  gains       {gains}, by certificate A, paper's conditions\n" in first.stdout
    one, two = (json.loads((folder / name).read_text(encoding="utf-8")) for name in ("1.json", "2.json"))
    assert one["hash"] == two["hash"] == digest(one["result"])
    assert one["result"]["verdict"] == "certified"
    assert f"rho = {one['result']['tube']['rho']:.4g}"[:9] in first.stdout


@pytest.mark.slow
def test_a_real_refusal(folder):
    file = folder / "fast.yaml"
    file.write_text(replaced("rate: 0.9999", "rate: 1"), encoding="utf-8")
    result = run("certify", file)
    assert result.exit_code == 1
    assert result.stdout.startswith("refuted three_state: metric, contraction: C2 ")
    assert "the largest rate that this metric supports is 0.9999" in " ".join(result.stdout.split())
    [reason] = json.loads((folder / "fast.certificate.json").read_text("utf-8"))["result"]["reasons"]
    assert reason["verdict"] == "refuted"
    assert len(reason["at"]["x"]) == 3


def test_a_budget_that_runs_out_is_undecided(folder):
    result = run("certify", SPEC, "--budget", "10")
    assert result.exit_code == 4
    assert result.stdout.startswith("undecided three_state: ")


def test_ci_runs_what_the_readme_says():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for part in ('install --quiet -c constraints.txt -e ".[dev]"', "-m pytest\n"):
        assert part in script
        assert part.replace(" --quiet", "").strip() in readme
