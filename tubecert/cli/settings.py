"""`--set KEY=VALUE`: keys of the specification that the command line sets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tubecert.cli.options import flag
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.library.asked import set_twice
from tubecert.spec import Setting

PARAMETER: Final = "set_"


def settings_of(given: Mapping[str, object]) -> tuple[Setting, ...]:
    """What is set; `given` holds the options by the names of their parameters.

    Raises `SpecError` with everything that is wrong with it, also if another option sets the same key.
    """
    found: list[Setting] = []
    findings: list[Finding] = []
    for each in _texts(given[PARAMETER]):
        try:
            found.append(Setting.of(each))
        except SpecError as error:
            findings += error.findings
    findings += set_twice(found, given, flag)
    if findings:
        raise SpecError(findings)
    return tuple(found)


def _texts(value: object) -> list[str]:
    return [str(each) for each in value] if isinstance(value, (list, tuple)) else []
