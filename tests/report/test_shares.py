"""What fills the tube: the causes make up the whole, and each is what it is called."""

from dataclasses import replace

import pytest
from proven import proven

from tubecert.certificate.result import Certificate
from tubecert.digits import exact
from tubecert.report.certificate_brief import beyond_its_theorem, less_by_distance
from tubecert.report.figures_gains import trade_off
from tubecert.report.gains import rows
from tubecert.report.shares import filled

WINDY = """
tubecert: 1
name: windy
system: {states: [x], inputs: [u], f: ["-x"], B: [[1]]}
safe_set: {x: [-2, 2]}
uncertainty: {h: ["0.4*sin(t)"]}
disturbance: {E: [[1]], bound: 0.05}
trajectory: {kind: equilibrium, at: [0], input: [0], horizon: 20}
tube: {epsilon: 0.7, rho_a: 0.1}
metric: {dual_metric: [[1]], rate: 1}
conditions: {decides: B}
"""


@pytest.mark.slow
def test_the_causes_make_up_what_the_margin_leaves_each_as_by_hand():
    sealed = proven(WINDY)
    result = Certificate.from_json(sealed).result
    told = filled(result)
    assert set(told) == {"no_adaptation", "distance"}, "A compares other quantities"
    for key, causes in told.items():
        total, margin = sum(causes.values()), result.sections[key].decisive(asked=False).margins[key]
        assert 1 - margin.above - 1e-6 <= total <= 1 - margin.below + 1e-3
        assert not any(cause.startswith("the start") for cause in causes), (
            "the start is long over when D is largest"
        )
        # W = 1: beta = 1, dbar = rho = .8, lambda = 1
        assert causes["wind that pushes"] == pytest.approx(0.05 / 0.8, rel=1e-6)
    assert told["no_adaptation"]["the uncertainty, which nothing compensates"] == pytest.approx(
        0.4 / 0.8, rel=1e-2
    )


@pytest.mark.slow
def test_a_certificate_that_is_not_stated_for_wind_says_so():
    windy = Certificate.from_json(proven(WINDY)).result
    [(label, line)] = beyond_its_theorem(windy)
    assert label == "undecided"
    assert line.startswith(
        "certificate A, paper's conditions: the theorem is stated for inputs and matched uncertainty alone"
    )
    calm = replace(windy, claim=replace(windy.claim, wind=None))
    assert not list(beyond_its_theorem(calm))
    decides = replace(windy, decided_by=("conditions_26",))
    assert not list(less_by_distance(decides)), "WINDY says itself what decides"
    [told] = beyond_its_theorem(decides)
    assert told == ("help", "B, distance, is stated for them as well: --conditions B"), (
        "the first line says why"
    )


@pytest.mark.slow
def test_where_a_decides_unasked_it_is_said_what_b_asks_for():
    calm = WINDY.replace("disturbance: {E: [[1]], bound: 0.05}\n", "")
    unasked = Certificate.from_json(proven(calm.replace("conditions: {decides: B}\n", ""))).result
    [(label, line)] = less_by_distance(unasked)
    assert label == "or"
    least = min(row.pair.adaptation_rate for row in rows(unasked) if row.section == "distance")
    assert line.endswith(f"Gamma = {exact(least)}, by B, distance: --conditions B")
    assert not list(less_by_distance(Certificate.from_json(proven(calm)).result))
    assert not list(less_by_distance(replace(unasked, decided_by=("distance",))))


@pytest.mark.slow
def test_a_curve_of_what_is_not_certified_says_so():
    chart = trade_off(Certificate.from_json(proven(WINDY)).result)
    assert chart.legend[0] == ("a", "A paper's conditions, undecided")
    assert ("b", "B distance") in chart.legend
