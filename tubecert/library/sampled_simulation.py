"""Simulation of a sampled loop from code, and what the command shares with it: `simulate` where there is `hardware`."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from tubecert.digits import short
from tubecert.errors import SpecError, TubecertError
from tubecert.findings import Finding
from tubecert.library.specification import File
from tubecert.progress import Progress
from tubecert.records import Json
from tubecert.sampled_loop.record import Certificate
from tubecert.spec import Spec

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tubecert.simulation.campaign import Campaign, Controllers
    from tubecert.simulation.record import Summary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledSimulation:
    """What was simulated of a sampled loop, and whether it falsified anything: that it did not proves nothing.

    `campaign` has what was seen of every run.
    """

    campaign: Campaign = field(repr=False)

    @property
    def outcome(self) -> str:
        """`not falsified`, `falsified`, `no result` or `interrupted`."""
        return self.campaign.outcome

    @property
    def falsified(self) -> bool:
        """Whether a run was outside of what is proven."""
        return self.outcome == "falsified"

    @property
    def runs(self) -> int:
        """How many runs were made."""
        return self.campaign.runs

    @property
    def found(self) -> Summary:
        """Everything that was found, as a record; there is none before the first runs are finished."""
        from tubecert.simulation.campaign import summary

        return summary(self.campaign)

    @property
    def summary(self) -> Json:
        """The same as plain data."""
        return self.found.to_json()

    def figure(self, name: str = "tube_use") -> Figure:
        """A figure: `tube_use` or `plane`; draw into its axes what you like.

        Raises `KeyError` for a name that is none, or of which there is nothing to draw.
        """
        from tubecert.simulation.figures import drawn

        found = drawn(name, self.campaign)
        if found is None:
            raise KeyError(f"{name}: there is no plane of one state")
        return found

    def save(self, folder: File) -> list[str]:
        """Write summary, runs and figures into a folder, as the command does; their names. Raises `TargetError`."""
        from tubecert.simulate.output import prepared
        from tubecert.simulation.files import write

        with prepared(os.fspath(folder)):
            return write(os.fspath(folder), self.campaign)

    def __str__(self) -> str:
        from tubecert.report.sampled_simulation import verdict_line

        return verdict_line(self.found).plain

    def __repr__(self) -> str:
        return f"<SampledSimulation: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        shares = [
            (name, f"largest share {short(peak.share)}")
            for name, own in (*self.found.states.items(), *self.found.inputs.items())
            for peak in [max(filter(None, (own.random, own.adversary)), key=lambda peak: peak.share)]
        ]
        style = "falsified" if self.falsified else ""
        return notebook.of_line(str(self), self.campaign.setting.spec.name, style, shares)


def simulated(
    certificate: Certificate,
    spec: Spec,
    *,
    runs: int,
    seed: int,
    duration: Fraction | None,
    report: Progress | None,
) -> SampledSimulation:
    """The campaign of a certificate; raises `TubecertError` if there is no tube, or it is of another specification."""
    from tubecert.simulation.campaign import simulate
    from tubecert.simulation.setting import setting_of

    require_figures()
    _require_tube(certificate)
    setting = setting_of(_adopted(spec, certificate), certificate.result, duration)
    made = _compiled(certificate)
    return SampledSimulation(
        campaign=simulate(setting, certificate.hash, made, runs=runs, seed=seed, report=report)
    )


def require_figures() -> None:
    """Raises `SpecError` without the library that draws."""
    if importlib.util.find_spec("matplotlib") is None:
        help = "install tubecert with its extra: pip install 'tubecert[simulate]'"
        raise SpecError([Finding(code="TC122", message="simulate needs matplotlib", help=help)])


def _require_tube(certificate: Certificate) -> None:
    """Raises TC703 where nothing is proven."""
    result = certificate.result
    if result.tube and result.controller is not None and result.nominal is not None:
        return
    from tubecert.words.sampled_loop import why

    reason = why(result.lacks[0], result.spec.effective.system.units) if result.lacks else "nothing was found"
    message = f"there is no tube that a simulation could leave ({result.verdict}: {reason})"
    error = TubecertError([Finding(code="TC703", message=message, help="tubecert certify tells more")])
    error.exit_code = result.verdict.exit_code
    raise error


def _adopted(spec: Spec, certificate: Certificate) -> Spec:
    """The specification with what the command line that certified had set; raises TC604 if it is another one."""
    from tubecert.certificate.belonging import ForeignError
    from tubecert.spec import Setting, canonical
    from tubecert.spec.load import again

    source = certificate.result.spec
    spec = again(spec, [Setting(path=path, text=text) for path, text in sorted(source.settings.items())])
    own, other = canonical(spec), source.effective.data
    differing = sorted(
        key for key in {*own, *other} - {"simulation", "expect"} if own.get(key) != other.get(key)
    )
    if not differing:
        return spec
    message = f"the certificate does not belong to this specification: {', '.join(differing)} differ"
    help = "certify again, or give the specification that was certified"
    raise ForeignError(
        [Finding(code="TC604", message=message, location=spec.location(differing[0]), help=help)]
    )


def _compiled(certificate: Certificate) -> Controllers | None:
    """The exported C code as the controller; None where there is none to export, or no compiler."""
    from tubecert.controller.compiled import Controller
    from tubecert.controller.data import data_of
    from tubecert.simulation.sampled import Compiled

    try:
        data = data_of(certificate)
        Controller(data)
    except TubecertError:
        return None
    return lambda lanes: Compiled(Controller(data, lanes), handed=data.plan.at is None)
