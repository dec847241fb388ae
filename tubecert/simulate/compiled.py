"""Compilation by numba, kept between runs where there is a folder for it. Imported by the kernels only, hence late."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function compiled when first called; it runs without the GIL.

    Numba keeps the machine code beside the package or in the user's cache, and forgets it when the function's own file
    changes. Kernels call each other across files, so what counts here is the content of all of them.
    """
    options = {"nogil": True, "error_model": "numpy"}
    try:
        kernel: Any = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # nowhere to write: compile in every process
        kernel = numba.njit(**options)(function)
    files = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if hasattr(files, "_source_stamp"):
        files._source_stamp = _stamp()
    return kernel  # type: ignore[no-any-return]


@cache
def _stamp() -> str:
    """A digest of every file that may hold a kernel."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
