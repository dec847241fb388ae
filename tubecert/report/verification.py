"""What `verify` found, as a page for each metric, and as data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from math import isfinite
from typing import TYPE_CHECKING

from tubecert.claims.statements import MetricKilling
from tubecert.digits import down, exact, up
from tubecert.enclosure.constant import Constant
from tubecert.printable import json_text
from tubecert.records import Json, to_json
from tubecert.report.claimed import box, place
from tubecert.report.page import Facts, Page, Section

if TYPE_CHECKING:
    from tubecert.pipeline.verification import Verified

_UNTOLD = ("states", "name", "file")  # of the fields: `file` is the metric, what it is called comes first


def page_of(file: str, found: Verified) -> Page:
    """The page of a metric in a file."""
    reason, facts = found.reason, Facts.of(_details(found))
    known = [f"rate {exact(found.rate)} 1/s", _supports(found), _condition(found)]
    return Page(
        name=file,
        verdict=found.verdict,
        summary=", ".join(filter(None, known)) if reason is None else reason.sentence,
        sections=(Section(key="metric", title="Metric", blocks=(facts,)),),
        about="metric",
    )


def _details(found: Verified) -> Iterator[tuple[str, str]]:
    sides, reason = box(found.safe_set), found.reason
    if reason is None:
        yield "C1 to C3", f"hold on {sides}"
        return
    if reason.at is not None:
        yield "at", place(found.states, reason.at)
    if known := ", ".join(filter(None, (_supports(found), _condition(found)))):
        yield "C2 alone" if isinstance(reason.claim, MetricKilling) else "metric", known
    yield "on", sides


def _supports(found: Verified) -> str:
    rate = found.largest_rate
    if rate is None:
        return ""
    if not isfinite(rate.below):
        return "" if rate.above < 0 else "C2 is void: there are as many inputs as states"
    least = f"rates up to {down(rate.below, 7)} 1/s" if rate.below > 0 else "no positive rate"
    return f"supports {least}"


def _condition(found: Verified) -> str:
    return "" if found.condition_number is None else f"condition number {up(found.condition_number.above)}"


def as_json(found: Sequence[tuple[str, Verified]]) -> str:
    """A list of objects, one for each metric; what was not reached is left out."""
    return json_text([_data(*each) for each in found])


def _data(file: str, found: Verified) -> Json:
    values = {item.name: getattr(found, item.name) for item in fields(found) if item.name not in _UNTOLD}
    known = {name: value for name, value in values.items() if value is not None and _finite(value)}
    return to_json({"file": file, "name": found.name, **known})


def _finite(value: object) -> bool:
    return not isinstance(value, Constant) or isfinite(value.below)
