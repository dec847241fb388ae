"""Constants of certificate H for a metric that depends on the state, every length measured by the metric itself.

They are the same in all coordinates, and lose no factor where W is badly conditioned. In: a tube and the constants of
B. Out: `CovariantConstants`, each an enclosure. Trusted: yes. Implements: theory 8.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from tubecert.bounds.constants import BoundConstants, Constant
from tubecert.bounds.hardware import HardwareSuprema
from tubecert.bounds.lipschitz import substituted
from tubecert.bounds.machines import COVARIANT as TABLE
from tubecert.bounds.machines import CovariantConstants
from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.pencil import Pencil
from tubecert.expression.matrix import Matrix
from tubecert.metric.covariant import Geometry

__all__ = ["TABLE", "CovariantConstants", "CovariantSuprema", "covariant_constants"]


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
        """D_nX = sup |Theta (X_x + Gamma(., X)) Theta^-1| of X = f + B u*, theory 8.6."""
        objective = Geometry(self.model).slope_of_field(self._drift)
        return self._tensor("drift_slope", objective, float(self.model.rate))

    def form_slope(self, least: Constant) -> Constant:
        """D_nF = sup over |v| = 1 of |D_v F|, theory 8.6."""
        objective = Geometry(self.model).slope_of_form()
        return self._tensor("form_slope", objective, float(self.model.rate) / self._distance(least))

    def input_slope(self, least: Constant, beta: Constant) -> Constant:
        """D_nb = sup on the plan over |v| = |z| = 1 of |(<D_v b_j, z>)_j|; 0 where the plan does not move.

        Theory 8.6.
        """
        if not self._plan_moves:
            return Constant.exactly(0.0)
        objective = Geometry(self.model).slope_of_inputs(self._on_the_plan, self.plan.fixed)
        return self._tensor_on_plan("input_slope", objective, beta.above / self._distance(least))

    def input_gain(self) -> Constant:
        """beta_O = sup smax(Theta B): the root of the largest eigenvalue of (B B', W), theory 8.6."""
        return self._root(self._over_tube("input_gain", Pencil(self.model.BBt, self.model.W)))

    def drift_metric(self, least: Constant) -> Constant:
        """phi_M = sup |Theta (f + B u*)|, theory 8.6."""
        objective = Geometry(self.model).size_of_field(self._drift)
        return self._tensor("drift_metric", objective, float(self.model.rate) * self._distance(least))

    def curvature(self, least: Constant) -> Constant:
        """K_R = sup |sectional curvature|: what matters is K_R dbar^2/8 against 1, theory 8.6."""
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
