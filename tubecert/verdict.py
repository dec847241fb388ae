"""Verdicts: three values; undecided is never shown as either of the others."""

from __future__ import annotations

from enum import StrEnum

from tubecert.errors import ExitCode


class Verdict(StrEnum):
    """What is known of a claim."""

    CERTIFIED = "certified"
    REFUTED = "refuted"
    UNDECIDED = "undecided"

    @property
    def exit_code(self) -> ExitCode:
        """What it means to the shell."""
        return _CODES[self]


_CODES = {
    Verdict.CERTIFIED: ExitCode.CERTIFIED,
    Verdict.REFUTED: ExitCode.NOT_CERTIFIED,
    Verdict.UNDECIDED: ExitCode.UNDECIDED,
}
