"""Certificate H and the disturbance in recheck: honest ones are confirmed, forged ones are not."""

from __future__ import annotations

import copy
from fractions import Fraction

import pytest
import tampers
from rechecked import CONFIGS, case_of, certified, examine, failing, sealed, unconfirmed
from systems import BLOWN, SCALAR, SMALL

from tubecert.errors import ExitCode, TubecertError
from tubecert.recheck.claims import of_certified
from tubecert.recheck.constants import feedback_gain

MACHINE = "hardware: {rate: 500, delay: 0.0005, noise: {x: 0.0005, y: 0.001}}\n"
WIND = 'disturbance: {E: [["0.1"], ["1 + 0.1*x"]], bound: 0.01}\n'
TURNING = (CONFIGS / "state_dependent_input.yaml").read_text("utf-8")
GAIN = SMALL.replace("  f: [", "  parameters: {m: [0.97, 1.03]}\n  f: [").replace("[1]]", '["1/m"]]', 1)
KINDS = {
    "a clean machine": SMALL + "hardware: {rate: 500}\n",
    "noise per state and wind": BLOWN,
    "prediction, noise that drifts": SMALL
    + "hardware: {rate: 500, delay: one sample, noise: 0.001, noise_rate: 0.1, predict: true}\n",
    "the largest sample time, wind that is adapted to": SMALL
    + "hardware: {sample_time: largest, noise: 0.0005, feedback_rate: 1000}\n"
    + WIND.replace("bound: 0.01", "bound: 0.01, rate: 1"),
    "the largest noise, u* held": SMALL + "hardware: {rate: 1000, noise: largest, feedforward: held}\n",
    "the largest wind, a clock of its own": SMALL
    + "hardware: {rate: 300, feedback_rate: 1000, bandwidth: 20}\ndisturbance: {bound: largest}\n",
    "the largest delay, slow feedback": SMALL
    + "hardware: {rate: 1000, delay: largest, feedback_rate: 110}\n",
    "an uncertain gain": GAIN.replace('"-y + 0.3*sin(x)"', '"-y + 0.3*m*sin(x)"').replace(
        "input: [0]", "input: [0.01]"
    )
    + MACHINE.replace("0.0005, y: 0.001", "0.0002, y: 0.0002")
    + WIND.replace("bound: 0.01", "bound: 0.005, rate: 1"),
    "B and the metric turn": TURNING + "hardware: {rate: 500, noise: 0.0001}\n",
    "rounding": SMALL + MACHINE.replace("rate: 500", "rate: 500, arithmetic: single"),
    "declared bounds": SMALL.replace('h: ["0.1*sin(t) + 0.05*x"]', "bounds: {h: 0.15, h_x: 0.05, h_t: 0.1}")
    + MACHINE,
}


WITH_CURVE = "noise per state and wind"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_honest_certificates_are_confirmed(kind):
    gap = Fraction(1, 5 if KINDS[kind].startswith(TURNING) else 10)  # of these recheck takes longest
    document = certified(KINDS[kind], conditions="hardware", bare=kind != WITH_CURVE, gap=gap)
    assert document["result"]["verdict"] == "certified", document["result"]["reasons"]
    found = examine(document)
    assert failing(found) == []
    assert found.exit_code == ExitCode.CERTIFIED
    assert any(item.name.startswith("H: d < ") for item in found.claims)


@pytest.mark.slow
def test_a_curve_of_a_machine_that_predicts_is_examined():
    """Each point has a recipe with a prediction of its own; a level that is too small has none."""
    document = certified(KINDS["prediction, noise that drifts"], conditions="hardware")
    section = document["result"]["hardware"]
    assert section["predict"]
    for share, level, confirmed in ((0.9, 1.05, True), (1.2, 1.5, True), (1, 0.99, False), (0.9, 0.7, False)):
        point = {"sample_time": section["sample_time"] * share, "level": section["level"] * level}
        section["curve"] = [point]
        wrong = [name for name, _ in failing(examine(sealed(document)))]
        assert wrong == ([] if confirmed else ["H: the curve is feasible"])


@pytest.fixture(scope="module")
def honest():
    """A certificate of H with noise and wind, and outcomes that forged ones share with it."""
    document, memory = certified(KINDS["noise per state and wind"], conditions="hardware", bare=False), {}
    assert failing(examine(document, memory=memory)) == []
    return document, memory


def refused(document, memory) -> bool:
    """Whether a forged certificate is not confirmed."""
    try:
        found = examine(sealed(document), memory=memory, to_first_failure=True)
    except TubecertError:
        return True
    return found.exit_code != ExitCode.CERTIFIED


OWN = (
    "feedback_slope",
    "feedback_curvature",
    "drift_difference",
    "drift_difference_metric",
    "drift_slope_metric",
    "drift_explained",
    "noise_size",
    "noise_metric",
    "noise_explained",
    "wind_push",
    "wind_size",
    "wind_explained",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", OWN)
def test_no_constant_may_be_half_of_what_it_is(honest, name):
    document, memory = copy.deepcopy(honest[0]), honest[1]
    constant = document["result"]["constants"][name]
    constant |= {"above": constant["above"] / 2, "below": 0.0}
    found = examine(sealed(document), memory=memory, to_first_failure=True)
    assert any(found_name.startswith(f"{name} <=") for found_name, _ in failing(found))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*OWN, "plan_tilt", "plan_speed", "symbols", "symbols_slope"])
def test_no_constant_may_be_missing(honest, name):
    document = copy.deepcopy(honest[0])
    del document["result"]["constants"][name]
    assert refused(document, honest[1])


def both(key, factor):
    def change(result):
        for part in (result["hardware"], result["proof"]["hardware"]):
            part[key] = part[key] * factor

    return change


def own(factor, *path):
    """One number of the section."""

    def change(result):
        *above, last = path
        holder = result["hardware"]
        for key in above:
            holder = holder[key]
        holder[last] = holder[last] * factor

    return change


def proof(key, factor):
    def change(result):
        result["proof"]["hardware"][key] *= factor

    return change


def put(value, *path):
    def change(result):
        *above, last = path
        holder = result
        for key in above:
            holder = holder[key]
        holder[last] = value

    return change


def gone(*path):
    def change(result):
        *above, last = path
        holder = result
        for key in above:
            holder = holder[key]
        del holder[last]

    return change


SPEC = ("spec", "effective")
FORGED = {
    "a smaller level": both("level", 0.99),
    "a level without room for noise": both("level", 6),
    "a smaller level in the section only": own(0.99, "level"),
    "a longer sample time": both("sample_time", 1.01),
    "a shorter sample time": both("sample_time", 0.5),
    "no delay": both("delay", 0),
    "less noise": both("noise", 0.5),
    "less wind": both("wind", 0.5),
    "a faster feedback": both("feedback_time", 0.5),
    "another bandwidth": both("bandwidth", 2),
    "a filter that forgets at once": put(None, "hardware", "bandwidth"),
    "deadbeat": put(True, "hardware", "deadbeat"),
    "a prediction": put(True, "hardware", "predict"),
    "a prediction in the recipe": put(0.01, "proof", "hardware", "prediction"),
    "something largest": put("noise", "hardware", "largest"),
    "a smaller clip": both("clip_radius", 0.99),
    "a narrower clip": own(0.99, "clip", 0, 1),
    "a clip on the other side": put([[0.05, 0.2]], "hardware", "clip"),
    "two clips": put([[-0.2, 0.2], [-0.2, 0.2]], "hardware", "clip"),
    "speed": proof("speed", 0.999),
    "bias": proof("bias", 0.999),
    "ripple": proof("ripple", 0.999),
    "floor": proof("floor", 1e-6),
    "a floor above the level": proof("floor", 1e6),
    "a higher margin": own(1.1, "margin", 0),
    "a higher margin of the level": own(1.01, "level_margin", 0),
    "a smaller radius": own(0.999, "radius"),
    "a smaller radius in the long run": own(0.999, "ultimate_radius"),
    "a smaller half-width": own(0.99, "half_widths", "x"),
    "a half-width of another": put(1.0, "hardware", "half_widths", "z"),
    "no half-width": gone("hardware", "half_widths", "x"),
    "a smaller input": own(0.99, "inputs", "u", 1),
    "a smaller input below": own(0.99, "inputs", "u", 0),
    "no input": gone("hardware", "inputs", "u"),
    "a smaller share": own(0.99, "budget", "bias"),
    "a small share, by less than what is dust": own(1 - 2e-7, "budget", "lag"),
    "no share": gone("hardware", "budget", "lag"),
    "no budget": put(None, "hardware", "budget"),
    "an infeasible curve": put([{"sample_time": 1.0, "level": 0.05}], "hardware", "curve"),
    "no recipe": gone("proof", "hardware"),
    "half a recipe": gone("proof", "hardware", "floor"),
    "no section": gone("hardware"),
    "a new key": put(1, "hardware", "safety"),
    "a new key of the recipe": put(1, "proof", "hardware", "safety"),
    "no machine in the specification": gone(*SPEC, "hardware"),
    "no wind in the specification": gone(*SPEC, "disturbance"),
    "no wind in the claim": gone("claim", "wind"),
    "less wind in the claim": put("0.001", "claim", "wind", "bound"),
    "wind with a rate in the claim": put("1", "claim", "wind", "rate"),
    "no wind assumed": lambda result: result["assumptions"].remove(
        next(item for item in result["assumptions"] if item["id"] == "wind_within")
    ),
    "a machine with more noise": put({"x": "0.001", "y": "0.001"}, *SPEC, "hardware", "noise"),
    "a machine with noise in one state": put({"x": "0.001"}, *SPEC, "hardware", "noise"),
    "a slower machine": put("0.004", *SPEC, "hardware", "sample_time"),
    "a later machine": put("0.001", *SPEC, "hardware", "delay"),
    "a machine that predicts": put("true", *SPEC, "hardware", "predict"),
    "a machine that holds u*": put("held", *SPEC, "hardware", "feedforward"),
    "a machine with a word": put("fast", *SPEC, "hardware", "sample_time"),
    "a machine with a new key": put("1", *SPEC, "hardware", "jitter"),
    "more wind": put("0.02", *SPEC, "disturbance", "bound"),
    "wind elsewhere": put([["1"], ["1"]], *SPEC, "disturbance", "E"),
    "wind of another shape": put([["1"]], *SPEC, "disturbance", "E"),
    "wind that is searched for": put("largest", *SPEC, "disturbance", "bound"),
    "wind that may be undefined": put([["0.1/(x - 0.5)"], ["1"]], *SPEC, "disturbance", "E"),
    "wind with kinks": put([["0.1*abs(x)"], ["1"]], *SPEC, "disturbance", "E"),
    "an extreme level": put("1e-300", "proof", "hardware", "level"),
    "an extreme floor": put("1e-300", "proof", "hardware", "floor"),
    "an extreme speed": put(1e308, "proof", "hardware", "speed"),
    "a time that is no number": put("nan", "proof", "hardware", "sample_time"),
    "no time at all": both("sample_time", 0),
    "a negative delay": both("delay", -1),
    "another section decides nothing": put(["hardware", "hardware"], "decided_by"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGED)
def test_forged_certificates_are_not_confirmed(honest, name):
    document = copy.deepcopy(honest[0])
    FORGED[name](document["result"])
    assert refused(document, honest[1])


@pytest.mark.slow
def test_a_section_of_h_has_no_place_without_a_machine(honest):
    other = certified(SMALL, conditions="distance")
    section = honest[0]["result"]["hardware"]
    other["result"]["hardware"] = section
    assert unconfirmed(other)
    other["result"]["proof"]["hardware"] = honest[0]["result"]["proof"]["hardware"]
    other["result"]["decided_by"] = ["hardware"]
    assert unconfirmed(other)


@pytest.mark.slow
def test_looser_numbers_are_confirmed(honest):
    """What claims less is examined as it stands, too."""
    document = copy.deepcopy(honest[0])
    section, recipe = document["result"]["hardware"], document["result"]["proof"]["hardware"]
    for part in (section, recipe):
        part["level"] *= 1.5
    for key in ("radius", "ultimate_radius"):
        section[key] *= 2
    for key in section["half_widths"]:
        section["half_widths"][key] *= 2
    section["inputs"]["u"] = [-1.0, 1.0]
    section["level_margin"][0] /= 2
    recipe["speed"] *= 1.2
    recipe["bias"] *= 1.1
    recipe["ripple"] *= 1.1
    for key in section["budget"]:
        section["budget"][key] *= 2
    section["margin"][0] = 1e-6
    document["result"]["reasons"] = []  # they repeat the margins
    assert failing(examine(sealed(document), memory=honest[1])) == []


@pytest.mark.slow
def test_wind_in_the_other_certificates():
    """Each of 0, B and C rests on what the wind does; A says that it knows of none."""
    text, memory = SMALL + WIND, {}
    document = certified(text, conditions="distance")
    assert failing(examine(document, memory=memory)) == []
    for section in ("no_adaptation", "distance", "sampled"):
        assert document["result"][section]["verdict"] == "certified"
    for name in ("wind_push", "wind_size", "wind_explained"):
        forged = copy.deepcopy(document)
        forged["result"]["constants"][name] |= {"below": 0.0, "above": 0.0}
        assert any(found.startswith(name) for found, _ in failing(examine(sealed(forged), memory=memory)))
    silent = copy.deepcopy(document)
    silent["result"]["conditions_26"] |= {"verdict": "certified", "shortfalls": []}
    assert unconfirmed(silent)


@pytest.mark.slow
@pytest.mark.parametrize("section", ["no_adaptation", "distance", "sampled"])
def test_no_certificate_of_calm_air_serves_in_wind(section):
    """The numbers of a certificate without wind, with the wind of a specification and its constants."""
    calm = certified(SMALL, conditions="distance")
    blown = certified(SMALL + WIND.replace("0.01", "0.05"), conditions="distance")
    forged = copy.deepcopy(blown)
    forged["result"][section] = calm["result"][section]
    forged["result"]["proof"][section] = calm["result"]["proof"][section]
    named = {"no_adaptation": "0: ", "distance": "B: ", "sampled": "C: "}[section]
    assert any(name.startswith(named) for name, _ in failing(examine(sealed(forged))))


def test_the_units_of_a_drift_are_the_least_noise():
    """noise_rate bounds a length: in units of noise it is largest for the state that is measured best."""
    from tubecert.recheck.kinds.machine import promise

    from tubecert.recheck.specified.hardware import Hardware

    asked = Hardware(
        sample_time=Fraction(1),
        delay=Fraction(0),
        one_sample=False,
        noise=(Fraction(0), Fraction(1, 10), Fraction(1, 2)),
        noise_rate=Fraction(3),
        held=False,
        feedback_time=None,
        predict=False,
        bandwidth=None,
        arithmetic=None,
    )
    assert promise(asked).drift == 30


@pytest.mark.slow
def test_a_feedback_of_nothing_is_confirmed():
    """W contracts at its rate by itself: F is 0, so du = 0 is a bound; of any other F it is none."""
    own = SCALAR.replace("-x + 0.1*sin(x)", "-0.5*x").replace("0.2*sin(t)", "0.05*sin(t)")
    document = certified(own, conditions="hardware")
    assert document["result"]["constants"]["feedback_gain"]["above"] == 0
    assert failing(examine(document, 400)) == []
    # of a plant that contracts more slowly than that, F is .2
    steeper = certified(SCALAR.replace("-x + 0.1*sin(x)", "-0.4*x"), conditions="hardware")
    place = case_of(steeper).place
    assert not feedback_gain(place, Fraction(0), Fraction(1)).holds
    assert feedback_gain(place, Fraction(1), Fraction(1)).holds


@pytest.mark.slow
def test_no_random_change_of_what_is_stated_of_a_machine_is_confirmed(monkeypatch):
    made, fields = certified(KINDS["noise per state and wind"], conditions="hardware"), tampers.fields
    own = (
        "hardware",
        "proof.hardware",
        "spec.effective.hardware",
        "spec.effective.disturbance",
        "claim.wind",
    )
    monkeypatch.setattr(
        tampers,
        "fields",
        lambda r: {name: paths for name, paths in fields(r).items() if name.startswith(own)},
    )
    refusals, _, wrong = tampers.campaign(made, 150, seed=5)
    assert wrong == []
    assert refusals > 90


@pytest.mark.slow
def test_outcomes_of_a_forged_certificate_are_not_those_of_another(honest):
    """A half-width that only a forged bound of the metric allows is not confirmed with the bound that is true."""
    document, memory = copy.deepcopy(honest[0]), dict(honest[1])
    widths = document["result"]["hardware"]["half_widths"]
    name = min(widths)
    widths[name] = float(widths[name]) / 2
    forged = copy.deepcopy(document)
    forged["result"]["constants"]["lower"] |= {"below": 1e6, "above": 1e6}
    examine(sealed(forged), memory=memory)
    assert unconfirmed(document)
    assert refused(document, memory)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lower", "h", "plan_defect"])
def test_claims_of_h_depend_on_all_that_they_rest_on(honest, name):
    case, other = case_of(honest[0]), copy.deepcopy(honest[0])
    other["result"]["constants"][name] |= {"below": 7.0, "above": 7.0}
    keys, others = ({c.name: c.key for c in of_certified(x)} for x in (case, case_of(sealed(other))))
    resting = {"lower": "H: half-width", "h": "H: the estimate", "plan_defect": "H: d <"}[name]
    found = [own for own in keys if own.startswith(resting)]
    assert found
    assert all(keys[own] != others[own] for own in found)


def _more(rounding):
    rounding["estimate"] = 0.5


def _negative(rounding):
    rounding["feedback"] = -1e-9


def _unknown(rounding):
    rounding["drift"] = 0.0


@pytest.mark.slow
def test_what_rounding_may_cost_is_examined():
    document, memory = certified(KINDS["rounding"], conditions="hardware"), {}
    assert failing(examine(document, memory=memory)) == []

    def forged(change):
        other = copy.deepcopy(document)
        change(other["result"])
        return other

    def of_rounding(change):
        return lambda result: change(result["proof"]["hardware"]["rounding"][0])

    def twice(result):
        result["proof"]["hardware"]["rounding"] *= 2

    def exact(result):
        del result["proof"]["hardware"]["rounding"]

    def assumed(result):
        (own,) = [item for item in result["assumptions"] if item["id"] == "machine_as_given"]
        own["arithmetic"] = "double"

    changes = (*map(of_rounding, (_more, _negative, _unknown, dict.clear)), twice, exact, assumed)
    for change in changes:
        assert refused(forged(change), memory), change
