"""Every shipped machine and its variants: certified, rechecked, simulated, exported by the command line; one table.

    python benchmarks/sampled_loop.py                    everything, as Markdown on stdout
    python benchmarks/sampled_loop.py orbit --runs 100   rows whose name contains a word; runs of simulate

Beside every half-width stands what a search in floats, with remainders bounded by hand, had found before there was a
proof: one tube for ever where nothing else is said. The ratio is the geometric mean (that of the widest state). Times
are CPU seconds, of whole commands but for `proof`, which is the inequalities alone; the memory is the peak of certify.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from statistics import geometric_mean
from typing import Any

from tubecert.loop_design.certification import ask
from tubecert.sampled_loop.record import read
from tubecert.sampled_loop.theorem import check
from tubecert.spec import Spec, load
from tubecert.spec.override import Setting

CONFIGS = Path(__file__).parent.parent / "configs"
HEAD = (
    "machine",
    "half-widths at first",
    "in the long run",
    "floats",
    "ratio",
    "inputs used of what is there",
    "certify s",
    "proof s",
    "recheck s",
    "MB",
    "recheck, simulate, export",
)
PVTOL_NOISE = "{{px: {0}, pz: {0}, phi: {0}, vx: {1}, vz: {1}, w: {1}}}"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A file of configs/, keys that are set, and the half-widths in floats: of the first stage, of the last one."""

    name: str
    file: str
    floats: tuple[float, ...]
    later: tuple[float, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)


def _moving(name: str, floats: tuple[float, ...], **settings: str) -> Case:
    own = {key.replace("__", "."): value for key, value in settings.items()}
    wished = _wishes(("px", "pz", "phi", "vx", "vz", "w"), floats)
    return Case(name=f"pvtol_moving {name}", file="pvtol_moving", floats=floats, settings=own | wished)


def _orbit(name: str, floats: tuple[float, ...], settings: Mapping[str, str]) -> Case:
    wished = _wishes(("x1", "x2"), floats)
    return Case(name=f"orbit {name}", file="orbit", floats=floats, settings={**settings, **wished})


def _wishes(names: tuple[str, ...], floats: tuple[float, ...]) -> dict[str, str]:
    """In place of the wishes of the file, which are about another question: 1.2 times what floats had found."""
    told = ", ".join(f"{name}: {1.2 * width:.3g}" for name, width in zip(names, floats, strict=False))
    return {"tube.half_widths": f"{{{told}}}"}


CASES = (
    Case(name="three", file="three", floats=(0.01004, 0.01008, 0.01), later=(7e-5, 7e-5, 1.5e-4)),
    Case(
        name="state_dependent_input",
        file="state_dependent_input",
        floats=(0.02, 0.0011),
        later=(1.5e-4, 2.1e-4),
    ),
    Case(name="orbit", file="orbit", floats=(0.0058, 0.0051)),
    Case(name="pvtol", file="pvtol", floats=(0.0053, 0.00016, 0.0016, 0.0072, 0.0006, 0.0046)),
    Case(name="pvtol_mass", file="pvtol_mass", floats=(0.0053, 0.0001, 0.0015, 0.0066, 0.0017, 0.0048)),
    Case(name="pvtol_moving", file="pvtol_moving", floats=(0.0058, 0.0009, 0.0019, 0.0088, 0.0022, 0.0049)),
    Case(name="two_state_plan", file="two_state_plan", floats=(0.0011, 0.0017), later=(2.4e-4, 4.8e-5)),
    Case(name="rest", file="rest", floats=(0.01, 0.0017), later=(0.001, 0.0002)),
    *(
        _orbit(f"start within {r}", floats, {"initial_state": f"{{within: {r}}}"})
        for r, floats in {"0.6": (0.71, 0.6), "0.8": (1.03, 0.8), "1": (1.2, 1.0)}.items()
    ),
    *(
        _orbit(
            f"slope of h {s}",
            floats,
            {
                "uncertainty.h": f'["-2*sin(2*t) - {s}*norm(x1, x2)"]',
                "limits": "{u: [-30, 30]}" if s == "5" else "{u: [-8, 8]}",
            },
        )
        for s, floats in {"0.5": (0.0088, 0.0043), "2": (0.0046, 0.0097), "5": (0.0051, 0.0208)}.items()
    ),
    *(
        _moving(f"wind {w}", (px,), disturbance__bound=w)
        for w, px in {"0.05": 0.029, "0.2": 0.117, "0.5": 0.33}.items()
    ),
    *(
        _moving(f"mass +-{share} %", floats, system__parameters__m=ends)
        for share, ends, floats in (
            (3, "[0.4714, 0.5006]", (0.006, 0.0009)),
            (10, "[0.4374, 0.5346]", (0.0061, 0.0011)),
            (20, "[0.3888, 0.5832]", (0.0067, 0.0016)),
        )
    ),
    *(
        _moving(f"noise x {scale}", floats, hardware__noise=noise)
        for scale, noise, floats in (
            (
                0.1,
                PVTOL_NOISE.format(0.0005, 0.002),
                (0.015, 0.005, 0.005, 0.022, 0.008, 0.022),
            ),
            (
                0.3,
                PVTOL_NOISE.format(0.0015, 0.006),
                (0.036, 0.013, 0.013, 0.052, 0.023, 0.055),
            ),
            (
                1,
                PVTOL_NOISE.format(0.005, 0.02),
                (0.117, 0.049, 0.041, 0.168, 0.081, 0.176),
            ),
        )
    ),
    Case(name="two_state_family", file="two_state_family", floats=(0.059, 0.05), later=(0.012, 0.01)),
    Case(
        name="car_family",
        file="car_family",
        floats=(0.075, 0.022, 0.02, 0.023),
        later=(0.006, 0.002, 0.002, 0.002),
    ),
    Case(
        name="pvtol_family",
        file="pvtol_family",
        floats=(0.032, 0.011, 0.01, 0.035, 0.011, 0.054),
        later=(0.015, 0.007, 0.004, 0.019, 0.008, 0.01),
    ),
)


@dataclass(frozen=True, kw_only=True)
class Done:
    """A command: its exit code, CPU seconds, peak memory in MB."""

    code: int
    seconds: float
    memory: float


def main() -> None:
    """The table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("word", nargs="?", default="")
    parser.add_argument("--runs", type=int, default=1000)
    asked = parser.parse_args()
    print("|", " | ".join(HEAD), "|")
    print("|", " | ".join("---" for _ in HEAD), "|")
    for case in CASES:
        if asked.word in case.name:
            with tempfile.TemporaryDirectory() as folder:
                print("|", " | ".join(_row(case, Path(folder), asked.runs)), "|", flush=True)


def _row(case: Case, folder: Path, runs: int) -> list[str]:
    spec, certificate = str(CONFIGS / f"hardware_{case.file}.yaml"), str(folder / "certificate.json")
    sets = [word for key, value in case.settings.items() for word in ("--set", f"{key}={value}")]
    certified = _command("certify", spec, *sets, "-o", certificate, "-q")
    result = json.loads(Path(certificate).read_text("utf-8"))["result"]
    if result["verdict"] != "certified":
        lacks = ", ".join(f"{lack['kind']} {lack['where']}" for lack in result["lacks"])
        blank = [""] * (len(HEAD) - 8)
        return [
            case.name,
            lacks,
            "",
            _numbers(case.floats),
            *blank[:2],
            f"{certified.seconds:.1f}",
            *[""] * 4,
        ]
    question = load(spec, [Setting(path=path, text=text) for path, text in case.settings.items()])
    first, last = ([result["tube"][i]["half_widths"][name] for name in question.states] for i in (0, -1))
    checked = _command("recheck", certificate, "-q")
    played = _command(
        "simulate",
        spec,
        "--certificate",
        certificate,
        "--runs",
        str(runs),
        "-o",
        str(folder / "runs"),
        "-q",
    )
    exported = _command("export", certificate, "-o", str(folder / "controller"), "-q")
    return [
        case.name,
        _numbers(first),
        _numbers(last),
        _numbers(case.floats) + (f"; {_numbers(case.later)}" if case.later else ""),
        _ratios(case, first, last),
        _inputs(result),
        f"{certified.seconds:.1f}",
        f"{_proof(question, certificate):.2f}",
        f"{checked.seconds:.1f}",
        f"{certified.memory:.0f}",
        ", ".join("yes" if done.code == 0 else f"exit {done.code}" for done in (checked, played, exported)),
    ]


def _ratios(case: Case, first: list[Any], last: list[Any]) -> str:
    """The ratio to the floats, of the first stage and of the last one: geometric mean, and that of the widest state."""
    pairs = [(first, case.floats), (last, case.later)] if case.later else [(first, case.floats)]
    texts = []
    for widths, floats in pairs:
        ratios = [float(own) / before for own, before in zip(widths, floats, strict=False)]
        texts.append(f"{geometric_mean(ratios):.2f} ({max(ratios):.2f})")
    return ", ".join(texts)


def _numbers(values: Any) -> str:
    return " ".join(f"{float(value):.2g}" for value in values)


def _inputs(result: Mapping[str, Any]) -> str:
    """What every input takes, and its limits."""
    texts = []
    for own in result["inputs"]:
        low, high = (f"{float(end):.3g}" for end in own["range"])
        limits = own.get("limits")
        within = "" if not limits else f" of {float(limits[0]):g}..{float(limits[1]):g}"
        texts.append(f"{own['input']} {low}..{high}{within}")
    return ", ".join(texts)


def _proof(question: Spec, certificate: str) -> float:
    """CPU seconds of the inequalities alone, for the stages and the recipe of a certificate."""
    own = read(Path(certificate).read_text("utf-8"), certificate).result
    assert own.controller is not None
    assert own.recipe is not None
    loop = ask(question).loop
    tables = own.controller
    started = time.process_time()
    assert check(loop, tables, own.tube, own.recipe).verdict is own.verdict
    return time.process_time() - started


def _command(*words: str) -> Done:
    process = subprocess.Popen(
        [sys.executable, "-m", "tubecert", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Done(code=process.returncode, seconds=used.ru_utime + used.ru_stime, memory=used.ru_maxrss / 1024)


if __name__ == "__main__":
    main()
