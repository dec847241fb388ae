"""A sweep on a Dask cluster: a scheduler and workers on this machine, one of them killed; the bytes of a serial run."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec

import numpy as np
import pytest
from simulated import setting
from test_sweep import ONE, bytes_in

from tubecert.enclosure import branch_and_bound
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.executor import Cluster, Serial, WorkerError
from tubecert.expression import parse, symbol
from tubecert.libraries import versions
from tubecert.simulation.adaptive import campaign
from tubecert.simulation.adaptive.campaign import cases
from tubecert.simulation.adaptive.setting import Choice, loop_of
from tubecert.trajectory import constant_plan
from tubecert.tube import Tube

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(280),
    pytest.mark.skipif(find_spec("distributed") is None, reason="an extra"),  # to import it takes a second
]
COMMAND = (sys.executable, "-m", "tubecert")
NINE = Effort(gap=0.05, cheap=0, budget=700)
OVER = ("--over", "tube.epsilon=.2:.4:6")


def nine_states():
    """A quadrotor that is driven by a linear feedback of all its nine states, over a tube around hover."""
    states = ("px", "py", "pz", "vx", "vy", "vz", "thrust", "phi", "theta")
    symbols = {name: symbol(name) for name in states}
    f = [
        "vx",
        "vy",
        "vz",
        "-thrust*sin(theta)",
        "thrust*cos(theta)*sin(phi)",
        "9.8 - thrust*cos(theta)*cos(phi)",
    ]
    f += ["9.8 - thrust + 2*pz + 3*vz", "-phi - py - 2*vy", "-theta + px + 2*vx"]
    field = [[parse(text, symbols=symbols).expression] for text in f]
    hover = constant_plan([Fraction(0)] * 6 + [Fraction("9.8"), Fraction(0), Fraction(0)], [], None)
    return SumOfNorms([field]), Tube(hover, 0.5, states=states, inputs=(), time=None)


@contextmanager
def running(*words, env=None):
    """A process that is ended, whatever happens."""
    process = subprocess.Popen(
        [sys.executable, *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **(env or {})},
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def until(condition, seconds=100):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    assert condition()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """The address of a scheduler with three workers, and their processes."""
    folder = tmp_path_factory.mktemp("cluster")
    place = folder / "scheduler.json"
    start = ("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    with ExitStack() as stack:
        stack.enter_context(running(*start, "--scheduler-file", place))
        until(place.exists)
        address = json.loads(place.read_text())["address"]
        own = (
            "-m",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--no-nanny",
        )
        workers = [stack.enter_context(running(*own, "--local-directory", folder / f"{i}")) for i in range(3)]
        until(lambda: len(Cluster(address).versions(versions)) == 3)
        yield address, workers


def done_in(folder, *words):
    """A command in a process of its own, started in the folder of the specification."""
    told = {"capture_output": True, "text": True, "timeout": 250}
    return subprocess.run([*COMMAND, *map(str, words)], cwd=folder, check=False, **told)


def test_a_killed_worker_loses_nothing_and_changes_no_byte(cluster, tmp_path):
    address, workers = cluster
    (tmp_path / "one.yaml").write_text(ONE, encoding="utf-8")
    assert done_in(tmp_path, "sweep", "one.yaml", *OVER, "-o", "serial").returncode == 0
    points, silent = tmp_path / "spread/points", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    words = [*COMMAND, "sweep", "one.yaml", *OVER, "-o", "spread", "--scheduler", address]
    with subprocess.Popen(words, cwd=tmp_path, **silent) as process:
        until(lambda: points.is_dir() and any(points.glob("*.certificate.json")))
        assert len(list(points.glob("*.certificate.json"))) < 6
        workers[0].send_signal(signal.SIGKILL)
        assert process.wait(timeout=200) == 0
    assert bytes_in(tmp_path / "spread") == bytes_in(tmp_path / "serial")


def test_what_a_cluster_cannot_do_is_refused(cluster, tmp_path):
    address, _ = cluster
    text = ONE.replace("{kind: equilibrium, at: [0], horizon: 10}", "{kind: csv, file: plan.csv}")
    (tmp_path / "one.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "plan.csv").write_text("t,x,u\n0,0,0\n10,0,0\n")
    done = done_in(tmp_path, "sweep", "one.yaml", *OVER, "--scheduler", address)
    assert (done.returncode, "in folders of their own" in done.stderr) == (2, True), done.stderr
    assert not (tmp_path / "one.sweep").exists()


def test_other_versions_on_workers_are_found(cluster):
    assert all(each == versions() for each in Cluster(cluster[0]).versions(versions))


def test_where_there_is_no_cluster_that_is_said(monkeypatch):
    monkeypatch.setattr("tubecert.executor._PATIENCE", 1)
    with pytest.raises(WorkerError, match="no cluster with workers at"):
        Cluster("tcp://127.0.0.1:9").versions(versions)
    with pytest.raises(WorkerError, match="no cluster with workers at"):
        Cluster("tcp://127.0.0.1:9").map(abs, [1])


def test_random_runs_on_a_cluster_are_those_of_this_machine(cluster, monkeypatch):
    monkeypatch.setattr(campaign, "LANES", 2)
    monkeypatch.setattr(campaign, "worst", lambda where, loop, seed, *more: cases(where, seed, [0]))
    where = setting("flat", duration="1")
    loops = [loop_of(where, "l1", Choice())]
    here, there = (
        campaign.simulate(where, loops, count=7, seed=5, executor=each).attacks[0].random.runs
        for each in (Serial(), Cluster(cluster[0]))
    )
    np.testing.assert_array_equal(here.x, there.x)
    np.testing.assert_array_equal(here.found.peak.distance, there.found.peak.distance)


def test_files_are_checked_on_a_cluster(cluster, tmp_path):
    (tmp_path / "one.yaml").write_text(ONE, encoding="utf-8")
    (tmp_path / "wrong.yaml").write_text(ONE.replace("kind: equilibrium", "kind: rest"), encoding="utf-8")
    words = ["check", "one.yaml", "wrong.yaml", "--no-cache"]
    own = [done_in(tmp_path, *words, *more) for more in ([], ["--scheduler", cluster[0]])]
    assert [each.returncode for each in own] == [2, 2], own
    assert own[1].stdout.replace(f"{tmp_path}/", "") == own[0].stdout


def test_the_boxes_of_one_supremum_are_shared_and_none_is_lost_with_a_worker(cluster, monkeypatch):
    address, workers = cluster
    monkeypatch.setattr(branch_and_bound, "_ALONE", 200)
    monkeypatch.setattr(branch_and_bound, "_PARTS", 6)
    objective, domain = nine_states()
    own = supremum(objective, domain, NINE)
    apart: list[int] = []

    def after_the_first_part(step):
        if step.count >= 200:  # told when the search falls apart, then after each part
            apart.append(step.count)
        if len(apart) == 2:
            workers[1].send_signal(signal.SIGKILL)

    effort = replace(NINE, workers=Cluster(address), progress=after_the_first_part)
    assert supremum(objective, domain, effort) == own
    assert len(apart) == 7


def test_results_are_in_the_order_of_the_items_and_exceptions_are_raised(cluster):
    ready: dict[int, int] = {}
    assert Cluster(cluster[0]).map(abs, [-1, 2, -3], ready.__setitem__) == [1, 2, 3]
    assert ready == {0: 1, 1: 2, 2: 3}
    with pytest.raises(TypeError):
        Cluster(cluster[0]).map(abs, ["x"])
