"""The schema is the table of the keys: what it says of defaults and of choices is what the readers do."""

import copy
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

import tubecert
from tubecert.errors import SpecError
from tubecert.spec import canonical
from tubecert.spec.document import compose
from tubecert.spec.keys import key, number, section
from tubecert.spec.load import load_text
from tubecert.spec.names import Names
from tubecert.spec.reader import Reader, root_field
from tubecert.spec.source import Source

PACKAGE = Path(tubecert.__file__).parent
SCHEMA = json.loads((PACKAGE / "schemas/spec.schema.json").read_text("utf-8"))
FILES = [
    *sorted((PACKAGE.parent / "tests/specs/ok").glob("*.yaml")),
    *sorted((PACKAGE.parent / "configs").glob("*.yaml")),
    PACKAGE / "templates/csv.yaml",
    PACKAGE.parent / "tests/specs/planned/hardware_table.yaml",
]
ANY = "*"  # an entry of a list, or the value of a name


def mappings(schema: Any, path: tuple[str, ...] = (), kind: str = "") -> Iterator[tuple[Any, Any, str]]:
    """Every mapping of the schema with keys of its own: where it stands, its properties, the kind of trajectory."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        yield from mappings(SCHEMA["$defs"][name], path, name.partition("trajectory_")[2])
        return
    if "properties" in schema:
        yield path, schema["properties"], kind
        for key, value in schema["properties"].items():
            yield from mappings(value, (*path, key))
    if "items" in schema:
        yield from mappings(schema["items"], (*path, ANY))
    if isinstance(schema.get("additionalProperties"), dict):
        yield from mappings(schema["additionalProperties"], (*path, ANY))
    for branch in ("anyOf", "oneOf", "allOf"):
        for each in schema.get(branch, ()):
            if "properties" in each or "$ref" in each or "then" in each:
                yield from mappings(each.get("then", each), path)


def choices(schema: Any) -> list[Any]:
    """The words that a key may have."""
    own = list(schema.get("enum", ()))
    for branch in ("anyOf", "oneOf"):
        for each in schema.get(branch, ()):
            own += choices(each)
    return own


KEYS = {
    (*path, f"{key}|{kind}" if kind else key): value
    for path, properties, kind in mappings(SCHEMA)
    for key, value in properties.items()
    if "default" in value or choices(value)
}


def sections(data: Any, path: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """The mappings at a place in a file."""
    if not path:
        if isinstance(data, dict):
            yield data
    elif path[0] == ANY:
        for each in data if isinstance(data, list) else data.values():
            yield from sections(each, path[1:])
    elif isinstance(data, dict) and path[0] in data:
        yield from sections(data[path[0]], path[1:])


@cache
def files() -> list[tuple[str, Any]]:
    """The files as their readers see them: every scalar a text."""
    return [(str(path), yaml.load(path.read_text("utf-8-sig"), Loader=yaml.BaseLoader)) for path in FILES]


def effective(data: Any, path: str) -> Any:
    """What is read, None if it is refused."""
    return read(json.dumps(data), path)


@cache
def read(text: str, path: str) -> Any:
    """The same of a text: most files do not have the key in question, and are read once."""
    try:
        return canonical(load_text(text, path, "question"))
    except SpecError:
        return None


def _goes_without(key: str, data: Any, own: Any) -> bool:
    """Whether a file is refused for a key that goes with hardware, and with a horizon."""
    return (key == "controller" and "hardware" not in data) or (
        key == "afterwards" and ("hardware" not in data or "horizon" not in own)
    )


def same_as_left_out(place: tuple[str, ...], values: list[Any]) -> set[str] | None:
    """Which values of a key mean what its absence means, in every file; None if there is no file without it."""
    path, (key, _, kind) = place[:-1], place[-1].partition("|")
    found = None
    for name, whole in files():
        data = copy.deepcopy(whole)
        own = next((each for each in sections(data, path) if not kind or each.get("kind") == kind), None)
        if own is None:
            continue
        if _goes_without(key, data, own):
            continue
        own.pop(key, None)
        without = effective(data, name)
        if without is None:
            continue
        same = set()
        for value in values:
            own[key] = value
            if (found is None or str(value) in found) and effective(data, name) == without:
                same.add(str(value))
        found = same
        if not found:
            break
    return found


@pytest.mark.slow
@pytest.mark.parametrize("place", KEYS, ids=".".join)
def test_a_default_is_what_its_absence_means(place):
    """And where one of the words of a key means that always, the schema says so."""
    schema = KEYS[place]
    stated = [schema["default"]] if "default" in schema else []
    always = same_as_left_out(place, [*stated, *choices(schema)])
    if stated:
        assert always is not None, "no file in which the key can be left out"
        assert str(stated[0]) in always
    else:
        assert not always, "a default that the schema does not state"


@pytest.mark.parametrize("place", [place for place in KEYS if choices(KEYS[place])], ids=".".join)
def test_a_word_that_is_no_choice_is_refused(place):
    path, (key, _, kind) = place[:-1], place[-1].partition("|")
    for name, whole in files():
        data = copy.deepcopy(whole)
        own = next((each for each in sections(data, path) if not kind or each.get("kind") == kind), None)
        if own is None or effective(data, name) is None:
            continue
        own[key] = "quite another"
        assert effective(data, name) is None
        return
    pytest.fail("no file has the section")


@dataclass(frozen=True, slots=True, kw_only=True)
class Toy:
    """A toy."""

    share: Fraction | None = key(number(above=0, most=1), None, example=0.1)
    """A share; > 0."""


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("share: 1/4", None, ""),
        ("share: 2", (1, 8), "toy.share is 2; it must be > 0 and <= 1"),
        ("share: 0.1 m", (1, 12), "a number has no unit"),
        ("shar: 0.1", (1, 1), "did you mean share?"),
    ],
)
def test_a_key_is_one_place(text, place, words):
    """From one field it is read, refused, compared with misspelt ones, written and described."""
    source = Source.of("toy.yaml", text)
    reader, toy = Reader(source), section(Toy)
    field = replace(root_field(reader, compose(source)[0]), path="toy")
    found = toy.read(field, Names(states=("x",), inputs=("u",), parameters=()))
    if place is None:
        assert found == Toy(share=Fraction(1, 4))
        assert toy.written(found) == {"share": "0.25"}
    else:
        [finding] = reader.findings
        assert (finding.location.line, finding.location.column) == place
        assert words in f"{finding.message} / {finding.help}"


def test_the_words_of_a_key_stand_below_it(monkeypatch):
    monkeypatch.syspath_prepend(PACKAGE.parent / "docs")
    import generate

    described = generate.described_section(section(Toy))
    assert described["description"] == "A toy."
    said = {"description": "A share; > 0.", "$ref": "#/$defs/number", "examples": [0.1]}
    assert described["properties"] == {"share": said}
