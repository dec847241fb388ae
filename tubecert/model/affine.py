"""A specification as exact matrices of expressions.

In: a `Spec`. Out: a `ControlAffineModel`, and the period of what depends on time. Trusted: yes.
Implements: F(x) = -d_f W + f_x W + W f_x' + 2 rate W, B^+ = (B'B)^-1 B' and their parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import combinations, islice
from typing import TYPE_CHECKING

import numpy as np

from tubecert.enclosure.branch_and_bound import Decision, Effort, decide
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.interval import PI, Interval
from tubecert.enclosure.pencil import scalar
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression, constant, free_symbols, substitute, symbol
from tubecert.expression.matrix import (
    Matrix,
    adjugate,
    along,
    combine,
    determinant,
    differentiate,
    identity,
    jacobian,
    multiply,
    null_space,
    transpose,
)
from tubecert.expression.waves import frequencies
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from tubecert.spec import Output, Spec


def nonzero(e: Expression, ranges: dict[str, Range], effort: Effort) -> Decision:
    """Whether e has no zero on a box: proven if it is of one sign, refuted by a point of either sign."""
    domain = BoxDomain(ranges)
    positive = decide(scalar(-e), domain, 0.0, effort)
    if positive.verdict is Verdict.CERTIFIED:
        return positive
    negative = decide(scalar(e), domain, 0.0, effort)
    if negative.verdict is Verdict.CERTIFIED:
        return negative
    if positive.verdict == negative.verdict is Verdict.REFUTED:
        # e <= 0 at one point and e >= 0 at the other, and a box is connected
        at = _between(e, positive.at, negative.at)
        return replace(negative, at=round_zero(e, at, ranges) or at)
    return replace(negative, verdict=Verdict.UNDECIDED)


def _between(e: Expression, low: dict[str, float], high: dict[str, float]) -> dict[str, float]:
    """A point near a zero of `e` on the segment between points where it is <= 0 and >= 0 (floats: only shown)."""
    names = tuple(high)
    tape = Tape([e], names)
    a, b = (np.array([at[name] for name in names]) for at in (low, high))
    for _ in range(60):
        middle = 0.5 * a + 0.5 * b
        value = tape.run_floats([np.array(x) for x in middle], ())[0]
        a, b = (middle, b) if value <= 0 else (a, middle)
    return dict(zip(names, (float(x) for x in b), strict=True))


def round_zero(e: Expression, at: dict[str, float], ranges: Mapping[str, Range]) -> dict[str, float] | None:
    """A decimal of few digits near the point where `e` is exactly zero, if there is one in the box."""
    return next((rounded for rounded in decimals(at, ranges) if vanishes(e, rounded)), None)


def decimals(at: dict[str, float], ranges: Mapping[str, Range]) -> Iterator[dict[str, float]]:
    """Decimals of few digits near a point, in the box."""
    for digits in (1, 3, 6):
        rounded = {name: round(value, digits) for name, value in at.items()}
        if all(ranges[v][0] <= Fraction(repr(value)) <= ranges[v][1] for v, value in rounded.items()):
            yield rounded


def vanishes(e: Expression, at: dict[str, float]) -> bool:
    """Whether `e` is zero, exactly, at the decimals that are shown for a point."""
    exact = {name: constant(Fraction(repr(value))) for name, value in at.items()}
    try:
        return substitute([e], exact)[0] is ZERO
    except ZeroDivisionError:  # a part of it is undefined there
        return False


TIME = "t"
_MINORS = 1_000  # of B that are looked at: there may be billions


@dataclass(frozen=True)
class ControlAffineModel:
    """xdot = f(x) + B(x)(u + h(t, x)) + E(x) w with dual metric W at a rate, all exact.

    Shapes: f (n,), B (n, m), W (n, n), h (m,). Derived matrices are built when asked for and shared. E (n, k) is empty
    where there is no wind; |w| <= `wind_bound` if that is one number, and |w'| <= `wind_rate` if that is known. Where
    `parameters` lie in ranges, the plant has `drift`, f(x, theta) (n,), in place of f, which the controller knows, and
    `gained`, B(x, theta) (n, m), in place of B, if that is not empty. `time`: the range of t in f(t, x), None if f is
    free of t. `outputs`: linear combinations of the states whose half-widths are told.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: tuple[Expression, ...]
    B: Matrix
    W: Matrix
    rate: Fraction
    h: tuple[Expression, ...] | None
    E: Matrix = ()
    wind_bound: Fraction | None = None
    wind_rate: Fraction | None = None
    drift: tuple[Expression, ...] = ()
    gained: Matrix = ()
    parameters: tuple[tuple[str, Range], ...] = ()
    time: Range | None = None
    outputs: tuple[Output, ...] = ()

    @cached_property
    def f_x(self) -> Matrix:
        """df/dx, (n, n)."""
        return jacobian(self.f, self.states)

    @cached_property
    def columns(self) -> Matrix:
        """The columns b_j of B, as rows (m, n)."""
        return transpose(self.B)

    @cached_property
    def constant_input(self) -> bool:
        """Whether B is a matrix of rational numbers."""
        return all(e.is_constant for row in self.B for e in row)

    @cached_property
    def B_x(self) -> list[Matrix]:
        """dB/dx_i for every state, each (n, m)."""
        return [differentiate(self.B, name) for name in self.states]

    @cached_property
    def b_x(self) -> list[Matrix]:
        """db_j/dx for every input, each (n, n)."""
        return [jacobian(column, self.states) for column in self.columns]

    @cached_property
    def gram(self) -> Matrix:
        """B'B, (m, m); its determinant is positive where B has full column rank."""
        return multiply(self.columns, self.B)

    @cached_property
    def B_pinv(self) -> Matrix:
        """B^+ = (B'B)^-1 B', (m, n)."""
        return divide(multiply(adjugate(self.gram), self.columns), determinant(self.gram))

    @cached_property
    def B_pinv_x(self) -> list[Matrix]:
        """dB^+/dx_i for every state, each (m, n)."""
        return [differentiate(self.B_pinv, name) for name in self.states]

    @cached_property
    def BBt(self) -> Matrix:
        """B B', (n, n)."""
        return multiply(self.B, self.columns)

    @cached_property
    def W_x(self) -> list[Matrix]:
        """dW/dx_i for every state, each (n, n)."""
        return [differentiate(self.W, name) for name in self.states]

    @cached_property
    def drift_form(self) -> Matrix:
        """-d_f W + f_x W + W f_x', (n, n): F without its rate term."""
        product = multiply(self.f_x, self.W)
        return combine(1, combine(1, product, 1, transpose(product)), -1, along(self.W, self.f, self.states))

    @cached_property
    def F(self) -> Matrix:
        """-d_f W + f_x W + W f_x' + 2 rate W, (n, n)."""
        return combine(1, self.drift_form, 2 * self.rate, self.W)

    @cached_property
    def annihilator(self) -> Matrix:
        """B_perp of a constant rational B, (n, n - m): columns spanning {v : B'v = 0}."""
        from tubecert.expression.matrix import constants

        basis = null_space([[e.fraction for e in column] for column in self.columns])
        return transpose(constants(basis)) if basis else ()

    def annihilator_by(self, rows: tuple[int, ...]) -> Matrix:
        """B_perp(x), (n, n - m), where m rows of B, given by their numbers, are independent; empty where m = n.

        With B_1 these rows and B_2 the others, v = (v_1, v_2) has B'v = 0 iff v_1 = -(B_2 B_1^-1)' v_2.
        """
        others = [i for i in range(len(self.states)) if i not in rows]
        if not others:
            return ()
        square = [self.B[i] for i in rows]
        solved = multiply([self.B[i] for i in others], adjugate(square))
        gain = divide(solved, determinant(square))  # B_2 B_1^-1, (n - m, m)
        own = dict(zip(rows, ([-e for e in column] for column in transpose(gain)), strict=True))
        free = dict(zip(others, identity(len(others)), strict=True))
        return tuple(tuple((own | free)[i]) for i in range(len(self.states)))

    @cached_property
    def projector(self) -> Matrix:
        """I - B B^+, (n, n): its columns span {v : B'v = 0}."""
        return combine(1, identity(len(self.states)), -1, multiply(self.B, self.B_pinv))

    def killing_defect(self, j: int) -> Matrix:
        """d_bj W - (b_j)_x W - W (b_j)_x', (n, n): zero where C3 holds for input j."""
        product = multiply(self.b_x[j], self.W)
        moved = along(self.W, self.columns[j], self.states)
        return combine(1, moved, -1, combine(1, product, 1, transpose(product)))

    @cached_property
    def pivots(self) -> tuple[list[tuple[int, ...]], bool]:
        """Choices of m rows of B that may be independent, and whether these are all there are."""
        rows = [i for i, row in enumerate(self.B) if any(e is not ZERO for e in row)]
        chosen = list(islice(combinations(rows, len(self.inputs)), _MINORS + 1))
        return chosen[:_MINORS], len(chosen) <= _MINORS

    def drift_on_plan(self) -> Matrix:
        """f(x) + B(x) u* as a column, with the input names standing for u*, (n, 1)."""
        u = [(symbol(name),) for name in self.inputs]
        return combine(1, [(e,) for e in self.f], 1, multiply(self.B, u))


def divide(a: Matrix, e: Expression) -> Matrix:
    """Every entry over `e`."""
    return tuple(tuple(x / e for x in row) for row in a)


def build(spec: Spec) -> ControlAffineModel:
    """The model of a specification; without a metric, W is empty."""
    metric = spec.metric
    h, wind = spec.uncertainty.h, spec.disturbance
    return ControlAffineModel(
        states=spec.states,
        inputs=spec.inputs,
        f=tuple(term.expression for term in spec.f),
        B=tuple(tuple(term.expression for term in row) for row in spec.B),
        W=tuple(tuple(term.expression for term in row) for row in metric.dual_metric) if metric else (),
        rate=metric.rate if metric else Fraction(0),
        h=None if h is None else tuple(term.expression for term in h),
        E=() if wind is None else tuple(tuple(term.expression for term in row) for row in wind.E),
        wind_bound=wind.bound if wind is not None and isinstance(wind.bound, Fraction) else None,
        wind_rate=None if wind is None else wind.rate,
        drift=tuple(term.expression for term in spec.drift),
        gained=tuple(tuple(term.expression for term in row) for row in spec.gained),
        parameters=spec.ranges,
        time=_time_of(spec),
        outputs=spec.outputs,
    )


def _time_of(spec: Spec) -> Range | None:
    """The times of f, None where it is free of t: the horizon, or one period of all that depends on t.

    The reader takes no f that has neither.
    """
    terms = spec.drift or spec.f
    if TIME not in free_symbols(part for term in terms for part in term.parts):
        return None
    if spec.trajectory.horizon is not None:
        return Fraction(0), spec.trajectory.horizon
    period = time_period(moving_parts(spec))
    if period is None:
        raise ValueError("f depends on t without a horizon or a period")
    return 0.0, float(period.hi)


def moving_parts(spec: Spec) -> list[Expression]:
    """What may depend on t for all time, h and f of the plant, and what must hold for them to be defined."""
    terms = [*(spec.uncertainty.h or ()), *(spec.drift or spec.f)]
    return [part for term in terms for part in term.parts]


def time_period(h: Iterable[Expression]) -> Interval | None:
    """An enclosure of a common period in t of expressions that depend on t through sin, cos, tan only.

    None if there is none to be seen; [0, 0] if t does not occur.
    """
    found = frequencies(h, TIME)
    if found is None:
        return None
    if not found.rational and not found.of_pi:
        return Interval.exact(0.0)
    if found.period is None:
        return Interval.exact(1.0)  # t occurs, as in sin((t + 1) - t), but changes nothing
    length, of_pi = found.period
    with np.errstate(over="ignore"):
        period = Interval.of(length) * (PI if of_pi else Interval.exact(1.0))
    return period if np.isfinite(period.hi) else None
