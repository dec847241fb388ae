"""An uncertain gain in simulation: the feedback makes up for it, other loops are refused."""

from __future__ import annotations

from fractions import Fraction

import proven
import pytest
from systems import SMALL

from tubecert.errors import TubecertError
from tubecert.simulate.setting import setting_of
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.spec import load_text

TEXT = (
    SMALL.replace("  f: [", "  parameters: {m: [0.96, 1.04]}\n  f: [")
    .replace("[1]]", '["1/m"]]', 1)
    .replace(
        "{kind: equilibrium, at: [0, 0], input: [0]}",
        '{kind: expressions, x: ["0", "0"], u: ["0.05*sin(t)"], horizon: 6}',
    )
    + "hardware: {rate: 1000, feedforward: held}\n"
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def setting():
    spec = load_text(TEXT, "s.yaml")
    return setting_of(spec, proven.result(TEXT, bare=True, conditions="hardware"), Fraction(1, 5))


def test_the_feedback_is_raised_by_what_the_gain_may_lack(setting):
    loop = loop_of(setting, "hardware", Choice())
    error = setting.certified["gain_error"]
    assert loop.problem.machine.raised == pytest.approx(1 / (1 - error))
    assert loop.promise.bounds["k"] >= setting.certified["feedback_gain"] * loop.promise.bounds[
        "distance"
    ] / (1 - error)


def test_a_loop_that_takes_B_as_known_is_refused(setting):
    with pytest.raises(TubecertError, match="stated for a known B"):
        loop_of(setting, "l1", Choice())
