"""`recheck --spec`: whether a certificate is of the specification in a file.

Compared is what claims rest on: system, safe set, uncertainty, plan (from a CSV file: its knots), start, radii,
adaptation, conditions, and the metric. A metric that was synthesised for the file is not in it: there the certificate
must say that it was synthesised, and for what. What differs beside that is said, and makes no other system.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from tubecert.errors import ExitCode, TubecertError
from tubecert.findings import Finding
from tubecert.recheck.certificate import Knots, read_certificate
from tubecert.recheck.document import Node

_IDLE = ("name", "expect", "simulation", "obstacles", "system.units", "trajectory.file")


class ForeignError(TubecertError):
    """The certificate is of another specification (exit code 1)."""

    exit_code = ExitCode.NOT_CERTIFIED


def belongs(document: Node, name: str, path: str) -> str:
    """A sentence that says that the certificate is of the specification at `path`; raises TC604 if it is not."""
    from tubecert import spec as specification

    read = read_certificate(document).result
    result, loaded = document.mapping()["result"], specification.load(path)
    own, effective = specification.canonical(loaded), result["spec"]["effective"]
    overridden = _overridden(own, effective, result["overrides"])
    asked = own["metric"].get("synthesise") if "metric" in own else None
    if asked is not None:
        found = result.get("synthesis", {}).get("asked")
        own["metric"] = effective["metric"] if found == asked else own["metric"]
    differing = _differing(own, effective)
    table = loaded.trajectory.table
    if table is not None and "trajectory" not in differing:
        differing += _other_table(read.plan.knots, table)
    serious = [key for key in differing if key not in _IDLE]
    if serious:
        message = f"{name} does not belong to {path}: {', '.join(serious)} differ"
        help_ = "certify again, or give the specification that was certified"
        raise ForeignError([Finding(code="TC604", message=message, help=help_)])
    digest = "sha256:" + hashlib.sha256(loaded.source.encode()).hexdigest()
    notes = [f"with {', '.join(overridden)} given on the command line"] if overridden else []
    if asked is not None:
        notes.append("the metric was synthesised for it")
    if differing:
        notes.append(f"nothing rests on what differs: {', '.join(differing)}")
    elif digest != result["spec"]["file_hash"]:
        notes.append("the text of the file has changed, the system has not")
    return f"belongs to {path}" + (f" ({'; '.join(notes)})" if notes else "")


def _overridden(own: dict[str, Any], effective: Mapping[str, Any], overrides: Mapping[str, Any]) -> list[str]:
    """What the command line replaced in the file; there the certificate's value is taken over into `own`."""
    found = []
    for key in ("epsilon", "rho_a"):
        if key in overrides:
            found.append(key)
            own["tube"] = {**own["tube"], key: effective["tube"].get(key)}
    if "metric" in overrides:
        found.append("the metric")
        own["metric"] = effective["metric"]
    return found


def _differing(own: Mapping[str, Any], effective: Mapping[str, Any]) -> list[str]:
    """The keys whose values differ, by name; those that are idle inside a section apart."""
    ours, theirs = _spread(own), _spread(effective)
    return sorted(key for key in {*ours, *theirs} if ours.get(key) != theirs.get(key))


def _spread(data: Mapping[str, Any]) -> dict[str, Any]:
    """A specification with the idle keys of its sections beside them."""
    found = dict(data)
    for path in _IDLE:
        section, _, key = path.partition(".")
        inner = found.get(section)
        if key and isinstance(inner, dict) and key in inner:
            found[path] = inner[key]
            found[section] = {name: value for name, value in inner.items() if name != key}
    return found


def _other_table(knots: Knots | None, table: Any) -> list[str]:
    """What of a plan file differs: bytes that say the same knots are the same plan."""
    same = knots is not None and all(
        tuple(getattr(knots, key)) == tuple(getattr(table.knots, key)) for key in ("t", "x", "u")
    )
    return [] if same else [f"the knots of {table.file}"]
