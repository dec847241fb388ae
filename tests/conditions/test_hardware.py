"""Theorem H: its formulas against an oracle of their own, its limits, what it refuses."""

from __future__ import annotations

from dataclasses import fields, replace
from fractions import Fraction
from functools import cache
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from hardware_oracle import given, needed, theorem
from machines import alive_machine, asking, covariant_constants, hardware_constants, windy
from problems import ALIVE as TUBE
from problems import constants as tube_constants

from tubecert.bounds.constants import GainConstants, ResidualConstants
from tubecert.conditions import hardware
from tubecert.conditions.hardware import HardwareRecipe, Rounding, evaluated, loop_of, margins_hardware, plant
from tubecert.conditions.obstacles import reach
from tubecert.conditions.proposal import Proposal
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Proof, check, judge
from tubecert.spec import Picard

F = Fraction


def recipe(**changes) -> HardwareRecipe:
    """A recipe that proves theorem H at `alive_machine()`, with room."""
    own = {
        "sample_time": F(1, 1000),
        "delay": F(1, 2000),
        "feedback_time": F(1, 1000),
        "bandwidth": F(25),
        "noise": F(1, 1000),
        "wind": F(0),
        "clip_radius": F("0.37"),
        "level": F("0.2"),
        "floor": F("0.05"),
        "speed": F("4.6"),
        "bias": F("0.08"),
        "ripple": F("0.06"),
        "prediction": None,
    }
    return HardwareRecipe(**(own | changes))


BOX = {"noise_size": 0.0023, "noise_metric": 0.0021, "noise_explained": 0.0017}
FLAT = {"drift_difference_metric": 0.8, "drift_slope_metric": 3.1, "symbols": 0.0, "symbols_slope": 0.0}
FORMS = {
    "plain": (alive_machine(), {}),
    "no filter": (alive_machine(noise=F(1, 10**5)), {"bandwidth": None, "noise": F(1, 10**5)}),
    "a slow start": (
        replace(alive_machine(), constants=tube_constants(**(TUBE | {"initial_distance": 0.19}))),
        {},
    ),
    "a filter as slow as the metric": (
        replace(alive_machine(), constants=tube_constants(**(TUBE | {"h_t": 0.05, "h_x": 0.01}))),
        {"bandwidth": F("1.3")},
    ),
    "prediction": (alive_machine(predict=True), {"prediction": F("0.004")}),
    "prediction over a long delay": (
        alive_machine(predict=True, delay=F(1, 1000), feedback_time=F(1, 1000), sample_time=F(1, 1000)),
        {"prediction": F("0.004"), "delay": F(1, 1000)},
    ),
    "a fast feedback": (alive_machine(feedback_time=F(1, 4000)), {"feedback_time": F(1, 4000)}),
    "a fast feedback out of step": (alive_machine(feedback_time=F(1, 2300)), {"feedback_time": F(1, 2300)}),
    "a slow feedback": (alive_machine(feedback_time=F(3, 1000)), {"feedback_time": F(3, 1000)}),
    "a slow feedback out of step": (alive_machine(feedback_time=F(1, 700)), {"feedback_time": F(1, 700)}),
    "a drifting noise": (alive_machine(noise_rate=F(1, 50)), {}),
    "noise by state": (
        alive_machine(noise=(F("0.001"), F("0.002")), values=BOX),
        {"noise": F(1)},
    ),
    "u* played in time": (alive_machine(held=False), {}),
    "noise by state that drifts": (
        alive_machine(noise=(F("0.001"), F("0.002")), noise_rate=F(1, 10**5), values=BOX),
        {"noise": F(1)},
    ),
    "a low floor": (alive_machine(), {"floor": F(1, 1000)}),
    "prediction with a low floor": (
        alive_machine(predict=True),
        {"floor": F(1, 1000), "prediction": F("0.004")},
    ),
    "a u* that jumps": (
        replace(
            alive_machine(values={"input_rate": float("inf")}),
            constants=tube_constants(**(TUBE | {"u_star": 0.04})),
        ),
        {},
    ),
    "a flat metric": (
        alive_machine(
            values={
                "drift_difference_metric": 0.8,
                "drift_slope_metric": 3.1,
                "symbols": 0.0,
                "symbols_slope": 0.0,
            }
        ),
        {},
    ),
    "wind": (windy(alive_machine(), F("0.03")), {"wind": F("0.03"), "bias": F("0.12"), "speed": F(5)}),
    "parameters": (
        replace(
            alive_machine(),
            residual=ResidualConstants(
                push=Constant(below=0.0, above=0.02), size=Constant(below=0.0, above=0.03)
            ),
        ),
        {},
    ),
    "a horizon": (replace(alive_machine(), horizon=F("0.3")), {}),
}


def with_covariant(problem, **values):
    return replace(problem, machine=replace(problem.machine, covariant=covariant_constants(**values)))


def rounded(problem):
    """The same, for a controller that computes in double."""
    asked = replace(problem.machine.asked, arithmetic="double")
    return replace(problem, machine=replace(problem.machine, asked=asked))


def computed(problem, nodes=5, sweeps=2):
    """The same, for a controller that computes geodesics."""
    asked = replace(problem.machine.asked, geodesic=Picard(nodes=nodes, sweeps=sweeps))
    return replace(problem, machine=replace(problem.machine, asked=asked))


def with_gain(problem, error=0.03):
    return replace(problem, gain=GainConstants(error=Constant(below=0.0, above=error), matched=True))


for _name in ("plain", "no filter", "prediction", "a slow feedback out of step", "a flat metric", "wind"):
    FORMS[f"an uncertain gain, {_name}"] = with_gain(FORMS[_name][0]), FORMS[_name][1]
LOST = Rounding(feedback=F("0.0003"), input=F("0.002"), estimate=F("0.004"), prediction=F("0.0001"))
for _name in (
    "plain",
    "no filter",
    "prediction",
    "a slow feedback out of step",
    "a low floor",
    "u* played in time",
):
    FORMS[f"rounding, {_name}"] = rounded(FORMS[_name][0]), FORMS[_name][1] | {"rounding": (LOST,)}
for _name in (
    "plain",
    "no filter",
    "prediction",
    "a slow feedback out of step",
    "u* played in time",
    "parameters",
):
    FORMS[f"computed geodesics, {_name}"] = computed(FORMS[_name][0]), FORMS[_name][1]
FORMS["covariant with an uncertain gain"] = with_covariant(with_gain(alive_machine())), {}
FORMS["covariant"] = with_covariant(alive_machine()), {}
FORMS["covariant in wind"] = with_covariant(windy(alive_machine(), F("0.03"))), FORMS["wind"][1]
FORMS["covariant with computed geodesics"] = computed(with_covariant(alive_machine())), {}
FORMS["covariant with prediction"] = with_covariant(alive_machine(predict=True)), {"prediction": F("0.004")}


def numbers(problem, own):
    """What the package makes of a recipe, by the oracle's names."""
    x = evaluated(plant(problem, own.clip_radius), loop_of(own))
    e, run = x.estimate, x.course
    return {
        "bias": e.bias,
        "ripple": e.ripple,
        "speed": e.speed,
        "prediction": e.prediction,
        "within": None if e.geodesics is None else e.geodesics.within,
        "length": None if e.geodesics is None else e.geodesics.length,
        "kb": e.kb,
        "ups": e.ups,
        "s1": e.s1,
        "H1": e.H1,
        "X": e.X,
        "chi": x.loss.chi,
        "ell0": x.loss.ell0,
        "ell1": x.loss.ell1,
        "V_d": x.loss.V_d,
        "d1": run.d1,
        "omega": run.omega,
        "ultimate": run.bound.ultimate(),
        "needed": run.supremum(),
    }


@pytest.mark.parametrize("name", FORMS)
def test_every_number_is_that_of_the_theorem(name):
    problem, changes = FORMS[name]
    own = recipe(**changes)
    expected = theorem(given(problem, own)) | {"needed": needed(given(problem, own))}
    for key, found in numbers(problem, own).items():
        if found is None:
            assert key not in expected
            continue
        lo, hi = float(found.lo), float(found.hi)
        value = expected[key]
        assert float(value) == pytest.approx(lo, rel=1e-9, abs=1e-200), key
        # sup D of the oracle is a maximum over instants
        assert value <= hi if key != "needed" else value <= hi * (1 + 1e-12), key
        assert lo <= value + 1e-15 or key in {"needed", "n_fb"}, key


def settled(problem, own):
    """The same machine, level and floor, with Y, S, N and np a little above what they have to be: by the oracle."""
    before = None
    while own != before:
        need, before = theorem(given(problem, own)), own
        own = replace(
            own,
            speed=decimal(need["speed"]),
            bias=decimal(need["bias"]),
            ripple=decimal(need["ripple"]),
            prediction=None if own.prediction is None else decimal(need["prediction"]),
        )
    return own


def decimal(value):
    """A decimal a little above a number."""
    return F(mp.nstr(value * (1 + mp.mpf("1e-10")), 18))


@cache
def proving(name):
    """A recipe that proves the theorem at a form."""
    problem, changes = FORMS[name]
    return settled(problem, recipe(**{"level": F("0.8"), "floor": F("0.2")} | changes))


@pytest.mark.parametrize("name", FORMS)
def test_a_proof_needs_every_side_condition(name):
    problem, own = FORMS[name][0], proving(name)
    assert isinstance(check(problem, own), Proof), check(problem, own).margins
    for field in ("bias", "ripple", "prediction", "speed"):
        if getattr(own, field) is not None:
            short = replace(own, **{field: getattr(own, field) * (1 - F(1, 10**8))})
            assert not isinstance(check(problem, short), Proof), field
            level, stays = margins_hardware(problem, short)
            assert level.lo == stays.lo == -np.inf, field


@pytest.mark.parametrize("name", FORMS)
def test_the_least_level_is_that_of_the_oracle(name):
    """At the oracle's own max(d0, f0, d1, sup D) the theorem ends."""
    problem, own = FORMS[name][0], proving(name)
    need = needed(given(problem, own))
    margin = margins_hardware(problem, own)[1]
    assert float(margin.lo) == pytest.approx(
        float(1 - need / mp.mpf(own.level.numerator) * own.level.denominator), abs=1e-9
    )
    assert margin.hi == np.inf  # a recipe that fails refutes nothing


# -- what grows and what falls


def values_of(constants):
    return {
        item.name: None if (c := getattr(constants, item.name)) is None else c.above
        for item in fields(constants)
    }


@pytest.mark.parametrize(
    "name", ["plain", "prediction", "a flat metric", "a slow feedback out of step", "wind"]
)
def test_more_of_any_constant_needs_no_less(name):
    problem, own = FORMS[name][0], proving(name)
    least = float(margins_hardware(problem, own)[1].lo)
    known = values_of(problem.machine.constants)
    for field, value in known.items():
        if value is None:
            continue
        more = hardware_constants(**(known | {field: 1.001 * value + 1e-6}))
        larger = replace(problem, machine=replace(problem.machine, constants=more))
        assert float(margins_hardware(larger, settled(larger, own))[1].lo) <= least + 1e-9, field


# -- limits


def test_without_time_noise_and_wind_it_is_theorem_B_with_e_0():
    """At a fixed bandwidth, with the floor falling slower than the rest."""
    n = tube_constants(**(TUBE | {"initial_distance": 0.05}))
    found = []
    for k in (4, 6, 8):
        Ts = F(1, 10**k)
        problem = replace(alive_machine(sample_time=Ts, delay=Ts, noise=Ts / 1000, held=False), constants=n)
        own = recipe(
            sample_time=Ts,
            delay=Ts,
            feedback_time=Ts,
            noise=Ts / 1000,
            level=F("0.4"),
            floor=F(1, 10 ** (k // 2)),
        )
        own = settled(problem, own)
        x = evaluated(plant(problem, own.clip_radius), loop_of(own))
        Y = float(own.speed)
        S = (float(x.plant.n.Dht.hi) + float(x.plant.n.Dhx.hi) * Y) / float(own.bandwidth)
        limit = replace(
            x.course.bound,
            d0=x.plant.n.d0,
            H0=x.plant.n.H0,
            S=0 * x.plant.n.H0 + F(S),
            e=0 * x.plant.n.H0,
            delta=x.plant.n.delta,
        )
        found.append(float(x.course.supremum().hi) / float(limit.supremum().hi) - 1)
    assert all(a > 3 * b > 0 for a, b in pairwise(found))
    assert found[-1] < 1e-3


@pytest.mark.parametrize("name", ["plain", "prediction", "a flat metric", "wind", "covariant in wind"])
def test_the_scale_of_the_metric_does_not_matter(name):
    """W -> W/c^2: distances and what is measured by the metric grow by c; Y, S, N and the margins stay."""
    c = F(8)
    problem, own = FORMS[name][0], proving(name)
    tube, machine = problem.constants, problem.machine
    k = float(c)
    scaled = {
        "lower": tube.lower.above * k**2,
        "upper": tube.upper.above * k**2,
        "feedback_gain": tube.feedback_gain.above / k,
        "metric_input_gain": tube.metric_input_gain.above * k,
        "initial_distance": tube.initial_distance.above * k,
        "plan_defect_metric": tube.plan_defect_metric.above * k,
    }
    known = {item.name: getattr(tube, item.name).above for item in fields(tube)}
    own_values = values_of(machine.constants)
    for field in ("plan_tilt", "noise_metric", "drift_difference_metric"):
        if own_values[field] is not None:
            own_values[field] *= k
    changed = replace(
        problem,
        constants=tube_constants(**(known | scaled)),
        machine=replace(machine, constants=hardware_constants(**own_values)),
    )
    if machine.covariant is not None:
        v = values_of(machine.covariant)
        v |= {"form_slope": v["form_slope"] / k, "curvature": v["curvature"] / k**2}
        v |= {name: v[name] * k for name in ("input_gain", "drift_metric")}
        changed = replace(changed, machine=replace(changed.machine, covariant=covariant_constants(**v)))
    if problem.wind is not None:
        changed = windy(changed, problem.wind.bound, push=problem.wind.constants.push.above * k)
    other = replace(own, level=own.level * c, floor=own.floor * c)
    for one, two in zip(margins_hardware(problem, own), margins_hardware(changed, other), strict=True):
        assert float(one.lo) == pytest.approx(float(two.lo), abs=1e-12)
    assert float(one.lo) > 0


# -- the comparison equation of step 6


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "plain",
        "a fast feedback",
        "a fast feedback out of step",
        "a slow feedback",
        "a slow feedback out of step",
        "prediction",
    ],
)
def test_no_solution_of_the_comparison_equation_exceeds_the_closed_form(name):
    """D' = -lambda D + R(t), with both saw-teeth as they are, integrated exactly from step to step."""
    problem, own = FORMS[name][0], proving(name)
    for Ts, scale in ((own.sample_time, 1), (own.sample_time * 40, 40)):
        slow = replace(
            own,
            sample_time=Ts,
            delay=own.delay * scale,
            feedback_time=own.feedback_time * scale,
        )
        g = given(problem, slow)
        q = theorem(g)
        worst = integrated(g, q)
        closed = float(needed(g))
        assert worst <= closed * (1 + 1e-4)
        assert worst >= 0.9 * closed


def integrated(g, q):
    """The largest D, with steps that are short beside both clocks."""
    lam, omega, beta = float(g.lam), float(g.omega), float(g.beta)
    Ts, Tf, tau, t_a = float(g.Ts), float(g.Tf), float(g.tau), float(q["t_a"])
    first = max(float(g.d0), float(g.f0))
    count = int(min(12 / lam, 4000 * Ts) / (min(Ts, Tf) / 25))
    t = np.arange(count) * min(Ts, Tf) / 25
    waiting = (t - tau) % Tf
    teeth = float(q["s1"]) * (tau + (t - tau) % Ts)
    estimate = beta * (float(g.S) + float(q["extra"]) * np.exp(-omega * (t - t_a)) + float(g.N) + teeth)
    later = estimate + float(q["delta_2"]) + float(q["ell1"]) * waiting
    early = beta * float(q["X"] if Tf > Ts else q["H1"]) + float(q["delta_1"])
    push = np.where(t < t_a, early, later)
    step = t[1] - t[0]
    left, D, worst = np.exp(-lam * step), first, first
    for value in push:
        D = D * left + value * (1 - left) / lam
        worst = max(worst, D)
    return worst


# -- what it refuses


@pytest.mark.parametrize(
    "change",
    [
        {"sample_time": F(-1, 1000)},
        {"delay": F(-1, 2000)},
        {"delay": F(11, 10000)},
        {"bandwidth": F(0)},
        {"noise": F(-1, 1000)},
        {"wind": F(-1)},
        {"floor": F(0)},
        {"floor": F(-1)},
        {"level": F(-1)},
        {"bias": F(-1)},
        {"clip_radius": F("0.2")},
        {"level": F("0.853")},
    ],
    ids=str,
)
def test_it_is_stated_for_machines_only(change):
    problem, own = FORMS["plain"][0], proving("plain")
    assert not isinstance(check(problem, replace(own, **change)), Proof)
    assert not all(margin.lo > 0 for margin in margins_hardware(problem, replace(own, **change)))


def test_a_delay_is_at_most_one_sample():
    problem, T = FORMS["plain"][0], F(1001, 10**6)
    late = replace(proving("plain"), delay=T)
    possible = replace(late, sample_time=T, feedback_time=T)
    assert margins_hardware(problem, settled(problem, possible))[1].lo > 0
    assert margins_hardware(problem, settled(problem, late))[1].lo == -np.inf


def test_the_rate_of_noise_is_in_units_of_noise():
    """A ball of radius r lies in the box of sizes n_i times r/min n_i; what is not noisy does not count."""
    assert alive_machine(noise_rate=F(1, 50)).machine.drift == F(1, 50)
    assert alive_machine(noise_rate=F(1, 50), noise=(F(1, 1000), F(0))).machine.drift == 20
    assert alive_machine(noise_rate=F(1, 50), noise=(F(0), F(0))).machine.drift == 0
    assert alive_machine().machine.drift is None


def test_the_noise_has_to_fit_into_dbar_beside_the_level():
    problem, own = FORMS["plain"][0], proving("plain")
    level = margins_hardware(problem, own)[0]
    assert float(level.lo) == pytest.approx(1 - (0.8 + 0.00125) / (0.9**0.5 * 0.9), abs=1e-12)


@pytest.mark.parametrize(
    ("asked", "change"),
    [
        ({"sample_time": F(1, 999)}, {}),
        ({"delay": F(1, 2001)}, {}),
        ({"one_sample": True}, {}),
        ({"noise": F(1, 999)}, {}),
        ({"noise": (F(1), F(1))}, {}),
        ({"feedback_time": F(1, 1001)}, {}),
        ({"bandwidth": F(24)}, {}),
        ({"predict": True}, {}),
        ({}, {"wind": F(1, 10**9)}),
        ({}, {"feedback_time": F(1, 1001)}),
    ],
    ids=str,
)
def test_a_proof_is_about_the_machine_that_is_asked_for(asked, change):
    own = proving("plain")
    given_before = {"delay": F(1, 2000), "noise": F(1, 1000), "held": True}
    problem = asking(FORMS["plain"][0], **given_before)
    assert hardware.THEOREM.is_about(problem, own)
    other = asking(problem, **(given_before | asked))
    assert not hardware.THEOREM.is_about(other, replace(own, **change))
    assert not isinstance(check(other, replace(own, **change)), Proof)


def test_curved_geodesics_that_may_not_be_unique_prove_nothing():
    problem = alive_machine(values={"symbols": 1.2, "symbols_slope": 0.3})
    assert margins_hardware(problem, proving("plain"))[1].lo == -np.inf


def test_the_clip_is_a_box_or_a_ball():
    box = alive_machine()
    square = F("0.35") ** 2 + F("0.1") ** 2
    R = box.machine.clip_radius(box.constants.h)
    assert square <= R**2 <= square * (1 + F(1, 10**4))
    assert not box.machine.clips_within(box.constants.h, R - F(1, 10**4))
    ball = replace(box.machine, clip=())
    assert ball.clip_radius(box.constants.h) == F("0.35")
    assert not ball.clips_within(box.constants.h, F("0.3499"))
    with pytest.raises(ValueError, match="contains 0"):
        replace(box.machine, clip=((F(1), F(2)),))


def test_a_wind_may_push_harder_off_the_plan():
    """beta_w may rest on beta, |Theta B| on the plan; the covariant form needs |Theta E| everywhere."""
    problem = with_covariant(windy(alive_machine(), F("0.03"), push=0.1), input_gain=140.0)
    p = plant(problem, F("0.37"))
    assert float(hardware.metric_gust(p, p.m.bent).hi) == pytest.approx(1.7**0.5 * 0.9)
    problem = with_covariant(windy(alive_machine(), F("0.03"), push=0.1), input_gain=2.8)
    p = plant(problem, F("0.37"))
    assert float(hardware.metric_gust(p, p.m.bent).hi) == pytest.approx(0.2)


def test_it_needs_what_it_contains():
    needs = hardware.THEOREM.needs(alive_machine())
    assert needs == set(TUBE) - {"f", "M_x", "input_gain_least", "contraction_excess"}


def test_the_budget_adds_up():
    problem, own = FORMS["wind"][0], proving("wind")
    told = hardware.told(problem, own)
    x = evaluated(plant(problem, own.clip_radius), loop_of(own))
    whole = sum(getattr(told.budget, item.name) for item in fields(told.budget))
    level = float(x.course.bound.ultimate().hi) / float(own.level)
    assert whole == pytest.approx(level, rel=1e-9)
    assert told.radius == pytest.approx(0.8 / 0.9**0.5)
    assert float(reach(x.plant.n).lo) == pytest.approx(0.9**0.5 * 0.9)


@pytest.mark.parametrize(
    "lie",
    [
        {"noise": F(0), "ripple": F("0.0001")},
        {"delay": F(0)},
        {"feedback_time": F(1, 10_000)},
        {"clip_radius": F("0.38")},
        {"noise": F(0), "ripple": F("0.0001"), "delay": F(0), "level": F("0.12"), "floor": F("0.03")},
    ],
)
def test_a_curve_is_about_the_same_machine(lie: dict[str, F]) -> None:
    """What a search puts on the curve may differ from the decisive machine in its sample time alone."""
    problem, own = alive_machine(), recipe(level=F("0.21"))
    shorter = {"sample_time": F(1, 2000), "feedback_time": F(1, 2000)}
    honest, false = replace(own, **shorter), replace(own, **(shorter | lie))
    assert all(float(m.lo) > 0 for r in (honest, false) for m in hardware.margins_hardware(problem, r)), (
        "each is a proof of its own machine"
    )
    judged = judge(problem, hardware.THEOREM, Proposal(decisive=own, role="machine", curve=(honest, false)))
    assert judged.curve == (honest,)


@pytest.mark.parametrize("kind", [each.name for each in fields(Rounding)])
def test_what_is_lost_counts(kind):
    """Each of the four alone lowers a margin, or asks for more of the recipe."""
    problem, changes = FORMS["prediction"]
    problem = rounded(problem)
    own = settled(problem, recipe(**changes))
    none = Rounding(**{each.name: F(0) for each in fields(Rounding)})
    lost = replace(none, **{kind: F(1, 100)})
    before, after = (margins_hardware(problem, replace(own, rounding=(r,)))[1].lo for r in (none, lost))
    assert before > after  # -inf where Y, S or np is not enough any more


def test_a_controller_is_exact_or_rounds_as_the_specification_says():
    problem, changes = FORMS["plain"]
    own, none = recipe(**changes), Rounding(**{each.name: F(0) for each in fields(Rounding)})
    assert hardware.THEOREM.is_about(problem, own)
    assert not hardware.THEOREM.is_about(problem, replace(own, rounding=(none,)))
    assert not hardware.THEOREM.is_about(rounded(problem), own)
    assert hardware.THEOREM.is_about(rounded(problem), replace(own, rounding=(none,)))
    less = replace(none, input=F(-1))
    assert not hardware.THEOREM.is_about(rounded(problem), replace(own, rounding=(less,)))


def test_rounding_is_covered_for_a_known_gain_only():
    problem, changes = FORMS["plain"]
    none = Rounding(**{each.name: F(0) for each in fields(Rounding)})
    own = recipe(**changes, rounding=(none,))
    assert margins_hardware(rounded(problem), own)[0].lo > 0
    assert np.isneginf(margins_hardware(rounded(with_gain(problem)), own)[0].lo)
