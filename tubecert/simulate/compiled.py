"""Compilation by numba, kept between runs where there is a folder for it. Imported by the kernels only, hence late."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba

KERNELS = ("program", "small", "geodesic", "feedback", "fast", "computer", "stepping", "compiled")


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function compiled when another kernel first needs it; it cannot be called from Python.

    Without the wrappers that a call from Python needs, half of the compilation is saved.
    """
    return _kernel(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function compiled when first called from Python; it runs without the GIL."""
    return _kernel(function, nogil=True, no_cfunc_wrapper=True)


def _kernel(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    """Numba keeps the machine code beside the package or in the user's cache.

    It forgets it when the function's own file changes. Kernels call each other across files, so what counts here is the
    content of all of them.
    """
    compiler: Any = numba.njit
    try:
        kernel: Any = compiler(cache=True, error_model="numpy", **options)(function)
    except RuntimeError:  # nowhere to write: compile in every process
        kernel = compiler(error_model="numpy", **options)(function)
    files: Any = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if hasattr(files, "_source_stamp"):
        files._source_stamp = _stamp()
    return kernel  # type: ignore[no-any-return]


@cache
def _stamp() -> str:
    """A digest of every file that may hold a kernel."""
    digest = hashlib.sha256()
    for name in KERNELS:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    return digest.hexdigest()
