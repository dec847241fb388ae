"""The rank of B and what must hold for expressions to be defined: proven where it holds, never where it does not."""

from __future__ import annotations

from fractions import Fraction

import pytest

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import constant, parse, symbol
from tubecert.expression.matrix import Matrix, multiply, transpose
from tubecert.model import ControlAffineModel, domain_findings, rank_decision
from tubecert.spec import load_text

STATES = ("x", "y", "z")
SYMBOLS = {name: symbol(name) for name in STATES}
EFFORT = Effort(budget=3_000)


def model(B: list[list[str]]) -> ControlAffineModel:
    n = len(B)
    return ControlAffineModel(
        states=STATES[:n],
        inputs=tuple(f"u{j}" for j in range(len(B[0]))),
        f=(constant(0),) * n,
        B=tuple(tuple(parse(e, symbols=SYMBOLS).expression for e in row) for row in B),
        W=(),
        rate=Fraction(1),
        h=None,
    )


def verdict(B: list[list[str]], side: tuple[str, str] = ("-1", "1")) -> str:
    box = [(Fraction(side[0]), Fraction(side[1]))] * len(B)
    return rank_decision(model(B), box, EFFORT).verdict


FULL = {
    "a constant": [["0"], ["1"]],
    "one of two never vanishes": [["x"], ["y - 2"]],
    "neither alone, both together": [["x"], ["1 - x"]],
    "on a circle": [["sin(3*x)"], ["cos(3*x)"]],
    "two columns": [["1", "x"], ["x", "2"], ["y", "0"]],
    "of different rows": [["x", "0"], ["1 - x", "0"], ["0", "1"]],
}
DEFICIENT = {
    "at a corner": [["x + 1"], ["y + 1"]],
    "inside": [["x"], ["y"]],
    "at a third": [["3*x - 1"], ["3*y - 1"]],
    "of even order": [["(3*x - 1)**2"], ["(3*y - 1)**2"]],
    "where both rows are": [["x*y", "x"], ["y", "1"], ["0", "0"]],
    "on a line": [["x - y"], ["2*x - 2*y"]],
    "of two columns": [["x", "y"], ["y", "x"], ["0", "x + y"]],
    "the only minor": [["x - 1/3"], ["0"]],
    "the only minor, of one sign": [["(x - 1/3)**2"], ["0"]],
}


@pytest.mark.parametrize("name", FULL)
def test_full_rank_is_proven(name: str) -> None:
    assert verdict(FULL[name]) == "proven"


@pytest.mark.slow
@pytest.mark.parametrize("name", DEFICIENT)
@pytest.mark.parametrize("side", [("-1", "1"), ("-1", "1/3"), ("-1", "0.5")])
def test_a_rank_that_is_lost_somewhere_is_never_proven(name: str, side: tuple[str, str]) -> None:
    """Where det(B'B) reaches 0, however gently; being >= 0 it always is."""
    assert verdict(DEFICIENT[name], side) != "proven"


@pytest.mark.slow
def test_a_lost_rank_is_shown_with_its_point() -> None:
    found = rank_decision(model([["x"], ["y"]]), [(Fraction(-1), Fraction(1))] * 2, EFFORT)
    assert found.verdict == "refuted"
    assert found.at == {"x": 0, "y": 0}
    found = rank_decision(model([["x - 1/3"], ["0"]]), [(Fraction(-1), Fraction(1))] * 2, EFFORT)
    assert found.verdict == "refuted"
    assert abs(found.at["x"] - 1 / 3) < 1e-12


def test_one_minor_among_several_refutes_nothing() -> None:
    """x changes its sign, and so does 1 - 3 x, but not where x does."""
    assert verdict([["x"], ["1 - 3*x"]]) == "proven"
    assert verdict([["x", "0"], ["1 - 3*x", "0"], ["0", "1"]]) == "proven"


def test_the_gram_matrix_is_that_of_the_columns() -> None:
    plant = model([["x", "1"], ["y", "z"], ["2", "x*y"]])
    assert plant.gram == multiply(transpose(plant.B), plant.B)
    inverse: Matrix = multiply(plant.B_pinv, plant.B)
    assert len(inverse) == 2


SPEC = """
tubecert: 1
name: owing
system: {states: [x, y], inputs: [u], f: ["F", "-y"], B: [[0], ["G"]]}
safe_set: {x: [-1, 1], y: [-1, 1]}
uncertainty: {h: ["H"]}
trajectory: {kind: expressions, x: ["P", "0"], u: [0], horizon: 4}
metric: {rate: 0.5, dual_metric: [["W", 0], [0, 1]]}
"""


def codes(**given: str) -> list[str]:
    text = SPEC
    for key, plain in {"F": "-x", "G": "1", "H": "0", "P": "0", "W": "1"}.items():
        text = text.replace(f'"{key}"', f'"{given.get(key, plain)}"')
    return [f.code for f in domain_findings(load_text(text), (Fraction(0), Fraction(4)), EFFORT)]


@pytest.mark.slow
@pytest.mark.parametrize("key", ["F", "G", "H", "W"])
@pytest.mark.parametrize(
    ("owed", "expected"),
    [
        ("0/(x - 2)", []),
        ("0/(2 - x)", []),
        ("0*sqrt(x + 2)", []),
        ("0*tan(x)", []),
        ("0/x", ["TC201"]),
        ("0/(3*x - 1)", ["TC201"]),
        ("0/(x + 1)", ["TC202"]),  # at the edge: no point of either sign
        ("0/(x - 1/3)**2", ["TC202"]),  # of one sign all the same
        ("0/(9*x**2 - 6*x + 1)", ["TC202"]),
        ("0*sqrt(x)", ["TC201"]),
        ("0*sqrt(x + 1)", ["TC202"]),
        ("0*sqrt((3*x - 1)**2)", ["TC202"]),
        ("0*tan(2*x)", ["TC201"]),
    ],
)
def test_what_is_owed_is_proven_on_the_safe_set(key: str, owed: str, expected: list[str]) -> None:
    plain = {"F": "-x", "G": "1", "H": "0", "W": "1"}[key]
    assert codes(**{key: f"{plain} + {owed}"}) == expected


@pytest.mark.parametrize("key", ["H", "P"])
def test_what_is_owed_over_time_is_proven_to_the_horizon(key: str) -> None:
    assert codes(**{key: "0/(t - 5)"}) == []
    assert codes(**{key: "0/(t - 3)"}) == ["TC201"]
    assert codes(**{key: "0*sqrt(4 - t)"}) == ["TC202"]
    assert codes(**{key: "0*sqrt(4.01 - t)"}) == []
