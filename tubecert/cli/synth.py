"""`synth`: a specification in; a proven metric as a file, what was tried, and an exit code out."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert import certificate
from tubecert.cli import keeper, telling
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present, text_of
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import deadline_after, plan_of, refused, spare
from tubecert.errors import ExitCode
from tubecert.library.asked import SynthesisNumbers, Wishes, one_of, synthesis_numbers, wanted_of
from tubecert.printable import visible
from tubecert.report.terminal import Terminal
from tubecert.spec.metric import COORDINATES

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.report.page import Page
    from tubecert.report.text import Rows
    from tubecert.spec import Spec


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says; `numbers` are texts, by the names of their options."""

    spec: str
    settings: Sequence[str]
    objective: str | None
    degree: int | None
    variables: str | None
    coordinates: str | None
    route: str | None
    solver: str | None
    numbers: Mapping[str, str | None]
    table: bool
    plot: str | None
    target: str | None


def run(given: Given, output: Output) -> ExitCode:
    """Synthesise."""
    numbers = synthesis_numbers(given.numbers, flag)
    deadline = deadline_after(numbers.deadline)
    radii = {name: given.numbers[name] for name in ("rho_a", "epsilon")}
    settings = settings_of(given.settings, **radii)
    target = given.target if given.target is not None else f"{Path(given.spec).stem}.metric.json"
    for place in (target, *([given.plot] if given.plot else [])):
        certificate.check_target(place)
        spare(place, {"specification": given.spec})
    if given.plot and Path(given.plot).suffix.lower() != ".svg":
        raise refused(f"cannot write {given.plot}: the comparison is drawn as SVG", "give a file FILE.svg")
    from tubecert.spec.load import load_plant

    system = load_plant(given.spec, settings)
    spare(target, {"plan": plan_of(given.spec, system)})
    wanted = wanted_of(system, _wishes(given, numbers), flag)
    from tubecert import pipeline
    from tubecert.library.metrics import content, options_of

    terminal = Terminal.stderr(color=output.color)
    telling.warn_of_size(system, terminal, output)
    with telling.shown(terminal, output) as report:
        found = pipeline.synthesise(
            system,
            wanted,
            options_of(system, numbers),
            report,
            table=given.table or bool(given.plot),
            deadline=deadline,
            enough=content(system, given.objective),
            told=lambda so_far: _tell(so_far, system, terminal, output),
            kept=telling.kept(lambda so_far: _will(so_far, system, target, output)),
        )
    if found.file is not None and target != certificate.STDOUT:
        certificate.write(target, found.file.to_json())
    if given.plot and found.rows:
        from tubecert.report.figures_file import svg_file
        from tubecert.report.figures_rates import rate_figures

        certificate.write_text(given.plot, svg_file(*rate_figures(found.search().table)))
    _report(found, system, target, output)
    if found.cut is not None and found.file is None:
        keeper.tell({"said": False})  # where it was is worth a word
    if found.cut == "interrupted":
        return ExitCode.INTERRUPTED
    return found.verdict.exit_code


def _will(found: Synthesised, system: Spec, target: str, output: Output) -> keeper.Will | None:
    """What is left of a search that does not come to its end: the best metric, and the report about it."""
    if found.file is None:
        return None
    text = certificate.dump(found.file.to_json())
    files = {} if target == certificate.STDOUT else {target: text}
    return {
        "files": files,
        "said": text_of(output, *_presented(found, system, target, output)),
        "code": found.verdict.exit_code.value,
    }


def _tell(found: Synthesised, system: Spec, terminal: Terminal, output: Output) -> None:
    """The verdict, before advice is looked for."""
    from tubecert.report import synthesis, text

    if not output.quiet:
        terminal.show(text.headline(synthesis.page_of(found.search(), found.file, system.name)))


def _wishes(given: Given, numbers: SynthesisNumbers) -> Wishes:
    """What the command line says of the metric."""
    names = given.variables
    return Wishes(
        rate=numbers.rate,
        condition_number=numbers.condition_number,
        objective=given.objective,
        degree=given.degree,
        variables=None if names is None else tuple(name.strip() for name in names.split(",") if name.strip()),
        coordinates=one_of("--coordinates", given.coordinates, COORDINATES),
        route=given.route,
        solver=given.solver,
    )


def _report(found: Synthesised, system: Spec, target: str, output: Output) -> None:
    """The report on stdout, or the metric file, with the verdict line on stderr."""
    present(output, *_presented(found, system, target, output))


def _presented(
    found: Synthesised, system: Spec, target: str, output: Output
) -> tuple[Page, Rows, str | None]:
    """The page, what was written and comes next and, where data are wanted, the metric file."""
    from tubecert.records import to_json
    from tubecert.report import synthesis

    data, file = found.search(), found.file
    certify = shlex.join(["tubecert", "certify", system.path, "--metric", target])
    if system.lacks:
        certify = f"to certify with it, add {' and '.join(system.lacks)} to {visible(system.path)}"
    closing = [] if file is None else [("metric file", target), ("next", certify)]
    page = synthesis.page_of(data, file, system.name, system.states)
    wanted = output.json or target == certificate.STDOUT
    return page, closing, certificate.dump(to_json(data if file is None else file)) if wanted else None
