"""Ratios to another checkout: CPU time of whole commands, measured in turns.

python benchmarks/run.py --against PATH
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SMALL = ("three_state", "two_state", "two_state_orbit", "state_dependent_input")
METRIC = "{out}/metric.json"
COMMANDS: dict[str, tuple[str, ...]] = {
    "--help": ("--help",),
    "check configs": ("check", "--no-cache", *(f"{{configs}}/{name}.yaml" for name in SMALL)),
    **{
        f"certify {name}": ("certify", f"{{configs}}/{name}.yaml", "-q", "-o", "{out}/certificate.json")
        for name in SMALL
    },
    "synth three_state": ("synth", "{configs}/three_state.yaml", "--rate", "0.999", "-q", "-o", METRIC),
    "synth two_state": ("synth", "{configs}/two_state.yaml", "--rate", "1.7", "-q", "-o", METRIC),
    "synth state_dependent_input": (
        "synth",
        "{configs}/state_dependent_input.yaml",
        "--rate",
        "0.3",
        "-q",
        "-o",
        METRIC,
    ),
}


def cpu_seconds(tree: Path, command: Sequence[str]) -> tuple[float, int]:
    """CPU time of a command of a checkout with its own configs and an empty cache, and its exit code."""
    with tempfile.TemporaryDirectory() as folder:
        places = {"configs": str(tree / "configs"), "out": folder}
        process = subprocess.Popen(
            [sys.executable, "-m", "tubecert", *(word.format(**places) for word in command)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=folder,
            env=environment(tree) | {"XDG_CACHE_HOME": folder},
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    return used.ru_utime + used.ru_stime, process.returncode


def environment(tree: Path) -> dict[str, str]:
    """The variables with which Python runs the package of a checkout."""
    return {**os.environ, "PYTHONPATH": str(tree)}


def belongs(tree: Path) -> bool:
    """Whether it does."""
    code = "import tubecert; print(tubecert.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment(tree),
        cwd=tree,
        capture_output=True,
        text=True,
        check=True,
    )
    return Path(done.stdout.strip()).resolve().is_relative_to(tree.resolve())


def compare(other: Path, runs: int = 5) -> None:
    """Prints one line per command: both in turns, after a run of each to warm up."""
    for tree in (ROOT, other):
        if not belongs(tree):
            raise SystemExit(f"{tree} has no package tubecert")
    print(f"CPU time of this checkout over that of {other}, median of {runs} runs in turns")
    for name, command in COMMANDS.items():
        pairs = []
        for run in range(runs + 1):
            (new, code), (old, old_code) = cpu_seconds(ROOT, command), cpu_seconds(other, command)
            if code != old_code:
                print(f"{name}: ends with {code} here and with {old_code} there")
                break
            if run:
                pairs.append((new, old))
        else:
            print(line(name, pairs))


def line(name: str, pairs: Sequence[tuple[float, float]]) -> str:
    """What is printed of one command."""
    new, old = (statistics.median(side) for side in zip(*pairs, strict=True))
    ratios = sorted(here / there for here, there in pairs)
    return f"{name}: {new / old:.3f} ({ratios[0]:.2f} to {ratios[-1]:.2f}), {new:.2f} s against {old:.2f} s"
