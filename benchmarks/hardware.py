"""Certificate H with proven constants: the numbers of the notes, and what it costs over B.

    python benchmarks/hardware.py numbers   # largest sample times, noise and wind, and least tubes, as Markdown tables
    python benchmarks/hardware.py cells     # each sample time that is more than 5 % off those of the notes, and why
    python benchmarks/hardware.py cost      # CPU time of certify with B, and with H, on each machine in configs/

In the tables the numbers behind a stroke are those of the notes, for which constants were sampled and the free numbers
searched for on a coarser grid. Every other number is proven: the kernel decides at the decimals that are printed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

import numpy as np
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.search.hardware import Setting, recipe_at
from tubecert.search.lanes import DEADBEAT, Choice, Lanes, Search

from tubecert.conditions.decimals import round_down
from tubecert.conditions.problem import TubeProblem
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Array
from tubecert.pipeline import Options, certify, question_of
from tubecert.pipeline.certification import plan, tube
from tubecert.search.scan import serves
from tubecert.spec import Hardware, load, load_text
from tubecert.stages.bounded import bound, enclose
from tubecert.stages.metric import prove_metric

CONFIGS = Path(__file__).resolve().parent.parent / "configs"
WIND = {"two_state_orbit": "0.05", "two_state": "0.05", "three_state": "0.005"}
Of = TypeVar("Of")
OF_NOTES = {"symbols_slope": 36.0, "feedback_curvature": 2.9}  # L_G, and D_Fx, of three states
LATE = (Fraction(0), Fraction(1, 2), Fraction(1))  # delays, in sample times
NOISES = (("clean", "0", False), ("n 1e-4", "1e-4", False), ("n 1e-3", "1e-3", False))
COLUMNS = (*NOISES, ("wind", "0", True), ("n 1e-3, wind", "1e-3", True))


@dataclass(frozen=True)
class Place:
    """A system and its tube, with what the notes have of it: ms by column and delay (0: none), and least tubes."""

    name: str
    epsilon: str
    rho_a: str
    times: tuple[tuple[float, ...], ...]
    tubes: tuple[float, ...]
    noise: float
    wind: float


PLACES = (
    Place(
        "two_state_orbit", "0.6", "0.1",
        ((6.27, 4.27, 3.00), (6.09, 4.08, 2.83), (4.95, 2.87, 2.24), (5.77, 3.89, 2.73), (4.37, 2.51, 1.78)),
        (0.021, 0.030, 0.111, 0.270, 0.093, 0.434, 0.213), 5.4e-3, 0.40,
    ),
    Place(
        "two_state", "0.6", "0.1",
        ((2.33, 1.52, 1.13), (2.10, 1.34, 1.03), (1.40, 0.997, 0.708), (2.18, 1.38, 1.02), (1.24, 0.859, 0.608)),
        (0.111, 0.386, 0.552, 0.489, 0.189, 0, 0), 1e-3, 0.18,
    ),
    Place(
        "two_state", "0.4", "0.1",
        ((2.42, 1.57, 1.23), (2.09, 1.41, 1.09), (1.24, 0.889, 0.635), (2.20, 1.38, 1.07), (0.963, 0.671, 0.479)),
        (), 0, 0,
    ),
    Place(
        "three_state", "0.01", "0.01",
        ((37.6, 27.6, 20.0), (31.2, 18.0, 12.6), (0, 0, 0), (28.7, 19.9, 14.7), (0, 0, 0)),
        (), 0, 0,
    ),
    Place(
        "three_state", "0.01", "0.0408",
        ((36.1, 26.5, 19.0), (32.6, 22.3, 16.0), (8.40, 6.85, 4.77), (31.1, 22.4, 16.0), (3.64, 2.22, 1.97)),
        (0.0189, 0.0189, 0.0189, 0.058, 0.0189, 0.0688, 0.0189), 1.5e-3, 0.030,
    ),
)  # fmt: skip

# sample time in ms, delay in ms, noise, wind: the columns of the tubes that are least
TUBES = (
    ("1, 0, clean", 1, 0, "0", False),
    ("1, 1, clean", 1, 1, "0", False),
    ("2, 0, n 1e-4", 2, 0, "1e-4", False),
    ("1, 0, n 1e-3", 1, 0, "1e-3", False),
    ("1, 0, wind", 1, 0, "0", True),
    ("1, 1, n 1e-3, wind", 1, 1, "1e-3", True),
    ("5, 0, clean", 5, 0, "0", False),
)


def problem_of(place: Place) -> TubeProblem:
    """The constants of a system and its tube, proven once for all machines and winds."""
    text = (CONFIGS / f"{place.name}.yaml").read_text(encoding="utf-8")
    text += f"\nhardware: {{rate: 1000, noise: 0.001}}\ndisturbance: {{bound: {WIND[place.name]}}}\n"
    radii = {"epsilon": Fraction(place.epsilon), "rho_a": Fraction(place.rho_a)}
    question = question_of(load_text(text, place.name), Options(**radii, conditions="hardware"))
    stage = bound(enclose(tube(plan(prove_metric(question)))))
    return stage.problem


def largest(search: Search, lanes: Callable[[Array], Lanes], most: float) -> float:
    """The largest number whose lane serves, in floats, by a grid that is refined; 0 if there is none."""
    low, high = most * 1e-3, most
    for _ in range(3):
        values = np.geomspace(low, high, 14)
        good = np.flatnonzero(search.least(lanes(values))[0] < 1)
        if not len(good):
            return 0.0
        low, high = values[good[-1]], values[min(good[-1] + 1, len(values) - 1)]
    return float(low)


def proven(problem: TubeProblem, setting: Setting) -> HardwareRecipe | None:
    """The least level that the kernel proves for a machine and a wind."""
    assert problem.machine is not None
    assert problem.wind is not None
    asked = Hardware(sample_time=setting.sample_time, delay=setting.delay, noise=setting.noise)
    own = replace(
        problem,
        machine=replace(problem.machine, asked=asked),
        wind=replace(problem.wind, bound=setting.wind),
    )
    recipe = recipe_at(Search(own, own.machine), setting)
    return recipe if recipe is not None and serves(own, recipe) else None


def machine(Ts: Fraction, delay: Fraction, noise: Fraction, wind: Fraction) -> Setting:
    """One machine, feedback and adaptation at one rate."""
    return Setting(sample_time=Ts, delay=delay, feedback_time=Ts, noise=noise, wind=wind, bandwidth=None)


def lanes(Ts: Array, late: float, noise: Array, wind: Array) -> Lanes:
    """Machines, with delays in sample times."""
    zero = np.zeros(np.broadcast_shapes(Ts.shape, noise.shape, wind.shape))
    return Lanes(
        Ts=Ts + zero,
        tau=late * Ts + zero,
        Tf=Ts + zero,
        nu=noise + zero,
        wbar=wind + zero,
        omega=zero + np.nan,
    )


def downwards(value: float) -> Iterator[Fraction]:
    """Decimals below a number that was found in floats."""
    return (round_down(value * (1 - step), 3) for step in (0.0, 2e-3, 1e-2) if value > 0)


def longest(search: Search, late: Fraction, noise: Fraction, wind: Fraction) -> float:
    """The largest sample time in s, in floats."""
    fixed = np.array(float(noise)), np.array(float(wind))
    return largest(search, lambda x: lanes(x, float(late), *fixed), 0.1 / search.rate)


def slowest(problem: TubeProblem, late: Fraction, noise: Fraction, wind: Fraction) -> float:
    """The largest sample time in ms that is proven to serve."""
    found = longest(Search(problem, problem.machine), late, noise, wind)
    served = (Ts for Ts in downwards(found) if proven(problem, machine(Ts, late * Ts, noise, wind)))
    return 1e3 * float(next(served, 0))


def most(problem: TubeProblem, *, noise: bool) -> float:
    """The largest noise, or wind, at 1 kHz and half a sample late."""
    search, Ts, zero = Search(problem, problem.machine), Fraction(1, 1000), Fraction(0)
    still, one = np.array(0.0), np.array(1e-3)
    found = largest(
        search,
        lambda x: lanes(one, 0.5, x, still) if noise else lanes(one, 0.5, still, x),
        0.05 if noise else 2.0,
    )
    pairs = ((value, zero) if noise else (zero, value) for value in downwards(found))
    served = (max(pair) for pair in pairs if proven(problem, machine(Ts, Ts / 2, *pair)))
    return float(next(served, 0))


def radius(problem: TubeProblem, column: tuple[str, int, int, str, bool], wind: Fraction) -> float:
    """The least tube that is found and proven for a machine, as a radius; 0 if there is none."""
    _, Ts, delay, noise, blows = column
    setting = machine(
        Fraction(Ts, 1000), Fraction(delay, 1000), Fraction(noise), wind if blows else Fraction(0)
    )
    recipe = proven(problem, setting)
    return 0.0 if recipe is None else float(recipe.level) / problem.constants.lower.below**0.5


def told(found: float, notes: float) -> str:
    """A number beside that of the notes."""
    own = f"{found:.3g}" if found else "-"
    return f"{own} / {notes:g}" if notes else own


def numbers() -> None:
    """Three tables, place by place."""
    problems = {place: problem_of(place) for place in PLACES}
    print("| largest sample time in ms | delay | " + " | ".join(name for name, _, _ in COLUMNS) + " |")
    print("|---|---|" + "---|" * len(COLUMNS))
    for place, problem in problems.items():
        rho, wind = float(problem.rho), Fraction(WIND[place.name])
        for i, late in enumerate(LATE):
            cells = [
                told(slowest(problem, late, Fraction(noise), wind if blows else Fraction(0)), notes[i])
                for (_, noise, blows), notes in zip(COLUMNS, place.times, strict=True)
            ]
            words = ("none", "half a sample", "one sample")[i]
            print(f"| {place.name}, rho {rho:.3g} | {words} | " + " | ".join(cells) + " |", flush=True)
    print("\n| at 1 kHz, half a sample late | largest noise | largest wind |\n|---|---|---|")
    for place, problem in problems.items():
        if place.noise:
            cells = [
                told(most(problem, noise=True), place.noise),
                told(most(problem, noise=False), place.wind),
            ]
            print(f"| {place.name}, rho {float(problem.rho):.3g} | " + " | ".join(cells) + " |", flush=True)
    print("\n| least radius; Ts and delay in ms | " + " | ".join(column[0] for column in TUBES) + " |")
    print("|---|" + "---|" * len(TUBES))
    for place, problem in problems.items():
        if place.tubes:
            wind = Fraction(WIND[place.name])
            cells = [
                told(radius(problem, column, wind), own)
                for column, own in zip(TUBES, place.tubes, strict=True)
            ]
            print(f"| {place.name}, rho {float(problem.rho):.3g} | " + " | ".join(cells) + " |", flush=True)


class Coarse(Search):
    """What is free looked for as in the notes: at the largest level, on a grid of bandwidths and floors."""

    points = 20

    def least(self, at: Lanes, dhat: Array | None = None) -> tuple[Array, Choice]:
        """The best point of the grid in every lane."""
        top = self.dbar - at.nu * float(self.plant.m.n_M) if dhat is None else dhat
        level = np.maximum(top * (1 - 1e-6), 1e-9 * self.dbar)[:, None]
        share = np.linspace(0, 1, self.points)
        low, high = np.log(self.rate / 4), np.log(DEADBEAT / at.Ts)[:, None]
        omega = np.repeat(np.exp(low + (high - low) * share), self.points, axis=1)
        f0 = np.tile(level * np.exp(-9 * share), (1, self.points))
        found = Choice(dhat=level + 0 * f0, omega=omega, f0=f0)
        values = self.needed(at[:, None], found)
        best = np.argmin(values, axis=1)
        lanes = np.arange(len(at.Ts))
        chosen = Choice(dhat=level[:, 0], omega=omega[lanes, best], f0=f0[lanes, best])
        return values[lanes, best], chosen


def attained(problem: TubeProblem) -> TubeProblem:
    """With every constant at the end of its enclosure that is attained."""
    assert problem.machine is not None
    assert problem.wind is not None
    machine = problem.machine
    own = replace(machine, constants=_attained(machine.constants), covariant=_attained(machine.covariant))
    wind = replace(problem.wind, constants=_attained(problem.wind.constants))
    return replace(problem, constants=_attained(problem.constants), machine=own, wind=wind)


def _attained(constants: Of) -> Of:
    if constants is None:
        return constants
    found = {}
    for item in fields(constants):  # type: ignore[arg-type]
        value = getattr(constants, item.name)
        if isinstance(value, Constant) and np.isfinite(value.above) and value.below > 0:
            at = value.above if item.name == "lower" else value.below
            found[item.name] = Constant(below=at, above=at)
    return replace(constants, **found)  # type: ignore[type-var]


def in_coordinates(problem: TubeProblem) -> TubeProblem:
    """Without the covariant forms of the theorem, and where the notes took L_G and D_Fx with these."""
    assert problem.machine is not None
    machine = replace(problem.machine, covariant=None)
    of_notes = {name: Constant(below=value, above=value) for name, value in OF_NOTES.items()}
    return replace(problem, machine=replace(machine, constants=replace(machine.constants, **of_notes)))


def cells() -> None:
    """Every sample time that is more than 5 % off the notes, and what one difference after another makes of it."""
    print("| place | delay | machine | notes | proven | constants attained | notes' forms | and grid |")
    print("|---|---|---|---|---|---|---|---|")
    for place in PLACES:
        problem = problem_of(place)
        curved = place.name == "three_state"
        forms = in_coordinates(problem) if curved else problem
        tried = ((problem, Search), (attained(problem), Search), (forms, Search), (forms, Coarse))
        for i, late in enumerate(LATE):
            for (name, noise, blows), notes in zip(COLUMNS, place.times, strict=True):
                if not notes[i]:
                    continue
                wind = Fraction(WIND[place.name]) if blows else Fraction(0)
                found = []
                for each, kind in tried:
                    found.append(1e3 * longest(kind(each, each.machine), late, Fraction(noise), wind))
                    if abs(found[0] / notes[i] - 1) <= 0.05:
                        break
                else:
                    own = " | ".join(f"{x:.3g}" for x in found)
                    where = f"{place.name} {float(problem.rho):.3g} | {float(late):g} | {name}"
                    print(f"| {where} | {notes[i]:g} | {own} |", flush=True)


def cost(
    names: Sequence[str] = (
        "hardware_orbit",
        "hardware_three",
        "hardware_state_dependent_input",
        "two_state_windows",
        "hardware_pvtol",
    ),
) -> None:
    """CPU time of a certification with B alone and with H alone, the second of two runs each."""
    print("| configuration | B, s | H, s | H over B |\n|---|---|---|---|")
    for name in names:
        spec, seconds = load(str(CONFIGS / f"{name}.yaml")), []
        for options in (Options(conditions="distance"), Options(conditions="hardware")):
            own = replace(spec, hardware=None) if options.conditions == "distance" else spec
            for _ in range(2):
                started = time.process_time()
                certify(own, options)
                took = time.process_time() - started
            seconds.append(took)
        print(f"| {name} | {seconds[0]:.2f} | {seconds[1]:.2f} | {seconds[1] / seconds[0]:.2f} |", flush=True)


def main() -> None:
    """What is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("numbers", "cells", "cost"))
    asked = parser.parse_args()
    {"numbers": numbers, "cells": cells, "cost": cost}[asked.what]()


if __name__ == "__main__":
    main()
