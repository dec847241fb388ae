"""Every key of a specification and of a certificate has a claim that examines it, or is said to have none (R21, R24).

The table (`recheck.examines`) is walked against certificates, against the JSON Schemas and against what is examined: a
key without a row fails, a row without a key fails, and so does a row that names a claim which nobody makes.
"""

import copy
import json
from functools import cache
from pathlib import Path

import proven
import pytest
from rechecked import certified, examine, sealed
from systems import SMALL

import tubecert
from tubecert.certificate.notes import NOTES, joined, split
from tubecert.errors import TubecertError
from tubecert.recheck.document import Node
from tubecert.recheck.examines import EXAMINED, FILE, NOTHING, UNPROVEN, met
from tubecert.records import FormError

SCHEMAS = Path(tubecert.__file__).parent / "schemas"
SHIPPED = ("three_state", "two_state", "state_dependent_input", "two_state_orbit")
GIVEN = 'metric: {rate: 0.8, dual_metric: [[1, "-0.3"], ["-0.3", 2]]}'
PLAN = "{kind: equilibrium, at: [0, 0], input: [0]}"
OTHERS = {
    "half-widths": SMALL.replace(
        "tube: {epsilon: 0.2, rho_a: 0.1}", "tube: {half_widths: {x: 0.5}, gap: auto}"
    ).replace("  B: ", "  outputs: {s: x - 0.5*y}\n  units: {x: m}\n  B: "),
    "a wind": SMALL + 'disturbance: {E: [["0.1"], ["1"]], bound: 0.01, rate: 0.1}\nlimits: {u: [-9, 9]}\n',
    "a family": SMALL.replace(
        PLAN, "{kind: any, x: {x: [-0.1, 0.1], y: [-0.1, 0.1]}, u: {u: [-0.1, 0.1]}, defect: 0.01}"
    ).replace("{at: [0.05, 0]}", "{within: 0.01}"),
    "declared": SMALL.replace('{h: ["0.1*sin(t) + 0.05*x"]}', "{bounds: {h: 0.15, h_x: 0.05, h_t: 0.1}}"),
    "a box, a disc": SMALL.replace("{at: [0.05, 0]}", "{box: {x: [-0.05, 0.05], y: [0, 0]}}")
    + "obstacles: [{states: [x, y], disc: {center: [0.9, 0.9], radius: 0.05}, decide: false}]\n",
    "a parameter": SMALL.replace("-x + y", "-k*x + y").replace(
        "  f: ", "  parameters: {k: [0.9, 1.1]}\n  f: "
    ),
    "smooth": SMALL.replace("A_m: -10", "A_m: -10, projection: {smooth: 0.1}")
    + 'conditions: {decides: "B"}\nexpect: {verdict: certified}\n',
    "synthesised": SMALL.replace(GIVEN, "metric: {synthesise: {rate: 0.5}}"),
    "bounds of M": SMALL.replace("rate: 0.8,", "rate: 0.8, bounds: {lower: 0.4, upper: 1.2},"),
}
# what no certificate in continuous time has
OF_A_MACHINE = ("hardware.", "trajectory.afterwards", "trajectory.input_rate")
# keys of a file that stand in the canonical form under other names, as numbers in expressions, or not at all
OF_FILES = {
    "system.definitions.*": "system.f",
    "system.tables.*.file": "system.tables.*.points",
    "trajectory.near": "trajectory.at",
    "trajectory.columns.*": "trajectory.knots",
    "trajectory.columns.*.name": "trajectory.knots",
    "trajectory.columns.*.scale": "trajectory.knots",
    "initial_state.at.*": "initial_state.at",
    "uncertainty.bounds.*.h": "uncertainty.bounds.h",
    "uncertainty.bounds.*.h_x": "uncertainty.bounds.h_x",
    "uncertainty.bounds.*.h_t": "uncertainty.bounds.h_t",
}


@cache
def certificates():
    found = {name: proven.shipped(name, conditions="all") for name in SHIPPED}
    return found | {name: certified(text, conditions=None) for name, text in OTHERS.items()}


@pytest.mark.slow
def test_every_key_of_every_certificate_has_a_row():
    for name, document in certificates().items():
        assert met(Node(document["result"], "certificate.result")), name


@pytest.mark.parametrize("where", ["result", "tube", "spec.effective.metric", "spec.effective.tube"])
def test_a_key_without_a_row_is_refused(where):
    document = copy.deepcopy(certified(SMALL, conditions=None))
    place = document["result"]
    for key in where.split(".") if where != "result" else ():
        place = place[key]
    place["surprise"] = 1
    with pytest.raises(TubecertError):
        met(Node(document["result"], "result"))


def paths(node, schema, path=(), seen=()):
    """The paths of a JSON Schema at which values stand; `*` for names of somebody else's."""
    name = node.get("$ref", "").rpartition("/")[2]
    if name and name not in seen:
        yield from paths(schema["$defs"][name], schema, path, (*seen, name))
    inner = [(own, path) for key in ("anyOf", "oneOf", "allOf", "prefixItems") for own in node.get(key, ())]
    inner += [(node[key], path) for key in ("then", "else", "items") if isinstance(node.get(key), dict)]
    inner += [(own, (*path, key)) for key, own in node.get("properties", {}).items()]
    if isinstance(node.get("additionalProperties"), dict):
        inner.append((node["additionalProperties"], (*path, "*")))
    for own, at in inner:
        yield from paths(own, schema, at, seen)
    if not inner and node.keys() & {"type", "enum", "const"} and node.get("type") not in ("null", "object"):
        yield ".".join(path)


def schema(name):
    return json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))


def matches(row, path):
    """Whether a row is about a path: by name, by a name of somebody else's, or as what stands below it."""
    own, keys = row.split("."), path.split(".")
    if own[-1] == "**":
        own, keys = own[:-1], keys[: len(own) - 1]
    return len(own) == len(keys) and all("*" in (a, b) or a == b for a, b in zip(own, keys, strict=True))


def has_row(path):
    return any(matches(row, path) for row in EXAMINED)


def test_every_key_of_the_schema_of_certificates_has_a_row():
    whole = schema("certificate")
    result = sorted(set(paths(whole["properties"]["result"], whole)))
    assert len(result) > 100
    assert [path for path in result if not has_row(path)] == []


def test_every_key_of_the_schema_of_specifications_has_a_row():
    whole = schema("spec")
    found = sorted({path for path in paths(whole, whole) if path})
    assert len(found) > 60
    missing = [
        path
        for path in found
        if path not in OF_FILES
        and not path.startswith(OF_A_MACHINE)
        and not has_row(f"spec.effective.{path}")
        and "." in path
    ]
    assert missing == []


@pytest.mark.slow
def test_every_row_has_a_key_and_a_claim():
    """The first words of some claim, of some certificate that has the key."""
    named = {}
    proven = [own for own in certificates().values() if own["result"]["verdict"] == "certified"]
    for document in proven:
        for row in met(Node(document["result"], "result")):
            named.setdefault(row, []).append(document)
    names = {id(document): [claim.name for claim in examine(document, 50).claims] for document in proven}
    for row, documents in named.items():
        claim = EXAMINED[row]
        if claim not in (NOTHING, FILE, UNPROVEN):
            assert any(claim in name for own in documents for name in names[id(own)]), (row, claim)
    known = {f"spec.effective.{OF_FILES.get(path, path)}" for path in paths(schema("spec"), schema("spec"))}
    whole = schema("certificate")
    known |= set(paths(whole["properties"]["result"], whole))
    found = {row for own in certificates().values() for row in met(Node(own["result"], "result"))}
    assert [
        row for row in EXAMINED if row not in found and not any(matches(row, path) for path in known)
    ] == []


def test_notes_are_no_part_of_what_is_hashed_and_are_not_examined():
    document = certified(SMALL, conditions=None, bare=False)
    assert {"effort", "constants", "elasticities", "reasons", "distance"} <= set(document["notes"])
    found = examine({**document, "notes": {"anything": [1, {"verdict": "certified"}]}, "run": {}})
    assert found.verdict == examine(document).verdict == "confirmed"
    assert found.unread[:2] == ("notes", "run")


def test_what_was_split_is_joined_again_and_nothing_else():
    document = certified(SMALL, conditions=None, bare=False)
    result, notes = document["result"], document["notes"]
    assert split(joined(result, notes)) == (result, notes)
    for wrong in (
        {"verdict": "refuted"},
        {**notes, "tube": {"rho": 0.001}},
        {**notes, "constants": {"f": {"above": 0.1}}},
        {**notes, "reasons": [{"relax": []}] * 9},
        {"distance": {"split": None}},
        [],
        "",
    ):
        if wrong:
            with pytest.raises(FormError):
                joined(result, wrong)


def test_a_note_in_the_result_is_refused():
    """So that nothing that is not examined can be hashed with what is."""
    document = certified(SMALL, conditions=None, bare=False)
    whole = joined(document["result"], document["notes"])
    for key in document["notes"]:
        forged = copy.deepcopy(document)
        forged["result"][key] = whole[key]
        with pytest.raises(TubecertError):
            examine(sealed(forged))
    assert set(document["notes"]) <= set(NOTES)
