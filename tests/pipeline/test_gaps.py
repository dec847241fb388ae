"""Gaps by effect: gains as with close constants, enclosures that hold, and certificates that say what was done."""

from fractions import Fraction

import pytest
from proven import proven
from rechecked import certified, examine, sealed
from systems import SMALL
from texts import CONFIGS

from tubecert.pipeline import Memory, Options, question_of
from tubecert.pipeline.certification import plan, tube
from tubecert.pipeline.gaps import _sizes, enclosed
from tubecert.spec import load
from tubecert.stages.bounded import enclose
from tubecert.stages.metric import prove_metric

MEMORY = Memory()
CLOSE = Fraction(1, 1000)


def tube_of(name: str, kind: str, **options):
    spec = load(str(CONFIGS / f"{name}.yaml"))
    return tube(plan(prove_metric(question_of(spec, Options(conditions=kind, **options), memory=MEMORY))))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), [("three_state", "A"), ("state_dependent_input", "B")])
def test_gains_are_those_of_close_constants(name, kind):
    by_effect = enclosed(tube_of(name, kind, by_effect=True))
    close = enclose(tube_of(name, kind, gap=CLOSE))
    for own, least in zip(*(_sizes(each.problem, each.question) for each in (by_effect, close)), strict=True):
        assert own <= 1.01 * least
    assert len(by_effect.gaps) > len([gap for gap in by_effect.gaps.values() if gap < Fraction(1, 5)]) > 0
    for constant, found, _ in by_effect.constants.items():
        other = getattr(close.constants, constant)
        assert found.below <= other.above
        assert other.below <= found.above


@pytest.mark.slow
def test_the_certificate_says_how_closely_and_is_confirmed():
    text = SMALL.replace("tube: {", "tube: {gap: auto, ")
    assert text != SMALL
    document = certified(text, conditions="B")
    gaps = document["notes"]["effort"]["gaps"]
    assert set(gaps) <= set(document["result"]["constants"])
    assert gaps["f"] == 0.2
    assert gaps["h"] <= 0.2
    assert document["result"]["spec"]["effective"]["tube"]["gap"] == "auto"
    assert examine(document).verdict == "confirmed"
    document["result"]["constants"]["f_x"]["above"] *= 0.7
    assert examine(sealed(document)).verdict != "confirmed"


@pytest.mark.slow
def test_a_given_gap_wins_over_the_key_and_nothing_else_changes():
    text = SMALL.replace("tube: {", "tube: {gap: auto, ")
    own, plain = (proven(each, conditions="B", by_effect=by) for each, by in ((text, False), (SMALL, None)))
    assert own["result"]["constants"] == plain["result"]["constants"]
    assert "gaps" not in own["notes"]["effort"]


@pytest.mark.parametrize(
    ("file", "wanted", "options"),
    [
        ("tubecert/templates/csv.yaml", True, {}),
        ("tubecert/templates/csv.yaml", False, {"by_effect": False}),
        ("tubecert/templates/regulation.yaml", False, {}),
        ("tubecert/templates/car.yaml", False, {}),
        ("tubecert/templates/crane.yaml", True, {}),
        ("configs/quadrotor3d.yaml", False, {}),
        ("configs/two_state_orbit.yaml", False, {}),
    ],
)
def test_half_widths_along_a_plan_that_moves_or_of_many_states_ask_for_it_by_themselves(
    file, wanted, options
):
    assert question_of(load(str(CONFIGS.parent / file)), Options(**options)).by_effect is wanted
