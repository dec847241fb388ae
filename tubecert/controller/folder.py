"""The files of a controller, and how they come into a folder: whole, and over nothing that tubecert did not write.

The first line of every file tells the hash of the rest: a file is replaced only while that is so, and only if it is a
regular file of the folder itself. No link is followed.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Final

from tubecert.controller.data import HOME, Data, texts
from tubecert.errors import TargetError
from tubecert.files import replace
from tubecert.findings import Finding
from tubecert.printable import visible

RUNTIME: Final = ("controller.c", "controller.h", "selftest.c")  # by hand, the same for every certificate


def files_of(data: Data) -> dict[str, bytes]:
    """Every file by its name."""
    runtime = {name: (HOME / name).read_text("utf-8") for name in RUNTIME}
    return {name: marked(text.encode()) for name, text in (runtime | texts(data)).items()}


def marked(rest: bytes) -> bytes:
    """A file whose first line is the mark of tubecert, and tells the hash of the rest."""
    return b"/* tubecert export, sha256 of what follows: %s */\n" % sha256(rest).hexdigest().encode() + rest


def write(folder: str, files: Mapping[str, bytes]) -> None:
    """Writes the files, each as a whole; the folder is made if there is none.

    Raises `TargetError`; what stands in the folder is then as it was, or some of the files are new and none is half.
    """
    home = Path(folder)
    try:
        home.mkdir(exist_ok=True)
        if foreign := [name for name in files if not _replaceable(home / name)]:
            raise OSError(0, f"{foreign[0]} is there, and it is not what tubecert wrote")
        for name, content in files.items():
            replace(home / name, content)
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        message, help = f"cannot write {visible(folder)}: {why}", "choose another folder, or move it away"
        raise TargetError([Finding(code="TC120", message=message, help=help)]) from error


def _replaceable(path: Path) -> bool:
    """Whether there is nothing, or a file of the folder itself that tubecert wrote and nobody changed."""
    if not os.path.lexists(path):
        return True
    content = path.read_bytes() if stat.S_ISREG(path.lstat().st_mode) else b""
    return content == marked(content.partition(b"\n")[2])
