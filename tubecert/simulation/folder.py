"""The folder of a campaign: tried before any work is done; its summary comes last. Trusted: no."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.errors import TargetError
from tubecert.files import replace
from tubecert.findings import Finding

SUMMARY: Final = "summary.json"


@contextlib.contextmanager
def prepared(folder: str) -> Iterator[None]:
    """Makes the folder and tries to write to it, before any work is done; raises `TargetError`.

    A folder that was made here and in which nothing was written does not stay.
    """
    path = Path(folder)
    try:
        new = not path.exists()
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except (OSError, ValueError) as error:
        raise _unwritable(folder, error) from None
    try:
        yield
    finally:
        if new:
            with contextlib.suppress(OSError):  # it is not empty
                path.rmdir()


def written_to(
    folder: str, summary: object, files: Iterable[tuple[str, bytes]], outdated: Sequence[str]
) -> list[str]:
    """Writes files, then the summary, in place of `outdated` ones. Their names; raises `TargetError`.

    Who interrupts has the files so far and the summary: the runs are over, and to draw takes seconds.
    """
    written, text = [], json.dumps(summary, indent=1, sort_keys=True, allow_nan=False) + "\n"
    try:
        for name in (SUMMARY, *outdated):  # of earlier files, which are now replaced
            (Path(folder) / name).unlink(missing_ok=True)
        with contextlib.suppress(KeyboardInterrupt):
            for name, data in files:
                replace(Path(folder) / name, data)
                written.append(name)
        replace(Path(folder) / SUMMARY, text.encode())
    except OSError as error:
        raise _unwritable(folder, error) from None
    return [*written, SUMMARY]


def npz(arrays: Mapping[str, NDArray[np.generic]]) -> bytes:
    """Arrays as the bytes of a file of numpy; who interrupts has them without waiting for their compression."""
    buffer = io.BytesIO()
    try:
        np.savez_compressed(buffer, allow_pickle=False, **arrays)
    except KeyboardInterrupt:
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _unwritable(folder: str, error: Exception) -> TargetError:
    """The error for a folder that cannot be written to."""
    why = (getattr(error, "strerror", None) or str(error)).lower()
    message = f"cannot write to the folder {folder}: {why}"
    return TargetError([Finding(code="TC120", message=message, help="choose another folder with -o FOLDER")])
