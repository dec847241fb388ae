"""One worker against two: 200 points of a sweep, and the boxes of one supremum in nine states.

    python benchmarks/workers.py            # both
    python benchmarks/workers.py points     # or supremum

Each in a fresh folder, in turns, and the bytes compared. Processes start in a second or two, which is in the times.
Nine minutes beside a load of ten on two processors, where the ratios say little.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from tubecert.enclosure import branch_and_bound
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.executor import Executor, Processes
from tubecert.expression import parse, symbol
from tubecert.trajectory import constant_plan
from tubecert.tube import Tube

ROOT = Path(__file__).parents[1]
TURNS = 1
EFFORT = Effort(gap=1e-3, cheap=0, budget=6_000)
branch_and_bound._ALONE = 500  # what a search of minutes is like, in less time


def points(jobs: int) -> tuple[float, bytes]:
    """The wall time of a sweep over 200 points, and all that it writes."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "tubecert", "sweep", str(ROOT / "configs/three_state.yaml"), "-q"]
        words += ["--conditions", "B", "--over", "adaptation.A_m=-40:-2:200"]
        started = time.perf_counter()
        subprocess.run([*words, "--jobs", str(jobs), "-o", f"{folder}/out", "--no-progress"], check=True)
        seconds = time.perf_counter() - started
        files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
        return seconds, b"".join(path.read_bytes() for path in files)


def nine(jobs: int) -> tuple[float, Supremum]:
    """The wall time of one supremum: a quadrotor under a linear feedback of its nine states, around hover."""
    states = ("px", "py", "pz", "vx", "vy", "vz", "thrust", "phi", "theta")
    symbols = {name: symbol(name) for name in states}
    f = ["vx", "vy", "vz", "-thrust*sin(theta)", "thrust*cos(theta)*sin(phi)"]
    f += ["9.8 - thrust*cos(theta)*cos(phi)", "9.8 - thrust + 2*pz + 3*vz", "-phi - py - 2*vy"]
    f += ["-theta + px + 2*vx"]
    field = SumOfNorms([[[parse(text, symbols=symbols).expression] for text in f]])
    hover = constant_plan([Fraction(0)] * 6 + [Fraction("9.8"), Fraction(0), Fraction(0)], [], None)
    tube = Tube(hover, 0.5, states=states, inputs=(), time=None)
    workers: Executor | None = Processes(jobs) if jobs > 1 else None
    started = time.perf_counter()
    found = supremum(field, tube, replace(EFFORT, workers=workers))
    return time.perf_counter() - started, found


def main() -> None:
    """Both, or what is named."""
    for name, run in (("points", points), ("supremum", nine)):
        if sys.argv[1:] and name not in sys.argv[1:]:
            continue
        times: dict[int, list[float]] = {1: [], 2: []}
        results = []
        for _ in range(TURNS):
            for jobs, own in times.items():
                seconds, found = run(jobs)
                own.append(seconds)
                results.append(found)
        one, two = min(times[1]), min(times[2])
        same = all(found == results[0] for found in results)
        print(
            f"{name}: {one:.1f} s with one worker, {two:.1f} s with two: {one / two:.2f} times as fast,",
            "the same bytes" if same else "OTHER BYTES",
        )


if __name__ == "__main__":
    main()
