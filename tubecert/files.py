"""Files that are replaced as a whole, and what is kept between runs in the user's cache.

A cache entry that is broken, altered, absent or unwritable counts as absent: it only costs time.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any


def replace(path: Path, data: bytes) -> None:
    """Write to a temporary name beside it and rename: an interruption leaves the old file or the new one.

    A link keeps pointing where it points. Raises `OSError`.
    """
    path = path.resolve()
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


def kept_folder(kind: str) -> Path:
    """Where things of a kind are kept."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "tubecert" / kind


def read_kept(kind: str, name: str) -> Any:
    """The JSON data kept under a name; None if there are none, or they are not sealed as they were written."""
    try:
        kept = json.loads((kept_folder(kind) / f"{name}.json").read_text(encoding="utf-8"))
        return kept["data"] if kept["key"] == name and kept["seal"] == seal(kept["data"]) else None
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, RecursionError):
        return None


def keep(kind: str, name: str, data: Any) -> str:
    """Keep JSON data under a name; the reason if that cannot be done, else nothing."""
    text = json.dumps({"key": name, "seal": seal(data), "data": data})
    try:
        folder = kept_folder(kind)
        folder.mkdir(parents=True, exist_ok=True)
        replace(folder / f"{name}.json", text.encode())
    except (OSError, RuntimeError) as error:
        return str(error)
    return ""


def seal(data: Any) -> str:
    """A hash of JSON data."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
