"""Exported code, compiled by the C compiler of this machine: what `simulate` and the tests call is what is shipped."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.controller.data import Data
from tubecert.controller.folder import RUNTIME, files_of
from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.printable import visible

BAD: Final = 1  # of `Controller.status`
END: Final = 2
CLIPPED: Final = 4
COMPILERS: Final = ("cc", "gcc", "clang")
FLAGS: Final = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
_PATIENCE: Final = 120  # s
_SHOWN: Final = 400  # characters of what a compiler says
_KEPT: Final = 16  # libraries


class Controller:
    """As many controllers side by side as there are `lanes`; each has a state of its own.

    `state` is what the code keeps, an array of records (lanes,): `zeta` (z,), `delta` (m,), `k`, `bad`, `status`.
    Raises TC711 where there is no C compiler.
    """

    def __init__(self, data: Data, lanes: int = 1) -> None:
        self.data = data
        n, m, z = data.sizes
        real, count = np.dtype(data.real), np.dtype(np.uint32)
        fields = [
            ("zeta", real, (max(z, 1),)),
            ("delta", real, (m,)),
            *((name, count) for name in ("k", "bad", "status")),
        ]
        self.state = np.zeros(lanes, dtype=np.dtype(fields, align=True))
        self._shapes = ((lanes, n), *(((lanes, n), (lanes, m)) if data.plan.at is None else ()), (lanes, m))
        texts = files_of(data)
        self._step = _library(tuple((name, texts[name]) for name in texts)).controller_step_many
        self._step.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *(ctypes.c_void_p,) * len(self._shapes))
        self._step.restype = None

    def start(self) -> None:
        """All of them as before the first sample."""
        self.state[...] = 0

    @property
    def status(self) -> NDArray[np.uint32]:
        """Of the last sample of every lane: a sum of BAD, END, CLIPPED; (lanes,)."""
        return np.asarray(self.state["status"])

    def step(self, y: Array, xs: Array | None = None, us: Array | None = None) -> Array:
        """The inputs (lanes, m) for what is measured, (lanes, n).

        Of a family x* at this sample (lanes, n) and u* as it is held (lanes, m) are given as well.
        """
        given = [y] if xs is None or us is None else [y, xs, us]
        assert len(given) + 1 == len(self._shapes), (
            "x* and u* are handed in for a family of plans, and only there"
        )
        pairs = zip(given, self._shapes, strict=False)
        own = [
            np.ascontiguousarray(np.broadcast_to(each, shape), dtype=self.data.real) for each, shape in pairs
        ]
        u = np.empty(self._shapes[-1], dtype=self.data.real)
        self._step(
            self.state.ctypes.data, len(self.state), *(each.ctypes.data for each in own), u.ctypes.data
        )
        return u.astype(float)


def compiler() -> str:
    """A C compiler on PATH; raises TC711 if there is none."""
    found = next(filter(None, map(shutil.which, COMPILERS)), None)
    if found is None:
        raise _failed(f"there is no C compiler on PATH ({', '.join(COMPILERS)})")
    return found


def build(folder: Path, command: Sequence[str]) -> None:
    """Runs the compiler in a folder with exported files; raises TC711."""
    try:
        done = subprocess.run(  # noqa: S603 - a compiler of PATH, and the bytes that are exported
            [compiler(), *FLAGS, *command, "-lm"],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _failed(f"the C compiler does not run: {error}") from error
    if done.returncode:
        raise _failed(f"the C compiler refuses the controller: {visible(done.stderr.strip())[:_SHOWN]}")


@lru_cache(maxsize=_KEPT)
def _library(files: tuple[tuple[str, str], ...]) -> ctypes.CDLL:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for each, text in files:
            (folder / each).write_text(text, "utf-8")
        build(folder, ["-shared", "-fPIC", RUNTIME[0], "-o", "controller.so"])
        return ctypes.CDLL(str(folder / "controller.so"))


def _failed(message: str) -> TubecertError:
    help = "install gcc or clang: what is simulated is the controller in C, as it is exported"
    return TubecertError([Finding(code="TC711", message=message, help=help)])
