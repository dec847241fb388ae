"""`synth`: a specification in; a proven metric as a file, what was tried, and an exit code out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Never

from tubecert import certificate
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import deadline_after, plan_of, refused, spare
from tubecert.errors import ExitCode, SpecError
from tubecert.findings import Finding, NamedPlace
from tubecert.kinds import DISTANCE
from tubecert.library.numbers import Numbers
from tubecert.report.terminal import Terminal
from tubecert.spec import Spec, Synthesis
from tubecert.spec.synthesis import solver_name

if TYPE_CHECKING:
    from tubecert.pipeline import Synthesised

_DECIDES = DISTANCE.option  # what metrics are compared by, where the specification says nothing


def run(given: Mapping[str, Any], output: Output) -> ExitCode:
    """Synthesise; `given` holds the options by the names of their parameters."""
    numbers = Numbers()
    values = {
        name: numbers.positive(flag(name), given[name])
        for name in ("rate", "condition_number", "rho_a", "epsilon", "deadline")
    }
    seconds = values.pop("deadline")
    budget = numbers.count("--budget", given["budget"])
    numbers.check()
    settings = settings_of(given)
    target = given["output"] if given["output"] is not None else f"{Path(given['spec']).stem}.metric.json"
    for place in (target, *([given["plot"]] if given["plot"] else [])):
        certificate.check_target(place)
        spare(place, {"specification": given["spec"]})
    if given["plot"] and Path(given["plot"]).suffix.lower() != ".svg":
        raise refused(f"cannot write {given['plot']}: the comparison is drawn as SVG", "give a file FILE.svg")
    from tubecert import spec

    system = spec.load(given["spec"], settings)
    spare(target, {"plan": plan_of(given, system)})
    wanted = _wanted(system, given, values)
    from tubecert import pipeline
    from tubecert.report import progress

    options = pipeline.Options(
        rho_a=values["rho_a"], epsilon=values["epsilon"], conditions=system.decides or _DECIDES
    )
    if budget is not None:
        options = replace(options, budget=budget)
    terminal = Terminal.stderr(color=output.color)
    with progress.shown(terminal, wanted=not (output.no_progress or output.quiet)) as report:
        found = pipeline.synthesise(
            system,
            wanted,
            options,
            report,
            sweep=bool(given["sweep"] or given["plot"]),
            deadline=deadline_after(seconds),
            told=lambda so_far: _tell(so_far, system, terminal, output),
        )
    if found.file is not None and target != certificate.STDOUT:
        certificate.write(target, found.file.to_json())
    if given["plot"] and found.rows:
        from tubecert.report.sweep import draw

        certificate.write_text(given["plot"], draw(found.data().table))
    _report(found, system, target, output)
    if found.cut == "interrupted":
        return ExitCode.INTERRUPTED
    return found.verdict.exit_code


def _tell(found: Synthesised, system: Spec, terminal: Terminal, output: Output) -> None:
    """The verdict, before advice is looked for."""
    from tubecert.report import synthesis

    if not output.quiet:
        terminal.show(synthesis.verdict_line(found.data(), found.file, system.name))


def _wanted(system: Spec, given: Mapping[str, Any], values: Mapping[str, Any]) -> Synthesis:
    """What is asked for: the specification's section, changed by the command line.

    Without a section the rate is that of the specification's own metric. Raises `SpecError` if they do not go together.
    """
    own = system.synthesis
    if own is None:
        rate = None if system.metric is None else system.metric.rate
        own = Synthesis(rate=rate, objective="adaptation" if rate is None else "condition")
    changes: dict[str, Any] = {
        name: values[name] for name in ("rate", "condition_number") if values[name] is not None
    }
    if given["solver"] is not None:
        changes["solver"] = _solver(given["solver"])
    for name in ("degree", "route", "objective", "coordinates"):
        if given[name] is not None:
            changes[name] = given[name] if name == "degree" else str(given[name])
    if given["variables"] is not None:
        changes["variables"] = _names(system, given["variables"])
    objective = changes.get("objective", own.objective)
    if objective == "rate" or (
        objective in ("adaptation", "tube") and given["rate"] is None and own.objective != objective
    ):
        changes["rate"] = None  # searched for
    elif "rate" in changes and "objective" not in changes and own.rate is None:
        changes["objective"] = "condition"
    wanted = replace(own, **changes)
    if wanted.objective == "rate" and given["rate"] is not None:
        _refuse("--objective", "rate", "the objective rate searches for the rate; --rate cannot be given")
    if wanted.objective in ("condition", "margin") and wanted.rate is None:
        _refuse("--objective", wanted.objective, f"the objective {wanted.objective} needs --rate, in 1/s")
    return wanted


def _solver(text: str) -> str:
    found = solver_name(text)
    if found is None:
        _refuse("--solver", text, "the solvers are clarabel, scs, and cvxpy:NAME for those that cvxpy knows")
    return found


def _names(system: Spec, text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    for name in names:
        if name not in system.states:
            _refuse("--variables", text, f"{name} is no state; the states are {', '.join(system.states)}")
    return names


def _refuse(option: str, text: str, message: str) -> Never:
    place = NamedPlace(file=option, line=1, column=1, source=text, width=len(text))
    raise SpecError([Finding(code="TC112", message=message, location=place)])


def _report(found: Synthesised, system: Spec, target: str, output: Output) -> None:
    """The report on stdout, or the metric file, with the verdict line on stderr."""
    from tubecert.records import to_json
    from tubecert.report import synthesis

    data, file = found.data(), found.file
    present(
        output,
        synthesis.verdict_line(data, file, system.name),
        lambda: synthesis.report(data, file, system, target),
        certificate.dump(to_json(data if file is None else file))
        if output.json or target == certificate.STDOUT
        else None,
    )
