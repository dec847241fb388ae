"""How far a plan is from satisfying the dynamics, proven over its whole horizon.

Implements: delta_p = sup |p| and delta = sup |Theta(x*) p| with p = x*' - f(x*) - B(x*) u* (theory, sections 3 and 4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.coordinates import Coordinates, Fields
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.domain import BoxDomain, Domain
from tubecert.enclosure.objective import MetricNorm, Objective, SumOfNorms
from tubecert.enclosure.pencil import Pencil
from tubecert.expression import ZERO
from tubecert.expression.matrix import Matrix, identity
from tubecert.model import TIME, ControlAffineModel
from tubecert.trajectory.plan import Plan

Search = Callable[[str, Objective, Domain, Effort], Supremum]
_NEGLIGIBLE = 1e-6


def plain_search(name: str, objective: Objective, domain: Domain, effort: Effort) -> Supremum:
    """The supremum, without any report of progress."""
    del name
    return supremum(objective, domain, effort)


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """The defect p of a plan, (n, 1), to be bounded for a tube of radius `rho`, both in z = S x where there
    are `coordinates` S.

    It matters against rate times rho: what is a millionth of that is not refined further.
    """

    p: Matrix
    plan: Plan
    model: ControlAffineModel
    rho: float
    effort: Effort
    search: Search = plain_search
    coordinates: Coordinates | None = None

    @classmethod
    def of(
        cls,
        plan: Plan,
        model: ControlAffineModel,
        rho: float,
        effort: Effort,
        coordinates: Coordinates | None = None,
    ) -> Defect:
        """The defect of a plan."""
        p = Fields(model, coordinates).of_vector(plan.defect(model))
        return cls(p=p, plan=plan, model=model, rho=rho, effort=effort, coordinates=coordinates)

    @property
    def vanishes(self) -> bool:
        """Whether the plan satisfies the dynamics exactly."""
        return all(row[0] is ZERO for row in self.p)

    @property
    def domain(self) -> Domain:
        """Where the plan's variables live; of a plan that stays, its times, or all of f, where f depends on them."""
        if not self.plan.is_constant or self.model.time is None:
            return self.plan.domain
        horizon = self.plan.horizon
        return BoxDomain({TIME: self.model.time if horizon is None else (Fraction(0), horizon)})

    def in_state(self) -> Supremum:
        """delta_p."""
        small = replace(self.effort, absolute=self._negligible)
        return self.search("plan_defect", SumOfNorms([self.p], self.plan.fixed), self.domain, small)

    def in_metric(self) -> Supremum:
        """Delta; negligible is what is negligible for |p|, in the units of the metric."""
        W = self.plan.on(self.model, Fields(self.model, self.coordinates).W)
        fixed, domain = self.plan.fixed, self.domain
        name, eye = "plan_defect_metric", identity(len(self.p))
        stretch = self.search(name, Pencil(eye, W, fixed=fixed), domain, self.effort)
        absolute = self._negligible * float(np.sqrt(max(stretch.below, 0.0)))
        return self.search(
            name, MetricNorm(self.p, W, fixed), domain, replace(self.effort, absolute=absolute)
        )

    @property
    def _negligible(self) -> float:
        return _NEGLIGIBLE * float(self.model.rate) * self.rho
