"""Machine code kept between runs. A file is run only if it was written by this user, from this source, for this place.

Numba would unpickle, that is execute, whatever lies in its cache folder, and that folder may be restored from elsewhere
(a CI cache), shared, or simply broken. Here every file carries a keyed hash (HMAC-SHA256) of its name, of the stamp of
the source and libraries, and of its content. The key is not in the cache: it is in the user's state folder, readable by
the user alone. A file without the right seal counts as absent, and is compiled again; without a key nothing is kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import pickle
import secrets
import stat
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, Final

from tubecert.files import read_regular, replace

_MOST: Final = 200_000_000  # bytes of a file
_KEY: Final = "kernels.key"
_BYTES: Final = 32  # of the key, and of a seal
Entries = list[tuple[Any, Any]]


class SealedFile:
    """The overloads of one kernel, in one file; the interface is that of numba's own cache files."""

    def __init__(self, path: Path, stamp: str) -> None:
        self._path = path
        self._stamp = stamp

    def load(self, key: Any) -> Any:
        """What was kept under a key, None if there is nothing that may be used."""
        return next((data for known, data in self._entries() if known == key), None)

    def save(self, key: Any, data: Any) -> None:
        """Keeps data under a key, if that is possible."""
        others = [entry for entry in self._entries() if entry[0] != key]
        self._write([*others, (key, data)])

    def flush(self) -> None:
        """Forgets everything."""
        self._write([])

    def _entries(self) -> Entries:
        secret = user_key()
        if secret is None:
            return []
        try:
            content = read_regular(self._path, _MOST)
        except OSError:
            return []
        seal, payload = content[:_BYTES], content[_BYTES:]
        if not hmac.compare_digest(seal, self._seal(secret, payload)):
            return []
        return list(pickle.loads(payload))  # noqa: S301 - nobody but this user's tubecert can have sealed it

    def _write(self, entries: Entries) -> None:
        secret = user_key()
        if secret is None:
            return
        from numba.core import serialize

        dumps: Any = serialize.dumps
        payload = dumps(entries)
        with contextlib.suppress(OSError):
            replace(self._path, self._seal(secret, payload) + payload)

    def _seal(self, secret: bytes, payload: bytes) -> bytes:
        about = f"{self._path.name}\n{self._stamp}\n".encode()
        return hmac.new(secret, about + payload, hashlib.sha256).digest()


@cache
def user_key() -> bytes | None:
    """The key of this user, made when first asked for; None if there is no place for it that is the user's alone."""
    try:
        folder = _state_folder()
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / _KEY
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
        found = read_regular(path, _BYTES + 1)
    except OSError:
        return None
    own = not hasattr(os, "geteuid") or (about.st_uid == os.geteuid() and not about.st_mode & 0o077)
    return found if own and stat.S_ISREG(about.st_mode) and len(found) == _BYTES else None


def _write_key(path: Path) -> None:
    """A new key in place of one that may not be used; raises `OSError`."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{_KEY}.")  # of mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(_BYTES))
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise
