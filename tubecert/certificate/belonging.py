"""Whether a certificate is of a specification: one judge for every command that is given both.

Compared is every key of the canonical specification, and of a plan from a CSV file every knot: whatever differs makes
another system (TC604), but for the keys in `_IDLE`, of which it is said. A metric that was synthesised for the file is
not in it: there the certificate must say that it was synthesised, and for what. What the command line gave is no part
of the file: every member of `overrides` is told with its value. So are other bytes of the files that say the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from tubecert.certificate.result import KnotTexts, Overrides, Result
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.printable import visible
from tubecert.records import from_json, to_json
from tubecert.spec import Knots, Setting, Spec, Table, canonical
from tubecert.spec.load import again

_IDLE = ("name", "expect", "simulation", "system.units", "trajectory.file")


class ForeignError(SpecError):
    """The certificate is of another specification: the two files do not go together (exit code 2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Belonging:
    """How a certificate and a specification compare.

    Claims rest on what is `serious`, none on what is `idle`; `overridden` was given on the command line that certified;
    `synthesised` is a metric that the specification asks for; `rewritten` are files whose bytes are not those of then.
    """

    serious: tuple[str, ...]
    idle: tuple[str, ...]
    overridden: tuple[str, ...]
    synthesised: bool
    rewritten: tuple[str, ...]

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
        notes += [f"the text of {visible(file)} has changed, the system has not" for file in self.rewritten]
        return f"belongs to {visible(path)}" + (f" ({'; '.join(notes)})" if notes else "")


def compared(spec: Spec, result: Result) -> Belonging:
    """The `result` of a certificate against a specification; raises `SpecError` for keys set that it lacks."""
    own, effective = canonical(as_set(spec, result.overrides.settings)), result.spec.effective.data
    _taken_over(own, effective, result.overrides)
    asked = own["metric"].get("synthesise") if "metric" in own else None
    if asked is not None and result.synthesis is not None and result.synthesis.asked.data == asked:
        own["metric"] = effective["metric"]
    differing = _differing(own, effective)
    if spec.trajectory.table is not None and "trajectory" not in differing:
        differing += _other_table(result.plan.knots, spec.trajectory.table)
    rewritten = _rewritten(spec, result)
    return _belonging(differing, _told(result.overrides), rewritten, synthesised=asked is not None)


def compared_canonically(
    spec: Spec, effective: Mapping[str, Any], settings: Mapping[str, str], file_hash: str, knots: Knots | None
) -> Belonging:
    """The same of a certificate that rests on the specification, the keys that were set, and knots alone."""
    own = as_set(spec, settings)
    differing, table = _differing(canonical(own), effective), own.trajectory.table
    if table is not None and table.knots != knots:
        differing.append(f"the knots of {table.file}")
    told = tuple(f"{visible(path)} = {visible(text)}" for path, text in sorted(settings.items()))
    return _belonging(differing, told, ["the file"] if _hash_of(spec) != file_hash else [])


def _belonging(
    differing: Iterable[str],
    overridden: Iterable[str],
    rewritten: Iterable[str],
    *,
    synthesised: bool = False,
) -> Belonging:
    return Belonging(
        serious=tuple(key for key in differing if key not in _IDLE),
        idle=tuple(key for key in differing if key in _IDLE),
        overridden=tuple(overridden),
        synthesised=synthesised,
        rewritten=tuple(rewritten),
    )


def _hash_of(spec: Spec) -> str:
    return f"sha256:{hashlib.sha256(spec.source.encode()).hexdigest()}"


def _told(overrides: Overrides) -> Iterator[str]:
    """Everything that the command line gave, with its value: whether it did so is not to be known from the file."""
    for key, value in to_json(overrides).items():
        given = value if isinstance(value, dict) else {key: value}
        yield from (f"{visible(name)} = {visible(str(own))}" for name, own in sorted(given.items()))


def _rewritten(spec: Spec, result: Result) -> Iterator[str]:
    """Files whose bytes are others than the certificate names, though they say the same."""
    table = spec.trajectory.table
    if _hash_of(spec) != result.spec.file_hash:
        yield "the file"
    if table is not None and f"sha256:{table.sha256}" != result.plan.file_hash:
        yield table.file


def as_set(spec: Spec, settings: Mapping[str, str]) -> Spec:
    """The specification with the keys that were set on the command line that certified."""
    return again(spec, [Setting(path=path, text=text) for path, text in sorted(settings.items())])


def _taken_over(own: dict[str, Any], effective: Mapping[str, Any], overrides: Overrides) -> None:
    """What the command line replaced in the file: there the certificate's value is taken over into `own`."""
    for key in ("epsilon", "rho_a"):
        if getattr(overrides, key) is not None:
            own["tube"] = {**own["tube"], key: effective["tube"].get(key)}
    if overrides.metric is not None:
        own["metric"] = effective["metric"]


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

    def exact(texts: Sequence[str]) -> tuple[Fraction, ...]:
        return tuple(from_json(Fraction, text, "knots") for text in texts)

    theirs = (
        None if knots is None else (exact(knots.t), tuple(map(exact, knots.x)), tuple(map(exact, knots.u)))
    )
    return [] if (own.t, own.x, own.u) == theirs else [f"the knots of {table.file}"]
