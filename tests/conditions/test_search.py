"""Smallest gains against reference rows, dense grids and brute force; gains asked for; what cannot be met."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from problems import (
    ALIVE,
    alive,
    judged_26,
    judged_distance,
    margin_distance,
    three_state,
    two_state,
    verdict_at,
)

from tubecert.conditions import distance as theorem_b
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe, rate_margins
from tubecert.conditions.theorem import Asked
from tubecert.records import to_json
from tubecert.search.distance import DistanceSearch, least_rate
from tubecert.search.elasticities import elasticities
from tubecert.search.gains import LEAST
from tubecert.search.proposers import PROPOSERS
from tubecert.search.rates import RateSearch
from tubecert.verdict import Verdict


def gains(pair) -> tuple[float, float]:
    return float(pair.recipe.bandwidth), float(pair.recipe.adaptation_rate)


def unmet() -> TubeProblem:
    """No gains keep this tube."""
    return two_state(values={"plan_defect_metric": 1000.0})


@pytest.mark.slow
def test_three_state_corrected():
    assert gains(judged_distance(three_state()).at("least_adaptation")) == pytest.approx(
        (10.8, 1.38e4), rel=5e-3
    )


def test_two_state_function_level():
    result = judged_distance(two_state())
    assert gains(result.at("split"))[0] == pytest.approx(15.136, rel=1e-3)
    n = two_state().floats()
    assert float(least_rate(two_state(), n, np.array([15.136]))[0][0]) == pytest.approx(2.661e5, rel=1e-3)
    assert gains(result.at("least_adaptation")) == pytest.approx((26.383, 6.091e4), rel=1e-3)
    # P = I and A_m = -omega I: the best gain of a constant B
    assert (
        result.at("least_adaptation").recipe.predictor_gain == result.at("least_adaptation").recipe.bandwidth
    )


def test_the_row_of_least_bandwidth_has_no_larger_one_than_that_of_least_adaptation():
    """With much left to rho_a the split pair had omega = 30.28 beside 26.39, and the larger Gamma."""
    result = judged_distance(two_state(epsilon=Fraction("0.3"), rho_r=Fraction("0.3"), rho_a=Fraction("0.4")))
    assert (
        gains(result.at("split"))
        == gains(result.at("least_adaptation"))
        == pytest.approx((26.39, 6.09e4), rel=1e-3)
    )


@pytest.mark.parametrize(("delta", "omega", "Gamma"), [(0.1, 32.2, 1.35e5), (0.3, 58.0, 1.43e6)])
def test_two_state_with_a_plan_defect(delta, omega, Gamma):
    result = judged_distance(two_state(values={"plan_defect_metric": delta}))
    assert gains(result.at("least_adaptation"))[0] == pytest.approx(omega, rel=0.03)
    assert gains(result.at("least_adaptation"))[1] == pytest.approx(Gamma, rel=0.01)


def printed_gains(problem: TubeProblem) -> tuple[Fraction, ...]:
    A, B = judged_26(problem), judged_distance(problem)
    return (
        A.decisive.recipe.bandwidth,
        A.decisive.recipe.adaptation_rate,
        B.at("least_adaptation").recipe.bandwidth,
        B.at("least_adaptation").recipe.adaptation_rate,
    )


def test_printed_gains_are_pinned():
    assert printed_gains(alive()) == PINNED


PINNED = tuple(Fraction(x) for x in ("7.548", "42750", "3.5", "78.74"))


# where a constant hardly acts at the pinned point, another point shows it
ELSEWHERE = {"u_star": {"u_star": 40.0}, "h_initial": {"h_t": 0.1, "h_x": 0.01, "h": 2.2, "h_initial": 2.0}}
INERT = {"f", "plan_defect"}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(ALIVE) - INERT))
def test_a_constant_reduced_by_two_per_cent_changes_the_printed_gains(name):
    values = ALIVE | ELSEWHERE.get(name, {})
    base = printed_gains(alive(values=values)) if name in ELSEWHERE else PINNED
    assert printed_gains(alive(values=values | {name: values[name] * 0.98})) != base


def rate_needed_by_brute_force(problem: TubeProblem, grid: np.ndarray) -> np.ndarray:
    """Gamma by bisection on the margin of (26c) alone, infinite where (26a) or (26b) fails."""
    n = problem.floats()
    g = np.full_like(grid, float(problem.predictor_gain))
    low, high = np.full_like(grid, -10.0), np.full_like(grid, 40.0)
    for _ in range(60):
        mid = (low + high) / 2
        holds = rate_margins(n, grid, np.exp(mid), g)["26c"] > 0
        low, high = np.where(holds, low, mid), np.where(holds, mid, high)
    margins = rate_margins(n, grid, np.exp(high), g)
    return np.where((margins["26a"] > 0) & (margins["26b"] > 0), np.exp(high), np.inf)


CASES_26 = [
    {},
    {"values": {"M_x": 12.0}},  # (26b) binds
    {"values": {"h": 0.004, "h_t": 0.002, "h_x": 0.0001}},  # below 2 lambda
    {"values": {"h": 0.04, "h_t": 0.002, "h_x": 0.001}},
]


@pytest.mark.slow
@pytest.mark.parametrize("options", CASES_26)
def test_least_gains_of_26_against_brute_force(options):
    problem = alive(**options)
    result = judged_26(problem)
    assert result.verdict is Verdict.CERTIFIED
    omega, Gamma = gains(result.decisive)
    grid = np.geomspace(1.3e-3, 2e3, 60001)
    with np.errstate(all="ignore"):
        needed = rate_needed_by_brute_force(problem, grid)
        left = rate_margins(problem.floats(), grid, np.full_like(grid, 1e30), np.full_like(grid, 3.5))["26b"]
    feasible = grid[np.isfinite(needed)]
    assert result.proposal.infimum == pytest.approx(feasible[0], rel=1e-3)
    admitted = grid[np.isfinite(needed) & (left >= 0.01)]
    assert omega == pytest.approx(admitted[0], rel=2e-3)
    assert Gamma == pytest.approx(float(rate_needed_by_brute_force(problem, np.array([omega]))[0]), rel=2e-3)
    assert gains(result.at("least_adaptation"))[1] == pytest.approx(needed.min(), rel=2e-3)


def test_where_26b_binds_a_hundredth_is_left():
    result = judged_26(alive(values={"M_x": 12.0}))
    assert result.proposal.binds == "26b"
    assert result.proposal.infimum < float(result.decisive.recipe.bandwidth)
    assert float(result.decisive.margins["26b"].lo) == pytest.approx(0.01, rel=0.1)
    assert gains(result.at("least_adaptation"))[1] < 0.1 * gains(result.decisive)[1]
    assert judged_26(alive()).proposal.binds == "26a"


@pytest.mark.slow
@pytest.mark.parametrize("options", CASES_26)
def test_printed_pairs_of_26_are_proven_and_cannot_be_smaller(options):
    problem = alive(**options)
    result = judged_26(problem, curve=True)
    for recipe in (result.decisive.recipe, result.at("least_adaptation").recipe, *result.curve):
        assert verdict_at(problem, recipe) is Verdict.CERTIFIED
        less = replace(recipe, adaptation_rate=recipe.adaptation_rate * Fraction("0.998"))
        assert verdict_at(problem, less) is Verdict.REFUTED
    narrower = replace(result.decisive.recipe, bandwidth=Fraction(result.proposal.infimum * 0.999))
    assert verdict_at(problem, narrower) is Verdict.REFUTED
    assert len(result.curve) >= 20


def test_auto_takes_the_best_predictor_gain_of_26():
    problem = alive(predictor_gain=None)
    result = judged_26(problem, curve=True)
    w, G = gains(result.decisive)
    n = problem.floats()
    g = np.geomspace(0.01, 1000, 4001)
    margins = rate_margins(n, np.full_like(g, w), np.full_like(g, G), g)["26c"]
    assert float(result.decisive.recipe.predictor_gain) == pytest.approx(g[np.argmax(margins)], rel=0.03)
    assert float(result.decisive.margins["26c"].lo) >= margins.max() - 1e-4
    assert gains(judged_26(alive()).decisive)[1] * 1.001 > G


def least_rate_by_scan(problem: TubeProblem, omegas: np.ndarray, g: float | None) -> tuple[float, float]:
    """(omega, Gamma) by a scan over omega and e with an iterated fixed point and a time grid for sup D."""
    n = problem.floats()
    v = {name: float(x) for name in n.__slots__ if name != "horizon" and (x := getattr(n, name)) is not None}
    dbar = np.sqrt(v["a"]) * v["rho"]
    t = np.concatenate([[0.0], np.geomspace(1e-4, 30, 500)])[:, None]
    best = (np.inf, np.inf)
    for w in omegas:
        e = np.geomspace(1e-3, 1, 400) * dbar * v["lam"] / v["beta"]
        Y = np.full_like(e, v["phi"])
        for _ in range(300):
            S = (v["Dht"] + v["Dhx"] * Y) / w
            Y = v["phi"] + v["DB"] * (
                v["du"] * dbar + np.minimum(v["Dh"] + v["R"], np.maximum(v["H0"], S) + e)
            )
        S = (v["Dht"] + v["Dhx"] * Y) / w
        A1 = (v["beta"] * (S + e) + v["delta"]) / v["lam"]
        K = (np.exp(-v["lam"] * t) - np.exp(-w * t)) / (w - v["lam"])
        D = A1 + (v["d0"] - A1) * np.exp(-v["lam"] * t) + v["beta"] * (v["H0"] - S) * K
        gain = np.full_like(e, w) if g is None else np.full_like(e, g)
        hs = v["Dh"] + v["R"]
        xt = np.sqrt(2 * hs * (w * S) / (2 * gain) + hs**2)
        eta = (v["DBpx"] * Y + v["DBp"] * (w + np.abs(w - gain))) * xt
        Gamma = np.where(D.max(axis=0) < dbar, (eta / e) ** 2, np.inf).min()
        best = min(best, (float(Gamma), float(w)))
    return best[1], best[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "g"),
    [
        (two_state(), None),
        (three_state(), None),
        (alive(), 3.5),
        (alive(values={"B_pinv_x": 40.0}), 3.5),  # the best e lies inside (0, e_max)
        (alive(values={"initial_distance": 0.7, "h_x": 0.9}), 3.5),
    ],
)
def test_least_gamma_against_brute_force(problem, g):
    found = gains(judged_distance(problem).at("least_adaptation"))
    omega, Gamma = least_rate_by_scan(problem, found[0] * np.geomspace(0.5, 2, 81), g)
    assert found[1] == pytest.approx(Gamma, rel=0.03)
    assert found[1] <= Gamma * (1 + 2e-3)
    assert found[0] == pytest.approx(omega, rel=0.1)


@pytest.mark.slow
def test_auto_takes_the_best_predictor_gain_of_b():
    problem = alive(predictor_gain=None, values={"B_pinv_x": 300.0, "h_t": 40.0})
    low = judged_distance(problem, curve=True).curve[0].bandwidth
    recipe = DistanceSearch(problem).at(low)
    n = problem.floats()
    g = np.geomspace(0.2, 5, 2000) * float(low)
    rates = least_rate(problem, n, np.full_like(g, float(low)), g)[0]
    assert float(recipe.adaptation_rate) == pytest.approx(rates.min(), rel=2e-3)
    assert float(recipe.predictor_gain) == pytest.approx(g[np.argmin(rates)], rel=0.03)
    assert recipe.predictor_gain > low


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem",
    [two_state(), three_state(), alive(), alive(predictor_gain=None), alive(smooth=Fraction("0.1"))],
)
def test_printed_pairs_of_b_are_proven_and_cannot_be_smaller(problem):
    result = judged_distance(problem, curve=True)
    assert result.verdict is Verdict.CERTIFIED
    assert len(result.curve) >= 20
    for recipe in (result.at("split").recipe, result.at("least_adaptation").recipe, *result.curve):
        assert margin_distance(problem, recipe).lo > 0
    for pair in (result.at("split"), result.at("least_adaptation")):
        less = replace(pair.recipe, adaptation_rate=pair.recipe.adaptation_rate * Fraction("0.99"))
        assert theorem_b.distance_ceiling(problem, less) <= 0
    least = min(float(r.adaptation_rate) for r in result.curve)
    assert least >= 0.999 * gains(result.at("least_adaptation"))[1]
    assert result.at("least_adaptation").ultimate_radius < float(problem.rho)


@pytest.mark.slow
def test_gains_asked_for_are_judged_as_given():
    problem = alive()
    pair = judged_26(problem).decisive
    w, G = pair.recipe.bandwidth, pair.recipe.adaptation_rate
    assert judged_26(problem, gains=(w, G)).verdict is Verdict.CERTIFIED
    assert judged_26(problem, gains=(w, G)).decisive.recipe == pair.recipe
    refuted = judged_26(problem, gains=(w, G * Fraction("0.99")))
    assert refuted.verdict is Verdict.REFUTED
    assert [item.claim for item in refuted.shortfalls] == ["26c"]
    assert judged_26(problem, gains=(w / 2, G)).verdict is Verdict.REFUTED
    least = judged_distance(problem).at("least_adaptation").recipe
    same = judged_distance(problem, gains=(least.bandwidth, least.adaptation_rate))
    assert same.verdict is Verdict.CERTIFIED
    assert same.at("asked").recipe == least
    low = judged_distance(problem, gains=(least.bandwidth, least.adaptation_rate / 2))
    assert low.verdict is Verdict.REFUTED
    assert low.shortfalls[0].claim == "distance"
    assert low.at("least_adaptation") is not None


@pytest.mark.slow
def test_a_gap_in_the_constants_leaves_gains_undecided():
    values = {k: (x, x * 1.01) if k == "lower" else (x * 0.99, x) for k, x in ALIVE.items()}
    problem = alive(values=values)
    pair = judged_26(problem).decisive.recipe
    least = judged_distance(problem).at("least_adaptation").recipe
    less = Fraction("0.97")
    asked = judged_26(problem, gains=(pair.bandwidth, pair.adaptation_rate * less))
    assert asked.verdict is Verdict.UNDECIDED
    assert (
        judged_distance(problem, gains=(least.bandwidth, least.adaptation_rate * less)).verdict
        is Verdict.UNDECIDED
    )


def test_an_initial_distance_beyond_the_tube_is_refuted_by_name():
    problem = alive(values={"initial_distance": 0.9})
    result = judged_distance(problem)
    assert result.verdict is Verdict.REFUTED
    assert [item.claim for item in result.shortfalls] == ["initial_distance"]
    assert result.shortfalls[0].missing == pytest.approx(0.9 - np.sqrt(0.9) * 0.9)
    result = judged_26(problem)
    assert result.verdict is Verdict.REFUTED
    assert result.shortfalls[0].claim == "26a"
    assert result.decisive is None


def test_a_plan_defect_beyond_the_tube_is_refuted_by_name():
    result = judged_distance(alive(values={"plan_defect_metric": 1.3}))
    assert [item.claim for item in result.shortfalls] == ["plan_defect"]
    wide = alive(values={"plan_defect_metric": (0.1, 1.3)})
    assert judged_distance(wide).verdict is Verdict.UNDECIDED


def test_no_uncertainty_needs_next_to_no_gain():
    problem = alive(values={"h": 0.0, "h_x": 0.0, "h_t": 0.0, "h_initial": 0.0})
    for result in (judged_26(problem), judged_distance(problem)):
        assert result.verdict is Verdict.CERTIFIED


@pytest.mark.slow
def test_results_are_json_and_recipes_are_decimals():
    for problem in (alive(), alive(predictor_gain=None), alive(values={"initial_distance": 0.9})):
        for result in (judged_26(problem), judged_distance(problem)):
            text = json.dumps(to_json(result.data()), allow_nan=False, sort_keys=True)
            assert json.loads(text)["verdict"] == str(result.verdict)
    result = judged_26(alive())
    data = to_json(result.data())
    assert data["predictor_gain"] == 3.5
    assert Fraction(repr(data["bandwidth"])) == result.decisive.recipe.bandwidth
    recipe = to_json(judged_distance(alive()).at("least_adaptation").recipe)
    again = theorem_b.DistanceRecipe(**{k: Fraction(repr(x)) for k, x in recipe.items()})
    assert margin_distance(alive(), again).lo > 0
    recipe = judged_26(two_state(predictor_gain=None)).decisive.recipe
    assert RateRecipe(**{k: Fraction(repr(x)) for k, x in to_json(recipe).items()}) == recipe


def test_elasticities_are_the_slopes_of_the_search():
    problem = alive()
    result = judged_distance(problem)
    slopes = elasticities(DistanceSearch, problem, result.at("least_adaptation").recipe)
    n = problem.floats()
    w = np.array([float(result.at("least_adaptation").recipe.bandwidth)])
    for name in ("metric_input_gain", "h_t", "lower"):
        moved = alive(values={name: ALIVE[name] * 1.001})
        ratio = least_rate(moved, moved.floats(), w)[0] / least_rate(problem, n, w)[0]
        assert slopes[name] == pytest.approx(float(np.log(ratio[0]) / np.log(1.001)), rel=0.02)
    assert set(slopes) <= set(ALIVE)
    assert elasticities(RateSearch, problem, judged_26(problem).at("least_adaptation").recipe)[
        "B_pinv"
    ] == pytest.approx(2.0, abs=0.2)


def random_problem(rng: np.random.Generator) -> TubeProblem:
    """Constants over orders of magnitude, some of them 0 or without a bound, any option."""
    spread = rng.choice([0.3, 2.0, 6.0])
    keep = {"lower", "upper", "B", "B_pinv", "metric_input_gain"}
    values = {
        name: float(x * np.exp(rng.normal() * spread)) * float(name in keep or rng.random() > 0.08)
        for name, x in ALIVE.items()
    }
    values["upper"] = max(values["upper"], values["lower"])
    values["h_initial"] = min(values["h_initial"], values["h"])
    if rng.random() < 0.1:
        values[rng.choice(["feedback_gain", "M_x", "h_x", "h", "f"])] = float("inf")
    rate, epsilon, rho_a, horizon = (Fraction(float(x)) for x in np.exp(rng.normal(size=4) * spread))
    return alive(
        values=values,
        rate=rate,
        epsilon=epsilon,
        rho_a=rho_a,
        rho_r=epsilon,
        rho=epsilon + rho_a,
        predictor_gain=[None, Fraction("3.5")][rng.integers(2)],
        horizon=[None, horizon][rng.integers(2)],
        smooth=[None, Fraction(1, 10)][rng.integers(2)],
    )


@pytest.mark.slow
@pytest.mark.parametrize("recipe", [RateRecipe, DistanceRecipe])
@pytest.mark.parametrize("problem", [two_state(), three_state(), alive(predictor_gain=None), unmet()])
def test_the_least_rate_alone_is_that_of_the_whole_proposal(recipe, problem):
    proposer = PROPOSERS[recipe]
    whole = proposer.propose(problem, Asked())
    assert proposer.least(problem) == (whole.decisive if whole.role == LEAST else whole.beside.get(LEAST))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_problems_end_in_a_verdict_that_says_why(seed):
    rng = np.random.default_rng(seed)
    for _ in range(12):
        problem = random_problem(rng)
        wish = Fraction(float(np.exp(rng.normal() * 3)))
        for asked in ({}, {"gains": (wish, wish)}):
            for search in (judged_26, judged_distance):
                result = search(problem, **asked)
                json.dumps(to_json(result.data()), allow_nan=False)
                assert bool(result.shortfalls) == (result.verdict is not Verdict.CERTIFIED)


def test_a_constant_without_a_bound_is_named():
    problem = alive(values={"M_x": float("inf")})
    result = judged_26(problem)
    assert result.verdict is Verdict.UNDECIDED
    assert [(item.claim, item.constant) for item in result.shortfalls] == [("bounded", "M_x")]
    assert judged_distance(problem).verdict is Verdict.CERTIFIED  # no M_x in B
