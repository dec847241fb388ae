"""Attacks on certificate H: at its own numbers nothing may break, at several times these the bounds have to.

    python tests/harness/hardware_attack.py                   10 000 runs of every row, hours
    python tests/harness/hardware_attack.py --runs 200        minutes
    python tests/harness/hardware_attack.py --rows noise wind --scales 1 4

A row is a specification with its hardware. "scale s": sample time, delay, noise and wind times s at the same bandwidth,
compared with the bounds that are certified for s = 1. Shares above 1 are broken bounds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from tubecert import pipeline
from tubecert.simulate.campaign import Attack, simulate
from tubecert.simulate.promise import Levels
from tubecert.simulate.runs import Runs
from tubecert.simulate.setting import Loop, Setting, setting_of
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.spec import load_text

CONFIGS = Path(__file__).parents[2] / "configs"
QUANTITIES = ("distance", "estimate", "sigma_error", "k", "speed")
WIND = "disturbance: {E: [[1, 0], [0, 1]], bound: 1/20}\n"


@dataclass(frozen=True, slots=True)
class Row:
    """A configuration, and what is added to it; as it is shipped, if nothing is."""

    config: str
    hardware: str
    wind: str = ""
    duration: str = "3"
    windows: str = ""


ROWS = {
    "clean": Row("two_state_orbit", "{sample_time: 1/1000, delay: 0}"),
    "late": Row("two_state_orbit", "{sample_time: 1/1000, delay: 1/1000}"),
    "noise": Row("two_state_orbit", "{sample_time: 1/1000, delay: 0, noise: 1/1000}"),
    "wind": Row("two_state_orbit", "{sample_time: 1/1000, delay: 0}", WIND),
    "all": Row("two_state_orbit", "{sample_time: 1/1000, delay: 1/2000, noise: 1/1000}", WIND),
    "predicts": Row(
        "two_state_orbit", "{sample_time: 1/1000, delay: 1/1000, noise: 1/1000, predict: true}", WIND
    ),
    "two rates": Row(
        "two_state_orbit", "{sample_time: 1/500, delay: 1/2000, noise: 1/10000, feedback_rate: 1000}"
    ),
    "transfer": Row("two_state", "{sample_time: 1/2000, delay: 1/4000, noise: 1/2000}"),
    "windows": Row("two_state", "{rate: 500}", duration="5", windows="10"),
    "noisy windows": Row(
        "two_state", "{rate: 1000, delay: 1/2000, noise: 1/1000}", duration="5", windows="[0.5, 1, 2, 3]"
    ),
    "orbit as shipped": Row("hardware_orbit", ""),
    "three as shipped": Row("hardware_three", "", duration="6"),
    "windows as shipped": Row("two_state_windows", "", duration="5"),
    # a tube in coordinates of its own, two inputs
    "pvtol as shipped": Row("hardware_pvtol", "", duration="2"),
    "pvtol, uncertain mass": Row("hardware_pvtol_mass", "", duration="2"),
    # B and W depend on the state
    "turning": Row("state_dependent_input", "{sample_time: 1/500, noise: 1/10000}"),
    "curved": Row("three_state", "{sample_time: 1/200, delay: 0, noise: 1/10000}", duration="6"),
}


def certified(row: Row) -> tuple[Setting, Loop]:
    """The setting of a row and its certified loop."""
    text = (CONFIGS / f"{row.config}.yaml").read_text("utf-8")
    if row.windows:
        text = text.replace("rho_a: 0.1}", f"rho_a: 0.1, windows: {row.windows}}}")
    spec = load_text(f"{text}\nhardware: {row.hardware}\n{row.wind}" if row.hardware else text)
    setting = setting_of(
        spec, pipeline.certify(spec, pipeline.Options(conditions="hardware")), Fraction(row.duration)
    )
    return setting, loop_of(setting, "hardware", Choice())


def scaled(setting: Setting, loop: Loop, scale: float) -> tuple[Setting, Loop]:
    """The same with every number of the hardware times `scale`, but for the bandwidth; the promise is the old one."""
    kind, machine = setting.on_machine, loop.problem.machine
    assert kind is not None
    assert kind.sources is not None
    assert machine is not None
    sources = replace(kind.sources, table=scale * kind.sources.table, wind=scale * kind.sources.wind)
    slower = replace(
        machine,
        sample_time=scale * machine.sample_time,
        delay=scale * machine.delay,
        feedback_time=machine.feedback_time and scale * machine.feedback_time,
    )
    problem = replace(loop.problem, machine=slower)
    return replace(setting, on_machine=replace(kind, sources=sources)), replace(loop, problem=problem)


def attacked(setting: Setting, loop: Loop, count: int, seed: int) -> Attack:
    """Random runs and an adversary."""
    (found,) = simulate(setting, [loop], count=count, seed=seed).attacks
    return found


def shares(found: Attack) -> dict[str, float]:
    """The largest share of every bound that was met."""
    most: dict[str, float] = {}
    for comparison in (found.comparison, found.worst_comparison):
        assert comparison is not None
        for name, use in comparison.uses.items():
            if name in QUANTITIES:
                most[name] = max(most.get(name, 0.0), use.share or 0.0)
        for own in comparison.inputs:
            assert own.proven is not None
            middle, half = sum(own.proven) / 2, (own.proven[1] - own.proven[0]) / 2
            used = max(own.greatest - middle, middle - own.least) / half
            most["u"] = max(most.get("u", 0.0), used)
    return most


def by_window(loop: Loop, found: Iterable[Runs | None]) -> list[float]:
    """The largest d(x*, x) of every window per level of it, at the times of output; nothing without windows."""
    own = None if loop.promise is None else loop.promise.decay
    if not isinstance(own, Levels):
        return []
    most = [0.0] * len(own.levels)
    for runs in found:
        if runs is not None:
            greatest = np.nanmax(runs.distance, axis=0) / own(runs.t)
            for j, (begin, end) in enumerate(pairwise((0.0, *own.ends))):
                inside = (runs.t >= begin) & (runs.t <= end)
                most[j] = max(most[j], float(greatest[inside].max()))
    return most


def _broken(found: Attack) -> Iterator[str]:
    for comparison in (found.comparison, found.worst_comparison):
        assert comparison is not None
        yield from (item.name for item in comparison.violations)
        if comparison.unreliable:
            yield f"{len(comparison.unreliable)} without result"


def main() -> None:
    """Prints one line for each row and scale; the exit code is 1 where a bound breaks at scale 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--few", type=int, default=100, help="runs at the other scales")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", nargs="*", default=list(ROWS))
    parser.add_argument("--scales", nargs="*", type=float, default=[1, 2, 4, 10])
    asked = parser.parse_args()
    print(f"{'row':10} {'scale':>5} {'runs':>6} " + " ".join(f"{name:>11}" for name in (*QUANTITIES, "u")))
    failed = False
    for name in asked.rows:
        setting, loop = certified(ROWS[name])
        for scale in asked.scales:
            started, count = time.perf_counter(), asked.runs if scale == 1 else min(asked.few, asked.runs)
            found = attacked(*scaled(setting, loop, scale), count, asked.seed)
            most, broken = shares(found), sorted(set(_broken(found)))
            failed = failed or (scale == 1 and bool(broken))
            row = " ".join(f"{most.get(q, 0.0):11.4f}" for q in (*QUANTITIES, "u"))
            line = f"{name:10} {scale:5g} {count:6} {row}  {time.perf_counter() - started:.0f} s"
            runs = (found.sample and found.sample.runs, found.worst)
            windows = "".join(f" {share:.3f}" for share in by_window(loop, runs))
            line += f"  d/level by window:{windows}" if windows else ""
            print(f"{line}  {'BROKEN: ' + ', '.join(broken) if broken else ''}", flush=True)
    raise SystemExit(int(failed))


if __name__ == "__main__":
    main()
