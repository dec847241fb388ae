"""Exported code, compiled, in the loop of its certificate: `simulate --controller`, from code and for the command."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from tubecert.digits import near
from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.library.certification import Certification, read
from tubecert.library.numbers import Numbers
from tubecert.library.plain import Number, number_texts
from tubecert.library.simulating import SEED, require_extra, specification_of
from tubecert.library.specification import File, Specifiable, spec_of
from tubecert.progress import Progress
from tubecert.report.progress import timed

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.export.driven import Driven
    from tubecert.simulate.setting import Setting
    from tubecert.spec import Spec

RUNS: Final = 20
MEMBERS: Final = 4  # plans of a family, among which the runs are shared


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """How many runs, drawn from which seed, each how long (s; None: the plan's horizon)."""

    runs: int = RUNS
    seed: int = SEED
    duration: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What compiled code did in the loop; `found` has its numbers. That nothing broke proves nothing."""

    found: Driven = field(repr=False)
    folder: str

    @property
    def fine(self) -> bool:
        """Whether nothing speaks against the code: it agrees with its reference, and no run reached the level."""
        return self.found.fine

    def __str__(self) -> str:
        done = self.found
        lines = [
            f"{'not falsified' if done.fine else 'FALSIFIED'}: {self.folder} drove {done.runs} runs "
            f"of {done.samples} samples",
            f"  d(x*, x) reached {near(done.distance, 4)}; {near(done.level)} is proven; "
            f"{len(done.escapes)} runs reached that",
            f"  largest difference to the reference at a sample: {near(done.difference, 3)} "
            f"({done.precision}; inputs up to {near(done.scale, 3)})",
            f"  a step takes {near(1e6 * done.step, 2)} us here, at most {near(1e6 * done.worst, 3)} us "
            "(called from Python)",
        ]
        if done.lost is not None:
            lines.append(
                f"  rounding took at most {near(100 * done.lost, 2)} % of what the certificate allows for, at a sample"
            )
        if done.told:
            lines.append(f"  {done.told} steps said that an assumption does not hold")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_lines(str(self).splitlines(), "" if self.fine else "falsified")


def drive(
    result: Certification | File,
    folder: File,
    *,
    spec: Specifiable | None = None,
    runs: int | None = None,
    seed: int | None = None,
    duration: Number | None = None,
    progress: Progress | None = None,
) -> Drive:
    """Compiles the C code that was exported for a certificate, and lets it drive the attacked plant.

    `tubecert simulate --controller`: its arguments are the options of the command. `spec` is needed where the
    certificate was read and its plan is in a file. Raises `TubecertError` where the code is not that of the
    certificate, is in Python, or cannot be compiled.
    """
    require_extra()
    numbers = Numbers()
    most, first, long = number_texts(runs=runs, seed=seed, duration=duration).values()
    count, start = numbers.whole("runs", most), numbers.whole("seed", first)
    length = numbers.positive("duration", long)
    numbers.check()
    certification = result if isinstance(result, Certification) else read(result)
    system = specification_of(certification) if spec is None else spec_of(spec)
    name = "the certificate" if isinstance(result, Certification) else os.fspath(result)
    attack = Attack(
        runs=RUNS if count is None else count, seed=SEED if start is None else start, duration=length
    )
    return attacked(certification, system, os.fspath(folder), attack, name=name, report=timed(progress))


def attacked(
    certification: Certification,
    system: Spec,
    folder: str,
    attack: Attack,
    *,
    name: str,
    report: Progress | None,
) -> Drive:
    """The code in a folder, driven; `name` is what messages call the certificate."""
    from tubecert.export.assembly import controller_of
    from tubecert.export.belonging import belonging
    from tubecert.export.compiled import compiled
    from tubecert.export.continuous import compiled as all_the_time
    from tubecert.export.continuous.driven import driven as all_the_time_driven
    from tubecert.export.controller import Continuous
    from tubecert.export.driven import Given, driven, joined
    from tubecert.simulate.certified import adopted, require_tube

    certificate = certification.certificate
    system = adopted(system, certificate.result)
    require_tube(certificate.result)
    found = belonging(folder, controller_of(certificate, name))
    if found.language == "python":
        message = "a controller in Python is not driven: it computes what the reference computes"
        raise TubecertError([Finding(code="TC712", message=message, help="export it in C")])
    settings = _settings(system, certificate.result, attack)
    lanes = max(1, -(-attack.runs // len(settings)))
    controller, given = found.controller, Given(count=lanes, seed=attack.seed, precision=found.precision)
    if isinstance(controller, Continuous):
        with all_the_time.compiled(found, lanes) as acting:
            parts = [all_the_time_driven(own, acting, controller, given, report) for own in settings]
    else:
        with compiled(found, lanes) as code:
            parts = [driven(own, code, controller, given, report) for own in settings]
    done = joined(parts)
    return Drive(found=done, folder=folder)


def _settings(system: Spec, result: Result, attack: Attack) -> list[Setting]:
    """One; or of a family one for each of some plans, which are random and keep to its boxes."""
    from tubecert.model import build
    from tubecert.simulate.members import drawing_of, member
    from tubecert.simulate.setting import horizon_of, setting_of

    if system.trajectory.bundle is None:
        return [setting_of(system, result, attack.duration)]
    drawing = drawing_of(system, build(system), horizon_of(system, attack.duration))
    plans = [member(drawing, attack.seed, number) for number in range(min(MEMBERS, attack.runs))]
    return [setting_of(system, result, attack.duration, plan) for plan in plans]
