"""Theorem HW of recheck against that of the producer: two readings of one text, at random machines and windows."""

from __future__ import annotations

import inspect
import sys
from dataclasses import fields, replace
from fractions import Fraction
from itertools import pairwise
from types import ModuleType

import pytest
from flint import ctx
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants
from test_hardware_formulas import BENT, own_reading, problems, same
from tubecert.conditions.hardware.loop import WindowProof
from tubecert.conditions.machine import Window as Known

from tubecert.conditions.hardware import windows as producer
from tubecert.enclosure.constant import Constant
from tubecert.recheck import along as own
from tubecert.recheck.balls import exact

KEPT = ("h_initial", "initial_distance")  # those of the start are of the whole tube


@st.composite
def courses(draw):
    """A problem cut into windows, each with constants and numbers of its own, and a recipe for it."""
    problem, recipe = draw(problems())
    pad = producer.pad(recipe)
    count = draw(st.integers(1, 4))
    lengths = [pad * draw(st.sampled_from([Fraction(1), Fraction(3, 2), Fraction(40)])) for _ in range(count)]
    ends = [sum(lengths[:k], start=Fraction(0)) for k in range(count + 1)]
    scales = st.sampled_from([0.3, 0.7, 1.0])

    def less(constants, names=None):
        """Some of the constants, scaled."""
        share = draw(scales)
        chosen = {
            item.name: Constant(below=value.below * share, above=value.above * share)
            for item in fields(constants)
            if (value := getattr(constants, item.name)) is not None
            and isinstance(value, Constant)
            and item.name not in KEPT
            and (names is None or item.name in names)
        }
        return replace(constants, **chosen)

    machine, windows, proofs = problem.machine, [], []
    for begin, end in pairwise(ends):
        windows.append(
            Known(
                begin=begin,
                end=end,
                since=max(Fraction(0), begin - pad),
                radius=problem.rho * draw(st.sampled_from([Fraction(1), Fraction(1, 2)])),
                constants=replace(less(problem.constants), lower=problem.constants.lower),
                machine=less(machine.constants),
                covariant=None if machine.covariant is None else less(machine.covariant, BENT),
                wind=less(problem.wind.constants),
                residual=None,
                inputs={},
            )
        )
        level = recipe.level * draw(st.sampled_from([Fraction(1, 2), Fraction(1)]))
        proofs.append(
            WindowProof(
                level=level,
                floor=level / draw(st.integers(2, 300)),
                speed=recipe.speed * draw(st.sampled_from([Fraction(1, 3), Fraction(1)])),
                bias=recipe.bias * draw(st.sampled_from([Fraction(1, 3), Fraction(1)])),
                ripple=recipe.ripple * draw(st.sampled_from([Fraction(1, 3), Fraction(1)])),
                prediction=None if recipe.prediction is None else recipe.prediction * draw(st.integers(1, 2)),
            )
        )
    # an uncertain gain beside windows is refused before any theorem is asked
    asked = replace(machine.asked, arithmetic="double" if recipe.rounding else None)
    machine = replace(machine, asked=asked, windows=tuple(windows))
    problem = replace(problem, gain=None, horizon=ends[-1], machine=machine)
    return problem, replace(recipe, windows=tuple(proofs))


def read(problem, recipe, module=own) -> tuple[list[own.Window], object]:
    """The windows as recheck reads them."""
    found = []
    for window, proof in zip(problem.machine.windows, recipe.windows, strict=True):
        setting, machine, promise, whole = own_reading(producer.over(problem, window), recipe)
        at = replace(whole, **{item.name: getattr(proof, item.name) for item in fields(proof)})
        found.append(module.Window(setting=setting, machine=machine, at=at, length=window.end - window.begin))
    return found, promise


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(courses())
def test_both_readings_of_theorem_hw_agree(case):
    problem, recipe = case
    assume(recipe.delay <= recipe.sample_time)  # of what is no loop of the theorem nothing is asked
    for window, proof in zip(problem.machine.windows, recipe.windows, strict=True):
        if proof.prediction is not None:  # a predicted state is off by no less than a measured one
            noise = float(recipe.noise) * window.machine.noise_metric.above
            assume(float(proof.prediction) * window.constants.upper.above**0.5 >= noise)
    compare(problem, recipe)


def compare(problem, recipe, module=own) -> None:
    """Every number of both readings."""
    theirs = producer.course_of(problem, recipe)
    with ctx.workprec(160):
        windows, promise = read(problem, recipe, module)
        for stage, x in zip(module.stages(windows, promise), theirs, strict=True):
            needed, e = stage.needed(), x.at.estimate
            for value, other in zip(needed, (e.speed, e.bias, e.ripple), strict=False):
                same(value, other)
            if e.prediction is not None:
                same(needed[3], e.prediction)
            if not x.at.loss.chi.lo > 0:
                return
            same(stage.left.error, e.X)
            same(stage.left.feedback, e.kb)
            same(stage.left.feedforward, e.ups)
            same(stage.left.top, x.supremum)
            same(stage.at_end(), x.end)
            same(stage.left.ultimate, x.at.course.bound.ultimate())


@pytest.mark.slow
@settings(deadline=None, max_examples=3)
@given(courses())
def test_an_uncertain_gain_beside_windows_is_refused_by_the_windows_themselves(case):
    windows, promise = read(*case)
    Delta = exact(Fraction(1, 10))
    uncertain = [replace(each, setting=replace(each.setting, gain=Delta)) for each in windows]
    assert own.along(uncertain, promise) is None
    with pytest.raises(ValueError, match="a B that is known"):
        own.stages(uncertain, promise)


PLANTED = {
    "the level of the window alone": ("level=max(at.level, before.own_level)", "level=at.level"),
    "the level of the window before alone": ("max(at.level, before.own_level)", "before.own_level"),
    "the first error for ever": ("h_initial=before.remembered()", "h_initial=before.n.h_initial"),
    "no error at first": ("h_initial=before.remembered()", "h_initial=arb(0)"),
    "what acts in the window alone": ("map(larger, self.own, before.own)", "self.own"),
    "what acted before alone": ("map(larger, self.own, before.own)", "before.own"),
    "the pad forgotten in the filter": ("exact(self.length - pad(self.at))", "exact(self.length)"),
    "two pads in the filter": ("self.length - pad(self.at)", "self.length - 2 * pad(self.at)"),
    "the filter forgets its bias": (
        "return self.S + larger(self.n.h_initial",
        "return larger(self.n.h_initial",
    ),
    "noise of the window alone": ("now if self.before is None else", "now if True else"),
    "half of the noise": ("2 * self.th / self.Ts", "self.th / self.Ts"),
    "noise that B does not turn": ("found = direct + turning", "found = direct"),
    "noise that drifts twice": ("smaller(found, drifting)", "found"),
    "no rise where teeth grow": ("start = start + larger", "start = start + 0 * larger"),
    "a rise where teeth shrink": ("larger(now - then, arb(0))", "(now - then)"),
    "the rise of other teeth": ("zip((self.Ts, self.Tf), steep", "zip((self.Tf, self.Ts), steep"),
    "a rise in the wrong unit": ("self.tooth(T) / self.lam *", "self.tooth(T) *"),
    "no floor": ("start = larger(start, self.floor)", "pass"),
    "the first phase twice": ("whole - self.first_phase if", "whole if"),
    "the first phase always": ("if self.before is None else whole", "if True else whole"),
    "a peak without the end": ("larger(bound.d0, _filtered(bound", "(bound.d0 + 0 * _filtered(bound"),
    "no filter, and yet": ("replace(bound, H0=bound.S)", "bound"),
    "the horizon of the whole": ("horizon=window.length", "horizon=window.setting.system.horizon"),
}


def cases():
    """Windows of which every term is alive, with a filter, without one and on two clocks."""
    found = []

    # enough of them for every bug
    @settings(database=None, derandomize=True, max_examples=400, phases=[Phase.generate], deadline=None)
    @given(courses())
    def gathered(case):
        if len(case[1].windows) > 1:
            found.append(case)

    with pytest.MonkeyPatch.context() as patch:  # the same ones whatever other tests have loaded
        patch.setattr(providers, "_get_local_constants", Constants)
        gathered()
    return found


@pytest.fixture(scope="module")
def alive():
    return cases()


@pytest.mark.slow
@pytest.mark.parametrize("bug", PLANTED)
def test_a_planted_bug_is_found_by_the_other_reading(bug, alive, monkeypatch):
    before, after = PLANTED[bug]
    text = inspect.getsource(own)
    assert text.count(before) == 1, before
    module = ModuleType("planted")
    monkeypatch.setitem(sys.modules, "planted", module)
    exec(compile(text.replace(before, after), "planted", "exec"), module.__dict__)
    for problem, recipe in alive:
        try:
            compare(problem, recipe, module)
        except AssertionError:
            return
    pytest.fail("both readings agree")
