"""One worker against two: 200 points of a sweep, and the boxes of one supremum in nine states.

    python benchmarks/workers.py                # both
    python benchmarks/workers.py points         # or supremum
    python benchmarks/workers.py --scheduler    # the workers of a Dask cluster on this machine, started and ended here

Each in a fresh folder, in turns, and the bytes compared. Processes start in a second or two, which is in the times; a
cluster is there before the clock starts, and one worker of it is compared with two. On two processors that were idle
but for this: a minute and a half, points 1.54 times as fast with two processes, the supremum 1.68 times; with two
workers of a cluster 1.87 and 1.61 times.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

from tubecert.enclosure import branch_and_bound
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.executor import Cluster, Executor, Processes
from tubecert.expression import parse, symbol
from tubecert.libraries import versions
from tubecert.trajectory import constant_plan
from tubecert.tube import Tube

T = TypeVar("T")
ROOT = Path(__file__).parents[1]
TURNS = 1
EFFORT = Effort(gap=1e-3, cheap=0, budget=6_000)
branch_and_bound._ALONE = 500  # what a search of minutes is like, in less time


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """The address of a scheduler on loopback with so many workers, all of which have imported what they need."""
    bare = ("--no-dashboard",)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        place = folder / "scheduler.json"
        stack.enter_context(
            _running("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", place, *bare)
        )
        address = _until(lambda: json.loads(place.read_text())["address"] if place.exists() else None)
        for number in range(workers):
            own = ("--nthreads", "1", "--no-nanny", "--local-directory", folder / f"{number}", *bare)
            stack.enter_context(_running("dask_worker", address, *own))
        _until(lambda: len(Cluster(address).versions(_warmed)) == workers or None)
        yield address


def _warmed() -> object:
    """On a worker: what a certification imports."""
    from tubecert import pipeline

    return pipeline.__name__, versions()


@contextmanager
def _running(module: str, *words: object) -> Iterator[None]:
    """A process of Dask that is ended, whatever happens; workers find this file by their path."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "benchmarks"), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _until(found: Callable[[], T | None], seconds: float = 60.0) -> T:
    """What is there at last."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if (value := found()) is not None:
            return value
        time.sleep(0.05)
    raise TimeoutError("the cluster did not start")


def points(workers: int, address: str | None) -> tuple[float, bytes]:
    """The wall time of a sweep over 200 points, and all that it writes."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "tubecert", "sweep", str(ROOT / "configs/three_state.yaml"), "-q"]
        words += ["--conditions", "B", "--over", "adaptation.A_m=-40:-2:200"]
        words += ["--jobs", str(workers)] if address is None else ["--scheduler", address]
        started = time.perf_counter()
        subprocess.run([*words, "-o", f"{folder}/out", "--no-progress"], check=True)
        seconds = time.perf_counter() - started
        files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
        return seconds, b"".join(path.read_bytes() for path in files)


def nine(workers: int, address: str | None) -> tuple[float, Supremum]:
    """The wall time of one supremum: a quadrotor under a linear feedback of its nine states, around hover."""
    states = ("px", "py", "pz", "vx", "vy", "vz", "thrust", "phi", "theta")
    symbols = {name: symbol(name) for name in states}
    f = ["vx", "vy", "vz", "-thrust*sin(theta)", "thrust*cos(theta)*sin(phi)"]
    f += ["9.8 - thrust*cos(theta)*cos(phi)", "9.8 - thrust + 2*pz + 3*vz", "-phi - py - 2*vy"]
    f += ["-theta + px + 2*vx"]
    field = SumOfNorms([[[parse(text, symbols=symbols).expression] for text in f]])
    hover = constant_plan([Fraction(0)] * 6 + [Fraction("9.8"), Fraction(0), Fraction(0)], [], None)
    tube = Tube(hover, 0.5, states=states, inputs=(), time=None)
    executor: Executor | None = Processes(workers) if workers > 1 else None
    executor = executor if address is None else Cluster(address)
    started = time.perf_counter()
    found = supremum(field, tube, replace(EFFORT, workers=executor))
    return time.perf_counter() - started, found


def timed(
    run: Callable[..., tuple[float, object]], workers: int, *, on_cluster: bool
) -> tuple[float, object]:
    """One run, with processes of its own or a cluster of so many workers."""
    if not on_cluster:
        return run(workers, None)
    with cluster(workers) as address:
        return run(workers, address)


def main() -> None:
    """Both, or what is named."""
    on_cluster = "--scheduler" in sys.argv
    named = [word for word in sys.argv[1:] if not word.startswith("-")]
    for name, run in (("points", points), ("supremum", nine)):
        if named and name not in named:
            continue
        times: dict[int, list[float]] = {1: [], 2: []}
        results = []
        for _ in range(TURNS):
            for workers, own in times.items():
                seconds, found = timed(run, workers, on_cluster=on_cluster)
                own.append(seconds)
                results.append(found)
        one, two = min(times[1]), min(times[2])
        same = all(found == results[0] for found in results)
        print(
            f"{name}: {one:.1f} s with one worker, {two:.1f} s with two: {one / two:.2f} times as fast,",
            "the same bytes" if same else "OTHER BYTES",
            f"(load {os.getloadavg()[0]:.1f})",
            flush=True,
        )


if __name__ == "__main__":
    main()
