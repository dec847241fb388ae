"""`design`: a specification with a machine in; the narrowest certified tube, and every attempt, out."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import certificate, pipeline
from tubecert.cli.corridor import Kept, corridor, pareto
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import deadline_after, spare
from tubecert.errors import ExitCode
from tubecert.libraries import versions
from tubecert.library.numbers import Numbers
from tubecert.library.trading import Asked, refused
from tubecert.printable import printable_json, visible
from tubecert.records import to_json
from tubecert.report import design as told
from tubecert.report import progress
from tubecert.report.terminal import Terminal
from tubecert.spec.load import load_source
from tubecert.spec.source import read_source

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.pipeline.design import Design


SEARCH: Final = "search"


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says, as texts."""

    spec: str
    minimise: str | None
    corridor: str | None
    pareto: str | None
    sensitivities: bool
    settings: Sequence[str]
    metric: str | None
    gap: str
    budget: str | None
    deadline: str | None
    target: str | None


def run(given: Given, output: Output) -> ExitCode:
    """Try tubes of every size, and write the certificate of the narrowest; or what a tube asks of the machine."""
    numbers = Numbers()
    gap = numbers.positive("--gap", given.gap, below=1)
    budget = numbers.count("--budget", given.budget)
    seconds = numbers.positive("--deadline", given.deadline)
    numbers.check()
    target = given.target or f"{Path(given.spec).stem}.design.json"
    certificate.check_target(target)
    file = None if given.metric == SEARCH else given.metric
    spare(target, {"specification": given.spec, "metric file": file})
    fixed = settings_of(given.settings, metric=given.metric)
    first = load_source(read_source(given.spec), fixed)
    from tubecert.library.designing import improved, narrowed, opened

    default = pipeline.Options()
    options = pipeline.Options(gap=gap or default.gap, budget=budget or default.budget)
    minimise = None if given.minimise is None else [name.strip() for name in given.minimise.split(",")]
    terminal = Terminal.stderr(color=output.color)
    with progress.shown(terminal, wanted=not (output.no_progress or output.quiet)) as report:
        asked = opened(
            first,
            options,
            minimise,
            given.metric,
            named=flag,
            keep=partial(_kept_metric, target),
            progress=report,
            deadline=deadline_after(seconds),
            as_it_is=given.corridor is not None,
        )
        if given.corridor is not None or given.pareto is not None:
            return _traded(given, asked, target, output)
        memory = pipeline.Memory()
        found = narrowed(asked, memory)
        better = improved(found, asked, memory) if given.sensitivities and found.cut is None else ()
    text = _sealed(found)
    if text is not None:
        certificate.write_text(target, text)
    written = None if text is None else visible(target)
    data = (
        printable_json(json.dumps(to_json(told.as_data(found, better)), indent=1, ensure_ascii=False)) + "\n"
    )
    present(
        output,
        told.summary(first, found),
        lambda: told.report(first, found, written, better),
        data if output.json else None,
    )
    return ExitCode.INTERRUPTED if found.cut == "interrupted" else found.shown.result.verdict.exit_code


def _kept_metric(target: str, text: str) -> str:
    """The file of a metric that was found, beside the certificate."""
    file = f"{target.removesuffix('.json')}.metric.json"
    certificate.check_target(file)
    certificate.write_text(file, text)
    return file


def _traded(given: Given, asked: Asked, target: str, output: Output) -> ExitCode:
    """What a tube asks of the machine."""
    kept = Kept(target=target, seal=_certificate)
    if given.corridor is not None and given.pareto is not None:
        raise refused("--corridor", "it is beside --pareto", "give one of the two")
    if given.sensitivities:
        raise refused(
            "--sensitivities", "they are those of the narrowest tube", "leave --corridor and --pareto out"
        )
    if given.corridor is not None:
        return corridor(given.corridor, asked, kept, output)
    return pareto(given.pareto or "", asked, kept, output)


def _sealed(found: Design) -> str | None:
    """The certificate of the best attempt, as a text."""
    return None if found.best is None else _certificate(found.best.result)


def _certificate(result: Result) -> str:
    """A certificate as a text."""
    command = visible(shlex.join(["tubecert", *sys.argv[1:]]))
    run = {"command": command, "versions": versions()}
    return certificate.dump(certificate.seal(result.to_json(), run))
