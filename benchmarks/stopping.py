"""SIGTERM at random moments of every long command, on systems of 2 to 12 states: seconds until the end, what was said.

    python benchmarks/stopping.py [--moments 20] [--longest 10] [--seed 0]

A table in Markdown on stdout: for each command how often it was ended, the median and the largest number of seconds
that it took to end, its exit codes, and what it said the time that it took longest. Certificates that commands need are
made first. Nothing is asserted: how long it takes depends on who else has the processor.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
CONFIGS = ROOT / "configs"
FULL = """tubecert: 1
name: full
system:
  states: [x, y, z, vx, vy, vz, phi, th, psi, p, q, r]
  inputs: [T, L, M, N]
  f:
    - vx
    - vy
    - vz
    - 9.81*(cos(phi)*sin(th)*cos(psi) + sin(phi)*sin(psi))
    - 9.81*(cos(phi)*sin(th)*sin(psi) - sin(phi)*cos(psi))
    - -9.81 + 9.81*cos(phi)*cos(th)
    - p + q*sin(phi)*sin(th)/cos(th) + r*cos(phi)*sin(th)/cos(th)
    - q*cos(phi) - r*sin(phi)
    - (q*sin(phi) + r*cos(phi))/cos(th)
    - -0.8*q*r
    - 0.8*p*r
    - 0
  B: [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0],
    [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
safe_set: {x: [-5, 5], y: [-5, 5], z: [-5, 5], vx: [-2, 2], vy: [-2, 2], vz: [-2, 2], phi: [-0.5, 0.5], th: [-0.5, 0.5],
  psi: [-0.5, 0.5], p: [-1, 1], q: [-1, 1], r: [-1, 1]}
uncertainty: {h: [0.1*sin(t), 0, 0, 0]}
trajectory: {kind: equilibrium, at: [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], horizon: 10}
metric: {synthesise: {}}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
CUBIC = """tubecert: 1
name: cubic
system:
  states: [a, b, c, d]
  inputs: [u]
  f: [b + 0.2*a**3 - 0.1*b*c*d, c - 0.3*a*b*c + 0.1*d**3, d + 0.2*b**3 - a*c**2, a*b*d - c**3 + a]
  B: [[0], [0], [0], [1]]
safe_set: {a: [-3, 3], b: [-3, 3], c: [-3, 3], d: [-3, 3]}
uncertainty: {h: [0.1*sin(t)]}
trajectory: {kind: equilibrium, at: [0, 0, 0, 0], horizon: 10}
metric: {synthesise: {}}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
POWER = """tubecert: 1
name: power
system: {states: [p, v], inputs: [u], f: [v, "-p + 1e-6*((p + v + sin(p) + cos(v) + 1)**12)**12"], B: [[0], [1]]}
safe_set: {p: [-1, 1], v: [-1, 1]}
uncertainty: {h: [0.1*sin(t)]}
trajectory: {kind: equilibrium, at: [0, 0], horizon: 10}
metric: {rate: 0.2, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
TWO, THREE, SIX, NINE = (
    str(CONFIGS / f"{name}.yaml") for name in ("two_state", "three_state", "pvtol", "quadrotor3d")
)
COMMANDS = {
    "synth": (
        ["synth", TWO, "--rate", "0.5"],
        ["synth", "cubic.yaml"],
        ["synth", SIX, "--rate", "0.5", "--degree", "2"],
        ["synth", NINE, "--rate", "1"],
        ["synth", "full.yaml"],
        ["synth", "full.yaml", "--rate", "0.2", "--route", "sos"],
    ),
    "certify": (
        ["certify", TWO, "--gap", "1e-5"],
        ["certify", "power.yaml"],
        ["certify", "cubic.yaml"],
        ["certify", SIX, "--gap", "1e-4"],
        ["certify", "full.yaml"],
    ),
    "recheck": (["recheck", "three.json"], ["recheck", "six.json"]),
    "simulate": (["simulate", THREE, "--certificate", "three.json", "--runs", "4000"],),
    "sweep": (
        ["sweep", TWO, "--over", "tube.epsilon=0.2:0.4:9"],
        ["sweep", "cubic.yaml", "--over", "tube.epsilon=0.2:0.4:9", "--jobs", "2"],
    ),
}


@dataclass(frozen=True)
class Ended:
    """A command that was told to end: seconds until it had, its exit code, and what it said."""

    words: tuple[str, ...]
    moment: float
    seconds: float
    code: int
    said: str


def ended(words: list[str], moment: float, folder: Path) -> Ended | None:
    """What became of a command that is told to end after `moment` s; None if it was done before."""
    with subprocess.Popen(
        [sys.executable, "-m", "tubecert", *words, "--no-progress"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(folder / "cache")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            process.communicate(timeout=moment)
        except subprocess.TimeoutExpired:
            began = time.monotonic()
            process.send_signal(signal.SIGTERM)
            _, said = process.communicate()
            return Ended(tuple(words), moment, time.monotonic() - began, process.returncode, said)
    return None


def measured(command: str, moments: int, longest: float, folder: Path, chance: random.Random) -> list[Ended]:
    """So many ends of a command, at moments up to `longest` s or, where that is earlier, to when it was done."""
    found: list[Ended] = []
    most = [longest] * len(COMMANDS[command])
    while len(found) < moments:
        place = chance.randrange(len(most))
        end = ended(COMMANDS[command][place], chance.uniform(0.2, most[place]), folder)
        if end is None:
            most[place] = max(0.8 * most[place], 0.5)
        else:
            found.append(end)
    return found


def main() -> None:
    """The table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--moments", type=int, default=20)
    options.add_argument("--longest", type=float, default=10.0, help="s")
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    chance = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for own, text in (("full", FULL), ("cubic", CUBIC), ("power", POWER)):
            (folder / f"{own}.yaml").write_text(text)
        for own, source in (("three", THREE), ("six", SIX)):
            made = [sys.executable, "-m", "tubecert", "certify", source, "-q", "-o", f"{own}.json"]
            subprocess.run(made, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        print(f"Load when it began: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors.\n")
        print(
            "| command | ended | median (s) | largest (s) | exit codes | longest: at (s), and what it said |"
        )
        print("|---|---|---|---|---|---|", flush=True)
        for command in COMMANDS:
            ends = measured(command, given.moments, given.longest, folder, chance)
            worst = max(ends, key=lambda end: end.seconds)
            codes = ", ".join(map(str, sorted({end.code for end in ends})))
            middle = statistics.median(end.seconds for end in ends)
            said = " / ".join(line.strip() for line in worst.said.splitlines())
            where = f"{' '.join(Path(word).name for word in worst.words[:2])} at {worst.moment:.1f}: {said}"
            print(
                f"| {command} | {len(ends)} | {middle:.2f} | {worst.seconds:.2f} | {codes} | {where} |",
                flush=True,
            )
        print(f"\nLoad when it ended: {os.getloadavg()[0]:.1f}.")


if __name__ == "__main__":
    main()
