"""Theorem HW: one window is theorem H, the course of D against its differential equation, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from machines import alive_machine, windy
from test_hardware import LOST, rounded
from tubecert.conditions.hardware.course import ages_of_feedback, base_of
from tubecert.conditions.hardware.windows import course_of
from tubecert.conditions.machine import Window
from tubecert.search.along import propose_in_windows

from tubecert.conditions import hardware
from tubecert.conditions.hardware import HardwareRecipe, Rounding, WindowProof, margins_hardware
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Interval
from tubecert.kernel import Proof, check

F = Fraction
HORIZON = F(3)
PAD = F(1, 400)  # s
STEP = 5e-6  # s
OWN = {"level": F("0.2"), "floor": F("0.05"), "speed": F("4.6"), "bias": F("0.08"), "ripple": F("0.06")}


def recipe(*windows: dict, **changes) -> HardwareRecipe:
    """A recipe with room at `alive_machine()`, the same in each window but for what is said."""
    own = {
        "sample_time": F(1, 1000),
        "delay": F(1, 2000),
        "feedback_time": F(1, 1000),
        "bandwidth": F(25),
        "noise": F(1, 1000),
        "wind": F(0),
        "clip_radius": F("0.37"),
        "prediction": None,
    } | changes
    numbers = {name: own.pop(name, value) for name, value in OWN.items()} | {
        "prediction": own.pop("prediction")
    }
    parts = tuple(WindowProof(**(numbers | each)) for each in windows)
    if parts:
        numbers = {
            name: None if numbers[name] is None else max(getattr(part, name) for part in parts)
            for name in numbers
        }
    return HardwareRecipe(**own, **numbers, windows=parts)


def pad_of(r: HardwareRecipe) -> Fraction:
    return 2 * max(r.sample_time, r.feedback_time) + r.delay


def scaled(constants, factors):
    """Constants with some times a factor, by name."""
    changed = {}
    for name, factor in factors.items():
        if hasattr(constants, name):
            old = getattr(constants, name)
            changed[name] = Constant(below=0.0, above=old.above * factor)
    return replace(constants, **changed)


def cut(problem, *factors: dict, ends=None, pad=PAD):
    """The problem in windows of equal length, each with some constants times a factor."""
    problem = replace(problem, horizon=HORIZON)
    machine = problem.machine
    ends = ends or [HORIZON * k / len(factors) for k in range(len(factors) + 1)]
    windows = tuple(
        Window(
            begin=begin,
            end=end,
            since=max(F(0), begin - pad),
            radius=problem.rho,
            constants=scaled(problem.constants, own),
            machine=scaled(machine.constants, own),
            covariant=None,
            wind=None if problem.wind is None else problem.wind.constants,
            residual=problem.residual,
            inputs={},
        )
        for begin, end, own in zip(ends[:-1], ends[1:], factors, strict=True)
    )
    return replace(problem, machine=replace(machine, windows=windows))


FORMS = {
    "plain": (alive_machine(), {}),
    "noise by state and its rate": (
        alive_machine(noise=(F("0.001"), F("0.002")), noise_rate=F(1, 50)),
        {"noise": F(1, 1000)},
    ),
    "prediction": (alive_machine(predict=True), {"prediction": F("0.004")}),
    "a fast feedback out of step": (alive_machine(feedback_time=F(1, 2300)), {"feedback_time": F(1, 2300)}),
    "a slow feedback": (alive_machine(feedback_time=F(3, 1000)), {"feedback_time": F(3, 1000)}),
    "rounding": (rounded(alive_machine()), {"rounding": (LOST,), "bias": F("0.1"), "speed": F(5)}),
    "wind": (windy(alive_machine(), F("0.03")), {"wind": F("0.03"), "bias": F("0.12"), "speed": F(5)}),
}


def test_a_gain_of_the_feedback_in_a_window_does_not_count_where_it_is_cut_by_that_of_the_whole():
    """The code is the same in all windows, and so is what it cuts its feedback by; other constants count."""
    own = recipe({}, {}, **FORMS["rounding"][1])
    problem = rounded(alive_machine())

    def stays(*factors):
        return float(margins_hardware(cut(problem, *factors), own)[1].lo)

    assert stays({}, {}) == stays({}, {"feedback_gain": 0.5})
    assert stays({}, {}) < stays({"feedback_slope": 0.5}, {"feedback_slope": 0.5})
    exact = replace(own, rounding=())
    alive = alive_machine()
    both = {"feedback_gain": 0.5}
    halves = [float(margins_hardware(cut(alive, each, each), exact)[1].lo) for each in ({}, both)]
    assert halves[0] < halves[1]


def test_rounding_in_windows_is_not_proven_of_a_problem_that_knows_nothing_of_it():
    """Its windows would be taken with a du of their own, below what the code cuts its feedback by."""
    own = recipe({}, {}, **FORMS["rounding"][1])
    assert np.isfinite(float(margins_hardware(cut(rounded(alive_machine()), {}, {}), own)[1].lo))
    assert float(margins_hardware(cut(alive_machine(), {}, {}), own)[1].lo) == -np.inf


def test_what_rounding_costs_counts_in_every_window():
    problem, changes = FORMS["rounding"]
    nothing = Rounding(feedback=F(0), input=F(0), estimate=F(0), prediction=F(0))

    def last(lost):
        own = recipe({}, {}, **changes | {"rounding": (lost,), "floor": F("0.01")})
        return course_of(cut(problem, {}, {}), own)[1]

    of_nothing = last(nothing)
    for name in ("feedback", "input"):
        assert last(replace(nothing, **{name: F(1, 20)})).supremum.lo > of_nothing.supremum.hi + 1e-4
    bias = last(LOST).at.estimate.bias.lo - of_nothing.at.estimate.bias.hi
    assert float(bias) >= float(LOST.estimate) * 0.999


@pytest.mark.parametrize("form", FORMS)
def test_one_window_is_theorem_h(form):
    problem, changes = FORMS[form]
    alone = margins_hardware(replace(problem, horizon=HORIZON), recipe(**changes))
    windowed = margins_hardware(cut(problem, {}), recipe({}, **changes))
    assert np.isfinite(float(alone[1].lo))
    for one, other in zip(alone, windowed, strict=True):
        assert float(other.lo) == pytest.approx(float(one.lo), abs=1e-12)


def test_without_a_filter_one_window_is_no_worse():
    problem, changes = alive_machine(noise=F(1, 10**5)), {"bandwidth": None, "noise": F(1, 10**5)}
    alone = margins_hardware(replace(problem, horizon=HORIZON), recipe(**changes))
    windowed = margins_hardware(cut(problem, {}), recipe({}, **changes))
    assert float(alone[1].lo) <= float(windowed[1].lo) < float(alone[1].lo) + 0.05


# -- the course of D

FACTORS = [
    {"h_t": 0.3, "feedback_slope": 0.4, "plan_defect_metric": 0.1},
    {"h_t": 1.0, "feedback_slope": 1.0, "plan_defect_metric": 1.0},
    {"h_t": 0.1, "feedback_slope": 0.5, "plan_defect_metric": 0.3, "metric_input_gain": 0.5},
]


def forcing(found, r: HardwareRecipe, lengths):
    """R(t) of the comparison equation with its saw-teeth, window by window, in floats; from when on it holds."""
    Ts, tau, Tf = float(r.sample_time), float(r.delay), float(r.feedback_time)
    t_a = max(Ts, Tf) + tau

    def push(t: np.ndarray, j: int) -> np.ndarray:
        x = found[j].at
        n, e, loss, loop = x.plant.n, x.estimate, x.loss, x.loop
        lam, beta, s1 = (float(v.hi) for v in (n.lam, n.beta, e.s1))
        S, N, f0, z = (float(v.hi) for v in (loop.S, loop.N, loop.f0, n.H0))
        age = ages_of_feedback(loop)
        youngest, oldest = float(loss.at(age.youngest).hi), float(loss.at(age.oldest).hi)
        move = float((loss.V_d * age.oldest + e.n_fb).hi)
        decay = np.exp(-float(r.bandwidth) * (t - (t_a if j == 0 else lengths[j])))
        xi = S + max(0.0, z - S) * decay + N + s1 * tau + s1 * ((t - tau) % Ts)
        base = float(base_of(x.plant, loop, e).hi)
        saw = 0.0 if r.prediction is not None and Tf != Ts else (t - tau) % Tf
        return beta * xi + max(lam * f0, base + youngest + oldest * move / f0) + float(loss.ell1.hi) * saw

    return t_a, push


SLOW = {"sample_time": F(1, 50), "feedback_time": F(1, 50), "delay": F(0)}
STEEPER = {
    "in the estimate": [{"h_t": 0.01, "h_x": 0.01}, {"h_t": 3.0}, {"h_t": 0.01}],
    "in the feedback": [{"feedback_slope": 0.05, "feedback_curvature": 0.05}, {}, {"feedback_slope": 0.05}],
}


def followed(problem, r: HardwareRecipe):
    """D by its differential equation, window by window: what holds of it, and its path there, in steps of STEP."""
    from scipy.signal import lfilter  # a second

    found = course_of(problem, r)
    ends = [0.0, *(float(w.end) for w in problem.machine.windows)]
    t_a, push = forcing(found, r, ends)
    D = float(found[0].at.course.d1.hi)
    for j, own in enumerate(found):
        begin = t_a if j == 0 else ends[j]
        lam = float(own.at.plant.n.lam.hi)
        D = max(D, float(own.at.loop.f0.hi))
        # D' = -lambda D + R(t), exactly but for R at the middle of each step
        decay = np.exp(-lam * STEP)
        pushed = push(begin + STEP * (np.arange(round((ends[j + 1] - begin) / STEP)) + 0.5), j)
        path, _ = lfilter([(1 - decay) / lam], [1.0, -decay], pushed, zi=[decay * D])
        yield j, own, path
        D = float(path[-1])


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, {"bandwidth": F(3)}, {"feedback_time": F(3, 1000)}])
def test_the_course_is_above_the_comparison_equation(changes):
    problem = cut(
        alive_machine(**{k: v for k, v in changes.items() if k == "feedback_time"}), *FACTORS, pad=F(1, 100)
    )
    r = recipe({"floor": F("0.02")}, {}, {"floor": F("0.03")}, **changes)
    for j, own, path in followed(problem, r):
        assert path.max() <= float(own.supremum.hi) * (1 + 1e-6)
        assert not j or path.max() >= 0.999 * float(own.supremum.hi)
        assert float(own.end.hi) * (1 + 1e-6) >= path[-1]


@pytest.mark.parametrize("form", STEEPER)
def test_a_saw_that_grows_steeper_is_ahead_of_its_mean(form):
    """Windows begin where the saw-tooth is behind its mean the most: D has to jump for that."""
    machine = alive_machine(sample_time=F(1, 50), delay=F(0))
    ends = [F(0), F(1) + F(8, 1000), F(2) + F(8, 1000), HORIZON]
    problem = cut(machine, *STEEPER[form], ends=ends, pad=F(1, 25))
    r = recipe({}, {}, {}, **SLOW)
    for j, own, path in followed(problem, r):
        if j == 1:
            v = np.arange(1, 9) * 0.02 - 0.008  # where the saw falls
            bound = [float(own.at.course.bound.at(Interval.exact(x)).hi) for x in v]
            ratio = path[np.round(v / STEP).astype(int) - 1] / bound
            assert ratio.max() <= 1 + 1e-6
            assert ratio.max() >= 0.99


def test_a_window_begins_above_its_floor():
    problem = cut(alive_machine(), *FACTORS)
    low, high = (course_of(problem, recipe({}, {}, {"floor": f}))[2] for f in (F("0.05"), F("0.25")))
    assert float(low.at.course.bound.d0.hi) < 0.25 <= float(high.at.course.bound.d0.hi)
    assert float(high.supremum.hi) >= 0.25


@pytest.mark.parametrize("noisy", [(0.2, 1.0, 0.1), (1.0, 1.0, 1.0)])
def test_what_the_filter_remembers(noisy):
    """|e_k| along samples, and the noise in it, against S_j + (z_j - S_j) e^(...) and N_j at their largest."""
    problem = cut(
        alive_machine(),
        {"h_t": 1.0, "noise_explained": noisy[0], "B_pinv_x": 1.0},
        {"h_t": 0.05, "noise_explained": noisy[1], "B_pinv_x": 0.02},
        {"h_t": 0.05, "noise_explained": noisy[2], "B_pinv_x": 0.02},
        ends=[F(0), F(1, 10), F(2, 10), HORIZON],
    )
    r = recipe({}, {}, {}, bandwidth=F(25))
    found = course_of(problem, r)
    Ts, th = 1e-3, 1 - np.exp(-25e-3)
    k = np.arange(1, 400)
    window = np.searchsorted([0.1, 0.2], k * Ts - 1e-12)
    S = np.array([float(x.at.loop.S.hi) for x in found])
    own_M = np.array(noisy) * 1e-3 * 1.05
    nbar = 1e-3
    speeds = [float(x.at.loop.Y.hi) for x in found]
    bent = np.array([float(x.at.plant.n.DBpx.hi) for x in found]) * (np.array(speeds) + 2 * nbar / Ts) * nbar
    z = [float(x.at.plant.n.H0.hi) for x in found]
    e = float(found[0].at.plant.n.H0.hi)
    for step, j in zip(k, window, strict=True):
        e = (1 - th) * e + th * S[j]
        t = step * Ts + 1.5e-3  # until when the sample acts
        start = 1.5e-3 if j == 0 else [0, 0.1, 0.2][j]
        allowed = S[j] + max(0.0, z[j] - S[j]) * np.exp(-25 * (t - start))
        assert e <= allowed * (1 + 1e-9)
        if step % 20 in (0, 1):
            i = np.arange(1, step + 1)
            a = th * (1 - th) ** (step - i)
            weights = np.append(a, 0.0) - np.append(0.0, a)  # of m_0, ..., m_k, but for signs
            noise = np.abs(weights[1:-1]) @ own_M[window[: step - 1]] if step > 1 else 0.0
            noise = (noise + a[-1] * own_M[j] + a[0] * own_M[0]) / Ts + a @ bent[window[:step]]
            assert noise <= float(found[j].at.estimate.ripple.hi) * (1 + 1e-9)
    decayed = S[0] + (z[0] - S[0]) * np.exp(-25 * (0.1 - float(PAD)))
    assert z[1] == pytest.approx(decayed, rel=1e-9)


def test_what_acted_before_still_counts():
    """The pad of a window lies in the one before it: its kappa, its u0 and its error are bounded there."""
    whole = cut(alive_machine(), {}, {})
    calm = cut(alive_machine(), {}, {"feedback_gain": 0.01, "u_star": 0.01, "h": 0.01})
    parts = [{}, {"level": F("0.19")}]
    first, second = course_of(calm, recipe(*parts))
    assert float(second.at.estimate.kb.hi) == float(first.at.estimate.kb.hi)
    assert float(second.at.estimate.ups.hi) == float(first.at.estimate.ups.hi)
    assert float(second.at.estimate.X.hi) >= float(first.at.estimate.X.hi)
    assert float(second.at.loop.dhat.hi) == 0.2  # the level of the window before
    assert float(second.supremum.hi) < float(course_of(whole, recipe(*parts))[1].supremum.hi)


# -- what is asked for


def test_it_proves_and_every_number_is_verified():
    problem, r = cut(alive_machine(), *FACTORS), recipe({}, {}, {})
    assert isinstance(check(problem, r), Proof)
    for k, change in enumerate(
        (
            {"speed": F("0.5")},
            {"bias": F("0.001")},
            {"ripple": F("0.0001")},
            {"level": F("0.07")},
            {"level": F(3)},
            {"floor": F("0.21")},
            {"prediction": F("0.001")},
        )
    ):
        parts = [change if i == k % 3 else {} for i in range(3)]
        assert not isinstance(check(problem, recipe(*parts)), Proof), change
    own = recipe({}, {"level": F("0.09")}, {})  # less than its sup D, though the window before has more
    assert not isinstance(check(problem, own), Proof)
    for name in OWN:  # what is said of all windows is the largest of them
        assert not isinstance(check(problem, replace(r, **{name: getattr(r, name) * F("0.9")})), Proof), name
    negative = replace(r.windows[2], ripple=F(-1))
    broken = replace(r, windows=(*r.windows[:2], negative))
    assert not isinstance(check(problem, broken), Proof)
    assert not float(margins_hardware(problem, broken)[0].lo) > 0


def test_windows_and_recipes_belong_together():
    problem = cut(alive_machine(), *FACTORS)
    assert not isinstance(check(problem, recipe()), Proof)
    assert not isinstance(check(problem, recipe({}, {})), Proof)
    assert not isinstance(check(replace(alive_machine(), horizon=HORIZON), recipe({}, {}, {})), Proof)


def test_windows_that_leave_something_out_prove_nothing():
    r = recipe({}, {}, {})
    good = cut(alive_machine(), *FACTORS)
    a, b, c = good.machine.windows

    def with_those(*windows):
        return replace(good, machine=replace(good.machine, windows=windows))

    assert isinstance(check(with_those(a, b, c), r), Proof)
    shorter = F(1, 10**6)
    for windows in (
        (a, replace(b, begin=b.begin + shorter), c),
        (a, replace(b, since=b.since + shorter), c),
        (a, replace(b, since=F(-1)), c),
        (replace(a, begin=shorter), b, c),
        (replace(a, since=shorter), b, c),
        (a, b, replace(c, end=c.end - shorter)),
        (a, b, replace(c, radius=good.rho + shorter)),
        (a, c, b),
    ):
        assert not isinstance(check(with_those(*windows), r), Proof)
    for length, holds in ((PAD, True), (PAD - shorter, False)):
        ends = [F(0), F(1), HORIZON - length, HORIZON]
        brief = cut(alive_machine(), FACTORS[2], FACTORS[2], FACTORS[2], ends=ends)
        assert isinstance(check(brief, r), Proof) is holds
    late = cut(alive_machine(), *FACTORS, pad=F(1, 401))
    assert not isinstance(check(late, r), Proof)


def test_a_radius_of_its_own_limits_the_level():
    good = cut(alive_machine(), *FACTORS)
    a, b, c = good.machine.windows
    narrow = replace(c, radius=c.radius / 5)
    problem = replace(good, machine=replace(good.machine, windows=(a, b, narrow)))
    assert not isinstance(check(problem, recipe({}, {}, {})), Proof)


@pytest.mark.slow
def test_the_search_looks_below_the_level_of_the_whole_tube():
    """Where the metric is larger in the windows levels could be higher there, but none is proven above dbar.

    Costs grow faster than levels here: from the highest levels of the windows the search would find none that serve.
    """
    factors = [
        {**each, "feedback_curvature": 370, "feedback_slope": 10 * each["feedback_slope"]} for each in FACTORS
    ]
    problem = cut(alive_machine(), *factors)
    larger = Constant(below=100.0, above=100.0)
    assert problem.constants.lower.above < 1
    windows = tuple(
        replace(own, constants=replace(own.constants, lower=larger)) for own in problem.machine.windows
    )
    problem = replace(problem, machine=replace(problem.machine, windows=windows))
    found = propose_in_windows(problem, problem.machine).decisive
    assert isinstance(check(problem, found), Proof)
    assert float(found.level) < 0.5 < problem.constants.lower.below**0.5 * float(problem.rho) < 1


def test_what_is_told_of_each_window():
    problem, r = cut(alive_machine(), *FACTORS), recipe({}, {"level": F("0.21")}, {})
    every = hardware.told_in_windows(problem, r)
    told = hardware.told(problem, r)
    assert told.radius == max(own.radius for own in every) == every[1].radius
    assert told.budget == every[1].budget
    assert told.supremum == max(own.supremum for own in every)
    assert hardware.THEOREM.ultimate is not None
    assert hardware.THEOREM.ultimate(problem, r) > 0
