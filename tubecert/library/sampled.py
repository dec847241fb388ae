"""Certification of a sampled loop from code: its certificate as a value, and its controller, sample by sample.

In: a specification with `hardware`, or a certificate. Out: views of what the certificate says; nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from tubecert.controller.data import data_of
from tubecert.controller.recursion import SampledController
from tubecert.enclosure.interval import Array
from tubecert.library.certifying import ran
from tubecert.library.specification import Specification
from tubecert.library.stated import Stated, array, rounded, rounded_up
from tubecert.progress import Phase, Progress, Step
from tubecert.report.figures_axes import Chart
from tubecert.report.figures_sampled import band, plane_figure, state_figures
from tubecert.report.page import Reason
from tubecert.sampled_loop.record import Certificate, Result, Shares, certificate_text
from tubecert.spec import Spec
from tubecert.words.sampled_loop import assumed, lacking

if TYPE_CHECKING:
    from tubecert.certificate.belonging import Belonging  # loads rooms that a sampled loop does not use


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """The tube over time: `t` (K,) in s, `lower` and `upper` (K, n) of every state, around `plan` (K, n).

    Where a later stage begins, its time occurs twice. The points of the plan are notes, which recheck does not examine.
    """

    t: Array
    lower: Array
    upper: Array
    plan: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SampledCertification(Stated[Certificate]):
    """What the certification of a sampled loop came to, whatever its verdict."""

    @property
    def result(self) -> Result:
        """What was proven, as the certificate holds it."""
        return self.certificate.result

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """What is lacking, in words: `claim`, `message` and `relax` (what would help)."""
        return tuple(
            Reason(verdict=self.verdict, claim=kind, message=message, relax=help)
            for kind, message, help in lacking(self.result, self.certificate.notes)
        )

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the claim rests on and does not show, in words."""
        return tuple(assumed(self.result))

    @property
    def half_widths(self) -> Mapping[str, float]:
        """How far each state can be from the plan at any time, in its unit; empty if nothing is proven."""
        return rounded(self.result.half_widths)

    @property
    def start(self) -> Mapping[str, float]:
        """The same from the first sample on, until the tube gets narrower."""
        return rounded(self.result.tube[0].half_widths if self.certified else {})

    @property
    def long_run(self) -> Mapping[str, float]:
        """The same in the long run, when the start is forgotten: from sample `result.tube[-1].start` on."""
        return rounded(self.result.tube[-1].half_widths if self.certified else {})

    @property
    def ranges(self) -> Mapping[str, tuple[float, float]]:
        """What each input stays within, plan and controller together: from below and from above, in its unit."""
        proven = self.result.inputs if self.certified else ()
        return MappingProxyType(
            {use.input: (-rounded_up(-use.range[0]), rounded_up(use.range[1])) for use in proven}
        )

    @property
    def shares(self) -> Mapping[str, Mapping[str, float]]:
        """What fills the tube of each state in the long run: shares that add up to 1. Notes, which are not examined."""
        return MappingProxyType({name: _parts(own) for name, own in self.certificate.notes.long_run.items()})

    @property
    def tube(self) -> Tube | None:
        """The tube over time; None for a family of plans, and if nothing is proven."""
        t, x, widths = band(self.certificate)
        if not self.certified or not t.size:
            return None
        return Tube(t=array(t), lower=array(x - widths), upper=array(x + widths), plan=array(x))

    def _drawn(self, plane: tuple[int, int] | None) -> Iterable[Chart]:
        return state_figures(self.certificate) if plane is None else [plane_figure(self.certificate, plane)]

    def controller(self) -> SampledController:
        """The proven controller, from its first sample on; a new one for every run.

        Raises `TubecertError` if nothing is certified, or without a controller.
        """
        return SampledController(data_of(self.certificate))


def certified(spec: Spec, progress: Progress | None) -> SampledCertification:
    """The sealed answer for a specification with `hardware`."""
    from tubecert.loop_design.certification import certify

    run = ran("tubecert.certify")
    if progress is not None:
        progress(Step(phase=Phase.LOOP))
    return certification_of(replace(certify(spec, progress), run=run()), Specification(spec=spec))


def certification_of(certificate: Certificate, given: Specification | None = None) -> SampledCertification:
    """A sealed certificate as a value."""
    return SampledCertification(certificate=certificate, text=certificate_text(certificate), given=given)


def compared(spec: Spec, result: Result) -> Belonging:
    """A certificate's result against a specification."""
    from tubecert.certificate.belonging import compared_canonically

    own = result.spec
    return compared_canonically(spec, own.effective.data, own.settings, own.file_hash, result.planned)


def _parts(shares: Shares) -> Mapping[str, float]:
    parts = {item.name: float(getattr(shares, item.name)) for item in fields(shares)}
    whole = sum(parts.values()) or 1.0
    return MappingProxyType({name: part / whole for name, part in parts.items()})
