"""Whether the files in a folder are the controller of a certificate: the very bytes that export writes for it.

Code that differs anywhere is refused before it is compiled or run. What it computes is examined by `compiled`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tubecert.errors import ExitCode, TargetError
from tubecert.export.controller import Continuous, Controller, refused
from tubecert.export.folder import FORMAT, MANIFEST, Exported, Language, Precision, exported
from tubecert.files import Kind, read
from tubecert.findings import Finding
from tubecert.printable import visible
from tubecert.records import FormError, from_json

_KIND: Final = Kind(
    most=64_000_000,
    unreadable="TC600",
    too_large="TC600",
    help="give a folder that tubecert export wrote",
)


def belonging(folder: str, controller: Controller | Continuous) -> Exported:
    """The controller in a folder; raises TC711 where it is not that of the certificate, and `TargetError`."""
    language, precision = _kind(folder, controller)
    wanted = exported(controller, language, precision)
    for name, text in wanted.files.items():
        found = _text(Path(folder) / name)
        if found != text:
            raise _differs(folder, name, found, text)
    return wanted


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a folder says of its files."""

    certificate: str
    format: str
    language: Language
    name: str
    precision: Precision


def _kind(folder: str, controller: Controller | Continuous) -> tuple[Language, Precision]:
    """Language and precision, as the folder says; it says of which certificate it is as well."""
    path = Path(folder) / MANIFEST
    try:
        said = from_json(Manifest, json.loads(_text(path)), MANIFEST)
    except (ValueError, RecursionError, FormError):
        said = None
    if said is None or said.format != FORMAT:
        message = f"{visible(str(path))} does not say what these files are ({FORMAT})"
        raise TargetError([Finding(code="TC601", message=message, help=_KIND.help)])
    if said.certificate != controller.hash:
        other = visible(said.certificate)[:80]
        raise _foreign(f"the controller in {visible(folder)} is that of another certificate, {other}")
    return said.language, said.precision


def _text(path: Path) -> str:
    return read(str(path), _KIND).decode("utf-8", errors="replace")


def _differs(folder: str, name: str, found: str, wanted: str) -> Exception:
    """The first line that differs."""
    theirs, ours = found.splitlines(), wanted.splitlines()
    pairs = zip([*theirs, ""], [*ours, ""], strict=False)
    line = next((i for i, (a, b) in enumerate(pairs, start=1) if a != b), len(ours))
    own = theirs[line - 1].strip() if line <= len(theirs) else "nothing"
    return _foreign(
        f"{visible(str(Path(folder) / name))}:{line}: this is not what export writes for the certificate: "
        f"{visible(own)[:100]}"
    )


def _foreign(message: str) -> Exception:
    error = refused(message, "export again, with the same version of tubecert", "TC711")
    error.exit_code = ExitCode.NOT_CERTIFIED
    return error
