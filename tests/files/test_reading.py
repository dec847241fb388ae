"""What a file may do to the tool: pipes, devices, folders, size, and files that are not what they are named for."""

import json
import os
import resource
import socket
import stat
import time
from pathlib import Path

import pytest
from commands import run
from texts import ROOT

from tubecert import files, kept, spec
from tubecert.errors import TargetError, TubecertError
from tubecert.findings import MOST, Finding, Location, Severity, capped

KIND = files.Kind(most=100, unreadable="TC100", too_large="TC102", help="give another")
PLAN = """
tubecert: 1
name: small
system: {states: [q, w], inputs: [u], f: [w, "-q - w"], B: [[0], [1]]}
safe_set: {q: [-1, 1], w: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: csv, file: "FILE"}
"""

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.timeout(60)]


def strange(kind: str) -> str:
    """The name of something that is no regular file."""
    if kind == "pipe":
        os.mkfifo("pipe")
    elif kind == "link to a pipe":
        os.mkfifo("pipe")
        Path("link to a pipe").symlink_to("pipe")
    elif kind == "folder":
        Path("folder").mkdir()
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind("socket")
    else:
        return kind
    return kind


STRANGE = ["pipe", "link to a pipe", "folder", "socket", "/dev/null", "/dev/tty", "/dev/full"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", STRANGE)
@pytest.mark.parametrize("command", [
    ["certify"],
    ["check"],
    ["synth"],
    ["simulate"],
    ["recheck"],
    ["report"],
    ["certify", ROOT / "configs" / "three_state.yaml", "--metric"],
    ["simulate", ROOT / "configs" / "three_state.yaml", "--certificate"],
    ["recheck", "no.json", "--spec"],
], ids=lambda words: " ".join(Path(word).name for word in words))  # fmt: skip
def test_only_regular_files_are_read(command, kind):
    name = strange(kind)
    started = time.monotonic()
    done = run(*command, name)
    assert done.exit_code == 2, done.output
    assert time.monotonic() - started < 20
    assert "error TC" in done.output


@pytest.mark.parametrize("kind", STRANGE)
def test_only_a_regular_file_is_a_plan(kind):
    Path("spec.yaml").write_text(PLAN.replace("FILE", strange(kind)))
    done = run("check", "spec.yaml")
    assert done.exit_code == 2
    assert "spec.yaml:7:31: error TC100: cannot read" in done.output


@pytest.mark.parametrize(
    "command",
    [["certify"], ["recheck"], ["report"], ["certify", ROOT / "configs" / "three_state.yaml", "--metric"]],
    ids=lambda words: words[-1].lstrip("-"),
)
def test_a_huge_file_is_refused_before_it_is_read(command):
    with open("huge", "wb") as file:
        file.truncate(10**12)  # a hole: no byte of it is on the disk
    done = run(*command, "huge")
    assert done.exit_code == 2
    assert "larger than" in done.output


def test_a_file_that_says_that_it_is_empty_is_not_read_without_end(monkeypatch):
    Path("a").write_bytes(b"x" * 1000)
    true = os.fstat

    def lying(handle):
        found = true(handle)
        return os.stat_result([*found[:6], 0, *found[7:10]])

    monkeypatch.setattr(files.os, "fstat", lying)  # as files in /proc do
    with pytest.raises(TargetError) as caught:
        files.read("a", KIND)
    assert caught.value.findings[0].code == "TC102"


def test_what_is_within_the_limit_is_read():
    Path("a").write_bytes(b"x" * 100)
    assert files.read("a", KIND) == b"x" * 100


def test_stdin_has_a_limit_as_well():
    done = run("recheck", "-", input=b" " * 64_000_001)
    assert (done.exit_code, "larger than" in done.output) == (2, True)


def test_a_cache_entry_that_is_a_pipe_counts_as_absent():
    folder = kept.kept_folder("plans")
    folder.mkdir(parents=True)
    os.mkfifo(folder / "a.json")
    assert kept.read_kept("plans", "a") is None


SECRETS = {
    "environ": b"HOME=/root\x00TOKEN=hunter2,q=1\x00",
    "passwd": b"root:hunter2:0:0:root,,,:/root:/bin/sh\n",
    "ini": b"[core]\nkey = hunter2\n",
    "words": b"user hunter2, t, q, w, u\n",
    "names": b"user,hunter2,mail\n1,2,3\n",
    "one": b"hunter2",
    "not UTF-8": b"hunter2\xff",
    "rows": b"t,q,w,u hunter2\n0,0,0,0\nhunter2,1,1,1\n",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SECRETS)
@pytest.mark.parametrize("format_", ["text", "json", "sarif", "junit", "github"])
def test_nothing_is_shown_of_a_file_that_is_no_plan(name, format_):
    Path("secret").write_bytes(SECRETS[name])
    Path("spec.yaml").write_text(PLAN.replace("FILE", "secret"))
    done = run("check", "spec.yaml", "--format", format_)
    assert done.exit_code == 2
    assert "TC1" in done.output
    assert "hunter2" not in done.output


def test_a_plan_with_a_wrong_column_or_number_is_shown():
    Path("plan.csv").write_text("t,q,ww,u\n0,0,0,0\n")
    Path("spec.yaml").write_text(PLAN.replace("FILE", "plan.csv"))
    assert "columns: {w: ww}" in run("check", "spec.yaml").output
    Path("plan.csv").write_text("t,q,w,u\n0,zero,0,0\n1,0,0,0\n")
    done = run("check", "spec.yaml")
    assert "plan.csv:2:3: error TC108: unknown symbol zero" in done.output
    assert "    0,zero,0,0\n      ^^^^" in done.output


def test_a_link_in_a_folder_does_not_lead_out_of_it():
    Path("configs").mkdir()
    Path("secret").write_text("key: hunter2: 3\n")
    Path("configs/leak.yaml").symlink_to(Path("secret").resolve())
    Path("configs/own.yaml").write_text((ROOT / "configs" / "three_state.yaml").read_text())
    Path("configs/same.yaml").symlink_to("own.yaml")
    done = run("check", "configs")
    assert "hunter2" not in done.output
    assert done.exit_code == 0, done.output
    assert "2 specifications checked" in done.output


@pytest.mark.slow
def test_long_lines_and_many_columns_cost_little():
    Path("spec.yaml").write_text(PLAN.replace("FILE", "plan.csv"))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for header in ("t,q,w,u," + ",".join(f"{'x' * 39_000}{k}" for k in range(240)), "x," * 4_900_000):
        Path("plan.csv").write_text(header)
        for format_ in ("sarif", "json", "text", "junit", "github"):
            started = time.monotonic()
            done = run("check", "spec.yaml", "--format", format_)
            assert done.exit_code == 2
            assert len(done.output) < 20_000
            assert time.monotonic() - started < 5
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # KiB


@pytest.mark.slow
def test_findings_of_a_file_are_counted_beyond_the_first():
    keys = "".join(f"unknown_{k}: 1\n" for k in range(5_000))
    Path("spec.yaml").write_text(PLAN + keys)
    log = json.loads(run("check", "spec.yaml", "--format", "sarif").stdout)
    results = log["runs"][0]["results"]
    assert len(results) == MOST + 1
    assert "more" in results[-1]["message"]["text"]


def test_columns_that_a_plan_does_not_know_are_one_finding_of_a_line_or_two():
    Path("plan.csv").write_text("t,q,w,u," + ",".join(f"x{k}" for k in range(150)) + "\n")
    with pytest.raises(TubecertError) as caught:
        spec.load_text(PLAN.replace("FILE", "plan.csv"), "spec.yaml")
    (found,) = caught.value.findings
    assert len(found.message) < 200


def test_what_is_left_out_keeps_its_severity():
    warnings = [Finding(code="TC130", message="w", severity=Severity.WARNING)] * 5
    error = Finding(code="TC131", message="e")
    assert [item.severity for item in capped([*warnings, error], "TC102", 3)] == ["warning"] * 3 + ["error"]


def test_a_finding_is_small_and_its_caret_is_right():
    line = "a" * 500 + "HERE" + "b" * 500_000
    place = Location(file="f", line=1, column=501, source=line, width=4)
    assert len(place.source) <= 200
    text, caret = place.excerpt().splitlines()
    assert text[caret.index("^") : caret.rindex("^") + 1] == "HERE"
    assert len(Finding(code="TC100", message="x" * 10**6).message) < 3_000


@pytest.mark.parametrize("through_a_link", [False, True])
def test_what_is_no_regular_file_is_never_replaced_by_one(through_a_link, tmp_path):
    """As root, a link to a device would otherwise be the end of the device."""
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    with pytest.raises(OSError, match="it is a pipe, not a regular file"):
        files.replace(link if through_a_link else pipe, b"x")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert sorted(path.name for path in tmp_path.iterdir() if path.name.endswith(".part")) == []
