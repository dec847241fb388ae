"""Eight systems written from their equations, each in three unit systems: what a new user types, one after the other.

python benchmarks/robots.py                     # all of them (half an hour of processor time)
python benchmarks/robots.py joint missile       # some
python benchmarks/robots.py joint --units 1     # in the units of the file only
python benchmarks/robots.py --until certify     # no further than this command

A row is one system in one unit system: `synth` without options, `certify`, `recheck`, `simulate`, `report`, with their
processor times in s. Numbers are in the units of the file: the rows of a system should agree. A row is kept in
`robots.runs` (`--folder DIR`) with all its files, and what is there is not done again.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from tubecert.letters import DISTANCE
from tubecert.spec import Spec, canonical, load

FOLDER = Path(__file__).parent / "robots"
NAMES = ("slider", "joint", "flexible_joint", "missile", "car", "crane", "arm", "boat")
DEGREE = Fraction(355, 113 * 180)  # rad, nearly: any ratio will do
COMMANDS = (
    ("synth", "spec.yaml"),
    ("certify", "spec.yaml", "--metric", "spec.metric.json", "-o", "certificate.json"),
    ("recheck", "certificate.json", "--spec", "spec.yaml"),
    ("simulate", "spec.yaml", "--certificate", "certificate.json", "-o", "simulation"),
    ("report", "certificate.json", "-o", "page.html"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """How many of the file's units one new unit is: of each state and input by its unit in the file, and of time."""

    name: str
    sizes: Mapping[str, Fraction]
    time: Fraction = Fraction(1)

    def of(self, unit: str) -> Fraction:
        """The size of a new unit, in the file's; a rate has the new time in it."""
        found = self.sizes.get(unit.removesuffix("/s"), Fraction(1))
        return found / self.time if unit.endswith("/s") else found

    def of_inputs(self, spec: Spec) -> Fraction:
        """The size of the inputs' new units: one for all, as Gamma, |h| and |u| are of all of them together."""
        named = dict(spec.units)
        return self.of(named.get(spec.inputs[0], ""))


UNITS = (
    Units(name="as written", sizes={}),
    Units(
        name="deg, mm, kN",
        sizes={"rad": DEGREE, "m": Fraction(1, 1000), "N": Fraction(1000), "N m": Fraction(1000)},
    ),
    Units(
        name="mrad, cm, ms",
        sizes={"rad": Fraction(1, 1000), "m": Fraction(1, 100)},
        time=Fraction(1, 1000),
    ),
)


def rescaled(spec: Spec, units: Units, folder: Path) -> dict[str, Any]:
    """The same system in other units, as the data of a specification; its plan, if it is a file, goes to `folder`."""
    named = dict(spec.units)
    sizes = {name: units.of(named.get(name, "")) for name in spec.states}
    sizes |= dict.fromkeys(spec.inputs, units.of_inputs(spec))
    T, x, u = units.time, [sizes[name] for name in spec.states], [sizes[name] for name in spec.inputs]
    data = canonical(spec)

    def old(text: str, factor: Fraction) -> str:
        """An expression of the new variables, times a factor."""
        scales = {**sizes, "t": T}
        words = re.sub(
            r"\b[A-Za-z_]\w*\b",
            lambda m: f"({scales[m[0]]}*{m[0]})" if m[0] in scales else m[0],
            text,
        )
        return f"{factor}*({words})"

    def number(text: str, size: Fraction) -> str:
        return str(Fraction(text) / size)

    def ends(box: Mapping[str, Any]) -> dict[str, Any]:
        return {
            name: [number(end, sizes[name]) for end in pair]
            if isinstance(pair, list)
            else number(pair, sizes[name])
            for name, pair in box.items()
        }

    system = data["system"]
    found = {
        **data,
        "system": {
            **{key: value for key, value in system.items() if key not in ("units", "parameters")},
            "f": [old(f, T / s) for f, s in zip(system["f"], x, strict=True)],
            "B": [
                [old(b, T * v / s) for b, v in zip(row, u, strict=True)]
                for row, s in zip(system["B"], x, strict=True)
            ],
        },
        "safe_set": ends(data["safe_set"]),
        "uncertainty": {"h": [old(h, 1 / v) for h, v in zip(data["uncertainty"]["h"], u, strict=True)]},
        "tube": {**data["tube"], "half_widths": ends(data["tube"]["half_widths"])},
        "trajectory": _plan(spec, data["trajectory"], old, (x, u, T), folder),
    }
    start = data["initial_state"]
    if "box" in start:
        found["initial_state"] = {"box": ends(start["box"])}
    else:
        found["initial_state"] = {"at": [number(value, s) for value, s in zip(start["at"], x, strict=True)]}
    return found


def _plan(spec: Spec, plan: Mapping[str, Any], old: Any, sizes: Any, folder: Path) -> dict[str, Any]:
    x, u, T = sizes
    found = dict(plan)
    if "horizon" in found:
        found["horizon"] = str(Fraction(found["horizon"]) / T)
    if plan["kind"] == "expressions":
        found |= {"x": [old(e, 1 / s) for e, s in zip(plan["x"], x, strict=True)]}
        found |= {"u": [old(e, 1 / s) for e, s in zip(plan["u"], u, strict=True)]}
    elif plan["kind"] == "equilibrium":
        found |= {"at": [str(Fraction(e) / s) for e, s in zip(plan["at"], x, strict=True)]}
        found |= {"input": [str(Fraction(e) / s) for e, s in zip(plan["input"], u, strict=True)]}
    else:
        assert spec.trajectory.table is not None
        knots = spec.trajectory.table.knots
        rows = [",".join(("t", *spec.states, *spec.inputs))]
        rows += [
            ",".join(repr(float(value / size)) for value, size in zip((t, *a, *b), (T, *x, *u), strict=True))
            for t, a, b in zip(knots.t, knots.x, knots.u, strict=True)
        ]
        (folder / plan["file"]).write_text("\n".join(rows) + "\n")
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Ran:
    """One command: its exit code, its processor time in s, and the line that says what came out."""

    code: int
    seconds: float
    said: str


def ran(words: tuple[str, ...], folder: Path) -> Ran:
    """Runs a command of tubecert in a folder; what it prints is kept beside its files."""
    with (folder / f"{words[0]}.txt").open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "tubecert", *words, "--no-progress"],
            cwd=folder,
            stdout=out,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONPATH": str(FOLDER.parents[1])},
        )
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    lines = (folder / f"{words[0]}.txt").read_text().splitlines()
    said = next((line for line in lines if line.strip()), "")
    return Ran(code=process.returncode, seconds=usage.ru_utime + usage.ru_stime, said=said)


def kept_row(folder: Path) -> dict[str, Ran]:
    """The commands that have been run in a folder."""
    path = folder / "row.json"
    rows = json.loads(path.read_text()) if path.exists() else {}
    return {name: Ran(code=code, seconds=seconds, said=said) for name, (code, seconds, said) in rows.items()}


def done(spec: Spec, units: Units, folder: Path, until: str) -> dict[str, Ran]:
    """The commands for one system in one unit system, until one says that there is no certificate."""
    kept = kept_row(folder)
    if not kept:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "spec.yaml").write_text(json.dumps(rescaled(spec, units, folder), indent=1))
    for words in COMMANDS:
        name = words[0]
        if name not in kept:
            kept[name] = ran(words, folder)
            rows = {name: [each.code, each.seconds, each.said] for name, each in kept.items()}
            (folder / "row.json").write_text(json.dumps(rows))
        if name == until or (kept[name].code and name in ("synth", "certify")):
            break
    return kept


def row(spec: Spec, units: Units, folder: Path, until: str) -> list[str]:
    """The cells of one row; numbers in the units of the file."""
    kept = done(spec, units, folder, until)
    times = [f"{kept[words[0]].seconds:.0f}" if words[0] in kept else "-" for words in COMMANDS]
    short = [f"{name} {each.code}: {each.said}" for name, each in kept.items() if each.code]
    ended = "; ".join(short) or "as hoped"
    if "certify" not in kept or kept["certify"].code:
        return [spec.name, units.name, "-", "-", "-", "-", *times, ended]
    named, T = dict(spec.units), units.time
    result = json.loads((folder / "certificate.json").read_text())["result"]
    gains = result[DISTANCE.key]["least_adaptation"]
    widths = ", ".join(
        f"{name} {float(units.of(named.get(name, ''))) * float(width):.3g}"
        for name, width in result["tube"]["half_widths"].items()
    )
    return [
        spec.name,
        units.name,
        f"{float(Fraction(str(result['metric']['rate'])) / T):.3g}",
        f"{float(gains['bandwidth']) / float(T):.4g}",
        f"{float(gains['adaptation_rate']) * float(units.of_inputs(spec)) ** 2:.4g}",
        widths,
        *times,
        ended,
    ]


def _parser() -> argparse.ArgumentParser:
    described = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=described)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}; all by default")
    parser.add_argument("--units", type=int, choices=range(1, len(UNITS) + 1), default=len(UNITS))
    parser.add_argument("--folder", default="robots.runs", help="where rows are kept with their files")
    parser.add_argument("--until", choices=[words[0] for words in COMMANDS], default=COMMANDS[-1][0])
    return parser


def main(arguments: list[str]) -> None:
    """Prints the table, a row as soon as it is known."""
    given = _parser().parse_args(arguments)
    kept, names = Path(given.folder), given.names or NAMES
    heads = ("system", "units", "rate", "omega", "Gamma", "half-widths", *(c[0] for c in COMMANDS), "ended")
    print("| " + " | ".join(heads) + " |")
    print("|---" * len(heads) + "|")
    for name in names:
        spec = load(str(FOLDER / f"{name}.yaml"))
        for number, units in enumerate(UNITS[: given.units], 1):
            print(
                "| " + " | ".join(row(spec, units, kept / f"{name}-{number}", given.until)) + " |", flush=True
            )


if __name__ == "__main__":
    main(sys.argv[1:])
