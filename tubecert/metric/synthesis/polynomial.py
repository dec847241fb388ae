"""The conditions on a metric as polynomial matrices on cubes, affine in the unknown coefficients.

I <= W, W <= kappa I and -N'(F_0 + 2 rate W)N >= 0, each from values at the nodes of its own chart. Variables in which a
condition has degree one are replaced by the ends of their ranges.
Untrusted. Implements: (CCM_1), (CCM_2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO
from tubecert.expression.matrix import Matrix, adjugate, along, combine, determinant, multiply, transpose
from tubecert.metric.synthesis.chart import Chart, NotPolynomialError, Variable, degrees_of, highest, total
from tubecert.metric.synthesis.conic import triangle
from tubecert.metric.synthesis.forms import FormsTape, Unknowns
from tubecert.metric.synthesis.parity import invariant_entries
from tubecert.metric.synthesis.problem import SynthesisProblem
from tubecert.model import ControlAffineModel

Array = NDArray[np.float64]
SMALL = 1e-3  # W >= SMALL I beside W >= B B'


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """C(u) >= 0 on a cube, of order `size`, at one control point of the variables that were replaced.

    `coefficients` (order_1 + 1, ..., t, U + 2): for every monomial the upper triangle of C by columns, as coefficients of
    the unknowns, of kappa and the constant; `orders` in each variable of the cube. `signs`: each symmetry's action on
    the cube's variables and on the rows of C.
    """

    name: str
    size: int
    orders: tuple[int, ...]
    coefficients: Array
    signs: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """All conditions of a problem, and the unknowns that its symmetries leave."""

    unknowns: Unknowns
    conditions: tuple[Condition, ...]


def polynomial_conditions(problem: SynthesisProblem, *, pieces: int = 0) -> Conditions:
    """The conditions of a problem.

    With `pieces`, plain variables of a higher degree that share a condition with an angle are replaced too, by the
    control points of their Bernstein form on so many pieces: cheaper, and a little stricter.
    Raises `NotPolynomialError` or `NotLiftedError` if the route does not apply.
    """
    model, n = problem.model, len(problem.model.states)
    N = _annihilator(model)
    metric, contraction, angles = _degrees(problem, N)
    box = np.array([[float(lo), float(hi)] for lo, hi in problem.safe_set])
    forms = FormsTape(model, problem.family)
    symmetries, mask = invariant_entries(model, problem.family, box, forms)
    unknowns = Unknowns(mask)

    chart = _chart(problem, metric, angles)
    points, weight = _points(chart, model, box)
    at = forms(points, np.zeros((len(points), n, 0)))
    W = at.metric_rows(unknowns)
    i, j = triangle(n)
    eye = np.repeat(np.where(i == j, 1.0, 0.0)[None], len(points), axis=0)
    none = np.zeros_like(eye)
    floors = {"floor": (W, none, -eye)}
    if problem.floor == "input":
        floors = {"floor": (W, none, -at.input[:, i, j]), "definite": (W, none, -SMALL * eye)}
    states = [(sign, sign) for sign in symmetries]
    found = []
    for name, parts in (floors | {"ceiling": (-W, eye, none)}).items():
        found += _placed(name, chart, _weighted(parts, weight), states, model, pieces)

    if N[0]:
        chart = _chart(problem, contraction, angles)
        points, weight = _points(chart, model, box)
        F = forms(points, _values(N, model, points)).contraction_rows(unknowns, problem.rate)
        none = np.zeros(F.shape[:2])
        states = [
            (sign, rows) for sign in symmetries if (rows := _row_signs(N, model, box, sign)) is not None
        ]
        found += _placed("contraction", chart, _weighted((F, none, none), weight), states, model, pieces)
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


def _degrees(problem: SynthesisProblem, N: Matrix) -> tuple[dict[str, int], dict[str, int], frozenset[str]]:
    """Bounds on the degrees of W and of C2 in each state, and the states that are angles."""
    model, family = problem.model, problem.family
    E, f, states = family.frame, model.f, model.states
    A = model.f_x if family.flat else combine(1, multiply(model.f_x, E), -1, along(E, f, states))
    Nt, g = transpose(N), (family.functions,)
    groups = [E, multiply(Nt, E), multiply(Nt, A), g, along(g, f, states)]
    flat = [[e for row in group for e in row] for group in groups]
    found, angles = degrees_of([e for part in flat for e in part])
    ends = np.cumsum([0, *map(len, flat)])
    frame, P, Q, values, rates = (highest(*found[a:b]) for a, b in zip(ends[:-1], ends[1:], strict=True))
    contraction = highest(total(P, P, highest(values, rates)), total(P, Q, values))
    return total(frame, frame, values), contraction, angles


def _chart(problem: SynthesisProblem, degrees: dict[str, int], angles: frozenset[str]) -> Chart:
    variables, orders = [], []
    for name, (lo, hi) in zip(problem.model.states, problem.safe_set, strict=True):
        if degrees.get(name, 0):
            variables.append(Variable(name=name, lo=float(lo), hi=float(hi), angle=name in angles))
            orders.append(degrees[name])
    return Chart(variables=tuple(variables), degrees=tuple(orders))


def _points(chart: Chart, model: ControlAffineModel, box: Array) -> tuple[Array, Array]:
    """The chart's nodes as whole states (N, n), the others in the middle; and the condition's factor (N,)."""
    nodes, weight = chart.nodes()
    points = np.repeat(box.mean(axis=1)[None], len(nodes), axis=0)
    points[:, [model.states.index(v.name) for v in chart.variables]] = nodes
    return points, weight


def _values(N: Matrix, model: ControlAffineModel, points: Array) -> Array:
    """N at points, (N, n, r)."""
    values = Tape([e for row in N for e in row], model.states).run_floats(list(points.T), (len(points),))
    return np.asarray(values.reshape(len(N), -1, len(points)).transpose(2, 0, 1))


def _row_signs(N: Matrix, model: ControlAffineModel, box: Array, sign: Array) -> Array | None:
    """Q (r,) with D N(D x) = N(x) Q, if it is diagonal: how a symmetry acts on the rows of C2."""
    points = np.random.default_rng(8).uniform(box[:, 0], box[:, 1], (3, len(box)))
    here, there = _values(N, model, points), sign[:, None] * _values(N, model, points * sign)
    rows = np.where(np.sum(here * there, axis=(0, 1)) < 0, -1.0, 1.0)
    return rows if np.allclose(there, here * rows, rtol=1e-9, atol=1e-9 * np.abs(here).max()) else None


def _weighted(parts: tuple[Array, Array, Array], weight: Array) -> Array:
    """(N, t, U + 2), times the factor that makes it a polynomial."""
    unknowns, kappa, constant = parts
    table = np.concatenate([unknowns, kappa[..., None], constant[..., None]], axis=2)
    return table * weight[:, None, None]


def _placed(
    name: str,
    chart: Chart,
    values: Array,
    symmetries: Sequence[tuple[Array, Array]],
    model: ControlAffineModel,
    pieces: int,
) -> list[Condition]:
    """One condition for every control point, one of each orbit under the symmetries."""
    angle = any(v.angle for v in chart.variables)
    replaced = [
        1 if order <= 1 else (pieces if angle and not v.angle else 0)
        for order, v in zip(chart.orders, chart.variables, strict=True)
    ]
    places, tables = chart.coefficients(values, replaced)
    states = [model.states.index(v.name) for v in chart.variables]
    gone = [state for state, count in zip(states, replaced, strict=True) if count]
    kept = [state for state, count in zip(states, replaced, strict=True) if not count]
    orders = tuple(order for order, count in zip(chart.orders, replaced, strict=True) if not count)
    conditions = []
    for place, table in zip(places, tables, strict=True):
        images = [place * sign[gone] for sign, _ in symmetries]
        if any(tuple(image) > tuple(place + 1e-9) for image in images):
            continue
        stays = [np.allclose(image, place) for image in images]
        signs = [
            (*sign[kept].astype(int).tolist(), *rows.astype(int).tolist())
            for (sign, rows), stay in zip(symmetries, stays, strict=True)
            if stay
        ]
        conditions.append(
            Condition(
                name=name,
                size=int(np.sqrt(2 * values.shape[1])),
                orders=orders,
                coefficients=table,
                signs=tuple(sorted(set(map(tuple, signs)))),
            )
        )
    return conditions
