"""The JSON Schemas: they say what the readers and the writer say, and an editor that has only them agrees."""

import ast
import copy
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import certificates
import jsonschema
import proven
import pytest
import yaml
from systems import SMALL

import tubecert
from tubecert import certificate, spec
from tubecert.certificate.result import Certificate
from tubecert.errors import TubecertError
from tubecert.spec.load import load, load_question, load_system, load_text
from tubecert.spec.metric_file import with_metric
from tubecert.spec.reader import Field

PACKAGE = Path(tubecert.__file__).parent
ROOT = PACKAGE.parent
SCHEMAS = {
    path.name.split(".")[0]: json.loads(path.read_text("utf-8"))
    for path in (PACKAGE / "schemas").glob("*.json")
}
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
GOOD = [
    *CONFIGS,
    *sorted((ROOT / "tests/specs/ok").glob("*.yaml")),
    *sorted((PACKAGE / "templates").glob("*.yaml")),
]
BAD = sorted((ROOT / "tests/specs/bad").glob("*.yaml"))
STRUCTURAL = {"TC103", "TC106"}


def errors(name: str, data: Any) -> list[str]:
    validator = jsonschema.Draft202012Validator(SCHEMAS[name])
    return [f"{error.json_path}: {error.message}" for error in validator.iter_errors(data)]


def as_text(path: Path) -> Any:
    """The file with every scalar as the text that was written, which is how the reader sees it."""
    return yaml.load(path.read_text("utf-8-sig"), Loader=yaml.BaseLoader)


def as_editor(path: Path) -> Any:
    return yaml.safe_load(path.read_text("utf-8-sig"))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_schemas_are_schemas(name):
    jsonschema.Draft202012Validator.check_schema(SCHEMAS[name])
    assert set(SCHEMAS) == {"spec", "metric", "certificate", "sampled-loop"}


def described(schema: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every property that a schema introduces (conditions only mention them again)."""
    if isinstance(schema, dict):
        yield from ((f"{path}/{key}", value) for key, value in schema.get("properties", {}).items())
        for key, value in schema.items():
            if key not in ("if", "anyOf", "oneOf") or path.endswith(("A_m", "projection")):
                yield from described(value, f"{path}/{key}")
    elif isinstance(schema, list):
        for item in schema:
            yield from described(item, path)


@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_every_key_is_described(name):
    for path, value in described(SCHEMAS[name]):
        assert value.get("description") or "$ref" in value, path


@pytest.mark.parametrize("path", GOOD, ids=lambda path: path.stem)
def test_good_files_fit(path):
    assert not errors("spec", as_text(path))
    if path.stem != "odd_style":  # its numbers are texts to YAML 1.1
        assert not errors("spec", as_editor(path))


@pytest.mark.parametrize("path", GOOD, ids=lambda path: path.stem)
def test_the_effective_specification_fits(path):
    assert not errors("spec", spec.canonical(load_question(str(path))))


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_what_the_reader_says_of_keys_and_kinds_the_schema_says_too(path):
    codes = set(re.findall(r"# expect: (TC\d+)", path.read_text("utf-8", "replace")))
    # keys that are names; YAML that a schema never sees
    by_name = {"units_unknown", "tube_state", "start_box_unknown", "bounds_of_one_input", "bounds_mixed"}
    by_name |= {"mistake_unit_of_another_case", "hardware_noise_of_nothing"}
    by_name |= {"disturbance_ragged", "disturbance_rows", "disturbance_list_of_another_size"}
    by_name |= {"input_rate_of_nothing"}
    exempt = {*by_name, "yaml_complex_key"}
    if codes and codes <= STRUCTURAL | {"TC113"} and path.stem not in exempt:
        assert errors("spec", as_text(path))


class Asked:
    """Every question that the readers ask of a mapping: where, in which line, and for which keys."""

    def __init__(self) -> None:
        self.known: dict[tuple[str, str], set[str]] = {}
        self.required: dict[tuple[str, str], set[str]] = {}
        self.lines: set[tuple[str, int]] = set()

    def record(self, monkeypatch: pytest.MonkeyPatch) -> None:
        real = Field.mapping

        def mapping(field: Field, *, required=(), optional=(), reserved=()):
            caller = sys._getframe(1)
            self.lines.add((Path(caller.f_code.co_filename).name, caller.f_lineno))
            kind = ""
            if field.path == "trajectory":
                kind = next(node.text for key, node in field.node.pairs if key.text == "kind")
            by_name = caller.f_code.co_name in ("read_box", "_combined", "_named_ends")  # states or inputs
            if Path(caller.f_code.co_filename).name != "metric_file.py" and not by_name:
                path = re.sub(r"^uncertainty\.bounds\.\w+", "uncertainty.bounds", field.path)
                self.known.setdefault((path, kind), set()).update(required, optional)
                self.required.setdefault((path, kind), set()).update(required)
            return real(field, required=required, optional=optional, reserved=reserved)

        monkeypatch.setattr(Field, "mapping", mapping)


def subschema(path: str, kind: str) -> dict[str, Any]:
    """The schema of the mapping at a dotted path."""
    schema = SCHEMAS["spec"]
    if path == "trajectory":
        return schema["$defs"][f"trajectory_{kind}"]
    for key in filter(None, re.split(r"\.|\[\d+\]", path)):
        schema = schema.get("items", schema)
        while "$ref" in schema:
            schema = SCHEMAS["spec"]["$defs"][schema["$ref"].rsplit("/", 1)[1]]
        schema = schema.get("items", schema)
        named = schema.get("properties", {})
        schema = named.get(key) or schema["additionalProperties"]  # tables have names of their own
        choices = [item for item in schema.get("anyOf", ()) if "properties" in item]
        schema = choices[0] if choices and "properties" not in schema else schema
    while "$ref" in schema:
        schema = SCHEMAS["spec"]["$defs"][schema["$ref"].rsplit("/", 1)[1]]
    return schema.get("items", schema) if "properties" not in schema else schema


def sites() -> set[tuple[str, int, int]]:
    """Where the readers of the specification call `.mapping(`."""
    found = set()
    for path in sorted((PACKAGE / "spec").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr == "mapping"
            ):
                found.add((path.name, node.lineno, node.end_lineno or node.lineno))
    return found


EVERYTHING = """
tubecert: 1
name: everything
system: {states: [x], inputs: [u], parameters: {a: 1}, units: {x: m}, f: [-x], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: ["0"], bounds: {h: 1}}
trajectory: {kind: equilibrium, at: [0]}
initial_state: {within: 0.1}
metric: {rate: 1, dual_metric: [[1]], bounds: {lower: 1, upper: 1}}
tube: {epsilon: 1, rho_a: 1}
adaptation: {A_m: -1, projection: {smooth: 0.1}}
conditions: {decides: B}
expect: {verdict: certified, half_widths: {x: [0, 1]}}
"""


@pytest.mark.slow
def test_the_readers_know_no_key_that_the_schema_does_not(monkeypatch, tmp_path):
    """Every call of `.mapping(` is met, and what it asks for is what the schema says at that place."""
    asked = Asked()
    asked.record(monkeypatch)
    for path in [*GOOD, *BAD]:
        try:
            load(str(path))
        except (TubecertError, StopIteration):
            continue
    full = load_text(EVERYTHING)
    metric = tmp_path / "metric.json"
    metric.write_text(json.dumps({"format": "tubecert-metric/1", "rate": 1, "dual_metric": [[1]]}))
    with_metric(full, str(metric))
    load_system(str(GOOD[0]))
    met = [{(name, each) for each in range(first, last + 1)} & asked.lines for name, first, last in sites()]
    assert all(met), "a section that no example file of tests/specs/ok has"
    # their keys are states or inputs
    box = {"tube.half_widths", "trajectory.x", "trajectory.u", "limits", "hardware.noise", "hardware.limits"}
    box |= {"trajectory.input_rate", "expect.half_widths"}
    for (path, kind), known in asked.known.items():
        if path in box or path.startswith("uncertainty.bounds."):  # bounds of an input
            continue
        schema = subschema(path, kind)
        named = path == "uncertainty.bounds"  # beside its own keys, those of the inputs
        assert set(schema["properties"]) == (known & {"h", "h_x", "h_t"} if named else known), (path, kind)
        depends = "anyOf" in schema or "if" in schema or path == "uncertainty.bounds"  # on other keys
        if not depends:
            assert set(schema.get("required", ())) == asked.required[(path, kind)], (path, kind)
        assert schema["additionalProperties"] is False or path == "uncertainty.bounds"


def test_the_choices_are_those_of_the_readers():
    from tubecert.letters import ADAPTIVE, ALL, NAMES, words_of
    from tubecert.spec.plan import KINDS
    from tubecert.spec.settings import METRICS, RANGES, VERDICTS, WIDTHS
    from tubecert.spec.simulation import CONTROLLERS
    from tubecert.spec.synthesis import OBJECTIVES, ROUTES, SOLVERS

    properties = SCHEMAS["spec"]["properties"]
    assert properties["trajectory"]["properties"]["kind"]["enum"] == list(KINDS)
    assert properties["expect"]["properties"]["verdict"]["enum"] == list(VERDICTS)
    assert properties["expect"]["properties"]["metric"]["enum"] == list(METRICS.values())
    assert set(properties["expect"]["properties"]) == {"verdict", "metric", WIDTHS, *RANGES}
    decides = properties["conditions"]["properties"]["decides"]["enum"]
    assert set(map(str, decides)) == {*words_of(), ALL}
    result = SCHEMAS["certificate"]["properties"]["result"]["properties"]
    assert result["decided_by"]["items"]["enum"] == [name.key for name in NAMES]
    assert {name.key for name in NAMES} <= set(result)
    assert result["plan"]["properties"]["kind"]["enum"] == list(KINDS)
    simulation = properties["simulation"]["properties"]
    assert simulation["controllers"]["items"]["enum"] == list(CONTROLLERS)
    assert set(map(str, simulation["gains"]["enum"])) == set(words_of(ADAPTIVE))
    synthesis = properties["metric"]["properties"]["synthesise"]["properties"]
    for key, choices in (("objective", OBJECTIVES), ("route", ROUTES)):
        assert synthesis[key]["enum"] == list(choices)
    assert synthesis["solver"]["anyOf"][0]["enum"] == list(SOLVERS)


@pytest.mark.parametrize("path", [*CONFIGS], ids=lambda path: path.stem)
def test_every_config_names_the_schema(path):
    lines = path.read_text("utf-8").splitlines()
    [named] = [line for line in lines if line.startswith("# yaml-language-server:")]
    target = named.split("$schema=")[1]
    assert (path.parent / target).resolve() == (PACKAGE / "schemas/spec.schema.json").resolve()


def test_the_metric_file_has_the_keys_of_its_reader():
    from tubecert.spec import metric_file

    known = {"format", "rate", "dual_metric", *metric_file._REPORTED}
    assert set(SCHEMAS["metric"]["properties"]) == known
    assert SCHEMAS["metric"]["properties"]["format"]["const"] == metric_file.FORMAT


def closed(schema: Any) -> Any:
    """The same schema, refusing every key that it does not describe."""
    if isinstance(schema, dict):
        tight = {key: closed(value) for key, value in schema.items()}
        if "properties" in schema and schema.get("type") == "object":
            tight.setdefault("additionalProperties", False)
        return tight
    return [closed(item) for item in schema] if isinstance(schema, list) else schema


CLOSED = jsonschema.Draft202012Validator(closed(SCHEMAS["certificate"]))
VARIANTS = {
    "certified": (ROOT / "configs/three_state.yaml", "", "", {}),
    "everything decides": (ROOT / "configs/three_state.yaml", "", "", {"conditions": "all"}),
    "budget": (ROOT / "configs/three_state.yaml", "", "", {"budget": 10}),
    "metric refuted": (SMALL, "rate: 0.8", "rate: 3", {}),
    "leaves": (SMALL, "epsilon: 0.2", "epsilon: 2", {}),
    "too much": (SMALL, "0.1*sin(t)", "10*sin(t)", {}),
    "state-dependent": (ROOT / "configs/state_dependent_input.yaml", "", "", {}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(VARIANTS))
def test_certificates_fit_and_have_no_key_that_the_schema_does_not_know(name):
    source, old, new, options = VARIANTS[name]
    text = source if isinstance(source, str) else source.read_text("utf-8")
    assert old in text
    result = proven.result(text.replace(old, new) if old else text, **options).to_json()
    run = {"command": "", "started": "", "seconds": 1.0, "versions": {}}
    sealed = json.loads(certificate.dump(certificate.seal(result, run)))
    assert not [f"{error.json_path}: {error.message}" for error in CLOSED.iter_errors(sealed)]
    assert not errors("spec", sealed["result"]["spec"]["effective"])
    again = Certificate.from_json(sealed).to_json()
    assert certificate.dump(again) == certificate.dump(sealed), "read and written again, byte for byte"


@pytest.mark.parametrize(
    "change",
    [
        {"verdict": "fine"},
        {"metric": {"margin": [1]}},
        {"constants": {"h": {"above": 1}}},
        {"reasons": [{"claim": "x"}]},
        {"plan": {"kind": "magic"}},
    ],
)
def test_what_is_no_certificate_does_not_fit(change):
    result = certificates.certified()
    sealed = certificate.seal(copy.deepcopy(result), {})
    assert not [e for e in errors("certificate", sealed) if "hash" not in e]
    sealed["result"].update(change)
    assert [e for e in errors("certificate", sealed) if "hash" not in e]


def test_the_reference_is_what_the_schemas_say():
    sys.path.insert(0, str(ROOT / "docs"))
    import generate

    assert generate.sampled_loop() == SCHEMAS["sampled-loop"], "run python docs/generate.py"
    for name, text in generate.everything().items():
        assert (ROOT / "docs" / "reference" / name).read_text("utf-8") == text, "run python docs/generate.py"
    page = generate.published().partition("| metric |")[0]
    counted = re.findall(r"^\| [^|]+ \| (\d+) \| (\d+) \| (\d+)", page, re.MULTILINE)
    assert sum(int(metrics) for metrics, _, _ in counted) == 65
    assert all(int(metrics) == int(hold) + int(refuted) for metrics, hold, refuted in counted)
