"""The planner's inputs, kept between runs in the user's cache folder. Untrusted: any plan is certified before use.

A cache that is broken, absent or unwritable changes nothing but the time a run takes; why it was not used is returned.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

from tubecert.kept import keep, read_kept

KIND = "plans"
Rows = tuple[tuple[str, ...], ...]  # decimals as text, row by row


def key(content: Mapping[str, object]) -> str:
    """The name of a plan: a hash of everything that it follows from."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def read(name: str) -> Rows | None:
    """The inputs kept under a name; None if there are none, or they are broken."""
    data = read_kept(KIND, name)
    try:
        return None if data is None else tuple(tuple(str(value) for value in row) for row in data)
    except TypeError:
        return None


def write(name: str, rows: Rows) -> str:
    """Keep inputs; the reason if that cannot be done, else nothing."""
    return keep(KIND, name, rows)
