"""Families of dual metrics whose every member satisfies the Killing condition C3 exactly.

W(x) = E(x) (sum_k g_k(x) V_k) E(x)' with constant symmetric V_k. Its Lie derivative along b_j vanishes for every choice
of V_k if b_j(g_k) = 0 and the columns e_i of E commute with b_j, [b_j, e_i] = 0. For constant B, E is the identity. The
claim is proven again for the chosen member by `verify`; nothing here is trusted.
Implements: (CCM_3), on the coefficients.

In what coordinates the condition number of a metric is meant.

In the states' own units a condition number depends on the units: a speed in mm/s makes another metric the best. With
x = S z, S = diag(half-widths of the safe set), the metric in z is S^-1 W S^-1, and what is best there is best in
every unit. The columns of a frame and the functions of a family are scaled as well, so that all unknowns are of one
size. B B', which is a floor of W, is measured by its own size, and C2 by the rate that is asked for: so the unit of
time is gone, too.
Untrusted: W is proven in the states' own coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

import numpy as np

from tubecert.claims.failures import Failure, NoFrame, VariableForbidden
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression, cos, free_symbols, sin, symbol, topological
from tubecert.expression.matrix import Matrix, identity, multiply, null_space, transpose
from tubecert.model import ControlAffineModel
from tubecert.synthesis.frame import commuting_frame, pivot_frame
from tubecert.synthesis.lifting import products, unit_angles


class FamilyError(ValueError):
    """C3 leaves no family of the kind that was asked for."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.tag)
        self.failure = failure


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricFamily:
    """W(x) = E(x) (sum_k g_k(x) V_k) E(x)'; `functions`: g_k, g_0 = 1; `frame`: E, (n, n); V_k: symmetric (n, n).

    `variables` are the states, or combinations of states, on which V depends, in words; `degree` that of the g_k.
    """

    states: tuple[str, ...]
    functions: tuple[Expression, ...] = field(repr=False)
    frame: Matrix = field(repr=False)
    variables: tuple[str, ...]
    degree: int

    @property
    def flat(self) -> bool:
        """Whether the frame is the identity."""
        return self.frame == identity(len(self.states))

    def dual_metric(self, coefficients: Sequence[Sequence[Sequence[Fraction]]]) -> Matrix:
        """W for rational V_k, (K, n, n), exactly."""
        n = len(self.states)
        inner = [[ZERO] * n for _ in range(n)]
        for g, v in zip(self.functions, coefficients, strict=True):
            for i in range(n):
                for j in range(i, n):
                    inner[i][j] = inner[j][i] = inner[i][j] + v[i][j] * g
        if self.flat:
            return tuple(tuple(row) for row in inner)
        return _symmetric(multiply(self.frame, multiply(inner, transpose(self.frame))))


def metric_family(
    model: ControlAffineModel,
    *,
    degree: int,
    variables: Sequence[str] | None = None,
    safe_set: Sequence[tuple[Fraction, Fraction]] | None = None,
) -> MetricFamily:
    """The members of total degree <= `degree` in `variables` (default: all that C3 permits and the dynamics suggest).

    Raises `FamilyError` if C3 forbids that W depends on one of the variables, or no commuting frame was found.
    """
    permitted = invariants(model)
    chosen = _chosen(model, permitted, variables) if degree else {}
    frame = _frame(model, safe_set)
    if frame is None:
        raise FamilyError(NoFrame())
    generators = [g for form in chosen.values() for g in _generators(form, model)]
    return MetricFamily(
        states=model.states,
        functions=tuple(product for _, product in products(generators, degree)),
        frame=frame,
        variables=tuple(chosen),
        degree=degree if generators else 0,
    )


def _frame(model: ControlAffineModel, safe_set: Sequence[tuple[Fraction, Fraction]] | None) -> Matrix | None:
    """Fields that commute with the columns of B: in closed form where there is one, which is the smallest."""
    if model.constant_input:
        return identity(len(model.states))
    box = safe_set or [(Fraction(-1), Fraction(1))] * len(model.states)
    return pivot_frame(model, box) or commuting_frame(model)


def invariants(model: ControlAffineModel) -> dict[str, Expression]:
    """Linear forms of the states along which no input acts, by name: states first, combinations for constant B."""
    free = [name for name, row in zip(model.states, model.B, strict=True) if all(e is ZERO for e in row)]
    found = {name: symbol(name) for name in free}
    if not model.constant_input:
        return found
    rows = [[e.fraction for e in column] for column in model.columns]
    moved = [i for i, name in enumerate(model.states) if name not in found]
    if moved:
        for vector in null_space([[row[i] for i in moved] for row in rows]):
            form = sum((q * symbol(model.states[i]) for q, i in zip(vector, moved, strict=True)), start=ZERO)
            found[repr(form)] = form
    return found


def suggested(model: ControlAffineModel) -> dict[str, Expression]:
    """The invariants that involve a state on which f_x, or B, depends: others gain nothing to speak of."""
    matters = free_symbols(e for row in (*model.f_x, *model.B) for e in row)
    return {name: form for name, form in invariants(model).items() if free_symbols([form]) & matters}


def _chosen(
    model: ControlAffineModel, permitted: dict[str, Expression], variables: Sequence[str] | None
) -> dict[str, Expression]:
    if variables is None:
        return suggested(model)
    for name in variables:
        if name not in permitted:
            raise FamilyError(VariableForbidden(variable=name, permitted=tuple(permitted)))
    return {name: permitted[name] for name in variables}


def _generators(form: Expression, model: ControlAffineModel) -> list[Expression]:
    """The form itself; of an angle, its sine and cosine: the dynamics are polynomials in these."""
    entries = [*model.f, *(e for row in model.B for e in row)]
    angles = {node.args[0] for node in topological(entries) if node.op in ("sin", "cos", "tan")}
    if form.op == "symbol" and any(form in topological([angle]) for angle in angles):
        angle = unit_angles(entries).get(str(form.value), Fraction(1)) * form
        return [sin(angle), cos(angle)]
    return [form]


def _symmetric(a: Matrix) -> Matrix:
    """The upper triangle on both sides: products taken in another order are other nodes."""
    return tuple(tuple(a[min(i, j)][max(i, j)] for j in range(len(a))) for i in range(len(a)))


Choice = Literal["auto", "identity"]
_POINTS = 256  # of the safe set at which functions are looked at


@dataclass(frozen=True, slots=True)
class Coordinates:
    """`states` (n,): the diagonal of S; `columns` (n,): by what the columns of the frame are multiplied.

    `functions`: what the g_k (K,) are measured in; `input`: |S^-1 B|; `rate`: rates, in 1/s.
    """

    states: Array
    columns: Array
    functions: Array
    input: float = 1.0
    rate: float = 1.0

    @property
    def entries(self) -> Array:
        """What an unknown of the V_k stands for, (K, n, n)."""
        return np.asarray(np.outer(self.columns, self.columns) / self.functions[:, None, None])


def coordinates(
    choice: Choice,
    family: MetricFamily,
    safe_set: Sequence[tuple[Fraction, Fraction]],
    half_widths: Sequence[Fraction] = (),
) -> Coordinates:
    """S: half-widths (those of the safe set, if none are given), or ones."""
    if choice == "identity":
        return unscaled(family)
    half = half_widths or [(high - low) / 2 for low, high in safe_set]
    states = np.array([float(width) for width in half])
    functions = _sizes(functions_at(family, safe_set))
    if family.flat:
        return Coordinates(states, states, functions)
    columns = 1 / np.linalg.norm(_frame_at_centre(family, safe_set) / states[:, None], axis=0)
    return Coordinates(states, columns, functions)


def unscaled(family: MetricFamily) -> Coordinates:
    """The states' own units."""
    ones = np.ones(len(family.states))
    return Coordinates(ones, ones, np.ones(len(family.functions)))


def functions_at(family: MetricFamily, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Array:
    """The functions g_k at random points of the safe set, (P, K)."""
    ends = np.array([[float(low), float(high)] for low, high in safe_set])
    points = np.random.default_rng(7).uniform(ends[:, 0], ends[:, 1], (_POINTS, len(ends)))
    with np.errstate(all="ignore"):
        values = Tape(family.functions, family.states).run_floats(list(points.T), (_POINTS,)).T
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def _sizes(values: Array) -> Array:
    """Powers of two near the largest magnitudes (K,) of functions at points (P, K); 1 for what vanishes."""
    largest = np.abs(values).max(axis=0, initial=0.0)
    return np.asarray(2.0 ** np.rint(np.log2(np.where(largest > 0, largest, 1.0))))


def _frame_at_centre(family: MetricFamily, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Array:
    """The frame at the centre of the safe set, (n, n); the identity where it cannot be evaluated."""
    values = _at_centre(family.frame, family.states, safe_set)
    return values if (np.abs(values).max(axis=0) > 0).all() else np.eye(len(safe_set))


def input_size(
    model: ControlAffineModel, states: Array, safe_set: Sequence[tuple[Fraction, Fraction]]
) -> float:
    """|S^-1 B| at the centre of the safe set, S = diag(states); 1 where it is no positive number."""
    size = float(np.linalg.norm(_at_centre(model.B, model.states, safe_set) / states[:, None], 2))
    return size if 0 < size < np.inf else 1.0


def _at_centre(entries: Matrix, names: Sequence[str], safe_set: Sequence[tuple[Fraction, Fraction]]) -> Array:
    """A matrix of n rows at the centre of the safe set; 0 where it cannot be evaluated."""
    centre = np.array([[float((low + high) / 2)] for low, high in safe_set])
    with np.errstate(all="ignore"):
        tape = Tape([e for row in entries for e in row], names)
        values = np.asarray(tape.run_floats(list(centre), (1,)), dtype=float).reshape(len(entries), -1)
    return values if np.isfinite(values).all() else np.zeros_like(values)
