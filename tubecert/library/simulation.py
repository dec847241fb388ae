"""A campaign of runs, as a value: its outcome, its curves, its figures."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.library.specification import File
from tubecert.records import Json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tubecert.report.page import Page
    from tubecert.simulation.adaptive.campaign import Campaign, Outcome
    from tubecert.simulation.adaptive.loops import Runs


OUTCOMES: Final = ("falsified", "tube left")  # those that are bad news


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """What was simulated, and whether it falsified anything: that it did not proves nothing.

    `campaign` has every run; `summary` is what `summary.json` holds; `compared_with` the hash of the certificate.
    """

    campaign: Campaign = field(repr=False)
    compared_with: str

    @property
    def outcome(self) -> Outcome:
        """`not falsified`, `falsified`, `tube left`, `no result`, `interrupted` or `nothing claimed`."""
        return self.campaign.outcome

    @property
    def falsified(self) -> bool:
        """Whether a promise of the certificate was broken, or a loop that adapts left the tube."""
        return self.outcome in OUTCOMES

    @property
    def summary(self) -> Json:
        """Everything that was found, as plain data."""
        return self.campaign.summary(self.compared_with)

    @property
    def controllers(self) -> tuple[str, ...]:
        """The loops that were simulated."""
        return tuple(item.loop.controller for item in self.campaign.loops)

    def run(self, controller: str) -> Runs:
        """The run of a loop under the uncertainty that is drawn: times `t` (K,) in s, `x` (1, K, n), `u` (1, K, m), ...

        Raises `KeyError` for a loop that was not simulated.
        """
        for item in self.campaign.loops:
            if item.loop.controller == controller:
                return item.runs
        raise KeyError(controller)

    def states(self, controller: str) -> Array:
        """The states (K, n) of that run."""
        return np.asarray(self.run(controller).x[0])

    def figure(self, name: str = "states") -> Figure:
        """A figure: `states`, `plane`, `inputs`, `tube_use` or `monte_carlo`; draw into its axes what you like.

        Raises `KeyError` for a name that is none, or of which there is nothing to draw.
        """
        from tubecert.simulation.adaptive.figures import DRAWERS
        from tubecert.simulation.figures import drawn

        found = drawn(DRAWERS, name, self.campaign)
        if found is None:
            raise KeyError(f"{name}: nothing was simulated that it shows")
        return found

    def save(self, folder: File) -> list[str]:
        """Write data, figures and the summary into a folder, as the command does; their names.

        Raises `TargetError`.
        """
        from tubecert.simulation.adaptive.files import write
        from tubecert.simulation.folder import prepared

        with prepared(os.fspath(folder)):
            return write(os.fspath(folder), self.campaign, certificate=self.compared_with)

    def __str__(self) -> str:
        from tubecert.report.text import headline

        return headline(self._page()).plain

    def __repr__(self) -> str:
        return f"<Simulation: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(self._page())

    def _page(self) -> Page:
        from tubecert.report.simulation import page_of

        return page_of(self.campaign)
