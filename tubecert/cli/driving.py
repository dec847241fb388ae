"""`simulate --controller`: exported code, compiled, in the loop of its certificate."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.digits import near
from tubecert.errors import ExitCode, TubecertError
from tubecert.findings import Finding
from tubecert.library.certification import read
from tubecert.library.numbers import Numbers
from tubecert.library.simulating import SEED, require_extra

if TYPE_CHECKING:
    from tubecert.export.driven import Driven

RUNS = 20


def drive(
    paths: tuple[str, str, str], wanted: tuple[str | None, str | None, str | None], output: Output
) -> ExitCode:
    """Drive the code in a folder; `paths`: specification, certificate, folder; `wanted`: runs, seed, duration."""
    require_extra()
    from tubecert import spec
    from tubecert.export.assembly import controller_of
    from tubecert.export.belonging import belonging
    from tubecert.export.compiled import compiled
    from tubecert.export.driven import driven
    from tubecert.report import progress
    from tubecert.report.terminal import Terminal
    from tubecert.simulate.certified import adopted, require_tube
    from tubecert.simulate.setting import setting_of

    numbers = Numbers()
    count, seed = (
        numbers.whole(name, text) for name, text in zip(("--runs", "--seed"), wanted, strict=False)
    )
    duration = numbers.positive("--duration", wanted[2])
    numbers.check()
    certificate = read(paths[1]).certificate
    system = adopted(spec.load(paths[0]), certificate.result)
    require_tube(certificate.result)
    found = belonging(paths[2], controller_of(certificate, paths[1]))
    if found.language == "python":
        message = "a controller in Python is not driven: it computes what the reference computes"
        raise TubecertError([Finding(code="TC712", message=message, help="export it in C")])
    lanes = max(1, RUNS if count is None else count)
    terminal = Terminal.stderr(color=output.color)
    loud = not (output.no_progress or output.quiet)
    with compiled(found, lanes) as code, progress.shown(terminal, wanted=loud) as report:
        done = driven(
            setting_of(system, certificate.result, duration),
            code,
            found.controller,
            count=lanes,
            seed=SEED if seed is None else seed,
            precision=found.precision,
            report=report,
        )
    write_stdout(json.dumps(asdict(done), indent=1) + "\n" if output.json else _text(done, paths[2]))
    return ExitCode.CERTIFIED if done.fine else ExitCode.NOT_CERTIFIED


def _text(done: Driven, folder: str) -> str:
    lines = [
        f"{'not falsified' if done.fine else 'FALSIFIED'}: {folder} drove {done.runs} runs of {done.samples} samples",
        f"  d(x*, x) reached {near(done.distance, 4)}; {near(done.level)} is proven; "
        f"{len(done.escapes)} runs reached that",
        f"  largest difference to the reference at a sample: {near(done.difference, 3)} "
        f"({done.precision}; inputs up to {near(done.scale, 3)})",
        f"  a step takes {near(1e6 * done.step, 2)} us here, at most {near(1e6 * done.worst, 3)} us "
        "(called from Python)",
    ]
    if done.told:
        lines.append(f"  {done.told} steps said that an assumption does not hold")
    return "\n".join(lines) + "\n"
