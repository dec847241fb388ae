"""Certificates of sampled loops that claim too much, with hashes made right: not one is confirmed."""

import copy
import re

import pytest
from sampled_files import (
    CART,
    FAMILY,
    FAR,
    PAIR,
    SCALAR,
    SPRING,
    SWING,
    changed,
    code_of,
    examine,
    made,
    resealed,
    why_not,
)

from tubecert.errors import ExitCode
from tubecert.spec import load_text
from tubecert.spec.canonical import canonical


@pytest.mark.slow
@pytest.mark.parametrize("text", [SCALAR, CART, SWING, FAMILY, FAR, SPRING, PAIR])
def test_what_is_certified_is_confirmed(text):
    document = made(text)
    assert document["result"]["verdict"] == "certified"
    found = examine(document)
    assert (found.failing, found.exit_code) == (None, ExitCode.CERTIFIED)


def narrower(value):
    return round(float(value) * 0.98, 9)


def hexed(change):
    return lambda text: float(change(float.fromhex(text))).hex()


def spec(*path):
    return ("spec", "effective", *path)


N = ("controller", "N", "rows", 0, 0)
LIES = {
    "W x .98": (SCALAR, ("tube", 0, "half_widths", "x"), narrower),
    "W x .94, later": (SCALAR, ("tube", -1, "half_widths", "x"), lambda W: narrower(W) * 0.96),
    "W x .98, of another state": (CART, ("tube", 0, "half_widths", "p"), narrower),
    "U x .98": (CART, ("tube", 0, "deviations", "F"), narrower),
    "Z x .98": (CART, ("tube", 0, "memory", 0), narrower),
    "the long run from the start on": (SCALAR, ("tube",), lambda own: [{**own[-1], "start": 0}]),
    "a stage that begins too early": (SCALAR, ("tube", 1, "start"), 1),
    "W x .98, of two inputs": (PAIR, ("tube", 0, "half_widths", "q"), narrower),
    "U x .98, of two inputs": (PAIR, ("tube", -1, "deviations", "b"), narrower),
    "a larger ball of starts": (PAIR, spec("initial_state", "within"), "0.055"),
    "a wider range, of two inputs": (PAIR, spec("system", "parameters", "c"), ["0.93", "1.07"]),
    "more wind, of two inputs": (PAIR, spec("disturbance", "bound"), "0.055"),
    "an input on another one's place": (PAIR, ("controller", "M", "rows"), lambda own: own[::-1]),
    "noise twice": (SCALAR, spec("hardware", "noise", "x"), "0.02"),
    "noise of a length twice": (CART, spec("hardware", "noise"), "0.002"),
    "wind of a component twice": (SCALAR, spec("disturbance", "bound", 0), "0.4"),
    "wind of a length twice": (CART, spec("disturbance", "bound"), "0.2"),
    "one sample more of delay": (SCALAR, spec("hardware", "delay"), "0.14"),
    "one sample more of a long delay": (CART, spec("hardware", "delay"), "0.17"),
    "a start that is further away": (SCALAR, spec("initial_state", "at", 0), "0.33"),
    "a larger box of starts": (CART, spec("initial_state", "box", "p"), ["-0.1", "0.14"]),
    "K's sign": (SCALAR, N, hexed(lambda x: -x)),
    "a digit of K": (SCALAR, N, hexed(lambda x: x * 1.25)),
    "a digit of M": (CART, ("controller", "M", "rows", 0, 0), hexed(lambda x: x * 1.5)),
    "a digit of F": (CART, ("controller", "F", "rows", 0, 0), hexed(lambda x: x * 1.125)),
    "a digit of G": (CART, ("controller", "G", "rows", 0, 1), hexed(lambda x: x * 1.5)),
    "no number of single precision": (SCALAR, N, hexed(lambda x: x * (1 + 2**-40))),
    "no controller was asked for": (SCALAR, spec("controller"), "none"),
    "a faster h": (CART, spec("uncertainty", "h", 0), "0.2*sin(2*t)"),
    "a steeper h": (SWING, spec("uncertainty", "h", 0), "0.05*sin(3*t) + 0.06*q"),
    "a larger h": (CART, spec("uncertainty", "h", 0), "0.3*sin(t)"),
    "a wider range of a parameter": (SWING, spec("system", "parameters", "c"), ["0.85", "1.15"]),
    "a wider range of the mass on a spring": (SPRING, spec("system", "parameters", "m"), ["0.88", "1.12"]),
    "another plant": (SCALAR, spec("system", "f", 0), "0.6*x"),
    "more that is not linear": (CART, spec("system", "f", 1), "0.4*p**2"),
    "a start within more": (FAMILY, spec("initial_state", "within"), "0.12"),
    "plans that miss more": (FAMILY, spec("trajectory", "defect"), "0.03"),
    "inputs of plans that are faster": (FAMILY, spec("trajectory", "input_rate", "a"), "4"),
    "plans that are faster": (FAMILY, spec("trajectory", "x", "v"), ["-1.5", "1.5"]),
    "a larger h that may jump": (FAMILY, spec("uncertainty", "bounds", "h"), "0.12"),
    "another plan": (SWING, spec("trajectory", "x", 0), "sin(t + 0.02)"),
    "a plan that is not over when it begins again": (SWING, spec("trajectory", "horizon"), "6"),
    "a horizon that is not claimed": (SWING, spec("trajectory", "afterwards"), "nothing"),
    "a claim past the end": (SWING, ("claim", "horizon"), 7),
    "another hold": (SWING, ("claim", "hold"), "middle"),
    "another end": (SWING, ("claim", "afterwards"), "rest"),
    "one lag": (SCALAR, ("recipe", "lags"), 1),
    "few lags": (CART, ("recipe",), lambda own: {**own, "lags": 20, "cuts": [[0], [20], [0], [20]]}),
    "cuts of no signal": (CART, ("recipe", "cuts"), lambda own: [[] for _ in own]),
    "cuts of one signal more": (CART, ("recipe", "cuts"), lambda own: [[*row, 0] for row in own]),
    "parameters that jump": (SWING, ("recipe", "parameters"), "sudden"),
    "a set that is too small": (SCALAR, spec("safe_set", "x"), ["-0.31", "0.4"]),
    "an input out of its range": (SCALAR, ("inputs", 0, "range"), ["-0.9", "0.9"]),
    "an input above its range": (SCALAR, ("inputs", 0, "range"), ["-3", "0.9"]),
    "an input below its range": (SCALAR, ("inputs", 0, "range"), ["-0.9", "3"]),
    "an input that goes above its range on its way": (SWING, ("inputs", 0, "range"), ["-9", "1.2"]),
    "an input that goes below its range on its way": (SWING, ("inputs", 0, "range"), ["-1.2", "9"]),
    "an input out of its limits": (SCALAR, spec("limits", "u"), ["-0.9", "3"]),
    "an input left out": (SCALAR, ("inputs",), []),
    "an obstacle in the way": (CART, spec("obstacles", 0, "disc", "center"), ["0.5", "0.5"]),
    "an edge in the way": (CART, spec("obstacles", 1, "polygon", 0), ["0.1", "0"]),
    "an obstacle all around": (CART, spec("obstacles", 1, "polygon"), [["-5", "-5"], ["5", "-5"], ["0", "8"]]),
    "an obstacle left out": (CART, ("clearance",), lambda own: own[:1]),
    "an obstacle that is not cleared": (CART, ("clearance", 0, "verdict"), "undecided"),
    "a wish that is not met": (CART, spec("tube", "half_widths", "p"), "0.2"),
    "a wish for an output that is not met": (CART, spec("tube", "half_widths", "far"), "0.4"),
    "something lacks": (SCALAR, ("lacks",), [{"kind": "wish"}]),
    "A of nothing": (SCALAR, ("nominal", "A", "rows", 0, 0), "0x0.0p+0"),
    "B of nothing": (SCALAR, ("nominal", "B", "rows", 0, 0), "0x0.0p+0"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", LIES)
def test_a_lie_is_not_confirmed(name):
    text, path, to = LIES[name]
    document = made(text)
    if path[0] == "lacks":
        document["result"]["lacks"] = []
    assert why_not(changed(document, *path, to=to))


@pytest.mark.slow
def test_a_bound_that_is_too_large_is_told_against_the_claim():
    found = examine(changed(made(SCALAR), "tube", -1, "half_widths", "x", to=lambda W: W / 1.1))
    assert re.fullmatch(r"sample \d+: the bound is 1\.\d+ of what is claimed", found.failing.outcome.why)


@pytest.mark.slow
@pytest.mark.parametrize("ends", [("-0.9", "3"), ("-3", "0.9")])
def test_limits_that_are_told_twice_are_kept_on_both_sides(ends):
    lie = changed(made(SCALAR), "inputs", 0, "limits", to=list(map(float, ends)))
    assert why_not(changed(lie, *spec("limits", "u"), to=list(ends)))


def retold(text: str, before: str, after: str, *, slow: bool = True) -> dict:
    """The proof of an easier question, told as one of a harder one."""
    document, easier = made(text), made(text.replace(before, after), base=text, slow=slow)
    assert easier["result"]["verdict"] == "certified"
    assert why_not(easier) == []
    lie = copy.deepcopy(easier)
    for key in ("spec", "claim"):
        lie["result"][key] = document["result"][key]
    return resealed(lie)


EASIER = {
    "held, and proven continuous": (SWING, "hold: left", "hold: continuous"),
    "at the left end, and proven in the middle": (SWING, "hold: left", "hold: middle"),
    "by a range, and proven for its middle": (SWING, "c: [0.9, 1.1]", "c: [0.999, 1.001]"),
    "with slope, and proven without": (SWING, " + 0.02*q", ""),
    "far away in single precision, and proven in double": (FAR, "arithmetic: single", "arithmetic: double"),
    "with an h that may jump, and proven for a small one": (FAMILY, "h: 0.1}", "h: 0.01}"),
    "late, and proven at once": (SCALAR, "delay: 0.04", "delay: 0"),
    "two samples late, and proven with one": (CART, "delay: 0.12", "delay: 0.06"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EASIER)
def test_the_proof_of_an_easier_question_is_none_of_a_harder_one(name):
    assert why_not(retold(*EASIER[name]))


@pytest.mark.slow
def test_parameters_that_may_jump_are_proven_for_all_of_their_range():
    assert why_not(retold(SWING, "c: [0.9, 1.1]", "c: [0.99, 1.01]", slow=False))


def by_hand(f: str, stages: list, gain: float, *, start: str, delay: str = "0", lags: int = 1) -> dict:
    """x' = f with u held for 1 s, delta = gain e, from a point, with stages (start, W, U)."""
    text = SCALAR.replace('f: ["0.5*x"]', f'f: ["{f}"]').replace("at: [0.3]", f"at: [{start}]")
    text = text.replace("sample_time: 0.1, delay: 0.04, noise: {x: 0.01}", f"sample_time: 1, delay: {delay}")
    text = text.replace("disturbance: {E: [[1]], bound: [0.2]}\n", "").replace("[-3, 3]", "[-9, 9]")
    document = made(SCALAR)
    result = document["result"]
    result["spec"]["effective"] = canonical(load_text(text))
    slope = float(f.partition("*")[0])
    result["nominal"] |= {"A": {"columns": 1, "rows": [[slope.hex()]]}, "E": {"columns": 0, "rows": [[]]}}
    result["controller"]["N"]["rows"] = [[float(gain).hex()]]
    result["tube"] = [
        {"start": k, "half_widths": {"x": W}, "deviations": {"u": U}, "memory": []} for k, W, U in stages
    ]
    result["inputs"] = [{"input": "u", "range": [-8, 8], "limits": [-9, 9]}]
    result["recipe"] |= {"lags": lags, "cuts": [[], []], "pieces": 4, "panels": 2}
    return resealed(document)


@pytest.mark.slow
def test_what_is_left_of_the_past_is_not_forgotten():
    """x' = .1 x without any signal: every sum is 0, and only the tail says that it grows."""
    for lags in (1, 5, 20):
        assert why_not(by_hand("0.1*x", [(0, 0.02, 0.01)], 0.0, start="0.01", lags=lags))
    assert why_not(by_hand("-0.1*x", [(0, 0.02, 0.01)], 0.0, start="0.01", lags=20)) == []


@pytest.mark.slow
def test_commands_on_their_way_are_those_of_their_own_stage():
    """x' = -x + u, Ts = 1, two late, delta = -.875 e, e(0) = -1: what is sent at 0 acts from 2 on, |e(3)| = .503."""
    assert why_not(by_hand("-1*x", [(0, 1.1, 0.88), (1, 0.38, 0.35)], -0.875, start="-1", delay="2"))
    assert (
        why_not(by_hand("-1*x", [(0, 1.02, 0.31), (1, 0.6, 0.2)], -0.25, start="-1", delay="1", lags=6)) == []
    )


@pytest.mark.slow
def test_the_first_command_is_one():
    """From 1 with delta = -e/2: only the first command is larger than .3."""
    assert why_not(by_hand("-1*x", [(0, 1.2, 0.51)], -0.5, start="1", lags=9)) == []
    assert why_not(by_hand("-1*x", [(0, 1.2, 0.3)], -0.5, start="1", lags=9))


@pytest.mark.slow
def test_a_start_outside_of_the_long_run_is_followed():
    """From 1 x' = -x + u decays: inside at 0 and in the long run, and yet not at sample 1."""
    assert why_not(by_hand("-1*x", [(0, 1.01, 0.3), (9, 0.02, 0.01)], -0.25, start="1", lags=8)) == []
    assert why_not(by_hand("-1*x", [(0, 1.01, 0.3), (1, 0.02, 0.01)], -0.25, start="1", lags=8))


@pytest.mark.slow
def test_a_certificate_that_is_not_certified_certifies_nothing():
    document = made(SCALAR)
    found = examine(changed(document, "verdict", to="undecided"))
    assert (found.stated, found.exit_code, len(found.claims)) == ("undecided", ExitCode.UNDECIDED, 2)
    assert code_of(changed(document, "verdict", to="refuted")) == "TC603", "it does not say by what"
    bare = copy.deepcopy(document)
    bare["result"] = {key: document["result"][key] for key in ("spec", "claim")} | {"verdict": "undecided"}
    assert examine(resealed(bare)).exit_code is ExitCode.UNDECIDED


@pytest.mark.slow
def test_a_hash_that_is_not_that_of_the_result_contradicts():
    document = made(SCALAR)
    document["hash"] = "sha256:0"
    assert examine(document).exit_code is ExitCode.NOT_CERTIFIED


@pytest.mark.slow
def test_what_is_not_examined_in_time_is_undecided_and_progress_is_told():
    document, heard = made(CART), []
    late = examine(document, seconds=1e-9)
    assert late.exit_code is ExitCode.UNDECIDED
    examine(document, report=lambda *told: heard.append(told))
    assert {told[0] for told in heard} >= {"|p - p*| inside the tube", "what is added to F"}
    assert any(told[3] > 0 and 0 < told[4] < 1 for told in heard)


@pytest.mark.slow
@pytest.mark.parametrize(("until", "ends"), [("2.9", True), ("2.90001", False)])
def test_a_stage_begins_while_the_plan_lasts(until, ends):
    """The last stage of the tube begins at 2.9 s: no row is about it where nothing is claimed from there on."""
    document = made(SCALAR)
    assert document["result"]["tube"][-1]["start"] == 29
    finite = changed(
        document, *spec("trajectory"), to=lambda own: own | {"horizon": until, "afterwards": "nothing"}
    )
    finite["result"]["claim"]["horizon"] = float(until)
    if ends:
        finite["result"]["tube"][-1]["half_widths"]["x"] = 1e-9
    assert why_not(resealed(finite)) == ["the plan is that of the specification, and lasts"] * ends
