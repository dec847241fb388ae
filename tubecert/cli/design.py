"""`design`: a specification with a machine in; the narrowest certified tube, and every attempt, out."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import certificate, pipeline
from tubecert.cli.corridor import Asked, corridor, pareto, refused
from tubecert.cli.options import Output
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import spare
from tubecert.errors import ExitCode, SpecError
from tubecert.expression import number_text, suggestion
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.library.numbers import Numbers
from tubecert.pipeline.width import Measure, measure_in, measure_of
from tubecert.printable import printable_json, visible
from tubecert.records import to_json
from tubecert.report import design as told
from tubecert.report import progress
from tubecert.report.terminal import Terminal
from tubecert.spec.load import load_source
from tubecert.spec.metric_file import with_metric
from tubecert.spec.override import Setting
from tubecert.spec.source import read_source

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.pipeline.design import Design
    from tubecert.spec import Spec


SEARCH: Final = "search"


@dataclass(slots=True)
class _Held:
    """The file of the metric that stands for the specification's own."""

    file: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says, as texts."""

    spec: str
    minimise: str | None
    corridor: str | None
    pareto: str | None
    settings: Sequence[str]
    metric: str | None
    gap: str
    budget: str | None
    target: str | None


def run(given: Given, output: Output) -> ExitCode:
    """Try tubes of every size, and write the certificate of the narrowest; or what a tube asks of the machine."""
    numbers = Numbers()
    gap = numbers.positive("--gap", given.gap, below=1)
    budget = numbers.count("--budget", given.budget)
    numbers.check()
    target = given.target or f"{Path(given.spec).stem}.design.json"
    certificate.check_target(target)
    held = _Held(None if given.metric == SEARCH else given.metric)
    spare(target, {"specification": given.spec, "metric file": held.file})
    fixed = settings_of(given.settings, metric=given.metric)
    source = read_source(given.spec)

    def load(settings: Sequence[Setting]) -> Spec:
        # what a design sets itself takes the place of what the command line says of the same key
        kept = [own for own in fixed if not any(each.covers(own.path) for each in settings)]
        found = load_source(source, (*kept, *settings))
        return found if held.file is None else with_metric(found, held.file)

    first = load(())
    _check(first, searched=given.metric == SEARCH)
    from tubecert.pipeline.design import narrowest

    default = pipeline.Options()
    options = pipeline.Options(gap=gap or default.gap, budget=budget or default.budget)
    measure = _minimised(first, given.minimise)
    terminal = Terminal.stderr(color=output.color)
    with progress.shown(terminal, wanted=not (output.no_progress or output.quiet)) as report:
        asked = Asked(
            target=target, load=load, seal=_certificate, options=options, measure=measure, progress=report
        )
        if given.metric == SEARCH:
            held.file = _searched(first, lambda scale: load(_scaled(first, scale)), asked)
        if held.file is not None:
            options = replace(options, metric=Path(held.file))
            asked = replace(asked, options=options)
        if given.corridor is not None or given.pareto is not None:
            return _traded(given, asked, output, lambda scale: _scaled(first, scale))
        found = narrowest(lambda scale: load(_scaled(first, scale)), options, measure, report)
    text = _sealed(found)
    if text is not None:
        certificate.write_text(target, text)
    written = None if text is None else visible(target)
    data = printable_json(json.dumps(to_json(told.as_data(found)), indent=1, ensure_ascii=False)) + "\n"
    present(
        output,
        told.summary(first, found),
        lambda: told.report(first, found, written),
        data if output.json else None,
    )
    best = found.best or found.attempts[0]
    return best.result.verdict.exit_code


def _check(spec: Spec, *, searched: bool) -> None:
    """What a design needs; raises `SpecError`."""
    if spec.metric is None and not searched:
        raise _error(spec, "metric", "a design needs a metric", "tubecert synth, then --metric FILE")
    if spec.tube.epsilon is None and not spec.tube.half_widths:
        raise _error(spec, "tube", "a design needs a tube to begin with", "write tube: {half_widths: {...}}")


def _error(spec: Spec, path: str, message: str, help: str) -> SpecError:
    return SpecError([Finding(code="TC105", message=message, location=spec.location(path), help=help)])


def _minimised(spec: Spec, words: str | None) -> Measure:
    """What counts: the states that are named, each in its own unit or that of its half-width; raises `SpecError`."""
    if words is None:
        return measure_of(spec)
    names = [name.strip() for name in words.split(",")]
    wrong = [name for name in names if name not in spec.states]
    if wrong:
        help = suggestion(wrong[0], spec.states, what="states")
        raise SpecError(
            [Finding(code="TC122", message=f"--minimise: {visible(wrong[0])} is no state", help=help)]
        )
    return measure_in(spec, names) or measure_of(spec)


def _scaled(spec: Spec, scale: Fraction) -> list[Setting]:
    """The keys of the tube, times a scale."""
    if scale == 1:
        return []
    sizes = {f"tube.half_widths.{name}": width for name, width in spec.tube.half_widths}
    if not sizes:
        radii = (("tube.epsilon", spec.tube.epsilon), ("tube.rho_a", spec.tube.rho_a))
        sizes = {key: value for key, value in radii if value is not None}
    return [Setting.of(f"{key}={number_text(value * scale)}") for key, value in sizes.items()]


def _searched(spec: Spec, scaled: Callable[[Fraction], Spec], asked: Asked) -> str | None:
    """The file of the metric that was found; None if the specification's own serves better."""
    from tubecert.pipeline.metric_search import search

    def held(own: Spec, scale: Fraction) -> Spec:
        return replace(scaled(scale), metric=own.metric, synthesis=None)

    try:
        found = search(spec, held, asked.measure, asked.options, asked.progress)
    except ValueError as error:
        raise _error(
            spec, "system.B", f"--metric search: {error}", "tubecert synth, then --metric FILE"
        ) from error
    best = found.best
    if best is None and spec.metric is None:
        best = min(found.candidates, key=lambda each: each.told, default=None)
        if best is None:
            help = "raise hardware.rate, shrink the safe set, or lower the wind"
            raise _error(spec, "hardware", "no metric was found that may serve this machine", help)
    if best is None:
        return None
    file = f"{asked.target.removesuffix('.json')}.metric.json"
    certificate.check_target(file)
    certificate.write_text(file, best.text)
    return file


def _traded(
    given: Given, asked: Asked, output: Output, scaled: Callable[[Fraction], list[Setting]]
) -> ExitCode:
    """What a tube asks of the machine."""
    if given.corridor is not None and given.pareto is not None:
        raise refused("--corridor", "it is beside --pareto", "give one of the two")
    if given.corridor is not None:
        return corridor(given.corridor, asked, output)
    return pareto(given.pareto or "", asked, output, scaled)


def _sealed(found: Design) -> str | None:
    """The certificate of the best attempt, as a text."""
    return None if found.best is None else _certificate(found.best.result)


def _certificate(result: Result) -> str:
    """A certificate as a text."""
    command = visible(shlex.join(["tubecert", *sys.argv[1:]]))
    run = {"command": command, "versions": versions()}
    return certificate.dump(certificate.seal(result.to_json(), run))
