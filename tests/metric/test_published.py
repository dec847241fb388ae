"""The gallery of published metrics: what is said of each is locked, and every refutation is confirmed at 50 digits.

The witness of a refutation is evaluated from the text of the file with Python's own parser and the intervals of
mpmath: none of the code under test takes part but for the point that it names.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import run
from mpmath import iv

GALLERY = Path(__file__).parents[2] / "configs" / "published"
TABLE = json.loads((GALLERY / "verified.json").read_text("utf-8"))
FILES = sorted(GALLERY.glob("*.yaml"))
DIGITS = 50
WORDS = {"certified": "holds", "refuted": "refuted"}

Point = dict[str, Fraction]


def number(value: Any) -> Any:
    """An exact number as an interval."""
    q = Fraction(str(value))
    return iv.mpf(q.numerator) / q.denominator


class Series:
    """a + b e with e^2 = 0: a value and its derivative along one direction."""

    def __init__(self, value: Any, slope: Any = None) -> None:
        self.value, self.slope = value, iv.mpf(0) if slope is None else slope

    def _other(self, other: Any) -> Series:
        return other if isinstance(other, Series) else Series(number(other))

    def __add__(self, other: Any) -> Series:
        o = self._other(other)
        return Series(self.value + o.value, self.slope + o.slope)

    def __neg__(self) -> Series:
        return Series(-self.value, -self.slope)

    def __pos__(self) -> Series:
        return self

    def __sub__(self, other: Any) -> Series:
        return self + (-self._other(other))

    def __rsub__(self, other: Any) -> Series:
        return self._other(other) - self

    def __mul__(self, other: Any) -> Series:
        o = self._other(other)
        return Series(self.value * o.value, self.slope * o.value + self.value * o.slope)

    def __truediv__(self, other: Any) -> Series:
        o = self._other(other)
        return Series(
            self.value / o.value, (self.slope * o.value - self.value * o.slope) / (o.value * o.value)
        )

    def __rtruediv__(self, other: Any) -> Series:
        return self._other(other) / self

    def __pow__(self, n: int) -> Series:
        return Series(self.value**n, n * self.value ** (n - 1) * self.slope)

    __radd__, __rmul__ = __add__, __mul__


def sin(x: Any) -> Series:
    return Series(iv.sin(x.value), iv.cos(x.value) * x.slope)


def cos(x: Any) -> Series:
    return Series(iv.cos(x.value), -iv.sin(x.value) * x.slope)


def tan(x: Any) -> Series:
    return sin(x) / cos(x)


def evaluated(text: str, names: dict[str, Any]) -> Series:
    """An expression by Python's parser, its numbers taken exactly."""
    import ast

    class Exact(ast.NodeTransformer):
        def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
            if isinstance(node.op, ast.Pow):  # the exponent stays a whole number
                return ast.BinOp(self.visit(node.left), node.op, node.right)
            return self.generic_visit(node)

        def visit_Constant(self, node: ast.Constant) -> ast.AST:
            written = ast.get_source_segment(text, node)
            call = ast.Call(ast.Name("exactly", ast.Load()), [ast.Constant(written)], [])
            return ast.copy_location(call, node)

    tree = ast.fix_missing_locations(Exact().visit(ast.parse(text, mode="eval")))
    found = eval(compile(tree, "<expression>", "eval"), {"__builtins__": {}}, names)
    return found if isinstance(found, Series) else Series(number(found))


def functions(spec: dict[str, Any]) -> dict[str, Any]:
    known: dict[str, Any] = {"sin": sin, "cos": cos, "tan": tan, "exactly": lambda text: Series(number(text))}
    for name, value in (spec["system"].get("parameters") or {}).items():
        known[name] = evaluated(str(value), known)
    return known


def matrices(spec: dict[str, Any], at: Point) -> tuple[Any, Any, Any, Any]:
    """W, its derivative along f, f_x and B at a point, as intervals."""
    states, known = spec["system"]["states"], functions(spec)

    def along(texts: list[Any], direction: dict[str, Any]) -> list[Series]:
        names = known | {x: Series(number(at[x]), direction.get(x)) for x in states}
        return [evaluated(str(text), names) for text in texts]

    f = [item.value for item in along(spec["system"]["f"], {})]
    rows = spec["metric"]["dual_metric"]
    W = [along(row, dict(zip(states, f, strict=True))) for row in rows]
    columns = [[item.slope for item in along(spec["system"]["f"], {x: iv.mpf(1)})] for x in states]
    B = [[item.value for item in along(row, {})] for row in spec["system"]["B"]]
    value = iv.matrix([[item.value for item in row] for row in W])
    moved = iv.matrix([[item.slope for item in row] for row in W])
    return value, moved, iv.matrix(columns).T, iv.matrix(B)


def form(v: Any, A: Any) -> Any:
    return (v.T * A * v)[0, 0]


def floats(A: Any) -> np.ndarray:
    return np.array([[float(A[i, j].mid) for j in range(A.cols)] for i in range(A.rows)])


def violates(spec: dict[str, Any], claim: str, at: Point, rate: Fraction) -> bool:
    """Whether W is not positive at a point, or C2 fails for a vector that the inputs do not act on."""
    if claim == "metric_killing":
        return moves_along_inputs(spec, at)
    W, moved, f_x, B = matrices(spec, at)
    if claim == "metric_definite":
        v = exact_vector(np.linalg.eigh(floats(W))[1][:, 0])
        return bool(form(v, W) < 0)
    F = f_x * W + W * f_x.T - moved + W * (2 * number(rate))
    free = np.linalg.svd(floats(B).T)[2][B.cols :].T
    direction = free @ np.linalg.eigh(free.T @ floats(F) @ free)[1][:, -1]
    v = exact_vector(direction)
    v = v - B * iv.lu_solve(B.T * B, B.T * v)  # what is left of v in the range of B is taken out in intervals
    return bool(form(v, F) > 0)


def moves_along_inputs(spec: dict[str, Any], at: Point) -> bool:
    """Whether W changes along a constant column of B: then C3 fails."""
    states, known = spec["system"]["states"], functions(spec)
    assert all(text.strip("()-").replace(".", "").isdigit() for row in spec["system"]["B"] for text in row)
    for column in zip(*spec["system"]["B"], strict=True):
        direction = dict(zip(states, map(number, column), strict=True))
        names = known | {x: Series(number(at[x]), direction[x]) for x in states}
        entries = [evaluated(text, names) for row in spec["metric"]["dual_metric"] for text in row]
        if any(bool(entry.slope != 0) for entry in entries):
            return True
    return False


def exact_vector(v: np.ndarray) -> Any:
    return iv.matrix([number(Fraction(float(x))) for x in v])


@contextmanager
def digits(count: int) -> Iterator[None]:
    """Intervals of so many digits; the default of mpmath afterwards."""
    before, iv.dps = iv.dps, count
    try:
        yield
    finally:
        iv.dps = before


REFUTED = [each for each in TABLE if each["verdict"] == "refuted" and "at" in each.get("reason", {})]


@pytest.mark.slow
def test_the_table_is_about_the_files():
    assert sorted(Path(each["file"]).name for each in TABLE) == [path.name for path in FILES]
    for each in TABLE:
        expect = yaml.safe_load((GALLERY / Path(each["file"]).name).read_text("utf-8"))["expect"]
        assert expect["metric"] == WORDS[each["verdict"]]


@pytest.mark.slow
@pytest.mark.parametrize("each", REFUTED, ids=lambda each: each["name"])
def test_every_witness_is_confirmed_at_fifty_digits(each):
    spec = yaml.load((GALLERY / Path(each["file"]).name).read_text("utf-8"), Loader=yaml.BaseLoader)
    reason = each["reason"]
    at = {
        x: Fraction(str(value)) for x, value in zip(spec["system"]["states"], reason["at"]["x"], strict=True)
    }
    for x, (low, high) in each["safe_set"].items():
        assert Fraction(str(low)) <= at[x] <= Fraction(str(high)), "the witness lies in the set"
    with digits(DIGITS):
        assert violates(spec, reason["claim"], at, Fraction(str(each["rate"])))
        # at the rate that is said to hold there is nothing to object to at this point
        if reason["claim"] == "metric_contraction" and each["largest_rate"][0] > 0:
            assert not violates(spec, reason["claim"], at, Fraction(str(each["largest_rate"][0])))


FOUND = json.loads((GALLERY / "found" / "verified.json").read_text("utf-8"))


def beside() -> dict[str, tuple[dict[str, Any], dict[str, Any], bool]]:
    """For each published metric the file of the one found for it, what is proven of that, and if the set is its own."""
    made = {}
    for each in FOUND:
        text = (GALLERY / "found" / Path(each["file"]).name).read_text("utf-8")
        names = text.splitlines()[0].removeprefix("# for: ").split(", ")
        spec = yaml.load(text, Loader=yaml.BaseLoader)
        same = "\n# beside: " not in text
        made |= {name: (spec, each, same) for name in names if same or name not in made}
    return made


@pytest.mark.slow
def test_beside_each_that_is_refuted_stands_one_that_holds_on_its_set_at_its_rate():
    found = beside()
    assert sorted(found) == sorted(each["name"] for each in TABLE if each["verdict"] == "refuted")
    assert {path.name for path in (GALLERY / "found").glob("*.yaml")} == {Path(e["file"]).name for e in FOUND}
    for each in (each for each in TABLE if each["name"] in found):
        spec, proven, same = found[each["name"]]
        assert (proven["verdict"], spec["expect"]["metric"]) == ("certified", "holds")
        assert proven["largest_rate"][0] >= Fraction(spec["metric"]["rate"]) >= Fraction(str(each["rate"]))
        assert same == (each["name"] != "rmp_quadrotor")
        if same:
            text = (GALLERY / Path(each["file"]).name).read_text("utf-8")
            published = yaml.load(text, Loader=yaml.BaseLoader)
            assert (spec["system"], spec["safe_set"]) == (published["system"], published["safe_set"])


@pytest.mark.slow
@pytest.mark.parametrize("each", REFUTED, ids=lambda each: each["name"])
def test_the_one_beside_it_holds_where_it_fails(each):
    spec, _, same = beside()[each["name"]]
    if not same:
        return
    point = zip(spec["system"]["states"], each["reason"]["at"]["x"], strict=True)
    at = {x: Fraction(str(value)) for x, value in point}
    with digits(DIGITS):
        for claim in ("metric_definite", "metric_contraction"):
            assert not violates(spec, claim, at, Fraction(spec["metric"]["rate"]))


@pytest.mark.slow
def test_what_was_found_is_verified_again():
    path = GALLERY / "found" / "rmp_quadrotor_accelerations.yaml"
    assert run("verify", path, "--expect").exit_code == 0
