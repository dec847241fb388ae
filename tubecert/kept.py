"""What is kept between runs in the user's cache: only what this user's tubecert has written is read back.

A cache folder may be restored from elsewhere (a CI cache), shared, or broken, and what is read from it must not decide
anything. So every entry carries a keyed hash (HMAC-SHA256) of its place and content. The key is not in the cache: it is
in the user's state folder, readable by the user alone, or in the variable TUBECERT_CACHE_KEY (a secret of a CI service,
which those who may write its cache need not know). An entry without the right seal counts as absent: it only costs
time. Without a key nothing is kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import json
import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final

from tubecert.files import read_regular, replace

BYTES: Final = 32  # of a key, and of a seal
_FILE: Final = "cache.key"
_VARIABLE: Final = "TUBECERT_CACHE_KEY"
_LEAST: Final = 16  # characters of the variable
_LARGEST: Final = 64_000_000  # bytes of an entry
_unused: ContextVar[bool] = ContextVar("_unused", default=False)


@contextlib.contextmanager
def nothing_kept(wanted: bool = True) -> Iterator[None]:
    """Within the block nothing is read back and nothing is written."""
    token = _unused.set(wanted or _unused.get())
    try:
        yield
    finally:
        _unused.reset(token)


def kept_folder(kind: str) -> Path:
    """Where things of a kind are kept."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "tubecert" / kind


def read_kept(kind: str, name: str) -> Any:
    """The JSON data kept under a name; None if there are none, or they are not sealed as they were written."""
    key = None if _unused.get() else user_key()
    if key is None:
        return None
    try:
        content = read_regular(kept_folder(kind) / f"{name}.json", _LARGEST).decode()
        mark, _, text = content.partition("\n")
        if not hmac.compare_digest(mark.encode(), seal(key, f"{kind}/{name}", text.encode()).hex().encode()):
            return None
        return json.loads(text)
    except (OSError, ValueError, RuntimeError, RecursionError):
        return None


def keep(kind: str, name: str, data: Any) -> str:
    """Keep JSON data under a name; the reason if that cannot be done, else nothing."""
    if _unused.get():
        return ""
    key = user_key()
    if key is None:
        return "there is no place for a key that is the user's alone"
    text = json.dumps(data)
    try:
        folder = kept_folder(kind)
        folder.mkdir(parents=True, exist_ok=True)
        mark = seal(key, f"{kind}/{name}", text.encode()).hex()
        replace(folder / f"{name}.json", f"{mark}\n{text}".encode())
    except (OSError, RuntimeError) as error:
        return str(error)
    return ""


def seal(key: bytes, place: str, content: bytes) -> bytes:
    """What only those who know the key can write: bound to a place, so that entries cannot be exchanged."""
    return hmac.new(key, f"{place}\n".encode() + content, hashlib.sha256).digest()


def user_key() -> bytes | None:
    """The key of this user, made when first asked for; None if there is no place for it that is the user's alone."""
    given = os.environ.get(_VARIABLE, "")
    if len(given) >= _LEAST:
        return hashlib.sha256(os.fsencode(given)).digest()
    try:
        folder = _state_folder()
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / _FILE
        found = _read_key(path)
        if found is None:
            _write_key(path)
            found = _read_key(path)
    except (OSError, RuntimeError):
        return None
    return found


def _state_folder() -> Path:
    base = os.environ.get("XDG_STATE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".local" / "state") / "tubecert"


def _read_key(path: Path) -> bytes | None:
    """The key in a file, None if there is none, or if anybody else can read or has written it."""
    try:
        about = path.lstat()
        found = read_regular(path, BYTES + 1)
    except OSError:
        return None
    own = not hasattr(os, "geteuid") or (about.st_uid == os.geteuid() and not about.st_mode & 0o077)
    return found if own and stat.S_ISREG(about.st_mode) and len(found) == BYTES else None


def _write_key(path: Path) -> None:
    """A new key in place of one that may not be used; raises `OSError`."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{_FILE}.")  # of mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(BYTES))
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise
