"""The constants that certificate H needs beside those of A, B and C: what time, delay and noise cost.

In: a tube, what is asked of the hardware, and the constants of B. Out: `HardwareConstants`, each an enclosure, and the
set that the estimate is clipped to. All are in the coordinates z = S x of the tube, noise n is given in x. With W = L'L
it is Theta = L^-T and F~ = L^-T F L^-1. Trusted: yes. Implements: theory 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import cached_property
from itertools import product as choices

import numpy as np

from tubecert.bounds.constants import BoundConstants, Constant
from tubecert.bounds.feedforward import rate_of
from tubecert.bounds.lipschitz import substituted
from tubecert.bounds.machines import HARDWARE as TABLE
from tubecert.bounds.machines import HardwareConstants
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.whitened import Whitened, whitened
from tubecert.bounds.wind import joined
from tubecert.enclosure.branch_and_bound import Effort, Supremum
from tubecert.enclosure.constant import decimal_above
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.enclosure.metric_norm import MetricNorm
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.pencil import SumOfPencils
from tubecert.expression import ZERO, derivatives
from tubecert.expression.matrix import (
    Matrix,
    column,
    combine,
    constants,
    identity,
    jacobian,
    multiply,
)
from tubecert.metric.covariant import Geometry, MetricTensorNorm
from tubecert.metric.geodesic import GeodesicTest
from tubecert.model import TIME
from tubecert.spec import Hardware

_FEW = 4_000  # boxes
_NEGLIGIBLE = 1e-3  # of what a constant is added to
Box = tuple[tuple[Fraction, Fraction], ...]


__all__ = ["TABLE", "HardwareConstants", "HardwareSuprema", "clip_box", "corners", "hardware_constants"]


def hardware_constants(
    suprema: Suprema, machine: Hardware, geodesics: GeodesicTest, known: BoundConstants
) -> HardwareConstants:
    """The constants of certificate H over the tube of `suprema`, whose other constants are `known`."""
    search = HardwareSuprema(**{item.name: getattr(suprema, item.name) for item in fields(Suprema)})
    noise = machine.noise if isinstance(machine.noise, tuple) else None
    slope = search.drift_slope_metric()
    return HardwareConstants(
        feedback_slope=search.feedback_slope(),
        feedback_curvature=search.feedback_curvature(),
        plan_tilt=search.plan_tilt(known.metric_input_gain),
        plan_speed=search.plan_speed(known.plan_defect),
        drift_difference=search.drift_difference(),
        drift_difference_metric=search.drift_difference_metric(known.upper, slope),
        drift_slope_metric=slope,
        drift_explained=search.drift_explained(known),
        feedback_drift=search.feedback_drift(),
        drift_rate=search.drift_rate(known),
        noise_size=search.noise_size(noise),
        noise_metric=search.noise_metric(noise),
        noise_explained=search.noise_explained(noise),
        input_rate=search.input_rate() if machine.held else None,
        symbols=geodesics.symbols,
        symbols_slope=geodesics.slope or Constant(below=0.0, above=np.inf),
    ).printable()


@dataclass(frozen=True)
class HardwareSuprema(Suprema):
    """The suprema of a model over the tube that only certificate H needs."""

    @property
    def straight(self) -> bool:
        """Whether the metric is constant."""
        return self._white is not None

    @property
    def flat(self) -> bool:
        """Whether the metric and B are constant."""
        return self._white is not None and self.model.constant_input

    @cached_property
    def _white(self) -> Whitened | None:
        """Coordinates in which a constant metric is the identity; None if it is not constant."""
        return whitened(self.model.W)

    @property
    def _written(self) -> bool:
        """Whether x* and u* are expressions of t: not through knots, nor anywhere in boxes."""
        return self.plan.spans is None and self.plan.knots is None and self.plan.allowance is None

    # -- feedback ----------------------------------------------------------------------------------------------

    def feedback_slope(self) -> Constant:
        """D_F = sup |F~|: the largest |eigenvalue| of the pencil (F, W), theory 8.2."""
        return self._constant(
            self._over_tube("feedback_slope", SumOfPencils([self.model.F], self.model.W), self._fine)
        )

    def feedback_curvature(self) -> Constant:
        """D_Fx >= sup over |v| = 1 of |eigenvalue| of (T_v, W), T_v = F_v - W_v M F - F M W_v, theory 8.2.

        By the norm of v -> T_v as a matrix from vectors to pairs of them and v.
        """
        objective = Geometry(self.model).slope_by_coordinates(self.fields)
        if self._white is None:
            return self._tensor("feedback_curvature", objective, float(self.model.rate) / self.rho)
        slopes = [self._white.form(slope) for slope in self.fields.slopes(self.model.F)]
        above = SumOfNorms([tuple(row for slope in slopes for row in slope)])
        if above.is_zero:
            return Constant.exactly(0.0)
        found = self._over_tube("feedback_curvature", above)
        return _reached(objective, found, self._white.of_form(self._constant(found)))

    def feedback_drift(self) -> Constant | None:
        """D_Ft = sup |dF~/dt|: the largest |eigenvalue| of the pencil (dF/dt, W); None where f is free of t."""
        if self.model.time is None:
            return None
        slope = tuple(tuple(derivatives(row, TIME)) for row in self.model.F)
        if not _moves(slope):
            return Constant.exactly(0.0)
        return self._constant(self._over_tube("feedback_drift", SumOfPencils([slope], self.model.W)))

    def plan_tilt(self, beta: Constant) -> Constant:
        """D_cx >= sup on the plan over |v| = 1 of |(B_v' - B'M W_v) L^-1|; `beta` is that of the tube, theory 8.2."""
        if self.flat or not self._plan_moves:
            return Constant.exactly(0.0)
        objective = Geometry(self.model).tilt_by_coordinates(self.fields, self._on_the_plan, self.plan.fixed)
        return self._tensor_on_plan("plan_tilt", objective, beta.above / self.rho)

    def _on_the_plan(self, rows: Matrix) -> Matrix:
        return self.plan.on(self.model, rows)

    @property
    def _plan_moves(self) -> bool:
        return not self.plan.is_constant or self.plan.allowance is not None

    def _tensor(self, name: str, objective: MetricTensorNorm, scale: float) -> Constant:
        """The supremum over the tube; what is negligible against `scale` is not refined further."""
        found = self._over_tube(name, objective, self._up_to(name, scale))
        return _reached(objective, found, self._constant(found))

    def _tensor_on_plan(self, name: str, objective: MetricTensorNorm, scale: float) -> Constant:
        found = self._search_plan(name, objective, self._up_to(name, scale))
        return _reached(objective, found, self._constant(found))

    def _up_to(self, name: str, scale: float) -> Effort:
        return replace(self._few(name), absolute=_NEGLIGIBLE * scale)

    def _few(self, name: str) -> Effort:
        """For what enters in the second place only."""
        return replace(self.effort_for(name), budget=min(self.effort.budget, _FEW), cheap=0)

    # -- plan --------------------------------------------------------------------------------------------------

    def plan_speed(self, defect: Constant) -> Constant:
        """Ystar = sup |x*'|; of plans that are not known, sup |f + B u*| on them and what their defect adds.

        Theory 8.2.
        """
        if self.plan.allowance is None:
            slope = self.fields.vector(self.plan.slope)
            return self._on_plan("plan_speed", SumOfNorms([slope], self.plan.fixed))
        drift = self.plan.on(self.model, self.fields.drift_on_plan())
        objective, at = SumOfNorms([drift], self.plan.fixed), self.plan.at_times_of(self.model)
        speed = (
            Constant.exactly(0.0)
            if objective.is_zero
            else self._constant(self._run("plan_speed", objective, at, self.effort_for("plan_speed")))
        )
        total = Interval(speed.below, speed.above) + Interval(defect.below, defect.above)
        return Constant(below=0.0, above=float(total.hi))

    def input_rate(self) -> Constant:
        """Lus: the Lipschitz constant of u*, infinite where u* may jump, (H.6a)."""
        if self.plan.knots is not None:
            return rate_of(self.plan.knots)
        if self.plan.allowance is not None:
            held = all(e.is_constant for e in self.plan.u)
            return Constant.exactly(0.0) if held else Constant(below=0.0, above=np.inf)
        slope = column(derivatives(self.plan.u, TIME))
        return self._on_plan("input_rate", SumOfNorms([slope], self.plan.fixed))

    # -- drift -------------------------------------------------------------------------------------------------

    def drift_difference(self) -> Constant:
        """phi_rel = sup |(f + B u*)(x* + z) - (f + B u*)(x*)|, |z| <= rho, theory 8.2.

        At most rho times the Lipschitz constant of f + B u*; where x* is written in t, the difference itself is
        bounded, too.
        """
        drift = self.model.drift_on_plan()
        by_mean = self._by_mean_value(self._known_inputs(drift))
        if self.flat or not self._written:  # where M and B are constant, no formula contains it
            return by_mean
        difference = SumOfNorms([self.fields.of_vector(self._from_plan(drift))])
        return _smaller(self._in_few("drift_difference", difference), by_mean)

    def _in_few(self, name: str, objective: SumOfNorms) -> Constant:
        if objective.is_zero:
            return Constant.exactly(0.0)
        return self._constant(self._over_tube(name, objective, self._few(name)))

    def _by_mean_value(self, drift: Matrix) -> Constant:
        """A bound of |drift(x* + z) - drift(x*)|: rho sup |drift_x|, theory 8.2."""
        by_state = self.fields.of_vector(self.fields.by_state(_jacobian(drift, self.model.states)))
        slope = self.norms("drift_difference", [by_state])
        return Constant(below=0.0, above=float((Interval(slope.below, slope.above) * self._reach).hi))

    def drift_difference_metric(self, largest: Constant, slope: Constant | None) -> Constant | None:
        """phi_relM = sup |Theta (f(x* + z) - f(x*))|, for constant M and B; `slope` is D_A, theory 8.2."""
        if self._white is None or slope is None:
            return None
        # |Theta z| <= sqrt(A) rho
        length = sqrt(Interval(largest.below, largest.above)) * self._reach
        by_mean = Constant(below=0.0, above=float((Interval(0.0, slope.above) * length).hi))
        if not self._written:
            return by_mean
        difference = SumOfNorms([self._white.vector(self._from_plan(column(self.model.f)))])
        return _smaller(self._white.length(self._in_few("drift_difference_metric", difference)), by_mean)

    def drift_slope_metric(self) -> Constant | None:
        """D_A = sup |Theta f_x Theta^-1|, for constant M and B, theory 8.2."""
        if self._white is None or not self.flat:
            return None
        slope = self._white.map(self.model.f_x)
        return self._white.norm(self.norms("drift_slope_metric", [slope]))

    def drift_explained(self, known: BoundConstants) -> Constant:
        """D_pf = sup |B^+ f_x| where B is constant, else DBp Dfx: they are taken at two points, theory 8.2."""
        if self.model.constant_input:
            return self.norms("drift_explained", [multiply(self.fields.B_pinv, self.fields.f_x)])
        pinv, f_x = (Interval(c.below, c.above) for c in (known.B_pinv, known.f_x))
        total = pinv * f_x
        return Constant(below=max(0.0, float(total.lo)), above=float(total.hi))

    def drift_rate(self, known: BoundConstants) -> Constant | None:
        """D_pt = sup |B^+ f_t| where B is constant, else DBp sup |f_t|; None where f is free of t."""
        if self.model.time is None:
            return None
        slope = self.fields.of_vector(column(derivatives(self.model.f, TIME)))
        if self.model.constant_input:
            return self.norms("drift_rate", [multiply(self.fields.B_pinv, slope)])
        own, pinv = self.norms("drift_rate", [slope]), known.B_pinv
        total = Interval(own.below, own.above) * Interval(pinv.below, pinv.above)
        return Constant(below=max(0.0, float(total.lo)), above=float(total.hi))

    def _from_plan(self, drift: Matrix) -> Matrix:
        """What a column of x and u* is, less what it is at x*, in states and t."""
        return combine(1, self._known_inputs(drift), -1, self.plan.on(self.model, drift))

    def _known_inputs(self, drift: Matrix) -> Matrix:
        """The names of the inputs replaced by u*, where that is written in t."""
        if not self._written:
            return drift
        return substituted(drift, dict(zip(self.model.inputs, self.plan.u, strict=True)))

    @property
    def _reach(self) -> Interval:
        return Interval(self.rho, self.rho)

    # -- noise -------------------------------------------------------------------------------------------------

    def noise_size(self, noise: Sequence[Fraction] | None) -> Constant:
        """The size in z of one unit of noise."""
        if noise is None:
            return self.norms("noise_size", [self.fields.of_vector(identity(len(self.model.states)))])
        return _largest([self.norms("noise_size", [self.fields.of_vector(n)]) for n in corners(noise)])

    def noise_metric(self, noise: Sequence[Fraction] | None) -> Constant:
        """n_M = sup |Theta n| over one unit of noise: of a box, at its corners, theory 8.2."""
        if noise is None:
            return self.greatest_stretch()
        return _largest(
            [
                self._constant(self._over_tube("noise_metric", MetricNorm(n, self.model.W), self._fine))
                for n in corners(noise)
            ]
        )

    def noise_explained(self, noise: Sequence[Fraction] | None) -> Constant:
        """n_B = sup |B^+ n| over one unit of noise: of a box, at its corners, theory 8.2."""
        pinv = multiply(self.fields.B_pinv, self.fields.of_vector(identity(len(self.model.states))))
        if noise is None:
            return self.norms("noise_explained", [pinv])
        return _largest([self.norms("noise_explained", [multiply(pinv, n)]) for n in corners(noise)])


def clip_box(suprema: Suprema) -> Box:
    """A box of decimals that contains 0 and h over the tube, per input; h is given as expressions.

    h is what it is with a wind that joins it, and with unknown parameters (theory 7.1).
    """
    total, blown = joined(suprema)
    found = []
    for i, (name, h) in enumerate(zip(suprema.model.inputs, total, strict=True)):
        low, high = suprema.range_of(f"h of {name}", h)
        more = suprema.norms(f"wind of {name}", [(blown[i],)]).above if blown else 0.0
        found.append((-_decimal(-low, more), _decimal(high, more)))
    return tuple(found)


def corners(noise: Sequence[Fraction]) -> list[Matrix]:
    """The corners of the box |n_i| <= noise_i, each (n, 1), one of every two opposite ones."""
    moving = [i for i, most in enumerate(noise) if most]
    found = []
    for signs in choices((1, -1), repeat=max(0, len(moving) - 1)):
        corner = list(noise)
        for i, sign in zip(moving[1:], signs, strict=True):
            corner[i] *= sign
        found.append(constants([[value] for value in corner]))
    return found


def _decimal(bound: float, more: float) -> Fraction:
    """The least decimal >= bound + more and 0."""
    whole = Fraction(bound) + Fraction(more)
    return decimal_above(whole) if whole > 0 else Fraction(0)


def _reached(objective: MetricTensorNorm, found: Supremum, bound: Constant) -> Constant:
    """A bound by the norm of a matrix, and from below what the multilinear map itself reaches where it was found."""
    return replace(bound, below=min(objective.attained(found.at), bound.above))


def _largest(found: Sequence[Constant]) -> Constant:
    top = max(found, key=lambda c: c.above)
    return Constant(below=max(c.below for c in found), above=top.above, at=top.at)


def _smaller(direct: Constant, bound: Constant) -> Constant:
    """An enclosure with the smaller of two bounds from above."""
    return Constant(below=direct.below, above=min(direct.above, bound.above), at=direct.at)


# -- a constant metric -----------------------------------------------------------------------------------------


# -- matrices --------------------------------------------------------------------------------------------------


def _jacobian(drift: Matrix, states: Sequence[str]) -> Matrix:
    return jacobian([row[0] for row in drift], states)


def _moves(a: Matrix) -> bool:
    return any(e is not ZERO for row in a for e in row)
