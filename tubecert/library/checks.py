"""What there is to say about a specification before it is certified: `tubecert check`, from code."""

from __future__ import annotations

from dataclasses import dataclass, field

from tubecert.findings import Finding, Severity
from tubecert.library.plain import Data
from tubecert.library.shown import Shown
from tubecert.library.specification import Specifiable, load
from tubecert.report import findings as words
from tubecert.report.page import Page


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
        return "\n".join(map(str, (*self.findings, words.summary(self.findings, 1))))

    def _page(self) -> Page:
        return words.page_of(self.name, self.findings)


def check(source: Specifiable, *, settings: Data | None = None) -> Checked:
    """What a control engineer would ask about a specification: `tubecert check`.

    A plan that misses its own dynamics, a declared bound that is broken, a metric that fails at a point: nothing that a
    certificate rests on, but what is hardly meant. Raises `SpecError` as `load` does, where it cannot be read.
    """
    from tubecert import pipeline

    found = load(source, settings=settings)
    return Checked(name=found.name, findings=tuple(pipeline.inspect(found.spec)))
