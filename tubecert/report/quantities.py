"""The numbers of a certificate as a flat list, so that certificates can be put beside each other.

In: a `Result`. Out: `Quantity`s: `rho`, `half_width.px`, `distance.least_adaptation.bandwidth`. Those of a kind begin
with the name of its section; its gains and margins are what the section tells (`SectionData.pairs`).
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from fractions import Fraction
from io import StringIO
from math import isfinite
from typing import TypeAlias

from tubecert.certificate.result import Certificate, Result
from tubecert.claims.conditions import SECTIONS, condition_name
from tubecert.claims.family import Claim
from tubecert.digits import exact
from tubecert.kinds.kind import Pair, SectionData
from tubecert.kinds.table import KINDS
from tubecert.report.gains import ROLES
from tubecert.report.outline import widths
from tubecert.sampled_loop.record import Certificate as SampledCertificate
from tubecert.sampled_loop.record import Result as SampledResult
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import promise

AnyCertificate: TypeAlias = Certificate | SampledCertificate
AnyResult: TypeAlias = Result | SampledResult
Value = Fraction | float | str | None
_SYMBOLS = {
    "bandwidth": "ω (rad/s)",
    "adaptation_rate": "Γ",
    "ultimate_radius": "in the long run",
    "rate": "rate λ (1/s)",
    "rho_a": "rho_a",
    "rho_r": "rho_r",
}
_DETAILS = ("section", "condition", "constant", "state", "obstacle")  # of a claim, that tell which one it is


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A number (or a word) of a certificate: `section` is the kind it belongs to, `role` the set of gains.

    `share`: it is a margin, a share of what is allowed.
    """

    name: str
    value: Value
    section: str = ""
    role: str = ""
    share: bool = False

    @property
    def key(self) -> str:
        """Its name among all, by dotted path."""
        return ".".join(part for part in (self.section, self.role, self.name) if part)

    @property
    def number(self) -> float | None:
        """The value, to be drawn."""
        if self.value is None or isinstance(self.value, str) or not isfinite(self.value):
            return None
        return float(self.value)

    @property
    def words(self) -> str:
        """What it is called in tables and figures."""
        what = self.name.rpartition(".")[2] if self.share else self.name
        plain = _SYMBOLS.get(what, what.replace("_", " ").replace(".", " of "))
        what = f"margin {condition_name(what)}" if self.share else plain
        role = next((words for role, words in ROLES.items() if role == self.role), "")
        parts = [SECTIONS.get(self.section, self.section), "" if self.role == "feedback" else role, what]
        return ", ".join(part for part in parts if part)


def quantities(result: AnyResult) -> Iterator[Quantity]:
    """Every quantity, the tube's first, then kind after kind; of a sampled loop the tube's and the inputs'."""
    if isinstance(result, SampledResult):
        yield from _of_sampled_loop(result)
        return
    yield from _of_tube(result)
    for kind in KINDS:
        section = result.sections.get(kind.key)
        if section is not None:
            yield from _of_section(kind.key, section, asked=result.asked)


def failed(result: AnyResult) -> str:
    """What is not proven, by ids: claims of the verdict, each with what tells which one it is."""
    if isinstance(result, SampledResult):
        return " ".join(f"{lack.kind}:{lack.where}".removesuffix(":") for lack in result.lacks)
    found = [_id(reason.claim) for reason in result.reasons if reason.verdict is not Verdict.CERTIFIED]
    return " ".join(dict.fromkeys(found))


def lacking(result: AnyResult) -> str:
    """The same in words."""
    if isinstance(result, SampledResult):
        return promise(result)
    return "; ".join(dict.fromkeys(reason.claim.title for reason in result.failed))


def _of_tube(result: Result) -> Iterator[Quantity]:
    tube = result.tube
    if result.metric is not None:
        yield Quantity(name="rate", value=result.metric.rate)
    if tube is not None:
        for name in ("epsilon", "rho_a", "rho", "rho_r"):
            yield Quantity(name=name, value=getattr(tube, name))
        for state, width in (widths(result) or {}).items():
            yield Quantity(name=f"half_width.{state}", value=width)
    for number, found in enumerate(result.clearance, start=1):
        yield Quantity(name=f"clearance.obstacle {number}", value=found.clearance.below)


def _of_sampled_loop(result: SampledResult) -> Iterator[Quantity]:
    for state, width in result.half_widths.items():
        yield Quantity(name=f"half_width.{state}", value=width)
        yield Quantity(name=f"half_width_in_the_long_run.{state}", value=result.tube[-1].half_widths[state])
    for use in result.inputs if result.half_widths else ():
        yield Quantity(name=f"least.{use.input}", value=use.range[0])
        yield Quantity(name=f"greatest.{use.input}", value=use.range[1])


def _of_section(key: str, section: SectionData, *, asked: bool) -> Iterator[Quantity]:
    yield Quantity(section=key, name="verdict", value=str(section.verdict))
    conditions = dict.fromkeys(item.condition for item in section.shortfalls)
    yield Quantity(section=key, name="failed", value=" ".join(conditions) or None)
    for pair in section.pairs(asked=asked):
        yield from _of_pair(key, pair)
    for item in fields(section):
        value = getattr(section, item.name)
        if isinstance(value, float):
            yield Quantity(section=key, name=item.name, value=value)


def _of_pair(key: str, pair: Pair) -> Iterator[Quantity]:
    for item in fields(pair):
        value = getattr(pair, item.name)
        if isinstance(value, (Fraction, float)):
            yield Quantity(section=key, role=pair.role, name=item.name, value=value)
    for condition, margin in pair.margins.items():
        yield Quantity(
            section=key, role=pair.role, name=f"margin.{condition}", value=margin.below, share=True
        )


def _id(claim: Claim) -> str:
    details = [str(getattr(claim, name)) for name in _DETAILS if getattr(claim, name, None) is not None]
    return ":".join(dict.fromkeys([claim.tag, *details]))


def merged(rows: Iterable[Iterable[Quantity]]) -> list[Quantity]:
    """Every quantity that a row has, once (without a value), in the order in which rows have them."""
    order: list[str] = []
    first: dict[str, Quantity] = {}
    for row in rows:
        before = 0
        for each in row:
            if each.key not in first:
                first[each.key] = each
                order.insert(before, each.key)
            before = order.index(each.key) + 1
    return [first[key] for key in order]


def table_text(rows: Iterable[Iterable[Value]]) -> str:
    """Rows as comma-separated values, every digit of numbers; what is not there is empty."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in rows:
        writer.writerow(
            "" if cell is None else cell if isinstance(cell, str) else exact(cell) for cell in row
        )
    return text.getvalue()
