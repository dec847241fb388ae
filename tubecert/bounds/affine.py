"""The norm of a vector over an ellipsoid, where it is affine in some of the states: these need no search.

With x_L the states in which v = g(x_N) + K x_L is affine, K constant, and x_N given, x_L ranges over an ellipsoid of
its own: x_L - x*_L = C (x_N - x*_N) + E s with |s| <= r, r^2 = rho^2 - |R (x_N - x*_N)|^2. So
    sup |v| = sup over x_N of max over |s| <= r of |w + H s|,  w = g + K (x*_L + C (x_N - x*_N)),  H = K E,
and for any a, b > 0 with a^2 + b^2 <= 1
    |w + H s| <= |[w/a, r H/b]|
because [w/a, r H/b] is applied to (a, b s/r). The best a gives equality (S-lemma). Trusted: yes.
Implements: theory 1a.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import sub

import numpy as np

from tubecert.coordinates import Coordinates, Rows, inverse, product, turned
from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import midrad, norm_bound, spectral_norm, spectral_norm_midrad
from tubecert.enclosure.objective import Estimate, Target, estimate_of
from tubecert.enclosure.outward import down, up
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO, Expression, constant, derivatives, substitute, symbol
from tubecert.expression.matrix import Matrix, column, is_positive_semidefinite
from tubecert.tube.sections import enclosed, factor

_LEAST_SHARE = 1e-6
_GIVEN = 1e-9  # of E, given away until E E' >= (S'S)_LL^-1 is proven
_ROUNDS = 12


@dataclass(frozen=True, slots=True)
class Split:
    """v = g + K x_L with K exact; `own` are the states N, `rest` the states L, by number."""

    own: list[int]
    rest: list[int]
    K: Rows


def split(v: Matrix, states: Sequence[str]) -> Split:
    """The states in which v is affine with constant coefficients, 0 among them; raises `ValueError` if all are 0."""
    slopes = [derivatives([row[0] for row in v], name) for name in states]
    rest = [i for i, slope in enumerate(slopes) if all(e.is_constant for e in slope)]
    K = tuple(tuple(slopes[i][k].fraction for i in rest) for k in range(len(v)))
    if not any(any(row) for row in K):
        raise ValueError("the vector is affine in no state")
    return Split(own=[i for i in range(len(states)) if i not in rest], rest=rest, K=K)


class NormOverRest:
    """|v| over |S (x - x*)| <= rho, as a function of the states N and of what else v contains.

    `centre` (n,) is x*(t), constant or by expressions; the half-widths of the states L are not used. Raises
    `ValueError` if v is affine in no state, or floats are too coarse for S.
    """

    def __init__(
        self, v: Matrix, names: Sequence[str], centre: Sequence[Expression], S: Coordinates, rho: float
    ) -> None:
        """Theory 1a.6: w, H = K E and r from S'S in exact arithmetic."""
        parts = split(v, names)
        own, rest = parts.own, parts.rest
        back = inverse(tuple(tuple(S.gram[i][j] for j in rest) for i in rest))
        E = _root_above(back)
        if E is None:
            raise ValueError("the ellipsoid is too thin for floats")
        C = product(back, tuple(tuple(-S.gram[i][j] for j in own) for i in rest))
        offset = [symbol(names[j]) - centre[j] for j in own]
        values = {
            names[i]: sum((constant(c) * y for c, y in zip(row, offset, strict=True) if c), start=centre[i])
            for i, row in zip(rest, C, strict=True)
        }
        self._rho, self._R = rho, factor(S, tuple(own))
        self._function = MatrixFunction(
            [column(substitute([row[0] for row in v], values)), column(offset or [ZERO])]
        )
        self.variables = self._function.variables
        self._H = midrad(enclosed(product(parts.K, E)))
        self._own, self._rest = [names[j] for j in own], [names[i] for i in rest]
        self._place = MatrixFunction([column([values[name] for name in self._rest])])
        self._E = np.array([[float(value) for value in row] for row in E])

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The bound at the vertices of the affine part, plus the rest, theory 1a.6."""
        del target
        e = self._function.expand(lo, hi)
        mid, rad, rest = e.mid[0], e.over_vertices(e.rad[0]), e.rest[0]
        least, r = self._radius(lo, hi)
        value = self._bound(mid, rad, r[:, None]) + e.over_vertices(norm_bound(rest.sum(axis=0)))
        caused = norm_bound(rest.max(axis=2)) + self._lost(hi - lo, r - least)
        # a sum over at most 80 variables, and another one, of bounds: below 90 u <= 1e-14 (Higham 2002, eq. 3.5)
        return estimate_of(value * (1 + 1e-14), caused, e, lo, hi)

    def _lost(self, width: Array, spread: Array) -> Array:
        """What each variable causes by letting r vary, (d, N); it only steers the search."""
        weight = np.zeros_like(width)
        for j, name in enumerate(self._own):
            weight[:, self.variables.index(name)] = (
                width[:, self.variables.index(name)] * np.abs(self._R.hi[:, j]).sum()
            )
        total = weight.sum(axis=1)
        share = weight / np.where(total > 0, total, 1.0)[:, None]
        return np.asarray((share * (spread * np.linalg.norm(self._H[0], 2))[:, None]).T)

    def _bound(self, mid: Array, rad: Array, r: Array) -> Array:
        """|[w/a, r H/b]| with a proposed a, (N, V), theory 1a.6."""
        H, H_rad = self._H
        size, length = np.linalg.norm(mid[..., 0], axis=-1), float(np.linalg.norm(H, 2))
        a = _share(mid[..., 0], H, r, size, length)[..., None, None]
        # a^2 + b^2 <= 1: below the root 3 roundings of at most 1, 3 u < 1e-15, then 2 u; 1 - a^2 is 1e-6 at least
        b = np.sqrt(1.0 - a * a - 1e-15) * (1 - 1e-15)
        wide = r[..., None, None] / b
        whole = np.concatenate([mid / a, wide * H], axis=-1)
        # a quotient, a quotient and a product are rounded: 3 u of themselves
        error = np.concatenate([rad / a, wide * H_rad], axis=-1) * (1 + 1e-14) + 1e-15 * np.abs(whole)
        return spectral_norm_midrad(whole, error).hi

    def lower(self, lo: Array, hi: Array) -> Array:
        """|w + H s| for the s that looks largest, theory 1a.6."""
        w = self._function.at(lo, hi)[0]
        s = self.largest(lo, hi)
        H = Interval(self._H[0] - self._H[1], self._H[0] + self._H[1])
        total = w[..., 0]
        for k in range(s.shape[1]):
            total = total + H[:, k] * Interval.exact(s[:, k, None])
        return np.asarray(spectral_norm(total[..., None]).lo * (1 - 1e-14))

    def largest(self, lo: Array, hi: Array) -> Array:
        """The s (N, k), |s| <= r at thin boxes, for which |w + H s| is largest, by iteration: a proposal within r."""
        w = self._function.at(lo, hi)[0].mid[..., 0]
        H, r = self._H[0], self._radius(lo, hi)[0][:, None] * (1 - 1e-9)
        s = np.broadcast_to(np.linalg.svd(H)[2][0], (len(w), H.shape[1])) * r
        s = s * np.where((w * (s @ H.T)).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        for _ in range(_ROUNDS):
            pull = (w + s @ H.T) @ H
            length = np.linalg.norm(pull, axis=1, keepdims=True)
            s = np.where(length > 0, r * pull / np.where(length > 0, length, 1.0), s)
        return np.asarray(s)

    def completed(self, at: Mapping[str, float]) -> dict[str, float]:
        """The states L at the point where the norm is largest, given the others."""
        point = np.array([[at[name] for name in self.variables]])
        middle = self._place.floats(np.array([[at[name] for name in self._place.variables]]))[0][0, :, 0]
        x = middle + self._E @ self.largest(point, point)[0]
        return dict(zip(self._rest, map(float, x), strict=True))

    def _radius(self, lo: Array, hi: Array) -> tuple[Array, Array]:
        """Bounds of r from below and from above, (N,): r of theory 1a.6."""
        y = self._function.at(lo, hi)[1][..., 0]
        square = Interval.exact(np.zeros(len(lo)))
        for row in range(self._R.shape[0]):
            total = Interval.exact(np.zeros(len(lo)))
            for j in range(self._R.shape[1]):
                total = total + self._R[row, j] * y[:, j]
            square = square + total**2
        room = Interval.exact(self._rho) ** 2 - square
        low, high = np.sqrt(np.maximum(room.lo, 0.0)), np.sqrt(np.maximum(room.hi, 0.0))
        return np.maximum(down(low), 0.0), up(high)


def _share(w: Array, H: Array, r: Array, size: Array, length: float) -> Array:
    """The a in (0, 1) for which the bound is least, about: a^2 = |w|/|w + H s| if H s is parallel to w; a proposal."""
    best = np.full(size.shape, 0.5)
    least = np.full(size.shape, np.inf)
    gram = H @ H.T
    along = np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", w, gram, w), 0.0)) / np.where(
        size > 0, size, 1.0
    )
    for push in (length, along, 0.5 * (along + length)):
        total = size + r * push
        for bend in (1.0, 0.5, 0.8, 1.25):
            a2 = np.clip(bend * size / np.where(total > 0, total, 1.0), _LEAST_SHARE, 1 - _LEAST_SHARE)
            S = w[..., :, None] * w[..., None, :] / a2[..., None, None]
            S = S + gram * (r**2 / (1 - a2))[..., None, None]
            value = np.linalg.eigvalsh(np.where(np.isfinite(S), S, 0.0))[..., -1]
            better = value < least
            best, least = np.where(better, np.sqrt(a2), best), np.where(better, value, least)
    return best


def _root_above(spread: Rows) -> Rows | None:
    """E of floats with E E' >= spread, decided in exact arithmetic; None if what is proposed is no such thing.

    Theory 1a.6.
    """
    block = np.array([[float(value) for value in row] for row in spread])
    scale = np.sqrt(np.diag(block))
    try:
        proposed = scale[:, None] * np.linalg.cholesky(block / np.outer(scale, scale)) * (1 + _GIVEN)
    except np.linalg.LinAlgError:
        return None
    E = tuple(tuple(Fraction(float(value)) for value in row) for row in proposed)
    square = product(E, turned(E))
    more = tuple(tuple(map(sub, own, known)) for own, known in zip(square, spread, strict=True))
    return E if is_positive_semidefinite(more) else None
