"""`--set KEY=VALUE`: keys of the specification that the command line sets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tubecert.cli.options import flag
from tubecert.errors import SpecError
from tubecert.findings import Finding, NamedPlace
from tubecert.spec import Setting

PARAMETER: Final = "set_"
_OTHERS: Final = {
    "rho_a": "tube.rho_a",
    "epsilon": "tube.epsilon",
    "metric": "metric",
}  # options by the keys they set


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
    for setting in found:
        for name, key in _OTHERS.items():
            if given.get(name) is not None and setting.meets(key):
                findings.append(_twice(setting, flag(name), key))
    if findings:
        raise SpecError(findings)
    return tuple(found)


def _texts(value: object) -> list[str]:
    return [str(each) for each in value] if isinstance(value, (list, tuple)) else []


def _twice(setting: Setting, option: str, key: str) -> Finding:
    place = NamedPlace(file=setting.place, line=1, column=1, source=str(setting), width=len(setting.path))
    message = f"{option} is given, too, and says what {key} is"
    return Finding(code="TC104", message=message, location=place, help="keep one of them")
