"""`simulate --controller`: exported code, compiled, in the loop of its certificate."""

from __future__ import annotations

import json
from dataclasses import asdict

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.errors import ExitCode
from tubecert.library.certification import read
from tubecert.library.driving import RUNS, Attack, attacked
from tubecert.library.numbers import Numbers
from tubecert.library.simulating import SEED, require_extra


def drive(
    paths: tuple[str, str, str], wanted: tuple[str | None, str | None, str | None], output: Output
) -> ExitCode:
    """Drive the code in a folder; `paths`: specification, certificate, folder; `wanted`: runs, seed, duration."""
    require_extra()
    from tubecert import spec
    from tubecert.report import progress
    from tubecert.report.terminal import Terminal

    numbers = Numbers()
    count, seed = (
        numbers.whole(name, text) for name, text in zip(("--runs", "--seed"), wanted, strict=False)
    )
    duration = numbers.positive("--duration", wanted[2])
    numbers.check()
    attack = Attack(
        runs=RUNS if count is None else count, seed=SEED if seed is None else seed, duration=duration
    )
    terminal = Terminal.stderr(color=output.color)
    with progress.shown(terminal, wanted=not (output.no_progress or output.quiet)) as report:
        done = attacked(read(paths[1]), spec.load(paths[0]), paths[2], attack, name=paths[1], report=report)
    write_stdout(json.dumps(asdict(done.found), indent=1) + "\n" if output.json else f"{done}\n")
    return ExitCode.CERTIFIED if done.fine else ExitCode.NOT_CERTIFIED
