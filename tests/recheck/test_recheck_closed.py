"""A certificate is read into closed types: what is absent, unknown or of another kind is refused, never a default.

Findings R1 (a plan without a horizon), R2 (names that shadow constants), R3 (unknown members), R9 (numbers).
"""

import copy
import json
import time
from fractions import Fraction

import pytest
import tampers
from hypothesis import assume, given
from hypothesis import strategies as st
from rechecked import OUTCOMES, certified, examine, failing, respecified, sealed, written
from shared import once
from systems import SMALL

from tubecert import pipeline, spec
from tubecert.errors import ExitCode, TubecertError
from tubecert.expression.text import number_text
from tubecert.recheck.document import _SHORT, Node
from tubecert.recheck.grammar import spelled
from tubecert.recheck.run import recheck

PLAN = "trajectory: {kind: equilibrium, at: [0, 0], input: [0]}"
START = "initial_state: {at: [0.05, 0]}"
MOVING = (
    'trajectory: {kind: expressions, x: ["0.1*sin(t)", "0.1*sin(t) + 0.1*cos(t)"], '
    'u: ["0.2*cos(t) - 0.3*sin(0.1*sin(t))"], horizon: 3}'
)
PLANNED = "trajectory: {kind: ilqr, start: [0.05, 0], target: [0, 0], horizon: 2, knots: 5, goal: false}"
REALS = st.floats(allow_nan=False, allow_infinity=False)
ROWS = "t,x,y,u\n0,0,0,0\n1,0,0,0\n2,0,0,0\n"


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    """A certificate for every kind of plan that moves, or could."""
    folder = tmp_path_factory.mktemp("plans")
    (folder / "plan.csv").write_text(ROWS, encoding="utf-8")
    path = folder / "small.yaml"
    text = SMALL.replace(PLAN, "trajectory: {kind: csv, file: plan.csv}")
    path.write_text(text, encoding="utf-8")
    options = pipeline.Options(conditions="distance")
    result = once(lambda: pipeline.certify(spec.load(path), options).to_json(), text, ROWS, options)
    moving = SMALL.replace(PLAN, MOVING).replace(START, "initial_state: {at: [0.05, 0.1]}")
    return {
        "expressions": certified(moving, conditions="distance"),
        "csv": written(result),
        "ilqr": certified(SMALL.replace(PLAN, PLANNED), bare=False),
    }


def refused(document, code="TC603"):
    """The message with which a document is refused."""
    with pytest.raises(TubecertError) as raised:
        examine(sealed(document), 100)
    assert raised.value.exit_code == ExitCode.INVALID
    assert raised.value.findings[0].code == code
    return raised.value.findings[0].message


def forever(document):
    """The attack of R1: no horizon, and everything that says so made consistent."""
    document = copy.deepcopy(document)
    result = document["result"]
    del result["spec"]["effective"]["trajectory"]["horizon"]
    result["claim"] |= {"horizon": None, "for_all_time": "autonomous"}
    result["assumptions"] = [
        {"id": "for_all_time"} if item["id"] == "up_to_horizon" else item for item in result["assumptions"]
    ]
    return document


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["expressions", "csv", "ilqr"])
def test_a_plan_that_moves_has_a_horizon(plans, kind):
    assert plans[kind]["result"]["verdict"] == "certified"
    assert "trajectory.horizon is missing" in refused(forever(plans[kind]))


@pytest.mark.slow
def test_a_plan_that_grows_is_no_plan_for_all_time(plans):
    document = forever(plans["expressions"])
    document["result"]["spec"]["effective"]["trajectory"]["x"][1] = "0.1*sin(t) + 0.1*cos(t) + 1000000*t**3"
    refused(document)


@pytest.mark.slow
def test_no_other_kind_takes_a_plan_that_moves(plans):
    document = forever(plans["expressions"])
    trajectory = document["result"]["spec"]["effective"]["trajectory"]
    x, u = trajectory.pop("x"), trajectory.pop("u")
    trajectory |= {"kind": "equilibrium", "at": x, "input": u}
    document["result"]["plan"]["kind"] = "equilibrium"
    refused(document)


@pytest.mark.slow
@pytest.mark.parametrize("horizon", [None, "0", "-3", "1/0", 3, "t", "1e400"])
def test_a_horizon_is_a_positive_number(plans, horizon):
    document = copy.deepcopy(plans["expressions"])
    document["result"]["spec"]["effective"]["trajectory"]["horizon"] = horizon
    refused(document)


@pytest.mark.slow
def test_a_longer_horizon_than_was_examined_is_found(plans):
    """Both the specification and the claim say 300 s: the tube leaves nothing, but knots end, and words differ."""

    def longer(effective):
        effective["trajectory"]["horizon"] = "300"

    refused(respecified(plans["csv"], longer))
    found = examine(respecified(plans["expressions"], longer), 200)
    assert any(name == "assumptions are complete" for name, _ in failing(found))


CLAIMS = {
    "id": "reachability",
    "horizon": "5",
    "for_all_time": "autonomous",
    "period": "pi",
    "domain": {"x": ["-1", "1"], "y": ["-1", "1.1"]},
    "start": {"at": ["0.05", "0.1"]},
    "uncertainty": "expression_or_bounds",
}


@pytest.mark.slow
@pytest.mark.parametrize("key", CLAIMS)
def test_the_claim_is_derived_again(key):
    document = certified(SMALL)
    assert document["result"]["claim"] == {
        "id": "tube",
        "horizon": None,
        "for_all_time": "periodic",
        "period": "2*pi",
        "domain": {"x": ["-1", "1"], "y": ["-1", "1"]},
        "start": {"at": ["0.05", "0"]},
        "uncertainty": "expression",
    }
    document["result"]["claim"][key] = CLAIMS[key]
    found = examine(sealed(document), 100)
    assert (
        "the claim is that of the specification",
        f"claim.{key} is not that of the specification",
    ) in failing(found)
    assert found.exit_code == ExitCode.NOT_CERTIFIED
    del document["result"]["claim"][key]
    assert f"claim.{key} is missing" in refused(document)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("h", "why", "period"),
    [
        ("0.1*sin(t) + 0.05*x", "periodic", "2*pi"),
        ("0.1*sin(2*pi*t/3) + 0.05*x", "periodic", "3"),
        ("0.1*sin(pi*t)", "periodic", "2"),
        ("0.05*sin(2*t) + 0.05*cos(3*t/4)*x", "periodic", "8*pi"),
        ("0.05*sin(4*t)", "periodic", "1/2*pi"),
        ("0.05*sin(2*t)", "periodic", "pi"),
        ("0.1 + 0.05*x", "autonomous", None),
        ("0.1 + 0/(2 + sin(t))", "periodic", "2*pi"),
    ],
)
def test_why_a_claim_is_for_all_time(h, why, period):
    document = certified(SMALL.replace("0.1*sin(t) + 0.05*x", h), conditions="distance")
    claim = document["result"]["claim"]
    assert (claim["for_all_time"], claim["period"], claim["horizon"]) == (why, period, None)
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_an_uncertainty_without_a_period_needs_a_horizon():
    def grows(effective):
        effective["uncertainty"]["h"] = ["0.1*sin(t) + 0.05*x + 0*t + 1e-9*t"]

    found = examine(respecified(certified(SMALL), grows), 200)
    assert ("the claim is that of the specification", True) in [
        (name, "horizon is needed" in why) for name, why in failing(found)
    ]


@pytest.mark.slow
def test_what_h_owes_is_owed_at_all_times():
    """0/(t - 2) is 0, and h does not depend on t but for what it owes: t = 2 lies within the horizon."""
    text = SMALL.replace(PLAN, PLAN.replace("}", ", horizon: 3}"))

    def owes(effective):
        effective["uncertainty"]["h"] = ["0.05*x + 0.1 + 0/(t - 2)"]

    document = certified(text.replace("0.1*sin(t) + 0.05*x", "0.1 + 0.05*x"), conditions="distance")
    assert failing(examine(document)) == []
    (found,) = failing(examine(respecified(document, owes), 2_000))
    assert found[0] == "f, B, W, h and the plan are smooth"


def renamed(document, old, new):
    """A state, wherever it occurs."""
    text = json.dumps(document["result"])
    for before, after in (
        (f'"{old}"', f'"{new}"'),
        (f"{old})", f"{new})"),
        (f" {old}", f" {new}"),
        (f"-{old}", f"-{new}"),
        (f"*{old}", f"*{new}"),
    ):
        text = text.replace(before, after)
    return {**document, "result": json.loads(text)}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["pi", "t", "True", "None", "sin", "norm", "lambda", "x y", "1x", "", "x*", "é", "_x"]
)
def test_a_name_that_means_something_else_is_refused(name):
    """R2: a state named `pi` was read as the constant."""
    document = certified(SMALL)
    document["result"]["spec"]["effective"]["system"]["states"][1] = name
    assert "may not be used" in refused(document) or name == "x"
    document = renamed(certified(SMALL), "y", name)
    refused(document)


def test_a_name_is_used_once():
    for place, index in (("states", 0), ("inputs", 0)):
        document = certified(SMALL)
        document["result"]["spec"]["effective"]["system"][place][index] = "y"
        assert "uses a name twice" in refused(document)


# -- keys ----------------------------------------------------------------------------------------------------------

# names of the user's, in objects whose keys they are: an unused parameter, the version of a library
THEIRS = ("certificate.result.spec.effective.system.parameters", "certificate.run.versions")


def objects(value, path="certificate"):
    """Every object with its path."""
    if isinstance(value, dict):
        yield path, value
    for key, member in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(member, (dict, list)):
            yield from objects(member, f"{path}.{key}" if isinstance(value, dict) else f"{path}[{key}]")


def examples(plans):
    return {**plans, "small": certified(SMALL), "moving": plans["expressions"]}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["expressions", "csv", "ilqr", "small"])
def test_an_unknown_member_is_refused_wherever_it_stands(plans, kind):
    """R3: constants.u_max and tube.x were ignored, and shown as facts."""
    document = copy.deepcopy(examples(plans)[kind])
    document["run"] = {"command": "tubecert", "versions": {"numpy": "2"}}
    document["result"]["overrides"] = {}
    seen = 0
    for path, holder in objects(document):
        if (
            path in THEIRS
            or not path.startswith("certificate.result")
            or path.count("[") > 1
            or ("[" in path and "[0]" not in path)
        ):
            continue
        holder["u_max"] = 5.0
        message = refused(document)
        assert "u_max" in message or "x*" in message, path
        del holder["u_max"]
        seen += 1
    assert seen > 60


def removable(document):
    """Every member that can be taken out one at a time, long lists once."""
    for path, holder in objects(document):
        beside = path.startswith(("certificate.notes", "certificate.run"))  # not examined
        if beside or path.count("[") > 1 or ("[" in path and "[0]" not in path):
            continue
        for key in list(holder):
            yield f"{path}.{key}".removeprefix("certificate."), holder, key


HARMLESS = (
    "result.reasons[0].",  # an explanation less
    "result.spec.effective.system.parameters.",
    "result.spec.effective.system.units.",
    "result.spec.effective.simulation",
    "result.spec.effective.obstacles",
)


# what a kind of plan may read in a way of its own; all else is taken out of the first certificate that has it
OF_THE_PLAN = tuple(
    f"result.{section}" for section in ("assumptions", "claim", "plan", "spec.effective.trajectory")
)
MISSING = ["expressions", "csv", "ilqr", "small"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", MISSING)
def test_a_member_that_is_missing_is_refused(plans, kind):
    """No key has a default that could help a claim."""
    document, memory = copy.deepcopy(examples(plans)[kind]), {}
    before = {
        path
        for other in MISSING[: MISSING.index(kind)]
        for path, _, _ in removable(examples(plans)[other])
        if not path.startswith(OF_THE_PLAN)
    }
    examine(document, 2_000, memory)
    accepted, seen, codes = [], 0, set()
    for path, holder, key in list(removable(document)):
        if path in before:
            continue
        value = holder.pop(key)
        seen += 1
        try:
            found = examine(
                sealed(document) if "hash" not in key else document, 2_000, memory, to_first_failure=True
            )
            if found.exit_code == ExitCode.CERTIFIED and not path.startswith(HARMLESS):
                accepted.append(path)
        except TubecertError as error:
            codes.add(error.findings[0].code)
        holder[key] = value
    assert accepted == []
    assert "TC603" in codes
    assert ("TC601" in codes) == (not before)  # what makes it a certificate at all
    assert seen > (15 if before else 150)


# -- numbers -------------------------------------------------------------------------------------------------------

WRITTEN = [
    *tampers.EXTREME, "1e-310", "1" + "0" * 400, "Infinity", "true", "null", '"1e400"', "[1]", "{}", '"pi"', '" "',
    '"(((((1)))))' + "*9" * 3000 + '"', '"0/0"', '"0x1"',
]  # fmt: skip
PLACES = [
    ("tube", "rho"), ("constants", "h", "above"), ("constants", "h", "below"),
    ("distance", "least_adaptation", "bandwidth"), ("conditions_26", "predictor_gain"),
    ("spec", "effective", "tube", "epsilon"), ("spec", "effective", "metric", "rate"),
    ("spec", "effective", "initial_state", "at"), ("proof", "distance", "speed"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES, ids=".".join)
def test_a_number_that_is_none_is_refused_at_once(place):
    """R9: 1e-999999999 hung, integers of 4000 digits and 1e308 were internal errors."""
    document = certified(SMALL)
    examine(document, 500)
    holder, memory = document["result"], OUTCOMES[500]
    for key in place[:-1]:
        holder = holder[key]
    if isinstance(holder[place[-1]], list):
        holder = holder[place[-1]]
        place = (0,)
        if isinstance(holder[0], list):
            holder = holder[0]
    for other in WRITTEN:
        holder[place[-1]] = "@"
        text = json.dumps(sealed(document)).replace('"@"', other)
        start = time.process_time()
        try:
            code = recheck(text, "file.json", 500, memory=memory, to_first_failure=True).exit_code
        except TubecertError as error:
            code = error.exit_code
        assert code != ExitCode.CERTIFIED, other
        assert time.process_time() - start < 1, other


def test_a_number_is_the_one_that_is_hashed():
    """Digits beyond those of the float would be read here and not be covered by the hash."""
    document = certified(SMALL)
    text = json.dumps(document)
    rho = document["result"]["tube"]["rho"]
    assert recheck(text, "file.json", 10).claims[0].outcome.holds
    with pytest.raises(TubecertError):
        recheck(text.replace(f'"rho": {rho}', f'"rho": {rho}0000000000000001'), "file.json", 10)


OTHERWISE = [
    "-+0.5", "-.5", "-0.50", "-00.5", "-1/2", "-5e-1", " -0.5", "(-0.5)", "--(-0.5)", "-0.5*1", "-0.5 ",
]  # fmt: skip


@pytest.mark.parametrize("other", OTHERWISE)
@pytest.mark.parametrize("place", [("claim", "domain"), ("spec", "effective", "safe_set")], ids=".".join)
def test_a_number_has_one_spelling(place, other):
    """What a reader sees as the claim needs no rule of arithmetic to be understood."""
    document = copy.deepcopy(certified(SMALL))
    holder = document["result"]
    for key in place:
        holder = holder[key]
    name = next(iter(holder))
    holder[name][0] = "-0.5"
    if place[0] == "claim":
        document["result"]["spec"]["effective"]["safe_set"][name][0] = "-0.5"
    examine(sealed(document), 1, to_first_failure=True)
    holder[name][0] = other
    assert "the number -0.5" in refused(document)


@given(
    st.fractions() | st.decimals(allow_nan=False, allow_infinity=False).map(Fraction) | REALS.map(Fraction)
)
def test_the_spelling_is_the_one_that_is_written(value):
    """Whatever the producer writes is read, as the same number."""
    assume(value == 0 or Fraction(1, 10**300) <= abs(value) <= 10**300)
    assert Node(number_text(value), "place").exact() == value


@pytest.mark.slow
@given(st.from_regex(_SHORT, fullmatch=True))
def test_a_text_that_is_not_spelled_again_is_the_one_spelling(text):
    assert spelled(Fraction(text)) == text
