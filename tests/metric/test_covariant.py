"""Covariant norms: known curvatures, other coordinates, and differences of Christoffel symbols in floats."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from systems import matrix_of
from tubecert.metric.covariant import Geometry

from tubecert.coordinates import Fields
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import BoxDomain
from tubecert.expression.matrix import column
from tubecert.model import ControlAffineModel

NOTHING: frozenset[str] = frozenset()


def model_of(f, B, W, rate=Fraction(1, 2)):
    names = tuple(f"x{i + 1}" for i in range(len(f)))
    return ControlAffineModel(
        states=names,
        inputs=tuple(f"u{j + 1}" for j in range(len(B[0]))),
        f=matrix_of([f], names)[0],
        B=matrix_of(B, names),
        W=matrix_of(W, names),
        rate=rate,
        h=None,
    )


def objectives(model):
    geometry, fields = Geometry(model), Fields(model, None)
    return {
        "D_nF": geometry.slope_of_form(),
        "D_nX": geometry.slope_of_field(column(model.f)),
        "D_nb": geometry.slope_of_inputs(lambda a: a, NOTHING),
        "D_Fx": geometry.slope_by_coordinates(fields),
        "D_cx": geometry.tilt_by_coordinates(fields, lambda a: a, NOTHING),
        "K_R": geometry.curvature(),
    }


def at_point(objective, model, x):
    """The enclosure at a point."""
    point = np.array([[x[model.states.index(name)] for name in objective.variables]])
    return objective.lower(point, point)[0], objective.upper(point, point, -np.inf).upper[0]


SPHERE = [["1", "0"], ["0", "1/cos(x1)**2"]]
HYPERBOLIC = [["x2**2", "0"], ["0", "x2**2"]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("W", "x", "value"),
    [(SPHERE, (0.3, 0.1), 1.0), (HYPERBOLIC, (0.2, 1.5), 1.0)],
    ids=["sphere", "half-plane"],
)
def test_known_curvatures(W, x, value):
    model = model_of(["x2", "x1"], [["1"], ["0"]], W)
    objective = Geometry(model).curvature()
    low, high = at_point(objective, model, x)
    assert low <= value <= high <= low + 1e-9
    assert objective.attained(dict(zip(model.states, x, strict=True))) == pytest.approx(value, abs=1e-9)
    half = {name: (v - 0.1, v + 0.1) for name, v in zip(model.states, x, strict=True)}
    box = BoxDomain({name: half[name] for name in objective.variables})
    found = supremum(objective, box, Effort(gap=0.01, cheap=0))
    assert found.reached
    assert value <= found.above <= value * 1.011


# y' = f(y), V constant; x = (y1, y2 + y1^2)
FLAT = (["-y1 + y2", "y1 + y2**3/3"], ["0", "1"], np.array([[2.0, -0.5], [-0.5, 1.0]]))


def in_other_coordinates():
    """The system FLAT in x, with y1 = x1, y2 = x2 - x1^2; D psi = [1 0; 2 x1 1]."""
    f = [e.replace("y2", "(x2 - x1**2)").replace("y1", "x1") for e in FLAT[0]]
    W = [["2", "-1/2 + 4*x1"], ["-1/2 + 4*x1", "1 - 2*x1 + 8*x1**2"]]
    return model_of([f"({f[0]})", f"({f[1]}) + 2*x1*({f[0]})"], [["0"], ["1"]], W)


def test_covariant_norms_are_those_of_the_coordinates_in_which_the_metric_is_constant():
    model, V = in_other_coordinates(), FLAT[2]
    found = objectives(model)
    theta = np.linalg.inv(np.linalg.cholesky(V))
    for y in ((0.3, -0.2), (-0.5, 0.8)):
        x = (y[0], y[1] + y[0] ** 2)
        slope = np.array([[-1.0, 1.0], [1.0, y[1] ** 2]])
        bend = np.array([[0.0, 0.0], [0.0, 2 * y[1]]])
        # nabla F is the derivative of A V + V A' by y2, and |v| = 1 in the metric reaches sqrt(V_22) there
        F_2 = theta @ (bend @ V + V @ bend.T) @ theta.T
        known = {
            "D_nX": np.linalg.norm(theta @ slope @ np.linalg.inv(theta), 2),
            "D_nF": np.abs(np.linalg.eigvalsh(F_2)).max() * np.sqrt(V[1, 1]),
            "D_nb": 0.0,
            "K_R": 0.0,
        }
        for name, value in known.items():
            low, high = at_point(found[name], model, x)
            assert low - 1e-9 <= value <= high + 1e-9, name
            assert high <= value * (1 + 1e-9) + 1e-8, name


THREE = (
    ["-x1 + x3**2", "sin(x2) + x1*x3", "x1 - x2"],
    [["1", "x2"], ["0", "1"], ["x1", "cos(x3)"]],
    [
        ["2 + x1**2/5", "x2/5", "1/10"],
        ["x2/5", "3 + x3/4", "x1*x3/5"],
        ["1/10", "x1*x3/5", "1 + sin(x1)/4"],
    ],
)


def three(x):
    """f, B, W of THREE in floats."""
    f = np.array([-x[0] + x[2] ** 2, np.sin(x[1]) + x[0] * x[2], x[0] - x[1]])
    B = np.array([[1, x[1]], [0, 1], [x[0], np.cos(x[2])]])
    W = np.array(
        [
            [2 + x[0] ** 2 / 5, x[1] / 5, 0.1],
            [x[1] / 5, 3 + x[2] / 4, x[0] * x[2] / 5],
            [0.1, x[0] * x[2] / 5, 1 + np.sin(x[0]) / 4],
        ]
    )
    return f, B, W


def slopes(g, x, h=1e-4):
    """d g/dx_i, the last axis, to fourth order."""
    rows = np.eye(3) * h
    return np.stack(
        [(8 * (g(x + e) - g(x - e)) - g(x + 2 * e) + g(x - 2 * e)) / (12 * h) for e in rows], axis=-1
    )


def symbols(x):
    W = three(x)[2]
    M_x = slopes(lambda p: np.linalg.inv(three(p)[2]), x)
    lowered = M_x.transpose(0, 2, 1) + M_x - M_x.transpose(2, 0, 1)  # l, i, j
    return np.einsum("kl,lij->kij", W, lowered) / 2


def lowered_form(x):
    """M F M."""
    f, _, W = three(x)
    f_x = slopes(lambda p: three(p)[0], x)
    along = slopes(lambda p: three(p)[2], x) @ f
    M = np.linalg.inv(W)
    return M @ (f_x @ W + W @ f_x.T - along + W) @ M  # 2 rate = 1


def measured(x, rng, count=30_000):
    """Every norm at a point by its definition, over sampled directions."""
    f, B, W = three(x)
    M, L, gamma = np.linalg.inv(W), np.linalg.cholesky(W), symbols(x)
    v = rng.standard_normal((count, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    FF, FF_x = lowered_form(x), slopes(lowered_form, x, 1e-3)
    turn = np.einsum("kia,kb->abi", gamma, FF)
    nabla = np.einsum("abi,ap,bq,ir->pqr", FF_x - turn - turn.transpose(1, 0, 2), L, L, L)
    field = slopes(lambda p: three(p)[0], x) + np.einsum("kij,j->ki", gamma, f)
    columns = slopes(lambda p: three(p)[1], x) + np.einsum("kli,lj->kji", gamma, B)
    columns = np.einsum("kji,kl,lz,ip->jzp", columns, M, L, L)
    straight = np.einsum("abi,ap,bq->pqi", FF_x, L, L)
    tilt = np.einsum("jai,ap->jpi", slopes(lambda p: three(p)[1].T @ np.linalg.inv(three(p)[2]), x), L)
    bend = slopes(symbols, x, 1e-3)  # k, i, j, m
    R = bend.transpose(0, 2, 3, 1) - bend.transpose(0, 2, 1, 3)  # R^k_lij = d_i G^k_jl - d_j G^k_il
    R = R + np.einsum("kim,mjl->klij", gamma, gamma) - np.einsum("kjm,mil->klij", gamma, gamma)
    R = np.einsum("ka,klij,lq,ir,js->qrsa", M @ L, R, L, L, L).transpose(3, 0, 1, 2)
    sectional = np.einsum("pqrs,nq,ns->npr", R, v[:3000], v[:3000])

    def most(tensor):
        return np.linalg.norm(np.einsum("abi,ni->nab", tensor, v), 2, axis=(-2, -1)).max()

    return {
        "D_nF": most(nabla),
        "D_nX": np.linalg.norm(np.linalg.inv(L) @ field @ L, 2),
        "D_nb": most(columns),
        "D_Fx": most(straight),
        "D_cx": most(tilt),
        "K_R": np.abs(np.linalg.eigvalsh(sectional)).max(),
    }


@pytest.mark.slow
def test_norms_of_a_random_system_are_those_of_their_definitions():
    model = model_of(*THREE)
    x = np.array([0.3, -0.2, 0.4])
    sampled = measured(x, np.random.default_rng(1))
    for name, objective in objectives(model).items():
        low, high = at_point(objective, model, x)
        attained = objective.attained(dict(zip(model.states, x, strict=True)))
        assert high - low <= 1e-9 * high, name
        assert sampled[name] <= high + 1e-6, name
        # an unfolding may be above the norm itself
        assert high <= sampled[name] * 1.15 + 1e-6, name
        if name != "K_R":
            assert attained == pytest.approx(sampled[name], rel=2e-3), name


@pytest.mark.slow
def test_over_a_box_the_bound_is_above_every_point_and_close_to_the_largest():
    model = model_of(*THREE)
    rng = np.random.default_rng(2)
    for name, objective in objectives(model).items():
        lo = np.array([[{"x1": 0.2, "x2": -0.3, "x3": 0.3}[v] for v in objective.variables]])
        hi = lo + 0.04
        bound = objective.upper(lo, hi, -np.inf).upper[0]
        points = lo + (hi - lo) * rng.random((200, lo.shape[1]))
        values = objective.lower(points, points)
        assert values.max() <= bound <= values.max() * 1.05 + 1e-3, name
