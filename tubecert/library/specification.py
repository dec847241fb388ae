"""Specifications for code: from a file, a mapping, or a text; what there is to say about one that is not certified yet.

In: what a user has. Out: a `Specification`, which holds the `Spec` that commands read, or every problem as findings.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeAlias

from tubecert.asking import SETTINGS, asker, named, text_of
from tubecert.certificate.effective import Effective
from tubecert.certificate.file import digest
from tubecert.errors import SpecError
from tubecert.findings import Finding, NamedPlace, Severity
from tubecert.library import plain
from tubecert.library.plain import Data, Plain
from tubecert.library.shown import Shown
from tubecert.report.findings import page_of, summary
from tubecert.spec import Setting, Spec, canonical
from tubecert.spec.canonical import as_file
from tubecert.spec.load import VERSION, Reads, again, load_source, whole
from tubecert.spec.source import Source, read_source

if TYPE_CHECKING:
    from tubecert.report.page import Page

File: TypeAlias = str | os.PathLike[str]
NAME: Final = "<specification>"  # what findings call a specification that is no file


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """A system with its safe set, uncertainty, plan and options, or with a metric alone; `spec` has all of it, exact.

    Two specifications are equal if they are the same but for spelling.
    """

    spec: Spec

    @property
    def name(self) -> str:
        """Its name."""
        return self.spec.name

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the states (n), in the order of every vector."""
        return self.spec.states

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the inputs (m)."""
        return self.spec.inputs

    @property
    def units(self) -> Mapping[str, str]:
        """Units of states and inputs, as far as the specification says."""
        return MappingProxyType(dict(self.spec.units))

    @property
    def data(self) -> dict[str, Plain]:
        """The effective specification in texts, lists and mappings, defaults written out; itself a specification."""
        return as_file(canonical(self.spec))

    @property
    def hash(self) -> str:
        """The hash of its canonical form: the same for the same system, however it is written."""
        return digest(canonical(self.spec))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Specification) and self.data == other.data

    def __hash__(self) -> int:
        return hash(self.hash)

    def __repr__(self) -> str:
        told = f"states {', '.join(self.states)}; inputs {', '.join(self.inputs)}"
        return f"<Specification {self.name}: {told}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        unseen = {"trajectory": {"kind": "equilibrium"}} if self.spec.lacks else {}  # a card shows no plan
        return notebook.specification(Effective.of(self.data | unseen))


Specifiable: TypeAlias = Specification | File | Data


def load(source: Specifiable, *, settings: Data | None = None) -> Specification:
    """The specification in a file (its path), or in a mapping (see `specification`).

    `settings` are keys that are set in place of its own, by their paths: `{"tube.rho_a": 0.05}`, as `--set` does.
    Raises `TargetError` if the file cannot be read, and `SpecError` with every problem of it.
    """
    return Specification(spec=spec_of(source, settings_of(settings or {}), "question"))


def specification(data: Data | str) -> Specification:
    """The specification in a mapping with the keys of the format, or in a text (YAML).

    Values may be texts, numbers (a float stands for its shortest decimal), lists, arrays, and expressions and matrices
    of sympy; `tubecert: 1` may be left out. Raises `SpecError` with every problem.
    """
    return Specification(spec=load_source(_source(data), reads="question"))


def spec_of(source: Specifiable, settings: Sequence[Setting] = (), reads: Reads = "whole") -> Spec:
    """The specification in a source, as far as it `reads` (`spec.load`); raises `SpecError`."""
    if isinstance(source, Specification):
        spec = again(source.spec, [*settings_in(source.spec), *settings]) if settings else source.spec
        return whole(spec) if reads == "whole" else spec
    return load_source(source_of(source)[0], settings, reads)


def settings_in(spec: Spec | None) -> list[Setting]:
    """The keys of a specification that were set."""
    return [] if spec is None else [Setting(path=path, text=text) for path, text in spec.settings]


def require_once(settings: Iterable[Setting]) -> None:
    """Raises `SpecError` for everything asked that says what a key says that was set in the specification."""
    findings, given = [], asker().given
    for setting in settings:
        source = str(setting)
        place = NamedPlace(file=setting.place, line=1, column=1, source=source, width=len(setting.path))
        for name, kind in asker().words.items():
            if kind.sets and given.get(name) is not None and setting.meets(kind.sets):
                message = f"{named(name)} is given, too, and says what {kind.sets} is"
                findings += [Finding(code="TC104", message=message, location=place, help="keep one of them")]
    if findings:
        raise SpecError(findings)


def settings_of(given: Data | Sequence[Setting]) -> list[Setting]:
    """Keys that are set, with the texts of their values; raises `SpecError`."""
    if not isinstance(given, Mapping):
        return list(SETTINGS.read(named("settings"), given))
    texts = (f"{key}={plain.entry_text(value, str(key))}" for key, value in given.items())
    return [Setting.of(text, "settings") for text in texts]


def source_of(spec: Specifiable) -> tuple[Source, Spec | None]:
    """The text of a specification, which need not be valid yet, and the specification if it is one."""
    if isinstance(spec, Specification):
        return Source.of(spec.spec.path, spec.spec.source), spec.spec
    return (_source(spec) if isinstance(spec, Mapping) else read_source(text_of("spec", spec))), None


def _source(data: Data | str) -> Source:
    if isinstance(data, str):
        return Source.of(NAME, data)
    whole = data if "tubecert" in data else {"tubecert": VERSION, **data}
    return Source.of(NAME, plain.document_text(whole))


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked(Shown):
    """What was found in a specification: `findings`, each with its code, severity, message, place and help."""

    name: str
    findings: tuple[Finding, ...] = field(repr=False)

    @property
    def fine(self) -> bool:
        """Whether nothing is wrong or suspicious: notes may be left."""
        return all(item.severity is Severity.NOTE for item in self.findings)

    def __str__(self) -> str:
        return "\n".join(map(str, (*self.findings, summary(self.findings, 1))))

    def _page(self) -> Page:
        return page_of(self.name, self.findings)


def check(source: Specifiable, *, settings: Data | None = None) -> Checked:
    """What a control engineer would ask about a specification: `tubecert check`.

    A plan that misses its own dynamics, a declared bound that is broken, a metric that fails at a point: nothing that a
    certificate rests on, but what is hardly meant. Raises `SpecError` as `load` does, where it cannot be read.
    """
    from tubecert import pipeline

    found = load(source, settings=settings)
    return Checked(name=found.name, findings=tuple(pipeline.inspect(found.spec)))
