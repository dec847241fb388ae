"""Files that users name are read here and nowhere else, and files are replaced as a whole.

A name may stand for anything: a pipe that nobody writes to, a device without end, a folder. Only regular files are
read, and not more of them than their kind allows.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
import tempfile
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any, Final

from tubecert.errors import TargetError
from tubecert.findings import Finding, Location
from tubecert.printable import visible

STDIN: Final = "-"
_LISTED: Final = 1000  # files of a folder that are looked at for a name that was mistyped
_NEAR: Final = 0.72  # how alike two names are then, from 0 to 1: g.yml and g.yaml


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """What a user names a file for: how large one may be, the codes of its findings, and what to give instead."""

    most: int
    unreadable: str
    too_large: str
    help: str = ""


def read(path: str, kind: Kind) -> bytes:
    """The bytes of a regular file; raises `TargetError` for anything else, and for more bytes than its kind allows."""
    try:
        with _opened(path) as file:
            size = os.fstat(file.fileno()).st_size
            data = b"" if size > kind.most else file.read(kind.most + 1)
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        message = f"cannot read '{visible(path)}': {reason}"
        help = (isinstance(error, FileNotFoundError) and _beside(path)) or kind.help
        raise TargetError([Finding(code=kind.unreadable, message=message, help=help)]) from None
    return _within(path, data, max(size, len(data)), kind)


def _beside(path: str) -> str:
    """A hint at the file in the same folder that has nearly the name of a missing one; empty if none has."""
    wanted = Path(path)
    try:
        with os.scandir(wanted.parent) as found:
            names = sorted(entry.name for entry in islice(found, _LISTED) if entry.is_file())
    except OSError:
        return ""
    near = get_close_matches(wanted.name, names, n=1, cutoff=_NEAR)
    return f"there is {visible(str(wanted.with_name(near[0])))}" if near else ""


def read_regular(path: Path, most: int) -> bytes:
    """The first bytes of a regular file; raises `OSError` for anything else."""
    with _opened(path) as file:
        return bytes(file.read(most))


def read_stdin(kind: Kind) -> bytes:
    """What is on stdin, within the limit of its kind; raises `TargetError`."""
    try:
        data = b"" if sys.stdin is None else sys.stdin.buffer.read(kind.most + 1)
    except OSError as error:
        message = f"cannot read stdin: {error.strerror or error}"
        raise TargetError([Finding(code=kind.unreadable, message=message, help=kind.help)]) from None
    return _within("<stdin>", data, len(data), kind)


def _within(path: str, data: bytes, size: int, kind: Kind) -> bytes:
    if size <= kind.most:
        return data
    message = f"the file is larger than {kind.most:,} bytes"
    place = Location(file=path, line=1, column=1)
    raise TargetError([Finding(code=kind.too_large, message=message, location=place, help=kind.help)])


def _opened(path: str | Path) -> Any:
    """A regular file, opened for reading; raises `OSError` for anything else, without waiting for it."""
    # Without O_NONBLOCK the call would wait for somebody to open the other end of a pipe.
    flags = (
        os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    )
    handle = os.open(path, flags)
    try:
        mode = os.fstat(handle).st_mode
        if not stat.S_ISREG(mode):
            raise OSError(0, f"it is {_name(mode)}, not a regular file")
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def _name(mode: int) -> str:
    if stat.S_ISDIR(mode):
        return "a folder"
    if stat.S_ISFIFO(mode):
        return "a pipe"
    return "a socket" if stat.S_ISSOCK(mode) else "a device"


def stem_of(certificate: str) -> str:
    """`plant` for `plant.certificate.json`: what is made of a certificate is called after it."""
    return certificate.removesuffix(".json").removesuffix(".certificate")


def replace(path: Path, data: bytes) -> None:
    """Write to a temporary name beside it and rename: an interruption leaves the old file or the new one.

    A link keeps pointing where it points. What is no regular file (a device, a pipe) is never replaced by one. Raises
    `OSError`.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        raise OSError(errno.EEXIST, f"it is {_name(path.stat().st_mode)}, not a regular file")
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        Path(temporary).chmod(0o666 & ~mask)
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise
