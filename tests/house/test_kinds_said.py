"""Every kind of certificate, and every condition, has its words wherever reports look for them."""

import ast
from pathlib import Path

import pytest

import tubecert
from tubecert.claims.conditions import SAYS, SECTIONS
from tubecert.kinds import NAMES, RATES
from tubecert.report.figures_gains import STYLES

PACKAGE = Path(tubecert.__file__).parent
KEYS = [name.key for name in NAMES]
IN_ITS_OWN_WORDS = {"bounded"}  # names a constant


@pytest.mark.parametrize("name", NAMES, ids=lambda name: name.key)
def test_what_the_condition_of_a_kind_says_is_written(name):
    """It has the kind's own name, but for those of the paper."""
    own = ("26a", "26b", "26c") if name is RATES else (name.key,)
    assert {*own} <= {*SAYS}


def test_every_kind_has_its_colour_and_its_title():
    assert [*STYLES] == [*SECTIONS] == KEYS


def shortfalls():
    """The names of conditions that are not proven, where theorems make them."""
    for path in sorted((PACKAGE / "conditions").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "Shortfall":
                claims = [part.value for part in node.keywords if part.arg == "claim"]
                yield from (claim.value for claim in claims if isinstance(claim, ast.Constant))


def test_what_a_condition_says_that_is_not_proven_is_written():
    found = {*shortfalls()}
    assert len(found) > 3
    assert found - IN_ITS_OWN_WORDS <= {*SAYS}
