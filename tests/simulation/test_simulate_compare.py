"""Promises and what breaks them: every bound is broken on purpose, and everything within is left alone."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulated import FLAT, certified, runs, setting

from tubecert.certificate.result import Bound, Recipes
from tubecert.conditions.inputs import InputBound
from tubecert.errors import TubecertError
from tubecert.letters import DISTANCE, RATES
from tubecert.simulation.adaptive.judge import check_class, compare
from tubecert.simulation.adaptive.loops import Decay, joined
from tubecert.simulation.adaptive.setting import promise, setting_of
from tubecert.simulation.adaptive.uncertainty import class_of
from tubecert.simulation.told import RunAt
from tubecert.spec import Output, load_text
from tubecert.verdict import Verdict

T = np.linspace(0, 4, 81)


def quiet_runs(share=0.5, *, lanes=2, of_distance=None, sign=1, **changes):
    """Runs that use `share` of the tube for a moment; d is taken to be exactly sqrt(a) |x|, or of another share."""
    where = setting("flat")
    pulse = np.exp(-((T - 2) ** 2))
    x = np.zeros((lanes, len(T), 2))
    x[:, :, 1] = sign * where.rho * share * pulse
    return runs(
        T, x, np.broadcast_to(where.reach * (of_distance or share) * pulse, (lanes, len(T))), **changes
    )


def promised(**changes):
    """What is certified of the loop, with some of it replaced."""
    return replace(promise(setting("flat"), DISTANCE), **changes)


def broken(found):
    return {item.of for item in found.violations}


@pytest.mark.parametrize(("bandwidth", "off"), [(7.0, 1e-8), (1.3, 1e-4)])
def test_decay_solves_its_differential_equation(bandwidth, off):
    """Also where the bandwidth is the rate."""
    decay = Decay(
        rate=1.3, bandwidth=bandwidth, start=0.2, beta=0.8, defect=0.03, first=1.5, rest=0.4, error=0.0
    )

    def right(t, D):
        e = np.exp(-bandwidth * t)
        return -1.3 * D + 0.8 * (e * 1.5 + (1 - e) * 0.4) + 0.03

    t = np.linspace(0, 3, 31)
    solved = solve_ivp(right, (0, 3), [0.2], t_eval=t, rtol=1e-10, atol=1e-12).y[0]
    np.testing.assert_allclose(decay(t), solved, atol=off)


def test_the_error_of_the_estimate_counts_from_the_start():
    """(2.15) of what is certified, against its differential equation: a true loop broke a D(t) whose e came slowly."""
    where = setting("flat")
    own, recipe = where, where.proven(DISTANCE)
    rest, omega, e = map(float, (recipe.uncertainty, recipe.bandwidth, recipe.prediction_error))

    def right(t, D):
        share = np.exp(-omega * t)
        seen = share * own.sup("h_initial") + (1 - share) * rest + e
        return -float(own.model.rate) * D + own.sup("metric_input_gain") * seen + own.sup("plan_defect")

    t = np.linspace(0, 1 / omega, 31)
    start = [own.sup("initial_distance")]
    solved = solve_ivp(right, (0, t[-1]), start, t_eval=t, rtol=1e-10, atol=1e-14).y[0]
    np.testing.assert_allclose(promise(own, DISTANCE).decay(t), solved, rtol=1e-7)


@pytest.mark.slow
def test_the_largest_promised_distance_is_the_margin_of_the_certificate():
    _, result = certified("two_state", "0.4")
    found = promise(setting("two_state", "0.4"), DISTANCE)
    assert found.decay is not None
    margin = result.to_json()["distance"]["least_adaptation"]["margin"]
    left = 1 - found.decay(np.linspace(0, 5, 5001)).max() / found.bounds["distance"]
    assert margin[0] - 1e-6 <= left <= margin[1] + 1e-6


def test_only_certified_sections_promise():
    spec, result = certified("flat")
    assert promise(setting_of(spec, result), DISTANCE) is not None
    refuted = {"distance": replace(result.sections["distance"], verdict=Verdict.REFUTED)}
    changes = (
        {"sections": {}, "decided_by": ()},
        {"proof": Recipes()},
        {"sections": result.sections | refuted},
    )
    for change in changes:
        assert promise(setting_of(spec, replace(result, **change)), DISTANCE) is None


def test_what_keeps_every_promise_breaks_none():
    found = compare(setting("flat"), quiet_runs(), promised(decay=None))
    assert not found.violations
    assert not found.left_the_tube
    assert found.worst["deviation"].share == pytest.approx(0.5)


def test_leaving_the_tube_is_noticed_with_and_without_a_promise():
    where, outside = setting("flat"), quiet_runs(1.02)
    assert compare(where, outside, None).first_outside == (0, 1)
    assert not compare(where, outside, None).violations
    assert {"tube", "deviation"} <= broken(compare(where, outside, promised()))
    assert compare(where, quiet_runs(of_distance=1.02), None).first_outside == (0, 1)


def test_the_decaying_bound_is_checked_at_every_time():
    where, early = setting("flat"), quiet_runs()
    early.distance[1, 0] = 0.9 * where.reach  # far below dbar, but more than D(0) = d0
    assert "D(t)" in broken(compare(where, early, promised()))


@pytest.mark.parametrize("sign", [-1, 1])
def test_half_widths_count_to_both_sides(sign):
    where = setting("flat")
    narrow = promised(half_widths={"p": 1.0, "v": 0.4 * where.rho}, decay=None)
    assert broken(compare(where, quiet_runs(sign=sign), narrow)) == {"half-width of v"}


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("width", "expected"), [(1.01, set()), (0.99, {"half-width of both"})])
def test_outputs_keep_to_their_half_widths(sign, width, expected):
    """2 v goes to rho and back."""
    where = setting("flat")
    both = (Output(name="both", row=(Fraction(1), Fraction(2))),)
    where = replace(where, spec=replace(where.spec, outputs=both))
    own = promised(half_widths={"p": 1.0, "v": where.rho, "both": width * where.rho}, decay=None)
    assert broken(compare(where, quiet_runs(sign=sign), own)) == expected


@pytest.mark.parametrize("name", ["k", "u", "xtilde", "sigma_error"])
def test_every_other_bound_is_checked(name):
    own = promised(decay=None)
    for by, expected in ((-1e-3, set()), (1e-3, {name})):  # the feedback of this loop is 0, and bounded by 0
        given = quiet_runs(peaks={name: ([0.0, own.bounds[name] + by], [0.0, 1.5])})
        found = compare(setting("flat"), given, own)
        assert broken(found) == expected
        assert all((item.run, item.t) == (1, 1.5) for item in found.violations)


@pytest.mark.parametrize(("least", "expected"), [(-0.9, set()), (-1.1, {"input -u"})])
def test_inputs_stay_in_their_ranges(least, expected):
    stays = InputBound(least=-1.0, greatest=2.0, feedback=0.0, adaptation=0.0)
    own = promised(ranges={"u": stays}, decay=None)
    compared = compare(setting("flat"), quiet_runs(lanes=1, least=[[least]], greatest=[[1.0]]), own)
    assert broken(compared) == expected
    assert (compared.went["u"].least, compared.went["u"].proven) == (least, (-1.0, 2.0))


@pytest.mark.parametrize(("share", "outside"), [(1.004, ()), (1.007, (0, 1))])
def test_a_bound_is_broken_only_beyond_the_error_of_the_run(share, outside):
    where = setting("flat")
    given = quiet_runs(share, error=np.full(2, 0.005 * where.rho))
    found = compare(where, given, promised(half_widths={"p": 1.0, "v": where.rho}, decay=None))
    assert found.first_outside == outside
    assert broken(found) == ({"tube", "deviation", "half-width of v"} if outside else set())


def test_a_large_error_is_no_result():
    where = setting("flat")
    doubtful = quiet_runs(3.0, error=np.array([0.0, 0.011 * where.rho]))
    found = compare(where, doubtful, promised())
    assert (found.no_result, [item.run for item in found.unresolved]) == (1, [1])
    assert found.first_outside == (0,)
    assert all(item.run == 0 for item in found.violations)


@pytest.mark.parametrize(("share", "left"), [(1.9, False), (2.1, True), (30.0, True)])
def test_a_run_that_is_stopped_has_left_the_tube_beyond_two_radii(share, left):
    where = setting("flat")
    stopped = quiet_runs(share, error=np.array([0.0, np.inf]), ended={1: 2.5})
    found = compare(where, stopped, promised())
    assert (1 in found.first_outside) is left
    assert found.no_result == (not left)
    assert not found.unresolved
    told = [(item.of, item.run, item.t) for item in found.violations]
    assert (("tube", 1, 2.5) in told) is left


def test_runs_along_several_plans_are_numbered_through_and_judged_as_one():
    where = setting("flat")
    own = promised(ultimate=0.25 * where.rho, decay=None)
    outside = quiet_runs(1.5)
    outside.off[1, 0, 1] = 1.2 * where.rho  # the second is outside from the start
    stopped = quiet_runs(0.7, error=np.array([0.0, np.inf]), ended={1: 2.5})
    found = compare(where, joined([quiet_runs(), outside, stopped]), own)
    assert (found.runs, found.left_the_tube, found.no_result) == (6, 2, 1)
    assert found.first_outside == (2, 3)
    assert found.first_exit == RunAt(run=3, t=0.0)
    assert [(item.run, item.t) for item in found.stopped] == [(5, 2.5)]
    assert found.stopped[0].reason.startswith("the state diverges")
    assert found.worst["deviation"] == replace(compare(where, outside, own).worst["deviation"], run=2)
    assert found.settled == compare(where, outside, own).settled > compare(where, quiet_runs(), own).settled


def test_settling_is_measured():
    where = setting("flat")
    settled = compare(where, quiet_runs(), promised(ultimate=0.25 * where.rho)).settled
    assert settled is not None
    assert 0.5 * np.exp(-((settled - 2) ** 2)) <= 0.25 < 0.5 * np.exp(-((settled - 2 - 0.1) ** 2)) * 2
    assert compare(where, quiet_runs(), promised(ultimate=1e-3 * where.rho)).settled is None


def h_of(text):
    spec = load_text(FLAT.replace("0.2*sin(t)", text))
    return tuple(term.expression for term in spec.uncertainty.h)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("0.201*sin(t)", "|h| is"),
        ("0.19*sin(2*t)", "|dh/dt| is"),
        ("0.1*sin(t) + 0.1*v", "|dh/dx| is"),
        ("0.1", "|h| at the start is"),
    ],
)
def test_an_uncertainty_outside_its_class_is_an_error(text, what):
    where = setting("flat")
    with pytest.raises(TubecertError) as caught:
        check_class(where, quiet_runs(), h_of(text), "uncertainty.h")
    (finding,) = caught.value.findings
    assert finding.code == "TC706"
    assert what in finding.message
    assert "t = " in finding.message


def test_an_uncertainty_in_its_class_passes_and_may_leave_it_after_the_tube_is_left():
    where = setting("flat")
    check_class(where, quiet_runs(), h_of("0.2*sin(t)"), "uncertainty.h")
    growing = h_of("0.2*sin(t)*(1 + t)")
    check_class(where, quiet_runs(50.0), growing, "uncertainty.h")  # inside at t = 0 only
    with pytest.raises(TubecertError):
        check_class(where, quiet_runs(), growing, "uncertainty.h")


@pytest.fixture
def numbers():
    """A certificate by hand, whose constants are all different."""
    result = certified("flat")[1]
    names = (
        "feedback_gain u_star h h_t h_x h_initial prediction_error initial_distance metric_input_gain B B_x B_pinv "
        "B_pinv_x plan_defect plan_defect_metric drift_on_plan M_x"
    )
    constants = {name: Bound(below=0.0, above=0.3 + 0.11 * i) for i, name in enumerate(names.split())}
    return replace(setting("flat"), result=replace(result, constants=constants), rho=0.7, reach=0.4)


@pytest.mark.parametrize("kind", [RATES, DISTANCE], ids=str)
def test_bounds_are_those_of_the_theory(numbers, kind):
    c, recipe = numbers, numbers.result.proof.of[kind.key]
    kmax, R_H, Gamma = (
        c.sup("feedback_gain") * 0.4,
        float(recipe.projection_radius),
        float(recipe.adaptation_rate),
    )
    if kind == RATES:
        xtilde = c.sup("prediction_error") / Gamma**0.5
    else:
        s1, q = c.sup("h_t") + c.sup("h_x") * float(recipe.speed), 2 * float(recipe.predictor_gain)
        V = (2 * (c.sup("h") + R_H) * s1 / q + (c.sup("h") + R_H) ** 2) / Gamma  # (2.11)
        xtilde = V**0.5
    expected = {
        "distance": 0.4,
        "deviation": 0.7,
        "k": kmax,
        "u": c.sup("u_star") + kmax + R_H,
        "sigma_error": c.sup("h") + R_H,
        "xtilde": xtilde,
    }
    found = promise(numbers, kind)
    assert found.bounds == pytest.approx(expected, rel=1e-12)
    assert (found.decay is None) == (kind == RATES)


def test_what_unknown_parameters_do_beside_the_inputs_counts(numbers):
    """(7.8) with zb = D_r, and beta_r in the defect of D(t)."""
    constants = {"residual_size": Bound(below=0.0, above=0.5), "residual_push": Bound(below=0.0, above=0.6)}
    result = replace(numbers.result, constants={**numbers.result.constants, **constants})
    c, recipe = numbers, numbers.result.proof.of[DISTANCE.key]
    Gamma, q, s1 = map(
        float,
        (
            recipe.adaptation_rate,
            2 * recipe.predictor_gain,
            c.sup("h_t") + c.sup("h_x") * float(recipe.speed),
        ),
    )
    most, drag = c.sup("h") + float(recipe.projection_radius), 0.5 / q
    expected = (most**2 / Gamma + (drag + (drag**2 + 2 * most * s1 / (q * Gamma)) ** 0.5) ** 2) ** 0.5
    found = promise(replace(numbers, result=result), DISTANCE)
    assert found.bounds["xtilde"] == pytest.approx(expected, rel=1e-12)
    assert found.decay.defect == pytest.approx(c.sup("plan_defect_metric") + 0.6)


def test_pushes_are_bounded_where_metric_and_inputs_are_constant(numbers):
    """B'M gamma_s changes with x by |B| A, with t by |B| A |x*'|, and |x*'| <= |f + B u*| + |p|."""
    model, none = numbers.model, dict.fromkeys(("M_x", "B_x"), Bound(below=0.0, above=0.0))
    constant = replace(numbers.result, constants={**numbers.result.constants, **none})
    assert class_of(numbers.result, model, 0.4, 1.9).push is None
    assert class_of(constant, model, 0.4, None).push is None
    slope = numbers.sup("B") * 1.9
    assert class_of(constant, model, 0.4, 1.9).push == pytest.approx(
        (slope, slope * (numbers.sup("drift_on_plan") + numbers.sup("plan_defect")))
    )
