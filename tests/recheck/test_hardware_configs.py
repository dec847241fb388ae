"""The shipped machines: certified, confirmed by recheck, and their claims break with the machine."""

from __future__ import annotations

from fractions import Fraction

import proven
import pytest
import rechecked
from rechecked import CONFIGS, examine, failing, respecified

from tubecert.verdict import Verdict

ORBIT = (CONFIGS / "hardware_orbit.yaml").read_text("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hardware_orbit", "hardware_three", "hardware_state_dependent_input"])
def test_a_shipped_machine_is_certified_and_confirmed(name):
    document = proven.shipped(name, bare=name != "hardware_orbit")  # which other tests need as a whole
    assert document["result"]["verdict"] == Verdict.CERTIFIED
    assert document["result"]["decided_by"] == ["hardware"]
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_a_planar_quadrotor_is_certified_and_confirmed():
    """Six states, two inputs with limits, wind; half the corridor at four times the rate, with rough constants."""
    text = (CONFIGS / "hardware_pvtol.yaml").read_text("utf-8")
    text = text.replace("{px: 0.4}", "{px: 0.2}").replace("rate: 250", "rate: 1000")
    document = proven.proven(text, gap=Fraction(1, 5), conditions="hardware")
    result = document["result"]
    assert result["verdict"] == Verdict.CERTIFIED
    assert result["hardware"]["half_widths"]["px"] < 0.2
    assert [own["verdict"] for own in result["inputs"]] == ["certified", "certified"]
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
    assert rechecked.unconfirmed(
        respecified(proven.shipped("hardware_state_dependent_input", bare=True), change)
    )
