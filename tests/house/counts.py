"""How much of the package is strings where a type could be: python tests/house/counts.py [PACKAGE] [--where NAME]

Counted in the syntax tree, so that comments and docstrings do not matter. `recheck` is counted apart: it shares no type
with the rest. The serialiser, where strings have their place, is listed in `SERIALISER`.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

VERDICTS = {"certified", "refuted", "undecided", "proven", "holds", "contradicted", "confirmed"}
SERIALISER = ("records.py", "files.py", "checking/cache.py", "spec/", "schemas/")
KINDS = (
    "mappings of Any",
    "string-key reads",
    "Any",
    "asserts that something is not None",
    "verdict literals",
    "comparisons with sentences",
)


def found(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """What is counted, with its line."""
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.Subscript) and _is_mapping_of_any(node):
            yield "mappings of Any", line
        if _reads_a_key(node):
            yield "string-key reads", line
        if isinstance(node, ast.Name) and node.id == "Any":
            yield "Any", line
        if isinstance(node, ast.Assert) and ast.unparse(node.test).endswith("is not None"):
            yield "asserts that something is not None", line
        if isinstance(node, ast.Constant) and node.value in VERDICTS and id(node) not in docstrings:
            yield "verdict literals", line
        if _compares_a_sentence(node):
            yield "comparisons with sentences", line


def _is_mapping_of_any(node: ast.Subscript) -> bool:
    named = isinstance(node.value, ast.Name) and node.value.id in ("Mapping", "dict")
    return named and ast.unparse(node.slice).strip("()") == "str, Any"


def _reads_a_key(node: ast.AST) -> bool:
    """`data["key"]` and `data.get("key")`; not where a key is written."""
    if isinstance(node, ast.Subscript):
        return isinstance(node.ctx, ast.Load) and _is_text(node.slice)
    is_get = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "get"
    return is_get and bool(node.args) and _is_text(node.args[0])


def _compares_a_sentence(node: ast.AST) -> bool:
    """A text with a space in it that is compared, or looked for at the start of another."""
    if isinstance(node, ast.Compare):
        return any(_is_text(side) and " " in side.value for side in (node.left, *node.comparators))
    names = ("startswith", "endswith", "removeprefix", "partition")
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in names
    return is_call and any(_is_text(part) and " " in part.value.strip() for part in node.args)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def counts(package: Path, *, recheck: bool = False, serialiser: bool = False) -> Counter[str]:
    """The counts over a package: without recheck and the serialiser, or of one of them alone."""
    total: Counter[str] = Counter(dict.fromkeys(KINDS, 0))
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package).as_posix()
        if name.startswith("recheck/") == recheck and name.startswith(SERIALISER) == serialiser:
            total.update(kind for kind, _ in found(ast.parse(path.read_text(encoding="utf-8"))))
    return total


def main() -> None:
    """Print the table, and with --where every place of one kind."""
    arguments = [word for word in sys.argv[1:] if not word.startswith("--")]
    package = Path(arguments[0]) if arguments else Path(__file__).parents[2] / "tubecert"
    own, apart, strings = counts(package), counts(package, recheck=True), counts(package, serialiser=True)
    print(f"{'':<40}{'rest':>6}{'serialiser':>12}{'recheck':>9}")
    for kind in KINDS:
        print(f"{kind:<40}{own[kind]:>6}{strings[kind]:>12}{apart[kind]:>9}")
    if "--where" in sys.argv:
        wanted = sys.argv[sys.argv.index("--where") + 1]
        for path in sorted(package.rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            for kind, line in found(tree):
                if wanted in kind and "recheck/" not in path.as_posix():
                    print(f"{path.relative_to(package)}:{line}")


if __name__ == "__main__":
    main()
