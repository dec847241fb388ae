"""A folder of exported code against the certificate of a sampled loop: nothing of what wrote it is believed.

The runtime and the form of the data are files of tubecert that a reader can judge, and are compared byte by byte. Every
number is compared with the certificate: tables and limits with what it says, the plan with the curve of this room at
the times that the theorem has, the self-test with exact steps.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Final

from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import stated
from tubecert.recheck.sampled_loop.held import HEX, HeldPlan, Rows, single
from tubecert.recheck.sampled_loop.record import Certificate, Proven
from tubecert.recheck.sampled_loop.windows import course_of

_SHIPPED: Final = Path(__file__).parents[2] / "controller"
_RUNTIME: Final = ("controller.c", "controller.h", "selftest.c")
_DATA, _README = "controller_data.h", "README.txt"
_ALL: Final = {*_RUNTIME, _DATA, _README}
_FAR: Final = 64  # times its memory: where controller.c cuts zeta off
_LARGEST: Final = 256_000_000  # bytes of a file
_NUMBERS: Final = r"[-0-9a-fpux.,{} \n+]+"
_FORMS: Final = {
    "name": r"[A-Za-z0-9_-]{1,64}",
    "real": "float|double",
    "hash": "sha256:[0-9a-f]{64}",
    "kind": "PLAN_[A-Z]+",
    "plan": r"(?:#include <math\.h>)?[^#$]*",
    "period": HEX,
    "delay": HEX,
    **dict.fromkeys(("n", "m", "z", "steps", "after", "tests"), r"\d{1,10}"),
}
_FLAT: Final = ("reach", "memory", "low", "high")
_LITERAL: Final = re.compile(rf"({HEX})(f?)")


@dataclass(frozen=True)
class Exported:
    """A certificate, and the files of a folder by their names."""

    certificate: Certificate
    files: dict[str, bytes]

    def claims(self) -> Iterator[tuple[str, Outcome]]:
        """What is claimed of the files, and whether it is so, up to the first that is not."""
        examined: tuple[tuple[str, Callable[[], str]], ...] = (
            ("the runtime is that of tubecert", self._runtime),
            ("the data are of this certificate", self._identity),
            ("the tables are those of the certificate", self._tables),
            ("the plan is that of the certificate when its commands act", lambda: self._plan[0]),
            ("the limits are those of the certificate", self._limits),
            ("the self-test expects what is exact", self._selftest),
        )
        for name, wrong in examined:
            try:
                why = wrong()
            except (ValueError, OverflowError) as error:
                why = f"{_DATA} is not as tubecert writes it ({error})"
            yield f"controller: {name}", stated(not why, why)
            if why:
                return

    @property
    def _proven(self) -> Proven:
        if self.certificate.result.verdict != "certified" or self.certificate.result.proven is None:
            raise ValueError("the certificate is not certified")
        return self.certificate.result.proven

    @cached_property
    def _held(self) -> HeldPlan:
        result = self.certificate.result
        return HeldPlan(course_of(result.specification, result.plan))

    # the data as they are written

    @cached_property
    def _found(self) -> dict[str, str]:
        """What stands in the places of the form; raises `ValueError`."""
        form = re.split(r"\$\{?(\w+)\}?", (_SHIPPED / f"{_DATA}.in").read_text("utf-8"))
        for i in range(1, len(form), 2):
            form[i] = f"(?P<{form[i]}>{_FORMS.get(form[i], _NUMBERS)})"
        form[::2] = map(re.escape, form[::2])
        first, _, text = self.files[_DATA].decode("ascii").partition("\n")
        found = re.fullmatch("".join(form), text)
        if found is None or first != f"/* {_mark(found['hash'], text)} */":
            raise ValueError("its form")
        return found.groupdict()

    def _array(self, name: str, count: int = 1) -> Rows:
        """What stands in a place; `count` rows where they are empty, which C does not allow."""
        rows = _rows(self._found[name], flat=name in _FLAT)
        return rows if any(rows) else [[]] * count

    # what is claimed: what is wrong with it, or nothing

    def _runtime(self) -> str:
        for name in sorted(_ALL ^ set(self.files)):
            return f"{name[:60]} is {'missing' if name in _ALL else 'none of its files'}"
        for name in _RUNTIME:
            if self.files[name] != (_SHIPPED / name).read_bytes():
                return f"{name} is not what tubecert writes"
        first, _, text = self.files[_README].decode("utf-8", "replace").partition("\n")
        return "" if first == _mark(self.certificate.hash, text) else f"{_README} was changed"

    def _identity(self) -> str:
        own, held, spec = self._found, self._held, self.certificate.result.specification
        machine, counts = spec.hardware, held.counts
        wanted = {
            "hash": self.certificate.hash,
            "real": "float" if machine.arithmetic == "single" else "double",
            "n": str(len(spec.plant.states)),
            "m": str(len(spec.plant.inputs)),
            "z": str(len(self._proven.tables.F)),
            "kind": held.kind,
            "steps": str(counts[0]),
            "after": str(counts[1]),
        }
        wrong = [name for name, value in wanted.items() if own[name] != value]
        times = (("period", machine.sample_time), ("delay", machine.delay))
        wrong += [name for name, q in times if float.fromhex(own[name]) != q.numerator / q.denominator]
        return f"{wrong[0]} is {own[wrong[0]][:80]}" if wrong else ""

    def _tables(self) -> str:
        for name in "FGMN":
            own: Rows = [list(row) for row in getattr(self._proven.tables, name) if row]
            if [row for row in self._array(name) if row] != own:
                return f"the table {name} is another one"
        return ""

    @cached_property
    def _plan(self) -> tuple[str, list[float]]:
        """What is wrong with it, and the largest |x*_i| on it."""
        family, text = self._held.course.family, self._found["plan"]
        if family is None:
            return self._held.agrees(text, float.fromhex(self._found["period"]), _rows)
        return "a plan is there, and is handed in" if text else "", [
            float(max(map(abs, ends))) for ends in family.x.values()
        ]

    def _limits(self) -> str:
        """`low`, `high` and `memory` are the last numbers within; `reach` is enough, and hardly more."""
        result, stages = self.certificate.result, self._proven.stages
        sides = {
            "low": (-1, [use.range[0] for use in result.inputs]),
            "high": (1, [use.range[1] for use in result.inputs]),
            "memory": (1, [max(own) for own in zip(*(stage.memory for stage in stages), strict=True)]),
        }
        for name, (side, limits) in sides.items():
            [found] = self._array(name)
            if not all(self._last(x, side, q) for x, q in zip(found, limits, strict=True)):
                return f"{name} is not the last number within what is proven"
        noise, widths = (
            result.specification.hardware.noise,
            zip(*(own.half_widths for own in stages), strict=True),
        )
        [reach] = self._array("reach")
        for i, (x, each, size) in enumerate(zip(reach, widths, self._plan[1], strict=True)):
            width = max(each) + (noise[i] if isinstance(noise, tuple) else noise)
            least = (width + Fraction(size)) * Fraction(1, 2**21) + width
            if not least <= Fraction(x) <= width * Fraction(1001, 1000) + Fraction(size) / 2**16:
                return f"reach of {result.specification.plant.states[i]} is not what is proven"
        return ""

    def _last(self, x: float, side: int, limit: Fraction) -> bool:
        """Whether x is within a limit, and the next number of the arithmetic is not."""
        beyond = math.nextafter(x, side * math.inf)
        if self._found["real"] == "float":
            beyond = single(x + side * 1.1 * 2.0**-24 * abs(x))
        return side * Fraction(x) <= side * limit and (x == limit or side * limit < side * Fraction(beyond))

    def _selftest(self) -> str:
        [low], [high], [memory] = (self._array(name) for name in ("low", "high", "memory"))
        tables = {name: self._array(name, len(low)) for name in "FGMN"}
        places = ("zeta", "y", "xs", "us", "u", "next")
        samples = (self._array(name, int(self._found["tests"])) for name in places)
        for zeta, y, xs, us, u, later in zip(*samples, strict=True):
            seen = [*map(Fraction, zeta), *(Fraction(a) - Fraction(b) for a, b in zip(y, xs, strict=True))]
            delta = _products(tables["M"], tables["N"], seen)
            planned = zip(us, delta, low, high, strict=True)
            inputs = [float(min(max(Fraction(a) + d, Fraction(b)), Fraction(c))) for a, d, b, c in planned]
            state = _products(tables["F"][: len(later)], tables["G"][: len(later)], seen)
            bounded = zip(state, map(Fraction, memory), strict=True)
            if inputs != u or [float(min(max(v, -_FAR * x), _FAR * x)) for v, x in bounded] != later:
                return "a number that it expects is another one"
        return ""


def _products(left: Rows, right: Rows, seen: list[Fraction]) -> list[Fraction]:
    """[left right] seen, exactly."""
    rows = ((*a, *b) for a, b in zip(left, right, strict=True))
    return [sum((Fraction(c) * v for c, v in zip(row, seen, strict=True)), Fraction(0)) for row in rows]


def _rows(text: str, *, flat: bool = False) -> Rows:
    """An array of C in the one form that it has, row by row (or a `flat` one as a row); raises `ValueError`.

    Braces elsewhere, or numbers left out, would mean other things to a compiler.
    """
    if text == ("{0}" if flat else "{{0}}"):
        return [[]]
    found = re.fullmatch(r"\{([^{}]*)\}" if flat else r"\{\n((?:  \{[^{}]*\},\n)+)\}", text)
    if found is None:
        raise ValueError("an array")
    rows = [found[1]] if flat else re.findall(r"\{([^{}]*)\}", found[1])
    return [[_number(word) for word in row.split(", ")] for row in rows]


def _number(word: str) -> float:
    found = _LITERAL.fullmatch(word)
    value = math.nan if found is None else float.fromhex(found[1])
    if found is None or not math.isfinite(value) or (found[2] and single(value) != value):
        raise ValueError(f"the number {word[:40]}")
    return value


def _mark(certificate: str, text: str) -> str:
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f"tubecert export, certificate {certificate}, text sha256:{digest}"


def exported(certificate: Certificate, folder: str) -> list[tuple[str, Outcome]]:
    """The claims of a folder of exported code; a folder that cannot be read contradicts the only one."""
    try:
        files = {name: _read(os.path.join(folder, name)) for name in sorted(os.listdir(folder))}
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        return [("controller: the folder can be read", stated(False, f"{folder}: {why}"))]
    return list(Exported(certificate, files).claims())


def _read(path: str) -> bytes:
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise ValueError(f"{os.path.basename(path)} is not a regular file")
        return file.read(_LARGEST)
