"""Theorems BW and CW of recheck against those of the producer: two readings of one text, and bugs in either."""

from __future__ import annotations

import inspect
import sys
from dataclasses import fields, replace
from fractions import Fraction
from types import ModuleType

import pytest
import stretched
from flint import ctx
from hypothesis import given, settings
from hypothesis import strategies as st
from test_hardware_formulas import WIND, ball, same, system
from tubecert.conditions.stretches import over
from tubecert.recheck.sampling import SampledGains

from tubecert.conditions import distance, distance_windows, sampled, sampled_windows, stretches
from tubecert.recheck import legs
from tubecert.recheck.balls import exact
from tubecert.recheck.conditions import Numbers, Setting, WindNumbers
from tubecert.recheck.predictor import Gains

F = Fraction
GAINS = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")
SAMPLED = ("sample_time", "bandwidth", "predictor_gain", "projection_radius")


def stays(problem, recipe, module=legs):
    """The windows as recheck reads them."""
    found = []
    for part, own in zip(problem.parts, recipe.windows, strict=True):
        one = over(problem, part)
        wind = one.wind
        setting = Setting(
            replace(
                system(),
                rate=one.rate,
                horizon=problem.horizon,
                A_m=None if one.A_m is None else system().A_m,
            ),
            Numbers(**{item.name: ball(getattr(one.constants, item.name)) for item in fields(Numbers)}),
            part.radius,
            part.radius / 2,
            None
            if wind is None
            else WindNumbers(*(ball(getattr(wind.constants, name)) for name in WIND), exact(wind.bound)),
            turns=not problem.constant_input,
        )
        found.append(
            module.Stay(setting=setting, level=own.level, speed=own.speed, length=part.end - part.begin)
        )
    return found


def numbers_of_distance(problem, recipe):
    """What the producer finds: top, xi, S and e of every window."""
    found = distance.course_of(problem, recipe)
    return [(x.course.supremum, x.course.uncertainty, x.uncertainty, x.error) for x in found]


def numbers_of_samples(problem, recipe):
    found = sampled.course_of(problem, recipe)
    return [(x.course.supremum, x.course.uncertainty) for x in found]


def compare(problem, recipe, theirs, module=legs):
    """Every number of recheck with those of the producer."""
    with ctx.workprec(160):
        if hasattr(recipe, "sample_time"):
            gains = SampledGains(**{name: getattr(recipe, name) for name in SAMPLED})
            found = module.of_samples(stays(problem, recipe, module), gains)
            own = [(x.top, x.left_of_h) for x in found]
        else:
            gains = Gains(**{name: getattr(recipe, name) for name in GAINS})
            found = module.of_distance(stays(problem, recipe, module), gains, recipe.settling)
            own = [(x.top, x.left_of_h, x.S, x.e) for x in found]
        for mine, other in zip(own, theirs, strict=True):
            for value, its in zip(mine, other, strict=True):
                same(value, its)


@pytest.fixture(autouse=True)
def anything_stays(monkeypatch):
    """Formulas are compared wherever they lead, not only where a level is proven."""
    monkeypatch.setattr(legs, "_stays", lambda *_: True)
    monkeypatch.setattr(legs.Setting, "radius_serves", lambda *_, **__: True)


SHARES = st.lists(st.sampled_from([0.2, 0.5, 1.0]), min_size=1, max_size=3)
SPEEDS = st.integers(1, 60).map(Fraction)


@pytest.mark.slow
@settings(deadline=None, max_examples=5)
@given(SHARES, st.data())
def test_both_readings_agree(shares, data):
    wind, turns = data.draw(st.booleans()), data.draw(st.booleans())
    values = {} if turns else {"B_x": 0.0, "B_pinv_x": 0.0}
    problem = stretched.some(*shares, wind=wind, values=values, A_m=None)
    speeds = [data.draw(SPEEDS) for _ in shares]
    omega, g = (Fraction(data.draw(st.sampled_from([1, 13, 80, 400])), 10) for _ in range(2))
    rate = Fraction(10) ** data.draw(st.integers(0, 6))
    one = stretched.of_distance(problem, speeds, bandwidth=omega, predictor_gain=g, adaptation_rate=rate)
    compare(problem, one, numbers_of_distance(problem, one))
    Ts = Fraction(data.draw(st.sampled_from([1, 20, 140])), 1000)
    other = stretched.of_samples(problem, speeds, bandwidth=omega, predictor_gain=g, sample_time=Ts)
    compare(problem, other, numbers_of_samples(problem, other))


IN_RECHECK = {
    "the filter forgets": ("mu = self.memory + leg.rise", "mu = leg.rise"),
    "the rise is forgotten": ("mu = self.memory + leg.rise", "mu = self.memory"),
    "the memory is where it began": ("self.memory = leg.S + (mu", "self.memory = leg.S + leg.S - (mu"),
    "the filter does not settle": ("(-self.omega * leg.length).exp()", "(-self.omega).exp()"),
    "the distance starts anew": ("d0=self.distance,", "d0=setting.n.initial_distance,"),
    "no peak inside": ("larger(self.top, D.supremum())", "larger(self.top, D.at(leg.length))"),
    "e is left out of xi": ("larger(mu, leg.S) + leg.e", "larger(mu, leg.S)"),
    "mu is left out of xi": ("larger(mu, leg.S) + leg.e", "leg.S + leg.e"),
    "the estimator forgets": ("larger(held, self.settled)", "self.settled"),
    "it forgets at once": ("self.after(held, wait)", "self.settled"),
    "it forgets twice as fast": ("self.forgets = p.q / 2", "self.forgets = 2 * p.q"),
    "it forgets half as fast": ("self.forgets = p.q\n", "self.forgets = p.q / 2\n"),
    "B does not turn": ("n.B_pinv_x * exact(stay.speed) + n.B_pinv * p.shifted", "n.B_pinv * p.shifted"),
    "A_m is -omega": (
        "n.B_pinv_x * exact(stay.speed) + n.B_pinv * p.shifted",
        "n.B_pinv_x * exact(stay.speed)",
    ),
    "the wind is not taken for h": ("self.turning * X + self.stay.setting.taken", "self.turning * X"),
    "omega once less": ("omega * n.B_pinv * X", "n.B_pinv * X"),
    "no look back": ("_Sensed(*map(larger, own.all, before.all))", "own"),
    "only the look back": ("_Sensed(*map(larger, own.all, before.all))", "before"),
    "one sample back": ("_leg(both, 2 * Ts,", "_leg(both, Ts,"),
    "no saw-tooth": ("larger(steeper, arb(0)) * (Ts - kept / omega)", "arb(0)"),
    "half a saw-tooth": ("(Ts - kept / omega))", "(Ts - kept / omega) / 2)"),
    "no mean age": ("m * (at.rate + b * at.speed)", "m * at.rate"),
    "the start is no part": ("walk.top = larger(n.initial_distance, d1)", "walk.top = d1"),
    "the first sample is forgotten": ("Walk(d1, H1,", "Walk(n.initial_distance, H1,"),
    "beside is no wind": ("at.B_pinv_x * at.beside * m * at.speed", "at.B_pinv_x * m * at.speed * 0"),
}
IN_PRODUCER = {
    "the filter forgets": (stretches, "mu = at.memory + each.jump", "mu = each.jump"),
    "no jump": (stretches, "mu = at.memory + each.jump", "mu = at.memory"),
    "another settling": (stretches, "omega * each.length)", "omega)"),
    "the distance starts anew": (stretches, "d0=at.distance,", "d0=n.d0,"),
    "the end alone": (stretches, "highest = maximum(highest,", "highest = maximum(start.distance,"),
    "e is left out": (stretches, "maximum(mu, each.S) + each.e", "maximum(mu, each.S)"),
    "an estimator without memory": (distance_windows, "before.left - V)", "V - V)"),
    "rate q in wind": (distance_windows, "loop.predictor.q / 2 if", "loop.predictor.q if"),
    "left at once": (distance_windows, "left=V + excess * exp(-q * length)", "left=V + 0 * excess"),
    "no turning": (distance_windows, "n.DBpx * Y + n.DBp", "n.DBp"),
    "no wind in the estimate": (distance_windows, "turning * X + taken(n)", "turning * X"),
    "no look back": (sampled_windows, "both = own.with_before(before.sensed)", "both = own"),
    "no swing": (sampled_windows, "steeper * swing", "0 * steeper"),
    "one sample back": (sampled_windows, "look = 2 * loop.Ts", "look = loop.Ts"),
    "the last sample alone": (sampled_windows, "maximum(n.d0, course.supremum)", "course.supremum"),
    "b is left out": (sampled_windows, "turning = b * at.speed +", "turning = 0 * b +"),
}


def cases():
    """Windows that are faster and slower than the one before, with and without wind, at which every term is alive."""
    for wind, start, shares, speeds in (
        (True, 0.5, (1.0, 0.1, 0.8), (40, 3, 25)),
        (False, 0.5, (1.0, 0.1, 0.05), (40, 3, 2)),
        (False, 20.0, (0.02, 0.02), (1, 1)),
    ):
        problem = stretched.some(*shares, wind=wind, values={"h_initial": start}, A_m=None)
        speed = [F(Y) for Y in speeds]
        yield (
            problem,
            stretched.of_distance(problem, speed, predictor_gain=F(2), bandwidth=F(20), settling=F(1, 100)),
            numbers_of_distance,
        )
        yield problem, stretched.of_samples(problem, speed), numbers_of_samples
        slow = stretched.of_samples(problem, speed, bandwidth=F(3), sample_time=F(1, 8))
        yield problem, slow, numbers_of_samples


@pytest.fixture(scope="module")
def told():
    """The cases with what the producer says of them."""
    return [(problem, recipe, read(problem, recipe)) for problem, recipe, read in cases()]


def differs(told, module=legs):
    """Whether recheck is told apart from what the producer says at one of the cases."""
    for problem, recipe, theirs in told:
        try:
            compare(problem, recipe, theirs, module)
        except AssertionError:
            return True
    return False


@pytest.mark.slow
def test_without_a_bug_the_readings_agree(told):
    assert not differs(told)


@pytest.mark.slow
@pytest.mark.parametrize("bug", IN_RECHECK)
def test_a_bug_in_recheck_is_found_by_the_producer(bug, told, monkeypatch):
    before, after = IN_RECHECK[bug]
    text = inspect.getsource(legs)
    assert text.count(before) == 1, before
    module = ModuleType("planted")
    monkeypatch.setitem(sys.modules, "planted", module)
    exec(compile(text.replace(before, after), "planted", "exec"), module.__dict__)
    monkeypatch.setattr(module, "_stays", lambda *_: True)
    assert differs(told, module)


@pytest.mark.parametrize("bug", IN_PRODUCER)
def test_a_bug_in_the_producer_is_found_by_recheck(bug, monkeypatch):
    where, before, after = IN_PRODUCER[bug]
    text = inspect.getsource(where)
    assert text.count(before) == 1, before
    module = ModuleType("planted")
    monkeypatch.setitem(sys.modules, "planted", module)
    exec(compile(text.replace(before, after), "planted", "exec"), module.__dict__)
    if where is stretches:
        for own in (distance_windows, sampled_windows):
            monkeypatch.setattr(own, "through", module.through)
    else:
        monkeypatch.setattr(distance if where is distance_windows else sampled, "along", module.along)
    assert any(differs([(problem, recipe, read(problem, recipe))]) for problem, recipe, read in cases())
