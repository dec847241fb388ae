"""Certificate B along a plan that comes to rest, with wind, limits and an output: the honest one is confirmed alone."""

from __future__ import annotations

import copy

import pytest
from rechecked import certified, examine, failing, sealed, unconfirmed
from systems import COMING_TO_REST

PAIR, PROOF = ("distance", "least_adaptation"), ("proof", "distance")


@pytest.fixture(scope="module")
def honest():
    return certified(COMING_TO_REST, bare=False, conditions="distance")


@pytest.mark.slow
def test_the_honest_one_is_confirmed(honest):
    result = honest["result"]
    assert result["verdict"] == "certified"
    assert {"x", "y", "s"} == result["tube"]["half_widths"].keys()
    assert failing(examine(honest)) == []


def at(result, path):
    for key in path:
        result = result[key]
    return result


def scaled(factor, *paths):
    """The same number wherever it stands, times a factor."""

    def change(result):
        for *above, last in paths:
            holder = at(result, above)
            holder[last] = holder[last] * factor

    return change


def put(value, *path):
    def change(result):
        at(result, path[:-1])[path[-1]] = value

    return change


def gone(*path):
    def change(result):
        del at(result, path[:-1])[path[-1]]

    return change


def both(key, factor):
    """A gain in the section and in its recipe."""
    return scaled(factor, (*PAIR, key), (*PROOF, key))


FORGED = {
    "no recipe": gone(*PROOF),
    "half a recipe": gone(*PROOF, "uncertainty"),
    "a key of the recipe that is not known": put(1.0, *PROOF, "settling"),
    "no section": gone("distance"),
    "a key of the section that is not known": put([], "distance", "windows"),
    "no pair": put(None, *PAIR),
    "Y": scaled(0.99, (*PROOF, "speed")),
    "e": scaled(0.9, (*PROOF, "prediction_error")),
    "S": scaled(0.9, (*PROOF, "uncertainty")),
    "an extreme Y": put(1e308, *PROOF, "speed"),
    "a Y that is no number": put("nan", *PROOF, "speed"),
    "a smaller projection": both("projection_radius", 0.99),
    "a smaller bandwidth": both("bandwidth", 0.5),
    "no bandwidth": both("bandwidth", 0),
    "a negative rate": both("adaptation_rate", -1),
    "a smaller rate": both("adaptation_rate", 0.9),
    "another predictor": both("predictor_gain", 0.1),
    "a negative predictor": both("predictor_gain", -1),
    "a smaller rate in the section only": scaled(0.99, (*PAIR, "adaptation_rate")),
    "a margin": put([0.5, None], *PAIR, "margin"),
    "a smaller radius for ever": scaled(0.9, (*PAIR, "ultimate_radius"), ("distance", "ultimate_radius")),
    "another radius for ever": scaled(0.9, ("distance", "ultimate_radius")),
    "half-widths of the states": scaled(0.97, ("tube", "half_widths", "x")),
    "half-width of an output": scaled(0.97, ("tube", "half_widths", "s")),
    "an output without a half-width": gone("tube", "half_widths", "s"),
    "a half-width of nobody": put(1.0, "tube", "half_widths", "z"),
    "less of an input": scaled(0.99, ("inputs", 0, "bounds", "distance", "greatest")),
    "limits that the loop leaves": put([-1, 3], "inputs", 0, "limits"),
    "it decides twice": put(["distance", "distance"], "decided_by"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGED)
def test_a_forged_one_is_not_confirmed(honest, name):
    document = copy.deepcopy(honest)
    FORGED[name](document["result"])
    assert sealed(document)["hash"] != honest["hash"], "nothing was changed"
    assert unconfirmed(document)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drift_on_plan", "feedback_gain", "h", "h_t", "h_x", "wind_push", "lower"])
def test_no_constant_may_be_better_than_it_is(honest, name):
    document = copy.deepcopy(honest)
    bound = document["result"]["constants"][name]
    side, factor = ("below", 1.1) if name == "lower" else ("above", 0.9)
    bound |= {"below": min(bound["below"], bound["above"] * factor), side: bound[side] * factor}
    assert any(found.startswith(f"{name} ") for found, _ in failing(examine(sealed(document))))


@pytest.mark.slow
def test_looser_numbers_are_confirmed(honest):
    """What claims less is examined as it stands, too: the others are not refused for having been touched."""
    document = copy.deepcopy(honest)
    result = document["result"]
    both("adaptation_rate", 4)(result)
    wider = ("tube", "half_widths", "s"), (*PAIR, "ultimate_radius"), ("distance", "ultimate_radius")
    scaled(1.1, *wider)(result)
    at(result, PAIR)["margin"][0] = 1e-6
    result["reasons"] = []  # they repeat the margins
    assert failing(examine(sealed(document))) == []
