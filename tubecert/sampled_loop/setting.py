"""A specification and the matrices of an error equation -> the loop that the theorem is about.

Everything is exact: times are rational, matrices are floats that anybody may propose. Trusted: yes.
Implements: theory of the sampled loop, section 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import Range
from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.outward import number_above
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression, constant, free_symbols, symbol
from tubecert.expression.matrix import column, combine, multiply
from tubecert.model import ControlAffineModel, moving_parts, time_period
from tubecert.sampled_loop.matrices import lengths, nothing, total
from tubecert.sampled_loop.record import Nominal
from tubecert.spec import Afterwards, Hold, Knots, Spec, Vector
from tubecert.trajectory.plan import Family, Plan

ROUNDING: Final = {"single": 2.0**-24, "double": 2.0**-53}
_DEFECT: Final = Effort(gap=0.05, absolute=1e-9, budget=20_000)
PLAN_ROUNDING: Final = 2.0**-24
"""The controller's x* and u* are off by at most this of their largest size along the plan."""


@dataclass(frozen=True, slots=True, eq=False)
class Size:
    """What bounds a signal: every component, shape (k,), or its length (then each entry of `each` is the length)."""

    each: Array
    length: bool

    @classmethod
    def of(cls, bound: Fraction | Vector, components: int) -> Size:
        """A number bounds the length, a list the components."""
        if isinstance(bound, tuple):
            return cls(np.array([fraction_bounds(each)[1] for each in bound]), length=False)
        return cls(np.full(components, fraction_bounds(bound)[1]), length=components > 1)

    @property
    def weights(self) -> Array:
        """Of the components (k,), or of the length alone (1,)."""
        return self.each[:1] if self.length else self.each

    def weigh(self, columns: Array) -> Array:
        """What rows (.., k) of numbers that are not negative do to the signal: (..,), from above."""
        return total(lengths(columns) if self.length else columns, self.weights)


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """x(0) - x*(0): a known vector (n,) and what may be added to it, within a box (n,) or a length."""

    known: Interval
    box: Array
    length: float

    @property
    def reach(self) -> Array:
        """sup |x_i(0) - x*_i(0)|, (n,)."""
        return np.asarray((self.known.magnitude[:, 0] + self.box + self.length) * (1 + 1e-15))


class Loop:
    """The sampled loop about its plan; A (n, n), B (n, m), E (n, k) are any floats.

    `states` n, `inputs` m, `names` of both. Of the delay `whole` samples q, and the `rest` tau' in [0, Ts). `noise` of
    the measured states; `gusts`: the disturbance w (k,), which `sways` if it has a rate. `matched`: inputs beside which
    an h acts that is not identically 0; `declared`: bounds of |h|, its slope and its rate, of an h that is not given
    otherwise; it `jumps` if nothing bounds how fast it changes. `drift` f(x, p) (n,), `gained` B(x, p) (n, m) and
    `field` F = f + B u; `unknown`: the rows of F with a parameter that is not known; if `slow`, what these do along the
    plan is a component of eta, else it is sudden. How eta enters, `H` (n, r): h by columns of B, a disturbance that
    sways by those of E, parameters by rows. How rho enters, `R` (n, n + m): as it is, and by columns of B. `sudden`:
    what may jump at any time, columns (n, -) and size. `horizon`: until when the claim is, in s, in `samples`
    intervals; None: for ever.
    """

    def __init__(
        self, *, spec: Spec, model: ControlAffineModel, plan: Plan, knots: Knots | None, A: Array, B: Array, E: Array,
        slow: bool,
    ) -> None:  # fmt: skip
        assert spec.hardware is not None
        self.spec, self.model, self.plan, self.knots = spec, model, plan, knots
        self.A, self.B, self.E, self.slow, self.nominal = A, B, E, slow, Nominal(A, B, E)
        self.states, self.inputs = n, m = len(model.states), len(model.inputs)
        self.names = (*model.states, *model.inputs)
        self.hardware, self.sample_time = spec.hardware, spec.hardware.sample_time
        self.hold: Hold = spec.hardware.hold
        self.whole, self.rest = divmod(spec.hardware.delayed, self.sample_time)
        self.noise = Size.of(spec.hardware.noise, n)

        wind, given = spec.disturbance, spec.uncertainty.bounds
        self.gusts = Size(np.zeros(0), length=False) if wind is None else Size.of(wind.bound, E.shape[1])
        self.sways = wind is not None and wind.rate is not None
        bounds = (None,) * 3 if given is None else (given.h, given.h_x, given.h_t)
        self.declared = np.array([np.inf if each is None else fraction_bounds(each)[1] for each in bounds])
        self.jumps = model.h is None and not np.isfinite(self.declared[1:]).all()
        self.matched = tuple(j for j in range(m) if model.h is None or model.h[j] != constant(0))
        self.drift = model.drift or model.f
        self.gained: tuple[tuple[Expression, ...], ...] = tuple(map(tuple, model.gained or model.B))
        self.field = driven(self.drift, self.gained, model.inputs)
        parameters = {name for name, _ in model.parameters}
        rows = enumerate(zip(self.drift, self.gained, strict=True))
        self.unknown = tuple(i for i, (f, row) in rows if parameters & set(free_symbols([f, *row])))

        own = B[:, [] if self.jumps else list(self.matched)]
        strange = np.eye(n)[:, list(self.unknown if slow else ())]
        self.H, self.R = np.hstack([own, E if self.sways else E[:, :0], strange]), np.hstack([np.eye(n), B])
        blown = ((E, self.gusts),) if self.gusts.each.size and not self.sways else ()
        shaken = (
            ((B, Size(np.full(m, self.declared[0]), length=m > 1)),) if self.jumps and self.matched else ()
        )
        self.sudden: tuple[tuple[Array, Size], ...] = (*blown, *shaken)

        self.afterwards: Afterwards = spec.trajectory.afterwards
        self.horizon = plan.horizon if self.afterwards == "nothing" else None
        self.samples = None if self.horizon is None else ceil(self.horizon / self.sample_time)

    def times(self) -> Range | None:
        """The times that matter for h and the plan; None where nothing depends on t.

        Raises `ValueError` for an h that depends on t for ever without a period.
        """
        period = time_period(moving_parts(self.spec))
        if self.horizon is not None:
            return Fraction(0), self.horizon
        if period is None:
            raise ValueError("h depends on t without a horizon or a period")
        end = max(0.0 if self.plan.horizon is None else float(self.plan.horizon), float(period.hi))
        return (0.0, number_above(end)) if end else None

    @cached_property
    def defect(self) -> Array:
        """sup |x*_i' - F_i(x*, u*, p0)| while the plan moves, (n,)."""
        if isinstance(self.plan, Family):
            return np.full(self.states, fraction_bounds(self.plan.limit)[1])
        found = np.zeros(self.states)
        for i, (e,) in enumerate(self.plan.defect(self.model)):
            if e is not ZERO:
                found[i] = supremum(SumOfNorms([((e,),)], self.plan.fixed), self.plan.domain, _DEFECT).above
        return found

    @cached_property
    def start(self) -> Start:
        """x(0) - x*(0)."""
        n, spec = self.states, self.spec
        if spec.within is not None:
            return Start(nothing(n, 1), np.zeros(n), fraction_bounds(spec.within)[1])
        planned = Tape(self.plan.start, ()).run([], ())
        ends = spec.start_box or tuple((x, x) for x in spec.x0)
        bounds = np.array([(*fraction_bounds((a + b) / 2), fraction_bounds((b - a) / 2)[1]) for a, b in ends])
        middle, box = Interval(bounds[:, 0], bounds[:, 1]), bounds[:, 2]
        return Start((middle - planned).sanitised()[:, None], box, 0.0)


def driven(
    f: Sequence[Expression], B: Sequence[Sequence[Expression]], inputs: Sequence[str]
) -> tuple[Expression, ...]:
    """f + B u, (n,)."""
    u = column([symbol(name) for name in inputs])
    return tuple(row[0] for row in combine(1, column(f), 1, multiply(B, u)))
