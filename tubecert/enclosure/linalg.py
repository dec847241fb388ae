"""Verified linear algebra for batches of small interval matrices.

LAPACK only proposes a decomposition; its residual is then bounded from above with a-priori rounding bounds, so the
results hold whatever LAPACK returned. Symmetric matrices: with S = V D V' + E and |V'V - I| <= delta < 1, Ostrowski's
and Weyl's theorems give |lambda_k(S) - d_k| <= delta |d_k| + |E|; singular values likewise. Where only a sign is asked
for, a Cholesky factorisation answers that is done here, operation by operation: nothing of LAPACK is in it.
References: S. M. Rump, Verification methods: rigorous results using floating-point arithmetic, Acta Numerica 2010;
Verification of positive definiteness, BIT 46, 2006.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval

_UNIT: Final = 2.0**-53
_TINY: Final = 1e-300  # covers underflow in products
_LOST: Final = 1e-320  # covers underflow of a rounding error that is scaled afterwards
_ROOT_TINY: Final = 1e-150  # covers underflow below a square root
_STEP: Final = 16  # powers of two by which a congruence proposed in floats scales a row
_LANES: Final = 4096  # matrices that are factorised at once: as many as a processor keeps at hand


def finite(m: Array) -> NDArray[np.bool_]:
    """Which matrices of a batch have finite entries only."""
    return np.asarray(np.isfinite(m).all(axis=(-2, -1)))


def _gamma(k: int) -> float:
    """More than twice the bound k u/(1 - k u) of k roundings (Higham 2002, lemma 3.1): bounds of sums are sums, too."""
    return 4 * (k + 2) * _UNIT


def _frobenius(m: Array) -> Array:
    """An upper bound of the Frobenius norm, shape (...,): k squares and their sum (Higham 2002, eq. 3.5)."""
    k = m.shape[-1] * m.shape[-2]
    return np.asarray(np.sqrt(np.sum(m * m, axis=(-2, -1))) * (1 + _gamma(k)) + _ROOT_TINY)


def _lanes(m: Array) -> Array:
    """Matrices (..., p, q) as (p, q, M), a copy: what is done entry by entry is done to all of them at once."""
    p, q = m.shape[-2:]
    return np.array(m.reshape(-1, p * q).T, order="C").reshape(p, q, -1)


def norm_bound(m: Array) -> Array:
    """An upper bound of the spectral norm of any matrix between -m and m elementwise (m >= 0), shape (...,)."""
    p, q = m.shape[-2:]
    lanes = _lanes(m)
    rows, columns = lanes.sum(axis=1).max(axis=0), lanes.sum(axis=0).max(axis=0)
    mixed = np.sqrt(rows * columns) * (1 + _gamma(max(p, q))) + _ROOT_TINY
    whole = np.sqrt((lanes * lanes).sum(axis=(0, 1))) * (1 + _gamma(p * q)) + _ROOT_TINY  # as in `_frobenius`
    return np.asarray(np.minimum(whole, mixed)).reshape(m.shape[:-2])


def midrad(s: Interval) -> tuple[Array, Array]:
    """Midpoint and covering radius of an interval array; either difference is rounded by u of itself, 4 u > u."""
    mid = s.mid
    return mid, np.maximum(s.hi - mid, mid - s.lo) * (1 + 4 * _UNIT) + _TINY


def congruence(t: Array, mid: Array, rad: Array) -> tuple[Array, Array]:
    """Midpoint and radius of T S T' for all S in mid +- rad; shapes broadcast over leading axes."""
    return t @ mid @ np.swapaxes(t, -1, -2), congruence_radius(t, np.abs(mid), rad)


def congruence_radius(t: Array, size: Array, rad: Array) -> Array:
    """What T S T' is at most, entry by entry, off `t @ mid @ t'` for all S in mid +- rad, where |mid| <= size.

    Of a product of matrices with k columns each entry is off by gamma_k |A||B| (Higham 2002, eq. 3.13), here twice.
    """
    abs_t = np.abs(t)
    error = _gamma(2 * t.shape[-1]) * size + rad * (1 + _gamma(2 * t.shape[-1]))
    # a product that underflows in the first factor is multiplied by entries of the second: rows of T count
    lost = _TINY * (1 + abs_t.sum(axis=-1)[..., None, :])
    return np.asarray(
        abs_t @ (error + _LOST) @ np.swapaxes(abs_t, -1, -2) * (1 + _gamma(2 * t.shape[-1])) + lost
    )


def product(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
    """Midpoint and radius of A B for all A, B within their midpoints and radii (Rump 2010; Higham 2002, eq. 3.13)."""
    (m, r), (n, s) = a, b
    slack = _gamma(m.shape[-1])
    error = np.abs(m) @ s + r @ (np.abs(n) + s) + slack * (np.abs(m) @ np.abs(n))
    return m @ n, error * (1 + 2 * slack) + _TINY


def _departure(v: Array) -> Array:
    """An upper bound of |V'V - I|, with the rounding of V'V (Higham 2002, eq. 3.13)."""
    n = v.shape[-1]
    gram = np.swapaxes(v, -1, -2) @ v
    return _frobenius(gram - np.eye(n)) + _gamma(v.shape[-2]) * (_frobenius(v) ** 2 + 1)


def _product_error(left: Array, d: Array, right: Array, mid: Array) -> Array:
    """A bound of all roundings in mid - left diag(d) right', by norms."""
    k = left.shape[-1] + 2
    scale = np.max(np.abs(d), axis=-1) * _frobenius(left) * _frobenius(right) + _frobenius(mid)
    return np.asarray(_gamma(2 * k) * scale + _TINY)


def eigenvalues_midrad(mid: Array, rad: Array) -> Interval:
    """Every eigenvalue of every symmetric matrix within mid +- rad, ascending; shape (..., n).

    By Weyl's and Ostrowski's theorems, as the head of this file says.
    """
    if mid.shape[-1] == 1:
        return Interval(
            np.nextafter((mid - rad)[..., 0], -np.inf), np.nextafter((mid + rad)[..., 0], np.inf)
        ).sanitised()
    # may move a midpoint by a rounding: covered by _product_error
    mid = 0.5 * (mid + np.swapaxes(mid, -1, -2))
    bad = ~(finite(mid) & finite(rad))
    safe = np.where(bad[..., None, None], np.eye(mid.shape[-1]), mid)
    d, v = np.linalg.eigh(safe)
    residual = safe - (v * d[..., None, :]) @ np.swapaxes(v, -1, -2)
    error = _frobenius(residual) + _product_error(v, d, v, safe) + norm_bound(rad)
    delta = _departure(v)
    radius = (delta[..., None] * np.abs(d) + error[..., None]) * (1 + _gamma(4))
    radius = np.where((bad | ~(delta < 1))[..., None], np.inf, radius)
    # the k-th eigenvalue belongs to the k-th smallest d, in whatever order they were given
    order = np.argsort(d, axis=-1)
    d, radius = np.take_along_axis(d, order, axis=-1), np.take_along_axis(radius, order, axis=-1)
    return Interval(np.nextafter(d - radius, -np.inf), np.nextafter(d + radius, np.inf)).sanitised()


def exceeds(s: Array, least: Array) -> NDArray[np.bool_]:
    """For which symmetric matrices (..., n, n) of floats, read below the diagonal, S > least I is proven; least >= 0.

    With b_ii = s_ii - c, rounded, let the factorisation of B, S with this diagonal, come to its end with positive
    pivots. In whatever order it is summed, its factor L has L L' = B + E with |E| <= g |L||L|', g = gamma_(n+1), entry
    by entry (Higham 2002, theorem 10.3). In the spectral norm, |E| <= g |L|_F^2, and this square is the trace of L L',
    at most tr B + g |L|_F^2: |E| <= g/(1 - g) tr B. No b_ii exceeds s_ii, and it is off by u of itself, so that
    S > (c - (g/(1 - g) + u) tr S) I (Rump 2006). Here c is `least` + 4 (n + 3) u tr |S|: more than twice what is
    needed, with the roundings of the trace and of c, which is below every s_ii. What underflows is off by 2^-1075 in
    a product, by that times a root of tr S in a quotient: the first is below `_TINY`, the second below what is left
    of the trace.

    Every entry goes into a pivot: one that is NaN makes it NaN, which is not positive; so does an infinite trace, or
    it makes it -inf, as an infinite entry beside the diagonal does. Each operation is one of numpy's, rounded by
    itself; fused, or rounded twice, it is off by less than the two u for which there is room.
    """
    flat, above = s.reshape(-1, *s.shape[-2:]), np.broadcast_to(least, s.shape[:-2]).reshape(-1)
    found = np.empty(len(flat), dtype=bool)
    for start in range(0, len(flat), _LANES):
        part = slice(start, start + _LANES)
        with np.errstate(all="ignore"):  # a pivot that is not positive has no root
            found[part] = _factorised(_lanes(flat[part]), above[part])
    return found.reshape(s.shape[:-2])


def _factorised(left: Array, least: Array) -> NDArray[np.bool_]:
    """Whether all pivots of S - c I are positive, as `exceeds` says; `left` (n, n, M) is overwritten."""
    n = len(left)
    shift = least + (_gamma(n + 1) * np.sum([np.abs(left[i, i]) for i in range(n)], axis=0) + _TINY)
    left[range(n), range(n)] -= shift
    found = np.ones(len(shift), dtype=bool)
    for j in range(n):
        found &= left[j, j] > 0
        column = left[j + 1 :, j] / np.sqrt(left[j, j])
        left[j + 1 :, j + 1 :] -= column[:, None] * column
    return found


def spectral_norm_midrad(mid: Array, rad: Array) -> Interval:
    """The largest singular value of every matrix within mid +- rad (..., p, q); shape (...,).

    By Weyl's and Ostrowski's theorems, as the head of this file says.
    """
    p, q = mid.shape[-2:]
    bad = ~(finite(mid) & finite(rad))
    safe = np.where(bad[..., None, None], 0.0, mid)
    if min(p, q) == 1:
        exact = np.sqrt(np.sum(safe * safe, axis=(-2, -1)))
        radius = exact * _gamma(p * q) + _frobenius(np.where(bad[..., None, None], 0.0, rad)) + _ROOT_TINY
        lo, hi = exact - radius, exact + radius
    else:
        u, s, vt = np.linalg.svd(safe, full_matrices=False)
        v = np.swapaxes(vt, -1, -2)
        residual = safe - (u * s[..., None, :]) @ vt
        spread = norm_bound(np.where(bad[..., None, None], 0.0, rad))
        error = _frobenius(residual) + _product_error(u, s, v, safe) + spread
        delta = np.maximum(_departure(u), _departure(v))
        top = np.max(np.abs(s), axis=-1)  # whatever the order and the signs given
        radius = (top * delta + error) * (1 + _gamma(4))
        bad = bad | ~(delta < 1)
        lo, hi = top - radius, top + radius
    bad = bad | np.isnan(lo) | np.isnan(hi)
    lo = np.where(bad, 0.0, np.maximum(np.nextafter(lo, -np.inf), 0.0))
    return Interval(lo, np.where(bad, np.inf, np.nextafter(hi, np.inf)))


def spectral_norm(g: Interval) -> Interval:
    """Enclosures of the spectral norms of batches of interval matrices (..., p, q)."""
    return spectral_norm_midrad(*midrad(g))


def quadratic_form(v: Array, mid: Array, rad: Array) -> Interval:
    """v' S v for all S in mid +- rad; `v` has shape (..., n)."""
    n = v.shape[-1]
    value = np.einsum("...i,...ij,...j->...", v, mid, v)
    w = np.abs(v)
    error = rad * (1 + _gamma(2 * n)) + _gamma(2 * n * n) * np.abs(mid) + _LOST
    spread = np.einsum("...i,...ij,...j->...", w, error, w)
    radius = spread * (1 + _gamma(2 * n * n)) + _TINY * (1 + w.sum(axis=-1))  # underflow, as in `congruence`
    return Interval(np.nextafter(value - radius, -np.inf), np.nextafter(value + radius, np.inf))


def whitening(mid: Array) -> Array:
    """Floats T with T S T' close to the identity: a proposal, nothing is proven; I where S is not positive.

    Whatever the units: S is scaled first to a diagonal near 1, by powers of two, in steps that leave it as it is where
    units are alike.
    """
    n = mid.shape[-1]
    bad = ~finite(mid)
    safe = np.where(bad[..., None, None], np.eye(n), mid)
    diagonal = np.abs(np.einsum("...ii->...i", safe))
    scale = 2.0 ** (-_STEP * np.rint(np.log2(np.where(diagonal > 0, diagonal, 1.0)) / (2 * _STEP)))
    d, v = np.linalg.eigh(scale[..., :, None] * safe * scale[..., None, :])
    ok = ~bad & (d[..., 0] > 1e-14 * np.abs(d[..., -1]))  # the eigenvectors of I may come with either sign
    root = np.where(ok[..., None], 1 / np.sqrt(np.where(d > 0, d, 1.0)), 1.0)
    t = root[..., :, None] * np.swapaxes(v, -1, -2) * scale[..., None, :]
    return np.where(ok[..., None, None], t, np.eye(n))
