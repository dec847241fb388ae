"""What recheck reads of a sampled loop, to the last key; and that no certificate of 0, A or B may have a machine."""

import copy
from fractions import Fraction

import pytest
from rechecked import certified, examine, respecified, sealed
from systems import SMALL

from tubecert.errors import TubecertError
from tubecert.recheck.document import CertificateError, Node
from tubecert.recheck.specification import read_sampled_specification, read_specification
from tubecert.spec import canonical
from tubecert.spec.load import load_text

PLANT = """
tubecert: 1
name: machine
system: {states: [x, y], inputs: [u], parameters: {m: [0.97, 1.03]}, f: ["-x + y", "-y"], B: [[0], [1/m]]}
safe_set: {x: [-1, 1], y: [-1, 1]}
hardware: {rate: 500, delay: 0.011, noise: {x: 0.0005, y: 0.001}, arithmetic: single, hold: left}
disturbance: {E: [[1, 0], [0, "1 + x"]], bound: [0.05, 0.1], rate: 1}
limits: {u: [-8, 8]}
"""
FAMILY = (
    PLANT
    + """
trajectory: {kind: any, x: {x: [-0.5, 0.5], y: [-0.5, 0.5]}, u: {u: [-1, 1]}, defect: 0.01, input_rate: 2, horizon: 2}
initial_state: {within: 0.05}
tube: {half_widths: {x: 0.1}}
controller: none
"""
)
MOVING = (
    PLANT
    + 'trajectory: {kind: expressions, x: ["sin(t)", "cos(t)"], u: ["0"], horizon: 7, afterwards: repeat}\n'
)


def effective(text):
    return canonical(load_text(text))


def read(data):
    return read_sampled_specification(Node(data, "effective"))


def test_all_that_was_asked_for_is_read():
    own = read(effective(FAMILY))
    assert own.hardware.sample_time == Fraction(1, 500)
    assert own.hardware.delay == Fraction("0.011")
    assert own.hardware.noise == (Fraction("0.0005"), Fraction("0.001"))
    assert (own.hardware.arithmetic, own.hardware.hold) == ("single", "left")
    assert own.disturbance.bound == (Fraction("0.05"), Fraction("0.1"))
    assert own.disturbance.rate == 1
    assert own.trajectory.input_rate == (Fraction(2),)
    assert own.trajectory.horizon == 2
    assert own.afterwards == "nothing"
    assert own.controller == "none"
    assert own.limits == {"u": (Fraction(-8), Fraction(8))}
    assert own.plant.gained is not None
    assert own.uncertainty.words == "expression"


def test_what_holds_after_the_plan_is_read():
    own = read(effective(MOVING))
    assert (own.afterwards, own.controller) == ("repeat", "auto")
    late = effective(MOVING.replace("0.011", "one sample"))
    assert read(late).hardware.delay == Fraction(1, 500)
    rest = effective(PLANT + "trajectory: {kind: equilibrium, at: [0, 0]}\n")
    assert read(rest).afterwards == "nothing"
    assert "afterwards" not in rest["trajectory"]


def drop(*path):
    def change(data):
        for key in path[:-1]:
            data = data[key]
        del data[path[-1]]

    return change


def put(value, *path):
    def change(data):
        for key in path[:-1]:
            data = data[key]
        data[path[-1]] = value

    return change


REFUSED = {
    "a word for a time": put("fast", "hardware", "sample_time"),
    "no time at all": put("0", "hardware", "sample_time"),
    "no sample time": drop("hardware", "sample_time"),
    "a negative delay": put("-1", "hardware", "delay"),
    "a delay of more than 64 samples": put("0.129", "hardware", "delay"),
    "no delay": drop("hardware", "delay"),
    "noise of one state": put({"x": "0.001"}, "hardware", "noise"),
    "a negative noise": put({"x": "0.001", "y": "-0.001"}, "hardware", "noise"),
    "no noise": drop("hardware", "noise"),
    "another arithmetic": put("half", "hardware", "arithmetic"),
    "no arithmetic": drop("hardware", "arithmetic"),
    "another hold": put("right", "hardware", "hold"),
    "no hold": drop("hardware", "hold"),
    "a rate of noise": put("1", "hardware", "noise_rate"),
    "a new key of the machine": put("1", "hardware", "jitter"),
    "no machine": drop("hardware"),
    "another controller": put("own", "controller"),
    "no word of the controller": drop("controller"),
    "a metric": put({"rate": "1", "dual_metric": [["1", "0"], ["0", "1"]]}, "metric"),
    "a loop of adaptation": put({"A_m": "auto", "projection": "hard"}, "adaptation"),
    "who decides": put({}, "conditions"),
    "a radius": put("0.1", "tube", "epsilon"),
    "no wish": put({}, "tube", "half_widths"),
    "a wish for a stranger": put({"z": "0.1"}, "tube", "half_widths"),
    "a wish for nothing": put({"x": "0"}, "tube", "half_widths"),
    "nothing said of the end": drop("trajectory", "afterwards"),
    "an end without a horizon": drop("trajectory", "horizon"),
    "another end": put("stop", "trajectory", "afterwards"),
    "a family that repeats": put("repeat", "trajectory", "afterwards"),
    "a family that rests": put("rest", "trajectory", "afterwards"),
    "rates of a stranger": put({"v": "2"}, "trajectory", "input_rate"),
    "a number for the rates": put("2", "trajectory", "input_rate"),
    "a negative rate": put({"u": "-2"}, "trajectory", "input_rate"),
    "a family that starts at a point": put({"at": ["0", "0"]}, "initial_state"),
    "a wind of one component": put(["0.05"], "disturbance", "bound"),
    "a negative wind": put(["0.05", "-0.1"], "disturbance", "bound"),
    "an f that depends on t": put(["y - x", "t - y"], "system", "f"),
    "no h": drop("uncertainty"),
    "a new section": put({}, "jitter"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_the_canonical_form_is_refused(name):
    data = effective(FAMILY)
    REFUSED[name](data)
    with pytest.raises(CertificateError) as refused:
        read(data)
    assert {item.code for item in refused.value.findings} == {"TC603"}


def test_only_a_family_has_rates_of_inputs():
    data = effective(MOVING)
    data["trajectory"]["input_rate"] = {"u": "2"}
    with pytest.raises(CertificateError, match="input_rate"):
        read(data)


IN_CONTINUOUS_TIME = {
    "a machine": lambda data: data.update(effective(MOVING) | {"trajectory": data["trajectory"]}),
    "hardware beside a metric": put({"sample_time": "0.01", "delay": "0", "noise": "0"}, "hardware"),
    "a controller": put("auto", "controller"),
    "what holds afterwards": put("nothing", "trajectory", "afterwards"),
    "a wind by component": put({"E": [["1", "0"], ["0", "1"]], "bound": ["1", "1"]}, "disturbance"),
}


@pytest.mark.parametrize("name", IN_CONTINUOUS_TIME)
def test_a_certificate_of_0_a_or_b_has_nothing_of_a_machine(name):
    data = effective(SMALL)
    read_specification(Node(data, "effective"))
    IN_CONTINUOUS_TIME[name](data)
    with pytest.raises(CertificateError) as refused:
        read_specification(Node(data, "effective"))
    assert {item.code for item in refused.value.findings} == {"TC603"}


@pytest.fixture(scope="module")
def honest():
    return certified(SMALL, conditions="distance")


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
    """No theorem of continuous time speaks of such a B; it was never certified."""
    gained = SMALL.replace("  f: [", "  parameters: {m: [0.97, 1.03]}\n  f: [")
    document = certified(gained, conditions="distance")
    with pytest.raises(TubecertError, match="B"):
        examine(respecified(document, lambda e: e["system"].update(B=[["0"], ["1/m"]])))
    found = certified(gained.replace("[1]]", '["1/m"]]'), conditions="distance")
    assert found["result"]["verdict"] == "undecided"
    with pytest.raises(TubecertError) as refused:
        examine(found)
    assert {item.code for item in refused.value.findings} == {"TC603"}
