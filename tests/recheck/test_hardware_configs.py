"""The shipped machines: certified, confirmed by recheck, and their claims break with the machine."""

from __future__ import annotations

import proven
import pytest
import rechecked
from rechecked import CONFIGS, examine, failing, respecified

from tubecert.verdict import Verdict

ORBIT = (CONFIGS / "hardware_orbit.yaml").read_text("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hardware_orbit", "hardware_three", "hardware_state_dependent_input"])
def test_a_shipped_machine_is_certified_and_confirmed(name):
    document = proven.shipped(name)
    assert document["result"]["verdict"] == Verdict.CERTIFIED
    assert document["result"]["decided_by"] == ["hardware"]
    assert failing(examine(document)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda e: e["hardware"].update(sample_time="1/100"),
        lambda e: e["hardware"].update(delay="1/1000"),
        lambda e: e["hardware"].update(noise="1/100"),
        lambda e: e["hardware"].update(feedforward="held"),
        lambda e: e["disturbance"].update(bound="1/2"),
        lambda e: e["disturbance"].update(E=[["1"], ["1"]]),
        lambda e: e.pop("disturbance"),
        lambda e: e.pop("hardware"),
        lambda e: e["limits"].update(u=["-3", "3"]),
    ],
)
def test_the_certificate_is_of_no_other_machine(change):
    document = proven.proven(ORBIT)
    assert rechecked.unconfirmed(respecified(document, change))


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda e: e["hardware"]["geodesic"].update(nodes="2"),
        lambda e: e["hardware"]["geodesic"].update(sweeps="1"),
        lambda e: e["hardware"].pop("geodesic"),
    ],
)
def test_the_certificate_is_of_no_other_geodesics(change):
    assert rechecked.unconfirmed(respecified(proven.shipped("hardware_state_dependent_input"), change))
