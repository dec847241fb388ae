"""The corridor: rooms import only from earlier rooms, heavy libraries come late, nothing is evaluated."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import tubecert
from tubecert import kinds
from tubecert.recheck.kinds import table as recheck_kinds
from tubecert.recheck.specified.loop import LETTERS

PACKAGE = Path(tubecert.__file__).parent
ROOT = PACKAGE.parent
ROOMS = [
    "release", "errors", "printable", "findings", "files", "kept", "leash", "executor", "libraries",
    "verdict", "letters", "progress", "expression", "records", "digits", "recheck", "spec", "enclosure",
    "claims", "model", "coordinates", "metric", "synthesis", "trajectory", "planner", "tube", "bounds",
    "conditions", "kernel", "search", "lint", "kinds", "certificate", "sampled_loop",
    "loop_design", "controller", "stages", "words", "simulation",
    "pipeline", "checking", "sweep", "report", "asking", "library", "cli",
]  # fmt: skip
MODULES = sorted(PACKAGE.rglob("*.py"))
HEAVY = {
    "numpy", "scipy", "cvxpy", "clarabel", "yaml", "rich", "pydantic", "matplotlib", "jinja2", "flint",
    "distributed",
}  # fmt: skip
ALLOWED_AT_START = {"typer"}
FORBIDDEN_CALLS = {"eval", "exec", "compile", "sympify", "safe_load", "unsafe_load", "full_load", "load_all"}


def room_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).parts
    return parts[0].removesuffix(".py")


def imported(tree: ast.AST) -> set[str]:
    """Every module that a file imports, anywhere in it, under its full name."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            module = node.module or ""
            names |= {f"{module}.{a.name}" for a in node.names} if module == "tubecert" else {module}
    return names


def only_for_types(tree: ast.Module) -> set[ast.AST]:
    """Nodes below `if TYPE_CHECKING:`."""
    choices = [node for node in ast.walk(tree) if isinstance(node, ast.If)]
    blocks = [node for node in choices if ast.unparse(node.test) == "TYPE_CHECKING"]
    return {inner for block in blocks for inner in ast.walk(block)}


@pytest.mark.slow
def test_a_room_imports_only_from_earlier_rooms():
    wrong = []
    for path in MODULES:
        own = room_of(path)
        if own in {"__init__", "__main__"}:
            continue
        assert own in ROOMS, f"{own} is not a room of the corridor"
        tree = ast.parse(path.read_text(encoding="utf-8"))
        typed = only_for_types(tree)
        for node in ast.walk(tree):
            if node in typed or not isinstance(node, (ast.Import, ast.ImportFrom)):
                continue
            for name in imported(node):
                if name.startswith("tubecert."):
                    other = name.split(".")[1]
                    if ROOMS.index(other) > ROOMS.index(own):
                        wrong.append(f"{path}:{node.lineno}: {own} imports {other}")
    assert not wrong


@pytest.mark.parametrize(
    "path", [path for path in MODULES if room_of(path) == "recheck"], ids=lambda p: p.name
)
def test_recheck_shares_nothing_with_the_producer(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    rooms = {name.split(".")[1] for name in imported(tree) if name.startswith("tubecert.")}
    assert rooms <= {"errors", "findings", "recheck"}
    assert not {name.split(".")[0] for name in imported(tree)} & {"numpy", "scipy", "cvxpy", "sympy"}


@pytest.mark.slow
def test_recheck_knows_every_kind_and_no_other():
    """By a table of its own; beside the file of a kind, no file of the room names one."""
    own = [(kind.key, kind.adapts) for kind in recheck_kinds.KINDS]
    assert own == [(name.key, name.adapts) for name in kinds.NAMES]
    assert [*LETTERS.items()] == [(name.letter, name.key) for name in kinds.NAMES]
    for path in (PACKAGE / "recheck").glob("*.py"):
        texts = {n.value for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, ast.Constant)}
        assert not texts & set(recheck_kinds.KEYS), path.name


@pytest.mark.slow
def test_nothing_is_evaluated():
    wrong = []
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                function = node.func
                name = function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")
                qualified = isinstance(function, ast.Attribute) and ast.unparse(function) == "re.compile"
                if name in FORBIDDEN_CALLS and not qualified:
                    wrong.append(f"{path}:{node.lineno} calls {name}")
    assert not wrong


def loaded_by(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(' '.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return {name.split(".")[0] for name in done.stdout.split()}


@pytest.mark.slow
@pytest.mark.parametrize("statement", [
    "import tubecert.cli",
    "from typer.testing import CliRunner; from tubecert.cli.app import app; CliRunner().invoke(app, ['--help'])",
    "import tubecert as tc; dir(tc); tc.TubecertError, tc.Verdict",
    "import tubecert.expression",
    "import tubecert.errors, tubecert.findings",
    "from tubecert.report import pages; pages.find('TC302').text()",
])  # fmt: skip
def test_heavy_libraries_come_late(statement):
    assert not loaded_by(statement) & HEAVY


@pytest.mark.slow
def test_reading_a_specification_needs_no_numerics():
    statement = f"import tubecert.spec as s; s.load({str(ROOT / 'configs' / 'three_state.yaml')!r})"
    assert not loaded_by(statement) & {"numpy", "scipy", "cvxpy"}


def test_the_command_line_starts_with_typer_errors_and_names_only():
    for path in (PACKAGE / "cli" / "app.py", PACKAGE / "cli" / "adapter.py", PACKAGE / "cli" / "guard.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = set()
        for node in tree.body:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                names |= imported(node)
        own = {name for name in names if name.startswith("tubecert")}
        light = (
            "tubecert.cli",
            "tubecert.asking",
            "tubecert.errors",
            "tubecert.printable",
            "tubecert.letters",
        )
        assert all(name.startswith(light) for name in own), own
        foreign = {name.split(".")[0] for name in names - own} - set(sys.stdlib_module_names)
        assert foreign <= ALLOWED_AT_START


def test_no_two_test_files_share_a_name():
    """Without packages, pytest imports the tests of all rooms into one namespace."""
    names = [path.name for path in (ROOT / "tests").rglob("*.py")]
    assert sorted(names) == sorted(set(names))
