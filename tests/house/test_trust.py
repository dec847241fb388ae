"""Who may say "certified": trusted modules, what they import, and where the verdict is made."""

import ast
from pathlib import Path

import pytest

import tubecert

PACKAGE = Path(tubecert.__file__).parent

# What a certificate rests on. Everything else proposes, composes, shows or falsifies.
TRUSTED_ROOMS = {
    "errors",
    "findings",
    "claims",
    "records",
    "verdict",
    "letters",
    "progress",
    "printable",
    "files",
    "expression",
    "spec",
    "enclosure",
    "model",
    "coordinates",
    "metric",
    "trajectory",
    "tube",
    "bounds",
    "conditions",
    "kernel",
    "kinds",
    "certificate",
    "stages",
    "recheck",
}
SAYS_CERTIFIED = "kernel.py"  # the one module in which gains become certified
ALSO_SAY = {  # of one claim each, no gains
    "bounds/clearance.py": "the tube keeps away from an obstacle",
    "conditions/inputs.py": "an input stays within its limits",
    "enclosure/branch_and_bound.py": "an objective stays below a threshold",
    "model.py": "the rank of a B with a minor that is a constant",
    "metric/verify.py": "C1-C3",
    "tube/containment.py": "the tube lies in the safe set",
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


@pytest.mark.slow
@pytest.mark.parametrize("path", TRUSTED, ids=name_of)
def test_what_is_trusted_imports_only_what_is_trusted(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            if name.startswith("tubecert."):
                assert room_of(name) in TRUSTED_ROOMS, f"line {node.lineno} imports {name}"


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


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_gains_become_certified_in_one_module_only(path):
    """`Verdict.CERTIFIED` may be compared with anywhere; of gains it is made in the kernel alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    asked = compared(tree)
    made = [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr == "CERTIFIED" and node not in asked
        if isinstance(node.value, ast.Name) and node.value.id == "Verdict"
    ]
    assert not made or name_of(path) in {SAYS_CERTIFIED, *ALSO_SAY}, made


@pytest.mark.slow
@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_proofs_are_made_by_the_kernel_alone(path):
    """Nobody else calls `Proof`, nor goes round its constructor."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    called = {
        node.func.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert "Proof" not in called or name_of(path) == SAYS_CERTIFIED
    assert "MetricProof" not in called or name_of(path) == "metric/verify.py"
    assert "Containment" not in called or name_of(path) in {
        "tube/containment.py",
        "bounds/compute.py",
        "bounds/level.py",
    }


_BOUND = "the safe side of a constant, which is a float by definition"
_ENDS = "ends of an interval, put in for a variable that a formula is monotone in"
_POINT = "a point that was chosen: it need not be near anything"
TAKES_FLOATS = {  # `Interval.exact`, by module: why the float is what is meant, and not near it
    "bounds/affine.py": "0; rho, a bound; s, any will do",
    "bounds/clearance.py": f"{_BOUND}; {_POINT}",
    "bounds/compute.py": _BOUND,
    "bounds/level.py": _BOUND,
    "bounds/start.py": f"{_BOUND}; 0; the congruence T, any will do",
    "bounds/suprema.py": "1",
    "conditions/arithmetic.py": f"{_ENDS}; -inf",
    "conditions/distance.py": f"{_ENDS}; where a fixed point is approached from below",
    "conditions/hardware/loop.py": _BOUND,
    "conditions/kernels.py": _ENDS,
    "conditions/machine.py": _BOUND,
    "conditions/problem.py": _BOUND,
    "enclosure/interval.py": "powers; small integers",
    "enclosure/metric_norm.py": _BOUND,
    "enclosure/objective.py": "0; the congruence T, any will do",
    "enclosure/tape.py": "no number",
    "enclosure/taylor.py": f"corners of a box; {_POINT}",
    "kinds/hardware.py": _BOUND,
    "metric/geodesic.py": "rho, rounded up by the caller",
    "metric/verify.py": "1",
    "model.py": "0 and 1",
    "stages/bounded.py": _BOUND,
    "stages/tube.py": _BOUND,
    "trajectory/hermite.py": _POINT,
    "trajectory/plan.py": _POINT,
    "tube/sections.py": _POINT,
}


@pytest.mark.slow
def test_floats_are_taken_as_exact_where_they_are():
    """A float that was computed, measured or sampled says nothing of its error, and bounds nothing."""
    found = {
        name_of(path)
        for path in TRUSTED
        if room_of(name_of(path)) != "recheck"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "Interval.exact"
    }
    assert found == set(TAKES_FLOATS)
