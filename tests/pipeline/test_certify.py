"""End to end: specifications in, results out, against the facts of the literature and invariances."""

import dataclasses
import math
from fractions import Fraction

import proven
import pytest
from problems import judged_26, judged_distance, problem_of
from texts import CONFIGS, replaced

from tubecert.bounds.suprema import Suprema
from tubecert.certificate import seal
from tubecert.claims.family import Reason
from tubecert.errors import SpecError
from tubecert.pipeline import Options, certify
from tubecert.records import from_json
from tubecert.spec import load_text
from tubecert.verdict import Verdict

THREE = (CONFIGS / "three_state.yaml").read_text(encoding="utf-8")
ORBIT = (CONFIGS / "two_state_orbit.yaml").read_text(encoding="utf-8")

PRINTED_THREE = """  dual_metric:
    - ["0.2", "-0.41*x1", "-0.01"]
    - ["-0.41*x1", "0.81*x1**2 + 0.22", "0.01*x1 - 0.01"]
    - ["-0.01", "0.01*x1 - 0.01", "0.07*x1 + 0.22"]
"""


def with_metric(text, metric, following="tube:"):
    start, end = text.index("  dual_metric:"), text.index(following)
    return text[:start] + metric + "\n" + text[end:]


def run(text, *, bare=True, **options):
    """The result, which other tests may have asked for as well; curves and advice only where these are looked at."""
    return proven.result(text, bare=bare, **options).to_json()


def captured_problem(text, **options):
    """The `TubeProblem` that the pipeline builds."""
    return problem_of(load_text(text, "spec.yaml"), Options(**options))


def declared(text):
    return replaced(text, ("  rate: 0.9999", "  bounds: {lower: 3.85, upper: 5.88}\n  rate: 0.9999"))


@pytest.fixture(scope="module")
def three():
    return run(THREE, bare=False)


@pytest.mark.slow
def test_three_state_is_certified_in_every_number(three):
    assert three["verdict"] == "certified"
    assert Verdict(three["verdict"]).exit_code == 0
    for section in ("conditions_26", "distance"):
        assert three[section]["verdict"] == "certified"
    for name, constant in three["constants"].items():
        assert constant["below"] <= constant["above"], name
        if name in {"speed", "uncertainty_rate"} or not constant["above"] > 1e-12:
            continue
        assert constant["above"] - constant["below"] <= 0.0101 * constant["above"], name
    assert all(low > 0 for low, _ in three["conditions_26"]["margins"].values())
    seal(three, {})  # no NaN, no infinity, nothing that JSON cannot say


@pytest.mark.slow
def test_three_state_tube_is_the_fixed_point_of_its_own_metric_bounds(three):
    assert three["tube"]["rho"] == pytest.approx(0.03907, rel=1e-3)
    assert three["metric"]["lower"][0] == pytest.approx(4.3109, rel=1e-4)
    assert three["metric"]["upper"][1] == pytest.approx(5.2262, rel=1e-4)
    a, A = three["metric"]["lower"][0], three["metric"]["upper"][1]
    needed = (A / a) ** 0.5 * 3**0.5 * 0.01 + 0.02
    assert needed <= three["tube"]["rho"] <= needed * (1 + 2e-6)


@pytest.mark.slow
def test_gains_of_the_reference_rows():
    """That of A was found with a weaker kernel of the filter: no gain is larger than there."""
    problem = captured_problem(declared(THREE))
    worst_start = dataclasses.replace(problem.constants, h_initial=problem.constants.h)
    row = dataclasses.replace(problem, constants=worst_start, predictor_gain=None)
    a, b = judged_26(row).decisive.recipe, judged_distance(row).at("least_adaptation").recipe
    assert float(b.bandwidth) == pytest.approx(10.8, rel=0.03)
    assert float(b.adaptation_rate) == pytest.approx(1.38e4, rel=0.1)
    assert 41.8 > a.bandwidth > b.bandwidth
    assert 1.39e7 > a.adaptation_rate > b.adaptation_rate


@pytest.mark.slow
@pytest.mark.parametrize(("text", "changes", "largest"), [
    (with_metric(THREE, PRINTED_THREE), [("rate: 0.9999", "rate: 1")], "0.99653"),
    (THREE, [("rate: 0.9999", "rate: 1")], "0.99999"),
    (ORBIT, [('"4.25828", "-0.93423"', "4.26, -0.93"), ('"-0.93423", "3.76692"', "-0.93, 3.77")], "1.73933"),
], ids=["three-state as printed", "three-state at rate 1", "two-state as printed"])  # fmt: skip
def test_false_metrics_are_refuted_with_a_point_and_the_largest_rate(text, changes, largest):
    result = run(replaced(text, *changes))
    assert result["verdict"] == "refuted"
    assert Verdict(result["verdict"]).exit_code == 1
    (reason,) = result["reasons"]
    assert reason["claim"] == "metric_contraction"
    assert largest in from_json(Reason, reason, "reason").message
    assert len(reason["at"]["x"]) == len(result["safe_set"])
    assert "conditions_26" not in result


@pytest.mark.slow
@pytest.mark.parametrize("scale", ["1/100", "100"])
def test_scaling_the_metric_changes_no_gain(three, scale):
    spec = load_text(THREE, "spec.yaml")
    rows = "\n".join(
        "    - [" + ", ".join(f'"{scale}*({term.text})"' for term in row) + "]"
        for row in spec.metric.dual_metric
    )
    assert_same_gains(three, run(with_metric(THREE, f"  dual_metric:\n{rows}\n")))


def assert_same_gains(one, other):
    assert other["verdict"] == "certified"
    assert other["tube"]["rho"] == pytest.approx(one["tube"]["rho"], rel=1e-3)
    for pair in (("conditions_26",), ("distance", "split"), ("distance", "least_adaptation")):
        first, second = one, other
        for key in pair:
            first, second = first[key], second[key]
        assert second["bandwidth"] == pytest.approx(first["bandwidth"], rel=0.01)
        assert second["adaptation_rate"] == pytest.approx(first["adaptation_rate"], rel=0.03)


@pytest.mark.slow
def test_a_smaller_tube_never_has_larger_constants(three):
    smaller = run(replaced(THREE, ("epsilon: 0.01, rho_a: 0.01", "epsilon: 0.005, rho_a: 0.005")))
    derived = {"theta", "prediction_error", "filter_error", "zeta_1", "zeta_2", "zeta_3", "Psi_rate", "speed"}
    for name, constant in smaller["constants"].items():
        if name in derived | {"lower", "input_gain_least"}:
            continue
        assert constant["above"] <= three["constants"][name]["above"] * 1.01, name
    assert smaller["constants"]["lower"]["below"] >= three["constants"]["lower"]["below"] * 0.99


@pytest.mark.slow
def test_gains_beyond_all_bounds_are_told_in_words():
    result = run(THREE, bandwidth=Fraction(1, 10**30), adaptation_rate=Fraction(1))
    reasons = [from_json(Reason, reason, "reason") for reason in result["reasons"]]
    said = {reason.claim.condition: reason.message for reason in reasons}
    assert "no adaptation rate can, where (26b) fails" in said["26c"]
    assert "it needs 1.12e31 times what is allowed" in said["26a"]
    assert not any("inf" in words for words in said.values())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["26", "distance", "all"])
def test_the_chosen_conditions_decide(name):
    result = run(THREE, conditions=name)
    assert result["verdict"] == "certified"
    assert len(result["decided_by"]) == (2 if name == "all" else 1)


@pytest.mark.slow
def test_a_moving_plan_is_certified_and_its_defect_proven_zero():
    result = run(ORBIT)
    assert result["verdict"] == "certified"
    assert result["constants"]["plan_defect"]["above"] == 0
    assert result["constants"]["h_x"]["above"] == pytest.approx(0.1, rel=1e-6)
    assert result["tube"]["rho"] == 0.7


@pytest.mark.slow
def test_a_wrong_plan_has_its_defect_measured_and_costs_gain_or_the_certificate():
    exact = run(ORBIT)
    slightly = run(replaced(ORBIT, ("    - sin(t)\n", "    - 1.02*sin(t)\n")))
    defect = slightly["constants"]["plan_defect"]
    assert 0.01 < defect["below"] <= defect["above"] <= 1.02 * defect["below"]
    assert slightly["verdict"] == "certified"
    assert slightly["conditions_26"]["bandwidth"] > 1.05 * exact["conditions_26"]["bandwidth"]
    badly = run(replaced(ORBIT, ("    - sin(t)\n", "    - 2*sin(t)\n")))
    assert badly["distance"]["verdict"] == "refuted"
    assert badly["distance"]["shortfalls"][0]["condition"] == "plan_defect"


@pytest.mark.slow
def test_a_tube_that_leaves_the_safe_set_is_refuted_with_time_and_point():
    result = run(replaced(ORBIT, ("  x2: [-6, 6]", "  x2: [-6, 1.6]")))
    assert result["verdict"] == "refuted"
    (reason,) = result["reasons"]
    assert reason["claim"] == "tube_in_safe_set"
    assert reason["at"]["t"] == pytest.approx(1.5708, abs=1e-2)
    assert reason["at"]["x"][1] == pytest.approx(1.7, abs=1e-3)


@pytest.mark.slow
def test_declared_bounds_are_checked_against_the_expression():
    broken = run(replaced(THREE, ('  h: ["0.1*sin(2*t)"]', '  h: ["0.1*sin(2*t)"]\n  bounds: {h: 0.09}')))
    assert broken["verdict"] == "refuted"
    assert (broken["reasons"][0]["claim"], broken["reasons"][0]["constant"]) == ("uncertainty_bound", "h")
    wide = run(replaced(THREE, ('  h: ["0.1*sin(2*t)"]', '  h: ["0.1*sin(2*t)"]\n  bounds: {h: 0.2}')))
    assert wide["verdict"] == "certified"
    assert wide["constants"]["h"]["above"] == 0.2
    assert wide["constants"]["h_t"]["above"] == pytest.approx(0.2, rel=0.01)


@pytest.mark.slow
def test_declared_metric_bounds_must_hold_on_the_safe_set():
    result = run(replaced(THREE, ("  rate: 0.9999", "  bounds: {lower: 3.9, upper: 5.88}\n  rate: 0.9999")))
    assert result["verdict"] == "refuted"
    assert (result["reasons"][0]["claim"], result["reasons"][0]["side"]) == ("metric_bound", "lower")


@pytest.mark.slow
def test_declared_uncertainty_alone_is_believed_and_named():
    result = run(replaced(THREE, ('  h: ["0.1*sin(2*t)"]', "  bounds: {h: 0.1, h_x: 0, h_t: 0.2}")))
    assert result["verdict"] == "certified"
    assert result["declared"] == {"h": 0.1, "h_x": 0.0, "h_t": 0.2}
    assert result["constants"]["h_initial"]["above"] == 0.1


@pytest.mark.slow
def test_an_aperiodic_uncertainty_needs_a_horizon():
    text = replaced(THREE, ("0.1*sin(2*t)", "0.1*sin(2*t) + 0.01*sin(pi*t)"))
    with pytest.raises(SpecError, match="horizon") as caught:
        run(text)
    assert caught.value.findings[0].code == "TC204"
    with_horizon = replaced(text, ("input: [0]}", "input: [0], horizon: 20}"))
    assert run(with_horizon)["verdict"] == "certified"


@pytest.mark.parametrize(
    "expression", ["x1 + 1/(x2 + 0.05)", "tan(20*x1)", "sqrt(x1)", "x1**(-2)", "0*tan(20*x1) + x1", "x1/x1"]
)
def test_an_undefined_expression_is_located_with_a_point(expression):
    with pytest.raises(SpecError) as caught:
        run(replaced(THREE, ("    - -x2\n", f"    - {expression}\n")))
    (finding,) = caught.value.findings
    assert finding.code == "TC201"
    assert finding.location.line == 13
    assert "x1 =" in finding.message or "x2 =" in finding.message


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        ("x1 + 1/(x2 + 0.05)", ": x2 + 0.05 is zero at x2 = -0.05"),
        ("x1 + 1/(x2**2 - 1/200)", "has a zero near x2 = "),
        ("1/(1/x2 + x2)", ": x2 is zero at x2 = 0"),  # where the divisor cannot be evaluated
        ("1/(sin(x2) + 0.05)", "has a zero near x2 = -0.0500"),
        ("1/exp(x1) + sqrt(x2)", "x2 is not positive at x2 = "),
    ],
)
def test_a_point_is_said_to_be_near_a_zero_unless_it_is_one(expression, said):
    with pytest.raises(SpecError) as caught:
        run(replaced(THREE, ("    - -x2\n", f"    - {expression}\n")))
    assert any(said in finding.message for finding in caught.value.findings)


@pytest.mark.slow
@pytest.mark.parametrize(
    "expression", ["0*(1/(t + 1)) + x1", "(t/(t**2 + 1))**0 + x1", "exp((x1 - x1)/(x2 + t))"]
)
def test_what_depends_on_time_only_where_it_is_defined_needs_a_horizon(expression):
    with pytest.raises(SpecError, match="horizon") as caught:
        run(replaced(THREE, ("0.1*sin(2*t)", expression)))
    assert caught.value.findings[0].code == "TC204"
    assert run(replaced(THREE, ("0.1*sin(2*t)", "0*(1/(sin(t) + 2)) + 0.1")))["verdict"] == "certified"


@pytest.mark.slow
def test_a_B_that_loses_rank_at_a_point_is_refuted_there():
    result = run(replaced(THREE, ("B: [[0], [0], [1]]", 'B: [[0], [0], ["x1 + x2 - 0.05"]]')))
    assert result["verdict"] == "refuted"
    assert result["reasons"][0]["claim"] == "rank_of_B"
    x = result["reasons"][0]["at"]["x"]
    assert x[0] + x[1] == pytest.approx(0.05, abs=1e-6)


@pytest.mark.slow
def test_any_start_within_a_radius_costs_more_than_the_nearest_and_no_more_than_the_ball(three):
    within = "{within: 0.01732050808}"  # |x0| of the point
    around = run(replaced(THREE, ("{at: [0.01, -0.01, 0.01]}", within)))
    assert around["verdict"] == "certified"
    assert around["spec"]["effective"]["initial_state"] == {"within": "0.01732050808"}
    assert around["tube"]["rho"] == pytest.approx(three["tube"]["rho"], rel=1e-6)
    d0, point = around["constants"]["initial_distance"], three["constants"]["initial_distance"]
    length = 0.01732050808 * around["metric"]["upper"][1] ** 0.5
    assert point["above"] <= d0["above"] == pytest.approx(length, rel=1e-6)
    assert around["conditions_26"]["bandwidth"] > three["conditions_26"]["bandwidth"]  # E0 is larger


@pytest.mark.slow
def test_a_start_within_a_radius_bounds_the_uncertainty_over_all_starts():
    within = ("{at: [0.01, -0.01, 0.01]}", "{within: 0.01}")
    text = replaced(THREE, ("0.1*sin(2*t)", "0.1*sin(2*t) + x1"), within)
    found = run(text, conditions="distance")["constants"]["h_initial"]
    assert found["below"] <= 0.01 <= found["above"] * (1 + 1e-9)
    assert found["above"] <= 0.0101


@pytest.mark.slow
@pytest.mark.parametrize(("supremum", "loser"), [("metric_slope", "conditions_26"), ("norms", None)])
def test_a_constant_without_a_bound_stops_only_what_needs_it(supremum, loser, monkeypatch):
    """B and C do not contain the slope of the metric; without a bound of h there is nothing."""
    honest = getattr(Suprema, supremum)

    def unbounded(self, *arguments):
        found = honest(self, *arguments)
        return found if arguments and arguments[0] != "h" else dataclasses.replace(found, above=math.inf)

    monkeypatch.setattr(Suprema, supremum, unbounded)
    result, by_distance = (
        certify(load_text(THREE, "spec.yaml"), Options(conditions=kind)).to_json()
        for kind in (None, "distance")
    )
    assert result["verdict"] == "undecided"
    assert result["reasons"][0]["relax"] == [{"id": "raise_budget"}, {"id": "shrink_tube"}]
    sections = [result[name]["verdict"] for name in ("conditions_26", "distance") if name in result]
    assert sections == (["undecided", "certified"] if loser else [])
    assert (by_distance["verdict"] == "certified") == (loser is not None)


def test_who_gives_no_radii_is_told_of_half_widths_and_who_gives_one_is_not():
    """Nobody who is new knows what epsilon is; how far each state may be off, in its unit, they know."""
    with pytest.raises(SpecError) as caught:
        run(replaced(THREE, ("epsilon: 0.01, rho_a: 0.01", "gap: auto")))
    both = [finding.help for finding in caught.value.findings if finding.help]
    assert any("half_widths: {x1: ..., x2: ..., x3: ...}" in each for each in both)
    with pytest.raises(SpecError) as caught:
        run(replaced(THREE, ("epsilon: 0.01, rho_a: 0.01", "rho_a: 0.01")))
    (one,) = (finding.help for finding in caught.value.findings)
    assert "half_widths" not in one
