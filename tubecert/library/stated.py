"""What every certificate says, whatever is proven by it: the base of its values for code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from tubecert.asking import refuse, require_installed, shown, text_of
from tubecert.certificate import file
from tubecert.certificate.effective import Effective
from tubecert.enclosure.interval import Array
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.library.shown import Shown
from tubecert.library.specification import File, Specification
from tubecert.report.figures_axes import Chart
from tubecert.report.figures_file import paint
from tubecert.sampled_loop.record import Certificate as SampledCertificate
from tubecert.spec import load_text
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from tubecert.report.page import Page
    from tubecert.report.page_simulation import Simulated
    from tubecert.report.quantities import AnyCertificate


C = TypeVar("C", bound="AnyCertificate")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Stated(Shown, Generic[C]):
    """A certificate as a value: `certificate` has every key of it as a value, `text` is its file.

    `given` is the specification as it was asked about, if it was.
    """

    certificate: C
    text: str
    given: Specification | None = None

    @property
    def effective(self) -> Effective:
        """The specification as the certificate holds it."""
        return self.certificate.result.spec.effective

    @property
    def verdict(self) -> Verdict:
        """`certified`, `refuted` or `undecided`."""
        return self.certificate.result.verdict

    @property
    def certified(self) -> bool:
        """Whether the tube is certified. Neither refuted nor undecided is: look at `reasons`."""
        return self.verdict is Verdict.CERTIFIED

    @property
    def hash(self) -> str:
        """The hash of all that was proven, assumed and asked."""
        return self.certificate.hash

    @property
    def name(self) -> str:
        """The name of the specification."""
        return self.effective.name

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the states (n), in the order of every vector."""
        return self.effective.system.states

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the inputs (m)."""
        return self.effective.system.inputs

    @property
    def units(self) -> Mapping[str, str]:
        """Units of states and inputs, as far as the specification says."""
        return MappingProxyType(dict(self.effective.system.units))

    @property
    def specification(self) -> Specification:
        """What was certified.

        Of a certificate that was read it is taken from there; raises `TubecertError` if the plan is in a file (CSV)
        that is not where it was, or does not hold the same knots as it stands (the certificate has no `columns`).
        """
        if self.given is not None:
            return self.given
        spec, own = load_text(self.effective.text, "<certificate>"), self.certificate
        knots = own.result.planned if isinstance(own, SampledCertificate) else own.result.plan.exact_knots()
        if (table := spec.trajectory.table) is not None and table.knots != knots:
            message = f"the plan in {table.file}, as it stands, is another one than that of the certificate"
            raise SpecError([Finding(code="TC604", message=message, help="give the specification itself")])
        return Specification(spec=spec)

    def save(self, path: File) -> None:
        """Write the certificate, byte for byte as `tubecert certify -o` does; raises `TargetError`.

        What is there, and no certificate, is not overwritten.
        """
        target = text_of("path", path)
        file.spare(target, "certificate", help=file.OTHER)
        file.write_text(target, self.text, file.OTHER)

    def plot_tube(self, ax: Axes | None = None, *, states: tuple[str, str] | None = None) -> Axes:
        """Draw plan, tube, safe set and obstacles in the plane of two states (the first two); returns the axes.

        A single state is drawn against time. Needs matplotlib (the extra `simulate`).
        """
        axes, known = axes_of(ax), self.states
        plane = None if len(known) == 1 else _places(known, states or known[:2])
        for chart in self._drawn(plane):
            paint(axes, chart)
        if plane is not None and len({self.units.get(known[i], "") for i in plane}) == 1:
            axes.set_aspect("equal", adjustable="box")
        return axes

    def _drawn(self, plane: tuple[int, int] | None) -> Iterable[Chart]:
        """The plane of two states, by their places; without one every state over time."""
        raise NotImplementedError

    def _page(self) -> Page:
        return page_of(self.certificate, all_of_it=False)


def axes_of(ax: Axes | None) -> Axes:
    """The axes to draw into; new ones of pyplot, which notebooks show, if there are none."""
    if ax is not None:
        if not hasattr(ax, "plot"):
            refuse("ax", "", f"{shown(ax)} is no axes of matplotlib", code="TC106")
        return ax
    require_installed("matplotlib", "simulate", "figures need")
    import matplotlib.pyplot as plt

    _, axes = plt.subplots(layout="constrained")
    return axes


def _places(known: tuple[str, ...], names: tuple[str, ...]) -> tuple[int, int]:
    """Two states by name; raises `SpecError` for what are no two states."""
    if len(names) != 2 or len(set(names)) != 2 or not set(names) <= set(known):
        message = f"{', '.join(map(str, names))} are not two states"
        raise SpecError([Finding(code="TC112", message=message, help=f"the states are {', '.join(known)}")])
    return known.index(names[0]), known.index(names[1])


def page_of(
    certificate: AnyCertificate, simulated: Simulated | None = None, *, all_of_it: bool = True
) -> Page:
    """The page about a certificate, with what a simulation of it has shown; or what is seen first of it."""
    if isinstance(certificate, SampledCertificate):
        from tubecert.report import sampled_loop

        return sampled_loop.page_of(certificate, simulated, all_of_it=all_of_it)
    from tubecert.report import certificate_page

    return certificate_page.page_of(certificate, simulated, all_of_it=all_of_it)


def rounded_up(value: Fraction) -> float:
    """The float whose shortest decimal is the nearest one that is not below the value."""
    near = float(value)
    return near if Fraction(repr(near)) >= value else float(np.nextafter(near, np.inf))


def rounded(values: Mapping[str, Fraction]) -> Mapping[str, float]:
    """Of every name the same."""
    return MappingProxyType({name: rounded_up(value) for name, value in values.items()})


def array(values: ArrayLike) -> Array:
    """The values as an array that nobody writes to."""
    found = np.array(values, dtype=float)
    found.flags.writeable = False
    return found
