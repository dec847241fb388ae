"""The files of a controller, and how they come into a folder: whole, and over nothing that tubecert did not write.

The first line of every file tells the hash of the rest: a file is replaced only while that is so, and only if it is a
regular file of the folder itself. No link is followed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Final

from tubecert.controller.data import HOME, Data, header
from tubecert.errors import TargetError
from tubecert.findings import Finding
from tubecert.printable import visible

RUNTIME: Final = ("controller.c", "controller.h", "selftest.c")  # by hand, the same for every certificate
DATA: Final = "controller_data.h"
README: Final = "README.txt"
_MARK: Final = re.compile(
    r"(?:/\* )?tubecert export, certificate (?:any|sha256:[0-9a-f]{64}), text (sha256:[0-9a-f]{64})(?: \*/)?"
)
_LARGEST: Final = 256_000_000  # bytes of a file that is read before it is replaced
_REMEDY: Final = "choose another folder with -o FOLDER, or move that file away"


def files_of(data: Data) -> dict[str, str]:
    """The text of every file, by its name."""
    files = {name: (HOME / name).read_text("utf-8") for name in RUNTIME}
    for name, text, line in ((DATA, header(data), "/* {} */\n"), (README, _readme(data), "{}\n")):
        mark = f"tubecert export, certificate {data.hash}, text {_digest(text.encode())}"
        files[name] = line.format(mark) + text
    return files


def _digest(text: bytes) -> str:
    return "sha256:" + hashlib.sha256(text).hexdigest()


def marked(content: bytes) -> bool:
    """Whether the first line of a file is the mark of tubecert, and the rest is what it was when that was written."""
    first, _, rest = content.partition(b"\n")
    found = _MARK.fullmatch(first.decode("ascii", "replace"))
    return found is not None and found[1] == _digest(rest)


def write(folder: str, files: Mapping[str, str]) -> None:
    """Writes the files, each as a whole; the folder is made if there is none.

    Raises `TargetError`; what stands in the folder is then as it was, or some of the files are new and none is half.
    """
    try:
        Path(folder).mkdir(exist_ok=True)
        home = os.open(Path(folder).resolve(strict=True), os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            if foreign := [name for name in files if not _replaceable(home, name)]:
                raise OSError(0, f"{foreign[0]} is there, and it is not what tubecert wrote")
            _put(home, files)
        finally:
            os.close(home)
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        message = f"cannot write {visible(folder)}: {why}"
        raise TargetError([Finding(code="TC120", message=message, help=_REMEDY)]) from error


def _replaceable(home: int, name: str) -> bool:
    """Whether there is no such file, or one that tubecert wrote and nobody changed."""
    try:
        handle = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=home)
    except FileNotFoundError:
        return True
    with os.fdopen(handle, "rb") as file:
        return stat.S_ISREG(os.fstat(handle).st_mode) and marked(file.read(_LARGEST))


def _put(home: int, files: Mapping[str, str]) -> None:
    """All of them under names of their own first, then all renamed: what fails, fails before anything is replaced."""
    part = f".{secrets.token_hex(8)}.part"
    try:
        for name, text in files.items():
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
            with os.fdopen(os.open(f".{name}{part}", flags, 0o666, dir_fd=home), "wb") as file:
                file.write(text.encode())
                file.flush()
                os.fsync(file.fileno())
        for name in files:
            os.replace(f".{name}{part}", name, src_dir_fd=home, dst_dir_fd=home)
    finally:
        for name in files:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(f".{name}{part}", dir_fd=home)


def _readme(data: Data) -> str:
    (n, m, _), plan = data.sizes, data.plan
    over = f"after {plan.steps} samples: the last command is held from then on, and STATUS_END is told"
    return Template((HOME / "README.txt.in").read_text("utf-8")).substitute(
        name=data.name,
        hash=data.hash,
        handed="xs, us, " if plan.at is None else "",
        period=float(data.sample_time),
        delay=float(data.delay),
        n=n,
        m=m,
        work=data.work,
        numbers=plan.steps * (n + m) if plan.kind == "PLAN_TABLE" else 0,
        end=over if plan.after == plan.steps else "never",
    )
