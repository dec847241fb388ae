"""Exported controllers: the compiled code against the module in Python at every sample of attacked runs, and its costs.

    python benchmarks/controllers.py [orbit windows pvtol bent single single_pvtol]

For each: certify, export in C and in Python, and let the compiled code drive 8 plants against the adversaries of
`simulate` for 1250 samples (10 000 in all). At every sample the module in Python gets the same measurement; where the
certificate is about rounding, what every sample loses is compared with what that allows for. Then the code is compiled
once more for what it costs: the time of a step in a loop of its own, bytes of stack, what it calls.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import numpy as np
from tubecert.export.assembly import controller_of
from tubecert.export.compiled import Compiled, Memory, compiled, compiler
from tubecert.export.controller import Controller
from tubecert.export.driven import Given, driven
from tubecert.export.folder import Exported, exported
from tubecert.export.vectors import vectors
from tubecert.library.driving import Attack

import tubecert as tc
from tubecert.enclosure.interval import Array
from tubecert.simulate.certified import adopted
from tubecert.simulate.setting import setting_of
from tubecert.spec import load_text

CONFIGS = Path(__file__).parents[1] / "configs"
LANES, SAMPLES = 8, 1250
ROWS = {  # words, configuration, changes of it, precision
    "orbit": ("a plan in time, u* played", "hardware_orbit", (), "double"),
    "windows": ("a plan through knots, windows", "two_state_windows", (), "double"),
    "pvtol": ("six states, two inputs", "hardware_pvtol", (), "double"),
    "bent": ("W and B depend on the state", "hardware_state_dependent_input", (), "double"),
    "single": ("in float", "hardware_orbit", (("rate: 500", "arithmetic: single\n  rate: 500"),), "single"),
    "single_pvtol": (
        "in float",
        "hardware_pvtol",
        (("rate: 250", "rate: 500, arithmetic: single"),),
        "single",
    ),
}
_LOOP = """
#include "%(name)s.h"
#include <stdio.h>
#include <time.h>
static const %(name)s_real Y[%(count)d][%(n)d] = {%(rows)s};
int main(void)
{
    %(name)s_state c;
    %(name)s_real u[%(m)d], sum = 0;
    struct timespec begin, end;
    long k;
    (void)%(name)s_start(&c, Y[0], u);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
    for (k = 0; k < %(steps)d; k++) {
        (void)%(name)s_step(&c, Y[k %% %(count)d], u);
        sum = sum + u[0];
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
    fprintf(stderr, "%%g\\n", (double)sum);
    printf("%%g\\n", ((double)(end.tv_sec - begin.tv_sec) * 1e9 + (double)(end.tv_nsec - begin.tv_nsec)) / %(steps)d);
    return 0;
}
"""
_STEPS = 200_000


@dataclass
class Both:
    """The compiled code; beside it the module in Python, whose largest difference is kept."""

    code: Compiled
    module: ModuleType
    others: list[object] = field(default_factory=list)
    difference: float = 0.0

    def memory(self) -> Memory:
        """What the compiled code keeps."""
        return self.code.memory()

    def measured(self, y: Array) -> Array:
        """What it measures."""
        return self.code.measured(y)

    @property
    def seconds(self) -> list[float]:
        """Of every step of the compiled code."""
        return self.code.seconds

    @property
    def status(self) -> Array:
        """What the compiled code returned."""
        return self.code.status

    def start(self, y: Array) -> Array:
        """Both of them."""
        self.others = [self.module.Controller() for _ in y]
        return self._compared(
            self.code.start(y), [own.start(row) for own, row in zip(self.others, y, strict=True)]
        )  # type: ignore[attr-defined]

    def step(self, y: Array) -> Array:
        """Both of them."""
        return self._compared(
            self.code.step(y), [own.step(row) for own, row in zip(self.others, y, strict=True)]
        )  # type: ignore[attr-defined]

    def _compared(self, found: Array, expected: list[Array]) -> Array:
        self.difference = max(self.difference, float(np.abs(found - np.array(expected)).max()))
        return found


def main(names: list[str]) -> None:
    """Prints one row for each."""
    print(
        "| | states, inputs | samples | C less Python, over the largest input | d(x\\*, x) over its level | escapes |"
        " rounding, of what it may | a step | stack |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names or list(ROWS):
        print(_row(*ROWS[name]), flush=True)


def _row(words: str, config: str, changes: tuple[tuple[str, str], ...], precision: str) -> str:
    text = (CONFIGS / f"{config}.yaml").read_text("utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    spec = load_text(text, config)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{config}.yaml"
        path.write_text(text, "utf-8")
        certificate = tc.certify(path).certificate
    controller = controller_of(certificate)
    files = exported(controller, precision=precision)  # type: ignore[arg-type]
    duration = SAMPLES * controller.sample_time
    setting = setting_of(adopted(spec, certificate.result), certificate.result, duration)
    attack = Attack(runs=LANES)
    with compiled(files, lanes=LANES) as code, tempfile.TemporaryDirectory() as folder:
        both = Both(code, _module(controller, folder))
        given = Given(count=LANES, seed=attack.seed, precision=precision)
        done = driven(setting, both, controller, given)  # type: ignore[arg-type]
    nanoseconds, stack = _costs(files, controller)
    return (
        f"| {words} (`{config}`) | {len(controller.states)}, {len(controller.inputs)} | {done.runs * done.samples} "
        f"| {both.difference / done.scale:.1e} | {done.distance / done.level:.3f} | {len(done.escapes)} "
        f"| {'' if done.lost is None else f'{done.lost:.2g}'} | {nanoseconds / 1000:.2f} us | {stack} B |"
    )


def _module(controller: Controller, folder: str) -> ModuleType:
    exported(controller, "python").save(folder)
    spec = importlib.util.spec_from_file_location(controller.name, Path(folder) / f"{controller.name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _costs(files: Exported, controller: Controller) -> tuple[float, int]:
    """Nanoseconds of a step, and bytes of stack of all functions together; nothing on the heap, or ValueError."""
    name, rows = controller.name, vectors(controller, single=files.precision == "single").y
    given = {
        "name": name, "n": len(controller.states), "m": len(controller.inputs), "count": len(rows), "steps": _STEPS,
        "rows": ", ".join("{" + ", ".join(map(repr, row)) + "}" for row in rows),
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        files.save(folder)
        (Path(folder) / "loop.c").write_text(_LOOP % given, "utf-8")
        cc = compiler() or "cc"
        command = [
            cc,
            "-O2",
            "-std=c99",
            "-D_POSIX_C_SOURCE=199309L",
            "-fstack-usage",
            f"{name}.c",
            "loop.c",
            "-lm",
        ]
        subprocess.run([*command, "-o", "loop"], cwd=folder, check=True)
        done = subprocess.run([str(Path(folder) / "loop")], capture_output=True, text=True, check=True)
        usage = next(Path(folder).glob(f"*{name}.su")).read_text("utf-8")
        stack = sum(int(line.split("\t")[1]) for line in usage.splitlines())
        subprocess.run([cc, "-O2", "-std=c99", "-c", f"{name}.c"], cwd=folder, check=True)
        needs = subprocess.run(
            ["nm", "-u", f"{name}.o"], cwd=folder, capture_output=True, text=True, check=True
        )
    if re.search(r"alloc|free|new", needs.stdout):
        raise ValueError(f"it calls {needs.stdout}")
    return float(done.stdout), stack


if __name__ == "__main__":
    main(sys.argv[1:])
