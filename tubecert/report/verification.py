"""What `verify` found: a line for each metric, in words or as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.claims.family import Reason
from tubecert.claims.metric import MetricKilling
from tubecert.digits import down, end, exact, up
from tubecert.enclosure.constant import Constant
from tubecert.printable import printable_json, visible
from tubecert.records import to_json
from tubecert.report.claimed import place
from tubecert.report.layout import VERDICTS, indented
from tubecert.verdict import Verdict
from tubecert.words.claims import sentence

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.pipeline.verification import Verified


def line(file: str, found: Verified) -> Text:
    """The verdict, and what is known of the metric."""
    shown = Text.assemble(
        (str(found.verdict), f"bold {VERDICTS[found.verdict]}"), (f" {visible(file)}: ", "bold")
    )
    if found.reason is not None:
        return shown.append(sentence(found.reason))
    parts = [f"rate {exact(found.rate)} 1/s", _supports(found), _condition(found)]
    return shown.append(", ".join(part for part in parts if part))


def report(file: str, found: Verified) -> list[RenderableType]:
    """A few lines for one metric."""
    return [line(file, found), *(indented(Text(text)) for text in _details(found))]


def summary(found: Sequence[tuple[str, Verified]], target: str | None) -> list[RenderableType]:
    """How many there are of each verdict, and where a metric was written."""
    parts: list[RenderableType] = []
    if len(found) > 1:
        verdicts = [verified.verdict for _, verified in found]
        counts = ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts))
        parts += [Text(), Text(f"{len(found)} metrics: {counts}")]
    if target is not None and found[0][1].file is not None:
        parts += [Text(), Text(f"Metric: {visible(target)}")]
    return parts


def _details(found: Verified) -> list[str]:
    sides = ", ".join(f"{name} in [{end(lo)}, {end(hi)}]" for name, (lo, hi) in found.safe_set.items())
    if found.reason is None:
        return [f"C1-C3 hold on {sides}"]
    known = [part for part in (_supports(found), _condition(found)) if part]
    at = [] if found.reason.at is None else [f"at {place(found.states, found.reason.at)}"]
    alone = "C2 alone: " if isinstance(found.reason.claim, MetricKilling) else ""
    return [*at, *([alone + ", ".join(known)] if known else []), f"on {sides}"]


def _supports(found: Verified) -> str:
    rate = found.largest_rate
    if rate is None:
        return ""
    if not isfinite(rate.below):
        return "" if rate.above < 0 else "C2 is void: there are as many inputs as states"
    return (
        f"supports rates up to {down(rate.below, 7)} 1/s" if rate.below > 0 else "supports no positive rate"
    )


def _condition(found: Verified) -> str:
    return "" if found.condition_number is None else f"condition number {up(found.condition_number.above)}"


def as_json(found: Sequence[tuple[str, Verified]]) -> str:
    """A list of objects, one for each metric."""
    return (
        printable_json(json.dumps([to_json(_data(*each)) for each in found], indent=1, ensure_ascii=False))
        + "\n"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifiedData:
    """What is known of the metric in a file; what is None was not reached."""

    file: str
    name: str
    verdict: Verdict
    rate: Fraction
    safe_set: Mapping[str, tuple[Fraction, Fraction]]
    largest_rate: Constant | None = None
    condition_number: Constant | None = None
    lower: Constant | None = None
    upper: Constant | None = None
    reason: Reason | None = None


def _data(file: str, found: Verified) -> VerifiedData:
    return VerifiedData(
        file=file,
        name=found.name,
        verdict=found.verdict,
        rate=found.rate,
        safe_set=found.safe_set,
        largest_rate=_known(found.largest_rate),
        condition_number=_known(found.condition_number),
        lower=_known(found.lower),
        upper=_known(found.upper),
        reason=found.reason,
    )


def _known(value: Constant | None) -> Constant | None:
    return value if value is not None and isfinite(value.below) else None
