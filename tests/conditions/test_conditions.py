"""Margins of certificates 0, A and B: what they need, scales and units that do not matter, decimals."""

import re
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from problems import ALIVE, alive, constants, margin_distance, margins_26

from tubecert.bounds.constants import TABLE
from tubecert.conditions import alone
from tubecert.conditions.arithmetic import choose
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe, derived_constants
from tubecert.enclosure.constant import exact, next_up, printed, round_down, round_up
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


def distance_recipe(problem: TubeProblem, omega: str = "60", Gamma: str = "1e5"):
    return distance.recipes_at(problem, [(Fraction(omega), Fraction(Gamma), Fraction("3.5"))])[0]


def test_a_comparison_that_cannot_be_decided_yields_both_branches():
    test = Interval(np.array([-1.0, 0.5, -2.0, np.nan]), np.array([1.0, 1.0, 0.0, np.nan]))
    value = choose(test, Interval.exact(np.full(4, 5.0)), Interval.exact(np.full(4, 2.0)))
    assert list(value.lo) == [2.0, 5.0, 2.0, 2.0]
    assert list(value.hi) == [5.0, 5.0, 2.0, 5.0]


def scaled(c: float) -> dict[str, float]:
    """The constants after W -> c W."""
    root = np.sqrt(c)
    factors = {
        "lower": 1 / c, "upper": 1 / c, "M_x": 1 / c, "feedback_gain": root, "metric_input_gain": 1 / root,
        "initial_distance": 1 / root, "plan_defect_metric": 1 / root,
    }  # fmt: skip
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


IN_DISTANCE = {
    "lower", "B", "B_pinv", "B_pinv_x", "h", "h_x", "h_t", "h_initial", "feedback_gain", "metric_input_gain",
    "drift_on_plan", "initial_distance", "plan_defect_metric",
}  # fmt: skip


NEEDED = {
    "0": {"lower", "h", "metric_input_gain", "initial_distance", "plan_defect_metric"},
    "A": set(ALIVE) - {"metric_input_gain", "h_initial", "plan_defect", "f"},
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
    "bandwidth": "1/s", "adaptation_rate": "u^2", "predictor_gain": "1/s", "projection_radius": "u",
    "speed": "x/s", "prediction_error": "u", "uncertainty": "u",
}  # fmt: skip


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


def test_a_predictor_without_damping_is_refused():
    with pytest.raises(ValueError, match="stable"):
        alive(predictor_gain=Fraction(-1))


def test_inconsistent_radii_are_misuse():
    with pytest.raises(ValueError, match="rho must be"):
        alive(rho=Fraction("0.89"))
    with pytest.raises(ValueError, match="positive"):
        alive(epsilon=Fraction(0))


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
