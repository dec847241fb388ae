"""How far a command is: a line every ten seconds in a log, a bar on a terminal, the time that is left."""

import io
import re
from dataclasses import replace

import pytest
from texts import CONFIGS

from tubecert.kinds import NAMES
from tubecert.pipeline.listening import Claims, claims_of
from tubecert.progress import Phase, Step, Unit
from tubecert.report.progress import Log, Pieces, Timed, shown
from tubecert.report.terminal import Terminal
from tubecert.spec import load
from tubecert.words.progress import described


class Clock:
    """A time that passes when it is told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def pipe(width=100):
    return Terminal(stream=io.StringIO(), colored=False, width=width, interactive=False)


def lines(steps, width=100):
    """What a log holds after steps at these times."""
    terminal, clock = pipe(width), Clock()
    log = Log(terminal, clock)
    for at, step in steps:
        clock.now = 100.0 + at
        log.hear(step) if step is not None else log.beat()
    return terminal.stream.getvalue().splitlines()


def points(done):
    return Step(phase=Phase.SWEEP, done=done, of=60)


def test_a_log_has_a_line_every_ten_seconds_and_the_time_left():
    steps = [(0.0, points(20)), *((float(i), points(20 + i)) for i in range(1, 41))]
    assert lines(steps) == [
        "30 of 60 points done; 10 s so far, about 30 s left; certifying points",
        "40 of 60 points done; 20 s so far, about 20 s left; certifying points",
        "50 of 60 points done; 30 s so far, about 10 s left; certifying points",
        "60 of 60 points done; 40 s so far; certifying points",
    ]


def test_one_piece_that_is_hard_does_not_make_all_others_hard():
    """20 pieces in 20 s, and one that takes a minute: the 19 after it take 19 s, and it is not known when it ends."""
    slow = [(20.0 + i, points(40)) for i in range(61)]
    found = lines([*((float(i), points(20 + i)) for i in range(21)), *slow])
    assert found[1] == "40 of 60 points done; 20 s so far, about 20 s left; certifying points"
    assert found[2] == "40 of 60 points done; 30 s so far, at least 19 s left; certifying points"
    assert found[7] == "40 of 60 points done; 80 s so far, at least 19 s left; certifying points"
    last = lines([(0.0, points(58)), (1.0, points(59)), *((10.0 + i, points(59)) for i in range(10))])
    assert last[0] == "59 of 60 points done; 10 s so far; certifying points"


def test_a_run_that_ends_earlier_leaves_nothing_in_a_log():
    assert lines([(i / 2, points(20 + i)) for i in range(20)]) == []
    clock = Clock()
    terminal = pipe()
    with shown(terminal, wanted=True, clock=clock) as report:
        report(points(1))
    assert terminal.stream.getvalue() == ""


def test_a_log_goes_on_where_nothing_is_told():
    """One search may take minutes: the time that has passed is told, of what was told last."""
    steps = [(1.0, points(20)), (9.0, points(22)), (10.0, None), (15.0, None), (20.5, None), (30.0, None)]
    assert lines(steps) == [
        "22 of 60 points done; 10 s so far, about 3 min left; certifying points",
        "22 of 60 points done; 21 s so far, about 2 min left; certifying points",
    ]
    assert lines([(12.0, None)]) == []  # nothing is known yet


def test_an_estimate_that_was_wrong_is_not_repeated():
    found = lines([(0.0, points(57)), (5.0, points(58)), (10.0, None), (20.0, None)])
    assert found == [
        "58 of 60 points done; 10 s so far, about 5 s left; certifying points",
        "58 of 60 points done; 20 s so far; certifying points",
    ]


def test_a_line_is_no_longer_than_the_terminal():
    long = Step(phase=Phase.RECHECK, name="a claim with many words " * 9, done=3, of=7)
    for width in (40, 72, 100):
        (line,) = lines([(11.0, long)], width)
        assert len(line) == width
        assert line.startswith("3 of 7 claims done")
        assert line.endswith("...")


def test_what_a_name_holds_steers_no_terminal():
    (line,) = lines([(11.0, Step(phase=Phase.CHECK, name="\x1b[2Jx\n::error::", done=1, of=2))])
    assert "\x1b" not in line


def test_nothing_is_told_where_nothing_is_wanted():
    with shown(pipe(), wanted=False) as report:
        assert report is None
    with shown(replace(pipe(), interactive=True), wanted=False) as report:
        assert report is None


@pytest.mark.parametrize("width", [40, 100])
def test_on_a_terminal_it_goes_away_when_it_is_done(width):
    terminal = replace(pipe(width), interactive=True)
    with shown(terminal, wanted=True) as report:
        report(Step(phase=Phase.RECHECK, name="a claim of many words " * 9, done=3, of=7))
    text = terminal.stream.getvalue()
    assert text.endswith("\x1b[2K")  # the line is cleared
    for line in re.split(r"[\r\n]", re.sub(r"\x1b\[[^a-zA-Z]*[a-zA-Z]", "", text)):
        assert len(line) <= width


def told(times_and_steps):
    clock, found = Clock(), []
    times = Timed(found.append, clock)
    for at, step in times_and_steps:
        clock.now = 100.0 + at
        times(step)
    return found


def test_what_is_left_is_estimated_for_the_phase_from_what_was_done_in_it():
    runs = [Step(phase=Phase.SIMULATION, done=done, of=100) for done in (0, 25, 100)]
    found = told([(0, points(0)), (30, points(30)), (40, runs[0]), (50, runs[1]), (90, runs[2])])
    assert [step.seconds for step in found] == [0, 30, 40, 50, 90]
    assert [step.left for step in found] == [None, 30.0, None, 30.0, None]


def test_nothing_is_promised_of_gains():
    steps = [(i, Step(phase=Phase.CERTIFICATION, done=i, of=9)) for i in range(3)]
    found = told([*steps, (4, Step(phase=Phase.GAINS, name="distance", done=3, of=9))])
    assert [step.left for step in found] == [None, 8.0, 7.0, None]


def test_what_has_no_end_has_no_time_left():
    steps = [(i, Step(phase=Phase.SYNTHESIS, done=i)) for i in range(3)]
    assert [step.left for step in told(steps)] == [None, None, None]


def test_claims_are_counted_in_their_order():
    found = []
    claims = Claims(found.append, ("metric", "plan", "f", "B"))
    for name in ("metric", "f", "something", "metric"):
        claims(Step(phase=Phase.CERTIFICATION, name=name, count=5))
    claims(Step(phase=Phase.PLAN, name="defect"))
    claims(Step(phase=Phase.CERTIFICATION, name="B"))
    assert [step.done for step in found] == [0, 2, 2, 2, 2, 3]
    assert {step.of for step in found} == {4}
    assert found[0].count == 5


def test_the_claims_of_a_specification_are_those_of_its_states_and_its_machine():
    spec = load(CONFIGS / "two_state.yaml")
    names = claims_of(spec)
    assert names[:2] == ("metric", "plan")
    assert {"half width of x1", "half width of x2"} <= {*names}
    assert "noise_size" not in names
    assert names[-len(NAMES) :] == tuple(name.key for name in NAMES)
    assert len(names) == len({*names})


def test_pieces_count_with_what_is_done_in_them():
    found = []
    pieces = Pieces(found.append, Phase.CHECK, 3)
    pieces(Step(phase=Phase.CERTIFICATION, name="f", done=7, of=9))
    pieces.ready(0, None)
    assert [(step.phase, step.name, step.done, step.of) for step in found] == [
        (Phase.CHECK, "f", 0, 3),
        (Phase.CHECK, "", 1, 3),
    ]


def test_in_words():
    step = Step(phase=Phase.CERTIFICATION, name="feedback_gain", count=12000, below=0.5, above=0.75)
    assert described(step) == "proving |feedback| per Riemannian distance, 12,000 boxes"
    step = replace(step, done=17, of=33, seconds=4.2, left=3.9)
    assert described(step).startswith("17 of 33 claims done; 5 s so far, about 4 s left; proving |feedback|")
    assert described(Step(phase=Phase.GAINS, name="distance", done=30, of=33)) == (
        "30 of 33 claims done; gains of certificate B"
    )
    step = Step(phase=Phase.SYNTHESIS, name="rate 2, degree 0", count=3, unit=Unit.STEPS)
    assert described(step) == "looking for a metric: rate 2, degree 0, 3 steps"


def test_what_was_found_has_no_value_of_another_quantity(monkeypatch):
    """Of M's least eigenvalue, which is found as the largest of W, that was told; and each of them in every round."""
    from tubecert.cli import telling

    lines = []
    monkeypatch.setattr(telling, "found", lines.append)
    told = telling.Told(None, None, None)
    for name in ("lower", "upper", "lower", "upper", "h"):
        told(Step(phase=Phase.CERTIFICATION, name=name, count=1, below=1214.0, above=1214.1))
    assert lines == [
        "smallest eigenvalue of the metric M, 1 box",
        "largest eigenvalue of the metric M, 1 box",
    ]


@pytest.mark.parametrize("phase", Phase)
def test_every_phase_has_words(phase):
    assert described(Step(phase=phase))


def test_how_much_of_a_long_claim_is_proven_is_said():
    step = Step(phase=Phase.RECHECK, name="f_x <= 3", count=1280, share=0.382, done=3, of=7)
    assert described(step).endswith("examining: f_x <= 3, 1,280 boxes, 38 % of this part proven")
