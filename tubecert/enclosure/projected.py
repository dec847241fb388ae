"""The pencil (N(x), D(x)) on the null space of B(x)': what C2 is about when B depends on the state.

Above, Finsler's lemma: N - s B B' <= tau D for some s >= 0 gives v'Nv <= tau v'Dv for all v with B'v = 0; s may differ
from box to box, and is only proposed in floats. Below: a Rayleigh quotient of a vector proven to lie in the null space.
"""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import exceeds, finite, midrad, norm_bound, product, whitening
from tubecert.enclosure.objective import Estimate, Target
from tubecert.enclosure.taylor import Matrix, MatrixFunction
from tubecert.enclosure.vertices import Balls, spectrum


class ProjectedPencil:
    """sup over x of the least tau with v'N v <= tau v'D v whenever B'v = 0; D > 0, B of full column rank `inputs`.

    `BBt` is B B', `projector` a matrix whose columns lie in the null space of B' (such as I - B B^+).
    """

    def __init__(
        self, numerator: Matrix, denominator: Matrix, BBt: Matrix, projector: Matrix, *, inputs: int
    ) -> None:
        self._function = MatrixFunction([numerator, denominator, BBt])
        self._projector = MatrixFunction([projector])
        self._inputs = inputs
        self.variables = tuple(sorted({*self._function.variables, *self._projector.variables}))

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """`target` where Finsler's condition is proven over the box, inf elsewhere."""
        tau = target.enough
        own = [self.variables.index(v) for v in self._function.variables]
        e = self._function.expand(lo[:, own], hi[:, own])
        centre = [mid.mean(axis=1) for mid in e.mid]
        t = whitening(centre[1])[:, None]
        s = _multiplier(centre, tau, self._inputs)[:, None, None, None]
        mid = e.mid[0] - tau * e.mid[1] - s * e.mid[2]
        size, rad = (of[0] + abs(tau) * of[1] + s * of[2] for of in (e.size, [e.filled(k) for k in range(3)]))
        # mid: two products, two differences, 4 u of `size` (itself short by 4 u); 1e-15 > 9 u. Radii as in `pencil`
        rad = rad * (1 + 1e-14) + 1e-15 * size
        scaled, off = Balls(mid, size * (1 + 1e-15), rad).within(t)
        spread = e.over_vertices(norm_bound(off))
        proven = exceeds(-scaled, spread).all(axis=1)
        excess = spectrum(scaled)[..., -1] + spread
        worst = np.argmax(np.where(np.isnan(excess), -np.inf, excess), axis=1)
        signs = np.zeros(lo.shape)
        signs[:, own] = e.signs[worst]
        corner = np.where(signs > 0, hi, np.where(signs < 0, lo, 0.5 * (lo + hi)))
        caused = np.zeros(lo.shape)
        abs_t = np.abs(t)
        for k, weight in ((0, 1.0), (1, abs(tau)), (2, s[..., 0, 0])):
            scaled = abs_t @ e.rest[k] @ np.swapaxes(abs_t, -1, -2)
            caused[:, own] += (weight * scaled.sum(axis=(-2, -1))).max(axis=2).T
        caused = np.where(np.isfinite(caused), caused, np.finfo(float).max)
        return Estimate(np.where(proven, tau, np.inf), corner, caused, caused)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Rayleigh quotients of proposed vectors, projected onto the null space with intervals."""
        own = [self.variables.index(v) for v in self._function.variables]
        needed = [self.variables.index(v) for v in self._projector.variables]
        N, D, _ = (midrad(g) for g in self._function.at(lo[:, own], hi[:, own]))
        P = midrad(self._projector.at(lo[:, needed], hi[:, needed])[0])
        best = np.full(len(lo), -np.inf)
        Pt = np.swapaxes(P[0], -1, -2)
        reduced = Pt @ N[0] @ P[0]
        weight = Pt @ D[0] @ P[0]
        rank = P[0].shape[-1]
        frame = whitening(weight + 1e-9 * np.trace(weight, axis1=-2, axis2=-1)[:, None, None] * np.eye(rank))
        scaled = frame @ reduced @ np.swapaxes(frame, -1, -2)
        ok = finite(scaled)
        _, vectors = np.linalg.eigh(np.where(ok[:, None, None], scaled, 0.0))
        for k in range(rank):  # some of these belong to the range of B' and project to nothing
            y = np.einsum("nji,nj->ni", frame, vectors[..., k])[..., None]
            v = product(P, (y, np.zeros_like(y)))
            vt = np.swapaxes(v[0], -1, -2), np.swapaxes(v[1], -1, -2)
            top, bottom = (product(vt, product(S, v)) for S in (N, D))
            quotient = _interval(top) / _interval(bottom)
            best = np.fmax(best, np.where(np.isnan(quotient.lo) | ~ok, -np.inf, quotient.lo))
        return best


def _interval(scalar: tuple[Array, Array]) -> Interval:
    mid, rad = scalar[0][..., 0, 0], scalar[1][..., 0, 0]
    return Interval(np.nextafter(mid - rad, -np.inf), np.nextafter(mid + rad, np.inf))


def _multiplier(centre: list[Array], target: float, inputs: int) -> Array:
    """A proposal for s: with R, N bases of the range and null space, the Schur complement of N - s B B' - tau D.

    The mean of a box's vertices is not quite of the rank of B: its largest eigenvalues are taken for the range.
    """
    t = whitening(centre[1])
    tt = np.swapaxes(t, -1, -2)
    form, gram = t @ centre[0] @ tt - target * np.eye(t.shape[-1]), t @ centre[2] @ tt
    ok = finite(form) & finite(gram)
    form, gram = np.where(ok[:, None, None], form, 0.0), np.where(ok[:, None, None], gram, 0.0)
    d, v = np.linalg.eigh(gram)
    form = np.swapaxes(v, -1, -2) @ form @ v
    result = np.zeros(len(form))
    for row in range(len(form)):
        in_range = np.arange(len(d[row])) >= len(d[row]) - inputs
        null = form[row][np.ix_(~in_range, ~in_range)]
        mixed = form[row][np.ix_(~in_range, in_range)]
        own = form[row][np.ix_(in_range, in_range)]
        room = max(-np.linalg.eigvalsh(null)[-1], 1e-12) if null.size else 1.0
        needed = (
            2 * np.linalg.norm(mixed) ** 2 / room + max(0.0, np.linalg.eigvalsh(own)[-1]) if own.size else 0.0
        )
        result[row] = 1.1 * needed / max(d[row][in_range].min(initial=1.0), 1e-300)
    return result
