"""`design --corridor` and `--pareto`: what a tube asks of the machine; each answer is a certificate on disk."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import certificate
from tubecert.claims.advice import HardwarePart
from tubecert.cli.options import Output
from tubecert.cli.presenting import present
from tubecert.errors import ExitCode
from tubecert.library.trading import Asked, quantities
from tubecert.printable import printable_json
from tubecert.report import trade as told

if TYPE_CHECKING:
    from tubecert.certificate.result import Result

FILES: Final[Mapping[HardwarePart, str]] = {
    "sample_time": "rate",
    "delay": "delay",
    "noise": "noise",
    "wind": "wind",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """Where certificates go, and what makes the text of one."""

    target: str
    seal: Callable[[Result], str]


def corridor(words: str, asked: Asked, kept: Kept, output: Output) -> ExitCode:
    """The cheapest machine for a tube, part by part."""
    from tubecert.library.designing import offered

    spec, found = offered(words, asked)
    files = {}
    for each in found.offers:
        if each.value is not None:
            files[each.part] = _named(kept.target, FILES[each.part])
            certificate.write_text(files[each.part], kept.seal(each.result))
    data = (
        printable_json(json.dumps(told.offers_data(found.offers, files), indent=1, ensure_ascii=False)) + "\n"
    )
    present(
        output,
        told.offers_summary(spec, found.offers),
        lambda: told.offers(spec, found, files),
        data if output.json else None,
    )
    failed = next((each for each in found.offers if each.value is None), None)
    if found.cut == "interrupted":
        return ExitCode.INTERRUPTED
    return ExitCode.CERTIFIED if failed is None else failed.result.verdict.exit_code


def pareto(words: str, asked: Asked, kept: Kept, output: Output) -> ExitCode:
    """The size of the tube against a number of the machine."""
    from tubecert.library.designing import fronted

    _, part = quantities(words, asked.named)
    spec, found = fronted(words, asked)
    files = {}
    for number, point in enumerate(found.best, start=1):
        files[point.scale] = _named(kept.target, f"{number:02d}")
        certificate.write_text(files[point.scale], kept.seal(point.offer.result))
    stem = kept.target.removesuffix(".json")
    if files:
        certificate.write_text(f"{stem}.csv", told.table(found, files))
        certificate.write_text(f"{stem}.svg", told.drawn(found, part, spec.name))
    data = printable_json(json.dumps(told.front_data(found, files), indent=1, ensure_ascii=False)) + "\n"
    present(
        output,
        told.front_summary(spec, found, part),
        lambda: told.front(spec, found, part, files, stem),
        data if output.json else None,
    )
    if found.cut == "interrupted":
        return ExitCode.INTERRUPTED
    return ExitCode.CERTIFIED if files else found.points[0].offer.result.verdict.exit_code


def _named(target: str, word: str) -> str:
    """A file beside the target."""
    path = Path(target)
    return str(path.with_name(f"{path.name.removesuffix('.json')}.{word}.json"))
