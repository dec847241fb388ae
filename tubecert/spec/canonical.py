"""`Spec` -> plain data: the effective specification, defaults written out, decimals exact, texts canonical.

The same system written differently (spacing, order of commutative operands, 0.5 or 1/2) gives the same data; a system
that owes something else (x + 0/y in place of x) does not. The data is itself a specification: written as YAML or JSON
it loads to the same system. What a section says its keys write (`keys.Section.written`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from tubecert.spec.load import FILE, VERSION
from tubecert.spec.metric import SYNTHESIS
from tubecert.spec.system import SYSTEM
from tubecert.spec.types import Spec

_OF_LOOPS: Final = ("uncertainty", "trajectory", "initial_state", "tube", "adaptation", "conditions")


def canonical(spec: Spec) -> dict[str, Any]:
    """JSON-ready data of the effective specification."""
    data = {"tubecert": VERSION, **FILE.written(spec, spec), "system": SYSTEM.written(spec, spec)}
    if spec.synthesis is not None:
        data["metric"] = {"synthesise": SYNTHESIS.written(spec.synthesis)}
    without = {"controller"} if spec.hardware is None else {"adaptation", "conditions"}
    if spec.lacks:  # then it is about a metric alone
        without |= {*_OF_LOOPS}
    return {name: own for name, own in data.items() if name not in without}


def as_file(data: Mapping[str, Any]) -> dict[str, Any]:
    """Canonical data as a file: that the tube is a ball goes without saying in the one, in the other it may not."""
    ball = "tube" in data and "hardware" not in data and "coordinates" not in data["tube"]
    return {**data, "tube": {**data["tube"], "coordinates": "identity"}} if ball else dict(data)
