"""The certificate as data: sealed with a hash, written atomically, read back, mapped to an exit code.

In: the `result` of a certification. Out: canonical JSON. The hash is of the canonical bytes of `result` (UTF-8, sorted
keys, no spaces, no NaN), so that any change of what was proven shows. Trusted: yes.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tubecert.errors import ExitCode, TargetError
from tubecert.files import replace
from tubecert.findings import Finding

FORMAT = "tubecert-certificate/1"
STDOUT = "-"
REMEDY = "choose another file with -o FILE, or -o - for stdout"

_CODES = {
    "certified": ExitCode.CERTIFIED,
    "refuted": ExitCode.NOT_CERTIFIED,
    "undecided": ExitCode.UNDECIDED,
}


def canonical_bytes(data: Any) -> bytes:
    """The bytes that are hashed. Raises `ValueError` for NaN or infinity."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode()


def digest(data: Any) -> str:
    """`sha256:` and the hash of the canonical bytes."""
    return "sha256:" + hashlib.sha256(canonical_bytes(data)).hexdigest()


def seal(result: Mapping[str, Any], run: Mapping[str, Any]) -> dict[str, Any]:
    """The certificate: what was proven, its hash, and how it was made (versions, times, command line)."""
    return {"format": FORMAT, "hash": digest(result), "result": dict(result), "run": dict(run)}


def exit_code(result: Mapping[str, Any]) -> ExitCode:
    """What a verdict means to the shell."""
    return _CODES[result["verdict"]]


def dump(certificate: Mapping[str, Any]) -> str:
    """The file's text: sorted keys, indented."""
    return json.dumps(certificate, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def load(path: str) -> dict[str, Any]:
    """The certificate in a file, if its format is known and its hash is that of its result.

    Raises `TargetError` (TC121) for anything else. What the result says is not examined here.
    """
    try:
        certificate = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_no_number)
        if not isinstance(certificate, dict) or not isinstance(certificate.get("result"), dict):
            raise ValueError("it is JSON, but no certificate")
        if certificate.get("format") != FORMAT:
            raise ValueError(f"its format is {str(certificate.get('format'))[:60]!r}, not {FORMAT!r}")
        if certificate.get("hash") != digest(certificate["result"]):
            raise ValueError("its hash is not that of its result: the file was changed")
    except OSError as error:
        raise unreadable(path, error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise unreadable(path, "it is not UTF-8") from error
    except json.JSONDecodeError as error:
        raise unreadable(path, f"it is not JSON (line {error.lineno}: {error.msg})") from error
    except RecursionError as error:
        raise unreadable(path, "it is nested too deeply") from error
    except ValueError as error:
        raise unreadable(path, str(error)) from error
    return certificate


def _no_number(word: str) -> None:
    raise ValueError(f"it holds {word}, which is no number of JSON")


def unreadable(path: str, why: str) -> TargetError:
    """The error for a file that is no certificate."""
    remedy = "give a file that tubecert certify wrote"
    return TargetError(
        [Finding(code="TC121", message=f"{path} is no certificate that can be read: {why}", help=remedy)]
    )


def check_target(target: str, remedy: str = REMEDY) -> None:
    """Raise `TargetError` now if `target` cannot become a file, before any work is done."""
    if target == STDOUT:
        return
    path = Path(target)
    if path.is_dir():
        raise _unwritable(target, "it is a folder", remedy)
    if not path.parent.is_dir():
        raise _unwritable(target, f"there is no folder {path.parent}", remedy)
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise _unwritable(target, "permission denied", remedy)


def write(target: str, certificate: Mapping[str, Any]) -> None:
    """Write the certificate; `-` is stdout. Raises `TargetError`."""
    text = dump(certificate)
    if target == STDOUT:
        sys.stdout.write(text)
        sys.stdout.flush()
        return
    write_text(target, text)


def write_text(target: str, text: str, remedy: str = REMEDY) -> None:
    """Write a text to a temporary file and rename it; devices are written to directly.

    Raises `TargetError`; then nothing is left behind and an older file is untouched.
    """
    check_target(target, remedy)
    path = Path(target)
    try:
        if path.exists() and not path.is_file():
            with path.open("w", encoding="utf-8") as device:
                device.write(text)
        else:
            replace(path, text.encode())
    except OSError as error:
        raise _unwritable(target, error.strerror or str(error), remedy) from error


def same_file(target: str, source: str | Path) -> bool:
    """Whether two paths name the same existing file."""
    try:
        return Path(target).samefile(source)
    except (OSError, ValueError):
        return False


def _unwritable(target: str, why: str, remedy: str) -> TargetError:
    return TargetError([Finding(code="TC120", message=f"cannot write {target}: {why}", help=remedy)])
