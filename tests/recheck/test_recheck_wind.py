"""Wind and unknown parameters are examined: what is printed is proven again, and each planted fault is refused."""

import copy

import pytest
from rechecked import CONFIGS, certified, examine, failing, sealed, unconfirmed
from systems import SMALL

RANGES = SMALL.replace("0.3*sin(x)", "m*sin(x)").replace(
    "  inputs: [u]", "  inputs: [u]\n  parameters: {m: [0.2, 0.4], c: [-0.01, 0.01]}"
)
REST = RANGES.replace('"-x + y"', '"-x + y + c*cos(x)"')
FIELD = 'disturbance: {E: [["cos(x)"], ["1 + y"]], bound: 0.01}\n'
ADAPTED = 'disturbance: {E: [["cos(x)"], ["1 + y"]], bound: 0.01, rate: 0.1}\n'
DECLARED = REST.replace('h: ["0.1*sin(t) + 0.05*x"]', "bounds: {h: 0.12, h_x: 0.05, h_t: 0.1}")
TURNS = (CONFIGS / "state_dependent_input.yaml").read_text("utf-8") + "disturbance: {bound: 0.002}\n"

NARROW = REST.replace("[0.2, 0.4]", "[0.28, 0.32]") + "hardware: {rate: 1000, noise: 0.0001}\n"
SEARCHED = 'disturbance: {E: [["cos(x)"], ["1 + y"]], bound: largest}\n'

CASES = {
    "gusts": (SMALL + FIELD, "B"),
    "adapted": (SMALL + ADAPTED, "C"),
    "ranges": (REST, "B"),
    "both": (REST + ADAPTED, "C"),
    "coordinates": (REST.replace("rho_a: 0.1}", "rho_a: 0.1, coordinates: auto}") + ADAPTED, "C"),
    "declared": (DECLARED + ADAPTED, "B"),
    "within": (REST.replace("at: [0.05, 0]", "within: 0.05") + ADAPTED, "C"),
    "box": (REST.replace("at: [0.05, 0]", "box: {x: [0, 0.05], y: [0, 0]}") + ADAPTED, "C"),
    "B turns": (TURNS, "C"),
    "hardware": (NARROW + ADAPTED, "hardware"),
    "largest wind": (NARROW + SEARCHED, "hardware"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_what_is_certified_is_confirmed(name):
    text, kind = CASES[name]
    document = certified(text, conditions=kind)
    assert document["result"]["verdict"] == "certified"
    assert not failing(examine(document))


@pytest.mark.slow
def test_a_certificate_of_every_kind_is_confirmed_where_nothing_is_left():
    document = certified(RANGES.replace(", c: [-0.01, 0.01]", ""))
    assert document["result"]["conditions_26"]["verdict"] == "certified"
    assert not failing(examine(document))


def forged(change, name="both"):
    """A certificate with something changed in its result."""
    document = copy.deepcopy(certified(*CASES[name][:1], conditions=CASES[name][1]))
    change(document["result"])
    return sealed(document)


def less(*names, by=0.97):
    def change(result):
        for name in names:
            bound = result["constants"][name]
            bound["above"] *= by
            bound["below"] = min(bound["below"], bound["above"])

    return change


@pytest.mark.slow
@pytest.mark.parametrize(
    ("constant", "name"),
    [
        ("wind_push", "both"),
        ("wind_size", "both"),
        ("wind_push", "gusts"),
        ("wind_size", "gusts"),
        ("wind_explained", "gusts"),
        ("residual_push", "both"),
        ("residual_size", "both"),
        ("h", "both"),
        ("h_x", "both"),
        ("h_t", "both"),
        ("h_initial", "both"),
        ("h", "declared"),
        ("h_x", "declared"),
        ("h_t", "declared"),
        ("h_initial", "within"),
        ("h_initial", "box"),
        ("residual_size", "hardware"),
    ],
)
def test_a_constant_that_is_too_small_is_refused(constant, name):
    assert unconfirmed(forged(less(constant), name))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hardware", "largest wind"])
def test_the_estimate_is_clipped_to_all_that_joins_h(name):
    """The box holds h with its wind and its parameters; what h alone is would be too little."""

    def narrower(result):
        result["hardware"]["clip"] = [[-0.12, 0.12]]

    assert abs(certified(CASES[name][0], conditions="hardware")["result"]["hardware"]["clip"][0][0]) > 0.125
    assert unconfirmed(forged(narrower, name))


FAULTS = {
    "wind claimed larger": lambda r: r["claim"]["wind"].update(bound="0.02"),
    "wind claimed slower": lambda r: r["claim"]["wind"].pop("rate"),
    "no wind claimed": lambda r: r["claim"].pop("wind"),
    "wider ranges claimed": lambda r: r["claim"]["parameters"].update(m=["0.1", "0.4"]),
    "fewer parameters claimed": lambda r: r["claim"]["parameters"].pop("c"),
    "nothing said of parameters": lambda r: r["claim"].pop("parameters"),
    "an assumption less": lambda r: r["assumptions"].pop(),
    "assumed wind": lambda r: r["assumptions"][-2].update(bound=0.005),
    "a constant less": lambda r: r["constants"].pop("residual_push"),
    "no constant of the wind": lambda r: r["constants"].pop("wind_size"),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_refused(fault):
    assert unconfirmed(forged(FAULTS[fault]))


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda e: e["disturbance"].update(bound="0.02"),
        lambda e: e["disturbance"].update(E=[["cos(x)"], ["2 + y"]]),
        lambda e: e["system"]["parameters"].update(m=["0.1", "0.4"]),
        lambda e: e["system"]["parameters"].update(c=["-0.02", "0.01"]),
    ],
)
def test_constants_of_a_calmer_system_are_refused(change):
    """The claim goes with the specification; the constants are those of the system before."""

    def both(result):
        effective = result["spec"]["effective"]
        change(effective)
        wind = effective["disturbance"]
        result["claim"]["wind"] = {key: wind[key] for key in ("bound", "rate")}
        result["claim"]["parameters"] = {
            name: value
            for name, value in effective["system"]["parameters"].items()
            if isinstance(value, list)
        }
        result["assumptions"][-2]["bound"] = float(wind["bound"])

    assert unconfirmed(forged(both))


@pytest.mark.slow
def test_a_certificate_of_a_is_not_made_of_one_beside_a_wind():
    def certify_a(result):
        result["conditions_26"]["verdict"] = "certified"
        result["conditions_26"]["shortfalls"] = []

    assert unconfirmed(forged(certify_a))
