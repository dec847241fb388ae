"""The error family and the exit codes.

Every failure that a user can cause or meet is a `TubecertError` that carries findings and an exit code; anything
else that escapes is a defect of tubecert (exit code 3).
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tubecert.findings import Finding


class ExitCode(IntEnum):
    """What a command's exit code means."""

    CERTIFIED = 0
    NOT_CERTIFIED = 1
    INVALID = 2
    INTERNAL = 3
    UNDECIDED = 4
    HUNG_UP = 129
    INTERRUPTED = 130
    TERMINATED = 143


class TubecertError(Exception):
    """Something the user has to know, as findings, with the exit code it leads to; its text is that of the findings."""

    def __init__(self, findings: Sequence[Finding], exit_code: ExitCode = ExitCode.INVALID) -> None:
        self.findings, self.exit_code = tuple(findings), exit_code
        super().__init__("\n".join(map(str, self.findings)))

    def __reduce__(self) -> tuple[type[TubecertError], tuple[tuple[Finding, ...], ExitCode]]:
        """From its findings and its code, as it was made: an error crosses processes like any value."""
        return type(self), (self.findings, self.exit_code)


class SpecError(TubecertError):
    """The specification cannot be read or does not describe a system (exit code 2)."""


class TargetError(TubecertError):
    """A file cannot be read or written (exit code 2)."""


class ProcessorError(RuntimeError):
    """The process rounds in another way than IEEE 754 does by default (exit code 3)."""

    def __init__(self) -> None:
        super().__init__(
            "this process does not round as IEEE 754 does by default, so nothing can be proven in it; a library "
            "compiled with -ffast-math may have changed that when it was loaded: run tubecert without it"
        )
