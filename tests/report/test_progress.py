"""How far a sweep is: a line every ten seconds in a log."""

from __future__ import annotations

import io

from tubecert.report.progress import counted
from tubecert.report.terminal import Terminal


def lines(steps):
    """What a log holds after points that were finished at these times."""
    stream, now = io.StringIO(), [0.0]
    terminal = Terminal(stream=stream, colored=False, width=100, interactive=False)
    with counted(terminal, wanted=True, clock=lambda: now[0]) as report:
        assert report is not None
        for at, done, fresh in steps:
            now[0] = at
            report(done, 60, fresh)
    return stream.getvalue().splitlines()


def test_a_log_has_a_line_every_ten_seconds_and_the_time_left():
    steps = [(0.0, 20, False), *((float(i), 20 + i, True) for i in range(1, 41))]
    assert lines(steps) == [
        "20 of 60 points",
        "30 of 60 points, about 30 s left",
        "40 of 60 points, about 20 s left",
        "50 of 60 points, about 10 s left",
        "60 of 60 points",
    ]


def test_long_times_are_told_in_minutes_and_hours():
    assert lines([(120.0, 1, True)]) == ["1 of 60 points, about 2.0 h left"]
    assert lines([(60.0, 1, True)]) == ["1 of 60 points, about 59 min left"]


def test_nothing_is_told_where_nothing_is_wanted():
    terminal = Terminal(stream=io.StringIO(), colored=False, width=100, interactive=False)
    with counted(terminal, wanted=False) as report:
        assert report is None
