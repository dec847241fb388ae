"""A certificate as a value for code: the verdict in words, gains and constants by name, curves and plan as arrays.

In: a certificate that was made or read. Out: views of what it says. Nothing is decided here: `certified` is what the
certificate says, and `recheck` tells whether that is so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from tubecert.certificate import file
from tubecert.certificate.result import Bound, Certificate, InputData, MetricData, Result
from tubecert.enclosure.interval import Array
from tubecert.kinds.kind import SectionData
from tubecert.letters import NAMES
from tubecert.library.shown import Known
from tubecert.library.specification import Specification
from tubecert.library.stated import Stated, array, axes_of, rounded_up
from tubecert.records import Json
from tubecert.report.certificate_brief import reasons
from tubecert.report.figures_axes import Chart
from tubecert.report.figures_file import paint
from tubecert.report.figures_gains import trade_off
from tubecert.report.figures_tube import plane_figure, state_figures
from tubecert.report.gains import Gains, rows
from tubecert.report.outline import widths
from tubecert.report.page import Reason

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points of the plan: times `t` (K,) in s and states `x` (K, n)."""

    t: Array
    x: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Certification(Stated[Certificate]):
    """What a certification came to, whatever its verdict.

    `specification` is what was certified, with the metric and the radii that were given beside it.
    """

    # the verdict

    @property
    def result(self) -> Result:
        """What was proven, as the certificate holds it."""
        return self.certificate.result

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Why the verdict is what it is, in words: `claim`, `message`, `at` and `relax` (what would help)."""
        return reasons(self.result)

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the claim rests on and does not show, in words."""
        return tuple(item.told() for item in self.result.assumptions)

    # the gains

    @property
    def gains(self) -> tuple[Gains, ...]:
        """Every set of gains that was found, of every kind of certificate."""
        return tuple(rows(self.result))

    @property
    def deciding(self) -> Gains | None:
        """The gains that the verdict is about; of the first kind, if several decide."""
        return next((gains for gains in self.gains if gains.decides), None)

    @property
    def omega(self) -> float | None:
        """The filter bandwidth in rad/s that is certified; None if nothing is, or no filter is needed."""
        return None if (gains := self._proven()) is None else gains.omega

    @property
    def Gamma(self) -> float | None:
        """The adaptation rate that is certified together with `omega`."""
        return None if (gains := self._proven()) is None else gains.Gamma

    @property
    def margins(self) -> Mapping[str, tuple[float, float]]:
        """Of the gains that the verdict is about: by condition what is left, proven from below and from above."""
        return MappingProxyType({}) if self.deciding is None else self.deciding.margins

    def curve(self, kind: str) -> Array:
        """Points (K, 2) that were found to serve for a kind, by its letter: a note, which recheck does not examine.

        Bandwidth in rad/s and adaptation rate; (0, 2) where there is none. Raises `KeyError` for no kind.
        """
        section = self.section(kind)
        return array([] if section is None else section.points()).reshape(-1, 2)

    def section(self, kind: str) -> SectionData | None:
        """All that the certificate says of a kind, by its letter; None if it says nothing of it.

        Raises `KeyError` for a kind that there is not.
        """
        words = {word: name.key for name in NAMES for word in (name.letter, name.option, name.key)}
        return self.result.sections.get(Known(words)[kind])

    # the tube

    @property
    def rho(self) -> float | None:
        """The radius of the tube, rounded up: |x - x*| <= rho, in coordinates of the tube if it has its own."""
        return None if self.result.tube is None else rounded_up(self.result.tube.rho)

    @property
    def half_widths(self) -> Mapping[str, float]:
        """How far each state can be from the plan, in its unit; empty if there is no tube in the safe set."""
        return MappingProxyType(widths(self.result) or {})

    @property
    def constants(self) -> Mapping[str, Bound]:
        """The constants of the proof: `below` and `above`, `symbol`, `unit`, `equation`, `at`."""
        return MappingProxyType(Known(self.result.constants))

    @property
    def limits(self) -> Mapping[str, InputData]:
        """What is proven of each input that has limits, by its name."""
        return MappingProxyType(Known((item.input, item) for item in self.result.inputs))

    @property
    def metric(self) -> MetricData | None:
        """The metric, and what is proven of it."""
        return self.result.metric

    @property
    def plan(self) -> Points | None:
        """Points of the plan, to draw it; None for a family of plans."""
        samples = self.result.plan.samples
        return None if samples is None else Points(t=array(samples.t), x=array(samples.x))

    # figures

    def plot_tradeoff(self, ax: Axes | None = None) -> Axes:
        """Draw what each bandwidth needs of the adaptation rate, by kind of certificate; returns the axes.

        The curves are notes, which recheck does not examine. Needs matplotlib (the extra `simulate`).
        """
        axes, chart = axes_of(ax), trade_off(self.result)
        if chart is not None:
            paint(axes, chart)
        return axes

    def _drawn(self, plane: tuple[int, int] | None) -> Iterable[Chart]:
        return state_figures(self.result) if plane is None else [plane_figure(self.result, plane)]

    def _proven(self) -> Gains | None:
        return self.deciding if self.certified else None


def certification_of(sealed: Json, given: Specification | None = None) -> Certification:
    """A sealed certificate as a value; raises `FormError`."""
    return Certification(certificate=Certificate.from_json(sealed), text=file.dump(sealed), given=given)
