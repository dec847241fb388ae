"""The form of a certificate of a sampled loop: what is missing, unknown or of another kind is refused, with a code."""

import copy
import json

import pytest
from sampled_files import CART, FAMILY, SCALAR, changed, code_of, made, resealed, why_not
from small_loops import text_of

from tubecert.loop_design.certification import certify
from tubecert.sampled_loop.record import certificate_text
from tubecert.spec import load_text

pytestmark = pytest.mark.slow
SOMETIMES = {"settings", "lacks", "clearance", "inputs", "limits", "planned"}


def objects(value, path=()):
    if isinstance(value, dict):
        if path[:2] != ("spec", "effective"):
            yield path
        for key, item in value.items():
            yield from objects(item, (*path, key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from objects(item, (*path, i))


def at(document, path):
    place = document["result"]
    for key in path:
        place = place[key]
    return place


def test_every_object_is_closed():
    document = made(CART)
    for path in objects(document["result"]):
        more = copy.deepcopy(document)
        at(more, path)["novel"] = 1
        assert code_of(resealed(more)) == "TC603", path
        for key in set(at(document, path)) - SOMETIMES:
            less = copy.deepcopy(document)
            del at(less, path)[key]
            assert code_of(resealed(less)) == "TC603", (path, key)


TABLE = ("controller", "N", "rows", 0, 0)
WRONG = {
    "no hexadecimal number": (TABLE, "-3"),
    "another spelling": (TABLE, "-0x1.8p+1"),
    "no finite number": (TABLE, "nan"),
    "no finite number either": (TABLE, "inf"),
    "too large": (TABLE, "0x1.0000000000000p+9999"),
    "too small": (TABLE, "0x1.0000000000000p-9999"),
    "a number of JSON": (TABLE, -3.0),
    "a row too many": (("controller", "N", "rows"), lambda own: own * 2),
    "a column too many": (("controller", "N", "columns"), 2),
    "more memory than is read": (
        ("controller", "F"),
        {"columns": 65, "rows": [["0x0.0p+0"] * 65] * 65},
    ),
    "no lags": (("recipe", "lags"), 0),
    "too many lags": (("recipe", "lags"), 50_001),
    "no number of lags": (("recipe", "lags"), True),
    "a cut after the last lag": (("recipe", "cuts"), lambda own: [[10**6] for _ in own]),
    "cuts of fewer outputs": (("recipe", "cuts"), lambda own: own[1:]),
    "no pieces": (("recipe", "pieces"), 0),
    "too many pieces": (("recipe", "pieces"), 65),
    "no panels": (("recipe", "panels"), 0),
    "too many panels": (("recipe", "panels"), 65),
    "too many windows": (("recipe", "windows"), 4097),
    "parameters of another kind": (("recipe", "parameters"), "quick"),
    "no stage": (("tube",), []),
    "too many stages": (("tube",), lambda own: [{**own[0], "start": k} for k in range(65)]),
    "a stage that begins too late": (("tube", -1, "start"), 1_000_001),
    "stages in another order": (("tube",), lambda own: own[::-1]),
    "a first stage after the start": (("tube",), lambda own: own[1:]),
    "two stages at once": (("tube",), lambda own: [own[0], own[0]]),
    "a tube without an inside": (("tube", 0, "half_widths", "x"), 0),
    "a negative deviation": (("tube", 0, "deviations", "u"), -0.1),
    "a width that is no number": (("tube", 0, "half_widths", "x"), "nan"),
    "memory of another size": (("tube", 0, "memory"), [0.1]),
    "knots of no plan": (("planned",), {"t": [], "x": [], "u": [], "interpolation": "hold"}),
    "another verdict": (("verdict",), "proven"),
    "a controller of which nothing is known": (("spec", "effective", "controller"), "best"),
    "a delay of 65 samples": (("spec", "effective", "hardware", "delay"), "6.5"),
    "an f that depends on t": (("spec", "effective", "system", "f", 0), "0.5*x + t"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_has_no_place_is_refused(name):
    path, to = WRONG[name]
    document = made(SCALAR)
    if path[0] == "planned":
        document["result"]["planned"] = None
    assert code_of(changed(document, *path, to=to)) == "TC603"


def test_other_formats_are_told_apart():
    document = made(SCALAR)
    for format_, code in (
        ("tubecert-sampled-loop/2", "TC602"),
        ("tubecert-sampled-loop/0", "TC602"),
        ("tubecert-sampled-loop", "TC601"),
        ("tubecert-certificate/3", "TC603"),
    ):
        assert code_of({**document, "format": format_}) == code


def test_a_sampled_loop_is_refuted_by_where_its_plan_is_and_by_nothing_else():
    plan = "{kind: expressions, x: ['9*sin(t)'], u: ['9*cos(t)'], horizon: 2}"
    document = json.loads(
        certificate_text(certify(load_text(text_of(trajectory=plan, safe_set="{x: [-7, 7]}"))))
    )
    assert (document["result"]["verdict"], why_not(document)) == ("refuted", [])
    (lack,) = document["result"]["lacks"]
    lies = [("where", "u"), ("needed", 8.9), ("allowed", 6.0), ("at", 0.1), ("at", 2.1), ("kind", "start")]
    for key, to in lies:
        assert lack[key] != to
        assert why_not(changed(document, "lacks", 0, key, to=to))
    assert why_not(changed(document, "lacks", to=[]))
    planned = "{kind: ilqr, start: [0], target: [1], horizon: 2, knots: 3}"
    other = json.loads(certificate_text(certify(load_text(text_of(trajectory=planned)))))["result"]
    other["planned"]["x"][1] = ["9"]  # the knots are the certificate's own word
    kept = {key: other[key] for key in ("spec", "claim", "planned")}
    lie = {**kept, "verdict": "refuted", "lacks": [{**lack, "needed": 9.0, "allowed": 5000.0, "at": 1.0}]}
    assert why_not(resealed({**document, "result": lie}))
    for lie in (made(SCALAR), made(FAMILY)):
        del lie["result"]["controller"]
        assert why_not(
            changed({**lie, "result": {**lie["result"], "lacks": [lack]}}, "verdict", to="refuted")
        )
