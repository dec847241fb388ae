"""Where commands write: refused before any work is done if it would take the place of an input."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert import certificate
from tubecert.cli import keeper
from tubecert.errors import TargetError
from tubecert.findings import Finding
from tubecert.spec import Spec

if TYPE_CHECKING:
    from fractions import Fraction

    from tubecert.pipeline import Deadline

_REMEDY = "choose another file with -o FILE"


def refused(message: str, help: str = _REMEDY) -> TargetError:
    """The error about a file that is not written."""
    return TargetError([Finding(code="TC120", message=message, help=help)])


def spare(target: str, inputs: Mapping[str, str | Path | None]) -> None:
    """Raise `TargetError` for a target that would take the place of an input; `inputs` are named by what they are."""
    for what, source in inputs.items():
        if source is not None and target != certificate.STDOUT and certificate.same_file(target, source):
            raise refused(f"{target} is the {what} itself and would be overwritten")


def deadline_after(seconds: Fraction | None) -> Deadline | None:
    """When a search has to come to an end: so many seconds after the command was started."""
    from tubecert.pipeline import Deadline

    return None if seconds is None else Deadline.after(keeper.left_of(float(seconds)))


def plan_of(file: str, system: Spec) -> Path | None:
    """The plan file of the specification in `file`, if it has one."""
    table = system.trajectory.table
    return None if table is None else Path(file).parent / table.file
