"""Promises and what breaks them: every bound is broken on purpose, and everything within is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulated import FLAT, Failure, Peak, certified, runs, setting

from tubecert.certificate.result import Recipes
from tubecert.errors import TubecertError
from tubecert.simulate.certified import read_numbers
from tubecert.simulate.compare import check_class, compare
from tubecert.simulate.promise import KINDS, Decay, promise
from tubecert.spec import load_text
from tubecert.verdict import Verdict

T = np.linspace(0, 4, 81)


def quiet_runs(lanes=2, share=0.5, name="flat"):
    """Runs that use `share` of the tube for a moment; d is taken to be exactly sqrt(a) |x|."""
    where = setting(name)
    pulse = share * np.exp(-((T - 2) ** 2))
    x = np.zeros((lanes, len(T), 2))
    x[:, :, 1] = where.rho * pulse
    return runs(T, x, np.broadcast_to(where.reach * pulse, (lanes, len(T))).copy())


def broken(found):
    return {item.name for item in found.violations}


@pytest.mark.parametrize(("bandwidth", "off"), [(7.0, 1e-8), (1.3, 1e-4)])
def test_decay_solves_its_differential_equation(bandwidth, off):
    """Also where the bandwidth is the rate."""
    decay = Decay(rate=1.3, bandwidth=bandwidth, start=0.2, beta=0.8, defect=0.03, first=1.5, rest=0.4)

    def right(t, D):
        e = np.exp(-bandwidth * t)
        return -1.3 * D + 0.8 * (e * 1.5 + (1 - e) * 0.4) + 0.03

    t = np.linspace(0, 3, 31)
    solved = solve_ivp(right, (0, 3), [0.2], t_eval=t, rtol=1e-10, atol=1e-12).y[0]
    np.testing.assert_allclose(decay(t), solved, atol=off)


def test_the_error_of_the_estimate_counts_from_the_start():
    """(2.15) of what is certified, against its differential equation: a true loop broke a D(t) whose e came slowly."""
    where = setting("flat")
    own, recipe = where.certified, where.certified.proven("distance").recipe
    rest, omega = recipe["uncertainty"], recipe["bandwidth"]

    def right(t, D):
        e = np.exp(-omega * t)
        seen = e * own["h_initial"] + (1 - e) * rest + recipe["prediction_error"]
        return -own.rate * D + own["metric_input_gain"] * seen + own["plan_defect"]

    t = np.linspace(0, 1 / omega, 31)
    start = [own["initial_distance"]]
    solved = solve_ivp(right, (0, t[-1]), start, t_eval=t, rtol=1e-10, atol=1e-14).y[0]
    np.testing.assert_allclose(promise(own, KINDS["distance"]).decay(t), solved, rtol=1e-7)


@pytest.mark.slow
def test_the_largest_promised_distance_is_the_margin_of_the_certificate():
    _, result = certified("two_state", "0.4")
    found = promise(read_numbers(result), KINDS["distance"])
    assert found is not None
    assert found.decay is not None
    margin = result.to_json()["distance"]["least_adaptation"]["margin"]
    left = 1 - found.decay(np.linspace(0, 5, 5001)).max() / found.reach
    assert margin[0] - 1e-6 <= left <= margin[1] + 1e-6


def test_only_certified_sections_promise():
    _, result = certified("flat")
    assert promise(read_numbers(result), KINDS["distance"]) is not None
    refuted = {"distance": replace(result.sections["distance"], verdict=Verdict.REFUTED)}
    changes = (
        {"sections": {}, "decided_by": ()},
        {"proof": Recipes()},
        {"sections": result.sections | refuted},
    )
    for change in changes:
        assert promise(read_numbers(replace(result, **change)), KINDS["distance"]) is None


def test_what_keeps_every_promise_breaks_none():
    where = setting("flat")
    promised = replace(promise(where.certified, KINDS["distance"]), decay=None)
    found = compare(where, quiet_runs(), promised)
    assert not found.violations
    assert not found.outside
    assert found.uses["deviation"].share == pytest.approx(0.5)


def test_leaving_the_tube_is_noticed_with_and_without_a_promise():
    where = setting("flat")
    outside = quiet_runs(share=1.02)
    assert compare(where, outside, None).outside == (0, 1)
    assert not compare(where, outside, None).violations
    assert {"tube", "deviation"} <= broken(
        compare(where, outside, promise(where.certified, KINDS["distance"]))
    )


def test_the_decaying_bound_is_checked_at_every_time():
    where = setting("flat")
    promised = promise(where.certified, KINDS["distance"])
    early = quiet_runs()
    early.distance[1, 0] = 0.9 * where.reach  # far below dbar, but more than D(0) = d0
    assert "D(t)" in broken(compare(where, early, promised))


@pytest.mark.parametrize("name", ["k", "u", "xtilde", "sigma_error"])
def test_every_other_bound_is_checked(name):
    where = setting("flat")
    promised = replace(promise(where.certified, KINDS["distance"]), decay=None)
    bound = promised.bounds[name]
    for factor, expected in ((0.99, set()), (1.01, {name})):
        peak = Peak(value=np.array([0.0, factor * bound]), time=np.array([0.0, 1.5]))
        given = quiet_runs()
        given = replace(given, worst=replace(given.worst, **{name: peak}))
        found = compare(where, given, promised)
        assert broken(found) == expected
        assert all((item.lane, item.time) == (1, 1.5) for item in found.violations)


def test_a_bound_is_broken_only_beyond_the_error_of_the_run():
    where = setting("flat")
    promised = replace(promise(where.certified, KINDS["distance"]), decay=None)
    slightly = replace(quiet_runs(share=1.004), error=np.full(2, 0.005 * where.rho))
    assert not compare(where, slightly, promised).outside
    surely = replace(quiet_runs(share=1.007), error=np.full(2, 0.005 * where.rho))
    assert compare(where, surely, promised).outside == (0, 1)


def test_a_large_error_is_no_result():
    where = setting("flat")
    doubtful = replace(quiet_runs(share=3.0), error=np.array([0.0, 0.011 * where.rho]))
    found = compare(where, doubtful, promise(where.certified, KINDS["distance"]))
    assert found.unreliable == (1,)
    assert found.outside == (0,)
    assert all(item.lane == 0 for item in found.violations)


def test_a_run_that_diverges_has_left_the_tube():
    where = setting("flat")
    far = quiet_runs(share=30.0)
    stopped = replace(
        far, error=np.array([0.0, np.inf]), failures=(Failure(lane=1, t=2.5, reason="the state diverges"),)
    )
    found = compare(where, stopped, promise(where.certified, KINDS["distance"]))
    assert 1 in found.outside
    assert any((item.name, item.lane, item.time) == ("tube", 1, 2.5) for item in found.violations)


def test_settling_is_measured():
    where = setting("flat")
    promised = replace(promise(where.certified, KINDS["distance"]), ultimate=0.25 * where.rho)
    settled = compare(where, quiet_runs(), promised).settled
    assert settled is not None
    assert 0.5 * np.exp(-((settled - 2) ** 2)) <= 0.25 < 0.5 * np.exp(-((settled - 2 - 0.1) ** 2)) * 2
    never = replace(promised, ultimate=1e-3 * where.rho)
    assert compare(where, quiet_runs(share=0.5), never).settled is None


def h_of(text):
    spec = load_text(FLAT.replace("0.2*sin(t)", text))
    return tuple(term.expression for term in spec.uncertainty.h)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("0.25*sin(t)", "|h| is"),
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
    outside = quiet_runs(share=50.0)
    check_class(where, outside, h_of("0.2*sin(t)*(1 + 0*p)"), "uncertainty.h")
