"""Exported C of a certificate C, compiled by the C compiler of this machine and called from here, many runs at once."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.c_loop import handed
from tubecert.export.compiled import Read, library_of, probe
from tubecert.export.continuous.vectors import parts
from tubecert.export.controller import Continuous
from tubecert.export.folder import Exported
from tubecert.export.reference import Handed


class Compiled(Read):
    """N controllers side by side, as `Reference`, but of the compiled code; `seconds` of every call of `answer`."""

    def __init__(self, library: ctypes.CDLL, controller: Continuous, *, single: bool, lanes: int) -> None:
        super().__init__(library, controller, single=single)
        n, m = len(controller.states), len(controller.inputs)
        fields: list[tuple[str, type]] = [("sample", ctypes.c_uint32)]
        fields += [("s_hat", self._real * n), ("sigma_hat", self._real * m), ("u_a", self._real * m)]
        kind = type("State", (ctypes.Structure,), {"_fields_": fields})
        self._states = ctypes.create_string_buffer(lanes * ctypes.sizeof(kind))
        self._sizes = lanes, n, m
        self._all = getattr(library, f"{controller.name}_all")
        self._all.argtypes = (
            ctypes.c_int,
            ctypes.c_int,
            ctypes.c_void_p,
            self._real,
            *(ctypes.c_void_p,) * 7,
        )
        self._all.restype = None
        self._controller, self.handed = controller, None if controller.boxes is None else _unknown(controller)
        self.seconds: list[float] = []
        self.status = np.zeros(lanes, dtype=np.intc)

    def start(self, x: Array) -> Array:
        """xhat (N, n), for the states (N, n) at t = 0."""
        return self._called(_START, 0.0, x, x)[1]

    def step(self, x: Array, xhat: Array) -> None:
        """The adaptation at a sample, from states and xhat (N, n)."""
        self._called(_STEP, 0.0, x, xhat)

    def answer(self, since: float, x: Array, xhat: Array) -> tuple[Array, Array]:
        """The inputs (N, m) and xhat' (N, n), `since` s after the last sample."""
        begin = time.perf_counter()
        found = self._called(_ANSWER, since, x, xhat)
        self.seconds.append((time.perf_counter() - begin) / len(x))
        return found

    def answers(self, given: Array) -> Array:
        """u and xhat' (K, m + n) of one run, to rows of times, states and predictions."""
        found = []
        for k, row in enumerate(given):
            x, xhat, self.handed = parts(self._controller, row)
            if k == 0:
                self.start(x)
            elif row[0] == 0:
                self.step(x, xhat)
            found.append(np.concatenate(self.answer(float(row[0]), x, xhat), axis=1))
        return np.concatenate(found)

    def _called(self, what: int, since: float, x: Array, xhat: Array) -> tuple[Array, Array]:
        lanes, n, m = self._sizes
        given = [np.ascontiguousarray(each, dtype=self._type) for each in (x, xhat)]
        u, rate = np.zeros((lanes, m), dtype=self._type), np.zeros((lanes, n), dtype=self._type)
        plan = [] if self.handed is None else self.handed[:2]
        given += [np.ascontiguousarray(each[0], dtype=self._type) for each in plan] or [u, u]
        places = [each.ctypes.data_as(ctypes.c_void_p) for each in (*given, u, rate, self.status)]
        self._all(what, lanes, ctypes.byref(self._states), since, *places)
        return u.astype(float), rate.astype(float)


_START, _STEP, _ANSWER = 0, 1, 2


def _unknown(controller: Continuous) -> Handed:
    """A plan that nobody reads."""
    x, u = np.zeros((1, len(controller.states))), np.zeros((1, len(controller.inputs)))
    return Handed(x, u, u)


@contextmanager
def compiled(
    exported: Exported, lanes: int = 1, read: Sequence[str] = (), tables: Sequence[str] = ()
) -> Iterator[Compiled]:
    """The compiled code; `read` and `tables` as for certificate H. Raises TC712."""
    controller = exported.controller
    assert isinstance(controller, Continuous)
    source = probe(exported, read, tables) + "\n".join((*_lanes(controller), ""))
    with library_of(exported, source) as library:
        yield Compiled(library, controller, single=exported.precision == "single", lanes=lanes)


def _lanes(c: Continuous) -> Iterator[str]:
    """A function that calls those of the code, lane by lane."""
    name = c.name
    head = (
        f"void {name}_all(int what, int lanes, {name}_state *c, real since, const real *x, const real *xhat, "
        "const real *xs, const real *us, real *u, real *rate, int *status)"
    )
    yield f"{head};"
    yield head
    yield "{"
    yield "    int k;"
    yield "    for (k = 0; k < lanes; k++) {"
    yield f"        if (what == {_START}) {{"
    yield f"            {name}_start(c + k, x + k * N, rate + k * N);"
    yield f"        }} else if (what == {_STEP}) {{"
    yield f"            {name}_step(c + k, x + k * N, xhat + k * N);"
    yield "        } else {"
    if c.boxes is None:
        yield "            (void)xs;"
        yield "            (void)us;"
    yield f"            status[k] = {name}_law(c + k, since, x + k * N, {handed(c)}u + k * M);"
    yield f"            {name}_predictor(c + k, x + k * N, xhat + k * N, u + k * M, rate + k * N);"
    yield "        }"
    yield "    }"
    yield "}"
