"""Exported code, compiled by the C compiler of this machine: what `simulate` and the tests call is what is shipped."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from tubecert.controller.data import Data, data_of
from tubecert.controller.folder import files_of
from tubecert.controller.recursion import Step
from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.sampled_loop.record import Certificate

COMPILERS: Final = ("cc", "gcc", "clang")
FLAGS: Final = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")


class Controller:
    """As many controllers side by side as there are `lanes`, before their first sample; each has a state of its own.

    `state` is what the code keeps, an array of records (lanes,): `zeta` (z,), `delta` and `u` (m,), `k`, `bad`,
    `status` (see controller.h).
    Raises `OSError` where there is no C compiler.
    """

    def __init__(self, data: Data, lanes: int = 1) -> None:
        self.data = data
        n, m, z = data.sizes
        numbers = [(name, data.real, (size,)) for name, size in (("zeta", max(z, 1)), ("delta", m), ("u", m))]
        counts = [(name, np.uint32) for name in ("k", "bad", "status")]
        self.state = np.zeros(lanes, dtype=np.dtype([*numbers, *counts], align=True))
        self._widths = (n, n, m) if data.plan.handed else (n,)
        self._step = _library(tuple(files_of(data).items())).controller_step_many
        self._step.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_void_p] * (len(self._widths) + 1))
        self._step.restype = None

    def step(self, y: Array, *plan: Array) -> Array:
        """The inputs (lanes, m) for what is measured, (lanes, n).

        Of a family x* at this sample (lanes, n) and u* as it is held (lanes, m) are given as well; else not used.
        """
        pairs = zip((y, *plan), self._widths, strict=False)
        shaped = ((each, (len(self.state), width)) for each, width in pairs)
        own = [np.ascontiguousarray(np.broadcast_to(*pair), self.data.real) for pair in shaped]
        u = np.empty_like(self.state["u"], order="C")
        self._step(self.state.ctypes.data, len(u), *(each.ctypes.data for each in (*own, u)))
        return u.astype(float)


def build(folder: Path, command: Sequence[str]) -> None:
    """Runs the C compiler in a folder with exported files; raises `OSError` if it fails, or if none is on PATH."""
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise OSError(f"there is no C compiler on PATH ({', '.join(COMPILERS)})")
    call = [compiler, *FLAGS, *command, "-lm"]  # a compiler of PATH, and the bytes that are exported
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise OSError(done.stderr)


@lru_cache(maxsize=16)
def _library(files: tuple[tuple[str, bytes], ...]) -> ctypes.CDLL:
    with tempfile.TemporaryDirectory() as name:
        for each, content in files:
            (Path(name) / each).write_bytes(content)
        build(Path(name), ["-shared", "-fPIC", "controller.c", "-o", "controller.so"])
        return ctypes.CDLL(f"{name}/controller.so")


def stepper(certificate: Certificate) -> Callable[[int], Step] | None:
    """By the number of lanes, the exported code as a step of lanes that are last; None without code or compiler."""
    try:
        data = data_of(certificate)
        Controller(data)
    except (OSError, TubecertError):
        return None

    def made(lanes: int) -> Step:
        code = Controller(data, lanes)
        return lambda y, x, u: code.step(y.T, x.T, u.T).T

    return made
