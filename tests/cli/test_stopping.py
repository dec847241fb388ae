"""A command ends when it is told to, also in a step that never looks up, and says what it came to by then."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from texts import ROOT

SPEC = str(ROOT / "configs" / "three_state.yaml")
PENDULUM = str(ROOT / "tests" / "specs" / "robots" / "pendulum.yaml")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.usefixtures("folder"),
    pytest.mark.timeout(300),
    pytest.mark.skipif(not hasattr(os, "fork"), reason="a command works in a fork"),
]

STUCK = """
import os, signal, sys
from itertools import repeat
def stuck(*arguments, **options):
    said = False
    while True:
        try:
            said = said or os.write(2, b"stuck %d\\n" % os.getpid())
            sum(repeat(1))  # in C, for ever: no signal is looked at
        except KeyboardInterrupt:  # it came before
            pass
def late(*arguments, **options):
    keeper.tell({"seconds": 0.0})
    return stuck()
from tubecert.cli import keeper
"""
# by the step that never ends: the command, and what it is that is stuck
STEPS = {
    "reading": ("certify", "import tubecert.spec as place; place.load = {how}"),
    "expressions": ("certify", "import tubecert.model.affine as place; place.jacobian = {how}"),
    "solver": ("synth", "import tubecert.synthesis.cegis as place; place.propose = {how}"),
    "certification": ("certify", "import tubecert.pipeline as place; place.certify = {how}"),
    "check": ("check --certify --no-cache", "import tubecert.pipeline as place; place.certify = {how}"),
    "recheck": ("recheck", "from tubecert.recheck import run; run.of_every = {how}"),
    "sweep": ("sweep --over tube.epsilon=1,2", "from tubecert.sweep import run; run.certify_point = {how}"),
}


@pytest.fixture
def started():
    """Starts a command in a process of its own, in which `before` was run; ended with the test."""
    processes = []

    def start(before, *arguments):
        processes.append(begun(before, *arguments))
        return processes[-1]

    yield start
    for process in processes:
        with process:
            process.kill()


def begun(before, *arguments):
    return subprocess.Popen(
        [sys.executable, "-c", f"{STUCK}{before}\nfrom tubecert.cli import main\nmain()", *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def until_stuck(process) -> int:
    """The number of the process that is stuck."""
    for line in process.stderr:
        if line.startswith("stuck "):
            return int(line.split()[1])
    raise AssertionError("it ended")


def arguments_of(command):
    words = command.split()
    if words[0] == "recheck":
        from proven import result
        from systems import SMALL

        from tubecert import certificate

        certificate.write("c.json", certificate.seal(result(SMALL, bare=True).to_json(), {}))
        return [*words, "c.json"]
    return [words[0], SPEC if words[0] != "synth" else PENDULUM, *words[1:]]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize(
    ("how", "code", "said"),
    [("stuck", 143, "tubecert: terminated"), ("late", 4, "tubecert: undecided: the time was up")],
)
def test_a_step_that_never_looks_up_is_ended(started, step, how, code, said):
    """SIGTERM was obeyed up to 141 s late, and `--deadline 5` at 172 s: both were looked at between steps."""
    command, before = STEPS[step]
    process = started(before.format(how=how), *arguments_of(command))
    if how == "stuck":
        until_stuck(process)
        process.send_signal(signal.SIGTERM)
    output, errors = process.communicate()
    assert (process.returncode, output) == (code, "")
    lines = errors.splitlines()
    assert lines[lines.index(said) + 1].startswith("  after ")
    assert lines[-1].startswith("  next: ")
    if step == "reading":  # it may be the time that it takes to start
        assert lines[-1].startswith("  next: more time; ")


SECOND = """
from tubecert.pipeline.synthesis import SynthesisRun
whole, rows = SynthesisRun._row, []
def row(self, *given):
    rows.append(given)
    return whole(self, *given) if len(rows) == 1 else {how}()
SynthesisRun._row = row
"""


@pytest.mark.parametrize(("how", "code"), [("stuck", 143), ("late", 0)])
@pytest.mark.parametrize("shown", [(), ("--json",)])
def test_the_best_metric_is_left_by_a_search_that_had_to_be_ended(started, how, code, shown):
    arguments = ["synth", PENDULUM, "--objective", "adaptation", "-o", "m.json", *shown]
    process = started(SECOND.format(how=how), *arguments)
    if how == "stuck":
        until_stuck(process)
        process.send_signal(signal.SIGTERM)
    output, errors = process.communicate()
    assert process.returncode == code
    left = json.loads(Path("m.json").read_text())
    if shown:
        assert json.loads(output) == left
    else:
        assert output.startswith(f"metric proven pendulum: rate {left['rate']} 1/s")
    assert f"metric of rate {left['rate']}, degree 0: certified" in errors


def test_a_metric_that_certify_found_is_not_lost(started):
    process = started(SECOND.format(how="stuck"), "certify", PENDULUM, "--conditions", "B", "-o", "c.json")
    until_stuck(process)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate()
    assert process.returncode == 143
    assert "metric proven, rate " in errors
    assert json.loads(Path("c.metric.json").read_text())["rate"] > 0
    assert not Path("c.json").exists()


def test_what_was_examined_is_told(started):
    before = """
from tubecert.recheck import run
whole, claims = run.Claim.outcome, []
def outcome(self, *given):
    claims.append(self)
    return whole(self, *given) if len(claims) < 4 else stuck()
run.Claim.outcome = outcome
"""
    process = started(before, *arguments_of("recheck"))
    until_stuck(process)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate()
    assert process.returncode == 143
    assert errors.count("    confirmed  ") == 3
    assert "3 of " in errors


def test_a_process_that_is_killed_is_told_with_what_it_found(started):
    """The system kills what takes too much memory: nothing was said, and the exit code was none of ours."""
    process = started(STEPS["certification"][1].format(how="stuck"), "certify", SPEC)
    os.kill(until_stuck(process), signal.SIGKILL)
    output, errors = process.communicate()
    assert (process.returncode, output) == (3, "")
    assert "tubecert: internal error: the process that worked was killed (SIGKILL)" in errors


def test_nothing_outlives_who_was_killed(started):
    process = started(STEPS["certification"][1].format(how="stuck"), "certify", SPEC)
    worker = until_stuck(process)
    process.kill()
    process.communicate()
    assert gone(worker)


def test_workers_end_with_their_command(started):
    """Processes that share a search are none of the keeper's own."""
    before = """
import tubecert.pipeline as place
from tubecert.executor import Processes
def certify(*given, **options):
    from stopping_workers import stuck
    Processes(2).map(stuck, [1, 2])
place.certify = certify
"""
    Path("stopping_workers.py").write_text(STUCK)
    process = started(f"sys.path.insert(0, '.')\n{before}", "certify", SPEC)
    workers = [until_stuck(process), until_stuck(process)]
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 143
    assert all(map(gone, workers))


def gone(process: int) -> bool:
    """Whether it ends: not at once, as others have the processor, too."""
    for _ in range(600):
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        state = Path(f"/proc/{process}/stat")
        if state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            return True  # nobody has asked for its end yet
        time.sleep(0.1)
    return False


def test_reading_ends_at_the_deadline_too(started):
    """f + 1e-6*((p + v + sin(p) + cos(v) + 1)**12)**12, a power of 144, took 172 s with `--deadline 5`."""
    Path("power.yaml").write_text(
        """tubecert: 1
name: power
system: {states: [p, v], inputs: [u], f: [v, "-p + 1e-6*((p + v + sin(p) + cos(v) + 1)**12)**12"], B: [[0], [1]]}
safe_set: {p: [-1, 1], v: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], horizon: 10}
metric: {rate: 0.2, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
    )
    process = started("", "certify", "power.yaml", "--deadline", "0.2")
    _, errors = process.communicate()
    assert process.returncode == 4
    assert "tubecert: undecided: the time was up" in errors
