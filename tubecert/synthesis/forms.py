"""The conditions on the coefficients of a metric family, at points: batches of floats, linear in the coefficients.

With V = sum_k g_k V_k, A = f_x E - d_f E, P = N'E, Q = N'A (N: orthonormal, B'N = 0) and V's derivative along f in V',
    N'(-d_f W + f_x W + W f_x')N = Q V P' + P V Q' - P V' P'.
What mirror symmetries leave of a family, and of the points at which conditions are asked.

D = diag(+-1) with f(Dx) = D f(x), D range B(x) = range B(Dx) and D X = X: with W(x) also D W(Dx) D is feasible, and so
is their mean. With g_k(Dx) = s_k g_k(x) and E(Dx) = D E(x) diag(c), W is invariant iff V_k has no entry (i, j) with
s_k c_i c_j = -1. A symmetry under which some g_k or column of E is neither even nor odd is left out.
Untrusted: floats propose points and coefficients, `verify` decides; a symmetry is seen at random points, and a wrong
one can cost a metric but never a proof. Implements: (CCM_1), (CCM_2) at points.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import Expression, free_symbols
from tubecert.expression.matrix import along, combine, multiply
from tubecert.model import ControlAffineModel
from tubecert.synthesis.conic import triangle
from tubecert.synthesis.family import Coordinates, MetricFamily, unscaled

_CLOSE = 1e-9
_MOST_STATES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class PointForms:
    """What the conditions at N points are made of.

    Shapes: frame E and input B B' (N, n, n); P, Q (N, r, n) with r = n - rank B; values g and rates f.grad g (N, K).
    `unit`: the rate by which rows of C2 are divided.
    """

    frame: Array
    input: Array
    P: Array
    Q: Array
    values: Array
    rates: Array
    unit: float

    def inner(self, coefficients: Array) -> Array:
        """sum_k g_k V_k, (N, n, n)."""
        return np.asarray(np.einsum("pk,kij->pij", self.values, coefficients))

    def metric(self, coefficients: Array) -> Array:
        """W, (N, n, n)."""
        return _symmetric(self.frame @ self.inner(coefficients) @ _t(self.frame))

    def contraction(self, coefficients: Array) -> tuple[Array, Array]:
        """N'F_0 N and N'W N, each (N, r, r), for C2: the first is <= -2 rate times the second."""
        V = self.inner(coefficients)
        mixed = self.Q @ V @ _t(self.P)
        moved = self.P @ np.einsum("pk,kij->pij", self.rates, coefficients) @ _t(self.P)
        return _symmetric(mixed + _t(mixed) - moved), _symmetric(self.P @ V @ _t(self.P))

    def metric_rows(self, unknowns: Unknowns) -> Array:
        """Coefficients of the upper triangle of W on the unknowns, (N, n(n+1)/2, U)."""
        return unknowns.spread(_pairs(self.frame, self.frame, unknowns), self.values)

    def projected_rows(self, unknowns: Unknowns) -> Array:
        """Coefficients of the upper triangle of N'W N on the unknowns, (N, r(r+1)/2, U)."""
        return unknowns.spread(_pairs(self.P, self.P, unknowns), self.values)

    def contraction_rows(self, unknowns: Unknowns, rate: float) -> Array:
        """Coefficients of the upper triangle of -N'(F_0 + 2 rate W)N/unit on the unknowns, (N, r(r+1)/2, U)."""
        own = _pairs(self.P, self.P, unknowns)
        mixed = _pairs(self.Q, self.P, unknowns)
        rows = unknowns.spread(own, self.rates - 2 * rate * self.values)
        return (rows - unknowns.spread(2 * mixed, self.values)) / self.unit


@dataclass(frozen=True, slots=True)
class Unknowns:
    """Which entries of the V_k are unknown: mask (K, n, n), upper triangle only; the others are 0."""

    mask: NDArray[np.bool_]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.places[0])

    @property
    def places(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """(k, i, j) of each, i <= j."""
        k, i, j = np.nonzero(self.mask)
        return np.asarray(k), np.asarray(i), np.asarray(j)

    def matrices(self, y: Array) -> Array:
        """V_k from the unknowns, (K, n, n)."""
        result = np.zeros(self.mask.shape)
        k, i, j = self.places
        result[k, i, j] = result[k, j, i] = y
        return result

    def spread(self, pairs: Array, weights: Array) -> Array:
        """Upper triangles of weights[:, k] times the form of (i, j), for each unknown: (N, s, U)."""
        n = self.mask.shape[1]
        k, i, j = self.places
        return np.ascontiguousarray(upper(pairs[:, i * n + j] * weights[:, k, None, None]).swapaxes(1, 2))


class FormsTape:
    """Evaluates `PointForms` of a model and a family at points (N, n), in coordinates z of x = S z."""

    def __init__(
        self, model: ControlAffineModel, family: MetricFamily, scaled: Coordinates | None = None
    ) -> None:
        self._scaled = unscaled(family) if scaled is None else scaled
        self.states, self.inputs, self.functions = model.states, len(model.inputs), len(family.functions)
        E, g = family.frame, (family.functions,)
        A = combine(1, multiply(model.f_x, E), -1, along(E, model.f, model.states))
        parts = [E, A, g, along(g, model.f, model.states), model.B]
        entries = [e for part in parts for row in part for e in row]
        distinct = list(dict.fromkeys(entries))
        place = {e: i for i, e in enumerate(distinct)}
        self._index = np.array([place[e] for e in entries])
        self._tape = Tape(distinct, model.states)
        self.metric_variables = _used([*(e for row in E for e in row), *family.functions], model)
        self.input_variables = _used([e for row in model.B for e in row], model)
        self.variables = _used(entries, model)
        self._basis = np.eye(len(family.functions))

    @property
    def speeds(self) -> Array:
        """What the entries of f are measured in, (n,)."""
        return self._scaled.states * self._scaled.rate

    def orthonormalise(self, points: Array) -> None:
        """Change to functions that are orthonormal on the points (N, n): monomials are nearly dependent on small boxes.

        Points that are closed under the sign symmetries keep even and odd functions apart.
        """
        values = self(points).values
        finite = values[np.isfinite(values).all(axis=1)]
        r = np.asarray(np.linalg.qr(finite / np.sqrt(len(points)), mode="r"))
        if r.shape[0] == r.shape[1] and np.abs(np.diag(r)).min() > 1e-9 * np.abs(r).max():
            r = np.where(np.abs(r) > 1e-12 * np.abs(r).max(), r, 0.0)
            self._basis = self._basis @ np.linalg.inv(r)

    def coefficients(self, inner: Array) -> Array:
        """The V_k of the family (K, n, n) from those of the changed functions and coordinates."""
        return np.asarray(np.einsum("kj,jab->kab", self._basis, inner)) * self._scaled.entries

    def inner(self, coefficients: Array) -> Array:
        """What coefficients of the family are in these coordinates, before any change of functions."""
        return np.asarray(coefficients / self._scaled.entries)

    def __call__(self, points: Array, annihilator: Array | None = None) -> PointForms:
        """The forms at points (N, n), with the given N (N, n, r) of the states' own coordinates if there is one."""
        n, m, count = len(self.states), self.inputs, len(points)
        flat = self._tape.run_floats(list(points.T), (count,))[self._index].T
        sizes = np.cumsum([n * n, n * n, self.functions, self.functions])
        E, A, g, rates, B = np.split(flat, sizes, axis=1)
        rows, columns = self._scaled.states[:, None], self._scaled.columns
        E, A = (part.reshape(-1, n, n) * columns / rows for part in (E, A))
        B = B.reshape(-1, n, m) / rows
        N = null_bases(B) if annihilator is None else annihilator * rows
        return PointForms(
            frame=E,
            input=B @ _t(B) / self._scaled.input**2,
            P=_t(N) @ E,
            Q=_t(N) @ A,
            values=g / self._scaled.functions @ self._basis,
            rates=rates / self._scaled.functions @ self._basis,
            unit=self._scaled.rate,
        )

    def bases(self, points: Array) -> Array:
        """N at points, (N, n, r)."""
        flat = self._tape.run_floats(list(points.T), (len(points),))[self._index].T
        n, m = len(self.states), self.inputs
        return null_bases(flat[:, -n * m :].reshape(-1, n, m) / self._scaled.states[:, None])

    def projectors(self, points: Array) -> Array:
        """N N', (N, n, n)."""
        N = self.bases(points)
        return np.asarray(N @ _t(N))

    def affine_variables(self, lo: Array, hi: Array) -> tuple[int, ...]:
        """States in which the conditions are affine one at a time: they matter at the ends of their ranges only.

        Seen from second differences at random points, hence a proposal.
        """
        generator = np.random.default_rng(3)
        base = generator.uniform(lo, hi, (4, len(lo)))
        N = self.bases(base)
        found = []
        for i in self.variables:
            ends = [base.copy() for _ in range(3)]
            for place, weight in zip(ends, (0.0, 0.5, 1.0), strict=True):
                place[:, i] = lo[i] + weight * (hi[i] - lo[i])
            given = N / self._scaled.states[:, None]
            if not all(_close(self.projectors(place), N @ _t(N)) for place in ends):
                continue
            low, middle, high = (_flat(self(place, given)) for place in ends)
            if _close(2 * middle, low + high):
                found.append(i)
        return tuple(found)


def null_bases(B: Array) -> Array:
    """Orthonormal bases of {v : B'v = 0}, (N, n, n - m); zero where B is not finite."""
    finite = np.isfinite(B).all(axis=(1, 2), keepdims=True)
    q, _ = np.linalg.qr(np.where(finite, B, 0.0), mode="complete")
    return np.asarray(q[:, :, B.shape[2] :])


def upper(matrices: Array) -> Array:
    """Upper triangles by columns: (..., s) from symmetric (..., p, p)."""
    i, j = triangle(matrices.shape[-1])
    return np.asarray(matrices[..., i, j])


def _pairs(left: Array, right: Array, unknowns: Unknowns) -> Array:
    """(X Y' + Y X')/2 for X = left e_ij right', e_ij the symmetric unit matrices: (N, n n, r, r), by i n + j."""
    n = unknowns.mask.shape[1]
    outer = np.einsum("pai,pbj->pijab", left, right)
    unit = outer + outer.swapaxes(1, 2)
    unit[:, range(n), range(n)] *= 0.5
    both = 0.5 * (unit + unit.swapaxes(3, 4))
    return np.asarray(both.reshape(len(left), n * n, left.shape[1], left.shape[1]))


def _flat(forms: PointForms) -> Array:
    """Everything that multiplies a coefficient in C2, (N, anything)."""
    count = len(forms.values)
    own, mixed = (
        np.einsum("pai,pbj->paibj", left, forms.P).reshape(count, -1)
        for left in (forms.P, forms.Q / forms.unit)
    )
    products = [
        np.einsum("pk,ps->pks", weights, pairs).reshape(count, -1)
        for weights, pairs in ((forms.values, own), (forms.values, mixed), (forms.rates / forms.unit, own))
    ]
    return np.concatenate(products, axis=1)


def _close(a: Array, b: Array) -> bool:
    return bool((np.abs(a - b) <= _CLOSE * max(1.0, float(np.abs(b).max(initial=0.0)))).all())


def _used(entries: Iterable[Expression], model: ControlAffineModel) -> tuple[int, ...]:
    names = free_symbols(entries)
    return tuple(i for i, name in enumerate(model.states) if name in names)


def _t(a: Array) -> Array:
    return np.swapaxes(a, -1, -2)


def _symmetric(a: Array) -> Array:
    return np.asarray(0.5 * (a + _t(a)))


def invariant_entries(
    model: ControlAffineModel, family: MetricFamily, box: Array, forms: FormsTape
) -> tuple[Array, NDArray[np.bool_]]:
    """The symmetries that the family shares, as signs (S, n), and the entries (K, n, n), i <= j, that they leave."""
    n = len(model.states)
    mask = np.repeat(np.triu(np.ones((n, n), dtype=bool))[None], len(family.functions), axis=0)
    points = np.random.default_rng(7).uniform(box[:, 0], box[:, 1], (3, n))
    tape = Tape(model.f, model.states)
    drift, here, projectors = _drift(tape, points, forms), forms(points), forms.projectors(points)
    shared = []
    for signs in _candidates(box, forms.variables):
        if not _close(_drift(tape, points * signs, forms), drift * signs):
            continue
        if not _close(forms.projectors(points * signs), signs[:, None] * projectors * signs):
            continue
        there = forms(points * signs)
        parity = _parity(there.values, here.values)
        columns = _parity(there.frame.reshape(-1, n), (here.frame * signs[:, None]).reshape(-1, n))
        if parity is not None and columns is not None:
            mask &= parity[:, None, None] * columns[:, None] * columns > 0
            shared.append(signs)
    return np.array(shared).reshape(-1, n), mask


def canonical(points: Array, symmetries: Array) -> Array:
    """Of the mirror images of each point (N, n) the one with the largest coordinates, the first ones first."""
    best = points
    rows = np.arange(len(points))
    for signs in symmetries:
        image = points * signs
        differs = image != best
        first = np.argmax(differs, axis=1)
        better = differs.any(axis=1) & (image[rows, first] > best[rows, first])
        best = np.where(better[:, None], image, best)
    return best


def _candidates(box: Array, variables: tuple[int, ...]) -> list[Array]:
    """Sign patterns that map the ranges of the states that matter to themselves, the identity left out."""
    if len(box) > _MOST_STATES:
        return []
    both = [lo == -hi or i not in variables for i, (lo, hi) in enumerate(box)]
    choices = [(1.0, -1.0) if free else (1.0,) for free in both]
    return [np.array(signs) for signs in product(*choices) if min(signs) < 0]


def _drift(tape: Tape, points: Array, forms: FormsTape) -> Array:
    """f at points, (N, n), free of units where the forms are."""
    return np.asarray(tape.run_floats(list(points.T), (len(points),)).T / forms.speeds)


def _parity(there: Array, here: Array) -> Array | None:
    """The signs (K,) with there = sign * here at all points (N, K); None if there are none."""
    size = _CLOSE * max(1.0, float(np.abs(here).max(initial=0.0)))
    even, odd = (np.asarray(np.abs(there - sign * here) <= size).all(axis=0) for sign in (1.0, -1.0))
    return np.where(even, 1.0, -1.0) if bool((even | odd).all()) else None
