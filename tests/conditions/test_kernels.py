"""Kernels and sup D against the oracle in high precision and an integrated equation."""

from __future__ import annotations

from fractions import Fraction

import gains_oracle as oracle
import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tubecert.conditions.arithmetic import decay_mean, least_solution, log1p_ratio
from tubecert.conditions.kernels import DistanceBound, kappa, tight_kernel
from tubecert.enclosure.interval import Interval, exp

RNG = np.random.default_rng(7)
OF_COURSE = {"omega": "w", "horizon": "T"}  # names of the oracle


def scalar(x: float) -> np.ndarray:
    return np.asarray(float(x))


def random_kernel_case() -> tuple[float, float, float, float]:
    c, s0, s1 = np.exp(RNG.uniform(-3, 3, 3))
    kind = RNG.integers(4)
    w = c * (1 + [0.0, 1e-14, -1e-9, 0.0][kind]) if kind < 3 else np.exp(RNG.uniform(-3, 4))
    return float(c), float(w), float(s0), float(s1)


@pytest.mark.parametrize("ratio", [1.0, 1 + 1e-15, 1 - 1e-12, 0.3, 5.0])
def test_kappa_is_the_supremum_and_stable_at_equal_rates(ratio):
    c = 2.0
    with mpmath.workdps(60):
        C, w = mpmath.mpf(c), mpmath.mpf(c * ratio)
        exact = 1 / (mpmath.e * C) if w == C else (C / w) ** (w / (w - C)) / C
        value = kappa(Interval.exact(c), Interval.exact(c * ratio))
        assert value.lo <= exact <= value.hi
        assert value.hi - value.lo < 1e-13


@pytest.mark.slow
def test_tight_kernel_interval_contains_the_value_at_high_precision():
    with mpmath.workdps(80):
        for _ in range(300):
            case = random_kernel_case()
            exact = oracle.kernel(*map(mpmath.mpf, case))
            J = tight_kernel(*map(Interval.exact, case))
            assert J.lo <= exact <= J.hi
            assert J.hi - J.lo <= 1e-11 * float(exact)
            assert float(tight_kernel(*map(scalar, case))) == pytest.approx(float(exact), rel=1e-9)


def random_bound(horizon: bool = False) -> dict[str, float]:
    d0, beta, H0, S, e, delta, lam = np.exp(RNG.uniform(-2.5, 1.5, 7))
    d0, e, delta, S, H0 = (x * (RNG.random() > 0.2) for x in (d0, e, delta, S, H0))
    omega = lam * [1.0, 1 + 1e-13, 0.2, 3.0, 40.0][RNG.integers(5)]
    case = {"d0": d0, "beta": beta, "H0": H0, "S": S, "e": e, "delta": delta, "lam": lam, "omega": omega}
    if horizon:
        case["horizon"] = float(np.exp(RNG.uniform(-3, 2))) / lam
    return {name: float(value) for name, value in case.items()}


def test_D_is_the_solution_of_its_differential_equation():
    for _ in range(12):
        case = random_bound()

        def rate(t, D, case=case):
            decay = np.exp(-case["omega"] * t)
            xi = decay * case["H0"] + (1 - decay) * case["S"] + case["e"]
            return -case["lam"] * D + case["beta"] * xi + case["delta"]

        end = 12 / min(case["lam"], case["omega"])
        t = np.linspace(0, end, 4001)
        path = solve_ivp(rate, (0, end), [case["d0"]], t_eval=t, rtol=1e-10, atol=1e-12, method="LSODA").y[0]
        bound = DistanceBound(**{k: scalar(v) for k, v in case.items()})
        assert path.max() == pytest.approx(float(bound.supremum()), rel=2e-3)
        assert path.max() <= float(bound.supremum()) * (1 + 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("horizon", [False, True])
def test_sup_D_interval_contains_the_value_at_high_precision(horizon):
    narrow = 0
    with mpmath.workdps(80):
        for _ in range(400):
            case = random_bound(horizon)
            exact = oracle.Course(**{OF_COURSE.get(k, k): mpmath.mpf(v) for k, v in case.items()}).supremum()
            value = DistanceBound(**{k: Interval.exact(v) for k, v in case.items()}).supremum()
            assert value.lo <= exact <= value.hi
            rounded = float(DistanceBound(**{k: scalar(v) for k, v in case.items()}).supremum())
            assert rounded == pytest.approx(float(exact), rel=1e-9, abs=1e-12)
            narrow += bool(value.hi - value.lo <= 1e-11 * float(exact) + 1e-300)
    assert narrow > 380  # undecided branches cost width, but only where rounding decides


sizes = st.floats(0.0, 5.0)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.tuples(*[sizes] * 6), st.tuples(*[st.floats(0, 0.5)] * 6), st.floats(0.2, 5), st.floats(0.05, 50))
def test_sup_D_rises_with_every_size_and_intervals_include(low, extra, lam, omega):
    names = ("d0", "beta", "H0", "S", "e", "delta")
    high = [x + y for x, y in zip(low, extra, strict=True)]
    rates = {"lam": Interval.exact(lam), "omega": Interval.exact(omega)}
    below = DistanceBound(**dict(zip(names, map(Interval.exact, low), strict=True)), **rates).supremum()
    above = DistanceBound(**dict(zip(names, map(Interval.exact, high), strict=True)), **rates).supremum()
    hull = DistanceBound(**{k: Interval(a, b) for k, a, b in zip(names, low, high, strict=True)}, **rates)
    wide = hull.supremum()
    assert below.lo <= above.hi
    assert wide.lo <= below.hi
    assert above.lo <= wide.hi


@pytest.mark.parametrize("function", ["r", "mean"])
def test_removable_singularities_at_high_precision(function):
    points = [0.0, 1e-300, -1e-12, 1e-6, 9.9e-6, 1.1e-5, -1e-5, 0.3, -0.9, 25.0]
    with mpmath.workdps(60):
        for x in points:
            X = mpmath.mpf(x)
            if function == "r":
                exact = mpmath.log1p(X) / X if x else mpmath.mpf(1)
                value, near = log1p_ratio(Interval.exact(x)), log1p_ratio(scalar(x))
            else:
                exact = -mpmath.expm1(-X) / X if x else mpmath.mpf(1)
                value, near = decay_mean(Interval.exact(x)), decay_mean(scalar(x))
            assert value.lo <= exact <= value.hi
            assert value.hi - value.lo < 1e-9
            assert float(near) == pytest.approx(float(exact), rel=1e-10)


def test_undecided_signs_widen_but_never_exclude():
    # q may have either sign: the interval must hold both kernels
    wide = tight_kernel(Interval.exact(1.0), Interval.exact(2.0), Interval(0.9, 1.1), Interval(0.9, 1.1))
    for s0 in (0.9, 1.0, 1.1):
        for s1 in (0.9, 1.0, 1.1):
            assert wide.contains(float(tight_kernel(*map(scalar, (1.0, 2.0, s0, s1)))))
    assert np.isfinite(wide.hi)


def test_least_solution_is_the_least_prefixed_point():
    assert float(least_solution(scalar(2.0), scalar(0.5))) == 4.0
    assert np.isinf(least_solution(scalar(2.0), scalar(1.0)))
    value = least_solution(Interval.exact(2.0), Interval(0.4, 1.2))
    assert value.lo <= Fraction(2) / Fraction(6, 10)
    assert np.isinf(value.hi)


@pytest.mark.parametrize("w", [0.4, 1.0, 160.0])
def test_an_undecided_sign_of_q_costs_next_to_nothing(w):
    """h = b sin t has s0 = s1 = b: with c = 1 its q is 0 up to a rounding, and J is s1/(c w) all the same."""
    b = Interval(0.01 * (1 - 1e-12), 0.01 * (1 + 1e-12))
    c, omega = Interval(1 - 1e-15, 1 + 1e-15), Interval.exact(w)
    found = tight_kernel(c, omega, b, b)
    exact = float(tight_kernel(scalar(1.0), scalar(w), scalar(0.01), scalar(0.01)))
    assert found.lo <= exact * (1 + 1e-12)
    assert exact <= found.hi * (1 + 1e-12)
    assert found.hi <= exact * (1 + 1e-9)


def test_sup_D_over_a_short_horizon_where_the_filter_adds_nothing():
    """H0 = S, which intervals cannot tell from H0 > S: D goes from d0 towards A1, and by T it is far from there."""
    ends = Interval(0.0038491, 0.0038492)
    rest = {
        "d0": 0.0009, "beta": 1.15, "e": 0.0032, "delta": 0.0022, "lam": 0.4, "omega": 16.0, "horizon": 2.0,
    }  # fmt: skip
    D = DistanceBound(**{k: Interval.exact(v) for k, v in rest.items()}, H0=ends, S=ends)
    at_the_end = D.d0 * exp(-D.lam * D.horizon) + D.ultimate() * (1 - exp(-D.lam * D.horizon))
    assert D.supremum().hi <= at_the_end.hi * (1 + 1e-5)
    assert D.ultimate().lo > 1.5 * at_the_end.hi
