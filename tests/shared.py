"""What tests make once in a run: kept in its folder, so that every process of the run reads what one has made."""

import fcntl
import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

_FOLDER: Path | None = None


def keep_in(folder: Path | None) -> None:
    """Where this run keeps what is made; None: nothing is kept."""
    global _FOLDER  # noqa: PLW0603 - tests import this module, a fixture knows the folder
    _FOLDER = folder


def once(make: Callable[[], Any], *made_of: object) -> Any:
    """The value of `make`, which depends on `made_of` (and its words) alone; a copy of its own for each caller."""
    if _FOLDER is None:
        return make()
    _FOLDER.mkdir(parents=True, exist_ok=True)
    path = _FOLDER / hashlib.sha256(repr(made_of).encode()).hexdigest()
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # whoever comes second waits for what the first one makes
        if not path.exists():
            part = path.with_suffix(f".{os.getpid()}")
            part.write_bytes(pickle.dumps(make()))
            part.replace(path)
    return pickle.loads(path.read_bytes())
