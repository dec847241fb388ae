"""A small run of the fuzzing harness, and that the harness notices what it is for."""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "harness"))

import fuzz

LINT = ["--cases", "250", "--budget", "200", "--alarm", "60"]
CERTIFY = ["--cases", "10", "--first", "50", "--mode", "certify", "--budget", "300"]


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [LINT, CERTIFY], ids=["lint", "certify"])
def test_nothing_but_findings_comes_out(arguments):
    command = [sys.executable, fuzz.__file__, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = [int(line.split()[0]) for line in done.stdout.splitlines()]
    assert len(counts) > 1
    assert sum(counts) == int(arguments[1])


def test_cases_follow_from_their_numbers():
    assert fuzz.case(7) == fuzz.case(7)
    assert len({fuzz.case(number) for number in range(50)}) > 45


def test_an_exception_is_a_failure(monkeypatch):
    from tubecert import spec

    monkeypatch.setattr(spec, "load_text", lambda *_: 1 / 0)
    said = fuzz.outcome(fuzz.Judge(mode="lint", budget=10), 3, 60.0)
    assert said.startswith("FAILED ZeroDivisionError in test_fuzz.py:")


def test_an_alarm_that_is_swallowed_rings_again():
    before = signal.signal(signal.SIGPROF, fuzz._ring)
    try:
        assert fuzz.outcome(swallowing, 0, 0.05) == "FAILED alarm after 0.05 s"
    finally:
        signal.signal(signal.SIGPROF, before)


def swallowing(_):
    """Takes the first alarm for an error of its own, and goes on."""
    with contextlib.suppress(fuzz.Alarm):
        while True:
            pass
    while True:
        pass
