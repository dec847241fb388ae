"""Chebyshev geodesics against closed forms, a boundary value problem, and their own order."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from problems import W_CONSTANT, W_LINEAR, W_SQUARE
from scipy.integrate import solve_ivp
from systems import plain_model
from texts import CONFIGS

from tubecert.expression import as_expression, exp, sin, symbol
from tubecert.model import build
from tubecert.simulation.adaptive.geodesics import FOUND, NOT_POSITIVE, REASONS, Geodesics
from tubecert.spec import load_text

X, Y = symbol("x"), symbol("y")
THREE = build(load_text((CONFIGS / "three_state.yaml").read_text(encoding="utf-8"), "three_state.yaml"))


def model(W):
    plain = plain_model(("x", "y"), ("0", "0"), [["0"], ["1"]])
    return replace(plain, W=tuple(tuple(as_expression(e) for e in row) for row in W), rate=Fraction(1))


def connected(geodesics, p, *ends):
    with np.errstate(all="ignore"):
        return geodesics.connect(np.array([p], dtype=float).T, np.array(ends, dtype=float).T)


def solved(system, p, q, degree=5):
    """The geodesic of one lane, at last from itself: status, energy, M gamma_s at both ends (2, n)."""
    geodesics = Geodesics(system, degree, 1)
    first, _, found = (connected(geodesics, p, q) for _ in range(3))
    assert found.energy == pytest.approx(first.energy, rel=1e-11)
    return found.status[0], found.energy[0], np.array([found.start[:, 0], found.end[:, 0]])


HALF_PLANE = model([[Y**2, 0], [0, Y**2]])  # M = I / y^2


def hyperbolic(p, q):
    return float(np.arccosh(1 + ((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2) / (2 * p[1] * q[1])))


def test_constant_metrics_have_straight_geodesics():
    W = [[Fraction(2), Fraction(1, 2)], [Fraction(1, 2), Fraction(3)]]
    p, q = np.array([0.3, -1.0]), np.array([1.0, 2.0])
    status, energy, covectors = solved(model(W), p, q)
    M = np.linalg.inv(np.array(W, dtype=float))
    assert status == FOUND
    assert energy == pytest.approx((q - p) @ M @ (q - p), rel=1e-14)
    assert np.allclose(covectors, [M @ (q - p)] * 2, rtol=1e-13)


def test_flat_metrics_in_curved_coordinates_keep_their_distances():
    """z = (x, y + x^2/2) with |dz|^2: W = J^-1 J^-T; the solver has to find the straight line in z."""
    W = [[1, -X], [-X, 1 + X**2]]
    p, q = np.array([-0.5, 0.2]), np.array([0.8, -0.4])
    z = [np.array([a, b + a * a / 2]) for a, b in (p, q)]
    status, energy, covectors = solved(model(W), p, q)
    assert status == FOUND
    assert energy == pytest.approx((z[1] - z[0]) @ (z[1] - z[0]), rel=1e-12)
    J = np.array([[1.0, 0.0], [q[0], 1.0]])
    assert np.allclose(covectors[1], J.T @ (z[1] - z[0]), atol=1e-6)


def test_distances_of_the_hyperbolic_plane_converge_with_the_degree():
    p, q = [0.0, 1.0], [0.5, 1.2]
    exact = hyperbolic(p, q)
    errors = [abs(np.sqrt(solved(HALF_PLANE, p, q, degree)[1]) - exact) for degree in (3, 5, 7, 9)]
    assert errors[1] < 1e-6
    assert all(fine < coarse / 20 for coarse, fine in pairwise(errors[:3])), errors
    assert errors[3] < 1e-11


def test_cubic_geodesics_are_as_near_where_the_metric_varies_by_a_hundredth():
    """As `simulate` takes them there: far below the thousandth of the tube that its runs are known to."""
    p, q = [0.0, 1.0], [0.004, 1.005]  # M = I/y^2
    cubic, fine = (solved(HALF_PLANE, p, q, degree) for degree in (3, 9))
    assert cubic[1] == pytest.approx(hyperbolic(p, q) ** 2, rel=1e-9)
    assert np.allclose(cubic[2], fine[2], rtol=1e-7)


def test_three_state_geodesics_satisfy_their_differential_equation():
    """Shooting along Hamilton's equations x' = W m, m' = -1/2 d(m'W m)/dx from the covector found hits the end."""

    def W(x):
        return W_CONSTANT + x * W_LINEAR + x * x * W_SQUARE

    def hamilton(s, z):
        x, m = z[:3], z[3:]
        slope = m @ (W_LINEAR + 2 * x[0] * W_SQUARE) @ m
        return np.concatenate([W(x[0]) @ m, [-0.5 * slope, 0, 0]])

    p, q = np.array([0.05, 0.08, -0.03]), np.array([-0.09, -0.07, 0.1])
    status, _, covectors = solved(THREE, p, q)
    assert status == FOUND
    done = solve_ivp(hamilton, (0, 1), np.concatenate([p, covectors[0]]), rtol=1e-12, atol=1e-12)
    assert np.allclose(done.y[:3, -1], q, atol=1e-8)
    assert np.allclose(done.y[3:, -1], covectors[1], atol=1e-7)


def test_warm_starts_are_guarded():
    """Nonsense left behind changes nothing, lane by lane: nan, infinite, or a much longer curve."""
    p, q = [0.0, 1.0], [0.6, 1.3]
    geodesics = Geodesics(HALF_PLANE, 5, 5)
    clean = connected(geodesics, p, *[q] * 5).energy
    geodesics.a[:] = [np.nan, np.inf, 0.0, 3.0, -40.0]
    again = connected(geodesics, p, *[q] * 5)
    assert not again.status.any()
    assert again.energy == pytest.approx(clean, rel=1e-11)


def test_geodesics_that_cannot_be_found_are_refused():
    broken = model([[1 - X, 0], [0, 1]])  # not positive definite beyond x = 1
    assert solved(broken, [0, 0], [1.5, 0])[0] == NOT_POSITIVE
    assert solved(broken, [0, 0], [0.5, 0])[0] == FOUND
    steep = model([[exp(-8 * sin(3 * X)), 0], [0, exp(8 * sin(5 * X))]])
    assert solved(steep, [-1.5, -1.0], [1.5, 1.0], 3)[0] in REASONS


STEEP = model([[exp(-2 * sin(3 * X)), 0], [0, exp(2 * sin(5 * X))]])


def test_where_the_quick_way_fails_newton_finds_the_geodesic():
    """M varies by e^4 and more along the curve: the Hessian of a constant metric leads nowhere."""
    found = {degree: solved(STEEP, [-0.25, -0.1], [0.3, 0.1], degree) for degree in (9, 13)}
    assert [status for status, _, _ in found.values()] == [FOUND, FOUND]
    assert found[9][1] == pytest.approx(found[13][1], rel=1e-4)


def test_no_geodesic_is_longer_than_the_segment():
    rng = np.random.default_rng(5)
    s, weight = np.polynomial.legendre.leggauss(20)
    p, ends = rng.uniform(-0.1, 0.1, 3), rng.uniform(-0.1, 0.1, (100, 3))
    found = connected(Geodesics(THREE, 5, 100), p, *ends)
    assert not found.status.any()
    for energy, q in zip(found.energy, ends, strict=True):
        x = p[0] + (s + 1) / 2 * (q[0] - p[0])
        W = W_CONSTANT + x[:, None, None] * W_LINEAR + (x**2)[:, None, None] * W_SQUARE
        assert 0 < energy <= weight / 2 @ np.einsum("i,nij,j->n", q - p, np.linalg.inv(W), q - p) * (1 + 1e-9)
