"""The sampled loop asks nothing of the rooms about metrics, and they nothing of it."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from test_architecture import MODULES, PACKAGE, imported

OWN = tuple(
    f"tubecert.{room}" for room in ("sampled_loop", "loop_design", "controller", "simulation.sampled")
)
OF_METRICS = {
    "conditions", "kernel", "kinds", "search", "stages", "pipeline", "metric", "synthesis", "tube", "bounds",
}  # fmt: skip
ADAPTIVE = "tubecert.simulation.adaptive"
RESULT = "tubecert.certificate.result"  # names constants, gains and kinds
SHARED = [
    "tubecert.spec",
    "tubecert.lint",
    "tubecert.model",
    "tubecert.trajectory.make",
    "tubecert.planner.propose",
    "tubecert.certificate.file",
    "tubecert.certificate.effective",
    "tubecert.library.specification",
    "tubecert.report.page",
    "tubecert.report.html",
    "tubecert.report.markdown",
    "tubecert.report.progress",
    "tubecert.report.figures_axes",
    "tubecert.simulation.plans",
    "tubecert.simulation.figures",
]
LOADS = """
import importlib, json, sys
loaded = {}
for name in json.loads(sys.argv[1]):
    before = set(sys.modules)
    importlib.import_module(name)
    loaded[name] = sorted(set(sys.modules) - before)
print(json.dumps(loaded))
"""


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def is_about_metrics(module: str) -> bool:
    room = module.split(".")[1] if module.startswith("tubecert.") else ""
    return room in OF_METRICS or module.startswith(ADAPTIVE) or module == RESULT


def is_its_own(module: str) -> bool:
    return module.startswith(OWN)


@pytest.mark.slow
def test_what_the_sampled_loop_imports_loads_no_room_of_metrics():
    """Each module is charged with what it is the first to load."""
    names = SHARED + list(filter(is_its_own, map(module_of, MODULES)))
    assert "tubecert.sampled_loop.theorem" in names
    command = [sys.executable, "-c", LOADS, json.dumps(names)]
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=True)
    charged = {name: list(filter(is_about_metrics, new)) for name, new in json.loads(done.stdout).items()}
    assert {name: found for name, found in charged.items() if found} == {}


def test_neither_names_the_other_not_even_for_types():
    wrong = []
    for path in MODULES:
        foreign = is_its_own if is_about_metrics(module_of(path)) else is_about_metrics
        if is_its_own(module_of(path)) or foreign is is_its_own:
            names = imported(ast.parse(path.read_text(encoding="utf-8")))
            wrong += [f"{module_of(path)} imports {name}" for name in sorted(names) if foreign(name)]
    assert wrong == []
