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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tubecert.claims import failures
from tubecert.expression import Expression, constant, substitute
from tubecert.expression.matrix import null_space
from tubecert.model import ControlAffineModel

Rows = NDArray[Any]  # of fractions
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
    Z = np.array(null_space(_reachable(A, B).T.tolist()), dtype=object)  # rows z with z [B, AB, ...] = 0
    if not len(Z):
        return None
    A_c = _restricted(A, Z)
    try:
        modes = np.linalg.eigvals(A_c.astype(float))
    except (OverflowError, np.linalg.LinAlgError):  # numbers beyond floats have no name for a report
        return None
    slowest = complex(modes[np.argmax(modes.real)])
    if not _limits(A_c, rate):
        return None
    rounded = [r for r in _near(-slowest.real) if r < rate and _limits(A_c, r)]
    return UncontrollableMode(at=point, mode=slowest, limit=min([rate, *rounded]))


def _limits(A_c: Rows, rate: Fraction) -> bool:
    """Whether some mode decays at most at this rate: no metric has a larger one. Exact."""
    return not is_hurwitz(A_c + rate * _eye(len(A_c)))


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
    parts = [model.f, [e for row in model.B for e in row], [e for row in model.f_x for e in row]]
    parts.append([e for rows in model.b_x for row in rows for e in row])
    try:
        exact = [_rational(substitute(part, values)) for part in parts]
    except ZeroDivisionError:
        return None
    if any(part is None for part in exact):
        return None
    f, B, slopes, b_x = exact
    B = B.reshape(n, m)
    u = _solved(B, -f)
    return None if u is None else (slopes.reshape(n, n) + np.tensordot(u, b_x.reshape(m, n, n), 1), B)


def _rational(entries: Sequence[Expression]) -> Any:
    return np.array([e.fraction for e in entries]) if all(e.is_constant for e in entries) else None


def _solved(B: Rows, right: Rows) -> Rows | None:
    """U with B u = right, None if there is none."""
    vectors = null_space(np.column_stack([B, -right]).tolist())
    chosen = next((v for v in vectors if v[-1] != 0), None)
    return None if chosen is None else np.array([q / chosen[-1] for q in chosen[:-1]])


def _reachable(A: Rows, B: Rows) -> Rows:
    """[B, AB, ..., A^(n-1) B], (n, n m)."""
    blocks = [B]
    for _ in range(len(A) - 1):
        blocks.append(A @ blocks[-1])
    return np.hstack(blocks)


def _restricted(A: Rows, Z: Rows) -> Rows:
    """A_c with Z A = A_c Z for rows Z that span a left-invariant space."""
    solved = [_solved(Z.T, row) for row in Z @ A]
    assert all(row is not None for row in solved), "the rows span an invariant space"
    return np.array(solved)


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
    coefficients, M = [Fraction(1)], _eye(len(A))
    for k in range(1, len(A) + 1):
        M = A @ M
        coefficients.append(-M.trace() / k)
        M = M + coefficients[-1] * _eye(len(A))
    return coefficients


def _eye(n: int) -> Rows:
    return np.array([[Fraction(int(i == j)) for j in range(n)] for i in range(n)])
