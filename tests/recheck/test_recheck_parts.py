"""Windows of certificates B and C in recheck: honest ones are confirmed, forged ones are not."""

from __future__ import annotations

import copy
from fractions import Fraction
from types import SimpleNamespace

import proven
import pytest
from rechecked import case_of, examine, failing, sealed
from systems import GAINS_IN_WINDOWS
from tubecert.recheck.kinds.windows import within_tube

from tubecert.errors import ExitCode, TubecertError
from tubecert.recheck.claims import of_certified

BUDGET = 4000  # boxes for each claim
KINDS = {"distance": "B", "sampled": "C"}
CONSTANTS = ("drift_on_plan", "feedback_gain", "h_t", "h_x", "wind_push", "lower")


@pytest.fixture(scope="module")
def honest():
    """A certificate with three windows of B and of C, and outcomes that forged ones share with it."""
    document, memory = proven.proven(GAINS_IN_WINDOWS, bare=True, gap=Fraction(1, 20)), {}
    assert document["result"]["verdict"] == "certified", document["result"]["reasons"]
    found = examine(document, BUDGET, memory=memory)
    assert failing(found) == []
    assert found.exit_code == ExitCode.CERTIFIED
    names = [item.name for item in found.claims]
    for letter in KINDS.values():
        assert f"{letter}: d stays below its level in each of 3 windows" in names
        for j in (1, 2, 3):
            for what in ("half-width of y <=", "u in", "drift_on_plan <="):
                assert any(name.startswith(f"{letter}: window {j}: {what}") for name in names)
    return document, memory


def at(result, path):
    for key in path:
        result = result[key]
    return result


def scaled(factor, *path):
    def change(result, key):
        holder = at(result, (key, *path[:-1]))
        holder[path[-1]] = holder[path[-1]] * factor

    return change


def put(value, *path):
    def change(result, key):
        at(result, (key, *path[:-1]))[path[-1]] = value

    return change


def gone(*path):
    def change(result, key):
        del at(result, (key, *path[:-1]))[path[-1]]

    return change


def of_proof(own):
    """A change of the recipe."""
    return lambda result, key: own(result["proof"], key)


def level(j, factor):
    """The level of a window, in section and recipe."""

    def change(result, key):
        section, recipe = (part[key]["windows"][j] for part in (result, result["proof"]))
        section["level"] *= factor
        recipe["level"] = section["level"]

    return change


def speed(j, factor):
    """The speed of a window, and that of the whole with it."""

    def change(result, key):
        own = result["proof"][key]
        own["windows"][j]["speed"] *= factor
        own["speed"] = max(item["speed"] for item in own["windows"])

    return change


def shifted(result, key):
    """A boundary at another time than the specification says."""
    own = result[key]["windows"]
    own[0]["end"] = own[1]["begin"] = 0.31


def dropped(result, key):
    """No second window, and the first one until the third."""
    own = result[key]["windows"]
    own[0]["end"] = own[2]["begin"]
    del own[1], result["proof"][key]["windows"][1]


def swapped(*names):
    """Windows 1 and 3 with each other's numbers."""

    def change(result, key):
        own = result[key]["windows"]
        for name in names:
            own[0][name], own[2][name] = own[2][name], own[0][name]

    return change


def limited(value, *path):
    """What is told of the limits of the input in the windows of a kind."""

    def change(result, key):
        own = result["inputs"][0]["windows"]
        if path:
            own[key][path[0]] = value
        else:
            own[key] = value

    return change


W = ("windows",)
FORGED = {
    "a window beyond the limits": limited("undecided", 1),
    "limits of a window that there is not": limited(["certified"] * 4),
    "limits of fewer windows": limited(["certified"] * 2),
    "limits in other words": limited("yes", 1),
    "limits with what has no windows": lambda result, key: result["inputs"][0]["windows"].update(
        {"rates": ["certified"]}
    ),
    "limits that a window leaves": lambda result, key: result["inputs"][0].update(limits=[-1, 3]),
    "no windows in the section": gone(*W),
    "no windows in the recipe": of_proof(gone(*W)),
    "no window": put([], *W),
    "a window dropped": dropped,
    "a boundary shifted": shifted,
    "a gap": put(0.32, *W, 1, "begin"),
    "the last one ends early": put(1.9, *W, 2, "end"),
    "a key that is not known": put(1, *W, 1, "pad"),
    "a key that is missing": gone(*W, 1, "supremum"),
    "no level": put(None, *W, 1, "level"),
    "a constant of no window": put(1.0, *W, 1, "constants", "h_initial"),
    "a constant of a machine": put(1.0, *W, 1, "constants", "feedback_slope"),
    "a state without a half-width": gone(*W, 1, "half_widths", "x"),
    "an input without a range": gone(*W, 1, "inputs", "u"),
    "a recipe key that is not known": of_proof(put(1.0, *W, 1, "floor")),
    "one recipe less": of_proof(gone(*W, 2)),
    "a tube beyond the tube": put(0.4, *W, 1, "tube"),
    "no tube": put(0, *W, 1, "tube"),
    "levels swapped": swapped("level"),
    "constants of another window": swapped("constants"),
    "inputs swapped": swapped("inputs"),
    "half-widths swapped": swapped("half_widths"),
    "the speed of the whole": of_proof(scaled(1.1, "speed")),
    "the clip of the recipe": of_proof(scaled(0.9, "projection_radius")),
    "the bandwidth": lambda result, key: (
        scaled(0.9, "bandwidth")(result["proof"], key),
        scaled(0.9, *(() if key == "sampled" else ("least_adaptation",)), "bandwidth")(result, key),
    ),
    **{f"level of window {j + 1}": level(j, 0.99) for j in range(3)},
    **{f"a level beyond tube {j + 1}": level(j, 1.1) for j in range(3)},
    **{f"supremum of window {j + 1}": scaled(0.99, *W, j, "supremum") for j in range(3)},
    **{f"radius of window {j + 1}": scaled(0.97, *W, j, "radius") for j in range(3)},
    **{f"width in window {j + 1}": scaled(0.97, *W, j, "half_widths", "x") for j in range(3)},
    "width of an output": scaled(0.97, *W, 1, "half_widths", "s"),
    "an output without a half-width": gone(*W, 1, "half_widths", "s"),
    **{f"speed of window {j + 1}": speed(j, 0.97) for j in range(3)},
    **{
        f"{end} end of u in window {j + 1}": put(0.5, *W, j, "inputs", "u", k)
        for j in range(3)
        for k, end in enumerate(("lower", "upper"))
    },
}
OF_DISTANCE = {
    "no settling": of_proof(gone("settling")),
    "no wait at all": of_proof(put(0, "settling")),
    "a negative wait": of_proof(put(-0.01, "settling")),
    "a wait as long as a window": of_proof(put(0.3, "settling")),
    "S of the whole": of_proof(scaled(0.9, "uncertainty")),
    "e of the whole": of_proof(scaled(0.9, "prediction_error")),
    "a radius for ever": put(0.1, "least_adaptation", "ultimate_radius"),
    "another radius for ever": put(0.1, "ultimate_radius"),
    "a margin": put([0.5, None], "least_adaptation", "margin"),
    "a smaller rate": lambda result, key: (
        scaled(0.9, "adaptation_rate")(result["proof"], key),
        scaled(0.9, "least_adaptation", "adaptation_rate")(result, key),
    ),
    "a curve": put([{"bandwidth": 20, "adaptation_rate": 1e9, "predictor_gain": 20}], "curve"),
}
OF_SAMPLES = {
    "a margin": put([0.5, None], "margin"),
    "a radius for ever": put(0.1, "ultimate_radius"),
    "a longer sample": lambda result, key: (
        scaled(1.05, "sample_time")(result["proof"], key),
        scaled(1.05, "sample_time")(result, key),
    ),
    "a sample of half a window": lambda result, key: (
        put(0.15, "sample_time")(result["proof"], key),
        put(0.15, "sample_time")(result, key),
    ),
    "a curve": put([{"bandwidth": 20, "sample_time": 0.01}], "curve"),
}
CASES = [
    *((key, name) for key in KINDS for name in FORGED),
    *(("distance", name) for name in OF_DISTANCE),
    *(("sampled", name) for name in OF_SAMPLES),
]


def refused(document, memory) -> bool:
    """Whether a forged certificate is not confirmed."""
    try:
        found = examine(sealed(document), BUDGET, memory=memory, to_first_failure=True)
    except TubecertError:
        return True
    return found.exit_code != ExitCode.CERTIFIED


@pytest.mark.slow
@pytest.mark.parametrize(("key", "name"), CASES)
def test_no_change_is_confirmed(honest, key, name):
    document, memory = copy.deepcopy(honest[0]), honest[1]
    (FORGED | (OF_DISTANCE if key == "distance" else OF_SAMPLES))[name](document["result"], key)
    assert sealed(document)["hash"] != honest[0]["hash"], "nothing was changed"
    assert refused(document, memory)


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSTANTS)
def test_no_constant_of_a_window_may_be_less_than_it_is(honest, name):
    document, memory = copy.deepcopy(honest[0]), honest[1]
    stated = [
        (j, own["constants"])
        for j, own in enumerate(document["result"]["distance"]["windows"], start=1)
        if name in own["constants"]
    ]
    assert stated or name == "lower", name
    for _, constants in stated:
        constants[name] *= 1.1 if name == "lower" else 0.9
    found = {name for name, _ in failing(examine(sealed(document), budget=BUDGET, memory=memory))}
    for j, _ in stated:
        assert any(item.startswith(f"B: window {j}: {name} ") for item in found), (j, name)


@pytest.mark.slow
def test_windows_of_a_specification_are_those_of_the_section(honest):
    """Other times in the specification: the cheap claims say so."""
    document = copy.deepcopy(honest[0])
    document["result"]["spec"]["effective"]["tube"]["windows"] = ["0.3", "0.8"]
    claims = [item for item in of_certified(case_of(sealed(document))) if "windows follow" in item.name]
    assert len(claims) == 2
    assert not any(item.outcome(None).holds for item in claims)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda r: r["spec"]["effective"]["tube"].pop("windows"), "does not ask for"),
        (lambda r: r["tube"].update(coordinates=[["2", "0"], ["0", "2"]]), "beside coordinates"),
    ],
    ids=["without", "turned"],
)
def test_windows_that_cannot_be_are_refused(honest, change, why):
    """Each ended in an error of the program's own before: a part of a turned tube, a pad without a sample time."""
    document = copy.deepcopy(honest[0])
    change(document["result"])
    with pytest.raises(TubecertError, match=why):
        examine(sealed(document), BUDGET, memory={})


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.999, 1.001])
def test_no_level_is_beyond_that_of_the_whole_tube(honest, share):
    """Half-widths of the whole tube rest on d < dbar of the whole, however large the metric is in a window."""
    setting = case_of(honest[0]).setting
    course = SimpleNamespace(ground=SimpleNamespace(setting=setting))
    level = Fraction(float(setting.reach) * share)
    assert within_tube(course, level).holds is (share < 1)
