"""Wind and unknown parameters are examined: what is printed is proven again, and each planted fault is refused."""

import copy

import pytest
import tampers
from rechecked import certified, examine, failing, respecified, sealed, unconfirmed
from systems import BLOWN, COMING_TO_REST, DISTURBED, SMALL
from texts import CONFIGS

RANGES = SMALL.replace("0.3*sin(x)", "m*sin(x)").replace(
    "  inputs: [u]", "  inputs: [u]\n  parameters: {m: [0.2, 0.4], c: [-0.01, 0.01]}"
)
REST = RANGES.replace('"-x + y"', '"-x + y + c*cos(x)"')
FIELD = 'disturbance: {E: [["cos(x)"], ["1 + y"]], bound: 0.01}\n'
ADAPTED = 'disturbance: {E: [["cos(x)"], ["1 + y"]], bound: 0.01, rate: 0.1}\n'
DECLARED = REST.replace('h: ["0.1*sin(t) + 0.05*x"]', "bounds: {h: 0.12, h_x: 0.05, h_t: 0.1}")
TURNS = (CONFIGS / "state_dependent_input.yaml").read_text("utf-8") + "disturbance: {bound: 0.002}\n"

CASES = {
    "gusts": (SMALL + FIELD, "B"),
    "adapted": (SMALL + ADAPTED, "B"),
    "ranges": (REST, "B"),
    "both": (REST + ADAPTED, "B"),
    "coordinates": (REST.replace("rho_a: 0.1}", "rho_a: 0.1, coordinates: auto}") + ADAPTED, "B"),
    "declared": (DECLARED + ADAPTED, "B"),
    "within": (REST.replace("at: [0.05, 0]", "within: 0.05") + ADAPTED, "B"),
    "box": (REST.replace("at: [0.05, 0]", "box: {x: [0, 0.05], y: [0, 0]}") + ADAPTED, "B"),
    "B turns": (TURNS, "B"),
    "a plan that comes to rest": (COMING_TO_REST, "B"),
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
    document = copy.deepcopy(certified(CASES[name][0], conditions=CASES[name][1]))
    change(document["result"])
    return sealed(document)


def less(name):
    def change(result):
        bound = result["constants"][name]
        bound["above"] *= 0.97
        bound["below"] = min(bound["below"], bound["above"])

    return change


TOO_SMALL = {
    "both": "wind_push wind_size residual_push residual_size h h_x h_t h_initial",
    "gusts": "wind_push wind_size wind_explained", "declared": "h h_x h_t", "within": "h_initial",
    "box": "h_initial", "a plan that comes to rest": "wind_push drift_on_plan feedback_gain h h_x h_t",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("constant", "name"), [(each, name) for name, few in TOO_SMALL.items() for each in few.split()]
)
def test_a_constant_that_is_too_small_is_refused(constant, name):
    found = failing(examine(forged(less(constant), name)))
    assert any(claim.startswith(f"{constant} ") for claim, _ in found), found


SPEC = ("spec", "effective")


def put(value, *path):
    def change(result):
        for key in path[:-1]:
            result = result[key]
        result[path[-1]] = value

    return change


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


OF_GUSTS = {
    "no wind in the specification": lambda r: r["spec"]["effective"].pop("disturbance"),
    "no wind assumed": lambda r: r["assumptions"].remove(
        next(item for item in r["assumptions"] if item["id"] == "wind_within")
    ),
    "a rate in the claim": put("1", "claim", "wind", "rate"),
    "more wind": put("0.02", *SPEC, "disturbance", "bound"),
    "wind elsewhere": put([["3"], ["1"]], *SPEC, "disturbance", "E"),
    "wind of another shape": put([["1"]], *SPEC, "disturbance", "E"),
    "wind without a size": put("largest", *SPEC, "disturbance", "bound"),
    "wind that may be undefined": put([["0.1/(x - 0.5)"], ["1"]], *SPEC, "disturbance", "E"),
    "wind with kinks": put([["0.1*abs(x)"], ["1"]], *SPEC, "disturbance", "E"),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fault"), [*(("both", each) for each in FAULTS), *(("gusts", each) for each in OF_GUSTS)]
)
def test_a_planted_fault_is_refused(name, fault):
    assert unconfirmed(forged((FAULTS | OF_GUSTS)[fault], name))


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


@pytest.mark.slow
def test_a_certificate_for_a_wind_is_none_without():
    assert unconfirmed(respecified(certified(BLOWN), lambda e: e.pop("disturbance")))


@pytest.mark.slow
@pytest.mark.parametrize(("section", "letter"), [("no_adaptation", "0"), ("distance", "B")])
def test_no_certificate_of_calm_air_serves_in_wind(section, letter):
    """The numbers of a certificate without wind, with the wind of a specification and its constants."""
    calm = certified(SMALL, conditions="distance")
    blown = certified(SMALL + DISTURBED.replace("0.01", "0.05"), conditions="distance")
    other = copy.deepcopy(blown)
    other["result"][section] = calm["result"][section]
    other["result"]["proof"][section] = calm["result"]["proof"][section]
    assert any(name.startswith(f"{letter}: ") for name, _ in failing(examine(sealed(other))))


@pytest.mark.slow
def test_no_random_change_of_what_is_stated_of_a_wind_is_confirmed(monkeypatch):
    made, fields = certified(BLOWN, conditions="distance"), tampers.fields
    own = ("spec.effective.disturbance", "claim.wind", "proof.distance", "distance")
    monkeypatch.setattr(
        tampers,
        "fields",
        lambda r: {name: paths for name, paths in fields(r).items() if name.startswith(own)},
    )
    refusals, _, wrong = tampers.campaign(made, 150, seed=5)
    assert wrong == []
    assert refusals > 60
