"""Findings as SARIF 2.1.0, the format of code scanning."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from tubecert.checking import Checked
from tubecert.findings import Finding, Location, Severity
from tubecert.printable import json_text
from tubecert.release import __version__
from tubecert.report.pages import codes

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "note"}


def render(results: Sequence[Checked]) -> str:
    """The log: one run, a rule for each code that occurs."""
    findings = [item for result in results for item in result.findings]
    used = sorted({item.code for item in findings})
    run = {
        "tool": {
            "driver": {"name": "tubecert", "semanticVersion": __version__, "rules": [*map(_rule, used)]}
        },
        "invocations": [{"executionSuccessful": True}],
        "columnKind": "unicodeCodePoints",
        "artifacts": [{"location": _artifact(result.path)} for result in results],
        "results": list(_results(findings, used)),
    }
    log = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return json_text(log)


def _rule(code: str) -> dict[str, Any]:
    page = codes().get(code)
    title = page.title if page else code
    return {
        "id": code,
        "shortDescription": {"text": title},
        "fullDescription": {"text": page.meaning if page else title},
        "help": {"text": f"tubecert explain {code}"},
    }


def _results(findings: Sequence[Finding], used: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Each with a fingerprint of its code and line, numbered where lines are alike."""
    seen = Counter[str]()
    for item in findings:
        text, place = item.message + (f"\nhelp: {item.help}" if item.help else ""), item.location
        result: dict[str, Any] = {"ruleId": item.code, "ruleIndex": used.index(item.code)}
        result |= {"level": _LEVELS[item.severity], "message": {"text": text}}
        if place is not None:
            line = f"{item.code} {place.source.strip()}".encode("utf-8", "backslashreplace")
            mark = hashlib.sha256(line).hexdigest()[:16]
            seen[mark] += 1
            result["locations"] = [{"physicalLocation": _place(place)}]
            result["partialFingerprints"] = {"primaryLocationLineHash": f"{mark}:{seen[mark]}"}
        yield result


def _place(location: Location) -> dict[str, Any]:
    region: dict[str, Any] = {
        "startLine": location.line,
        "startColumn": location.column,
        "endColumn": location.column + location.width,
    }
    if location.source:
        region["snippet"] = {"text": location.source}
    return {"artifactLocation": _artifact(location.file), "region": region}


def _artifact(file: str) -> dict[str, str]:
    """A path below the current folder relative to it, any other one as an absolute URI."""
    path = Path(os.path.abspath(file))
    try:
        return {"uri": quote(os.fsencode(path.relative_to(Path.cwd()).as_posix())), "uriBaseId": "%SRCROOT%"}
    except ValueError:
        return {"uri": path.as_uri()}
