"""How much of the package is strings where a type could be.

Counted in the syntax tree, so that comments and docstrings do not matter. `recheck` is left out: it shares no type with
the rest. The edge, where strings have their place, is listed in `EDGE`. Names that stand for Any count as it does.
"""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

VERDICTS = {"certified", "refuted", "undecided", "proven", "holds", "contradicted", "confirmed"}
ANY = ("Any", "Json", "Tree")  # what the library json reads and writes, and what canonical data holds
EDGE = {  # where data comes in or goes out, and what it is
    "records.py": "records as JSON, and JSON as records",
    "spec/": "YAML, CSV and metric files as a `Spec`; a `Spec` as canonical data",
    "certificate/file.py": "the JSON of a certificate: sealed, hashed, written and read back",
    "certificate/effective.py": "the canonical data that a certificate holds, and typed views of it",
    "certificate/belonging.py": "canonical data of a file against that of a certificate, key by key",
    "sampled_loop/record.py": "records of a certificate of a sampled loop as JSON, sealed and read back",
    "synthesis/coefficients.py": "metrics as other tools keep them as the text of a metric file",
    "report/pages.py": "the TOML of the pages",
    "report/sarif.py": "the JSON of a foreign format",
}
KINDS = (
    "mappings of Any", "string-key reads", "Any", "asserts that something is not None", "verdict literals",
    "comparisons with sentences",
)  # fmt: skip


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
        if isinstance(node, ast.Name) and node.id in ANY:
            yield "Any", line
        if isinstance(node, ast.Assert) and ast.unparse(node.test).endswith("is not None"):
            yield "asserts that something is not None", line
        if isinstance(node, ast.Constant) and node.value in VERDICTS and id(node) not in docstrings:
            yield "verdict literals", line
        if _compares_a_sentence(node):
            yield "comparisons with sentences", line


def _is_mapping_of_any(node: ast.Subscript) -> bool:
    named = isinstance(node.value, ast.Name) and node.value.id in ("Mapping", "dict")
    return named and ast.unparse(node.slice).strip("()") in {f"str, {name}" for name in ANY}


def _reads_a_key(node: ast.AST) -> bool:
    """`data["key"]` and `data.get("key")`; not where a key is written, and not of the system's environment."""
    if isinstance(node, ast.Subscript):
        forward = isinstance(node.value, ast.Name) and node.value.id in ("list", "tuple", "type")
        return isinstance(node.ctx, ast.Load) and _is_text(node.slice) and not forward
    is_get = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "get"
    return (
        is_get and bool(node.args) and _is_text(node.args[0]) and ast.unparse(node.func.value) != "os.environ"
    )


def _compares_a_sentence(node: ast.AST) -> bool:
    """A text with a space in it that is compared, or looked for at the start of another."""
    if isinstance(node, ast.Compare):
        return any(_is_text(side) and " " in side.value for side in (node.left, *node.comparators))
    names = ("startswith", "endswith", "removeprefix", "partition")
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in names
    return is_call and any(_is_text(part) and " " in part.value.strip() for part in node.args)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def counts(package: Path) -> Counter[str]:
    """The counts over a package, without recheck and the edge."""
    total: Counter[str] = Counter(dict.fromkeys(KINDS, 0))
    for path in sorted(package.rglob("*.py")):
        if not path.relative_to(package).as_posix().startswith(("recheck/", *EDGE)):
            total.update(kind for kind, _ in found(ast.parse(path.read_text(encoding="utf-8"))))
    return total
