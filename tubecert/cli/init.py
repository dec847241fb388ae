"""`init`: a commented specification to start from, which certifies as it is."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Final

from tubecert import certificate
from tubecert.cli.guard import write_stdout
from tubecert.cli.targets import refused
from tubecert.errors import TargetError
from tubecert.printable import visible

_BESIDE: Final[Mapping[str, tuple[str, ...]]] = {"csv": ("plan.csv",)}
"""Files that a template needs beside it."""


def run(template: str, target: str | None, *, quiet: bool) -> None:
    """Write a template to a file that does not exist yet (`-`: to stdout); raises `TargetError`."""
    if target is not None and target != certificate.STDOUT and not Path(target).suffix:
        raise refused(f"{target} has no suffix", f"write tubecert init {target}.yaml")
    text = _text(f"{template}.yaml")
    if target == certificate.STDOUT:
        write_stdout(text)
        return
    name = f"{template}.yaml" if target is None else target
    text = text.replace(f"tubecert certify {template}.yaml", _command(name))
    beside = [(str(Path(name).with_name(file)), _text(file)) for file in _BESIDE.get(template, ())]
    for file, _ in beside:
        if Path(file).exists():
            raise _refused(f"{file} exists and is not overwritten")
    _create(name, text)
    for file, content in beside:
        _create(file, content)
    if not quiet:
        write_stdout(f"{visible(name)}: a specification that certifies as it is\n  {_command(name)}\n")


def _text(file: str) -> str:
    return (resources.files("tubecert") / "templates" / file).read_text(encoding="utf-8")


def _command(name: str) -> str:
    return f"tubecert certify {visible(shlex.quote(name))}"


def _create(name: str, text: str) -> None:
    try:
        data = text.encode()
        with Path(name).open("xb") as file:
            file.write(data)
    except FileExistsError:
        raise _refused(f"{name} exists and is not overwritten") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise _refused(f"cannot write {name}: {reason}") from None


def _refused(message: str) -> TargetError:
    return refused(message, "choose another file: tubecert init FILE")
