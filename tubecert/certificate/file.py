"""The certificate as data: sealed with a hash, written atomically, read back, mapped to an exit code.

In: what a certification found. Out: canonical JSON. The hash is of the canonical bytes of `result` (UTF-8, sorted
keys, no spaces, no NaN), so that any change of what was proven shows; `notes` and `run` are not hashed. Trusted: yes.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Final, cast

from tubecert.certificate.notes import split
from tubecert.errors import TargetError, TubecertError
from tubecert.files import STDIN, Kind, read, read_stdin, replace
from tubecert.findings import Finding
from tubecert.printable import printable_json, visible

FORMAT = "tubecert-certificate/3"
KIND: Final = Kind(
    most=64_000_000, unreadable="TC600", too_large="TC600", help="give a file that tubecert certify wrote"
)
STDOUT = "-"
OTHER: Final = "choose another file"
_WITH: Final = f"{OTHER} with -o FILE"
REMEDY = f"{_WITH}, or -o - for stdout"

# of what is written: how its text begins, else the keys that it has as JSON
_BEGINS: Final = {"html": "<!DOCTYPE html>", "markdown": "#", "csv": "quantity,"}
_KEYS: Final = {
    "certificate": {"format", "hash", "result"},
    "metric file": {"format", "solver", "verified_on"},
    "json": {"certificates", "quantities", "differences"},
}
_CALLED: Final = {"html": "page", "markdown": "page", "csv": "comparison", "json": "comparison"}

_VERSIONED = re.compile(r"tubecert-(certificate|sampled-loop)/\d{1,9}", re.ASCII)


def canonical_bytes(data: Any) -> bytes:
    """The bytes that are hashed. Raises `ValueError` for NaN or infinity."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode()


def digest(data: Any) -> str:
    """`sha256:` and the hash of the canonical bytes."""
    return "sha256:" + hashlib.sha256(canonical_bytes(data)).hexdigest()


def seal(found: Mapping[str, Any], run: Mapping[str, Any]) -> dict[str, Any]:
    """The certificate: what was proven, its hash, what explains it, how it was made (versions, times, command line)."""
    result, notes = split(found)
    return {"format": FORMAT, "hash": digest(result), "result": result, "notes": notes, "run": dict(run)}


def dump(certificate: Mapping[str, Any]) -> str:
    """The file's text: sorted keys, indented."""
    text = json.dumps(certificate, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False)
    return printable_json(text) + "\n"


def load(path: str, formats: Collection[str] = (FORMAT,)) -> dict[str, Any]:
    """The certificate in a file (`-`: on stdin), if its format is one of these and its hash is that of its result.

    Raises `TargetError` for anything else. What the result says is not examined here.
    """
    certificate = parse(read_stdin(KIND) if path == STDIN else read(path, KIND), path, formats)
    if certificate.get("hash") != digest(certificate["result"]):
        raise foreign(path, "was changed after it had been written: its hash is not that of its result")
    return certificate


def parse(data: bytes, name: str, formats: Collection[str] = (FORMAT,)) -> dict[str, Any]:
    """The certificate that bytes say; its hash is not compared. Raises `TargetError`."""
    try:
        certificate = json.loads(data.decode(), parse_constant=_no_number, object_pairs_hook=_once)
    except UnicodeDecodeError:
        raise unreadable(name, "it is not UTF-8") from None
    except json.JSONDecodeError as error:
        if name.endswith((".yaml", ".yml")):
            raise _a_specification(name) from None
        raise unreadable(name, f"it is not JSON (line {error.lineno}: {error.msg})") from None
    except RecursionError:
        raise unreadable(name, "it is nested too deeply") from None
    except ValueError as error:
        raise unreadable(name, str(error)) from None
    known = certificate.get("format") if isinstance(certificate, dict) else None
    if not isinstance(known, str) or not _VERSIONED.fullmatch(known):
        raise foreign(name, f"is not a certificate ({FORMAT})")
    if known not in formats:
        message = f"{visible(name)} has the format {known}; what is read here is {' or '.join(formats)}"
        raise TargetError([Finding(code="TC602", message=message, help="certify again")])
    if not isinstance(certificate.get("result"), dict):
        raise incomplete(name, "it has no result")
    if not _prints(certificate):
        raise foreign(name, "holds a character that does not print, and tubecert writes none")
    return cast(dict[str, Any], certificate)


def _no_number(word: str) -> None:
    raise ValueError(f"it holds {word}, which is no number of JSON")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose keys are all different: readers must not differ about what it says."""
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key occurs twice in one object")
    return found


def _prints(data: Any) -> bool:
    """Whether every text and key consists of characters that print: none can pass for a line of a report."""
    waiting = [data]
    while waiting:
        item = waiting.pop()
        if isinstance(item, str) and not item.isprintable():
            return False
        if isinstance(item, dict):
            waiting += [*item, *item.values()]
        elif isinstance(item, list):
            waiting += item
    return True


def unreadable(name: str, why: str) -> TargetError:
    """The error for a file that cannot be read as a certificate."""
    return TargetError([Finding(code="TC600", message=f"cannot read {visible(name)}: {why}", help=KIND.help)])


def _a_specification(name: str) -> TargetError:
    shown = visible(name)
    message = f"cannot read {shown}: it is not JSON, but a specification, and a certificate is needed here"
    help = f"`tubecert certify {shown}` writes one: {visible(Path(name).stem)}.certificate.json"
    return TargetError([Finding(code="TC600", message=message, help=help)])


def foreign(name: str, why: str) -> TargetError:
    """The error for a file that is no certificate, or no longer the one that was written."""
    return TargetError([Finding(code="TC601", message=f"{visible(name)} {why}", help=KIND.help)])


def incomplete(name: str, why: str) -> TargetError:
    """The error for a certificate that lacks something, or has it of another kind, below a hash that is right."""
    message = f"the certificate {visible(name)} is not complete: {why}"
    return TargetError([Finding(code="TC603", message=message, help="certify again")])


def refused(message: str, help: str = _WITH) -> TargetError:
    """The error about a file that is not written."""
    return TargetError([Finding(code="TC120", message=message, help=help)])


def spare(
    target: str, what: str = "", inputs: Mapping[str, str | Path | None] = {}, help: str = _WITH
) -> None:
    """Raise `TargetError` for a target that would take the place of an input, or of what is no `what` of tubecert.

    `inputs` are named by what they are. An older file of the same form is replaced.
    """
    if target == STDOUT:
        return
    for name, source in inputs.items():
        if source is not None and _is_same(target, source):
            raise refused(f"{visible(target)} is the {name} itself and would be overwritten", help)
    if what and Path(target).is_file() and not _written_as(what, target):
        called = _CALLED.get(what, what)
        raise refused(f"{visible(target)} is no {called} that tubecert wrote, and would be overwritten", help)


def _written_as(what: str, path: str) -> bool:
    """Whether tubecert writes files like this one, which may be empty, as a `what`."""
    try:
        text = read(path, KIND).decode().lstrip()
        if what in _BEGINS or not text:
            return not text or text.startswith(_BEGINS[what])
        content = json.loads(text)
    except (TubecertError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and _KEYS[what] <= content.keys()


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
    """Write a text as `write_bytes` does."""
    write_bytes(target, text.encode(), remedy)


def write_bytes(target: str, data: bytes, remedy: str = REMEDY) -> None:
    """Write to a temporary file and rename it; devices are written to directly.

    Raises `TargetError`; then nothing is left behind and an older file is untouched.
    """
    check_target(target, remedy)
    path = Path(target)
    try:
        if path.exists() and not path.is_file():
            with path.open("wb") as device:
                device.write(data)
        else:
            replace(path, data)
    except OSError as error:
        raise _unwritable(target, error.strerror or str(error), remedy) from error


def _is_same(target: str, source: str | Path) -> bool:
    """Whether two paths name the same file, which need not exist."""
    try:
        return os.path.abspath(source) == os.path.abspath(target) or Path(target).samefile(source)
    except (OSError, ValueError):
        return False


def _unwritable(target: str, why: str, remedy: str) -> TargetError:
    return TargetError([Finding(code="TC120", message=f"cannot write {visible(target)}: {why}", help=remedy)])
