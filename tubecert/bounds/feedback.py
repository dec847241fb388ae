"""The feedback gain du: the weights of its exact search over mu, and a closed form that needs no such search.

2 |B~ v| |v| = min over mu of |B~ v|^2/mu + mu |v|^2 makes du the supremum over (x, mu) of the pencil
(F, B B'/mu + mu W). Over a range of mu in which its ends are close, the denominator lies above its tangent at the
middle, which is affine in mu, so that the two ends suffice. Over a range down to 0, in coordinates in which
B B' = diag(I, 0), a congruence by powers of mu leaves something that is bounded by its two ends as well (theory 2.1).

The closed form: in coordinates in which W is near the identity, v = R r + N n with R, N bases of range(B~') and
null(B~); where v'F~v <= 0 on the null space (C2, certified before),
v'F~v <= |r| |v| sqrt(4 |N'F~R|^2 + max(0, lmax(R'F~R))^2), so
    du <= sqrt(|N'F~R|^2 + max(0, lmax(R'F~R))^2/4)/smin(B~).
It is up to ten times the exact constant for several inputs, and a fallback where the exact search runs out of boxes.
Implements: theory section 2, feedback gain, closed form.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import eigenvalues_midrad, midrad, product, spectral_norm_midrad, whitening
from tubecert.enclosure.objective import Estimate, Objective, Target
from tubecert.enclosure.pencil import FirstFinite, WeightedPencil, Weights
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ONE, ZERO
from tubecert.expression.matrix import Matrix, determinant, multiply, transpose
from tubecert.model import ControlAffineModel

Ball = tuple[Array, Array]  # midpoints and radii of matrices
MU = "mu#"  # no state can have this name
_WIDE = 4.0  # hi/lo of a range over which the tangent is worse than the values at the ends


def exact_gain(model: ControlAffineModel, largest: float) -> Objective:
    """du as a supremum over x and mu in (0, largest]; C2 must hold at the model's rate, theory 2.1."""
    loss = partial(_loss, largest=largest)
    exact = WeightedPencil(
        [model.F], [model.BBt, model.W], Weights(variables=(MU,), ends=tangents, loss=loss)
    )
    null = model.annihilator if model.constant_input else _moving_annihilator(model)
    if not null:
        return exact
    n, m = len(model.states), len(model.inputs)
    basis = tuple((*r, *c) for r, c in zip(transpose(model.B_pinv), null, strict=True))
    F, W = (multiply(transpose(basis), multiply(a, basis)) for a in (model.F, model.W))
    gram = tuple(tuple(ONE if i == j < m else ZERO for j in range(n)) for i in range(n))
    ends = partial(down_to_zero, inputs=m, states=n)
    split = WeightedPencil([F], [gram, W], Weights(variables=(MU,), ends=ends, loss=loss))
    # products may hide from simplification that a variable cancels
    return FirstFinite(exact, split) if set(split.variables) <= set(exact.variables) else exact


def _moving_annihilator(model: ControlAffineModel) -> Matrix:
    """B_perp(x) by rows of B that may depend on each other somewhere: no bound comes out there."""
    rows = next(
        (rows for rows in model.pivots[0] if determinant([model.B[i] for i in rows]) is not ZERO), None
    )
    return () if rows is None else model.annihilator_by(rows)


def tangents(lo: Array, hi: Array) -> tuple[Array, Array, Array]:
    """Weights of F, B B' and W, (N, 2) each: the ends of the tangent, or (1, 1/hi, lo) for a wide range, theory 2.1."""
    tangent = _narrow(lo, hi)
    ends = np.concatenate([lo, hi], axis=1)
    middle = np.where(tangent, 0.5 * (lo + hi), 1.0)
    # a difference, two quotients and the last product are rounded, 4 u; 1e-15 > 9 u
    slope = (2 * middle - ends) / middle / middle * (1 - 1e-15)  # 1/m + (m - mu)/m^2, rounded down
    return np.ones_like(ends), np.where(tangent, slope, _inverse(hi)), np.where(tangent, ends, lo)


def down_to_zero(lo: Array, hi: Array, *, inputs: int, states: int) -> tuple[Array, Array, Array]:
    """Weights of F, B B' = diag(I, 0) and W, by entries, for all mu in (0, hi], theory 2.1a.

    By the congruence diag(sqrt(mu/hi), sqrt(hi/mu)) and F_22 <= 0 (C2), F <= tau (B B'/mu + mu W) if
        [mu/hi F_11, F_12; F_21, F_22] <= tau [I/hi, mu W_12; mu W_21, hi W_22],
    which is affine in mu: mu = 0 and mu = hi suffice.
    """
    top = (np.arange(states) < inputs).astype(float)
    own, rest = np.outer(top, top), np.outer(1 - top, 1 - top)
    end = np.array([0.0, 1.0])[None, :, None, None]
    F = np.broadcast_to(1 - own + end * own, (len(hi), 2, states, states))
    W = hi[:, :, None, None] * (rest + end * (1 - own - rest))
    return F, np.repeat(_inverse(hi), 2, axis=1), W


def _inverse(mu: Array) -> Array:
    """1/mu rounded down; 0 for 0."""
    return np.where(mu > 0, np.nextafter(1 / np.where(mu > 0, mu, 1.0), 0.0), 0.0)


def _narrow(lo: Array, hi: Array) -> NDArray[np.bool_]:
    return (lo > 1e-100) & (hi <= _WIDE * lo) & (hi < 1e100)  # nothing over- or underflows


def _loss(lo: Array, hi: Array, *, largest: float) -> Array:
    """What the weights lose, relative: of second order for narrow ranges.

    Where a range reaches 0, its part of the whole one, which shrinks: it would otherwise be halved for ever where only
    other variables can help.
    """
    wide = np.where(lo > 0, (hi - lo) / np.where(lo > 0, lo, 1.0), hi / largest)
    return np.where(_narrow(lo, hi), ((hi - lo) / (hi + lo)) ** 2, wide)


class ClosedFormGain:
    """The closed form over boxes, for a constant B whose metric satisfies C2 at the model's rate."""

    def __init__(self, model: ControlAffineModel) -> None:
        self._function = MatrixFunction([model.F, model.W])
        self.variables = self._function.variables
        inputs = MatrixFunction([model.B, *([model.annihilator] if model.annihilator else [])])
        nothing = np.zeros((1, 0))
        self._B, *rest = (midrad(value) for value in inputs.at(nothing, nothing))
        self._annihilator: Ball | None = rest[0] if rest else None
        self._inputs = inputs

    def bound(self, lo: Array, hi: Array) -> Array:
        """An upper bound over each box, (N,); inf where the box is too wide, theory 2.2."""
        F, W = (midrad(value) for value in self._function.at(lo, hi))
        t = whitening(W[0])
        T: Ball = (t, np.zeros_like(t))
        scaled = eigenvalues_midrad(*product(T, product(W, _transposed(T))))
        image = product(T, self._B)  # R = T B
        G = product(_transposed(image), image)
        back = product(_transposed(T), image)
        k = whitening(G[0])
        Kr: Ball = (k, np.zeros_like(k))
        least_g = eigenvalues_midrad(*product(Kr, product(G, _transposed(Kr)))).lo[:, 0]
        right = product(F, product(back, _transposed(Kr)))
        own = product(_transposed(product(back, _transposed(Kr))), right)
        push = np.maximum(eigenvalues_midrad(*own).hi[:, -1], 0.0) / least_g
        cross = np.zeros(len(lo))
        if self._annihilator is not None:
            N = self._annihilator
            H = product(_transposed(N), product(W, N))
            kn = whitening(H[0])
            Kn: Ball = (kn, np.zeros_like(kn))
            # N'(T'T)^-1 N >= H/lmax(T W T')
            least_h = (
                eigenvalues_midrad(*product(Kn, product(H, _transposed(Kn)))).lo[:, 0] / scaled.hi[:, -1]
            )
            mixed = product(Kn, product(_transposed(N), right))
            cross = spectral_norm_midrad(*mixed).hi / np.sqrt(
                np.where(least_h > 0, least_h * least_g, np.nan)
            )
        smallest = eigenvalues_midrad(*G).lo[:, 0] * scaled.lo[:, 0]
        valid = (least_g > 0) & (smallest > 0) & (scaled.lo[:, 0] > 0)
        # roundings of bounds, here and in what `smallest` and `cross` are made of: below 20 u; 1e-13 > 900 u
        value = np.sqrt((cross**2 + push**2 / 4) / np.where(valid, smallest, np.nan)) * (1 + 1e-13)
        return np.where(valid & ~np.isnan(value), value, np.inf)

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The bound; it converges linearly, so every variable counts by its width."""
        width = hi - lo
        return Estimate(self.bound(lo, hi), 0.5 * (lo + hi), width, width)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Values at points, to steer by: the closed form is a bound, nobody needs it from below."""
        value = self.bound(lo, hi)
        return np.where(np.isfinite(value), value * (1 - 1e-9), -np.inf)


def _transposed(ball: Ball) -> Ball:
    return np.swapaxes(ball[0], -1, -2), np.swapaxes(ball[1], -1, -2)
