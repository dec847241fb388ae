"""Strings where a type could be: none as mappings of Any above the edge, and of the others not more than there are."""

import ast
from functools import cache
from pathlib import Path

import pytest
from counts import EDGE, KINDS, counts, found

import tubecert

# what is there now, outside the edge (`counts.EDGE`) and recheck; lower a number when it falls
MOST = {
    "mappings of Any": 0,
    "string-key reads": 83,
    "Any": 125,
    "asserts that something is not None": 18,
    "verdict literals": 14,
    "comparisons with sentences": 2,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_there_are_not_more_of_them(kind):
    assert counted()[kind] <= MOST[kind]


@cache
def counted():
    return counts(Path(tubecert.__file__).parent)


@pytest.mark.parametrize("name", EDGE)
def test_the_edge_is_where_it_is_said_to_be(name):
    """A module or a room, which has mappings of Any: one that has none is no edge."""
    package = Path(tubecert.__file__).parent
    modules = sorted((package / name).rglob("*.py")) if name.endswith("/") else [package / name]
    kinds = {kind for path in modules for kind, _ in found(ast.parse(path.read_text(encoding="utf-8")))}
    assert "mappings of Any" in kinds


@pytest.mark.parametrize(
    "text", ["def f(x: Mapping[str, Any]) -> None: ...", "x: dict[str, Json] = {}", "T = Mapping[str, Tree]"]
)
def test_a_mapping_of_any_is_found_under_each_of_its_names(text):
    assert "mappings of Any" in {kind for kind, _ in found(ast.parse(text))}
