"""How large each room may be. Numbers are lowered when a room shrinks, and never raised; a new room has its own row."""

import ast
from collections import Counter
from operator import gt
from pathlib import Path

import tubecert

PACKAGE = Path(tubecert.__file__).parent
TESTS = Path(__file__).parents[1]
OWN = "."  # the modules beside the rooms
BUDGET = {  # room: lines, modules, classes
    ".": (2357, 19, 39),
    "bounds": (2313, 13, 21),
    "certificate": (1449, 7, 43),
    "checking": (482, 5, 5),
    "claims": (1174, 8, 58),
    "cli": (2307, 21, 11),
    "conditions": (1537, 11, 19),
    "controller": (490, 6, 4),
    "enclosure": (2819, 14, 34),
    "expression": (2458, 15, 16),
    "kinds": (514, 6, 13),
    "library": (2725, 20, 22),
    "lint": (1203, 9, 3),
    "loop_design": (1173, 9, 7),
    "metric": (534, 3, 4),
    "model": (516, 4, 1),
    "pipeline": (2360, 16, 12),
    "planner": (701, 4, 10),
    "recheck": (12458, 60, 131),
    "report": (5474, 39, 34),
    "sampled_loop": (1530, 9, 26),
    "search": (960, 8, 6),
    "simulation": (4950, 32, 64),
    "spec": (5529, 29, 52),
    "stages": (1328, 10, 13),
    "sweep": (517, 5, 8),
    "synthesis": (3631, 15, 36),
    "trajectory": (939, 5, 8),
    "tube": (584, 4, 5),
    "words": (339, 3, 0),
}  # fmt: skip
FUNCTIONS = 4505  # of the package
TEST_LINES = 44_460


def counted() -> dict[str, tuple[int, int, int]]:
    """Lines, modules and classes by room."""
    lines, modules, classes = Counter[str](), Counter[str](), Counter[str]()
    for path in PACKAGE.rglob("*.py"):
        inside = path.relative_to(PACKAGE).parts
        room = inside[0] if len(inside) > 1 else OWN
        text = path.read_text(encoding="utf-8")
        lines[room] += len(text.splitlines())
        modules[room] += 1
        classes[room] += sum(isinstance(node, ast.ClassDef) for node in ast.walk(ast.parse(text)))
    return {room: (lines[room], modules[room], classes[room]) for room in lines}


def test_no_room_is_larger_than_its_budget():
    found = counted()
    assert found.keys() == BUDGET.keys()
    pairs = {room: (own, BUDGET[room]) for room, own in found.items()}
    above = {room: each for room, each in pairs.items() if any(map(gt, *each))}
    assert not above, "room: (lines, modules, classes) and what there may be"


def test_functions_and_tests_keep_to_their_budgets():
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")]
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    assert sum(isinstance(node, kinds) for tree in trees for node in ast.walk(tree)) <= FUNCTIONS
    assert (
        sum(len(path.read_text(encoding="utf-8").splitlines()) for path in TESTS.rglob("*.py")) <= TEST_LINES
    )
