"""The folder of a sweep: whose it is, so that what is there can be used, and nothing of another sweep."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

from tubecert.certificate import write_text
from tubecert.errors import TargetError
from tubecert.files import Kind, read
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.printable import printable_json, visible
from tubecert.records import FormError, from_json, to_json
from tubecert.spec.source import METRIC
from tubecert.sweep.grid import Axis
from tubecert.sweep.point import Task

FORMAT: Final = "tubecert-sweep/1"
NAME: Final = "sweep.json"
_REMEDY: Final = "choose another folder with -o FOLDER"
_KIND: Final = Kind(most=16_000_000, unreadable="TC120", too_large="TC120", help=_REMEDY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """An axis, as the folder says it."""

    key: str
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Everything that the points of a sweep follow from."""

    format: str
    specification: str
    specification_hash: str
    over: tuple[Range, ...]
    settings: Mapping[str, str]
    plan_hash: str | None
    metric_hash: str | None
    options: Mapping[str, str]
    versions: Mapping[str, str]


def identity(task: Task, axes: Sequence[Axis], plan_hash: str | None) -> Identity:
    """What a sweep is; raises `TargetError` if the metric file cannot be read."""
    metric, own = task.options.metric, task.options
    return Identity(
        format=FORMAT,
        specification=visible(task.path),
        specification_hash=_digest(task.text.encode()),
        over=tuple(Range(key=axis.path, values=axis.texts) for axis in axes),
        settings={each.path: each.text for each in task.fixed},
        plan_hash=plan_hash,
        metric_hash=None if metric is None else _digest(read(str(metric), METRIC)),
        options={"conditions": str(own.conditions or ""), "gap": str(own.gap), "budget": str(own.budget)},
        versions=versions(),
    )


def prepare(folder: Path, wanted: Identity) -> None:
    """Make the folder, or go on with the sweep that it holds; raises `TargetError` if it holds anything else."""
    found = _found(folder)
    if found is not None:
        other = [
            item.name for item in fields(wanted) if getattr(found, item.name) != getattr(wanted, item.name)
        ]
        if other:
            raise _refused(folder, f"it holds another sweep: {', '.join(other)} differ")
    try:
        for name in ("points", "figures"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _refused(folder, error.strerror or str(error)) from error
    tidy(folder)
    if found is None:
        text = json.dumps(to_json(wanted), sort_keys=True, indent=1, ensure_ascii=False)
        write_text(str(folder / NAME), printable_json(text) + "\n", _REMEDY)


def tidy(folder: Path) -> None:
    """Remove what a process that was killed had begun to write."""
    for part in (*folder.glob(".*.part"), *folder.glob("*/.*.part")):
        with contextlib.suppress(OSError):
            part.unlink()


def _found(folder: Path) -> Identity | None:
    """The sweep that is there; None where there is nothing yet."""
    if not folder.exists():
        return None
    if not folder.is_dir():
        raise _refused(folder, "it is no folder")
    if not (folder / NAME).exists():
        if any(not item.name.endswith(".part") for item in folder.iterdir()):
            raise _refused(folder, "it holds something else than a sweep")
        return None
    try:
        return from_json(Identity, json.loads(read(str(folder / NAME), _KIND)), NAME)
    except (FormError, ValueError) as error:
        raise _refused(folder, f"its {NAME} cannot be read") from error


def _refused(folder: Path, why: str) -> TargetError:
    message = f"cannot use the folder {visible(str(folder))}: {why}"
    return TargetError([Finding(code="TC120", message=message, help=_REMEDY)])


def _digest(data: bytes) -> str:
    return "sha256:" + hashlib.sha256(data).hexdigest()
