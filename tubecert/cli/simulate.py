"""`simulate`: a specification and its certificate in; runs, figures and what they falsify out."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import ENDING, METRIC, SETTINGS, SPEC, Exact, Text, flag, refuse, words_of
from tubecert.cli import telling
from tubecert.cli.adapter import Output, command
from tubecert.errors import ExitCode
from tubecert.library import certifying, simulating
from tubecert.library.reading import read
from tubecert.library.specification import Specification
from tubecert.printable import visible
from tubecert.progress import Phase, Progress, Step
from tubecert.spec import Setting, Spec, load

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification

_WITHOUT: Final = " (without --certificate)."
_APART: Final = (
    ("certificate", "epsilon", "a certificate has its own epsilon and rho_a"),
    ("certificate", "rho_a", "a certificate has its own epsilon and rho_a"),
    ("certificate", "metric", "a certificate has its own metric"),
    ("certificate", "settings", "a certificate has its own specification: --set goes without it"),
    ("plan", "members", "a plan of your own, or random ones: --plan, or --members"),
)
_WORDS: Final = {
    "spec": SPEC,
    "certificate": Text("Its certificate; without one, simulate certifies first.", "FILE"),
    **words_of(simulating.simulate),
    "metric": Text(f"A metric file, as for certify{_WITHOUT}", "FILE", sets="metric", of=METRIC),
    "settings": SETTINGS,
    "epsilon": Exact(f"Overrides tube.epsilon{_WITHOUT}", sets="tube.epsilon", of=METRIC),
    "rho_a": Exact(f"Overrides tube.rho_a{_WITHOUT}", sets="tube.rho_a", of=METRIC),
    "output": Text("Data and figures.  [SPEC's stem.simulation]", "FOLDER", short="-o", ending=".simulation"),
    "deadline": ENDING,
}


@command(_WORDS)
def simulate(
    how: Output,
    spec: str,
    *,
    output: str,
    certificate: str | None = None,
    settings: Sequence[Setting] = (),
    metric: str | None = None,
    epsilon: Any = None,
    rho_a: Any = None,
    **asked: Any,
) -> ExitCode:
    """Integrate the closed loops, attack the tube, draw figures. It can falsify a certificate, never support one."""
    certified_with = {"metric": metric, "epsilon": epsilon, "rho_a": rho_a}
    given = {**asked, **certified_with, "certificate": certificate, "settings": settings or None}
    for one, other, message in _APART:
        if given.get(one) is not None and given.get(other) is not None:
            refuse(_WORDS[other].called or flag(other), "", message)
    from tubecert.simulation.folder import prepared

    system = load(spec, settings)
    simulating.require_ready(system)
    with prepared(output), telling.shown(how) as progress:
        if certificate is None:
            found = _certified(spec, system, output, progress, **certified_with)
        else:
            found = _read(certificate, system)
        simulation = simulating.simulate(found, spec=Specification(spec=system), **asked, progress=progress)
        progress(Step(phase=Phase.FIGURES))
        files = simulation.save(output)
    there = certificate or str(Path(output) / "certificate.json")
    line = shlex.join(["tubecert", "report", there, "--simulation", output, "-o", f"{output}.html"])
    return telling.answer(how, simulation, [("files", f"{output}: {', '.join(files)}"), ("next", line)])


def _read(path: str, system: Spec) -> Certification | SampledCertification:
    """The certificate; raises `TargetError` for one of another kind of loop than that of the specification."""
    from tubecert.certificate.file import foreign
    from tubecert.library.certification import Certification

    found = read(path)
    if isinstance(found, Certification) and system.hardware is not None:
        raise foreign(path, "is of a loop that rests on a metric, and not of a sampled one")
    return found


def _certified(
    file: str, system: Spec, folder: str, progress: Progress, **given: Any
) -> Certification | SampledCertification:
    """A new certificate, which is kept in the folder."""
    there = f"{Path(file).stem}.certificate.json"
    hint = f" (--certificate {visible(there)} takes the one that is there)" if Path(there).is_file() else ""
    if sys.stderr is not None:
        print(f"no certificate is given: certifying first{hint}", file=sys.stderr, flush=True)
    found = certifying.certify(Specification(spec=system), **given, progress=progress)
    found.save(Path(folder) / "certificate.json")
    return found
