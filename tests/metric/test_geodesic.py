"""The test for unique geodesics against Christoffel symbols by differences of M, and closed forms."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from problems import W_CONSTANT, W_LINEAR, W_SQUARE
from systems import plain_model
from texts import CONFIGS

from tubecert.coordinates import Fields
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import as_expression, cos, sin, symbol
from tubecert.metric.geodesic import SymbolNorm, unique_geodesics
from tubecert.model import build
from tubecert.pipeline import Options, certify
from tubecert.spec import load_text
from tubecert.trajectory import constant_plan
from tubecert.tube import Tube

THREE = (CONFIGS / "three_state.yaml").read_text(encoding="utf-8")
ORBIT = (CONFIGS / "two_state_orbit.yaml").read_text(encoding="utf-8")
X, Y, Z = symbol("x"), symbol("y"), symbol("z")


def model(W):
    names = ("x", "y", "z")[: len(W)]
    plain = plain_model(names, names, [*[["0"]] * (len(W) - 1), ["1"]])
    return replace(plain, W=tuple(tuple(as_expression(e) for e in row) for row in W), rate=Fraction(1))


def ball(system, centre, rho):
    plan = constant_plan([Fraction(c) for c in centre], [Fraction(0)], None)
    return Tube(plan, rho, states=system.states, inputs=("u",), time=None)


def bounded(system, centre, rho, **effort):
    return unique_geodesics(Fields(system, None), ball(system, centre, rho), rho, Effort(**effort))


def differences(F, x, step=1e-3):
    """Of fourth order, one for each entry of x."""
    steps = np.eye(len(x)) * step
    return [(8 * (F(x + e) - F(x - e)) - (F(x + 2 * e) - F(x - 2 * e))) / (12 * step) for e in steps]


def christoffel(W, x):
    """Gamma^k_ij from differences of M = W^-1."""
    d = np.array(differences(lambda x: np.linalg.inv(W(x)), x))  # d[i, j, l] = dM_jl/dx_i
    lowered = 0.5 * (np.einsum("ijl->lij", d) + np.einsum("jil->lij", d) - d)
    return np.einsum("kl,lij->kij", W(x), lowered)


def slopes(W, x):
    """Its derivatives, last axis."""
    return np.stack(differences(lambda x: christoffel(W, x), x), axis=-1)


def sampled_norm(tensor, rng, tries=30):
    """The multilinear norm from below, by alternating maximisation from random starts."""
    best = 0.0
    for _ in range(tries):
        vectors = [rng.normal(size=size) for size in tensor.shape]
        for _ in range(40):
            for axis in range(tensor.ndim):
                image = tensor
                for other in reversed(range(tensor.ndim)):
                    if other != axis:
                        unit = vectors[other] / np.linalg.norm(vectors[other])
                        image = np.tensordot(image, unit, (other, 0))
                vectors[axis] = image if np.linalg.norm(image) > 0 else vectors[axis]
        best = max(best, float(np.linalg.norm(image)))
    return best


def three_state(x):
    return W_CONSTANT + W_LINEAR * x[0] + W_SQUARE * x[0] ** 2


def curved(x):
    a, b, c = x
    return np.array(
        [[2 + np.sin(a) * b, 0.3 * a, 0.1], [0.3 * a, 1 + 0.5 * np.cos(a + b), 0.2 * c], [0.1, 0.2 * c, 3]]
    )


CURVED = model(
    [
        [2 + sin(X) * Y, Fraction(3, 10) * X, Fraction(1, 10)],
        [Fraction(3, 10) * X, 1 + Fraction(1, 2) * cos(X + Y), Fraction(1, 5) * Z],
        [Fraction(1, 10), Fraction(1, 5) * Z, 3],
    ]
)
HALF_PLANE = model([[Y**2, 0], [0, Y**2]])  # curvature -1: |Gamma| = 1/y, |dGamma| = 1/y^2
SPHERE = model([[(1 + X**2 + Y**2) ** 2 / 4, 0], [0, (1 + X**2 + Y**2) ** 2 / 4]])


@pytest.mark.parametrize(
    ("system", "W"), [(build(load_text(THREE, "s")), three_state), (CURVED, curved)], ids=["three", "curved"]
)
def test_symbols_and_slopes_agree_with_differences(system, W):
    rng = np.random.default_rng(1)
    for _ in range(6):
        x = rng.uniform(-0.4, 0.4, 3)
        for order, reference in ((0, christoffel(W, x)), (1, slopes(W, x))):
            norm = SymbolNorm(Fields(system, None), order=order)
            point = np.array([[x[system.states.index(name)] for name in norm.variables]])
            mid, rad = norm.tensor(point, point)
            moving = [i for i, name in enumerate(system.states) if name in norm.variables]
            expected = reference[..., moving] if order else reference
            assert np.abs(mid[0] - expected).max() < 3e-6
            assert rad.max() < 1e-10


def test_tensors_over_boxes_contain_the_tensors_at_points():
    rng = np.random.default_rng(2)
    for order, size in ((0, 3), (1, 4)):
        norm = SymbolNorm(Fields(CURVED, None), order=order)
        lo = rng.uniform(-0.5, 0.3, (20, 3))
        hi = lo + 10.0 ** rng.uniform(-6, -1, (20, 1))
        mid, rad = norm.tensor(lo, hi)
        assert mid.ndim == size + 1
        for _ in range(10):
            x = lo + rng.uniform(size=lo.shape) * (hi - lo)
            inner, _ = norm.tensor(x, x)
            assert (np.abs(inner - mid) <= rad + 1e-12).all()


@pytest.mark.parametrize(("rho", "known"), [(0.0414, 0.0829), (0.1, 0.2005)])
def test_three_state_has_the_known_values(rho, known):
    system = build(load_text(THREE, "s"))
    found = bounded(system, (0, 0, 0), rho)
    assert found.holds
    assert found.value.below == pytest.approx(known, rel=2e-3)
    assert found.value.below <= found.value.above <= known * 1.1


@pytest.mark.slow
@pytest.mark.parametrize(("system", "W", "rho"), [(CURVED, curved, 0.3), (CURVED, curved, 0.05)])
def test_bounds_lie_above_sampling(system, W, rho):
    found = bounded(system, (0, 0, 0), rho)
    rng = np.random.default_rng(3)
    G = L = 0.0
    for _ in range(40):
        x = rng.normal(size=3)
        x *= rho * rng.uniform() ** 0.2 / np.linalg.norm(x)
        G = max(G, sampled_norm(christoffel(W, x), rng, 3))
        L = max(L, sampled_norm(slopes(W, x), rng, 3))
    assert found.symbols.above * (1 + 1e-6) >= G
    assert found.slope.above * (1 + 1e-6) >= L
    assert found.value.above <= 2 * (G * rho + L * rho**2 / 8)
    assert found.symbols.below <= found.symbols.above


@pytest.mark.slow
def test_half_plane_has_its_closed_form():
    rho = 0.4
    found = bounded(HALF_PLANE, (0, 1), rho)
    G, L = 1 / (1 - rho), 1 / (1 - rho) ** 2
    assert found.symbols.below == pytest.approx(G, rel=0.03)
    assert found.symbols.below <= G <= found.symbols.above <= G * 2**0.5 * 1.05
    assert found.slope.below <= L <= found.slope.above <= 2.1 * L


@pytest.mark.slow
@pytest.mark.parametrize(("system", "centre", "rho"), [(HALF_PLANE, (0, 1), 0.45), (CURVED, (0, 0, 0), 0.3)])
def test_the_value_is_that_of_the_theorem(system, centre, rho):
    """(5.1) in rational numbers: G rho + L rho^2/8, from the enclosures of G and L; here L counts."""
    found = bounded(system, centre, rho)

    def value(G, L):
        return Fraction(G) * Fraction(rho) + Fraction(L) * Fraction(rho) ** 2 / 8

    above, below = (
        value(getattr(found.symbols, side), getattr(found.slope, side)) for side in ("above", "below")
    )
    assert above <= Fraction(found.value.above) <= above * (1 + Fraction(1, 10**12))
    assert below * (1 - Fraction(1, 10**12)) <= Fraction(found.value.below) <= below
    assert Fraction(found.slope.above) * Fraction(rho) ** 2 / 8 > above / 50


@pytest.mark.slow
def test_a_tube_beyond_the_cut_locus_fails():
    """Many minimisers join opposite points of a sphere; in these coordinates (1, 0) is opposite (-1, 0)."""
    assert not bounded(SPHERE, (1, 0), 2.0).holds
    assert bounded(SPHERE, (1, 0), 0.2).holds


@pytest.mark.slow
def test_the_value_does_not_depend_on_the_scale_of_the_metric_or_the_order_of_states():
    once = bounded(CURVED, (0, 0, 0), 0.2)
    scaled = model([[e * 7 for e in row] for row in CURVED.W])
    order = (2, 0, 1)
    W = tuple(tuple(CURVED.W[i][j] for j in order) for i in order)
    swapped = replace(CURVED, states=tuple(CURVED.states[i] for i in order), W=W)
    for other in (scaled, swapped):
        again = bounded(other, (0, 0, 0), 0.2)
        assert again.value.above == pytest.approx(once.value.above, rel=0.03)
        assert again.value.below <= once.value.above
        assert once.value.below <= again.value.above


def test_constant_metrics_pass_trivially():
    found = bounded(model([[2, 1], [1, 3]]), (0, 0), 100.0)
    assert found.holds
    assert found.value.above == 0


@pytest.mark.slow
def test_where_the_metric_degenerates_nothing_is_proven():
    singular = model([[Y, 0], [0, 1]])
    assert not bounded(singular, (0, Fraction(1, 2)), 0.6, budget=2000).holds


@pytest.mark.slow
def test_the_verdict_rests_on_the_bound_from_above():
    found = bounded(CURVED, (0, 0, 0), 0.3, budget=1)
    assert found.value.above >= bounded(CURVED, (0, 0, 0), 0.3).value.below


@pytest.mark.slow
def test_the_certificate_says_whether_uniqueness_is_proven():
    three = certify(load_text(THREE, "three.yaml"), Options()).to_json()
    entry = three["metric"]["unique_geodesics"]
    assert entry["holds"]
    below, above = entry["value"]
    assert 0.07 < below <= above < 0.09
    assert {"id": "exact_geodesics", "uniqueness": "proven", "value": [below, above]} in three["assumptions"]
    orbit = certify(load_text(ORBIT, "orbit.yaml"), Options()).to_json()
    assert orbit["metric"]["unique_geodesics"] == {"value": [0.0, 0.0], "holds": True}
    assert {"id": "straight_geodesics"} in orbit["assumptions"]
