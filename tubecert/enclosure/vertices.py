"""Pencils (N, D) at the vertices of boxes: whether N < tau D holds at all of them, and a tau for which it does.

With a congruence T: if T (tau D - N) T' > 0, which a Cholesky factorisation decides, then T is regular and N < tau D. A
tau is proposed in floats from another one: with T (N - tau D) T' <= e I and T D T' between l I and g I, l > 0,
    N <= (tau + e/l) D if e >= 0,    N <= (tau + e/g) D if e <= 0.
In: matrices known to radii. Out: what is proven of tau. Trusted: yes, but for what is proposed.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import congruence_radius, exceeds, finite, norm_bound

_CLOSE = 0.5  # |T D T' - I| up to which Weyl's bound of its eigenvalues is good enough
_ROOM = 2.0**-50  # relative, of each of a proposal's summands
_MORE = (8.0, 64.0, 1e4, 1e6)  # times that room, where it was too little


@dataclass(frozen=True, slots=True)
class Balls:
    """Matrices of N boxes at V vertices, `mid` (N, V, n, n), known to `rad` at A ends: |mid| <= `size`, (N, A, n, n).

    Vertex v belongs to the end v mod A.
    """

    mid: Array
    size: Array
    rad: Array

    def __neg__(self) -> Balls:
        return Balls(-self.mid, self.size, self.rad)

    def within(self, t: Array) -> tuple[Array, Array]:
        """T S T' in floats, (N, V, n, n), and what S is off by there, (N, A, n, n), the same on both sides."""
        radius = congruence_radius(t, self.size, self.rad)
        return t @ self.mid @ np.swapaxes(t, -1, -2), np.maximum(radius, np.swapaxes(radius, -1, -2))


class Vertices:
    """Pencils of boxes at their vertices, in the frame T."""

    def __init__(self, t: Array, numerator: Balls, denominator: Balls) -> None:
        self.t = t
        self._top, self._top_radius = numerator.within(t)
        self._bottom, self._bottom_radius = denominator.within(t)

    def of(self, boxes: NDArray[np.intp]) -> Vertices:
        """Those of some boxes."""
        found = copy(self)
        for name, array in vars(self).items():
            setattr(found, name, array[boxes])
        return found

    def below(self, tau: Array) -> NDArray[np.bool_]:
        """In which boxes N < tau D is proven at every vertex; tau (N,).

        tau D - N: a product and a difference, 2 u of what `congruence_radius` has room for, 6 u and more.
        """
        difference = tau[:, None, None, None] * self._bottom - self._top
        return np.asarray(exceeds(difference, self._spread(tau[:, None])).all(axis=1))

    def proven(self, tau: Array, enough: float = np.inf) -> Array:
        """A number for each box, (N,), for which that is proven: tau with room for roundings, or `enough` where tau is.

        From a number that fails the next one is proposed; inf where all do.
        """
        wide = tau + self._room(tau)
        tried = np.where(tau <= enough, np.fmin(wide, enough), wide)
        found = np.where(self.below(tried), tried, np.inf)
        left = np.flatnonzero(np.isinf(found) & np.isfinite(tried))
        for more in _MORE:
            if not len(left):
                break
            own = self.of(left)
            tau = own.proposed(tried[left, None])[1].max(axis=1)
            tried[left] = tau + more * own._room(tau)
            found[left] = np.where(own.below(tried[left]), tried[left], np.inf)
            left = left[np.isinf(found[left]) & np.isfinite(tried[left])]
        return found

    def _room(self, tau: Array) -> Array:
        """What the roundings of a proposal and of its proof may come to, about, (N,)."""
        trace = np.abs(tau[:, None, None] * _diagonal(self._bottom) - _diagonal(self._top)).sum(axis=-1)
        return np.asarray(_ROOM * (np.abs(tau) + (self.t.shape[-1] + 3) * trace.max(axis=1)))

    def guess(self) -> Array:
        """The largest eigenvalue of T N T' in floats, (N, V)."""
        return spectrum(self._top)[..., -1]

    def proposed(self, tau: Array) -> tuple[Array, Array]:
        """(e, tau') in floats: T (N - tau D) T' <= e I and N <= tau' D, each (N, V); inf where nothing is known."""
        excess = spectrum(self._top - tau[..., None, None] * self._bottom)[..., -1] + self._spread(tau)
        least, greatest = self._range()
        above = tau + excess / np.where(excess > 0, least, greatest)
        known = (least > 0) & np.isfinite(above)
        return np.where(np.isnan(excess), np.inf, excess), np.where(known, above, np.inf)

    def _spread(self, tau: Array) -> Array:
        """How far off N - tau D is in the spectral norm, (N, V), 3 roundings in each entry; tau (N, 1) or (N, V)."""
        top, bottom = (_over_vertices(r, tau.shape[1]) for r in (self._top_radius, self._bottom_radius))
        radius = top + np.abs(tau)[..., None, None] * bottom
        return _over_vertices(norm_bound(radius * (1 + 1e-15)), self._top.shape[1])

    def _range(self) -> tuple[Array, Array]:
        """The least and the greatest eigenvalue of T D T' in floats, (N, V)."""
        off = np.abs(self._bottom - np.eye(self.t.shape[-1]))
        radius = _over_vertices(self._bottom_radius, self._bottom.shape[1])
        departure = norm_bound(off + radius)
        least, greatest = 1 - departure, 1 + departure
        far = ~(departure < _CLOSE)
        if far.any():
            values, more = spectrum(self._bottom[far]), norm_bound(radius[far])
            least[far], greatest[far] = values[..., 0] - more, values[..., -1] + more
        return least, greatest


def _over_vertices(by_end: Array, count: int) -> Array:
    """What is known at the ends, (N, A, ...), at so many vertices."""
    return np.tile(by_end, (1, max(1, count // by_end.shape[1]), *(1 for _ in by_end.shape[2:])))


def _diagonal(m: Array) -> Array:
    return np.diagonal(m, axis1=-2, axis2=-1)


def spectrum(m: Array) -> Array:
    """Eigenvalues of symmetric matrices (..., n, n) in floats, ascending, (..., n); NaN where one is not finite."""
    if m.shape[-1] == 1:
        return m[..., 0]
    known = finite(m)[..., None]
    return np.where(known, np.linalg.eigvalsh(np.where(known[..., None], m, 0.0)), np.nan)
