"""Who may say "certified": trusted modules, what they import, and where the verdict is made."""

import ast
from pathlib import Path

import pytest

import tubecert

PACKAGE = Path(tubecert.__file__).parent

# What a certificate rests on. Everything else proposes, composes, shows or falsifies.
# (what workers prove is believed: they run the same program, docs/guarantee.md)
TRUSTED_ROOMS = {
    "errors", "findings", "claims", "records", "digits", "verdict", "letters", "progress", "printable",
    "files", "leash", "executor", "expression", "spec", "enclosure", "model", "coordinates", "metric",
    "trajectory", "tube", "bounds", "conditions", "kernel", "kinds", "certificate", "stages", "recheck",
    "sampled_loop",
}  # fmt: skip
SAYS_CERTIFIED = "kernel.py"  # the one module in which gains become certified
ALSO_SAY = {  # of one claim each, no gains
    "bounds/clearance.py": "the tube keeps away from an obstacle",
    "conditions/inputs.py": "an input stays within its limits",
    "enclosure/branch_and_bound.py": "an objective stays below a threshold",
    "model/rank.py": "the rank of a B with a minor that is a constant",
    "metric/verify.py": "C1-C3",
    "tube/containment.py": "the tube lies in the safe set",
    "sampled_loop/theorem.py": "a sampled loop keeps its tube",
    "sampled_loop/obstacles.py": "its tube keeps away from an obstacle",
}


def name_of(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


def room_of(name: str) -> str:
    return (
        name.split(".")[1]
        if name.startswith("tubecert.")
        else name.split("/", maxsplit=1)[0].removesuffix(".py")
    )


MODULES = sorted(PACKAGE.rglob("*.py"))
TRUSTED = [path for path in MODULES if room_of(name_of(path)) in TRUSTED_ROOMS]


@pytest.fixture(scope="module")
def nodes():
    """What the rules below look at, of every module, which is read once: imports, calls and attributes."""
    kinds = (ast.ImportFrom, ast.Import, ast.Call, ast.Attribute)
    found = {}
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        asked = compared(tree)
        found[name_of(path)] = [(node, node in asked) for node in ast.walk(tree) if isinstance(node, kinds)]
    return found


@pytest.mark.slow
def test_what_is_trusted_imports_only_what_is_trusted(nodes):
    wrong = []
    for module in map(name_of, TRUSTED):
        for node, _ in nodes[module]:
            names = []
            if isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            wrong += [
                f"{module}:{node.lineno} imports {name}"
                for name in names
                if name.startswith("tubecert.") and room_of(name) not in TRUSTED_ROOMS
            ]
    assert not wrong


def compared(tree: ast.AST) -> set[ast.AST]:
    """Nodes that are only compared with: sides of comparisons, patterns, keys."""
    found: set[ast.AST] = set()
    for node in ast.walk(tree):
        match node:
            case ast.Compare():
                found |= {node.left, *node.comparators}
            case ast.MatchValue():
                found.add(node.value)
            case ast.Dict():
                found |= {key for key in node.keys if key is not None}
    return found


@pytest.mark.slow
def test_gains_become_certified_in_one_module_only(nodes):
    """`Verdict.CERTIFIED` may be compared with anywhere; of gains it is made in the kernel alone."""
    made = {
        module
        for module, each in nodes.items()
        for node, asked in each
        if isinstance(node, ast.Attribute) and node.attr == "CERTIFIED" and not asked
        if isinstance(node.value, ast.Name) and node.value.id == "Verdict"
    }
    assert made == {SAYS_CERTIFIED, *ALSO_SAY}


PROOFS = {  # by whom alone each is called
    "Proof": {SAYS_CERTIFIED},
    "MetricProof": {"metric/verify.py"},
    "Containment": {"tube/containment.py"},
}


@pytest.mark.slow
def test_proofs_are_made_by_the_kernel_alone(nodes):
    """Nobody else calls `Proof`, nor goes round its constructor."""
    called = {name: set() for name in PROOFS}
    for module, each in nodes.items():
        for node, _ in each:
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in PROOFS:
                called[node.func.id].add(module)
    assert called == PROOFS


_BOUND = "the safe side of a constant, which is a float by definition"
_ENDS = "ends of an interval, put in for a variable that a formula is monotone in"
_POINT = "a point that was chosen: it need not be near anything"
TAKES_FLOATS = {  # `Interval.exact`, by module: why the float is what is meant, and not near it
    "bounds/affine.py": "0; rho, a bound; s, any will do",
    "bounds/clearance.py": f"{_BOUND}; {_POINT}",
    "bounds/compute.py": _BOUND,
    "bounds/level.py": _BOUND,
    "bounds/linear.py": "rho, rounded up by the caller",
    "bounds/multiplier.py": f"{_BOUND}; rho, rounded up by the caller",
    "bounds/start.py": f"{_BOUND}; 0; the congruence T, any will do",
    "bounds/suprema.py": "1",
    "conditions/arithmetic.py": f"{_ENDS}; -inf",
    "conditions/distance.py": f"{_ENDS}; where a fixed point is approached from below",
    "conditions/kernels.py": _ENDS,
    "conditions/problem.py": _BOUND,
    "enclosure/interval.py": "powers; small integers",
    "enclosure/lookup.py": _ENDS,
    "enclosure/objective.py": _BOUND,
    "enclosure/tape.py": "no number",
    "enclosure/taylor.py": f"corners of a box; {_POINT}",
    "metric/geodesic.py": "rho, rounded up by the caller",
    "metric/verify.py": "1",
    "model/affine.py": "0 and 1",
    "sampled_loop/matrices.py": "A, any will do; 0 and 1",
    "sampled_loop/remainders.py": "A, B and E, any will do; 0",
    "sampled_loop/responses.py": "A, B, tables and rows, any will do",
    "stages/bounded.py": _BOUND,
    "stages/tube.py": _BOUND,
    "trajectory/hermite.py": _POINT,
    "trajectory/plan.py": _POINT,
    "tube/sections.py": _POINT,
}


@pytest.mark.slow
def test_floats_are_taken_as_exact_where_they_are(nodes):
    """A float that was computed, measured or sampled says nothing of its error, and bounds nothing."""
    found = {
        module
        for module in map(name_of, TRUSTED)
        if room_of(module) != "recheck"
        for node, _ in nodes[module]
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "Interval.exact"
    }
    assert found == set(TAKES_FLOATS)
