"""Eight systems written from their equations, each in three unit systems: bare `synth`, then certificate B.

python benchmarks/robots.py                     # all of them (half an hour of processor time)
python benchmarks/robots.py joint missile       # some
python benchmarks/robots.py joint --units 1     # in the units of the file only

A row is one system in one unit system. Gains are printed in the units of the file: the rows of a system should agree.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from tubecert import pipeline
from tubecert.letters import DISTANCE
from tubecert.pipeline import Options
from tubecert.spec import Spec, Synthesis, canonical, load, load_text

FOLDER = Path(__file__).parent / "robots"
NAMES = ("slider", "joint", "flexible_joint", "missile", "car", "crane", "arm", "boat")
DEGREE = Fraction(355, 113 * 180)  # rad, nearly: any ratio will do
BY_B = Options(conditions="distance")


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
    sizes = {name: units.of(named.get(name, "")) for name in (*spec.states, *spec.inputs)}
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
class Row:
    """What came out, in the units of the file: processor times in s, rate and omega in 1/s, Gamma."""

    verdict: str
    seconds: tuple[float, float]
    rate: float = 0.0
    omega: float = 0.0
    adaptation_rate: float = 0.0
    half_widths: tuple[float, ...] = ()


def row(spec: Spec, units: Units, folder: Path) -> Row:
    """One system in one unit system: a metric and its certificate."""
    own = load_text(json.dumps(rescaled(spec, units, folder)), str(folder / "spec.yaml"))
    began = time.process_time()
    found = pipeline.synthesise(own, Synthesis(rate=None, objective="adaptation"), BY_B)
    between = time.process_time()
    if found.file is None:
        return Row(verdict=str(found.reason), seconds=(between - began, 0.0))
    result = pipeline.certify(found.spec, BY_B)
    seconds = between - began, time.process_time() - between
    gains = result.proof.of[DISTANCE.key]
    named, T = dict(spec.units), units.time
    inputs = {units.of(named.get(name, "")) for name in spec.inputs}
    assert result.tube is not None
    assert result.tube.half_widths is not None
    return Row(
        verdict=str(result.verdict),
        seconds=seconds,
        rate=float(found.file.rate / T),
        omega=float(gains.bandwidth / T),
        adaptation_rate=float(gains.adaptation_rate) * float(max(inputs)) ** 2,
        half_widths=tuple(
            float(units.of(named.get(name, ""))) * result.tube.half_widths[name] for name in spec.states
        ),
    )


def main(arguments: list[str]) -> None:
    """Prints the table, a row as soon as it is known."""
    count = int(arguments[arguments.index("--units") + 1]) if "--units" in arguments else len(UNITS)
    names = [word for word in arguments if word in NAMES] or NAMES
    print("| system | states | units | rate | omega | Gamma | half-widths | verdict | synth, certify (s) |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names:
        spec = load(str(FOLDER / f"{name}.yaml"))
        for units in UNITS[:count]:
            with tempfile.TemporaryDirectory() as folder:
                found = row(spec, units, Path(folder))
            widths = ", ".join(
                f"{name} {w:.3g}" for name, w in zip(spec.states, found.half_widths, strict=False)
            )
            cells = (
                name,
                len(spec.states),
                units.name,
                f"{found.rate:.3g}",
                f"{found.omega:.4g}",
                f"{found.adaptation_rate:.4g}",
                widths,
                found.verdict,
                ", ".join(f"{t:.3g}" for t in found.seconds),
            )
            print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
