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
    ".": (1989, 18, 31),
    "bounds": (2374, 15, 21),
    "certificate": (1505, 10, 45),
    "checking": (490, 5, 5),
    "claims": (829, 12, 75),
    "cli": (3685, 34, 23),
    "conditions": (1688, 16, 22),
    "controller": (419, 5, 3),
    "enclosure": (2941, 18, 41),
    "expression": (2566, 15, 16),
    "kinds": (683, 7, 19),
    "library": (3252, 22, 30),
    "lint": (1158, 8, 3),
    "loop_design": (1169, 9, 7),
    "metric": (527, 3, 4),
    "model": (558, 5, 1),
    "pipeline": (2349, 16, 13),
    "planner": (708, 5, 10),
    "recheck": (13158, 87, 138),
    "report": (6163, 46, 44),
    "sampled_loop": (1889, 9, 32),
    "search": (961, 8, 6),
    "simulation": (5293, 34, 77),
    "spec": (5822, 30, 52),
    "stages": (1309, 10, 13),
    "sweep": (517, 5, 8),
    "synthesis": (4017, 28, 37),
    "trajectory": (949, 7, 8),
    "tube": (647, 4, 6),
    "words": (1011, 7, 0),
}  # fmt: skip
FUNCTIONS = 4750  # of the package
TEST_LINES = 44_400


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
