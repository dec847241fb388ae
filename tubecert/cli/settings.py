"""`--set KEY=VALUE`: keys of the specification that the command line sets."""

from __future__ import annotations

from collections.abc import Sequence

from tubecert.cli.options import flag
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.library.asked import set_twice
from tubecert.spec import Setting


def settings_of(texts: Sequence[str], **options: object) -> tuple[Setting, ...]:
    """What is set; `options` that may say what a key says, by the names of their parameters.

    Raises `SpecError` with everything that is wrong with it, also if another option sets the same key.
    """
    found: list[Setting] = []
    findings: list[Finding] = []
    for each in texts:
        try:
            found.append(Setting.of(each))
        except SpecError as error:
            findings += error.findings
    findings += set_twice(found, options, flag)
    if findings:
        raise SpecError(findings)
    return tuple(found)
