"""Exported C, compiled by the C compiler of this machine and called from here."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.export.controller import Controller, Steering, refused
from tubecert.export.folder import Exported
from tubecert.export.reference import Handed
from tubecert.printable import visible

COMPILERS: Final = ("cc", "gcc", "clang")
FLAGS: Final = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
_PROBE: Final = "probe.c"
_PATIENCE: Final = 120  # s
_SHOWN: Final = 400  # characters of what a compiler says


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """What N controllers keep: (N, n) of states, (N, m) of inputs, as in the code."""

    y: Array
    f: Array
    q: Array
    feedback: Array
    held: Array
    before: Array


class Read:
    """Compiled code, of which numbers are read back."""

    def __init__(self, library: ctypes.CDLL, controller: Steering, *, single: bool) -> None:
        self._real = ctypes.c_float if single else ctypes.c_double
        self._type = np.float32 if single else np.float64
        self._library, self._name = library, controller.name

    def literals(self, texts: Sequence[str]) -> dict[str, float]:
        """What the compiler made of the literals that it was asked for."""
        found = (self._real * len(texts)).in_dll(self._library, f"{self._name}_literals")
        return {text: float(value) for text, value in zip(texts, found, strict=True)}

    def tables(self, sizes: Mapping[str, int]) -> dict[str, list[float]]:
        """The tables that the code reads, as they lie in the object."""
        pointer = ctypes.POINTER(self._real)
        found = (pointer * (len(sizes) + 1)).in_dll(self._library, f"{self._name}_tables")
        own = zip(sizes.items(), found, strict=False)
        return {name: [float(start[k]) for k in range(size)] for (name, size), start in own}


class Compiled(Read):
    """N controllers side by side, as `Reference`, but of the compiled code; `seconds` of every step.

    `handed`: the plan at a sample, where it is handed in.
    """

    def __init__(self, library: ctypes.CDLL, controller: Controller, *, single: bool, lanes: int) -> None:
        super().__init__(library, controller, single=single)
        n, m = len(controller.states), len(controller.inputs)
        self._shape = (lanes, m)
        fields: list[tuple[str, type]] = [("sample", ctypes.c_uint32)]
        fields += [("since", ctypes.c_uint32)] if controller.every > 1 else []
        fields += [("y", self._real * n), ("f", self._real * n)]
        fields += [(name, self._real * m) for name in ("q", "feedback", "held", "before")]
        kind = type("State", (ctypes.Structure,), {"_fields_": fields})
        self._states = [kind() for _ in range(lanes)]
        family = controller.boxes is not None
        self._start = self._function(library, f"{controller.name}_start", 2 if family else 0)
        self._step = self._function(
            library, f"{controller.name}_step", (2 if controller.held else 3) if family else 0
        )
        self.handed: Handed | None = None
        self.seconds: list[float] = []
        self.status = np.zeros(lanes, dtype=np.intp)

    def start(self, y: Array) -> Array:
        """The inputs (N, m) that act from 0 on, for what is measured at 0, (N, n)."""
        return self._run(self._start, y, () if self.handed is None else self.handed[:2])

    def step(self, y: Array) -> Array:
        """The inputs (N, m) that act a delay from now on."""
        begin = time.perf_counter()
        found = self._run(self._step, y, () if self.handed is None else self.handed)
        self.seconds.append((time.perf_counter() - begin) / len(y))
        return found

    def memory(self) -> Memory:
        """What every controller keeps now."""
        names = (item.name for item in fields(Memory))
        return Memory(
            **{name: np.array([list(getattr(own, name)) for own in self._states]) for name in names}
        )

    def measured(self, y: Array) -> Array:
        """What is measured, (N, n), as numbers of its type."""
        return np.asarray(y, dtype=self._type).astype(np.float64)

    def _function(self, library: ctypes.CDLL, name: str, handed: int) -> Callable[..., int]:
        function = getattr(library, name)
        function.argtypes = (ctypes.c_void_p, *(ctypes.POINTER(self._real),) * (2 + handed))
        function.restype = ctypes.c_int
        return function  # type: ignore[no-any-return]

    def _run(self, function: Callable[..., int], y: Array, handed: Sequence[Array]) -> Array:
        given = np.ascontiguousarray(y, dtype=self._type)
        plan = [np.ascontiguousarray(each[0], dtype=self._type) for each in handed]
        plan = plan[: len(function.argtypes) - 3]  # type: ignore[attr-defined]
        found = np.zeros(self._shape, dtype=self._type)
        pointer = ctypes.POINTER(self._real)
        for lane, (row, out) in enumerate(zip(given, found, strict=True)):
            state = ctypes.byref(self._states[lane])
            vectors = (each.ctypes.data_as(pointer) for each in (row, *plan, out))
            self.status[lane] = function(state, *vectors)
        return found.astype(float)


def compiler() -> str | None:
    """A C compiler on PATH."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


@contextmanager
def compiled(
    exported: Exported, lanes: int = 1, read: Sequence[str] = (), tables: Sequence[str] = ()
) -> Iterator[Compiled]:
    """The compiled code; raises TC712 where there is no compiler, the code does not compile, or its hash is another.

    `read` are literals, and `tables` names of tables that are to be read back.
    """
    with library_of(exported, probe(exported, read, tables)) as library:
        assert isinstance(exported.controller, Controller)
        yield Compiled(library, exported.controller, single=exported.precision == "single", lanes=lanes)


@contextmanager
def library_of(exported: Exported, source: str) -> Iterator[ctypes.CDLL]:
    """Exported code, compiled within a source that includes it; raises TC712."""
    with tempfile.TemporaryDirectory() as folder:
        exported.save(folder)
        (Path(folder) / _PROBE).write_text(source, "utf-8")
        library = ctypes.CDLL(built(exported, folder))
        own = ctypes.string_at(
            ctypes.addressof(ctypes.c_char.in_dll(library, f"{exported.controller.name}_certificate"))
        )
        if own.decode(errors="replace") != exported.controller.hash:
            raise _failed("the compiled code is that of another certificate")
        yield library


def probe(exported: Exported, read: Sequence[str], tables: Sequence[str]) -> str:
    """The source, and what is to be read back from the same object."""
    name = exported.controller.name
    starts = [f"(const {name}_real *){table}" for table in tables]
    return "\n".join(
        (
            f'#include "{name}.c"',
            f"extern const {name}_real {name}_literals[];",
            f"const {name}_real {name}_literals[] = {{{', '.join((*read, '0'))}}};",
            f"extern const {name}_real *const {name}_tables[];",
            f"const {name}_real *const {name}_tables[] = {{{', '.join((*starts, '0'))}}};",
            "",
        )
    )


def built(exported: Exported, folder: str) -> str:
    """The shared object of the files in a folder; raises TC712."""
    found, target = compiler(), str(Path(folder) / "controller.so")
    if found is None:
        raise _failed(f"there is no C compiler on PATH ({', '.join(COMPILERS)})")
    probe = Path(folder) / _PROBE
    source = str(probe if probe.exists() else Path(folder) / f"{exported.controller.name}.c")
    command = [found, *FLAGS, "-shared", "-fPIC", source, "-o", target, "-lm"]
    try:
        done = subprocess.run(  # noqa: S603 - a compiler of PATH, and the bytes that export wrote
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _failed(f"{found} does not run: {error}") from error
    if done.returncode:
        raise _failed(f"{found} refuses the code: {visible(done.stderr.strip())[:_SHOWN]}")
    return target


def _failed(message: str) -> TubecertError:
    return refused(message, "install gcc or clang; what export writes is C99", "TC712")
