"""Campaigns of runs as values: what came out, curves, figures; of loops that adapt, and of sampled ones."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from tubecert.asking import text_of
from tubecert.errors import ExitCode
from tubecert.findings import Finding
from tubecert.library.shown import Known, Shown, UnknownNameError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tubecert.enclosure.interval import Array
    from tubecert.library.specification import File
    from tubecert.records import Json
    from tubecert.report.page import Page
    from tubecert.simulation.adaptive.campaign import Campaign
    from tubecert.simulation.adaptive.loops import Runs
    from tubecert.simulation.sampled.campaign import Campaign as SampledCampaign

_CODES: Final = {
    "falsified": ExitCode.NOT_CERTIFIED,
    "tube left": ExitCode.NOT_CERTIFIED,
    "no result": ExitCode.UNDECIDED,
    "interrupted": ExitCode.INTERRUPTED,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class _Campaign(Shown):
    """What was simulated, and whether it falsified anything: that it did not proves nothing."""

    campaign: Any = field(repr=False)
    drawn_in: ClassVar[str]  # the module of its figures
    within: ClassVar[Mapping[str, str]] = {}  # by a view the figure that has it

    @property
    def outcome(self) -> str:
        """`not falsified`, `falsified`, `no result`, `interrupted`; also `tube left`, `nothing claimed`."""
        return str(self.campaign.outcome)

    @property
    def summary(self) -> Json:
        """Everything that was found, as plain data: what `summary.json` holds."""
        raise NotImplementedError

    @property
    def falsified(self) -> bool:
        """Whether a run was outside of what is proven, or a loop that adapts left the tube."""
        return self.outcome in ("falsified", "tube left")

    @property
    def _exit_code(self) -> ExitCode:
        return _CODES.get(self.outcome, ExitCode.CERTIFIED)

    def _json(self) -> str:
        return json.dumps(self.summary, indent=1, sort_keys=True, allow_nan=False) + "\n"

    def figure(self, name: str = "tube_use") -> Figure:
        """A figure; draw into its axes what you like.

        `tube_use`, `states`, `inputs` or `plane` (of a sampled loop the first three are one); of loops that adapt also
        `monte_carlo`. Raises `KeyError` for a name that is none, or of which there is nothing to draw.
        """
        from tubecert.simulation.figures import drawn

        drawers = import_module(self.drawn_in).DRAWERS
        own = Known({each: each for each in drawers} | {**self.within})[name]
        found = drawn(drawers, own, self.campaign)
        if found is None:
            message = f"there is nothing that {name} could show"
            raise UnknownNameError([Finding(code="TC112", message=message)])
        return found

    def save(self, folder: File) -> list[str]:
        """Write summary, runs and, of a whole campaign, figures into a folder, as the command does; their names.

        Raises `TargetError`.
        """
        from tubecert.simulation.folder import prepared, written_to

        own, target = import_module(self.drawn_in), text_of("folder", folder)
        with prepared(target):
            outdated = [f"{name}.png" for name in own.DRAWERS]
            return written_to(target, self.summary, own.files(self.campaign), outdated)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Simulation(_Campaign):
    """What was simulated, and whether it falsified anything: that it did not proves nothing.

    `campaign` has every run; `compared_with` is the hash of the certificate.
    """

    campaign: Campaign = field(repr=False)
    compared_with: str
    drawn_in = "tubecert.simulation.adaptive.figures"

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
        return Known(zip(self.controllers, self.campaign.loops, strict=True))[controller].runs

    def states(self, controller: str) -> Array:
        """The states (K, n) of that run."""
        return np.asarray(self.run(controller).x[0])

    def _page(self) -> Page:
        from tubecert.report.simulation import page_of

        return page_of(self.campaign)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SampledSimulation(_Campaign):
    """What was simulated of a sampled loop: `campaign` has what was seen of every run."""

    campaign: SampledCampaign = field(repr=False)
    drawn_in = "tubecert.simulation.sampled.figures"
    within: ClassVar[Mapping[str, str]] = {"states": "tube_use", "inputs": "tube_use"}

    @property
    def runs(self) -> int:
        """How many runs were made."""
        return self.campaign.runs

    @property
    def summary(self) -> Json:
        """Everything that was found, as plain data; there is none before the first runs are finished."""
        return self.campaign.summary

    def _page(self) -> Page:
        from tubecert.report.sampled_simulation import page_of

        return page_of(self.campaign)
