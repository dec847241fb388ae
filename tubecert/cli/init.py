"""`init`: a commented specification to start from, which certifies as it is."""

from __future__ import annotations

import shlex
from importlib.resources import files
from pathlib import Path
from typing import Final

from tubecert import certificate
from tubecert.asking import Choice, Flag, Text, refuse
from tubecert.certificate.file import refused
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.errors import TargetError
from tubecert.printable import visible

_BESIDE: Final = {"csv": ("plan.csv",)}  # files that a template needs beside it
TEMPLATES: Final = (
    "regulation", "tracking", "machine", "pvtol", "car", "crane", "arm2", "quadrotor", "csv",
)  # fmt: skip
_WORDS: Final = {
    "file": Text("The new file; - is stdout.  [TEMPLATE.yaml]", "FILE", place=True, optional=True),
    "template": Choice("What to start from.", short="-t", words=TEMPLATES),
    "output": Text("The same as FILE.", "FILE", short="-o"),
    "quiet": Flag("Say nothing.", short="-q"),
}


@command(_WORDS, shared=("debug",))
def init(
    how: Output,
    file: str | None = None,
    *,
    template: str = "regulation",
    output: str | None = None,
    quiet: bool = False,
) -> None:
    """Write a commented specification to start from; it certifies as it is. Nothing is overwritten."""
    if file is not None and output is not None:
        refuse("--output", "", f"FILE and --output name the same: give {file} or {output}")
    if file in TEMPLATES:
        refuse("FILE", "", f"{file} is a template: write --template {file}")
    target = output if file is None else file
    if target == certificate.STDOUT:
        write_stdout(_text(f"{template}.yaml"))
        return
    if target is not None and not Path(target).suffix:
        raise refused(f"{target} has no suffix", f"write tubecert init {target}.yaml")
    name = target or f"{template}.yaml"
    line = f"tubecert certify {visible(shlex.quote(name))}"
    text = _text(f"{template}.yaml").replace(f"tubecert certify {template}.yaml", line)
    beside = {str(Path(name).with_name(each)): _text(each) for each in _BESIDE.get(template, ())}
    if there := [each for each in beside if Path(each).exists()]:
        raise _refused(f"{there[0]} exists and is not overwritten")
    for each, content in {name: text, **beside}.items():
        _create(each, content)
    if not quiet:
        write_stdout(f"{visible(name)}: a specification that certifies as it is\n  {line}\n")


def _text(file: str) -> str:
    return (files("tubecert") / "templates" / file).read_text(encoding="utf-8")


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
