"""The numbers of docs/errata.md: each counterexample to a printed statement, computed here."""

from math import pi

import numpy as np
import pytest


def gain(form, B):
    """max(0, v'Fv)/(2 |Bv| |v|) over the unit circle, and the printed lmax(F)/(2 smin>0(B))."""
    angle = np.linspace(0, pi, 400_001)
    v = np.stack([np.cos(angle), np.sin(angle)])
    quadratic = np.einsum("in,ij,jn->n", v, form, v)
    reach = np.abs(B @ v)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.where(reach > 1e-9, np.maximum(quadratic, 0) / (2 * reach), 0.0)
    return value.max(), np.linalg.eigvalsh(form)[-1] / (2 * np.linalg.norm(B))


@pytest.mark.parametrize(("power", "printed", "true"), [(4.0, 1.5, 1.0), (1.5, 0.25, -0.25)])
def test_the_factor_two_of_the_contraction_condition(power, printed, true):
    """x' = x on [1, 2], M = x^-p: d_f M = -p M and M f_x = M."""
    assert (power - 1) / 2 == pytest.approx(printed)
    assert (power - 2) / 2 == pytest.approx(true)
    x0, nearby = 1.0, 1.0 + 1e-7
    t = 0.5
    length = [abs(b - a) * a ** (-power / 2) for a, b in ((x0, nearby), (x0 * np.exp(t), nearby * np.exp(t)))]
    assert -np.log(length[1] / length[0]) / t == pytest.approx(true, abs=1e-6)


@pytest.mark.parametrize(
    ("e", "c", "d", "printed", "true"),
    [
        (0, 1, 0, 0.5, 1.0),
        (0.01, 1, 1, 0.305, 0.896),
        (1e-3, 1, 10, 0.049, 0.900),
        (1e-3, 1, 100, 0.0045, 0.684),
    ],
)
def test_the_printed_feedback_bound_misses_cross_terms(e, c, d, printed, true):
    found, formula = gain(np.array([[-e, c], [c, -d]], dtype=float), np.array([0.0, 1.0]))
    assert formula == pytest.approx(printed, rel=0.02)
    assert found == pytest.approx(true, rel=2e-3)


def test_the_printed_feedback_bound_changes_with_the_unit_of_the_metric():
    """f = 0, B = 1, M = c: the feedback -lambda x is the same for every c; the printed bound times rho is not."""
    rate = 1.0
    for c in (0.01, 1.0, 100.0):
        W = 1 / c
        printed = (2 * rate * W / W) / 2 / (1 / np.sqrt(W))  # lmax(F~)/(2 B~), F = 2 lambda W
        assert printed == pytest.approx(rate / np.sqrt(c))
        assert printed * np.sqrt(c) == pytest.approx(rate)  # du d = du sqrt(c) |x| is the truth


def test_the_smooth_projection_needs_a_larger_ball():
    def push(radius, layer, s, h, y):
        F = ((1 + layer) * s * s - radius**2) / (layer * radius**2)
        projected = y - F * y if F > 0 and y * s > 0 else y
        return (s - h) * (projected - y)

    assert push(1.0, 0.1, 0.97, 1.0, 1.0) == pytest.approx(0.0105, rel=1e-2)
    s = np.linspace(-np.sqrt(1.1), np.sqrt(1.1), 2001)
    worst = max(push(np.sqrt(1.1), 0.1, a, h, y) for a in s for h in (-1.0, 1.0) for y in (-1.0, 1.0))
    assert worst <= 1e-12


def tracking_gap(K, *, step=4e-6):
    """sup |x_r - x| and sup |x| of the loop x' = -2 x - K bump(x) + u_a, h = 0, sigma_hat(0) = Dh, A_m = -1."""

    x0, omega, Gamma, Dh, horizon = 0.8, 20.0, 27983.0, 0.1, 0.35

    def drift(x):
        z = (x - 0.5) / 0.1
        return -2 * x - (K * (1 - z * z) ** 2 if abs(z) < 1 else 0.0)

    x = reference = x0  # the reference knows h = 0: its adaptive input is 0
    error, estimate, u, gap, largest = 0.0, Dh, 0.0, 0.0, x0
    for _ in range(int(horizon / step)):
        half_x, half_r = x + 0.5 * step * (drift(x) + u), reference + 0.5 * step * drift(reference)
        x, reference = x + step * (drift(half_x) + u), reference + step * drift(half_r)
        error, estimate, u = (
            error + step * (estimate - error),
            min(Dh, max(-Dh, estimate - step * Gamma * error)),
            u - step * omega * (u + estimate),
        )
        gap, largest = max(gap, abs(reference - x)), max(largest, abs(x))
    return gap, largest


@pytest.mark.slow
def test_the_bound_between_plan_and_reference_is_false():
    """M = B = 1, x* = 0, lambda = 1, f = -2 x - K bump(x), h = 0: (26a)-(26c) hold, |x_r - x| > rho_a."""
    omega, Gamma, rho_a, x0, Dh = 20.0, 27983.0, 0.05, 0.8, 0.1
    rho = x0 + 0.2 + rho_a
    assert (x0 + 0.2) ** 2 >= x0**2 + 2 * rho * Dh / (omega - 2)
    assert np.sqrt(Gamma) > (2 * omega + 1) * 2 * Dh / rho_a
    for K, least in ((2e3, 1.2), (2e4, 3.0)):
        gap, largest = tracking_gap(K)
        assert gap > least * rho_a
        assert largest < rho  # the tube around the plan holds


def test_a_geodesic_may_leave_the_tube():
    """M = 16 inside radius 1, 1 beyond 1.2, at most 16 between: around is shorter than through."""
    around = 2 * (0.05 * 4 + 0.2 * 4) + pi * 1.2
    assert around < 4 * 1.9


def test_the_norm_of_the_differentiated_filter_is_twice_the_bandwidth():
    """The impulse response of s C(s) is omega (delta - omega e^(-omega t)); that of 1 - C is delta - omega e^(..)."""
    omega = 7.0
    t = np.linspace(0, 10 / omega, 200_001)
    tail = np.trapezoid(omega * np.exp(-omega * t), t)
    assert omega * (1 + tail) == pytest.approx(2 * omega, rel=1e-4)
    assert 1 + tail == pytest.approx(2, rel=1e-4)


def test_the_derivative_of_the_plan_makes_the_feedback_unbounded():
    """f = -x, M = I, B = (0, 1)', lambda = 1/2, unmatched defect p = (1, 0)': constraint 2 e2 k <= |e|^2 + 2 e1 p1."""
    e1, p1 = -0.1, 1.0
    needed = [abs(min(0.0, e1**2 + e2**2 + 2 * e1 * p1)) / (2 * e2) for e2 in (1e-1, 1e-3, 1e-6)]
    assert needed[0] < needed[1] < needed[2]
    assert needed[2] > 9e4


def test_the_weak_form_of_the_distance_bound_is_not_monotone():
    from tubecert.conditions.kernels import DistanceBound, kappa

    def both(S, omega=5.0, d0=0.5):
        values = {"d0": d0, "beta": 1, "H0": 1, "S": S, "e": 0, "delta": 0, "lam": 1, "omega": omega}
        D = DistanceBound(**{name: np.asarray(float(x)) for name, x in values.items()})
        weak = max(d0, S) + max(1 - S, 0) * float(kappa(np.asarray(1.0), np.asarray(omega)))
        return float(D.supremum()), weak

    sharp, weak = zip(both(0.0), both(0.4), strict=True)
    assert sharp == pytest.approx((0.528, 0.552), abs=1e-3)
    assert weak == pytest.approx((0.634, 0.580), abs=1e-3)
