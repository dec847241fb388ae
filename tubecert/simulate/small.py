"""Small dense matrices in compiled loops: for them calling LAPACK would cost more than the work."""

from __future__ import annotations

from typing import Any

import numpy as np

from tubecert.simulate.compiled import compiled


@compiled
def factor(A: Any, L: Any) -> bool:
    """The lower Cholesky factor of A (n, n) into L; False if A is not positive definite (or not finite)."""
    n = A.shape[0]
    for j in range(n):
        total = A[j, j]
        for k in range(j):
            total -= L[j, k] * L[j, k]
        if not total > 0.0 or total == np.inf:
            return False
        pivot = np.sqrt(total)
        L[j, j] = pivot
        for i in range(j + 1, n):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / pivot
    return True


@compiled
def solve(L: Any, b: Any, x: Any) -> None:
    """x with L L' x = b; x may be b."""
    n = L.shape[0]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= L[k, i] * x[k]
        x[i] = total / L[i, i]


@compiled
def dot(a: Any, b: Any) -> float:
    """a'b."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@compiled
def copy(a: Any, b: Any) -> None:
    """Writes b into a. (For an assignment of slices numba also compiles the words of an error: four seconds.)"""
    for i in range(a.shape[0]):
        a[i] = b[i]


@compiled
def clip(s: Any, radius: float) -> None:
    """Moves s to the nearest point of the ball."""
    size = np.sqrt(dot(s, s))
    if size > radius:
        for i in range(s.shape[0]):
            s[i] *= radius / size
