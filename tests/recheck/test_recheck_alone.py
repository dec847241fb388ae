"""Certificate 0 is examined: what it prints is proven again, and each planted fault is refused."""

import copy

import pytest
from rechecked import certified, examine, failing, unconfirmed
from texts import CONFIGS

CALM = (
    (CONFIGS / "two_state_orbit.yaml")
    .read_text("utf-8")
    .replace("-2*sin(2*t) - 0.1*norm(x1, x2)", "0.2*sin(2*t)")
)


@pytest.fixture(scope="module")
def calm():
    """A class so small that the feedback alone holds the tube."""
    return certified(CALM, conditions="none")


@pytest.mark.slow
def test_the_feedback_alone_is_certified_and_confirmed(calm):
    section = calm["result"]["no_adaptation"]
    assert (calm["result"]["verdict"], section["verdict"]) == ("certified", "certified")
    assert calm["result"]["decided_by"] == ["no_adaptation"]
    assert calm["result"]["proof"]["no_adaptation"] == {}
    assert not failing(examine(calm))
    h = calm["result"]["constants"]["h"]
    assert section["uncertainty_limit"] > h["above"]


@pytest.mark.slow
def test_what_it_prints_is_examined_where_another_kind_decides(calm):
    other = certified(CALM, conditions="B")
    assert not failing(examine(other))
    assert "no_adaptation.verdict" not in examine(other).unread
    forged = copy.deepcopy(other)
    forged["result"]["no_adaptation"]["uncertainty_limit"] *= 1.01
    assert unconfirmed(forged)
    refuted = copy.deepcopy(other)
    refuted["result"]["no_adaptation"]["verdict"] = "refuted"
    assert unconfirmed(refuted), "what is not certified has no recipe"
    del refuted["result"]["proof"]["no_adaptation"]
    assert "no_adaptation.verdict" in examine(refuted).unread, "it is not examined, and that is said"
