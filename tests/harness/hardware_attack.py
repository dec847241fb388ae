"""Attacks on certificate H: at its own numbers nothing may break, at several times these the bounds have to.

    python tests/harness/hardware_attack.py                   10 000 runs of every row, hours
    python tests/harness/hardware_attack.py --runs 512        minutes
    python tests/harness/hardware_attack.py --rows noise wind --scales 1 4
    python tests/harness/hardware_attack.py --keep runs.jsonl goes on where it was stopped

A row is a specification with its hardware. "scale s": sample time, delay, noise and wind times s at the same bandwidth,
compared with the bounds that are certified for s = 1. Shares above 1 are broken bounds. Every other batch of runs is
drawn at random; the others are bred, each for one of the quantities.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from tubecert import pipeline
from tubecert.simulate.compare import Comparison, compare
from tubecert.simulate.integrator import integrate
from tubecert.simulate.monte_carlo import Case, bred, case, children, disturbance_of, genes_of_case
from tubecert.simulate.promise import Levels
from tubecert.simulate.runs import Runs
from tubecert.simulate.setting import Loop, Setting, setting_of
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.spec import load_text

CONFIGS = Path(__file__).parents[2] / "configs"
QUANTITIES = ("distance", "estimate", "sigma_error", "k", "speed")
SIZE, TURNS, ELITE = 256, 4, 12  # runs of a batch, generations of those that are bred, parents
WIND = "disturbance: {E: [[1, 0], [0, 1]], bound: 1/20}\n"


@dataclass(frozen=True, slots=True)
class Row:
    """A configuration, and what is added to it; as it is shipped, if nothing is."""

    config: str
    hardware: str
    wind: str = ""
    duration: str = "3"
    windows: str = ""
    budget: int | None = None  # of boxes


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
    "orbit as shipped": Row("hardware_orbit", "", duration="2"),
    "three as shipped": Row("hardware_three", "", duration="1.5"),
    "windows as shipped": Row("two_state_windows", "", duration="5"),
    # a tube in coordinates of its own, two inputs
    "pvtol as shipped": Row("hardware_pvtol", "", duration="2"),
    "pvtol, uncertain mass": Row("hardware_pvtol_mass", "", duration="2"),
    "pvtol, moving": Row("hardware_pvtol_moving", "", duration="2", budget=4000),
    # geodesics that the loop computes (theorem H-G)
    "input by state as shipped": Row("hardware_state_dependent_input", "", duration="2"),
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
    options = pipeline.Options(conditions="hardware")
    options = replace(options, budget=row.budget or options.budget)
    setting = setting_of(spec, pipeline.certify(spec, options), Fraction(row.duration))
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


@dataclass(frozen=True, slots=True)
class Batch:
    """Some runs of a row: the largest share of every bound, of every window's level, and what broke."""

    row: str
    scale: float
    number: int
    runs: int = 0
    shares: dict[str, float] = field(default_factory=dict)
    windows: tuple[float, ...] = ()
    broken: tuple[str, ...] = ()
    error: float = 0.0
    seconds: float = 0.0

    @property
    def key(self) -> tuple[str, float, int]:
        """Which batch it is."""
        return self.row, self.scale, self.number

    def joined(self, other: Batch) -> Batch:
        """Both as one."""
        names = {**self.shares, **other.shares}
        return replace(
            self,
            runs=self.runs + other.runs,
            shares={q: max(self.shares.get(q, 0.0), other.shares.get(q, 0.0)) for q in names},
            windows=tuple(map(max, zip(self.windows, other.windows, strict=True)))
            if self.windows
            else other.windows,
            broken=tuple(sorted({*self.broken, *other.broken})),
            error=max(self.error, other.error),
            seconds=self.seconds + other.seconds,
        )


def ran(setting: Setting, loop: Loop, cases: Sequence[Case]) -> Runs:
    """The runs of some cases."""
    own = disturbance_of(setting, setting.class_of(loop), cases)
    starts = np.array([item.start for item in cases])
    return integrate(loop.problem, starts, own, tolerance=setting.tolerance)


def drawn(setting: Setting, loop: Loop, seed: int, number: int) -> Iterator[Runs]:
    """A batch of random runs."""
    kind = setting.class_of(loop)
    yield ran(setting, loop, [case(setting, kind, seed, number * SIZE + i) for i in range(SIZE)])


def evolved(setting: Setting, loop: Loop, seed: int, number: int, of: str) -> Iterator[Runs]:
    """A batch of runs that are bred for the largest value of a quantity."""
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(2**30 + number,)))
    kind = setting.class_of(loop)
    genes = rng.random((SIZE // TURNS, genes_of_case(setting, kind)))
    kept, scores = genes[:0], np.zeros(0)
    for turn in range(TURNS):
        runs = ran(setting, loop, [bred(setting, kind, row) for row in genes])
        yield runs
        worst = np.nan_to_num(getattr(runs.worst, of).value, nan=np.inf)
        pool, values = np.vstack([kept, genes]), np.concatenate([scores, worst])
        order = np.argsort(-values, kind="stable")[:ELITE]
        kept, scores = pool[order], values[order]
        genes = children(kept, len(genes), 0.5 ** (turn + 1), rng)


def filled(setting: Setting, loop: Loop, seed: int, empty: Batch) -> Batch:
    """What a batch finds."""
    started, found, turn = time.process_time(), empty, empty.number // 2
    of = QUANTITIES[turn % len(QUANTITIES)]
    every = (
        drawn(setting, loop, seed, turn) if empty.number % 2 == 0 else evolved(setting, loop, seed, turn, of)
    )
    for runs in every:
        seen = compare(setting, runs, loop.promise)
        found = found.joined(
            replace(
                empty,
                runs=seen.count,
                shares=shares(seen),
                windows=tuple(by_window(loop, runs)),
                broken=tuple(sorted(set(_broken(seen)))),
                error=seen.error / setting.rho,
            )
        )
    return replace(found, seconds=time.process_time() - started)


def shares(*parts: Comparison) -> dict[str, float]:
    """The largest share of every bound that was met."""
    most: dict[str, float] = {}
    for seen in parts:
        for name, use in seen.uses.items():
            if name in QUANTITIES:
                most[name] = max(most.get(name, 0.0), use.share or 0.0)
        for own in seen.inputs:
            assert own.proven is not None
            middle, half = sum(own.proven) / 2, (own.proven[1] - own.proven[0]) / 2
            used = max(own.greatest - middle, middle - own.least) / half
            most["u"] = max(most.get("u", 0.0), used)
    return most


def by_window(loop: Loop, runs: Runs) -> list[float]:
    """The largest d(x*, x) of every window per level of it, at the times of output; nothing without windows."""
    own = None if loop.promise is None else loop.promise.decay
    if not isinstance(own, Levels):
        return []
    greatest = np.nanmax(runs.distance, axis=0) / own(runs.t)
    return [
        float(greatest[(runs.t >= begin) & (runs.t <= end)].max())
        for begin, end in pairwise((0.0, *own.ends))
    ]


def _broken(seen: Comparison) -> Iterator[str]:
    yield from (item.name for item in seen.violations)
    if seen.unreliable:
        yield f"{len(seen.unreliable)} without result"


@dataclass
class Store:
    """The batches that are done, in a file of JSON lines if there is one."""

    path: Path | None
    done: dict[tuple[str, float, int], Batch] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.path is not None and self.path.exists():
            for line in self.path.read_text("utf-8").splitlines():
                own = Batch(**json.loads(line))
                self.done[own.key] = own

    def add(self, own: Batch) -> None:
        """Keeps a batch."""
        self.done[own.key] = own
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(own)) + "\n")

    def whole(self, row: str, scale: float) -> Batch | None:
        """All batches of a row and scale as one."""
        found: Batch | None = None
        for own in self.done.values():
            if (own.row, own.scale) == (row, scale):
                found = own if found is None else found.joined(own)
        return found


def told(own: Batch) -> str:
    """A line of the table."""
    row = " ".join(f"{own.shares.get(q, 0.0):11.4f}" for q in (*QUANTITIES, "u"))
    line = f"{own.row:22} {own.scale:5g} {own.runs:6} {row}  {own.error:.1e} of rho  {own.seconds:.0f} s"
    windows = "".join(f" {share:.3f}" for share in own.windows)
    line += f"  d/level by window:{windows}" if windows else ""
    return f"{line}  {'BROKEN: ' + ', '.join(own.broken) if own.broken else ''}".rstrip()


def main() -> None:
    """Prints one line for each row and scale; the exit code is 1 where a bound breaks at scale 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--few", type=int, default=2 * SIZE, help="runs at the other scales")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", nargs="*", default=list(ROWS))
    parser.add_argument("--scales", nargs="*", type=float, default=[1, 2, 4, 10])
    parser.add_argument("--keep", type=Path, help="a file of batches that are done")
    asked = parser.parse_args()
    store, loops = Store(asked.keep), dict[str, tuple[Setting, Loop]]()
    for number in range(-(-max(asked.runs, asked.few) // SIZE)):  # every row first, then more of each
        for name in asked.rows:
            for scale in asked.scales:
                empty = Batch(name, scale, number)
                if number * SIZE < (asked.runs if scale == 1 else asked.few) and empty.key not in store.done:
                    if name not in loops:
                        loops[name] = certified(ROWS[name])
                    store.add(filled(*scaled(*loops[name], scale), asked.seed, empty))
    print(f"{'row':22} {'scale':>5} {'runs':>6} " + " ".join(f"{name:>11}" for name in (*QUANTITIES, "u")))
    found = [own for name in asked.rows for scale in asked.scales if (own := store.whole(name, scale))]
    print("\n".join(map(told, found)))
    raise SystemExit(int(any(own.scale == 1 and own.broken for own in found)))


if __name__ == "__main__":
    main()
