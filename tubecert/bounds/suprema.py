"""Each constant as a supremum over the tube: the objective that defines it, and its enclosure.

`Suprema` fixes a model, a plan, a radius and an effort; every method returns one enclosed constant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.bounds.affine import NormOverRest
from tubecert.bounds.clearance import Shape
from tubecert.bounds.constants import Constant
from tubecert.bounds.feedback import MU, ClosedFormGain, exact_gain
from tubecert.bounds.linear import LEAST, linear_bound
from tubecert.bounds.multiplier import eased_bound
from tubecert.bounds.searches import Searches, lipschitz_constant, substituted
from tubecert.coordinates import Fields
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.constant import printable_above, printable_below
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Interval, fraction_bounds
from tubecert.enclosure.objective import Objective, SumOfNorms
from tubecert.enclosure.pencil import Pencil, SumOfPencils
from tubecert.expression import ONE, ZERO, Expression, derivatives, free_symbols
from tubecert.expression.matrix import Matrix, column, constants, identity, multiply, transpose
from tubecert.model import TIME
from tubecert.trajectory.plan import Defect

_SAME = 1e-5  # of a half-width that cuts nothing off the ellipsoid
_BESIDE = 500  # boxes beside a bound by the linear part
_NEAR = 0.05  # such bounds serve where they are this close, however close was asked for
_COARSE, _ROUGH = 0.1, 1e-2  # from that gap on the metric, too, need not be known sharply


@dataclass(frozen=True)
class Suprema(Searches):
    """The suprema of a model over its tube, each a constant."""

    # -- metric ------------------------------------------------------------------------------------------------

    def metric_bounds(self) -> tuple[Constant, Constant]:
        """(a, A): inf lmin(M) = 1/sup lmax(W) and sup lmax(M), with M = W^-1, (1.1)."""
        fine = self._fine
        unit = self._unit
        largest = self.over_tube("lower", Pencil(self.model.W, unit), fine)
        upper = self.over_tube("upper", Pencil(unit, self.model.W), fine)
        inverse = (Interval.exact(1.0) / Interval(largest.below, largest.above)).sanitised()
        lower = Constant(below=float(inverse.lo), above=float(inverse.hi), at=self._witness(largest))
        return lower, self._constant(upper)

    @property
    def _unit(self) -> Matrix:
        """What the dual metric is where it is the identity in z: S^-1 S^-T."""
        if self.coordinates is None:
            return identity(len(self.model.states))
        return constants(self.coordinates.spread)

    def greatest_stretch(self) -> Constant:
        """sup sqrt(lmax(M)) with M in x: the metric length of a vector over its length in x, theory 1a.3."""
        return self._root(
            self.over_tube("upper", Pencil(identity(len(self.model.states)), self.model.W), self._fine)
        )

    @property
    def _fine(self) -> Effort:
        """For what enters every condition; not where metrics are only compared."""
        return replace(self.effort, gap=min(self.effort.gap, _ROUGH if self.effort.gap >= _COARSE else 1e-4))

    def metric_slope(self) -> Constant:
        """DMx = sup sum_i |dM/dx_i|, dM/dx_i = -M W_i M: eigenvalues of the pencils (W_i, W^2), (2.2)."""
        W = self.fields.W
        slopes = [w for w in self.fields.W_x if any(e is not ZERO for row in w for e in row)]
        if not slopes:
            return Constant.exactly(0.0)
        return self._constant(self.over_tube("M_x", SumOfPencils(slopes, multiply(W, W))))

    # -- dynamics ----------------------------------------------------------------------------------------------

    def norms(self, name: str, matrices: list[Matrix]) -> Constant:
        """sup over the tube of the sum of spectral norms, (2.1)-(2.3)."""
        plain = SumOfNorms(matrices)
        if plain.is_zero:
            return Constant.exactly(0.0)
        rest = self._over_rest(matrices)
        objective: Objective = plain if rest is None else rest
        if name in self.gaps and len(matrices) == 1 and len(matrices[0][0]) == 1:
            return self._eased(name, objective, matrices[0])
        return self._constant(self._searched(name, objective, self.effort_for(name)))

    def _searched(self, name: str, objective: Objective, effort: Effort) -> Supremum:
        """By boxes, with the states that need no search put back.

        recheck proves such a norm by boxes in all states: to be sharper than was asked for would cost it minutes.
        """
        found = self.over_tube(name, objective, effort)
        if not isinstance(objective, NormOverRest):
            return found
        known = set(objective.variables) <= set(found.at)  # or no point was found
        at = {**found.at, **objective.completed(found.at)} if known else {}
        return replace(found, above=max(found.above, found.below * (1 + effort.gap)), at=at)

    def _eased(self, name: str, objective: Objective, v: Matrix) -> Constant:
        """The norm of one vector where gaps go by effect: by its linear part, by the constraint of the tube, by boxes.

        A few boxes say what the supremum is at least. With a multiplier, too, no closer than was asked for.
        """
        effort, few = self.effort_for(name), len(free_symbols(row[0] for row in v)) < LEAST
        found = self._searched(name, objective, replace(effort, budget=min(effort.budget, _BESIDE)))
        above, enough = found.above, found.below * (1 + effort.gap)
        if above > enough:
            above = min(above, linear_bound(self, v) or np.inf)
        if above > enough:
            close = replace(effort, gap=1e-9, absolute=effort.gap * found.below**2)
            above = min(above, max(enough, eased_bound(self, name, v, found.at, close) or np.inf))
        if above > (enough if few else found.below * (1 + max(effort.gap, _NEAR))):
            found = self._searched(name, objective, effort)
            above = min(above, found.above)
        return self._constant(replace(found, above=above))

    def _over_rest(self, matrices: list[Matrix]) -> NormOverRest | None:
        """The norm of one vector as a function of fewer states, where those that it is affine in need no search."""
        # x* by expressions of t alone: not through knots, whose coefficients are data, nor anywhere in boxes
        written = self.plan.spans is None and self.plan.knots is None and self.plan.allowance is None
        if self.coordinates is None or not written or len(matrices) > 1 or len(matrices[0][0]) > 1:
            return None
        if free_symbols(row[0] for row in matrices[0]) & set(dict(self.model.parameters)):
            return None
        if self.sides and np.any(self.sides < self.reach * (1 - _SAME)):  # half-widths count, too
            return None
        try:
            return NormOverRest(matrices[0], self.model.states, self.plan.x, self.coordinates, self.rho)
        except ValueError:
            return None

    def drift_on_plan(self) -> Constant:
        """phi = sup |f(x* + z) + B(x* + z) u*(t)|, |z| <= rho, (2.4)."""
        drift = self.fields.drift_on_plan()
        if self.plan.is_constant:
            drift = substituted(drift, dict(zip(self.model.inputs, self.plan.u, strict=True)))
        return self.norms("drift_on_plan", [drift])

    def input_on_plan(self) -> Constant:
        """Dus = sup_t |u*(t)|."""
        return self._on_plan("u_star", SumOfNorms([column(self.plan.u)], self.plan.fixed))

    def input_range(self, index: int, sharp: float) -> tuple[Constant, Constant]:
        """(inf u*_i, sup u*_i), each to `sharp` in units of the input, if not to the gap that was asked for, (4.13)."""
        name, u = self.model.inputs[index], self.plan.u[index]
        effort = replace(self.effort, absolute=sharp)

        def most(e: Expression) -> Constant:
            if e.is_constant:
                low, high = fraction_bounds(e.fraction)
                return Constant(below=low, above=high)
            entry = Pencil([[e]], [[ONE]], fixed=self.plan.fixed)
            return self._constant(self._search_plan(f"range of {name}", entry, effort))

        least = most(-u)
        return Constant(below=0.0 - least.above, above=0.0 - least.below, at=least.at), most(u)  # no -0.0

    # -- uncertainty -------------------------------------------------------------------------------------------

    def lipschitz(self, entries: tuple[Expression, ...], fields: Fields | None = None) -> Constant:
        """A Lipschitz constant of entries in the states, whatever their kinks."""
        if not free_symbols(entries) & set(self.model.states):
            return Constant.exactly(0.0)
        return self._constant(self.over_tube("h_x", lipschitz_constant(entries, fields or self.fields)))

    def uncertainty(self, fields: Fields | None = None) -> tuple[Constant, Constant, Constant]:
        """(Dh, Dhx, Dht) of the h given as expressions; Dhx is a Lipschitz constant where h has kinks, (2.3).

        It is one in the coordinates of the tube, or in those of other `fields`.
        """
        h = self.h
        by_time = derivatives(h, TIME)
        lipschitz = self.lipschitz(h, fields)
        return self.norms("h", [column(h)]), lipschitz, self.norms("h_t", [column(by_time)])

    @property
    def h(self) -> tuple[Expression, ...]:
        """The uncertainty as expressions; raises `ValueError` if it is declared by bounds only."""
        if self.model.h is None:
            raise ValueError("h is declared by bounds, not by expressions")
        return self.model.h

    # -- feedback ----------------------------------------------------------------------------------------------

    def feedback_gain(self) -> Constant:
        """du = sup over x and mu of the largest eigenvalue of (F, B B'/mu + mu W), at least 0, (2.8), theory 2.1.

        Exact: 2 |B~ v| |v| = min over mu of |B~ v|^2/mu + mu |v|^2, attained at some mu <= smax(B~).
        """
        top = self.over_tube("feedback_gain", Pencil(self.model.BBt, self.model.W))
        largest = float(np.nextafter(np.sqrt(top.above), np.inf))  # a root is rounded to nearest (IEEE 754)
        found = self.over_tube("feedback_gain", exact_gain(self.model, largest), extra={MU: (0.0, largest)})
        above = found.above
        if self.model.constant_input:
            effort = self.effort_for("feedback_gain")
            cheap = replace(effort, budget=min(effort.budget, self.effort.cheap))
            above = min(above, self.feedback_gain_closed_form(cheap if found.reached else None))
        return Constant(below=max(0.0, found.below), above=max(0.0, above), at=self._witness(found))

    def feedback_gain_closed_form(self, effort: Effort | None = None) -> float:
        """A bound of du in closed form: looser, but it needs no search over mu, theory 2.2."""
        return self.over_tube("feedback_gain", ClosedFormGain(self.model), effort).above

    # -- on the plan -------------------------------------------------------------------------------------------

    def metric_input_gain(self) -> Constant:
        """beta = sup_t smax(Theta(x*) B(x*)), the root of the largest eigenvalue of (B B', W) on the plan, (2.5)."""
        on = self.plan.on
        objective = Pencil(
            on(self.model, self.model.BBt), on(self.model, self.model.W), fixed=self.plan.fixed
        )
        return self._root(self._search_plan("metric_input_gain", objective))

    def plan_defect(self) -> tuple[Constant, Constant]:
        """(delta_p, delta): sup |p| and sup |Theta(x*) p| with p = x*' - f(x*) - B(x*) u*, (2.7)."""
        if self.plan.allowance is not None:
            return self._limited_defect(self.plan.allowance)
        effort = self.effort_for("plan_defect")
        found = Defect.of(self.plan, self.model, self.rho, effort, self.coordinates)
        defect = replace(found, search=self._run)
        if defect.vanishes:
            return Constant.exactly(0.0), Constant.exactly(0.0)
        return self._constant(defect.in_state()), self._constant(defect.in_metric())

    def _limited_defect(self, limit: Fraction) -> tuple[Constant, Constant]:
        """The limit, and the limit times the root of sup lmax(M) on the plan: any p that is allowed may be met, (4.10).

        The limit is of |p| in x, and M the metric in x; in z = S x the first is |S| times that.
        """
        if not limit:
            return Constant.exactly(0.0), Constant.exactly(0.0)
        length = Interval.of(limit)
        own = length
        if self.coordinates is not None:
            norm = supremum(SumOfNorms([self.coordinates.S]), BoxDomain({}), self.effort)
            own = Interval(norm.below, norm.above) * length
        M = Pencil(identity(len(self.model.states)), self.plan.on(self.model, self.model.W))
        stretch = self._root(self._search_plan("plan_defect_metric", M))
        size = length * Interval(stretch.below, stretch.above)
        return (
            Constant(below=float(own.lo), above=float(own.hi)),
            Constant(below=float(size.lo), above=float(size.hi), at=stretch.at),
        )

    def half_widths(self) -> tuple[Constant, ...]:
        """sup sqrt(W_ii) for every state: |x_i - x_i*| <= that times the distance, theory 4.3."""
        W = self.model.W
        return tuple(self._width(name, W[i][i]) for i, name in enumerate(self.model.states))

    def output_widths(self) -> tuple[Constant, ...]:
        """sup sqrt(c'W c) for every output c'x: |c'(x - x*)| <= that times the distance, (1.8)."""
        rows = ((output.name, constants([output.row])) for output in self.model.outputs)
        return tuple(
            self._width(name, multiply(multiply(c, self.model.W), transpose(c))[0][0]) for name, c in rows
        )

    def _width(self, name: str, square: Expression) -> Constant:
        effort = None if self.coordinates is None else self._fine  # it is no part of a ball
        return self._root(self.over_tube(f"half width of {name}", Pencil([[square]], [[ONE]]), effort))

    def shape_in(self, first: int, second: int) -> Shape:
        """Bounds over the tube of the block of W that belongs to two states, theory 4c."""

        def most(entry: Expression) -> float:
            if entry.is_constant:
                return fraction_bounds(entry.fraction)[1]
            return self.over_tube("shape in the plane", Pencil([[entry]], [[ONE]])).above

        W = self.model.W
        beside = W[first][second]
        return Shape(  # what is printed is what is used
            diagonal=(printable_above(most(W[first][first])), printable_above(most(W[second][second]))),
            beside=(printable_below(-most(-beside)), printable_above(most(beside))),
        )

    def root_of(self, name: str, objective: Objective) -> Constant:
        """The root of a supremum over the tube."""
        return self._root(self.over_tube(name, objective))
