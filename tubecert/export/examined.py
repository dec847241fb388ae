"""Code and certificate belong together: the very files, and what they answer, against recheck's own arithmetic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tubecert.certificate.result import Certificate
from tubecert.enclosure.interval import Array
from tubecert.errors import ExitCode, TubecertError
from tubecert.export.asked import Asked, OfSamples, OfTime, contradicted
from tubecert.export.assembly import controller_of
from tubecert.export.belonging import belonging
from tubecert.export.controller import Continuous, refused
from tubecert.export.folder import Exported
from tubecert.recheck.code.examination import Agreement, Allowed
from tubecert.recheck.code.python_reader import read_python
from tubecert.recheck.code.reader import Code, read_code
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.steering import Column

_INSTEAD: Final = (
    "nothing is shown to be wrong with it, but too little to be right. Of steep functions in a prediction, long delays "
    "and single precision a bound may be missing: try hardware.arithmetic: double, a shorter hardware.delay or no "
    "hardware.predict; without hardware.arithmetic rounding is assumed away (docs/export.md has a table)"
)


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
    asked: Asked = OfTime(found) if isinstance(found.controller, Continuous) else OfSamples(found)
    code, unread = _code(found)
    u, constants = asked.answered(code)
    agreement = None
    if code is not None:
        try:
            agreement = asked.examine(text, name, code, None if u is None else u.tolist())
        except UnreadError as error:
            unread = str(error)
    if u is not None:
        difference = _difference(u, asked.expected(text, name))
    elif agreement is not None:
        difference = agreement.difference
    else:
        raise undecided(f"the controller in {folder} was neither compiled nor followed: {unread}")
    _require(difference <= asked.tolerance, agreement, folder, difference)
    if unread and asked.rounds:
        raise undecided(f"recheck has no bound of what the controller in {folder} rounds: {unread}")
    return Answers(
        difference=difference,
        samples=len(asked.rows),
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
    if found.language == "python" and isinstance(found.controller, Continuous):
        return None, "of a certificate C it reads C, and of Python it compares the self-test"
    try:
        if found.language == "python":
            return read_python(found.files[f"{own}.py"]), ""
        return read_code(found.files[f"{own}.h"], found.files[f"{own}.c"]), ""
    except UnreadError as error:
        return None, str(error)


def _difference(u: Array, expected: Sequence[Column]) -> float:
    exact = np.array([[float(ball.mid()) for ball in row] for row in expected])
    return float(np.abs(u - exact).max())


def undecided(message: str) -> TubecertError:
    """The error for code of which too little is known."""
    error = refused(message, _INSTEAD, "TC711")
    error.exit_code = ExitCode.UNDECIDED
    return error
