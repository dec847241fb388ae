"""Code and certificate belong together: the very files, and what they answer, against recheck's own arithmetic."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np

from tubecert.certificate.result import Certificate
from tubecert.enclosure.interval import Array
from tubecert.errors import ExitCode, TubecertError
from tubecert.export.assembly import controller_of
from tubecert.export.belonging import belonging
from tubecert.export.compiled import compiled, compiler
from tubecert.export.controller import refused
from tubecert.export.folder import Exported
from tubecert.export.vectors import Vectors, vectors
from tubecert.recheck.code.constants import entries, literals, miscompiled
from tubecert.recheck.code.examination import Agreement, Allowed, examine
from tubecert.recheck.code.python_reader import read_python
from tubecert.recheck.code.reader import Code, read_code
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.controller import Column, answers

_PATIENCE: Final = 120  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """How far what code answers is from what recheck computes, at most, over `samples`.

    `ran`: it was compiled and run; else its text was. `constants`: so many were read back from the object.
    `losses`: what rounding costs it, and what it may; empty where the certificate is not about rounding.
    `unread`: why the text was not followed.
    """

    difference: float
    samples: int
    language: str
    precision: str
    ran: bool
    constants: int = 0
    losses: tuple[Allowed, ...] = ()
    unread: str = ""

    def __str__(self) -> str:
        return "; ".join(self._said())

    def _said(self) -> Iterator[str]:
        arithmetic = "" if self.language == "python" else f" in {self.precision}"
        yield f"the controller ({self.language}{arithmetic}) is that of the certificate"
        yield f"over {self.samples} samples it differs by {self.difference:.2g} from ball arithmetic"
        if self.losses:
            parts = (f"{own.name} {float(own.most / own.allowed):.0%}" for own in self.losses)
            yield f"by recheck's own bounds its rounding costs no more than is allowed for ({', '.join(parts)})"
        if self.unread:
            yield f"recheck did not follow its text: {self.unread}"
        if self.constants:
            yield f"{self.constants} constants were read back from the compiled object, to the bit"
        if not self.ran:
            yield "there is no compiler here: it was not run, and no constants were read back from an object"


def examined(folder: str, certificate: Certificate, text: str, name: str) -> Answers:
    """The code in a folder, examined; raises TC711 where it is not that of the certificate (whose text this is)."""
    found = belonging(folder, controller_of(certificate, name))
    own = vectors(found.controller, single=found.precision == "single")
    y = np.array(own.y)
    y = y.astype(np.float32).astype(np.float64) if found.precision == "single" else y
    rows = [[Fraction(float(value)) for value in row] for row in y]
    code, unread = _code(found)
    u, constants = _answered(found, own, y, code)
    agreement = None
    if code is not None:
        try:
            agreement = examine(text, name, code, rows, None if u is None else u.tolist())
        except UnreadError as error:
            unread = str(error)
    if u is not None:
        difference = _difference(u, answers(text, name, rows))
    elif agreement is not None:
        difference = agreement.difference
    else:
        raise undecided(f"the controller in {folder} was neither compiled nor followed: {unread}")
    _require(difference <= own.tolerance, agreement, folder, difference)
    if unread and found.controller.lost is not None:
        raise undecided(f"recheck has no bound of what the controller in {folder} rounds: {unread}")
    return Answers(
        difference=difference,
        samples=len(y),
        language=found.language,
        precision=found.precision,
        ran=u is not None,
        constants=constants,
        losses=() if agreement is None else agreement.losses,
        unread=unread,
    )


def _require(near: bool, agreement: Agreement | None, folder: str, difference: float) -> None:
    """Raises TC711 for another controller, or one that can lose more than is allowed for."""
    if not near or (agreement is not None and not agreement.agrees):
        raise contradicted(
            f"the controller in {folder} differs by {difference:.3g} from what the certificate says it computes"
        )
    if agreement is None:
        return
    if agreement.otherwise:
        raise contradicted(
            f"the controller in {folder} has other numbers than the certificate: {', '.join(agreement.otherwise)}"
        )
    if agreement.too_large:
        raise undecided(
            f"by recheck's bounds the controller in {folder} can lose more to rounding than the certificate "
            f"allows for: {', '.join(own.name for own in agreement.too_large)}"
        )


def _code(found: Exported) -> tuple[Code | None, str]:
    """The text as recheck reads it, or why it does not."""
    own = found.controller.name
    try:
        if found.language == "python":
            return read_python(found.files[f"{own}.py"]), ""
        return read_code(found.files[f"{own}.h"], found.files[f"{own}.c"]), ""
    except UnreadError as error:
        return None, str(error)


def _answered(found: Exported, own: Vectors, y: Array, code: Code | None) -> tuple[Array | None, int]:
    """What code answers to measurements, and how many constants were read back; None where it cannot be compiled."""
    if found.language == "python":
        return _tested(found, own), 0
    if compiler() is None:
        return None, 0
    sizes = {} if code is None else {name: len(list(entries(table))) for name, table in code.tables.items()}
    texts = () if code is None else literals(code)
    with compiled(found, read=texts, tables=tuple(sizes)) as built:
        if code is not None:
            wrong = list(miscompiled(code, built.literals(texts), built.tables(sizes)))
            if wrong:
                raise contradicted(
                    f"the compiled controller has other numbers than its source: {', '.join(wrong[:4])}"
                )
        u = np.concatenate([built.start(y[:1]), *(built.step(row[None]) for row in y)])
    return u, len(texts) + sum(sizes.values())


def _difference(u: Array, expected: Sequence[Column]) -> float:
    exact = np.array([[float(ball.mid()) for ball in row] for row in expected])
    return float(np.abs(u - exact).max())


def undecided(message: str) -> TubecertError:
    """The error for code of which too little is known."""
    error = refused(message, "export again, or certify without hardware.arithmetic", "TC711")
    error.exit_code = ExitCode.UNDECIDED
    return error


def contradicted(message: str) -> TubecertError:
    """The error for code that is another controller."""
    error = refused(message, "do not run it; export again", "TC711")
    error.exit_code = ExitCode.NOT_CERTIFIED
    return error


def _tested(found: Exported, own: Vectors) -> Array:
    """What the vectors say, once the module's self-test has passed in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        found.save(folder)
        command = [sys.executable, str(Path(folder) / f"{found.controller.name}.py")]
        done = subprocess.run(  # noqa: S603 - the bytes that export writes
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    if done.returncode:
        raise contradicted(f"the self-test of the controller fails: {done.stderr.strip()[-200:]}")
    return np.array(own.u)
