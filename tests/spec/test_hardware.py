"""A file that names its machine: what it may say of it, what stands beside it, what becomes of it in canonical data."""

import json
from dataclasses import fields
from fractions import Fraction
from pathlib import Path

import pytest
from texts import replaced

import tubecert
from tubecert import pipeline
from tubecert.errors import SpecError
from tubecert.spec import Hardware, Setting, canonical, load, load_text
from tubecert.synthesis.coefficients import with_metric_file

ROOT = Path(tubecert.__file__).parents[1]
CONFIGS = sorted((ROOT / "configs").glob("hardware_*.yaml"))

PLANT = """
tubecert: 1
name: small
system: {states: [x, y], inputs: [u], f: ["-x + y", "-y"], B: [[0], [1]]}
safe_set: {x: [-1, 1], y: [-1, 1]}
"""
REST = "trajectory: {kind: equilibrium, at: [0, 0]}\n"
LASTING = 'trajectory: {kind: expressions, x: ["sin(t)", "cos(t)"], u: ["0"], horizon: 7}\n'
MACHINE = "hardware: {rate: 500}\n"
BASE = PLANT + REST + MACHINE
FAMILY = (
    PLANT
    + "trajectory: {kind: any, x: {x: [-0.5, 0.5], y: [-0.5, 0.5]}, u: {u: [-1, 1]}}\n"
    + "initial_state: {within: 0.05}\n"
    + MACHINE
)


def changed(*changes, text=BASE):
    return load_text(replaced(text, *changes), "small.yaml")


def hardware(text):
    found = changed(("rate: 500", text)).hardware
    assert found is not None
    return found


def said(text):
    """Code, message and help of every finding."""
    with pytest.raises(SpecError) as refused:
        load_text(text, "small.yaml")
    return [f"{item.code} {item.message} / {item.help}" for item in refused.value.findings]


def test_the_rate_is_enough():
    own = changed()
    assert own.hardware == Hardware(sample_time=Fraction(1, 500))
    assert (own.hardware.arithmetic, own.hardware.hold, own.hardware.delayed) == ("double", "middle", 0)
    assert own.controller == "auto"
    assert own.metric is own.synthesis is None
    assert [term.text for term in own.uncertainty.h] == ["0"]
    assert own.tube.half_widths == ()


def test_every_key_is_read():
    own = hardware("sample_time: 1/500, delay: 0.0051, noise: {y: 0.1}, arithmetic: single, hold: continuous")
    assert own == Hardware(
        sample_time=Fraction(1, 500),
        delay=Fraction("0.0051"),
        noise=(Fraction(0), Fraction("0.1")),
        arithmetic="single",
        hold="continuous",
    )
    assert {item.name for item in fields(Hardware)} == {"sample_time", "delay", "noise", "arithmetic", "hold"}


@pytest.mark.parametrize(
    ("written", "seconds"), [("one sample", "1/500"), ("0.128", "0.128"), ("0", "0"), ("1/3000", "1/3000")]
)
def test_a_delay_is_seconds_or_one_sample(written, seconds):
    assert hardware(f"rate: 500, delay: {written}").delayed == Fraction(seconds)


def test_one_sample_follows_the_rate():
    text = BASE.replace("500", "500, delay: one sample")
    slower = load_text(text)
    assert slower.hardware.delay is None
    assert canonical(slower)["hardware"]["delay"] == "one sample"
    assert changed(("500", "100, delay: one sample")).hardware.delayed == Fraction(1, 100)


@pytest.mark.parametrize("word", ["nothing", "rest", "repeat"])
def test_a_plan_that_ends_says_what_holds_afterwards(word):
    spec = changed(("horizon: 7", f"horizon: 7, afterwards: {word}"), text=PLANT + LASTING + MACHINE)
    assert spec.trajectory.afterwards == word
    assert canonical(spec)["trajectory"]["afterwards"] == word


def test_a_family_bounds_the_rates_of_its_inputs():
    assert changed(text=FAMILY).trajectory.bundle.input_rate is None
    for rate in ("2", "{u: 2}"):
        spec = changed(("[-1, 1]}}\n", f"[-1, 1]}}, input_rate: {rate}}}\n"), text=FAMILY)
        assert spec.trajectory.bundle.input_rate == (Fraction(2),)
        assert canonical(spec)["trajectory"]["input_rate"] == {"u": "2"}


def test_a_number_bounds_the_rate_of_every_input():
    two = FAMILY.replace("[u]", "[u, v]").replace("[[0], [1]]", "[[0, 1], [1, 0]]")
    two = two.replace("u: {u: [-1, 1]}", "u: {u: [-1, 1], v: [-1, 1]}, input_rate: 1/2")
    assert load_text(two).trajectory.bundle.input_rate == (Fraction(1, 2), Fraction(1, 2))
    assert said(two.replace("1/2", "{u: 1}")) == ["TC105 trajectory.input_rate lacks v / add v: ..."]


def test_a_wind_is_bounded_by_its_length_or_by_component():
    wind = "disturbance: {E: [[1, 0], [0, 1]], bound: 0.05}\n"
    assert load_text(BASE + wind).disturbance.bound == Fraction("0.05")
    boxed = load_text(BASE + wind.replace("0.05", "[0.05, 1/10]"))
    assert boxed.disturbance.bound == (Fraction("0.05"), Fraction("0.1"))
    assert canonical(boxed)["disturbance"]["bound"] == ["0.05", "0.1"]


def test_canonical_data_names_the_machine_and_nothing_of_a_metric():
    data = canonical(changed(text=PLANT + LASTING + MACHINE))
    assert data["hardware"] == {
        "sample_time": "0.002",
        "delay": "0",
        "noise": "0",
        "arithmetic": "double",
        "hold": "middle",
    }
    assert data["controller"] == "auto"
    assert data["uncertainty"] == {"h": ["0"]}
    assert data["tube"] == {}
    assert not data.keys() & {"metric", "adaptation", "conditions"}


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_canonical_data_is_a_specification_of_the_same(path):
    data = canonical(load(str(path)))
    assert canonical(load_text(json.dumps(data), str(path))) == data


WRITTEN = {
    "another time": "sample_time: 0.002",
    "the default delay": "rate: 500, delay: 0",
    "the default noise": "rate: 500, noise: {x: 0, y: 0}",
    "the default arithmetic": "rate: 500, arithmetic: double",
    "the default hold": "rate: 500, hold: middle",
}


@pytest.mark.parametrize("name", WRITTEN)
def test_what_means_the_same_is_the_same_system_but_for_noise(name):
    """A noise of 0 by state stays by state: one that is a length is another set of errors."""
    one, other = canonical(changed()), canonical(changed(("rate: 500", WRITTEN[name])))
    assert (one == other) == (name != "the default noise")


OTHERWISE = {
    "delay": "rate: 500, delay: 0.001",
    "noise": "rate: 500, noise: 0.001",
    "arithmetic": "rate: 500, arithmetic: single",
    "hold": "rate: 500, hold: left",
}


@pytest.mark.parametrize("name", OTHERWISE)
def test_what_means_something_else_is_another_system(name):
    assert canonical(changed()) != canonical(changed(("rate: 500", OTHERWISE[name])))


def test_without_hardware_nothing_is_new_in_canonical_data():
    text = PLANT + REST.replace("[0, 0]}", "[0, 0], horizon: 2}") + 'uncertainty: {h: ["0"]}\n'
    data = canonical(load_text(text))
    assert "afterwards" not in data["trajectory"]
    assert not data.keys() & {"hardware", "controller"}
    assert data.keys() >= {"adaptation", "conditions"}


def test_keys_are_set_from_outside(tmp_path):
    file = tmp_path / "small.yaml"
    file.write_text(BASE)
    words = ("hardware.rate=250", "hardware.delay=one sample", "controller=none", "tube.half_widths.x=0.1")
    spec = load(str(file), [Setting.of(each) for each in words])
    assert spec.hardware.delayed == Fraction(1, 250)
    assert spec.controller == "none"
    assert spec.tube.half_widths == (("x", Fraction("0.1")),)
    with pytest.raises(SpecError, match=r"tube\.epsilon beside hardware"):
        load(str(file), [Setting.of("tube.epsilon=0.1")])


def test_a_file_with_hardware_may_lack_uncertainty_and_no_other():
    assert any("lacks uncertainty" in each for each in said(PLANT + REST))
    (told,) = said(PLANT + MACHINE)
    assert told.startswith(
        "TC105 the specification lacks trajectory / add trajectory: {kind: equilibrium, at:"
    )


def test_reasons_are_told_with_what_to_do():
    metric = "metric: {rate: 1, dual_metric: [[1, 0], [0, 1]]}\n"
    (told,) = said(BASE + metric)
    assert told == (
        "TC112 metric beside hardware / the sampled loop is proven without a metric: leave it out, or leave out "
        "hardware"
    )
    (told,) = said(BASE.replace("-y", "-y + t*x"))
    assert told.startswith("TC112 f depends on t, and with hardware it may not / ")


def test_no_metric_is_put_beside_hardware():
    """Neither a file nor a search: certificates 0, A and B are not about this loop."""
    spec = changed()
    with pytest.raises(SpecError, match="proven without a metric"):
        with_metric_file(spec, str(ROOT / "configs/pvtol_adaptation.metric.json"))
    with pytest.raises(SpecError, match="proven without a metric"):
        pipeline.question_of(spec, pipeline.Options())


@pytest.mark.parametrize("named", ["at: {y: 0.54}", "box: {y: [0.54, 0.55]}"])
def test_states_that_are_not_named_start_on_a_plan_whose_start_is_irrational_elsewhere(named):
    plan = LASTING.replace("cos(t)", "cos(t + 1)") + f"initial_state: {{{named}}}\n"
    assert changed((REST, plan)).x0[0] == 0
