"""Constants of certificate H for a metric that depends on the state, every length measured by the metric itself.

They are the same in all coordinates, and lose no factor where W is badly conditioned. In: a tube and the constants of
B. Out: `CovariantConstants`, each an enclosure. Trusted: yes. Implements: theory 8.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from tubecert.bounds.constants import BoundConstants, Constant, Meaning, table_of
from tubecert.bounds.hardware import HardwareSuprema, entry
from tubecert.bounds.suprema import Suprema, substituted
from tubecert.enclosure.pencil import Pencil
from tubecert.expression.matrix import Matrix
from tubecert.metric.covariant import Geometry


@dataclass(frozen=True, slots=True, kw_only=True)
class CovariantConstants:
    """What takes the place of coordinate derivatives where the metric is not constant, each an enclosure."""

    drift_slope: Constant = field(
        metadata=entry("D_nX", "1/s", "sup of the covariant derivative of f + B u*, in the metric")
    )
    form_slope: Constant = field(
        metadata=entry("D_nF", "1/(d s)", "sup of the covariant derivative of F, in the metric")
    )
    input_slope: Constant = field(
        metadata=entry("D_nb", "1/(u s)", "sup on the plan of the covariant derivatives of the columns of B")
    )
    input_gain: Constant = field(metadata=entry("beta_O", "d/(u s)", "sup of |Theta B| over the tube"))
    drift_metric: Constant = field(metadata=entry("phi_M", "d/s", "sup of |Theta (f + B u*)| over the tube"))
    curvature: Constant = field(metadata=entry("K_R", "1/d^2", "sup of the |curvature| of the metric"))

    def printable(self) -> CovariantConstants:
        """The same with every enclosure widened to printable bounds."""
        return replace(self, **{name: value.printable() for name, value, _ in self.items()})

    def items(self) -> list[tuple[str, Constant, Meaning]]:
        """`(name, value, meaning)` of every constant, in the order of the table."""
        return [(name, getattr(self, name), meaning) for name, meaning in TABLE.items()]


TABLE: dict[str, Meaning] = table_of(fields(CovariantConstants))


def covariant_constants(suprema: Suprema, known: BoundConstants) -> CovariantConstants | None:
    """The covariant constants over the tube of `suprema`; None where the metric is constant."""
    search = CovariantSuprema(**{item.name: getattr(suprema, item.name) for item in fields(Suprema)})
    if search.straight:
        return None
    return CovariantConstants(
        drift_slope=search.drift_slope(),
        form_slope=search.form_slope(known.lower),
        input_slope=search.input_slope(known.lower, known.metric_input_gain),
        input_gain=search.input_gain(),
        drift_metric=search.drift_metric(known.lower),
        curvature=search.curvature(known.lower),
    ).printable()


class CovariantSuprema(HardwareSuprema):
    """The suprema over the tube that are free of coordinates: all in x, whatever the coordinates of the tube."""

    def drift_slope(self) -> Constant:
        """D_nX = sup |Theta (X_x + Gamma(., X)) Theta^-1| of X = f + B u*."""
        objective = Geometry(self.model).slope_of_field(self._drift)
        return self._tensor("drift_slope", objective, float(self.model.rate))

    def form_slope(self, least: Constant) -> Constant:
        """D_nF = sup over |v| = 1 of |D_v F|."""
        objective = Geometry(self.model).slope_of_form()
        return self._tensor("form_slope", objective, float(self.model.rate) / self._distance(least))

    def input_slope(self, least: Constant, beta: Constant) -> Constant:
        """D_nb = sup on the plan over |v| = |z| = 1 of |(<D_v b_j, z>)_j|; 0 where the plan does not move."""
        if not self._plan_moves:
            return Constant.exactly(0.0)
        objective = Geometry(self.model).slope_of_inputs(self._on_the_plan, self.plan.fixed)
        return self._tensor_on_plan("input_slope", objective, beta.above / self._distance(least))

    def input_gain(self) -> Constant:
        """beta_O = sup smax(Theta B): the root of the largest eigenvalue of (B B', W)."""
        return self._root(self._over_tube("input_gain", Pencil(self.model.BBt, self.model.W)))

    def drift_metric(self, least: Constant) -> Constant:
        """phi_M = sup |Theta (f + B u*)|."""
        objective = Geometry(self.model).size_of_field(self._drift)
        return self._tensor("drift_metric", objective, float(self.model.rate) * self._distance(least))

    def curvature(self, least: Constant) -> Constant:
        """K_R = sup |sectional curvature|: what matters is K_R dbar^2/8 against 1."""
        bound = self._tensor("curvature", Geometry(self.model).curvature(), 1 / self._distance(least) ** 2)
        # of more than three states not every bivector is a plane
        return bound if len(self.model.states) <= 3 else replace(bound, below=0.0)

    def _distance(self, least: Constant) -> float:
        """About dbar = sqrt(a) rho: a scale."""
        return float(np.sqrt(least.above)) * self.rho

    @property
    def _drift(self) -> Matrix:
        drift = self.model.drift_on_plan()
        if not self.plan.is_constant or self.plan.allowance is not None:
            return drift
        return substituted(drift, dict(zip(self.model.inputs, self.plan.u, strict=True)))
