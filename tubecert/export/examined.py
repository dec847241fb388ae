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
from tubecert.export.belonging import belonging
from tubecert.export.compiled import compiled, compiler
from tubecert.export.controller import controller_of, refused
from tubecert.export.folder import Exported
from tubecert.export.vectors import Vectors, vectors
from tubecert.recheck.code.examination import Agreement, Allowed, examine
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.controller import Column, answers

_PATIENCE: Final = 120  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """How far what code answers is from what recheck computes, at most, over `samples`.

    `ran`: it was compiled and run; else its text was. `losses`: what rounding costs it, and what it may; empty where
    the certificate is not about rounding, or the code is not C. `unread`: why the text was not followed.
    """

    difference: float
    samples: int
    language: str
    precision: str
    ran: bool
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
        if not self.ran:
            yield "it was not compiled, as there is no compiler here"


def examined(folder: str, certificate: Certificate, text: str, name: str) -> Answers:
    """The code in a folder, examined; raises TC711 where it is not that of the certificate (whose text this is)."""
    found = belonging(folder, controller_of(certificate, name))
    own = vectors(found.controller, single=found.precision == "single")
    y = np.array(own.y)
    y = y.astype(np.float32).astype(np.float64) if found.precision == "single" else y
    rows = [[Fraction(float(value)) for value in row] for row in y]
    u = _answered(found, own, y)
    read, unread = _read(found, text, name, rows, u)
    if u is not None:
        difference = _difference(u, answers(text, name, rows))
    elif read is not None:
        difference = read.difference
    else:
        raise undecided(f"the controller in {folder} was neither compiled nor followed: {unread}")
    if not difference <= own.tolerance or (read is not None and not read.agrees):
        raise contradicted(
            f"the controller in {folder} differs by {difference:.3g} from what the certificate says it computes"
        )
    if read is not None and read.too_large:
        raise undecided(
            f"by recheck's bounds the controller in {folder} can lose more to rounding than the certificate "
            f"allows for: {', '.join(own.name for own in read.too_large)}"
        )
    if unread and found.language == "c" and found.controller.lost is not None:
        raise undecided(f"recheck has no bound of what the controller in {folder} rounds: {unread}")
    return Answers(
        difference=difference,
        samples=len(y),
        language=found.language,
        precision=found.precision,
        ran=u is not None,
        losses=() if read is None else read.losses,
        unread=unread,
    )


def _read(
    found: Exported, text: str, name: str, rows: Sequence[Sequence[Fraction]], u: Array | None
) -> tuple[Agreement | None, str]:
    """What recheck says of the text of C, or why it says nothing."""
    if found.language == "python":
        return None, ""
    own = found.controller.name
    files = found.files[f"{own}.h"], found.files[f"{own}.c"]
    try:
        return examine(text, name, files, rows, None if u is None else u.tolist()), ""
    except UnreadError as error:
        return None, str(error)


def _answered(found: Exported, own: Vectors, y: Array) -> Array | None:
    """What code answers to measurements; None where it would have to be compiled, and cannot."""
    if found.language == "python":
        return _tested(found, own)
    if compiler() is None:
        return None
    with compiled(found) as code:
        return np.concatenate([code.start(y[:1]), *(code.step(row[None]) for row in y)])


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
