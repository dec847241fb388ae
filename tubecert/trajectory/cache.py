"""The planner's inputs, kept between runs in the user's cache folder. Untrusted: any plan is certified before use.

A cache that is broken, absent or unwritable changes nothing but the time a run takes; why it was not used is returned.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

Rows = tuple[tuple[str, ...], ...]  # decimals as text, row by row


def key(content: Mapping[str, Any]) -> str:
    """The name of a plan: a hash of everything that it follows from."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def folder() -> Path:
    """Where plans are kept."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "tubecert" / "plans"


def read(name: str) -> Rows | None:
    """The inputs kept under a name; None if there are none, or they are broken."""
    try:
        data = json.loads((folder() / f"{name}.json").read_text(encoding="utf-8"))
        rows = tuple(tuple(str(value) for value in row) for row in data["u"])
        return rows if data["key"] == name and data["seal"] == _seal(rows) else None
    except (OSError, ValueError, KeyError, TypeError, RuntimeError):
        return None


def write(name: str, rows: Rows) -> str:
    """Keep inputs; the reason if that cannot be done, else nothing."""
    text = json.dumps({"key": name, "seal": _seal(rows), "u": rows})
    try:
        place = folder()
        place.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=place, suffix=".part")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            Path(temporary).replace(place / f"{name}.json")
        except BaseException:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()
            raise
    except (OSError, RuntimeError) as error:
        return str(error)
    return ""


def _seal(rows: Rows) -> str:
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()
