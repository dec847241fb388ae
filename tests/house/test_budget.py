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
    ".": (2296, 19, 39),
    "bounds": (2271, 13, 22),
    "certificate": (1518, 7, 42),
    "checking": (482, 5, 5),
    "claims": (1123, 8, 59),
    "cli": (1997, 17, 10),
    "conditions": (1510, 11, 18),
    "controller": (453, 6, 4),
    "enclosure": (2817, 14, 34),
    "expression": (2572, 13, 15),
    "kinds": (514, 6, 13),
    "library": (2560, 18, 23),
    "lint": (1221, 8, 3),
    "loop_design": (1193, 7, 8),
    "metric": (534, 3, 4),
    "model": (515, 4, 1),
    "pipeline": (2254, 13, 12),
    "planner": (697, 4, 10),
    "recheck": (12429, 58, 131),
    "report": (5083, 39, 27),
    "sampled_loop": (1536, 9, 26),
    "search": (862, 7, 7),
    "simulation": (4131, 26, 48),
    "spec": (4798, 24, 46),
    "stages": (1246, 7, 12),
    "sweep": (508, 5, 7),
    "synthesis": (3825, 16, 36),
    "trajectory": (947, 5, 8),
    "tube": (557, 4, 5),
    "words": (336, 3, 0),
}  # fmt: skip
FUNCTIONS = 4302  # of the package
TEST_LINES = 44_860


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
