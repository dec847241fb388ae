"""A certificate with a metric, read: its system, tube, constants and the ground of its claims."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb, ctx

from tubecert.recheck import wind as disturbed
from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.conditions import USED, Numbers, Setting, WindNumbers
from tubecert.recheck.coordinates import Coordinates
from tubecert.recheck.cover import SHARP
from tubecert.recheck.curve import Curve
from tubecert.recheck.document import Enclosure, digest
from tubecert.recheck.kinds.kind import Section
from tubecert.recheck.place import Place
from tubecert.recheck.result import INFIMA, MEASURED, MetricSection, Result, TubeSection
from tubecert.recheck.system import System, curve_of, system_of
from tubecert.recheck.terms import all_zero


@dataclass(frozen=True)
class Case:
    """A certificate with a metric, read."""

    result: Result
    budget: int

    @cached_property
    def system(self) -> System:
        """Its system."""
        return system_of(self.result.specification)

    @cached_property
    def curve(self) -> Curve:
        """The plan."""
        with ctx.workprec(SHARP):
            s, trajectory = self.system, self.result.specification.trajectory
            drift = [row[0] for row in s.drift]
            return curve_of(
                trajectory, self.result.plan, s.states, s.inputs, drift, times=s.time, period=s.period
            )

    @cached_property
    def metric(self) -> MetricSection:
        """What is claimed of the metric."""
        assert self.result.metric is not None
        return self.result.metric

    @cached_property
    def tube(self) -> TubeSection:
        """What is claimed of the tube."""
        assert self.result.tube is not None
        return self.result.tube

    @cached_property
    def constants(self) -> dict[str, Enclosure]:
        """What is claimed of the constants."""
        assert self.result.constants is not None
        return self.result.constants

    @cached_property
    def sections(self) -> dict[str, Section]:
        """What is claimed of gains."""
        assert self.result.sections is not None
        return self.result.sections

    @cached_property
    def place(self) -> Place:
        """The tube."""
        tube, states = self.tube, self.system.states
        if tube.coordinates is None or tube.half_widths is None:
            return Place(self.system, self.curve, tube.rho, self.budget)
        sides = tuple(tube.half_widths[name] for name in states)
        return Place(self.system, self.curve, tube.rho, self.budget, Coordinates(tube.coordinates), sides)

    @cached_property
    def setting(self) -> Setting:
        """The constants on their safe sides."""
        with ctx.workprec(SHARP):
            bounds = {name: self.bound_if_any(name) for name in USED}
            # what has no bound is not a number: no comparison with what rests on it can hold
            values = {name: arb("nan") if q is None else exact(q) for name, q in bounds.items()}
            rest = [arb(0), arb(0)]
            if self.system.unknown is not None:  # theory 7: it pushes and drifts as if the plan did
                rest = [self._ball(name) for name in disturbed.OF_UNKNOWN]
                values["plan_defect_metric"] += rest[0]
                values["drift_on_plan"] += rest[1]
            return Setting(
                self.system,
                Numbers(**values),
                self.place.rho,
                self.tube.rho_a,
                self._wind,
                turns=not all(map(all_zero, self.place.fields.slopes(self.system.B))),
                rest=rest[1],
            )

    @property
    def _wind(self) -> WindNumbers | None:
        """What a disturbance does, if there is one."""
        wind = self.system.wind
        if wind is None:
            return None
        push, size, explained = (self._ball(name) for name in disturbed.CONSTANTS)
        return WindNumbers(push, size, explained, exact(wind.length))

    def _ball(self, name: str) -> Ball:
        """The upper end of a constant, not a number where it has none."""
        found = self.bound_if_any(name)
        return arb("nan") if found is None else exact(found)

    def bound(self, name: str) -> Fraction:
        """The side of a constant that the conditions use; raises `ValueError` where there is none."""
        found = self.bound_if_any(name)
        if found is None:
            raise ValueError(f"{name} has no bound")
        return found

    def bound_if_any(self, name: str) -> Fraction | None:
        """The same; None where the certificate states that none was found: it claims nothing of the constant then."""
        value = self.constants[name]
        return value.below if name in INFIMA else value.above

    @cached_property
    def whole(self) -> tuple[object, ...]:
        """What every claim about the system depends on."""
        return self.result.specification.content, self.budget

    @cached_property
    def over_tube(self) -> tuple[object, ...]:
        """What every claim over the tube depends on."""
        own = () if self.place.coordinates is None else (self.place.coordinates.S, self.place.sides)
        return *self.whole, self.knots, self.place.rho, *own

    @cached_property
    def knots(self) -> str:
        """The knots of the plan, as a hash."""
        return digest(repr(self.result.plan.knots))

    @cached_property
    def numbers(self) -> tuple[object, ...]:
        """What every claim about gains depends on."""
        used = (*USED, *(name for name in self.constants if name not in MEASURED))
        return *self.whole, self.place.rho, self.tube.rho_a, *(self.bound_if_any(name) for name in used)
