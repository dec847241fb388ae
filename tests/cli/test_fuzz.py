"""A small run of the fuzzing harness, and that the harness notices what it is for."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "harness"))

import fuzz

LINT = ["--cases", "100", "--jobs", "2", "--budget", "200", "--alarm", "60"]
CERTIFY = ["--cases", "10", "--first", "50", "--jobs", "2", "--mode", "certify", "--budget", "300"]


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [LINT, CERTIFY], ids=["lint", "certify"])
def test_nothing_but_findings_comes_out(arguments):
    options = fuzz.options_of(arguments)
    report = fuzz.run(options)
    assert not report.failures, report.text()
    assert sum(report.outcomes.values()) == options.cases
    assert len(report.outcomes) > 1
    assert 0 < report.peak < 1000


def test_cases_follow_from_their_numbers():
    assert fuzz.case(7) == fuzz.case(7)
    assert len({fuzz.case(number) for number in range(50)}) > 45


def dying(first, last, options, pipe):
    """A worker that fails in each way."""
    pipe.send((first, "started", 0.0))
    if first == 0:
        pipe.send((0, "FAILED by itself", 0.1))
        pipe.send((1, "started", 0.0))
        raise SystemExit(9)
    for number in range(first, last):
        pipe.send((number, "clean", 0.1))
    pipe.send((last, "peak", 50.0))


@pytest.mark.slow
def test_a_worker_that_dies_is_a_failure_and_the_rest_goes_on(monkeypatch):
    monkeypatch.setattr(fuzz, "work", dying)
    report = fuzz.run(fuzz.options_of(["--cases", "5", "--jobs", "1"]))
    assert [number for number, _ in report.failures] == [0, 1]
    assert "died" in report.failures[1][1]
    assert report.outcomes["clean"] == 3


def test_an_exception_is_a_failure(monkeypatch):
    from tubecert import spec

    monkeypatch.setattr(spec, "load_text", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        fuzz.Judge(mode="lint", budget=10)(3)


def test_the_summary_groups_failures():
    report = fuzz.Report()
    for number in range(28):
        report.add(number, "FAILED here", 0.5)
    report.add(29, "clean", 2.0)
    text = report.text()
    assert text.startswith("29 cases, 28 failures; slowest 2.00 s (case 29)")
    assert "FAILED here: cases [0, 1, 2, 3, 4, 5," in text
    assert "18, 19]... (28)" in text
    assert isinstance(fuzz.options_of([]), argparse.Namespace)


def test_an_alarm_that_is_swallowed_rings_again(monkeypatch):
    said = []
    monkeypatch.setattr(fuzz.Judge, "__call__", lambda judge, number: swallowing())
    monkeypatch.setattr(fuzz.resource, "setrlimit", lambda *_: None)
    pipe = type("Pipe", (), {"send": lambda self, item: said.append(item)})()
    options = fuzz.options_of(["--alarm", "0.05"])
    for name in ("OMP_NUM_THREADS", "XDG_STATE_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, os.environ.get(name, ""))
    monkeypatch.chdir(".")
    before = signal.getsignal(signal.SIGINT)
    try:
        fuzz.work(0, 1, options, pipe)
    finally:
        signal.signal(signal.SIGINT, before)
    assert said[1][1] == "FAILED alarm after 0.05 s"


def swallowing():
    """Takes the first alarm for an error of its own, and goes on."""
    with contextlib.suppress(fuzz.Alarm):
        while True:
            pass
    while True:
        pass
