"""`recheck`: a certificate in; every claim examined in a second arithmetic; a verdict and an exit code out."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass, replace

from tubecert.certificate.file import FORMAT, parse
from tubecert.cli import keeper, telling
from tubecert.cli.options import Output
from tubecert.cli.presenting import present
from tubecert.errors import ExitCode
from tubecert.library.numbers import Numbers
from tubecert.library.rechecking import text_of, told, with_controller
from tubecert.printable import printable_json
from tubecert.recheck import document
from tubecert.recheck.run import BUDGET, Examined, Recheck, recheck
from tubecert.report.rechecked import page_of
from tubecert.sampled_loop.record import FORMAT as SAMPLED


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says, as texts."""

    certificate: str
    spec: str | None
    budget: str | None
    deadline: str | None
    controller: str | None = None


def run(given: Given, output: Output) -> ExitCode:
    """Recheck a certificate; with a specification, also whether it belongs to it."""
    numbers = Numbers()
    budget = numbers.count("--budget", given.budget)
    seconds = numbers.positive("--deadline", given.deadline)
    numbers.check()
    limit = None if seconds is None else keeper.left_of(float(seconds))
    name = given.certificate
    text = text_of(name)
    note = "" if given.spec is None else _specification(given.spec, text, name)
    from tubecert.report.terminal import Terminal

    terminal = Terminal.stderr(color=output.color)
    with telling.shown(terminal, output) as show:
        report, most = None if show is None else told(show), BUDGET if budget is None else budget
        found = recheck(text, name, most, report, seconds=limit, heard=_heard)
    if given.controller is not None:
        found = with_controller(found, text, name, given.controller)
    data = _as_json(found, name, note) if output.json else None
    present(replace(output, quiet=output.quiet or output.json), page_of(found, name, note), _next(name), data)
    return found.exit_code


def _next(name: str) -> list[tuple[str, str]]:
    return [
        ("more", f"-v here; tubecert report {shlex.quote(name)}: what is certified, as a page with figures")
    ]


def _heard(item: Examined) -> None:
    why = "" if item.outcome.holds else f": {item.outcome.why}"
    telling.found(f"{item.outcome.verdict:<12}  {item.name}{why}")


def _specification(path: str, text: str, name: str) -> str:
    """A sentence that says that the certificate is of a specification; raises TC604 if it is not."""
    from tubecert.cli.belonging import belongs, sampled_belongs

    if parse(text.encode(), name, (FORMAT, SAMPLED))["format"] == SAMPLED:
        return sampled_belongs(text, name, path)
    return belongs(document.read(text, name), name, path)


def _as_json(found: Recheck, name: str, note: str) -> str:
    failing = found.failing
    data = {
        "certificate": name,
        "verdict": found.verdict,
        "stated": found.stated,
        "hash": found.hash,
        "claims": [
            {
                "claim": item.name,
                "verdict": item.outcome.verdict,
                "why": item.outcome.why,
                "boxes": item.outcome.boxes,
            }
            for item in found.claims
        ],
        "first_failing": None if failing is None else failing.name,
        "not_examined": list(found.unread),
        **({"specification": note} if note else {}),
    }
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"
