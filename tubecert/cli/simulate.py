"""`simulate`: a specification and its certificate in; runs, figures and what they falsify out."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import METRIC, Exact, Text, flag, refuse, words_of
from tubecert.cli.adapter import ENDING, SET, SPEC, Output, command
from tubecert.errors import ExitCode
from tubecert.library import certifying, simulating

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.library.simulation import SampledSimulation, Simulation
    from tubecert.progress import Progress
    from tubecert.spec import Setting, Spec

_CODES: Final = {
    "falsified": ExitCode.NOT_CERTIFIED,
    "tube left": ExitCode.NOT_CERTIFIED,
    "no result": ExitCode.UNDECIDED,
    "interrupted": ExitCode.INTERRUPTED,
}
_WITHOUT: Final = " (without --certificate)."
_APART: Final = (
    ("certificate", "epsilon", "a certificate has its own epsilon and rho_a"),
    ("certificate", "rho_a", "a certificate has its own epsilon and rho_a"),
    ("certificate", "metric", "a certificate has its own metric"),
    ("certificate", "set_", "a certificate has its own specification: --set goes without it"),
    ("plan", "members", "a plan of your own, or random ones: --plan, or --members"),
)
_WORDS: Final = {
    "spec": SPEC,
    "certificate": Text("Its certificate; without one, simulate certifies first.", "FILE"),
    **words_of(simulating.simulate),
    "metric": Text(f"A metric file, as for certify{_WITHOUT}", "FILE", sets="metric", of=METRIC),
    "set_": SET,
    "epsilon": Exact(f"Overrides tube.epsilon{_WITHOUT}", sets="tube.epsilon", of=METRIC),
    "rho_a": Exact(f"Overrides tube.rho_a{_WITHOUT}", sets="tube.rho_a", of=METRIC),
    "output": Text("Data and figures.  [SPEC's stem.simulation]", "FOLDER", short="-o"),
    "deadline": ENDING,
}


@command(_WORDS)
def simulate(
    how: Output,
    spec: str,
    *,
    certificate: str | None = None,
    set_: Sequence[Setting] = (),
    output: str | None = None,
    metric: str | None = None,
    epsilon: Any = None,
    rho_a: Any = None,
    **asked: Any,
) -> ExitCode:
    """Integrate the closed loops, attack the tube, draw figures. It can falsify a certificate, never support one."""
    certified_with = {"metric": metric, "epsilon": epsilon, "rho_a": rho_a}
    given = {**asked, **certified_with, "certificate": certificate, "set_": set_ or None}
    for one, other, message in _APART:
        if given.get(one) is not None and given.get(other) is not None:
            refuse(flag(other), "", message)
    from tubecert.cli import telling
    from tubecert.library.specification import Specification
    from tubecert.progress import Phase, Step
    from tubecert.simulation.folder import prepared
    from tubecert.spec import load

    system = load(spec, set_)
    simulating.require_ready(system)
    folder = output or f"{Path(spec).stem}.simulation"
    with prepared(folder), telling.shown(how) as progress:
        if certificate is None:
            found = _certified(spec, system, folder, progress, **certified_with)
        else:
            found = _read(certificate, system)
        simulation = simulating.simulate(found, spec=Specification(spec=system), **asked, progress=progress)
        if progress is not None:
            progress(Step(phase=Phase.FIGURES))
        files = simulation.save(folder)
    _show(simulation, folder, files, certificate or str(Path(folder) / "certificate.json"), how)
    return _CODES.get(simulation.outcome, ExitCode.CERTIFIED)


def _read(path: str, system: Spec) -> Certification | SampledCertification:
    """The certificate; raises `TargetError` for one of another kind of loop than that of the specification."""
    from tubecert.certificate.file import foreign
    from tubecert.library.certification import Certification
    from tubecert.library.reading import read

    found = read(path)
    if isinstance(found, Certification) and system.hardware is not None:
        raise foreign(path, "is of a loop that rests on a metric, and not of a sampled one")
    return found


def _certified(
    file: str, system: Spec, folder: str, progress: Progress | None, **given: Any
) -> Certification | SampledCertification:
    """A new certificate, which is kept in the folder."""
    from tubecert.library.specification import Specification
    from tubecert.printable import visible

    there = f"{Path(file).stem}.certificate.json"
    hint = f" (--certificate {visible(there)} takes the one that is there)" if Path(there).is_file() else ""
    if sys.stderr is not None:
        print(f"no certificate is given: certifying first{hint}", file=sys.stderr, flush=True)
    found = certifying.certify(Specification(spec=system), **given, progress=progress)
    found.save(Path(folder) / "certificate.json")
    return found


def _show(
    simulation: Simulation | SampledSimulation,
    folder: str,
    files: Sequence[str],
    certificate: str,
    how: Output,
) -> None:
    """The page, and the command that shows it beside what is proven."""
    from tubecert.cli.telling import present

    data = json.dumps(simulation.summary, indent=1, sort_keys=True, allow_nan=False) + "\n"
    words = ["tubecert", "report", certificate, "--simulation", folder, "-o", f"{folder}.html"]
    closing = [("files", f"{folder}: {', '.join(files)}"), ("next", shlex.join(words))]
    present(how, simulation._page(), closing, data if how.json else None)
