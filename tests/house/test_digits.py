"""Numbers become text for a reader in `digits` alone, by rounding that keeps what is said true."""

import ast
from pathlib import Path

import pytest

import tubecert

PACKAGE = Path(tubecert.__file__).parent
ELSEWHERE = {  # where a format with significant digits stands, and what it makes that is no text for a reader
    "certificate/sections.py": "the points by which a plan is drawn",
    "expression/parse.py": "the range of a table, in a room below `digits`",
    "planner/propose.py": "decimals of a proposal",
    "recheck/": "words of its own, shared with nobody",
    "report/comparison.py": "signed differences in percent",
    "sweep/grid.py": "decimals of a grid",
    "synthesis/": "decimals of a proposal",
}


def formats(tree: ast.Module):
    """Every format of a text with so many significant digits, by its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            written = "".join(str(p.value) for p in node.format_spec.values if isinstance(p, ast.Constant))
            if written.endswith(("g", "e")):
                yield node.lineno


@pytest.mark.slow
def test_numbers_become_text_in_one_module():
    found = {
        path.relative_to(PACKAGE).as_posix(): lines
        for path in sorted(PACKAGE.rglob("*.py"))
        if (lines := [*formats(ast.parse(path.read_text(encoding="utf-8")))])
    }
    beside = {name: lines for name, lines in found.items() if not name.startswith(tuple(ELSEWHERE))}
    assert not beside
    assert all(any(name.startswith(own) for name in found) for own in ELSEWHERE), "an exception that is none"
