"""Families of dual metrics whose every member satisfies the Killing condition C3 exactly.

W(x) = E(x) (sum_k g_k(x) V_k) E(x)' with constant symmetric V_k. Its Lie derivative along b_j vanishes for every choice
of V_k if b_j(g_k) = 0 and the columns e_i of E commute with b_j, [b_j, e_i] = 0. For constant B, E is the identity. The
claim is proven again for the chosen member by `verify`; nothing here is trusted.
Implements: (CCM_3), on the coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations_with_replacement

from tubecert.claims.failures import Failure, NoFrame, VariableForbidden
from tubecert.expression import ONE, ZERO, Expression, cos, free_symbols, sin, symbol, topological
from tubecert.expression.matrix import Matrix, identity, multiply, null_space, transpose
from tubecert.model import ControlAffineModel
from tubecert.synthesis.frame import commuting_frame
from tubecert.synthesis.lifting import unit_angles
from tubecert.synthesis.pivot_frame import pivot_frame


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
        functions=_monomials(generators, degree),
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


def _monomials(generators: Sequence[Expression], degree: int) -> tuple[Expression, ...]:
    """All products of at most `degree` generators, 1 first, without squares of sines (sin^2 = 1 - cos^2)."""
    result = [ONE]
    for d in range(1, degree + 1):
        for choice in combinations_with_replacement(generators, d):
            if any(choice.count(g) > 1 for g in choice if g.op == "sin"):
                continue
            product = ONE
            for g in choice:
                product = product * g
            result.append(product)
    return tuple(result)


def _symmetric(a: Matrix) -> Matrix:
    """The upper triangle on both sides: products taken in another order are other nodes."""
    return tuple(tuple(a[min(i, j)][max(i, j)] for j in range(len(a))) for i in range(len(a)))
