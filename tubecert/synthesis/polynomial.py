"""The conditions on a metric as polynomial matrices on cubes, affine in the unknown coefficients.

I <= W, W <= kappa I and -N'(F_0 + 2 rate W)N >= 0, each from values at the nodes of its own chart.
Untrusted. Implements: (CCM_1), (CCM_2).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression
from tubecert.expression.matrix import Matrix, adjugate, along, combine, determinant, jacobian, multiply
from tubecert.model import ControlAffineModel
from tubecert.synthesis.chart import Chart, NotPolynomialError, Variable, degrees_of, highest, total
from tubecert.synthesis.conic import triangle
from tubecert.synthesis.forms import FormsTape, Unknowns, invariant_entries
from tubecert.synthesis.problem import SynthesisProblem

Array = NDArray[np.float64]
Signs = tuple[tuple[int, ...], ...]
_SMALL = 1e-3  # W >= _SMALL I beside W >= B B'
_LARGE = 40  # order of a Gram matrix above which a variable is replaced by control points
_LARGEST = 150  # order at which the route gives up
_MOST_NODES = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """C(u) >= 0 on a cube, of order `size`, at one control point of the variables that were replaced.

    `coefficients` (monomials, t, U + 2): of every monomial up to the degrees `orders`, in C order, the upper triangle
    of C by columns, as coefficients of the unknowns, of kappa, and the constant. `signs`: how each symmetry acts on
    the variables of the cube and on the rows of C.
    """

    name: str
    size: int
    orders: tuple[int, ...]
    coefficients: Array
    signs: Signs


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """All conditions of a problem, and the unknowns that its symmetries leave."""

    unknowns: Unknowns
    conditions: tuple[Condition, ...]


def polynomial_conditions(
    problem: SynthesisProblem, *, pieces: int = 2, symmetric: bool = True
) -> Conditions:
    """The conditions of a problem.

    A variable of degree one is replaced by the ends of its range: that is exact. Where Gram matrices would get large,
    variables of low degree are replaced by the control points of their Bernstein form on so many `pieces`: a little
    stricter, and much cheaper (0: they never are). Sign symmetries are looked for if `symmetric`.
    Raises `NotPolynomialError` or `NotLiftedError` if the route does not apply.
    """
    model, family = problem.model, problem.family
    box = np.array([[float(lo), float(hi)] for lo, hi in problem.safe_set])
    N = _annihilator(model)
    charts = _charts(problem, N)
    forms = FormsTape(model, family, problem.scaled)
    symmetries, mask = invariant_entries(model, family, box, forms)
    if not symmetric:
        symmetries, mask = (
            symmetries[:0],
            np.broadcast_to(np.triu(np.ones(mask.shape[1:], dtype=bool)), mask.shape),
        )
    unknowns = Unknowns(mask)
    found: list[Condition] = []

    points, weight = _points(charts[0], model, box)
    at = forms(points, np.zeros((len(points), len(box), 0)))
    own = [(sign, sign) for sign in symmetries]
    for name, values in _bounds(at.metric_rows(unknowns), at.input, problem.floor):
        found += _placed(name, charts[0], values * weight[:, None, None], own, model=model, pieces=pieces)
    if N[0]:
        points, weight = _points(charts[1], model, box)
        basis = _values(N, model, points)
        basis = basis / _lengthened(basis, problem.scaled.states)
        rows = forms(points, basis).contraction_rows(unknowns, problem.rate)
        values = np.concatenate([rows, np.zeros((*rows.shape[:2], 2))], axis=2)
        kept = [(sign, q) for sign in symmetries if (q := _row_signs(N, model, box, sign)) is not None]
        found += _placed(
            "contraction", charts[1], values * weight[:, None, None], kept, model=model, pieces=pieces
        )
    return Conditions(unknowns=unknowns, conditions=tuple(found))


def _annihilator(model: ControlAffineModel) -> Matrix:
    """N (n, n - m), polynomial if B is: its columns span {v : B'v = 0} wherever the pivot rows are independent."""
    if model.constant_input:
        return model.annihilator or ((),) * len(model.states)
    n = len(model.states)
    for rows in model.pivots[0]:
        pivot = determinant([model.B[i] for i in rows])
        if pivot is ZERO:
            continue
        others = [i for i in range(n) if i not in rows]
        gain = multiply([model.B[i] for i in others], adjugate([model.B[i] for i in rows]))
        return tuple(
            tuple(-row[rows.index(i)] for row in gain)
            if i in rows
            else tuple(pivot if i == j else ZERO for j in others)
            for i in range(n)
        )
    raise NotPolynomialError("B has no rows that are independent")


def _charts(problem: SynthesisProblem, N: Matrix) -> tuple[Chart, Chart]:
    """The variables and degrees of W, and of C2."""
    model, family = problem.model, problem.family
    E, f, states = family.frame, model.f, model.states
    # rows that N'A and N'E have terms of
    met = [i for i, row in enumerate(N) if any(e is not ZERO for e in row)]
    A = model.f_x if family.flat else combine(1, multiply(model.f_x, E), -1, along(E, f, states))
    g = (family.functions,)
    rates = [
        sum((f[i] * d for i, d in enumerate(slopes) if d is not ZERO), start=ZERO)
        for slopes in jacobian(*g, states)
    ]
    groups: list[Sequence[Sequence[Expression]]] = [
        E,
        N,
        [E[i] for i in met],
        [A[i] for i in met],
        g,
        [rates],
    ]
    flat = [[e for row in group for e in row] for group in groups]
    found, angles = degrees_of([e for part in flat for e in part])
    ends = np.cumsum([0, *map(len, flat)])
    frame, basis, E_met, A_met, values, moved = (highest(*found[a:b]) for a, b in pairwise(ends))
    P, Q = total(basis, E_met), total(basis, A_met)
    both = total(frame, frame, values), highest(total(P, P, highest(values, moved)), total(P, Q, values))
    charts = []
    for degrees in both:
        used = [
            (Variable(name=name, lo=float(lo), hi=float(hi), angle=float(angles.get(name, 0))), degrees[name])
            for name, (lo, hi) in zip(states, problem.safe_set, strict=True)
            if degrees.get(name, 0)
        ]
        chart = Chart(variables=tuple(v for v, _ in used), degrees=tuple(d for _, d in used))
        if np.prod([order + 1.0 for order in chart.orders]) > _MOST_NODES:
            raise NotPolynomialError("too many variables of too high a degree")
        charts.append(chart)
    return charts[0], charts[1]


def _points(chart: Chart, model: ControlAffineModel, box: Array) -> tuple[Array, Array]:
    """The chart's nodes as whole states (N, n), the others in the middle; and the condition's factor (N,)."""
    nodes, weight = chart.nodes()
    points = np.repeat(box.mean(axis=1)[None], len(nodes), axis=0)
    points[:, [model.states.index(v.name) for v in chart.variables]] = nodes
    return points, weight


def _bounds(W: Array, BBt: Array, floor: str) -> Iterator[tuple[str, Array]]:
    """Floors and the ceiling of W, from its rows (N, t, U), as (N, t, U + 2); BBt is (N, n, n)."""
    i, j = triangle(BBt.shape[1])
    eye = np.broadcast_to(np.where(i == j, 1.0, 0.0), W.shape[:2])
    none = np.zeros_like(eye)
    if floor == "input":
        yield "floor", _joined(W, none, -BBt[:, i, j])
        yield "definite", _joined(W, none, -_SMALL * eye)
    else:
        yield "floor", _joined(W, none, -eye)
    yield "ceiling", _joined(-W, eye, none)


def _joined(unknowns: Array, kappa: Array, constant: Array) -> Array:
    return np.concatenate([unknowns, kappa[..., None], constant[..., None]], axis=2)


def _values(N: Matrix, model: ControlAffineModel, points: Array) -> Array:
    """N at points, (N, n, r)."""
    values = Tape([e for row in N for e in row], model.states).run_floats(list(points.T), (len(points),))
    return np.asarray(values.reshape(len(N), -1, len(points)).transpose(2, 0, 1))


def _lengthened(basis: Array, scale: Array) -> Array:
    """How much longer the columns of N (N, n, r) become in coordinates, (r,): rows of a condition should be alike."""
    before, after = (
        np.sqrt(np.mean((basis * s[:, None]) ** 2, axis=(0, 1))) for s in (np.ones_like(scale), scale)
    )
    return np.where(before > 0, after / np.where(before > 0, before, 1.0), 1.0)


def _row_signs(N: Matrix, model: ControlAffineModel, box: Array, sign: Array) -> Array | None:
    """Q (r,) with D N(D x) = N(x) Q, if it is diagonal: how a symmetry acts on the rows of C2."""
    points = np.random.default_rng(8).uniform(box[:, 0], box[:, 1], (3, len(box)))
    here, there = _values(N, model, points), sign[:, None] * _values(N, model, points * sign)
    rows = np.where(np.sum(here * there, axis=(0, 1)) < 0, -1.0, 1.0)
    return rows if np.allclose(there, here * rows, rtol=1e-9, atol=1e-9 * np.abs(here).max(axis=0)) else None


def _placed(
    name: str,
    chart: Chart,
    values: Array,
    symmetries: Sequence[tuple[Array, Array]],
    *,
    model: ControlAffineModel,
    pieces: int,
) -> Iterator[Condition]:
    """One condition for every control point, one of each orbit under the symmetries."""
    size = int(np.sqrt(2 * values.shape[1]))
    replaced = _replaced(chart.orders, size, pieces)
    places, tables = chart.coefficients(values, replaced)
    states = [model.states.index(v.name) for v in chart.variables]
    gone = [state for state, count in zip(states, replaced, strict=True) if count]
    kept = [state for state, count in zip(states, replaced, strict=True) if not count]
    orders = tuple(order for order, count in zip(chart.orders, replaced, strict=True) if not count)
    for place, table in zip(np.round(places, 9), tables, strict=True):
        images = [(place * sign[gone]).tolist() for sign, _ in symmetries]
        if any(image > place.tolist() for image in images):
            continue
        signs = {
            (*sign[kept].astype(int).tolist(), *rows.astype(int).tolist())
            for (sign, rows), image in zip(symmetries, images, strict=True)
            if image == place.tolist()
        }
        yield Condition(
            name=name,
            size=size,
            orders=orders,
            coefficients=table.reshape(-1, *table.shape[len(orders) :]),
            signs=tuple(sorted(signs)),
        )


def _replaced(orders: Sequence[int], size: int, pieces: int) -> list[int]:
    """How many pieces each variable is replaced on, 0 if it is kept; the highest degree is kept."""
    counts = [1 if order <= 1 else 0 for order in orders]
    while True:
        kept = [k for k, count in enumerate(counts) if not count]
        order = size * np.prod([(orders[k] + 1) // 2 + 1.0 for k in kept])
        if len(kept) < 2 or order <= _LARGE or not pieces:
            if order > _LARGEST:
                raise NotPolynomialError(f"Gram matrices of order {order:.0f} would be needed")
            return counts
        counts[min(kept, key=lambda k: orders[k])] = pieces
