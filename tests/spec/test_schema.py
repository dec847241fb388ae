"""The JSON Schemas: they say what the readers and the writer say, and an editor that has only them agrees."""

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
from tampers import leaves

import tubecert
from tubecert import certificate, spec
from tubecert.certificate.result import Certificate
from tubecert.records import FormError
from tubecert.spec.keys import Section
from tubecert.spec.load import FILE, load, load_text
from tubecert.spec.plan import PLANS

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
    *sorted((ROOT / "tests/specs/planned").glob("*.yaml")),
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
    assert not errors("spec", spec.canonical(load(str(path), reads="question")))


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


def sections(form: Any) -> Iterator[Section]:
    """The sections that a part of the table has within it."""
    if isinstance(form, Section):
        yield form
        for key in form.keys.values():
            yield from sections(key.kind.schema)
    else:
        for each in form.values() if isinstance(form, dict) else form if isinstance(form, list) else ():
            yield from sections(each)


@pytest.mark.slow
def test_every_section_of_the_table_is_read(monkeypatch):
    """From the table, and from nothing else: what the schema has is asked of some file, with its keys."""
    asked = []
    real = Section.entries

    def entries(section, *arguments):
        asked.append(section.keys.keys())
        return real(section, *arguments)

    monkeypatch.setattr(Section, "entries", entries)
    for path in GOOD:
        load(str(path), reads="question")
    load_text(EVERYTHING)
    told = list(sections(FILE))
    assert len(told) > 20
    assert [section.words for section in told if section.keys.keys() not in asked] == []


def test_the_choices_are_those_of_certificates():
    from tubecert.letters import NAMES

    result = SCHEMAS["certificate"]["properties"]["result"]["properties"]
    assert result["decided_by"]["items"]["enum"] == [name.key for name in NAMES]
    assert {name.key for name in NAMES} <= set(result)
    assert result["plan"]["properties"]["kind"]["enum"] == list(PLANS)


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
    assert not errors("certificate", sealed)
    assert not errors("spec", sealed["result"]["spec"]["effective"])
    again = Certificate.from_json(sealed).to_json()
    assert certificate.dump(again) == certificate.dump(sealed), "read and written again, byte for byte"


# what a schema does not say: that keys are the states, that notes are of what is there
BETWEEN = re.compile(
    r"result\.(safe_set\.\w+|tube\.half_widths(\.\w+)?|constants(\.\w+)?|conditions_26)|(result|notes)\.reasons\.0"
)


@pytest.mark.slow
def test_the_schema_accepts_what_is_read_and_nothing_else():
    """At every place: the key left out, one more key, values of other kinds."""
    sealed = certificate.seal(certificates.certified(), {"seconds": 1.0})
    validator = jsonschema.Draft202012Validator(SCHEMAS["certificate"])
    told, wrong = set(), []
    for path in leaves(sealed):
        if path[:3] == ("result", "spec", "effective"):  # a specification, which has a schema of its own
            continue
        for change in ("absent", "surprise", None, True, "text", [None], {"a": 1}):
            fits, is_read = validator.is_valid(other := changed(sealed, path, change)), reads(other)
            told.add((fits, is_read))
            if fits != is_read and not (fits and BETWEEN.fullmatch(".".join(map(str, path)))):
                wrong.append((path, change, fits))
    assert wrong == []
    assert {(True, True), (False, False)} <= told
    assert errors("certificate", changed(sealed, ("result", "reasons", 0, "binds"), "26a")), "it is a note"


def changed(sealed: Any, path: tuple[Any, ...], change: Any) -> Any:
    other = copy.deepcopy(sealed)
    *above, key = path
    parent = other
    for each in above:
        parent = parent[each]
    if change == "absent":
        del parent[key]
    elif change == "surprise" and isinstance(parent, dict):
        parent[change] = 1
    else:
        parent[key] = change
    return other


def reads(sealed: Any) -> bool:
    try:
        return Certificate.from_json(sealed).format == certificate.FORMAT
    except FormError:
        return False


def test_the_reference_is_what_the_schemas_say():
    sys.path.insert(0, str(ROOT / "docs"))
    import generate

    assert generate.schemas() == SCHEMAS, "run python docs/generate.py"
    for name, text in generate.everything().items():
        assert (ROOT / "docs" / "reference" / name).read_text("utf-8") == text, "run python docs/generate.py"
    page = generate.published().partition("| metric |")[0]
    counted = re.findall(r"^\| [^|]+ \| (\d+) \| (\d+) \| (\d+)", page, re.MULTILINE)
    assert sum(int(metrics) for metrics, _, _ in counted) == 65
    assert all(int(metrics) == int(hold) + int(refuted) for metrics, hold, refuted in counted)
