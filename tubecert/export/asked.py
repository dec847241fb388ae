"""What code is asked, and what it answers: compiled, in Python, and by recheck's own reading of the theorem.

One class for every kind of certificate that is exported; `examined` compares.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.errors import ExitCode, TubecertError
from tubecert.export import compiled as on_samples
from tubecert.export.compiled import Read, compiler
from tubecert.export.continuous import compiled as all_the_time
from tubecert.export.continuous import vectors as in_time
from tubecert.export.controller import Continuous, Controller, refused
from tubecert.export.folder import Exported
from tubecert.export.vectors import handed_of, vectors
from tubecert.recheck import continuous, controller
from tubecert.recheck.code import continuous as of_time
from tubecert.recheck.code import examination as of_samples
from tubecert.recheck.code.constants import entries, literals, miscompiled
from tubecert.recheck.code.examination import Agreement
from tubecert.recheck.code.reader import Code
from tubecert.recheck.steering import Column

_PATIENCE: Final = 120  # s

Rows = Sequence[Sequence[Fraction]]


class Asked(ABC):
    """What the code in a folder is asked: `rows`, of which the answers may be off by `tolerance`.

    `rounds`: the certificate covers its rounding.
    """

    rounds = False

    def __init__(
        self, found: Exported, given: Sequence[Sequence[float]], answers: object, tolerance: float
    ) -> None:
        self._found, self._own, self.tolerance = found, np.array(answers), tolerance
        rows = np.array(given)
        self._given = rows.astype(np.float32).astype(np.float64) if found.precision == "single" else rows
        self.rows = [[Fraction(float(value)) for value in row] for row in self._given]

    def answered(self, code: Code | None) -> tuple[Array | None, int]:
        """What the code answers, and how many numbers were read back; None where it cannot be compiled."""
        if self._found.language == "python":
            _test(self._found)
            return self._own, 0
        if compiler() is None:
            return None, 0
        sizes = {} if code is None else {key: len(list(entries(own))) for key, own in code.tables.items()}
        texts = () if code is None else literals(code)
        return self._run(code, texts, sizes), len(texts) + sum(sizes.values())

    @abstractmethod
    def expected(self, text: str, name: str) -> list[Column]:
        """What recheck computes."""

    @abstractmethod
    def examine(
        self, text: str, name: str, code: Code, answered: Sequence[Sequence[float]] | None
    ) -> Agreement:
        """The text of C, as recheck follows it; raises `UnreadError`."""

    @abstractmethod
    def _run(self, code: Code | None, texts: Sequence[str], sizes: dict[str, int]) -> Array:
        """What compiled code answers."""


class OfSamples(Asked):
    """Of a certificate H: what is measured; the inputs of the start and of every step."""

    def __init__(self, found: Exported) -> None:
        assert isinstance(found.controller, Controller)
        own = vectors(found.controller, single=found.precision == "single")
        super().__init__(found, own.given, own.u, own.tolerance)
        self.rounds = found.controller.lost is not None

    def expected(self, text: str, name: str) -> list[Column]:
        """By section 8."""
        return controller.answers(text, name, self.rows)

    def examine(
        self, text: str, name: str, code: Code, answered: Sequence[Sequence[float]] | None
    ) -> Agreement:
        """By section 8."""
        return of_samples.examine(text, name, code, self.rows, answered)

    def _run(self, code: Code | None, texts: Sequence[str], sizes: dict[str, int]) -> Array:
        own, answers = self._found.controller, []
        assert isinstance(own, Controller)
        n = len(own.states)
        with on_samples.compiled(self._found, read=texts, tables=tuple(sizes)) as built:
            _compare(code, built, texts, sizes)
            for k, row in enumerate(self._given):
                built.handed = None if own.boxes is None else handed_of(own, row[n:])
                answers += [built.start(row[None, :n])] if k == 0 else []
                answers.append(built.step(row[None, :n]))
        return np.concatenate(answers)


class OfTime(Asked):
    """Of a certificate C: times, states and predictions; inputs and xhat'."""

    def __init__(self, found: Exported) -> None:
        assert isinstance(found.controller, Continuous)
        own = in_time.vectors(found.controller, single=found.precision == "single")
        super().__init__(found, own.given, own.expected, own.tolerance)

    def expected(self, text: str, name: str) -> list[Column]:
        """By section 4b."""
        return continuous.answers(text, name, self.rows)

    def examine(
        self, text: str, name: str, code: Code, answered: Sequence[Sequence[float]] | None
    ) -> Agreement:
        """By section 4b."""
        return of_time.examine(text, name, code, self.rows, answered)

    def _run(self, code: Code | None, texts: Sequence[str], sizes: dict[str, int]) -> Array:
        with all_the_time.compiled(self._found, read=texts, tables=tuple(sizes)) as built:
            _compare(code, built, texts, sizes)
            return built.answers(self._given)


def _compare(code: Code | None, built: Read, texts: Sequence[str], sizes: dict[str, int]) -> None:
    """Raises TC711 where the compiler made other numbers."""
    if code is not None:
        wrong = list(miscompiled(code, built.literals(texts), built.tables(sizes)))
        if wrong:
            raise contradicted(
                f"the compiled controller has other numbers than its source: {', '.join(wrong[:4])}"
            )


def contradicted(message: str) -> TubecertError:
    """The error for code that is another controller."""
    error = refused(message, "do not run it; export again", "TC711")
    error.exit_code = ExitCode.NOT_CERTIFIED
    return error


def _test(found: Exported) -> None:
    """The module's self-test, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        found.save(folder)
        command = [sys.executable, str(Path(folder) / f"{found.controller.name}.py")]
        done = subprocess.run(  # noqa: S603 - the bytes that export writes
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    if done.returncode:
        raise contradicted(f"the self-test of the controller fails: {done.stderr.strip()[-200:]}")
