"""Code and certificate belong together: the very files, and what they answer, against recheck's own arithmetic."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np

from tubecert.certificate.result import Certificate
from tubecert.enclosure.interval import Array
from tubecert.errors import ExitCode, TubecertError
from tubecert.export.belonging import belonging
from tubecert.export.compiled import compiled
from tubecert.export.controller import controller_of, refused
from tubecert.export.folder import Exported
from tubecert.export.vectors import Vectors, vectors
from tubecert.recheck.controller import answers

_PATIENCE: Final = 120  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """How far what code answers is from what recheck computes, at most, of how large an input, over `samples`."""

    difference: float
    tolerance: float
    samples: int
    language: str
    precision: str

    def __str__(self) -> str:
        arithmetic = "" if self.language == "python" else f" in {self.precision}"
        return (
            f"the controller ({self.language}{arithmetic}) is that of the certificate; over {self.samples} samples it "
            f"differs by {self.difference:.2g} from ball arithmetic"
        )


def examined(folder: str, certificate: Certificate, text: str, name: str) -> Answers:
    """The code in a folder, run; raises TC711 where it is not that of the certificate (whose text this is), TC712."""
    found = belonging(folder, controller_of(certificate, name))
    own = vectors(found.controller, single=found.precision == "single")
    y = np.array(own.y)
    y = y.astype(np.float32).astype(np.float64) if found.precision == "single" else y
    if found.language == "python":
        u = _tested(found, own)
    else:
        with compiled(found) as code:
            u = np.concatenate([code.start(y[:1]), *(code.step(row[None]) for row in y)])
    expected = answers(text, name, [[Fraction(float(value)) for value in row] for row in y])
    exact = np.array([[float(ball.mid()) for ball in row] for row in expected])
    difference = float(np.abs(u - exact).max())
    if not difference <= own.tolerance:
        raise contradicted(
            f"the controller in {folder} differs by {difference:.3g} from what the certificate says it computes"
        )
    return Answers(
        difference=difference,
        tolerance=own.tolerance,
        samples=len(y),
        language=found.language,
        precision=found.precision,
    )


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
