"""Machine code kept between runs. A file is run only if it was written by this user, from this source, for this place.

Numba would unpickle, that is execute, whatever lies in its cache folder, and that folder may be restored from elsewhere
(a CI cache), shared, or simply broken. Here every file carries a keyed hash (HMAC-SHA256) of its name, of the stamp of
the source and libraries, and of its content, with the user's key (`kept`). A file without the right seal counts as
absent, and is compiled again; without a key nothing is kept.
"""

from __future__ import annotations

import contextlib
import hmac
import pickle
from pathlib import Path
from typing import Any, Final

from tubecert.files import read_regular, replace
from tubecert.kept import BYTES, seal, user_key

_MOST: Final = 200_000_000  # bytes of a file
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
        mark, payload = content[:BYTES], content[BYTES:]
        if not hmac.compare_digest(mark, self._seal(secret, payload)):
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
        return seal(secret, f"{self._path.name}\n{self._stamp}", payload)
