"""Whether a certificate is of a specification: one judge for every command that is given both.

Compared is what claims rest on: system, safe set, uncertainty, plan (from a CSV file: its knots), start, radii,
adaptation, conditions, and the metric. A metric that was synthesised for the file is not in it: there the certificate
must say that it was synthesised, and for what. What differs beside that is said, and makes no other system.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tubecert.certificate.result import KnotTexts, Overrides, Result
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.printable import visible
from tubecert.records import from_json
from tubecert.spec import Setting, Spec, canonical
from tubecert.spec.load import again
from tubecert.spec.types import Table

_IDLE = ("name", "expect", "simulation", "system.units", "trajectory.file")


class ForeignError(SpecError):
    """The certificate is of another specification: the two files do not go together (exit code 2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Belonging:
    """How a certificate and a specification compare.

    Claims rest on what is `serious`, none on what is `idle`; `overridden` was given on the command line that certified;
    `synthesised` is a metric that the specification asks for; `same_text` says that the file is the one of then.
    """

    serious: tuple[str, ...]
    idle: tuple[str, ...]
    overridden: tuple[str, ...]
    synthesised: bool
    same_text: bool

    def require(self, spec: Spec, name: str) -> None:
        """Raises `ForeignError` (TC604) if the certificate is of another system."""
        if not self.serious:
            return
        message = f"{visible(name)} does not belong to {visible(spec.path)}: {', '.join(self.serious)} differ"
        help = "certify again, or give the specification that was certified"
        place = spec.location(self.serious[0])
        raise ForeignError([Finding(code="TC604", message=message, location=place, help=help)])

    def words(self, path: str) -> str:
        """A sentence about a certificate that belongs to the file at `path`."""
        notes = [f"with {', '.join(self.overridden)} given on the command line"] if self.overridden else []
        if self.synthesised:
            notes.append("the metric was synthesised for it")
        if self.idle:
            notes.append(f"nothing rests on what differs: {', '.join(self.idle)}")
        elif not self.same_text:
            notes.append("the text of the file has changed, the system has not")
        return f"belongs to {visible(path)}" + (f" ({'; '.join(notes)})" if notes else "")


def compared(spec: Spec, result: Result) -> Belonging:
    """The `result` of a certificate against a specification; raises `SpecError` for keys set that it lacks."""
    own, effective = canonical(as_set(spec, result.overrides)), result.spec.effective.data
    overridden = _overridden(own, effective, result.overrides)
    asked = own["metric"].get("synthesise") if "metric" in own else None
    if asked is not None and result.synthesis is not None and result.synthesis.asked.data == asked:
        own["metric"] = effective["metric"]
    differing = _differing(own, effective)
    if spec.trajectory.table is not None and "trajectory" not in differing:
        differing += _other_table(result.plan.knots, spec.trajectory.table)
    digest = "sha256:" + hashlib.sha256(spec.source.encode()).hexdigest()
    return Belonging(
        serious=tuple(key for key in differing if key not in _IDLE),
        idle=tuple(key for key in differing if key in _IDLE),
        overridden=(*overridden, *sorted(result.overrides.settings)),
        synthesised=asked is not None,
        same_text=digest == result.spec.file_hash,
    )


def as_set(spec: Spec, overrides: Overrides) -> Spec:
    """The specification with the keys that were set on the command line that certified."""
    return again(spec, [Setting(path=path, text=text) for path, text in sorted(overrides.settings.items())])


def _overridden(own: dict[str, Any], effective: Mapping[str, Any], overrides: Overrides) -> list[str]:
    """What the command line replaced in the file; there the certificate's value is taken over into `own`."""
    found = []
    for key in ("epsilon", "rho_a"):
        if getattr(overrides, key) is not None:
            found.append(key)
            own["tube"] = {**own["tube"], key: effective["tube"].get(key)}
    if overrides.metric is not None:
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


def _other_table(knots: KnotTexts | None, table: Table) -> list[str]:
    """What of a plan file differs: bytes that say the same knots are the same plan."""
    own = table.knots
    if knots is not None and (own.t, own.x, own.u) == (_exact(knots.t), _rows(knots.x), _rows(knots.u)):
        return []
    return [f"the knots of {table.file}"]


def _rows(rows: Sequence[Sequence[str]]) -> tuple[tuple[Fraction, ...], ...]:
    return tuple(map(_exact, rows))


def _exact(texts: Sequence[str]) -> tuple[Fraction, ...]:
    return tuple(from_json(Fraction, text, "knots") for text in texts)
