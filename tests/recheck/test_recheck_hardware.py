"""A section `hardware` in recheck: it is read to the last key, no claim rests on it, and the certificate says so."""

import copy

import pytest
from rechecked import certified, examine, failing, respecified, sealed, unconfirmed
from systems import SMALL

from tubecert.errors import TubecertError

MACHINE = "hardware: {rate: 500, delay: 0.0005, noise: {x: 0.0005, y: 0.001}, noise_rate: 0.1, arithmetic: single}\n"
LEFT_OUT = {"id": "hardware_left_out"}


@pytest.fixture(scope="module")
def honest():
    return certified(SMALL + MACHINE, conditions="distance")


@pytest.mark.slow
def test_an_honest_certificate_says_that_it_left_the_machine_out(honest):
    assert honest["result"]["verdict"] == "certified"
    assert LEFT_OUT in honest["result"]["assumptions"]
    assert failing(examine(honest)) == []


@pytest.mark.slow
def test_what_is_left_out_is_not_silent(honest):
    silent = copy.deepcopy(honest)
    silent["result"]["assumptions"].remove(LEFT_OUT)
    assert unconfirmed(silent)
    ideal = certified(SMALL, conditions="distance")
    assert LEFT_OUT not in ideal["result"]["assumptions"]
    ideal["result"]["assumptions"].append(LEFT_OUT)
    assert unconfirmed(ideal)
    assert unconfirmed(respecified(honest, lambda effective: effective.pop("hardware")))


REFUSED = {
    "a word for a time": {"sample_time": "fast"},
    "no time at all": {"sample_time": "0"},
    "a negative delay": {"delay": "-1"},
    "a delay longer than a sample": {"delay": "0.003"},
    "noise of one state": {"noise": {"x": "0.001"}},
    "a negative noise": {"noise": {"x": "0.001", "y": "-0.001"}},
    "another arithmetic": {"arithmetic": "half"},
    "a new key": {"jitter": "1"},
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_machine_that_is_none_is_refused(honest, name):
    with pytest.raises(TubecertError) as refused:
        examine(respecified(honest, lambda effective: effective["hardware"].update(REFUSED[name])))
    assert {item.code for item in refused.value.findings} == {"TC603"}


@pytest.mark.parametrize("key", ["sample_time", "delay", "noise"])
def test_a_machine_that_lacks_something_is_refused(honest, key):
    with pytest.raises(TubecertError, match=f"hardware.{key} is missing"):
        examine(respecified(honest, lambda effective: effective["hardware"].pop(key)))


@pytest.mark.parametrize("place", [(), ("proof",)], ids=["section", "recipe"])
@pytest.mark.parametrize("kind", ["hardware", "sampled"])
def test_a_kind_that_there_is_not_is_refused(honest, kind, place):
    document = copy.deepcopy(honest)
    holder = document["result"]
    for key in place:
        holder = holder[key]
    holder[kind] = {"verdict": "certified"}
    with pytest.raises(TubecertError) as refused:
        examine(sealed(document))
    assert {item.code for item in refused.value.findings} == {"TC603"}


def test_a_b_with_parameters_known_by_ranges_is_refused():
    """No theorem here speaks of such a B; it was never certified."""
    gained = SMALL.replace("  f: [", "  parameters: {m: [0.97, 1.03]}\n  f: [")
    document = certified(gained, conditions="distance")
    with pytest.raises(TubecertError, match="B"):
        examine(respecified(document, lambda e: e["system"].update(B=[["0"], ["1/m"]])))
    found = certified(gained.replace("[1]]", '["1/m"]]'), conditions="distance")
    assert found["result"]["verdict"] == "undecided"
    with pytest.raises(TubecertError) as refused:
        examine(found)
    assert {item.code for item in refused.value.findings} == {"TC603"}
