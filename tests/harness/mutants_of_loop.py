"""Mutants of the theorem of the sampled loop, or of its twin in the checker, by a stated seed: which are not noticed.

    python tests/harness/mutants_of_loop.py theorem --count 200 --seed 34
    python tests/harness/mutants_of_loop.py recheck --count 200 --seed 34

A mutant is one place of the code with another comparison, sign, factor, number, choice of max or min, or a term less.
It is killed if a certificate that holds is no longer certified or confirmed (a tube is .1 % wider than the least, so
bounds that are merely larger are killed as well), if a forged one is, or if one of the fast tests fails.
"""

import argparse
import ast
import json
import os
import random
import signal
import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests/recheck/sampled_loop")]

import pytest  # noqa: E402
import sampled_files as files  # noqa: E402
import test_sampled_forged as forged  # noqa: E402

from tubecert.loop_design.certification import certify  # noqa: E402
from tubecert.sampled_loop.record import certificate_text  # noqa: E402
from tubecert.spec import load, load_text  # noqa: E402

SIDES = {
    "theorem": ("tubecert.sampled_loop", ("theorem", "responses", "remainders"), ("tests/sampled_loop",)),
    "recheck": (
        "tubecert.recheck.sampled_loop",
        ("theorem", "remainders", "claims"),
        ("tests/recheck/sampled_loop",),
    ),
}
FEW_SECONDS = 150  # of the processor
DEAR = 2  # certificates, the last ones
SHOWN = ("test_a_lie_is_not_confirmed", "test_the_proof_of_an_easier_question_is_none_of_a_harder_one")
SWAPPED = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.LtE, ast.LtE: ast.Lt,
    ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.In: ast.NotIn, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
NAMES = {"max": "min", "min": "max", "maximum": "minimum", "minimum": "maximum", "lo": "hi", "hi": "lo"}
NAMES |= {"abs_upper": "abs_lower", "all": "any", "any": "all", "ceil": "floor", "above": "mid", "rad": "mid"}


def mutations(node):
    """What may stand in the place of a node."""
    if isinstance(node, (ast.BinOp, ast.BoolOp)) and (other := SWAPPED.get(type(node.op))):
        yield "operator", lambda own: setattr(own, "op", other())
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Mult, ast.MatMult)):
        yield "left", lambda own: own.left
        yield "right", lambda own: own.right
    if isinstance(node, ast.AugAssign) and (other := SWAPPED.get(type(node.op))):
        yield "operator", lambda own: setattr(own, "op", other())
        yield "dropped", lambda own: ast.Pass()
    if isinstance(node, ast.Compare) and (other := SWAPPED.get(type(node.ops[0]))):
        yield "comparison", lambda own: own.ops.__setitem__(0, other())
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield (
            "number",
            lambda own: setattr(
                own, "value", own.value + 1 if type(own.value) is int else own.value / 2 or 1.0
            ),
        )
    if isinstance(node, ast.Attribute) and node.attr in NAMES:
        yield "name", lambda own: setattr(own, "attr", NAMES[own.attr])
    if isinstance(node, ast.Name) and node.id in NAMES:
        yield "name", lambda own: setattr(own, "id", NAMES[own.id])
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        yield "sign", lambda own: own.operand
    if isinstance(node, (ast.List, ast.Tuple)) and isinstance(node.ctx, ast.Load) and len(node.elts) > 1:
        yield "entry", lambda own: own.elts.__delitem__(-1)


class Changed(ast.NodeTransformer):
    """One node in another form."""

    def __init__(self, target, change):
        self.target, self.change = target, change

    def visit(self, node):
        if node is not self.target:
            return self.generic_visit(node)
        other = self.change(node)
        return node if other is None else other


def places(tree):
    """All nodes that compute something, in their order: no annotations."""
    said = {
        id(part)
        for node in ast.walk(tree)
        for field in ("annotation", "returns")
        if isinstance(own := getattr(node, field, None), ast.AST)
        for part in ast.walk(own)
    }
    return [node for node in ast.walk(tree) if id(node) not in said]


def drawn(package, modules, count, seed):
    """(module, place, which change of it), at random."""
    every = []
    for name in modules:
        tree = ast.parse((ROOT / package.replace(".", "/") / f"{name}.py").read_text())
        every += [(name, i, k) for i, node in enumerate(places(tree)) for k, _ in enumerate(mutations(node))]
    return random.Random(seed).sample(every, min(count, len(every)))


class Finder(MetaPathFinder, Loader):
    """Imports one module from a changed tree."""

    def __init__(self, name, tree):
        self.name, self.tree = name, tree

    def find_spec(self, name, path, target=None):
        return ModuleSpec(name, self) if name == self.name else None

    def exec_module(self, module):
        exec(compile(self.tree, self.name, "exec"), module.__dict__)


def documents():
    """Certificates that hold, and forged ones."""
    texts = (files.SCALAR, files.CART, files.SWING, files.PAIR)
    specs = [
        load(f"{ROOT}/configs/hardware_{name}.yaml")
        for name in ("three", "car_family", "state_dependent_input")
    ]
    good = [*map(files.made, texts), *(json.loads(certificate_text(certify(spec))) for spec in specs)]
    bad = [
        files.changed(files.made(text), *path, to=to)
        for text, path, to in forged.LIES.values()
        if path[0] != "lacks"
    ]
    return good, [*bad, *(forged.retold(*own) for own in forged.EASIER.values())]


def says(side, document):
    """Whether this side holds a certificate to be true."""
    if side == "recheck":
        from tubecert.recheck.run import recheck

        return recheck(json.dumps(document), "certificate").exit_code == 0
    from tubecert.model import build
    from tubecert.records import from_json
    from tubecert.sampled_loop import record, setting, theorem
    from tubecert.trajectory.make import plan_of

    own = document["result"]
    spec = load_text(json.dumps(own["spec"]["effective"]))
    nominal, tables, recipe = (
        from_json(kind, own[key], key)
        for kind, key in (
            (record.Nominal, "nominal"),
            (record.Tables, "controller"),
            (record.Recipe, "recipe"),
        )
    )
    stages = [from_json(record.Stage, stage, "tube") for stage in own["tube"]]
    model, slow = build(spec), recipe.parameters == "slow"
    matrices = {key: getattr(nominal, key) for key in "ABE"}
    loop = setting.Loop(spec=spec, model=model, plan=plan_of(spec, model), knots=None, slow=slow, **matrices)
    return theorem.check(loop, tables, stages, recipe).verdict.value == "certified"


def killer(side, package, tests, good, bad):
    """What notices; "" if nothing does."""
    for name in [
        own
        for own in sys.modules
        if own.startswith(
            (package, "tubecert.loop_design", "tubecert.recheck.run", "sampled_files", "small_loops", "test_")
        )
    ]:
        del sys.modules[name]
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
    steps = (  # what is cheap and notices much comes first
        ("good", lambda: not all(holds(side, own) for own in good[:-DEAR])),
        ("tests", lambda: failing(tests, "not slow")),
        ("good", lambda: not all(holds(side, own) for own in good[-DEAR:])),
        ("forged", lambda: any(holds(side, own) for own in bad)),
        ("tests", lambda: failing(tests, "slow")),
    )
    return next((name for name, notices in steps if notices()), "")


def failing(tests, which):
    """Whether one of the tests fails; but for those of the forged certificates, which are shown before."""
    how = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", which, "-k", f"not ({' or '.join(SHOWN)})"]
    return pytest.main([*tests, *how]) not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)


def noticed(side, finders, good, bad):
    """What `killer` says in a process of its own, with what it imports by these; "time" if that does not end."""
    package, _, tests = SIDES[side]
    ended, told = os.pipe()
    if not (child := os.fork()):
        signal.setitimer(signal.ITIMER_PROF, FEW_SECONDS)
        sys.meta_path[:0] = finders
        os.write(told, killer(side, package, tests, good, bad).encode() or b"-")
        os._exit(0)
    os.close(told)
    by = os.read(ended, 99).decode() or "time"
    os.close(ended)
    os.waitpid(child, 0)
    return by


def main():
    """Count the dead, and name who lives."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("side", choices=SIDES)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=34)
    parser.add_argument("--only", type=int, nargs="*", help="which of them, by number")
    given = parser.parse_args()
    package, modules, _ = SIDES[given.side]
    good, bad = documents()
    assert all(says(given.side, own) for own in good)
    bad = [own for own in bad if not holds(given.side, own)]
    failing(SIDES[given.side][-1], "slow and not slow")  # imports what the tests do
    assert noticed(given.side, [], good, bad) == "-"
    killed = 0
    for number, (name, place, which) in enumerate(drawn(package, modules, given.count, given.seed)):
        if given.only is not None and number not in given.only:
            continue
        tree = ast.parse((ROOT / package.replace(".", "/") / f"{name}.py").read_text())
        node = places(tree)[place]
        before, (kind, change) = ast.unparse(node), list(mutations(node))[which]
        tree = ast.fix_missing_locations(Changed(node, change).visit(tree))
        by = noticed(given.side, [Finder(f"{package}.{name}", tree)], good, bad)
        killed += by != "-"
        print(f"{number} {by} {name}:{node.lineno} {kind} {before}", flush=True)
    print(f"{killed} killed")
    return 0


def holds(side, document):
    """`says`, of a document that may not even be one."""
    try:
        return says(side, document)
    except Exception:
        return False


if __name__ == "__main__":
    sys.exit(main())
