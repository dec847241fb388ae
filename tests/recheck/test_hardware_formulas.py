"""Theorem H of recheck against that of the producer: two readings of one text, at random machines."""

from __future__ import annotations

from dataclasses import fields, replace
from fractions import Fraction
from functools import cache

import machines
import pytest
from flint import arb, ctx
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rechecked import case_of, certified
from systems import SMALL
from tubecert.bounds.covariant import CovariantConstants
from tubecert.recheck.digital import Evaluation, loop
from tubecert.recheck.proposal import proposed
from tubecert.recheck.recipe import Bent, Digital, Losses, MachineNumbers, Promise

from tubecert.bounds.constants import GainConstants, WindConstants
from tubecert.conditions import hardware as theorem
from tubecert.conditions.problem import Wind
from tubecert.enclosure.constant import Constant
from tubecert.recheck.balls import exact
from tubecert.recheck.conditions import Numbers, Setting, WindNumbers
from tubecert.recheck.specified.hardware import Arcs
from tubecert.spec import Picard

LOST = theorem.Rounding(
    feedback=Fraction(1, 300), input=Fraction(1, 70), estimate=Fraction(1, 50), prediction=Fraction(1, 900)
)
BENT = ("drift_slope", "form_slope", "input_slope", "input_gain", "drift_metric", "curvature")
MOVING = ("feedback_drift", "drift_rate")
APART = ("windows", "losses")
WIND = ("push", "size", "explained")


@cache
def system():
    """Some system: of it only the rate and the horizon count here."""
    return case_of(certified(SMALL, conditions="distance")).system


def ball(constant: Constant) -> arb:
    return exact(Fraction(constant.above))


@st.composite
def problems(draw):
    """A problem with a machine of which every term may be alive, its recipe, and both readings of it."""
    sizes = st.floats(0.01, 3)

    def some(names, scale=1.0):
        return {name: draw(sizes) * scale for name in names}

    flat, bent = draw(st.booleans()), draw(st.booleans())
    own = some(machines.ALIVE) | some(("symbols", "symbols_slope"), 0.0 if flat else 0.1)
    if not flat:
        own |= {"drift_difference_metric": None, "drift_slope_metric": None}
    if draw(st.booleans()):
        own |= {"feedback_drift": None, "drift_rate": None}
    held, predicts = draw(st.booleans()), draw(st.booleans())
    if not held:
        own["input_rate"] = None
    sample_time = Fraction(draw(st.integers(1, 40)), 10_000)
    ratio = draw(st.sampled_from([Fraction(1), Fraction(1, 2), Fraction(2, 5), Fraction(3), Fraction(7, 3)]))
    feedback_time = sample_time * ratio
    delay = min(sample_time, feedback_time) * draw(
        st.sampled_from([Fraction(0), Fraction(1, 2), Fraction(1)])
    )
    drift = draw(st.sampled_from([None, Fraction(1, 3)]))
    problem = machines.alive_machine(
        own,
        sample_time=sample_time,
        feedback_time=feedback_time,
        held=held,
        predict=predicts,
        noise_rate=drift,
        geodesic=draw(st.sampled_from([None, Picard(nodes=1, sweeps=1), Picard(nodes=7, sweeps=3)])),
    )
    values = some(item.name for item in fields(Numbers)) | {"lower": 0.8, "upper": 1.5}
    horizon = draw(st.sampled_from([None, Fraction(1, 3), Fraction(5)]))
    machine = replace(
        problem.machine,
        covariant=None
        if flat or not bent
        else CovariantConstants(**{name: point(draw(sizes) * 0.5) for name in BENT}),
    )
    problem = replace(
        problem,
        constants=replace(problem.constants, **{name: point(value) for name, value in values.items()}),
        machine=machine,
        horizon=horizon,
        wind=Wind(
            bound=Fraction(1, 20), constants=WindConstants(**{name: point(draw(sizes)) for name in WIND})
        ),
    )
    if problem.machine.asked.geodesic is None and draw(st.booleans()):
        problem = replace(problem, gain=GainConstants(error=point(draw(st.floats(0.001, 0.9))), matched=True))
    level = Fraction(draw(st.integers(1, 60)), 100)
    bandwidth = draw(st.sampled_from([None, Fraction(2), Fraction(130, 100), Fraction(90)]))
    recipe = theorem.HardwareRecipe(
        sample_time=sample_time,
        delay=delay,
        feedback_time=feedback_time,
        bandwidth=bandwidth,
        noise=Fraction(1, 500),
        wind=Fraction(1, 20),
        clip_radius=Fraction(3),
        level=level,
        floor=level / draw(st.integers(2, 300)),
        speed=Fraction(draw(st.integers(1, 90))),
        bias=Fraction(draw(st.integers(1, 90)), 30),
        ripple=Fraction(draw(st.integers(1, 90)), 300),
        prediction=Fraction(draw(st.integers(1, 90)), 3000) if predicts else None,
        rounding=() if problem.gain is not None else draw(st.sampled_from([(), (LOST,)])),
    )
    return problem, recipe


def point(value: float) -> Constant:
    return Constant(below=value, above=value)


def own_reading(problem, recipe) -> tuple[Setting, MachineNumbers, Promise, Digital]:
    """The same problem as recheck reads it from a certificate."""
    c, m, w = problem.constants, problem.machine, problem.wind
    setting = Setting(
        replace(system(), rate=problem.rate, horizon=problem.horizon),
        Numbers(**{item.name: ball(getattr(c, item.name)) for item in fields(Numbers)}),
        problem.rho,
        problem.rho_a,
        WindNumbers(*(ball(getattr(w.constants, name)) for name in WIND), exact(w.bound)),
        gain=None if problem.gain is None else ball(problem.gain.error),
    )
    known = {name: ball(value) for name, value, _ in m.constants.items()} | {
        "plan_defect": ball(c.plan_defect)
    }
    absent = dict.fromkeys(("drift_difference_metric", "drift_slope_metric", "input_rate", *MOVING))
    bent = None
    if m.covariant is not None:
        bent = Bent(**{name: ball(getattr(m.covariant, name)) for name in BENT})
    numbers = MachineNumbers(**(absent | known), bent=bent)
    own = m.asked.geodesic
    promise = Promise(
        held=m.asked.held,
        predicts=m.asked.predict,
        drift=m.drift,
        arcs=None if own is None else Arcs(panels=own.nodes, passes=own.sweeps),
    )
    return (
        setting,
        numbers,
        promise,
        Digital(
            **{item.name: getattr(recipe, item.name) for item in fields(Digital) if item.name not in APART},
            losses=next(
                (
                    Losses(**{item.name: getattr(r, item.name) for item in fields(Losses)})
                    for r in recipe.rounding
                ),
                None,
            ),
        ),
    )


def same(own: arb, other) -> None:
    """A ball and an interval of one number: they meet, and are thin."""
    low, high = float(other.lo), float(other.hi)
    if not own.is_finite():
        assert not (low <= high < float("inf"))
        return
    slack = 1e-9 * max(1e-12, abs(high))
    assert low - slack <= float(own) <= high + slack, (float(own), low, high)


@pytest.mark.slow
@settings(deadline=None, max_examples=80)
@given(problems())
def test_both_readings_of_theorem_h_agree(case):
    problem, recipe = case
    noise = float(recipe.noise) * problem.machine.constants.noise_metric.above
    if recipe.prediction is not None:  # a predicted state is off by no less than a measured one
        assume(float(recipe.prediction) * problem.constants.upper.above**0.5 >= noise)
    x = theorem.evaluated(theorem.plant(problem, recipe.clip_radius), theorem.loop_of(recipe))
    with ctx.workprec(160):
        reading = own_reading(problem, recipe)
        own = Evaluation(*reading)
        needed = own.needed()
        found = own.course()
    for value, other in zip(needed, (x.estimate.speed, x.estimate.bias, x.estimate.ripple), strict=False):
        same(value, other)
    if x.estimate.prediction is not None:
        same(needed[3], x.estimate.prediction)
    if x.estimate.geodesics is not None:
        assert (own.bent is not None) == bool(x.estimate.geodesics.within.lo > 0)
        if own.bent is None:
            return
        same(own.bent.loss, x.estimate.geodesics.feedback)
        same(own.bent.beyond, x.estimate.geodesics.input)
    if not x.loss.chi.lo > 0:
        return
    same(found.error, x.estimate.X)
    same(found.feedback, x.estimate.kb)
    same(found.feedforward, x.estimate.ups)
    same(found.ultimate, x.course.bound.ultimate())
    same(found.top, x.course.supremum())


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(problems(), st.integers(2, 400))
def test_where_some_floor_serves_the_proposal_serves(case, share):
    problem, recipe = case
    with ctx.workprec(160):
        setting, numbers, promise, like = own_reading(problem, replace(recipe, level=Fraction(1, 2)))
        found = proposed(setting, numbers, promise, like, fixed=True)
        if found is None:
            return
        own = loop(setting, numbers, promise, found)
        other = loop(setting, numbers, promise, replace(found, floor=found.level / share))
        assert (own is None) == (other is None)  # only (H.12) depends on the floor
        if own is not None and other is not None and other.top < exact(found.level * Fraction(999, 1000)):
            assert own.top < exact(found.level)
