"""Certification of a sampled loop from code: its certificate as a value, and its controller, sample by sample.

In: a specification with `hardware`, or a certificate. Out: views of what the certificate says; nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.library.certifying import ran
from tubecert.library.specification import Specification
from tubecert.library.stated import Stated, array, rounded, rounded_up
from tubecert.progress import Phase, Progress, Step
from tubecert.sampled_loop.record import Certificate, Result, Shares, certificate_text
from tubecert.spec import Spec

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tubecert.certificate.belonging import Belonging
    from tubecert.controller.data import Data
    from tubecert.report.page import Reason

_ON_TIME: Final = 1e-6  # of a sample time


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
        from tubecert.report.page import Reason
        from tubecert.words.sampled_loop import lacking

        return tuple(
            Reason(verdict=self.verdict, claim=kind, message=message, relax=help)
            for kind, message, help in lacking(self.result, self.certificate.notes)
        )

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the claim rests on and does not show, in words."""
        from tubecert.words.sampled_loop import assumed

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
        from tubecert.report.figures_sampled import band

        t, x, widths = band(self.certificate)
        if not self.certified or not t.size:
            return None
        return Tube(t=array(t), lower=array(x - widths), upper=array(x + widths), plan=array(x))

    def controller(self) -> SampledController:
        """The proven controller, from its first sample on; a new one for every run.

        Raises `TubecertError` if nothing is certified, or without a controller.
        """
        from tubecert.controller.data import data_of

        return SampledController(data_of(self.certificate))


class SampledController:
    """The recursion of a certificate's tables in numpy: `u = controller(t, y)` once a sample, beginning with t = 0.

    What is exported in C computes the same, and also judges samples and clips inputs.
    """

    def __init__(self, data: Data) -> None:
        self.sample_time, self.samples = float(data.sample_time), 0
        self._plan, self._tables, self._row = data.plan, data.tables, 0
        self._zeta = np.zeros(data.sizes[2])

    def __call__(
        self, t: float, y: ArrayLike, x: ArrayLike | None = None, u: ArrayLike | None = None
    ) -> Array:
        """The input (m,) for the state (n,) that is measured at t, in s; it acts after the delay, for a sample time.

        Of a family the plan comes with every sample: x* at t (n,), and u* (m,) as it is held while the input acts.
        Raises `ValueError` if t is not the time of the next sample, if y is no state, if a plan is missing, or is over.
        """
        plan, tables = self._plan, self._tables
        if abs(t / self.sample_time - self.samples) > _ON_TIME * (1 + self.samples):
            raise ValueError(f"the next sample is at t = {self.samples * self.sample_time} s")
        if (plan.at is None) is (x is None or u is None):
            raise ValueError("x and u are given for a family of plans, and only there")
        if self._row >= plan.steps:
            raise ValueError("the plan is over, and nothing is proven for later")
        given = (x, u) if plan.at is None else plan.at([self._row])
        planned, held = (np.ravel(np.asarray(each, float)) for each in given)
        measured = np.asarray(y, float)
        if measured.shape != planned.shape:
            raise ValueError(f"y has {measured.size} numbers, the state has {planned.size}")
        off = measured - planned
        command = held + tables["M"] @ self._zeta + tables["N"] @ off
        self._zeta = tables["F"] @ self._zeta + tables["G"] @ off
        self.samples += 1
        self._row = self._row + 1 if self._row + 1 < plan.steps else plan.after
        return np.asarray(command)


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
