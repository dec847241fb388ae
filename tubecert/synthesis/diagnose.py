"""Why there is no metric: modes of the linearisation that no input reaches bound the rate.

Where f(x) + B(x) u = 0, C3 makes the projected C2 that of the linear system (A, B), A = f_x + sum_j u_j (b_j)_x: its
uncontrollable modes are those of A_c, Z'A = A_c Z' with Z spanning the left null space of [B, AB, ..., A^(n-1) B]. For
p with A_c' p = s p, v = Z p has B'v = 0, and C2 in direction v says 2 (Re s + rate) v'Wv <= 0.
The point and A must be rational there: then A_c is exact, and Routh's test decides. Points where they are not are
passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, isfinite, log10

import numpy as np

from tubecert.claims import failures
from tubecert.expression import Expression, constant, substitute
from tubecert.expression.matrix import null_space
from tubecert.model import ControlAffineModel

Rows = list[list[Fraction]]
_REAL = 1e-9  # imaginary parts below it are rounding errors
_DIGITS = (12, 6, 4, 3, 2)  # of a bound that is tried: repeated modes are known to few


@dataclass(frozen=True, slots=True, kw_only=True)
class UncontrollableMode:
    """A mode s of the linearisation at a (forced) equilibrium that no input reaches: no metric has a rate above -Re s.

    `limit` is -Re s rounded up, or the rate that was asked for if that is all that is known: that no metric has a rate
    above it is proven in rational arithmetic. The mode itself is rounded.
    """

    at: tuple[Fraction, ...]
    mode: complex
    limit: Fraction

    @property
    def bound(self) -> float:
        """The rate that it allows, in 1/s."""
        return float(self.limit)

    def excludes(self, rate: Fraction) -> bool:
        """Whether no metric has this rate; at the limit itself C2 may hold, with nothing to spare for a proof."""
        return rate > self.limit

    def failure(self) -> failures.UncontrollableMode:
        """It as the reason why there is no metric; six digits of the mode, which is known roughly."""
        imaginary = abs(self.mode.imag) if abs(self.mode.imag) > _REAL else 0.0
        return failures.UncontrollableMode(
            mode=(float(f"{self.mode.real:.6g}"), float(f"{imaginary:.6g}")), limit=self.limit
        )


def uncontrollable_mode(
    model: ControlAffineModel, points: Sequence[Sequence[Fraction]], rate: Fraction
) -> UncontrollableMode | None:
    """The mode that leaves nothing above `rate`, at one of the points that are exact (forced) equilibria, if any."""
    worst: UncontrollableMode | None = None
    for point in points:
        mode = _at(model, tuple(point), rate)
        if mode is not None and (worst is None or mode.limit < worst.limit):
            worst = mode
    return worst


def _at(model: ControlAffineModel, point: tuple[Fraction, ...], rate: Fraction) -> UncontrollableMode | None:
    values = {name: constant(q) for name, q in zip(model.states, point, strict=True)}
    exact = _linearised(model, values)
    if exact is None:
        return None
    A, B = exact
    Z = null_space(_transposed(_reachable(A, B)))  # rows z with z [B, AB, ...] = 0
    if not Z:
        return None
    A_c = _restricted(A, Z)
    try:
        modes = np.linalg.eigvals(np.array([[float(q) for q in row] for row in A_c]))
    except (OverflowError, np.linalg.LinAlgError):  # numbers beyond floats have no name for a report
        return None
    slowest = complex(modes[np.argmax(modes.real)])
    if not _limits(A_c, rate):
        return None
    rounded = [r for r in _near(-slowest.real) if r < rate and _limits(A_c, r)]
    return UncontrollableMode(at=point, mode=slowest, limit=min([rate, *rounded]))


def _limits(A_c: Rows, rate: Fraction) -> bool:
    """Whether some mode decays at most at this rate: no metric has a larger one. Exact."""
    return not is_hurwitz(
        [[q + (rate if i == j else 0) for j, q in enumerate(row)] for i, row in enumerate(A_c)]
    )


def _near(value: float) -> list[Fraction]:
    """Decimals at or slightly above a number that is known roughly."""
    if not isfinite(value):
        return []
    found = [Fraction(0)]
    for digits in _DIGITS:
        unit = Fraction(10) ** (floor(log10(abs(value) or 1.0)) - digits + 1)
        found += [round(Fraction(value) / unit) * unit, ceil(Fraction(value) / unit) * unit]
    return found


def _linearised(model: ControlAffineModel, values: dict[str, Expression]) -> tuple[Rows, Rows] | None:
    """(A, B) with the forcing input put in, if the point is an equilibrium and everything is rational there."""
    n, m = len(model.states), len(model.inputs)
    try:
        f = _rational(substitute(model.f, values))
        B = _rational(substitute([e for row in model.B for e in row], values))
        slopes = _rational(substitute([e for row in model.f_x for e in row], values))
        b_x = _rational(substitute([e for rows in model.b_x for row in rows for e in row], values))
    except ZeroDivisionError:
        return None
    if f is None or B is None or slopes is None or b_x is None:
        return None
    table = [B[i * m : (i + 1) * m] for i in range(n)]
    u = _solved(table, [-q for q in f])
    if u is None:
        return None
    A = [slopes[i * n : (i + 1) * n] for i in range(n)]
    for j in range(m):
        for i in range(n):
            for k in range(n):
                A[i][k] += u[j] * b_x[(j * n + i) * n + k]
    return A, table


def _rational(entries: Sequence[Expression]) -> list[Fraction] | None:
    if not all(e.is_constant for e in entries):
        return None
    return [e.fraction for e in entries]


def _solved(B: Rows, right: list[Fraction]) -> list[Fraction] | None:
    """U with B u = right, None if there is none."""
    vectors = null_space([[*row, -q] for row, q in zip(B, right, strict=True)])
    chosen = next((v for v in vectors if v[-1] != 0), None)
    return None if chosen is None else [q / chosen[-1] for q in chosen[:-1]]


def _reachable(A: Rows, B: Rows) -> Rows:
    """[B, AB, ..., A^(n-1) B], (n, n m)."""
    blocks = [B]
    for _ in range(len(A) - 1):
        blocks.append(_product(A, blocks[-1]))
    return [[q for block in blocks for q in block[i]] for i in range(len(A))]


def _restricted(A: Rows, Z: Rows) -> Rows:
    """A_c with Z A = A_c Z for rows Z that span a left-invariant space."""
    image = _product(Z, A)
    result = []
    for row in image:
        solved = _solved(_transposed(Z), row)
        assert solved is not None, "the rows span an invariant space"
        result.append(solved)
    return result


def is_hurwitz(A: Rows) -> bool:
    """Whether every eigenvalue has a negative real part: Routh's array is full and positive; exact."""
    p = _characteristic(A)  # highest power first, p[0] = 1
    upper, lower = p[0::2], p[1::2]
    rows = 1
    while lower:
        if lower[0] <= 0:
            return False
        rows += 1
        padded = lower + [Fraction(0)] * (len(upper) - len(lower))
        following = [upper[i + 1] - upper[0] * padded[i + 1] / lower[0] for i in range(len(upper) - 1)]
        while following and following[-1] == 0:
            following.pop()
        upper, lower = lower, following
    return rows == len(p)


def _characteristic(A: Rows) -> list[Fraction]:
    """Coefficients of det(s I - A), highest power first (Faddeev and LeVerrier)."""
    n = len(A)
    coefficients = [Fraction(1)]
    M = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
    for k in range(1, n + 1):
        AM = _product(A, M)
        c = -sum((AM[i][i] for i in range(n)), start=Fraction(0)) / k
        coefficients.append(c)
        M = [[q + (c if i == j else 0) for j, q in enumerate(row)] for i, row in enumerate(AM)]
    return coefficients


def _product(a: Rows, b: Rows) -> Rows:
    return [
        [
            sum((p * q for p, q in zip(row, column, strict=True)), start=Fraction(0))
            for column in zip(*b, strict=True)
        ]
        for row in a
    ]


def _transposed(a: Rows) -> Rows:
    return [list(row) for row in zip(*a, strict=True)]
