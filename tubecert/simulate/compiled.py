"""Compilation by numba, kept between runs where there is a folder for it. Imported by the kernels only, hence late.

What is kept is sealed (`sealed`): machine code that this user has not compiled from these files is never run.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

if "numba" not in sys.modules:
    os.environ.setdefault("NUMBA_OPT", "1")  # compiles faster by a third, and the loops are as fast

import llvmlite
import numba
from numba.core.caching import IndexDataCacheFile
from numba.core.options import DefaultOptions

from tubecert.progress import Phase, Progress, Step
from tubecert.simulate.parts import EntryCompiler, PartCompiler
from tubecert.simulate.sealed import SealedFile

Kernel: TypeAlias = Callable[..., Any]  # a function of whatever numba compiles it for
_njit: Any = numba.njit
_NAMES: list[str] = []  # of all kernels
# Kernels make no arrays, and their callers hold those that they work on: without counting references, which numba does
# atomically for every member of every tuple, the loops are twice as fast.
_COMMON: dict[str, object] = {
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    **({"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}),
}
KERNELS = (
    "program", "small", "layout", "loops", "geodesic", "feedback", "fast",
    "stepping", "compiled", "parts", "pointed",
)  # fmt: skip


def compiled(function: Kernel) -> Kernel:
    """The function as a part of what other kernels call; it cannot be called from Python."""
    return _part(function)


def folded(function: Kernel) -> Kernel:
    """The same, made a part of each kernel that calls it, which should be one or two."""
    return _part(function, forceinline=True)


def entry(function: Kernel) -> Kernel:
    """The function compiled when first called from Python, with all that it calls; it runs without the GIL.

    Numba finds a folder for the machine code: beside the package, or in the user's cache.

    It would trust every file there that is not older than the function's own source. Kernels call each other across
    files, so what counts here is the content of all of them, and the seal.
    """
    _NAMES.append(function.__name__)
    options = {**_COMMON, "pipeline_class": EntryCompiler, "nogil": True}
    try:
        kernel: Any = _njit(cache=True, **options)(function)
        folder, name = kernel._cache.cache_path, kernel._cache._impl.filename_base
        if not isinstance(kernel._cache._cache_file, IndexDataCacheFile):
            raise TypeError("this numba keeps its files in another way")
        kernel._cache._cache_file = SealedFile(Path(folder) / f"{name}.kernel", _stamp())
    except (RuntimeError, AttributeError, TypeError):  # nowhere to write: compile in every process
        kernel = _njit(**options)(function)
    return kernel  # type: ignore[no-any-return]


def inlined(function: Kernel) -> Kernel:
    """The function, written out wherever a kernel calls it."""
    return _njit(inline="always")(function)  # type: ignore[no-any-return]


def _part(function: Kernel, **options: bool) -> Kernel:
    _NAMES.append(function.__name__)
    part = {**_COMMON, "pipeline_class": PartCompiler, "no_cpython_wrapper": True}
    return _njit(**part, **options)(function)  # type: ignore[no-any-return]


@contextmanager
def told(report: Progress | None) -> Iterator[None]:
    """Reports what is compiled while it is: nothing if the machine code is found in the cache."""
    if report is None:
        yield
        return
    from numba.core import event

    tell, done = report, set()

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            if function.__module__.startswith(__package__):
                done.add(function.__qualname__)
                tell(Step(phase=Phase.COMPILATION, done=len(done), of=len(_NAMES)))

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield


@cache
def _stamp() -> str:
    """A digest of every file that may hold a kernel, and of what compiles them."""
    digest = hashlib.sha256(
        f"{sys.version} numba {numba.__version__} llvmlite {llvmlite.__version__}".encode()
    )
    for name in KERNELS:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    return digest.hexdigest()
