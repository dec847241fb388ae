"""Windows of certificate H in recheck: honest ones are confirmed, forged ones are not."""

from __future__ import annotations

import copy

import proven
import pytest
from rechecked import case_of, certified, examine, failing, sealed
from systems import IN_WINDOWS

from tubecert.errors import ExitCode, TubecertError
from tubecert.recheck.claims import of_certified

CHEAP = ("H: windows follow", "H: the machine is", "H: the recipe is")
BUDGET = 4000  # boxes for each claim
INSIDE = "H: d stays below its level in each of 3 windows"
H, PROOF, SPEC = ("hardware",), ("proof", "hardware"), ("spec", "effective")


@pytest.fixture(scope="module")
def honest():
    """A certificate with three windows in which every term is alive, and outcomes that forged ones share with it."""
    document, memory = proven.proven(IN_WINDOWS, bare=True, conditions="hardware"), {}  # as others make it
    assert document["result"]["verdict"] == "certified", document["result"]["reasons"]
    found = examine(document, BUDGET, memory=memory)
    assert failing(found) == []
    assert found.exit_code == ExitCode.CERTIFIED
    names = [item.name for item in found.claims]
    assert INSIDE in names
    for j in (1, 2, 3):
        for what in (
            "half-width of x <=",
            "half-width of y <=",
            "u in",
            "drift_on_plan <=",
            "feedback_slope <=",
        ):
            assert any(name.startswith(f"H: window {j}: {what}") for name in names)
    return document, memory


def at(result, path):
    for key in path:
        result = result[key]
    return result


def scaled(factor, *path):
    """A number of the certificate times a factor."""

    def change(result):
        holder = at(result, path[:-1])
        holder[path[-1]] = holder[path[-1]] * factor

    return change


def put(value, *path):
    def change(result):
        at(result, path[:-1])[path[-1]] = value

    return change


def gone(*path):
    def change(result):
        del at(result, path[:-1])[path[-1]]

    return change


def swapped(*keys):
    """Windows 1 and 3 with each other's numbers."""

    def change(result):
        own = result["hardware"]["windows"]
        for key in keys:
            own[0][key], own[2][key] = own[2][key], own[0][key]

    return change


def level(j, factor):
    """The level of a window, wherever it stands."""

    def change(result):
        own, proof = result["hardware"], result["proof"]["hardware"]
        own["windows"][j]["level"] *= factor
        proof["windows"][j]["level"] = own["windows"][j]["level"]
        own["level"] = proof["level"] = max(item["level"] for item in own["windows"])

    return change


def number(j, key, factor):
    """A number of the recipe of a window, and that of the whole with it."""

    def change(result):
        proof = result["proof"]["hardware"]
        proof["windows"][j][key] *= factor
        proof[key] = max(item[key] for item in proof["windows"])

    return change


def shifted(result):
    """A boundary at another time than the specification says."""
    own = result["hardware"]["windows"]
    own[0]["end"] = own[1]["begin"] = 0.31


def dropped(result):
    """No second window, and the first one until the third."""
    own = result["hardware"]["windows"]
    own[0]["end"] = own[2]["begin"]
    del own[1], result["proof"]["hardware"]["windows"][1]


def short(result):
    """A window that is shorter than what it looks back at."""
    result["spec"]["effective"]["tube"]["windows"] = ["0.3", "0.302", "0.9"]
    for windows in (result["hardware"]["windows"], result["proof"]["hardware"]["windows"]):
        windows.insert(1, copy.deepcopy(windows[1]))
    own = result["hardware"]["windows"]
    own[1]["end"] = own[2]["begin"] = 0.302


def respecified(windows):
    """Other windows in the specification than in the section."""
    return put(windows, *SPEC, "tube", "windows")


def both(*changes):
    def change(result):
        for own in changes:
            own(result)

    return change


CONSTANTS = (
    "drift_slope_metric",
    "feedback_slope",
    "feedback_gain",
    "plan_speed",
    "wind_push",
    "wind_size",
    "h",
)
W = (*H, "windows")
STRUCTURAL = {
    "no windows in the section": gone(*W),
    "no windows in the recipe": gone(*PROOF, "windows"),
    "no windows at all": both(gone(*W), gone(*PROOF, "windows")),
    "no windows in the specification": gone(*SPEC, "tube", "windows"),
    "other windows in the specification": respecified("3"),
    "windows in the specification that go back": respecified(["0.9", "0.3"]),
    "windows in the specification beyond the horizon": respecified(["0.3", "2.5"]),
    "no window": put([], *W),
    "a window dropped": dropped,
    "a boundary shifted": shifted,
    "a gap": put(0.32, *W, 1, "begin"),
    "the last one ends early": put(1.9, *W, 2, "end"),
    "the first one begins late": put(0.01, *W, 0, "begin"),
    "a window shorter than its pad": short,
    "a key that is not known": put(1, *W, 1, "pad"),
    "a key that is missing": gone(*W, 1, "supremum"),
    "a text for a number": put("many", *W, 1, "supremum"),
    "no number": put(None, *W, 1, "level"),
    "a list for an object": put([], *W, 1, "constants"),
    "a constant of no window": put(1.0, *W, 1, "constants", "h_initial"),
    "a constant that is not known": put(1.0, *W, 1, "constants", "speed"),
    "a constant that is added, and too small": put(1e-9, *W, 1, "constants", "noise_explained"),
    "a constant that is no number": put(None, *W, 1, "constants", "h"),
    "a state without a half-width": gone(*W, 1, "half_widths", "x"),
    "an input without a range": gone(*W, 1, "inputs", "u"),
    "a key of the recipe that is missing": gone(*PROOF, "windows", 1, "floor"),
    "a key of the recipe that is not known": put(1.0, *PROOF, "windows", 1, "omega"),
    "a prediction without prediction": put(0.1, *PROOF, "windows", 1, "prediction"),
    "one recipe less": gone(*PROOF, "windows", 2),
    "a tube beyond the tube": put(0.31, *W, 1, "tube"),
    "no tube": put(0, *W, 1, "tube"),
    "a curve beside windows": put([{"sample_time": 0.002, "level": 0.06}], *H, "curve"),
}
NUMERIC = {
    "levels swapped": swapped("level"),
    "constants of another window": swapped("constants"),
    "tubes swapped": swapped("tube", "constants"),
    "half-widths swapped": swapped("half_widths"),
    "inputs swapped": swapped("inputs"),
    "the pad of a slower machine": put("0.0021", *SPEC, "hardware", "sample_time"),
    **{f"level of window {j + 1}": level(j, 0.97) for j in range(3)},
    **{f"level of window {j + 1} in the section": scaled(0.97, *W, j, "level") for j in range(3)},
    **{f"supremum of window {j + 1}": scaled(0.99, *W, j, "supremum") for j in range(3)},
    **{f"radius of window {j + 1}": scaled(0.97, *W, j, "radius") for j in range(3)},
    **{f"width in window {j + 1}": scaled(0.97, *W, j, "half_widths", "x") for j in range(3)},
    "width of an output": scaled(0.97, *W, 1, "half_widths", "s"),
    "an output without a half-width": gone(*W, 1, "half_widths", "s"),
    **{f"tube of window {j + 1}": scaled(0.95, *W, j, "tube") for j in range(3)},
    **{
        f"{end} end of u in window {j + 1}": put(0.0, *W, j, "inputs", "u", k)
        for j in range(3)
        for k, end in enumerate(("lower", "upper"))
    },
    **{
        f"{key} of window {j + 1}": number(j, key, factor)
        for key, factor in (("speed", 0.9), ("bias", 0.97), ("ripple", 0.97), ("floor", 30.0))
        for j in range(3)
    },
    "the whole radius": scaled(0.97, *H, "radius"),
    "a whole half-width": scaled(0.97, *H, "half_widths", "y"),
    "the whole range of u": put(0.1, *H, "inputs", "u", 1),
    "the speed of the whole": scaled(1.1, *PROOF, "speed"),
    "a budget": scaled(0.9, *H, "budget", "bias"),
    "the margin": put([0.01, None], *H, "margin"),
    "the margin of the level": put([0.01, None], *H, "level_margin"),
    "the ultimate radius": scaled(0.9, *H, "ultimate_radius"),
}


def refused(document, memory) -> bool:
    """Whether a forged certificate is not confirmed."""
    try:
        found = examine(sealed(document), BUDGET, memory=memory, to_first_failure=True)
    except TubecertError:
        return True
    return found.exit_code != ExitCode.CERTIFIED


def contradicted(document) -> bool:
    """The same where the specification changed, by what is cheap: the times of windows, and the machine."""
    try:
        claims = of_certified(case_of(document))
        return any(not item.outcome(None).holds for item in claims if item.name.startswith(CHEAP))
    except TubecertError:
        return True


@pytest.mark.slow
def test_rounding_in_windows_is_confirmed_by_du_of_the_whole_tube_alone():
    document = certified(
        IN_WINDOWS.replace("hardware: {", "hardware: {arithmetic: double, "), conditions="hardware"
    )
    own = document["result"]["hardware"]
    assert document["result"]["verdict"] == "certified"
    assert not any("feedback_gain" in window["constants"] for window in own["windows"])

    def holds(other):
        (claim,) = (item for item in of_certified(case_of(sealed(other))) if item.name == INSIDE)
        return claim.outcome(None).holds

    assert holds(document)
    gain = document["result"]["constants"]["feedback_gain"]["above"]
    for change in (
        put(gain, *W, 2, "constants", "feedback_gain"),
        scaled(1e9, *PROOF, "rounding", 0, "estimate"),
        scaled(1e9, *PROOF, "rounding", 0, "feedback"),
    ):
        forged = copy.deepcopy(document)
        change(forged["result"])
        assert not holds(forged)


@pytest.mark.slow
@pytest.mark.parametrize("change", [*STRUCTURAL, *NUMERIC])
def test_no_change_is_confirmed(honest, change):
    document, memory = copy.deepcopy(honest[0]), honest[1]
    (STRUCTURAL | NUMERIC)[change](document["result"])
    assert sealed(document)["hash"] != honest[0]["hash"], "nothing was changed"
    same = document["result"]["spec"]["effective"] == honest[0]["result"]["spec"]["effective"]
    assert refused(document, memory) if same else contradicted(sealed(document))


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSTANTS)
def test_no_constant_of_a_window_may_be_less_than_it_is(honest, name):
    document, memory = copy.deepcopy(honest[0]), honest[1]
    stated = [
        (j, own["constants"])
        for j, own in enumerate(document["result"]["hardware"]["windows"], start=1)
        if name in own["constants"]
    ]
    assert stated, name
    for _, constants in stated:
        constants[name] *= 0.9
    found = {name for name, _ in failing(examine(sealed(document), budget=4000, memory=memory))}
    for j, _ in stated:
        assert any(item.startswith(f"H: window {j}: {name} <=") for item in found), (j, name)


@pytest.mark.slow
def test_what_is_sharper_by_a_larger_pad_is_not_lost(honest):
    """What a window states need not be sharp: a larger constant that still serves is confirmed."""
    document, memory = copy.deepcopy(honest[0]), honest[1]
    own = document["result"]["hardware"]["windows"][1]["constants"]
    own["plan_speed"] *= 1 + 1e-9
    assert not refused(document, memory)
