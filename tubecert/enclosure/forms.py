"""Affine forms of tensors over boxes: a midpoint, a part linear in each variable, and a radius for all the rest.

With e_i in [-1, 1] the position in the box along variable i, an entry is c_0 + sum_i c_i e_i + r, |r| <= radius.
Products keep the linear part, so what is computed from forms converges quadratically with the size of the box, and no
derivative of a product is ever written out. Everything here is rigorous; rounding errors go into the radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product as choices

import numpy as np

from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import norm_bound, spectral_norm_midrad
from tubecert.enclosure.taylor import Matrix, MatrixFunction

# k products that are added are off by k u of the sum of their sizes (Higham 2002, eq. 3.5): 1e-13 > 900 u
_SLACK = 1e-13
_TINY = 1e-300  # covers underflow
_VERTICES = 5  # variables for which a norm is taken at the ends; that of the others is added


class Form:
    """Tensors (N, ...) over N boxes: `parts` (1 + d, N, ...), the midpoint first, and `radius` (N, ...)."""

    __slots__ = ("parts", "radius")

    def __init__(self, parts: Array, radius: Array) -> None:
        self.parts, self.radius = parts, radius

    @property
    def size(self) -> Array:
        """What the magnitude of an entry is at most, (N, ...), but for a rounding."""
        return np.asarray(np.abs(self.parts).sum(axis=0) + self.radius)

    def __add__(self, other: Form) -> Form:
        parts = self.parts + other.parts
        return Form(parts, self.radius + other.radius + _SLACK * (self.size + other.size))

    def __sub__(self, other: Form) -> Form:
        return self + (-1.0) * other

    def __rmul__(self, factor: float) -> Form:
        """Times a power of two, up to its sign."""
        return Form(factor * self.parts, abs(factor) * self.radius)

    def turned(self, *axes: int) -> Form:
        """The tensors with their axes, counted from 0, in another order."""
        inner = tuple(1 + axis for axis in axes)
        return Form(
            np.transpose(self.parts, (0, 1, *(1 + axis for axis in inner))),
            np.transpose(self.radius, (0, *inner)),
        )


def contract(spec: str, a: Form, b: Form) -> Form:
    """The sum of products that `spec` names as `einsum` does, such as "ij,jk->ik", for every box."""
    inputs, output = spec.split("->")
    left, right = inputs.split(",")
    spec = f"N{left},N{right}->N{output}"  # the boxes

    def times(x: Array, y: Array) -> Array:
        return np.asarray(np.einsum(spec, x, y, optimize=True))

    first = times(a.parts[0], b.parts[0])
    linear = [
        times(a.parts[0], q) + times(p, b.parts[0]) for p, q in zip(a.parts[1:], b.parts[1:], strict=True)
    ]
    swing_a, swing_b = np.abs(a.parts[1:]).sum(axis=0), np.abs(b.parts[1:]).sum(axis=0)
    whole_a, whole_b = a.size, b.size
    radius = times(swing_a, swing_b) + times(a.radius, whole_b) + times(whole_a, b.radius)
    radius = radius * (1 + _SLACK) + _SLACK * times(whole_a, whole_b) + _TINY
    return Form(np.stack([first, *linear]), radius)


def thin(values: Array, count: int) -> Form:
    """Exact tensors (N, ...) that do not depend on any of `count` variables."""
    parts = np.concatenate([values[None], np.zeros((count, *values.shape))])
    return Form(parts, np.zeros(values.shape))


def stacked(forms: Sequence[Form]) -> Form:
    """Several tensors of one shape along a new first axis."""
    return Form(np.stack([f.parts for f in forms], axis=2), np.stack([f.radius for f in forms], axis=1))


class Forms:
    """Matrices of expressions in `variables`, as affine forms over boxes by their mean value."""

    def __init__(self, matrices: Sequence[Matrix], fixed: frozenset[str] = frozenset()) -> None:
        self._function = MatrixFunction(matrices, order=1, fixed=fixed)
        self.variables = self._function.variables

    def over(self, lo: Array, hi: Array) -> list[Form]:
        """The forms over N boxes (N, d), one for each matrix."""
        return [Form(parts, radius) for parts, radius in self._function.linear(lo, hi)]


def unfolded_norm(form: Form, rows: tuple[int, ...]) -> tuple[Array, Array]:
    """A bound (N,) of the spectral norms of tensors as matrices, the axes `rows` against the others.

    And by variable, (N, d), how much it grows over the box.
    """
    parts = np.stack([_unfold(part, rows) for part in form.parts])
    radius = _unfold(form.radius, rows)
    linear = [spectral_norm_midrad(part, np.zeros_like(part)).hi for part in parts[1:]]
    ends = min(_VERTICES, len(linear))
    flips = np.array(list(choices((-1.0, 1.0), repeat=ends))).reshape(2**ends, ends)
    vertices = parts[0] + np.einsum("vk,knab->vnab", flips, parts[1 : 1 + ends])
    # a vertex is a sum of at most six terms
    rounding = radius + _SLACK * np.abs(parts).sum(axis=0)
    value = spectral_norm_midrad(vertices, np.broadcast_to(rounding, vertices.shape)).hi.max(axis=0)
    value = (value + sum(linear[ends:], start=np.zeros(len(value)))) * (1 + _SLACK)
    grown = np.stack([*linear], axis=1) if linear else np.zeros((len(value), 0))
    return np.where(np.isnan(value), np.inf, value), grown + norm_bound(radius)[:, None]


def least_norm(form: Form, rows: tuple[int, ...]) -> Interval:
    """An enclosure of the same at points, where the forms are thin, (N,)."""
    mid = _unfold(form.parts[0], rows)
    spread = np.abs(form.parts[1:]).sum(axis=0) * (1 + _SLACK) + form.radius
    return spectral_norm_midrad(mid, _unfold(spread, rows))


def _unfold(tensor: Array, rows: tuple[int, ...]) -> Array:
    """The tensors (N, ...) as matrices; axes are counted from 0 behind the first."""
    axes = tuple(1 + axis for axis in rows)
    others = tuple(axis for axis in range(1, tensor.ndim) if axis not in axes)
    height = int(np.prod([tensor.shape[axis] for axis in axes]))
    turned = np.transpose(tensor, (0, *axes, *others))
    return np.ascontiguousarray(turned).reshape(len(tensor), height, -1)
