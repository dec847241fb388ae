"""The narrowest tube: every attempt is a certification, the best one is no worse than those on a grid beside it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from io import StringIO

import pytest
from rechecked import certified, examine, failing
from rich.console import Console
from systems import IN_WINDOWS, SCALAR, SMALL
from tubecert.pipeline.design import narrowest, needed_of
from tubecert.pipeline.trade import cheapest, front
from tubecert.report.design import as_data, report
from tubecert.spec.windows import more_windows

from tubecert.certificate.result import Result
from tubecert.claims.advice import EaseHardware, LessenCause, TakeWindows
from tubecert.digits import exact
from tubecert.pipeline import Deadline, Options, certify, design
from tubecert.pipeline.width import Measure, size_of
from tubecert.spec import load_text
from tubecert.verdict import Verdict
from tubecert.words.advice import advice

RADIUS = Measure(units={})
H = Options(conditions="hardware")  # where nothing rests on the other kinds


def scaled(text=SCALAR):
    spec = load_text(text)

    def at(scale):
        tube = replace(spec.tube, epsilon=spec.tube.epsilon * scale, rho_a=spec.tube.rho_a * scale)
        return replace(spec, tube=tube)

    return at


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_the_best_is_certified_and_no_size_beside_it_is_better():
    at = scaled()
    found = narrowest(at, H, RADIUS)
    best = found.best
    assert best is not None
    again = certify(at(best.scale), H)
    assert again.verdict is Verdict.CERTIFIED
    assert size_of(again, RADIUS) == best.size
    for factor in (Fraction(1, 3), Fraction(4, 5), Fraction(5, 4)):
        size = size_of(certify(at(factor * best.scale), H), RADIUS)
        assert size is None or size >= best.size * 0.995
    needed = needed_of(best.result)
    assert needed is not None
    assert needed > Fraction(99, 100), "it is narrowed to what it needs"


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_deadline_leaves_the_best_that_was_tried_by_then_and_the_report_says_so():
    """There was none: a design came to its own end, or to none."""
    found = narrowest(scaled(), H, RADIUS, deadline=Deadline.after(0))
    assert [each.scale for each in found.attempts] == [1], "the tube that is asked for is certified always"
    assert found.best is not None
    assert "cut short by the deadline: this is the best of what was proven by then" in words_of(found)
    assert as_data(found).cut == "deadline"


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_an_interruption_leaves_the_best_that_was_tried_by_then(monkeypatch):
    tried = []

    def attempt(*arguments, **asked):
        if asked.get("brief"):
            tried.append(arguments[0].tube.epsilon)
        if len(tried) > 2:
            tried.clear()
            raise KeyboardInterrupt
        return certify(*arguments, **asked)

    monkeypatch.setattr(design, "certify", attempt)
    found = narrowest(scaled(), H, RADIUS)
    assert [each.scale for each in found.attempts] == [1, Fraction(1, 2)]
    assert (found.cut, found.best is not None) == ("interrupted", True)
    assert "interrupted: this is the best of what was proven by then" in words_of(found)


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_what_a_tube_asks_of_a_machine_is_cut_short_after_its_first_certification():
    text = SCALAR.replace("rate: 200", "sample_time: largest")
    offers = cheapest(lambda part: load_text(text), ["sample_time", "delay"], H, deadline=Deadline.after(0))
    assert [each.part for each in offers.offers] == ["sample_time"]
    assert offers.cut == "deadline"
    points = front(scaled(text), "sample_time", RADIUS, H, deadline=Deadline.after(0))
    assert ([each.scale for each in points.points], points.cut) == ([1], "deadline")


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_machine_that_keeps_no_tube_has_no_design():
    found = narrowest(scaled(SCALAR.replace("rate: 200", "rate: 1/10")), H, RADIUS)
    assert found.best is None
    assert all(each.result.verdict is not Verdict.CERTIFIED for each in found.attempts)


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_between_a_tube_that_is_too_narrow_and_one_that_is_too_wide_sizes_are_tried():
    """At .06 the loop has no room, .12 leaves the safe set: what was between used to go unseen."""
    text = SCALAR.replace("epsilon: 0.5, rho_a: 0.5", "epsilon: 0.03, rho_a: 0.03").replace(
        "[-2, 2]", "[-0.11, 0.11]"
    )
    found = narrowest(scaled(text), H, RADIUS)
    assert all(each.size is None for each in found.attempts if each.scale in (Fraction(1, 2), 1, 2))
    assert found.best is not None
    assert 1 < found.best.scale < 2
    assert found.best.size == size_of(certify(scaled(text)(found.best.scale), H), RADIUS)


@pytest.mark.slow
def test_attempts_are_brief_and_the_one_that_is_shown_is_what_certify_gives(monkeypatch):
    monkeypatch.setattr(design, "_FARTHEST", 0)
    monkeypatch.setattr(design, "_NARROWINGS", 0)
    brief = []

    def attempt(*arguments, **asked):
        result = certify(*arguments, **asked)
        if asked.get("brief"):
            brief.append(result)
        return result

    monkeypatch.setattr(design, "certify", attempt)
    (best,) = narrowest(scaled(), Options(), RADIUS).attempts
    assert "has no `hardware`" not in words_of(design.Design(attempts=(best,)))
    assert best.result.to_json() == certify(scaled()(Fraction(1)), Options()).to_json()
    (first,) = brief
    assert (first.verdict, size_of(first, RADIUS)) == (best.result.verdict, best.size)
    assert first.sections["hardware"].curve == ()
    assert best.result.sections["hardware"].curve != ()


@pytest.mark.slow
def test_where_none_serves_the_nearest_is_told_with_what_would_help(monkeypatch):
    for name, value in (("_FARTHEST", 1), ("_HALVINGS", 0)):
        monkeypatch.setattr(design, name, value)
    found = narrowest(scaled(SCALAR.replace("rate: 200", "rate: 1")), Options(), RADIUS)
    assert found.best is None
    lacking = [each.lacks for each in found.attempts]
    assert min(lacking) == found.shown.lacks < max(lacking)
    assert any(isinstance(each, EaseHardware) for each in found.shown.result.reason.relax)
    told = [str(line) for part in report(None, found, None) for line in [getattr(part, "plain", part)]]
    assert "Not certified" in " ".join(told)


def words_of(found):
    console = Console(width=200, file=StringIO())
    console.print(*report(None, found, None))
    return console.file.getvalue()


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_without_a_machine_the_gains_of_every_size_are_told(monkeypatch):
    """It used to end at a Gamma of 1e12 without a word."""
    monkeypatch.setattr(design, "_FARTHEST", 0)
    monkeypatch.setattr(design, "_NARROWINGS", 0)
    found = narrowest(scaled(SMALL), Options(conditions="B"), RADIUS)
    told = words_of(found)
    assert "hardware: {rate: 500" in told
    assert "\nMachine\n" not in told
    best = found.best.result.sections["distance"].pairs(asked=False)[0]
    assert f"Gamma = {exact(best.adaptation_rate)}" in told.split("Attempts")[1]


@pytest.mark.slow
def test_a_loop_that_does_not_serve_says_what_fills_it_and_which_machine_would():
    """It used to be silent: a loop that comes near was taken for one that serves, and better ones were told of it."""
    text = SCALAR.replace("rate: 200", "rate: 2")
    found = certify(load_text(text), Options())
    assert found.verdict is Verdict.UNDECIDED
    assert found.reason.claim.condition == "hardware", "the level that there may be does fit"
    advice = found.reason.relax
    shares = {each.cause: each.share for each in advice if isinstance(each, LessenCause)}
    assert sum(shares.values()) == pytest.approx(1 - found.reason.claim.margin.below, rel=0.02)
    assert list(shares.values()) == sorted(shares.values(), reverse=True)
    (easier,) = (each for each in advice if isinstance(each, EaseHardware))
    serving = text.replace("rate: 2,", f"sample_time: {easier.value},")
    assert certify(load_text(serving), Options()).verdict is Verdict.CERTIFIED
    assert failing(examine(certified(text, conditions="H"))) == []


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_plan_that_moves_may_be_proven_in_windows_and_that_is_said():
    text = IN_WINDOWS.replace(", windows: [0.3, 0.9]", "").replace("rate: 500", "rate: 8")
    document = certified(text, conditions="H", gap=Fraction(1, 5))
    found = Result.from_json(document["result"])
    assert found.verdict is Verdict.UNDECIDED
    (offer,) = (each for each in found.reason.relax if isinstance(each, TakeWindows))
    assert offer.windows == 7  # of 2 s, two samples of 125 ms and the delay each
    assert "tube.windows: 7 may do" in advice(found.reason.relax)
    assert failing(examine(document)) == []


@pytest.mark.parametrize(
    ("change", "windows"),
    [
        (lambda text: text, 20),
        (lambda text: text.replace("rho_a: 0.1}", "rho_a: 0.1, windows: 7}"), 20),
        (lambda text: text.replace("rho_a: 0.1}", "rho_a: 0.1, windows: 30}"), 60),
        (lambda text: text.replace("rate: 500", "rate: 25"), 20 + 4),
        (lambda text: text.replace("rate: 500", "rate: 1"), None),
        (lambda text: text.replace("rate: 500", "sample_time: largest"), None),
        (lambda text: text.replace("bound: 0.01", "bound: largest"), None),
        (lambda text: SCALAR, None),
    ],
)
def test_how_many_windows_might_do(change, windows):
    text = change(IN_WINDOWS.replace(", windows: [0.3, 0.9]", ""))
    if windows == 24:  # as many as there is room for, once there are 20 or more
        text = text.replace("rho_a: 0.1}", "rho_a: 0.1, windows: 20}")
    assert more_windows(load_text(text)) == windows


@pytest.mark.slow
def test_the_largest_sample_time_is_proven_and_a_much_larger_one_is_not():
    found = certify(load_text(SCALAR.replace("rate: 200", "sample_time: largest")), Options())
    assert found.verdict is Verdict.CERTIFIED
    section = found.sections["hardware"]
    longer = SCALAR.replace("rate: 200", f"sample_time: {float(section.sample_time) * 1.05}")
    assert certify(load_text(longer), Options()).verdict is Verdict.UNDECIDED
