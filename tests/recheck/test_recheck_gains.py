"""An uncertain gain in recheck: what is forged of it is not confirmed, and what it proves is the producer's."""

from __future__ import annotations

import copy

import pytest
from rechecked import certified, examine, failing, respecified, sealed
from test_recheck_hardware import KINDS

from tubecert.errors import TubecertError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def honest():
    document, memory = certified(KINDS["an uncertain gain"], conditions="hardware"), {}
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document, memory=memory)) == []
    return document, memory


def refused(document, memory) -> bool:
    try:
        return not examine(sealed(document), memory=memory, to_first_failure=True).claims[-1].outcome.holds
    except TubecertError:
        return True


def test_only_certificate_h_has_a_section(honest):
    result = honest[0]["result"]
    assert result["decided_by"] == ["hardware"]
    assert not {"no_adaptation", "gains", "distance", "sampled"} & result.keys()
    assert 0.03 < result["constants"]["gain_error"]["above"] < 0.0312
    assert 0.03 < result["hardware"]["budget"]["gain"] < 0.3


def less(place, share):
    place["above"] *= share


FORGED = {
    "a smaller Delta": lambda r: less(r["constants"]["gain_error"], 0.98),
    "no Delta": lambda r: r["constants"].pop("gain_error"),
    "a smaller h": lambda r: less(r["constants"]["h"], 0.97),
    "a smaller Lipschitz constant": lambda r: less(r["constants"]["h_x"], 0.97),
    "a smaller start": lambda r: less(r["constants"]["h_initial"], 0.97),
    "a smaller rate": lambda r: less(r["constants"]["h_t"], 0.97),
    "a smaller share": lambda r: r["hardware"]["budget"].update(gain=0.9 * r["hardware"]["budget"]["gain"]),
    "no share": lambda r: r["hardware"]["budget"].pop("gain"),
    "a smaller S": lambda r: r["proof"]["hardware"].update(
        bias=str(0.97 * float(r["proof"]["hardware"]["bias"]))
    ),
    "a smaller Y": lambda r: r["proof"]["hardware"].update(
        speed=str(0.97 * float(r["proof"]["hardware"]["speed"]))
    ),
    "a tighter clip": lambda r: r["hardware"].update(
        clip=[[low, str(0.97 * float(high))] for low, high in r["hardware"]["clip"]]
    ),
}


@pytest.mark.parametrize("name", FORGED)
def test_forged_ones_are_refused(honest, name):
    document, memory = copy.deepcopy(honest[0]), dict(honest[1])
    FORGED[name](document["result"])
    assert refused(document, memory)


def test_a_wider_range_is_refused(honest):
    def change(effective):
        effective["system"]["parameters"]["m"] = ["0.94", "1.06"]

    document = respecified(honest[0], change)
    document["result"]["claim"]["parameters"] = {"m": ["0.94", "1.06"]}
    assert refused(document, {})


def test_inputs_that_act_elsewhere_are_refused(honest):
    def change(effective):
        effective["system"]["B"] = [["0.01*(m - 1)"], ["1/m"]]

    assert refused(respecified(honest[0], change), {})
