"""How a process ends: 1 means refuted and nothing else, and what was half written is gone."""

import ctypes
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from texts import ROOT

SPEC = str(ROOT / "configs" / "three_state.yaml")

pytestmark = [
    pytest.mark.usefixtures("folder"),
    pytest.mark.timeout(120),
    pytest.mark.skipif(os.name == "nt", reason="signals and limits of POSIX"),
]


def started(*arguments, before: str = "", **options):
    """The command in a process of its own; the code `before` runs first."""
    code = f"{before}\nfrom tubecert.cli import main\nmain()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])},
        stdin=subprocess.DEVNULL,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options},
    )


def ended(process) -> tuple[int, str, str]:
    output, errors = process.communicate(timeout=100)
    return process.returncode, output, errors


CERTIFY = """
import ctypes, os, sys, time
import certificates
from tubecert import pipeline
from tubecert.certificate.result import Result
def certify(*arguments, **options):
    {body}
    return Result.from_json(certificates.certified())
pipeline.certify = certify
"""


@pytest.mark.slow
@pytest.mark.parametrize("status", [0, 1, 2, 4, 130])
def test_a_library_does_not_decide_on_the_exit_code(status):
    body = f"ctypes.CDLL(None).exit({status})"
    code, output, errors = ended(started("certify", SPEC, before=CERTIFY.format(body=body)))
    assert (code, output) == (3, "")
    assert errors.startswith("tubecert: internal error: a library ended the process")


@pytest.mark.slow
def test_a_library_that_gets_no_memory_refutes_nothing():
    """OpenBLAS ends the process with 1 when it gets no memory for its threads."""
    codes = set()
    for kilobytes in range(100_000, 240_000, 40_000):
        limit = kilobytes * 1024
        process = started(
            "certify", SPEC, "-q",
            preexec_fn=lambda limit=limit: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        )  # fmt: skip
        codes.add(ended(process)[0])
    assert codes <= {0, 3, 130}, "where it gets no thread, OpenBLAS interrupts the process"


@pytest.mark.slow
@pytest.mark.parametrize(
    "before",
    [
        "import sys; sys.modules['typer'] = None",
        "import sys; sys.modules['tubecert.cli.app'] = None",
        CERTIFY.format(body="raise MemoryError('4 TiB')"),
        CERTIFY.format(body="raise SystemError"),
        CERTIFY.format(body="raise GeneratorExit"),
        CERTIFY.format(body="sys.exit(1)"),
    ],
)
def test_an_exception_that_nobody_expects_is_an_internal_error(before):
    code, output, errors = ended(started("certify", SPEC, before=before))
    assert (code, output) == (3, "")
    assert "Traceback" not in errors
    assert errors.startswith("tubecert: internal error")
    if "MemoryError" in before:
        assert "out of memory: 4 TiB" in errors
        assert "defect" not in errors


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 130, "tubecert: interrupted\n"),
        (signal.SIGTERM, 143, "tubecert: terminated\n"),
        (signal.SIGHUP, 129, "tubecert: terminated\n"),
    ],
)
@pytest.mark.parametrize("where", ["work", "write"])
def test_a_signal_leaves_nothing_behind(folder, number, code, said, where):
    slow = "print('here', file=sys.stderr, flush=True); time.sleep(60)"
    before = CERTIFY.format(body=slow if where == "work" else "pass")
    if where == "write":
        before += f"def slow(handle): {slow}\nos.fsync = slow\n"
    process = started("certify", SPEC, "-o", "c.json", before=before)
    assert process.stderr.readline() == "here\n"
    if where == "write":
        assert [path.suffix for path in folder.iterdir()] == [".part"]
    process.send_signal(number)
    *end, errors = ended(process)
    assert (*end, errors.partition("  after ")[0]) == (code, "", said)
    assert not list(folder.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tubecert.cli.app", "typer", "tubecert.cli.certify", "numpy"])
@pytest.mark.parametrize(
    ("number", "code", "said"), [("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")]
)
def test_a_signal_while_modules_are_imported(folder, name, number, code, said):
    before = f"""
import os, signal, sys
class Stop:
    def find_spec(self, module, path, target=None):
        if module == {name!r}:
            os.kill(os.getpid(), signal.{number})
from tubecert.cli import process
sys.meta_path.insert(0, Stop())
"""
    assert ended(started("certify", SPEC, before=before)) == (code, "", f"tubecert: {said}\n")
    assert not list(folder.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("words", [["certify", SPEC], ["certify", SPEC, "-o", "-"], ["--help"], ["version"]])
def test_a_full_stdout(words):
    with open("/dev/full", "w") as full:
        code, _, errors = ended(started(*words, before=CERTIFY.format(body="pass"), stdout=full))
    assert code == 2
    assert len(errors.splitlines()) <= 2
    assert "TC120: cannot write to stdout: " in errors


@pytest.mark.slow
def test_a_pipe_that_closes_is_no_error(folder):
    command = started("certify", SPEC, "-v", before=CERTIFY.format(body="time.sleep(0.2)"))
    command.stdout.close()
    errors = command.stderr.read()
    assert (command.wait(), errors) == (0, "")
    command.stderr.close()
    assert len(list(folder.iterdir())) == 1


@pytest.mark.slow
@pytest.mark.parametrize(("stream", "shown"), [
    ("sys.stdout = sys.stderr = None", ""),
    ("sys.stdout.reconfigure(encoding='ascii')", "certified"),
])  # fmt: skip
def test_streams_that_are_closed_or_ascii(stream, shown):
    code, output, errors = ended(started("certify", SPEC, before=f"{CERTIFY.format(body='pass')}{stream}"))
    assert (code, output[:9], errors) == (0, shown, "")


@pytest.mark.slow
def test_nohup_is_honoured(folder):
    def ignore():
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    body = "os.kill(os.getpid(), 1); time.sleep(0.1)"
    process = started("certify", SPEC, "-q", before=CERTIFY.format(body=body), preexec_fn=ignore)
    assert ended(process)[0] == 0
    assert list(folder.iterdir())


@pytest.mark.slow
def test_what_was_registered_for_the_end_is_done_and_output_is_whole(folder):
    before = "import atexit; atexit.register(print, 'the end')\n" + CERTIFY.format(body="pass")
    code, output, _ = ended(started("certify", SPEC, "-q", before=before))
    assert (code, output.splitlines()[-1]) == (0, "the end")


FAULTS = """
import resource
import numpy
from tubecert.cli import process
process.prepare()
numpy.ones(3_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(4):
    numpy.ones(3_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
process.leave(0)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="another C library")
def test_memory_that_is_freed_is_not_fetched_again(monkeypatch):
    """24 MB are thousands of pages, each of which the system cleared at every use."""

    def faults():
        done = subprocess.run([sys.executable, "-c", FAULTS], capture_output=True, text=True, check=True)
        return int(done.stdout)

    for name in ("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"):
        monkeypatch.delenv(name, raising=False)
    kept = faults()
    monkeypatch.setenv("MALLOC_MMAP_THRESHOLD_", "1000000")  # the user's own is respected
    assert 5 * kept < faults()
