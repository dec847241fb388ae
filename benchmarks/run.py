"""Benchmarks of tubecert as ratios measured in one run; see benchmarks/README.md."""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / "configs" / "three_state.yaml"
TRACKING = ROOT / "configs" / "two_state.yaml"
RUNS = 7


def wall(command: list[str], runs: int = RUNS) -> tuple[float, float]:
    """Median wall time in s of warm runs, and the largest peak memory in MB."""
    times, memory = [], 0.0
    for run in range(runs + 1):
        start = time.perf_counter()
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT
        ) as process:
            process.wait()
        if run:
            times.append(time.perf_counter() - start)
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return statistics.median(times), memory


def startup() -> None:
    """`tubecert --help` against an empty Python program."""
    bare, _ = wall([sys.executable, "-c", "pass"])
    shown, _ = wall([sys.executable, "-m", "tubecert", "--help"])
    print(f"start-up: --help {shown * 1e3:.0f} ms, bare python {bare * 1e3:.0f} ms, ratio {shown / bare:.1f}")


def certify() -> None:
    """The whole command against its imports alone; the plan of the two-state system is cached by the first run."""
    for config in (CONFIG, TRACKING):
        command_line(config)


def command_line(config: Path) -> None:
    """One configuration through the command line."""
    imports = (
        "import tubecert.pipeline, tubecert.report.certificate_page, tubecert.spec, tubecert.certificate"
    )
    bare, _ = wall([sys.executable, "-c", imports])
    with tempfile.TemporaryDirectory() as folder:
        target = str(Path(folder) / "certificate.json")
        command = [sys.executable, "-m", "tubecert", "certify", str(config), "-q", "-o", target]
        whole, memory = wall(command)
    print(
        f"certify {config.stem}: {whole:.2f} s, imports alone {bare:.2f} s, after import {whole - bare:.2f} s, "
        f"peak memory {memory:.0f} MB"
    )


def timed(work: Callable[[], object]) -> tuple[float, object]:
    """Median time of three calls and the last value."""
    times = []
    value: object = None
    for _ in range(3):
        start = time.perf_counter()
        value = work()
        times.append(time.perf_counter() - start)
    return statistics.median(times), value


def growth() -> None:
    """Certification of the two-state plan against its number of knots and against rho, in this process, plan cached."""
    from tubecert.pipeline import Options, certify
    from tubecert.spec import load_text

    text = TRACKING.read_text(encoding="utf-8")
    reference = None
    for knots in (51, 101, 201):
        spec = load_text(text.replace("knots: 101", f"knots: {knots}"), str(TRACKING))
        planning, _ = once(lambda spec=spec: certify(spec, Options()))
        seconds, _ = timed(lambda spec=spec: certify(spec, Options()))
        reference = reference or seconds
        print(
            f"{knots} knots: {seconds:.2f} s ({seconds / reference:.2f} x), first run with planning {planning:.2f} s"
        )
    spec = load_text(text, str(TRACKING))
    reference = None
    for rho in ("0.1", "0.3", "0.6"):
        seconds, result = timed(lambda rho=rho: certify(spec, Options(epsilon=Fraction(rho))))
        reference = reference or seconds
        print(f"epsilon {rho}: {seconds:.2f} s ({seconds / reference:.2f} x), {result.verdict}")


def once(work: Callable[[], object]) -> tuple[float, object]:
    """Time of one call and its value."""
    start = time.perf_counter()
    value = work()
    return time.perf_counter() - start, value


def suprema() -> None:
    """Suprema over the safe set of the three-state system to a relative gap of 1e-3, three ways."""
    from tubecert.enclosure.branch_and_bound import Effort, supremum
    from tubecert.enclosure.domain import BoxDomain
    from tubecert.enclosure.objective import SumOfNorms
    from tubecert.enclosure.pencil import Pencil
    from tubecert.enclosure.taylor import MatrixFunction
    from tubecert.expression.matrix import column, identity
    from tubecert.model import build
    from tubecert.spec import load

    spec = load(str(CONFIG))
    model = build(spec)
    domain = BoxDomain(dict(zip(spec.states, spec.safe_set, strict=True)))
    effort = Effort(gap=1e-3, cheap=0)
    eye = identity(len(model.states))
    cases = {
        "sup |f|": (SumOfNorms, ([column(model.f)],), [column(model.f)]),
        "sup |f_x|": (SumOfNorms, ([model.f_x],), [model.f_x]),
        "sup lmax(W)": (Pencil, (model.W, eye), [model.W]),
    }
    for name, (kind, arguments, matrices) in cases.items():
        seconds, found = timed(
            lambda kind=kind, arguments=arguments: supremum(kind(*arguments), domain, effort)
        )
        mean = kind(*arguments)
        mean._function = MatrixFunction(matrices if kind is SumOfNorms else [matrices[0], eye], order=1)
        mean_seconds, mean_found = timed(lambda mean=mean: supremum(mean, domain, effort))
        grid_seconds, points = grid(MatrixFunction(matrices), spec.safe_set, found.above)
        print(
            f"{name}: {found.above:.6g} to {1 - found.below / found.above:.1e} in {seconds * 1e3:.1f} ms "
            f"({found.boxes} boxes); mean value form {mean_seconds / seconds:.1f} x ({mean_found.boxes} boxes); "
            f"grid of equal accuracy ({points:.1e} points, not proven) {grid_seconds / seconds:.1f} x"
        )


def grid(
    function: object, safe_set: tuple[tuple[Fraction, Fraction], ...], value: float
) -> tuple[float, float]:
    """Time and number of points of a grid whose spacing bounds the error by 1e-3 through the Lipschitz constant."""
    import numpy as np

    names = function.variables
    index = [int(name[1:]) - 1 for name in names]
    side = [float(safe_set[i][1] - safe_set[i][0]) for i in index]
    sample = np.random.default_rng(0).uniform(-0.1, 0.1, (2_000, len(names)))
    step = 1e-6
    slope = 0.0
    for i in range(len(names)):
        moved = sample.copy()
        moved[:, i] += step
        change = np.linalg.norm(function.floats(moved)[0] - function.floats(sample)[0], axis=(1, 2))
        slope = max(slope, float(change.max()) / step)
    spacing = 2 * 1e-3 * value / (slope * np.sqrt(len(names)))
    counts = [max(2, int(np.ceil(width / spacing)) + 1) for width in side]
    total = float(np.prod([float(count) for count in counts]))
    batch = np.random.default_rng(1).uniform(-0.1, 0.1, (int(min(total, 2e5)), len(names)))
    seconds, _ = timed(lambda: np.linalg.norm(function.floats(batch)[0], axis=(1, 2)).max())
    return seconds * total / len(batch), total


def main() -> None:
    """The parts that are named, or all; against another checkout if one is given."""
    parts = {"startup": startup, "certify": certify, "suprema": suprema, "growth": growth}
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(parts)}  [all]")
    asked.add_argument(
        "--against", type=Path, metavar="PATH", help="compare with another checkout, nothing else"
    )
    asked.add_argument("--runs", type=int, default=5, help="of each command, with --against  [5]")
    given = asked.parse_args()
    if unknown := set(given.parts) - set(parts):
        asked.error(f"no such part: {', '.join(sorted(unknown))}")
    if given.against:
        from against import compare

        compare(given.against.resolve(), given.runs)
        return
    for part in given.parts or parts:
        parts[part]()


if __name__ == "__main__":
    main()
