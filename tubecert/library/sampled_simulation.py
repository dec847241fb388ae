"""Simulation of a sampled loop from code, and what the command shares with it: `simulate` where there is `hardware`."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.library.sampled import SampledCertification
from tubecert.library.specification import File
from tubecert.records import Json
from tubecert.sampled_loop.record import Certificate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tubecert.report.page import Page
    from tubecert.simulation.sampled.campaign import Campaign
    from tubecert.simulation.sampled.loop import Controllers, Step


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
    def summary(self) -> Json:
        """Everything that was found, as plain data; there is none before the first runs are finished."""
        return self.campaign.summary

    def figure(self, name: str = "tube_use") -> Figure:
        """A figure: `tube_use` or `plane`; draw into its axes what you like.

        Raises `KeyError` for a name that is none, or of which there is nothing to draw.
        """
        from tubecert.simulation.figures import drawn
        from tubecert.simulation.sampled.figures import DRAWERS

        found = drawn(DRAWERS, name, self.campaign)
        if found is None:
            raise KeyError(f"{name}: there is no plane of one state")
        return found

    def save(self, folder: File) -> list[str]:
        """Write summary, runs and, of a whole campaign, figures into a folder; their names. Raises `TargetError`."""
        from tubecert.simulation.folder import prepared, written_to
        from tubecert.simulation.sampled.figures import DRAWERS, files

        with prepared(os.fspath(folder)):
            figures = [f"{name}.png" for name in DRAWERS]
            return written_to(os.fspath(folder), self.summary, files(self.campaign), figures)

    def __str__(self) -> str:
        from tubecert.report.text import headline

        return headline(self._page()).plain

    def __repr__(self) -> str:
        return f"<SampledSimulation: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(self._page())

    def _page(self) -> Page:
        from tubecert.report.sampled_simulation import page_of

        return page_of(self.campaign)


def require_tube(found: SampledCertification) -> None:
    """Raises TC703 where nothing is proven."""
    result = found.result
    if result.tube and result.controller is not None and result.nominal is not None:
        return
    reason = found.reasons[0].message if found.reasons else "nothing was found"
    message = f"there is no tube that a simulation could leave ({found.verdict}: {reason})"
    error = TubecertError([Finding(code="TC703", message=message, help="tubecert certify tells more")])
    error.exit_code = found.verdict.exit_code
    raise error


def compiled(certificate: Certificate) -> Controllers | None:
    """The exported C code as the controller; None where there is none to export, or no compiler."""
    from tubecert.controller.compiled import Controller
    from tubecert.controller.data import data_of

    try:
        data = data_of(certificate)
        Controller(data)
    except TubecertError:
        return None

    def made(lanes: int) -> Step:
        code, handed = Controller(data, lanes), data.plan.at is None
        return lambda y, x, u: code.step(y.T, *((x.T, u.T) if handed else ())).T

    return made
