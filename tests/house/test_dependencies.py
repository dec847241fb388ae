"""What is installed: declared, pinned, imported, and named wherever a result depends on it."""

import ast
import json
import sys
import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from test_architecture import MODULES, ROOT, imported, room_of
from typer.testing import CliRunner

from tubecert import libraries
from tubecert.checking import cache as kept
from tubecert.cli.app import app
from tubecert.spec import load

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MODULE_OF = {"pyyaml": "yaml", "python-flint": "flint"}


def names(requirements):
    return {line.split(">")[0].split("[")[0].strip().lower() for line in requirements} - {"tubecert"}


def needed():
    extras = PROJECT["optional-dependencies"]
    return names(
        [*PROJECT["dependencies"], *(line for name in extras if name != "dev" for line in extras[name])]
    )


@cache
def libraries_of(path: Path) -> frozenset[str]:
    """The modules that a file of the package imports."""
    return frozenset(name.split(".")[0] for name in imported(ast.parse(path.read_text(encoding="utf-8"))))


def test_every_dependency_is_said_to_decide_or_to_show():
    assert not set(libraries.DECIDING) & set(libraries.SHOWING)
    assert {*libraries.DECIDING, *libraries.RUNNING, *libraries.SHOWING} == needed()


@pytest.mark.slow
def test_dependencies_are_what_is_imported():
    found = frozenset().union(*map(libraries_of, MODULES))
    foreign = found - set(sys.stdlib_module_names) - {"tubecert"}
    assert foreign == {MODULE_OF.get(name, name) for name in needed()}


@pytest.mark.slow
@pytest.mark.parametrize("name", libraries.SHOWING)
def test_what_only_shows_is_used_where_things_are_shown(name):
    figures = {path for path in MODULES if path.name.startswith("figures")}
    users = {path for path in MODULES if name in libraries_of(path)}
    assert users
    assert all(room_of(path) in ("cli", "report", "library") or path in figures for path in users)


def test_versions_are_shown():
    shown = json.loads(CliRunner().invoke(app, ["version", "--json"]).stdout)
    assert list(shown) == ["tubecert", "python", *libraries.DECIDING]
    assert shown["cvxpy"] == metadata.version("cvxpy")


@pytest.mark.parametrize("name", libraries.DECIDING)
def test_what_is_kept_belongs_to_the_versions_that_made_it(name, monkeypatch):
    spec = load(str(ROOT / "configs" / "three_state.yaml"))
    kept._program.cache_clear()
    before = kept.key_of_text("lint", spec)
    honest = metadata.version
    monkeypatch.setattr(metadata, "version", lambda asked: "99" if asked == name else honest(asked))
    kept._program.cache_clear()
    try:
        assert kept.key_of_text("lint", spec) != before
    finally:
        kept._program.cache_clear()


def test_constraints_pin_every_dependency_by_name_and_version():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(line.count("==") == 1 and not set(line) & set(" @/:") for line in pins)
    pinned = {line.split("==")[0].lower().replace("_", "-") for line in pins}
    assert needed() | names(PROJECT["optional-dependencies"]["dev"]) <= pinned
