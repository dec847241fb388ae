"""Margins of certificates A and B against an independent high-precision implementation; what they reject."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from problems import (
    ALIVE,
    alive,
    constants,
    margin_distance,
    margins_26,
    three_state,
    two_state,
)

from tubecert.bounds.constants import TABLE, BoundConstants, Constant
from tubecert.conditions import alone
from tubecert.conditions.arithmetic import choose
from tubecert.conditions.decimals import exact, next_up, printed, round_down, round_up
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe, derived_constants
from tubecert.enclosure.interval import Interval
from tubecert.kernel import margins_along
from tubecert.kinds.table import kind_of
from tubecert.search import distance


def recipe(omega: str, Gamma: str, g: str = "3.5", R_H: str = "0.35") -> RateRecipe:
    return RateRecipe(
        bandwidth=Fraction(omega),
        adaptation_rate=Fraction(Gamma),
        predictor_gain=Fraction(g),
        projection_radius=Fraction(R_H),
    )


def oracle_26(values: dict[str, float], *, w: str, G: str):
    """The conditions written a second time, from theory.md, at 50 digits."""
    v = {k: mpmath.mpf(x) for k, x in values.items()}
    lam, rho_a, rho_r, rho, g = (mpmath.mpf(x) / 10 for x in (13, 2, 7, 9, 35))
    a, A = v["lower"], v["upper"]
    w, G = mpmath.mpf(w), mpmath.mpf(G)
    Dh, DB, root = v["h"], v["B"], mpmath.sqrt
    du = v["feedback_gain"]
    k, energy = root(a) * rho * du, v["initial_distance"] ** 2
    zp = rho * v["plan_defect_metric"] / (lam * root(a))
    xdot = v["drift_on_plan"] + DB * (2 * Dh + k)
    gs = root(A / a) * (v["f_x"] + (2 * Dh + v["u_star"] + k) * v["b_x"] + v["h_x"] * DB) + root(A) * du * DB
    s1 = v["h_t"] + v["h_x"] * xdot
    psix = 2 * v["B_x"] + DB * v["M_x"] / a
    psidot = A * (DB * gs + DB * v["M_x"] * xdot / root(A * a) + v["B_x"] * xdot)
    c = 2 * lam
    if min(c, w) * Dh <= s1:
        K = s1 / (c * w)
    else:
        p, q = w * Dh - s1, c * Dh - s1
        K = (s1 + q * (q / p) ** (c / (w - c))) / (c * w)
    z1, z2 = 2 * rho * DB * A / a * K, A * psix * K
    z3 = v["h_x"] * (4 * lam * A * DB + psidot) / (lam * w)
    xt = root(4 * Dh * s1 / (2 * g) + 4 * Dh**2)
    eta = (v["B_pinv_x"] * xdot + (2 * w + g) * v["B_pinv"]) * xt
    theta = DB * A * eta / lam
    rest = a - z2 - z3
    return {
        "26a": (rho_r**2 - energy / a - z1 - zp) / rho_r**2,
        "26b": rest / a,
        "26c": (root(G) - theta / (rho_a * rest)) / root(G),
    }


@pytest.mark.parametrize(("w", "G"), [("60", "3e5"), ("21.7", "1e7"), ("1.1", "1e9"), ("2.600001", "1e9")])
def test_margins_26_contain_an_independent_evaluation(w, G):
    margins = margins_26(alive(), recipe(w, G))
    with mpmath.workdps(50):
        expected = oracle_26(ALIVE, w=w, G=G)
        for claim in ("26a", "26b"):
            margin = margins[claim]
            assert margin.lo <= expected[claim] <= margin.hi
            assert margin.hi - margin.lo <= 1e-7 * max(1.0, abs(float(expected[claim])))
        if expected["26b"] > 0:
            assert margins["26c"].lo <= expected["26c"] <= margins["26c"].hi
        else:
            assert not margins["26c"].lo > 0


def test_a_bandwidth_of_twice_the_rate_is_no_singularity():
    assert margins_26(alive(), recipe("2.6", "1e9"))["26a"].lo > -np.inf


def test_margins_lie_between_the_safe_side_and_the_enclosures():
    wide = {k: (x, x * 1.01) if k == "lower" else (x * 0.99, x) for k, x in ALIVE.items()}
    point = margins_26(alive(), recipe("60", "1e6"))
    margins = margins_26(alive(values=wide), recipe("60", "1e6"))
    for claim, margin in margins.items():
        assert margin.lo == pytest.approx(float(point[claim].lo), abs=1e-12)
        assert margin.hi > point[claim].hi


# --- Theorem B: recipes are rejected as soon as one of their numbers is too small


def distance_recipe(problem: TubeProblem, omega: str = "60", Gamma: str = "1e5"):
    return distance.recipe_at(problem, Fraction(omega), Fraction(Gamma), Fraction("3.5"))


@pytest.mark.parametrize(
    "name", ["speed", "prediction_error", "uncertainty", "projection_radius", "adaptation_rate"]
)
def test_a_distance_recipe_with_one_number_too_small_is_rejected(name):
    problem = alive()
    good = distance_recipe(problem)
    assert margin_distance(problem, good).lo > 0
    bad = replace(good, **{name: getattr(good, name) * (1 - Fraction(1, 10**6))})
    assert margin_distance(problem, bad).lo == -np.inf


@pytest.mark.slow
def test_distance_margin_against_an_independent_evaluation():
    problem = alive()
    r = distance_recipe(problem)
    with mpmath.workdps(50):
        v = {k: mpmath.mpf(x) for k, x in ALIVE.items()}
        w, lam, rho, g = mpmath.mpf(60), mpmath.mpf("1.3"), mpmath.mpf("0.9"), mpmath.mpf("3.5")
        dbar = mpmath.sqrt(v["lower"]) * rho

        def step(Y):
            s1 = v["h_t"] + v["h_x"] * Y
            S = s1 / w
            xt = mpmath.sqrt(4 * v["h"] * s1 / (2 * g) + 4 * v["h"] ** 2)
            e = (v["B_pinv_x"] * Y + v["B_pinv"] * (w + abs(w - g))) * xt / mpmath.sqrt(10**5)
            bound = min(2 * v["h"], max(v["h_initial"], S) + e)
            return v["drift_on_plan"] + v["B"] * (v["feedback_gain"] * dbar + bound), S, e

        Y = mpmath.mpf(0)
        for _ in range(200):
            Y, S, e = step(Y)
        beta, H0, d0, delta = (
            v[k] for k in ("metric_input_gain", "h_initial", "initial_distance", "plan_defect_metric")
        )
        A1, C1 = (beta * (S + e) + delta) / lam, beta * (H0 - S)

        def D(t):
            K = (mpmath.exp(-lam * t) - mpmath.exp(-w * t)) / (w - lam)
            return A1 + (d0 - A1) * mpmath.exp(-lam * t) + C1 * K

        sup = max(D(mpmath.mpf(i) / 2000) for i in range(20000))
        margin = margin_distance(problem, r)
        assert float(margin.lo) == pytest.approx(float(1 - sup / dbar), abs=1e-5)
        assert margin.lo <= 1 - sup / dbar
        assert abs(float(r.speed) - Y) < 1e-7


def test_a_comparison_that_cannot_be_decided_yields_both_branches():
    test = Interval(np.array([-1.0, 0.5, -2.0, np.nan]), np.array([1.0, 1.0, 0.0, np.nan]))
    value = choose(test, Interval.exact(np.full(4, 5.0)), Interval.exact(np.full(4, 2.0)))
    assert list(value.lo) == [2.0, 5.0, 2.0, 2.0]
    assert list(value.hi) == [5.0, 5.0, 2.0, 5.0]


# --- invariance and mutation


def scaled(c: float) -> dict[str, float]:
    """The constants after W -> c W."""
    root = np.sqrt(c)
    factors = {
        "lower": 1 / c,
        "upper": 1 / c,
        "M_x": 1 / c,
        "feedback_gain": root,
        "metric_input_gain": 1 / root,
        "initial_distance": 1 / root,
        "plan_defect_metric": 1 / root,
    }
    return {name: value * factors.get(name, 1.0) for name, value in ALIVE.items()}


@pytest.mark.parametrize("c", [0.01, 0.1, 10.0, 100.0])
def test_margins_do_not_depend_on_the_scale_of_the_metric(c):
    base, other = alive(), alive(values=scaled(c))
    for claim, margin in margins_26(base, recipe("60", "1e6")).items():
        assert float(margins_26(other, recipe("60", "1e6"))[claim].lo) == pytest.approx(
            float(margin.lo), rel=1e-10
        )
    first, second = distance_recipe(base), distance_recipe(other)
    assert float(margin_distance(other, second).lo) == pytest.approx(
        float(margin_distance(base, first).lo), rel=1e-9
    )


IN_26 = set(ALIVE) - {
    "metric_input_gain",
    "h_initial",
    "plan_defect",
    "f",
}
IN_DISTANCE = {
    "lower", "B", "B_pinv", "B_pinv_x", "h", "h_x", "h_t", "h_initial", "feedback_gain", "metric_input_gain",
    "drift_on_plan", "initial_distance", "plan_defect_metric",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ALIVE))
def test_every_constant_acts_where_it_should_and_only_there(name):
    base = alive()
    moved = alive(values={name: ALIVE[name] * 0.98})
    before, after = (margins_26(p, recipe("60", "1e6")) for p in (base, moved))
    # R_H stays: the projection of a running controller does not shrink with a constant
    change = max(abs(float(before[c].lo - after[c].lo)) for c in before)
    assert (change > 1e-7) == (name in IN_26)
    margins = [float(margin_distance(p, distance_recipe(p)).lo) for p in (base, moved)]
    assert (abs(margins[0] - margins[1]) > 1e-7) == (name in IN_DISTANCE)


NEEDED = {
    "0": {"lower", "h", "metric_input_gain", "initial_distance", "plan_defect_metric"},
    "A": IN_26,
    "B": IN_DISTANCE,
}


@pytest.mark.parametrize("letter", NEEDED)
def test_a_theorem_needs_what_it_contains(letter):
    assert kind_of(letter).theorem.needs(alive()) == NEEDED[letter]


def proofs() -> list[tuple[TubeProblem, Any]]:
    """A problem with a recipe of every theorem."""
    problem = replace(alive(values={"initial_distance": 0.05}), horizon=Fraction(4))
    return [(problem, alone.NoGains()), (problem, recipe("60", "1e7")), (problem, distance_recipe(problem))]


def lows(problem: TubeProblem, own: Any) -> list[float]:
    return [float(margin.lo[0]) for margin in margins_along(problem, [own]).values()]


@pytest.mark.parametrize("name", sorted(ALIVE))
def test_more_of_any_constant_leaves_no_more(name):
    for problem, own in proofs():
        known = {item: getattr(problem.constants, item).above for item in TABLE}
        moved = known | {name: known[name] * (0.999 if name == "lower" else 1.001)}
        after = lows(replace(problem, constants=constants(**moved)), own)
        assert all(b <= a + 1e-12 for a, b in zip(lows(problem, own), after, strict=True))


OF_RECIPE = {
    "bandwidth": "1/s",
    "adaptation_rate": "u^2",
    "predictor_gain": "1/s",
    "projection_radius": "u",
    "speed": "x/s",
    "prediction_error": "u",
    "uncertainty": "u",
}


def factor(unit: str, sizes: dict[str, Fraction]) -> Fraction:
    """What a number in a unit becomes when the units of `sizes` are so many times smaller."""
    above, _, below = unit.replace("(", "").replace(")", "").partition("/")
    found = Fraction(1)
    for part, sign in ((above, 1), (below, -1)):
        for name, power in re.findall(r"([a-z])(?:\^(\d))?", part):
            found *= sizes.get(name, Fraction(1)) ** (sign * int(power or 1))
    return found


@pytest.mark.parametrize(
    "sizes", [{"u": Fraction(8)}, {"s": Fraction(8)}, {"u": Fraction(1, 4), "s": Fraction(2)}], ids=str
)
def test_units_of_inputs_and_time_do_not_matter(sizes):
    """By the units that the constants state; factors are powers of two, so that every number stays exact."""
    for problem, own in proofs():
        known = {item: getattr(problem.constants, item).above for item in TABLE}
        other = replace(
            problem,
            constants=constants(**{k: v * float(factor(TABLE[k].unit, sizes)) for k, v in known.items()}),
            rate=problem.rate / factor("s", sizes),
            horizon=problem.horizon * factor("s", sizes),
            predictor_gain=problem.predictor_gain / factor("s", sizes),
        )
        scales = {item.name: factor(OF_RECIPE[item.name], sizes) for item in fields(own)}
        changed = replace(own, **{name: getattr(own, name) * scale for name, scale in scales.items()})
        assert min(lows(problem, own)) > 0
        assert lows(other, changed) == pytest.approx(lows(problem, own), rel=1e-9)


def test_derived_constants_are_enclosures_by_name():
    wide = {k: (x, x * 1.01) if k == "lower" else (x * 0.99, x) for k, x in ALIVE.items()}
    narrow, both = (derived_constants(alive(values=v), recipe("60", "1e6")) for v in (ALIVE, wide))
    assert set(narrow) == {
        "speed", "uncertainty_rate", "prediction_error", "filter_error", "theta", "Psi_x", "geodesic_rate",
        "Psi_rate", "zeta_1", "zeta_2", "zeta_3",
    }  # fmt: skip
    for name, constant in narrow.items():
        assert constant.gap < 1e-12
        assert both[name].below < constant.below <= both[name].above


# --- options


def test_a_predictor_without_damping_is_refused():
    with pytest.raises(ValueError, match="stable"):
        alive(predictor_gain=Fraction(-1))


def test_the_smooth_projection_needs_a_larger_radius():
    problem = alive(smooth=Fraction("0.1"))
    assert problem.projection_radius**2 >= Fraction("1.1") * Fraction(0.35) ** 2
    assert margins_26(problem, recipe("60", "1e6"))["26a"].lo == -np.inf  # R_H = Dh does not serve
    R_H = problem.projection_radius
    served = margins_26(problem, replace(recipe("60", "1e6"), projection_radius=R_H))
    assert -np.inf < served["26c"].lo < margins_26(alive(), recipe("60", "1e6"))["26c"].lo


def test_inconsistent_radii_are_misuse():
    with pytest.raises(ValueError, match="rho must be"):
        alive(rho=Fraction("0.89"))
    with pytest.raises(ValueError, match="positive"):
        alive(epsilon=Fraction(0))


def test_a_finite_horizon_never_hurts():
    long, short = alive(), alive(horizon=Fraction("0.02"))
    assert margin_distance(short, distance_recipe(short)).lo > margin_distance(long, distance_recipe(long)).lo


# --- decimals


def test_rounding_is_exact():
    assert round_up(48.9205, 4) == Fraction("48.93")
    assert round_up(Fraction("48.92"), 4) == Fraction("48.92")
    assert round_up(9.9999, 3) == 10
    assert round_down(0.090669, 4) == Fraction("0.09066")
    assert round_down(1234567.0, 4) == 1234000
    assert next_up(Fraction("9999"), 4) == 10000
    assert next_up(Fraction("0.001"), 4) == Fraction("0.001001")
    assert printed(Fraction("48.93")) == 48.93
    assert printed(Fraction("0.1234567890123456789")) == "0.1234567890123456789"
    assert exact(0.1) == Fraction(1, 10)
    rng = np.random.default_rng(3)
    for x in np.exp(rng.uniform(-40, 40, 300)):
        up, down = round_up(float(x), 4), round_down(float(x), 4)
        assert down <= Fraction(float(x)) <= up <= down * Fraction(1001, 1000)
        assert exact(printed(up)) == up


def test_table_and_helper_agree():
    assert set(ALIVE) <= set(TABLE)
    assert isinstance(constants(**ALIVE), BoundConstants)
    assert Constant.exactly(1.0).gap == 0
    assert three_state().constants.h_x.above == 0
    assert two_state().states == 2
