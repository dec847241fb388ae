"""The rank of B and what must hold for expressions to be defined: proven where it holds, never where it does not."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from systems import plain_model

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import constant, graph, substitute, symbol
from tubecert.expression.matrix import Matrix, multiply, transpose
from tubecert.model import ControlAffineModel, domain_findings, rank_decision
from tubecert.spec import load_text

STATES = ("x", "y", "z")
EFFORT = Effort(budget=500)


def model(B: list[list[str]]) -> ControlAffineModel:
    return plain_model(STATES[: len(B)], ["0"] * len(B), B)


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
    assert verdict(FULL[name]) == "certified"


@pytest.mark.slow
@pytest.mark.parametrize("name", DEFICIENT)
@pytest.mark.parametrize("side", [("-1", "1"), ("-1", "1/3"), ("-1", "0.5")])
def test_a_rank_that_is_lost_somewhere_is_never_proven(name: str, side: tuple[str, str]) -> None:
    """Where det(B'B) reaches 0, however gently; being >= 0 it always is."""
    assert verdict(DEFICIENT[name], side) != "certified"


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
    assert verdict([["x"], ["1 - 3*x"]]) == "certified"
    assert verdict([["x", "0"], ["1 - 3*x", "0"], ["0", "1"]]) == "certified"


def affine(n: int, m: int) -> ControlAffineModel:
    """A dense B, affine in the states, of full rank about the origin."""
    rng = np.random.default_rng(n * m)
    states = tuple(f"x{i}" for i in range(n))
    B = tuple(
        tuple(
            constant(int(rng.integers(1, 9))) + int(rng.integers(1, 9)) * symbol(states[rng.integers(n)])
            for _ in range(m)
        )
        for _ in range(n)
    )
    inputs = tuple(f"u{j}" for j in range(m))
    return replace(model([["1"]]), states=states, inputs=inputs, f=(constant(0),) * n, B=B)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "m"), [(6, 5), (8, 6), (9, 7), (24, 12)])
@pytest.mark.parametrize("half", ["1/1000", "1"])
def test_the_rank_of_a_large_B_has_a_budget(n: int, m: int, half: str) -> None:
    """Of its minors there may be millions, of m! terms each: work is counted in nodes of expressions and in boxes."""
    before = next(graph._serial)
    found = rank_decision(affine(n, m), [(-Fraction(half), Fraction(half))] * n, Effort())
    assert next(graph._serial) - before < 60_000
    assert found.boxes < 25_000
    assert found.verdict == ("certified" if half != "1" else "undecided")


@pytest.mark.slow
def test_a_dependence_of_many_columns_is_shown_with_its_point() -> None:
    """A point of few digits, evaluated exactly, where nothing was written out."""
    plant = affine(9, 7)
    zero = {name: constant(0) for name in plant.states}
    last = [substitute([row[0]], zero)[0] + symbol("x3") for row in plant.B]
    B = tuple((*row[:-1], e) for row, e in zip(plant.B, last, strict=True))
    found = rank_decision(replace(plant, B=B), [(Fraction(-1, 2), Fraction(1, 2))] * 9, Effort())
    assert found.verdict == "refuted"
    assert set(found.at.values()) == {0}


def test_a_constant_minor_is_exact() -> None:
    """Of a size that floats do not hold: its square is 1e-600."""
    assert verdict([["1e-300"], ["x"]]) == "certified"
    assert verdict([["1e-300*x + 1e-300"], ["0"]]) != "certified"


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
        ("0*log(x)", ["TC201"]),
        ("0*log(x + 1.5)", []),
        ("0*asin(1.5*x)", ["TC201"]),
        ("0*acos(0.99*x)", []),
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


@pytest.mark.parametrize("rows", [(0, 1), (0, 2), (1, 2)])
def test_what_inputs_do_not_reach_is_solved_for_by_any_rows(rows):
    own = model([["1 + x**2", "y"], ["z", "2 - y"], ["x*y", "1 + z**2"]])
    basis = own.annihilator_by(rows)
    found = multiply(own.columns, basis)
    assert [len(basis), len(basis[0])] == [3, 1]
    for at in (
        {"x": Fraction(1, 3), "y": Fraction(-1, 2), "z": Fraction(1, 5)},
        dict.fromkeys(STATES, Fraction(2, 7)),
    ):
        given = {name: constant(value) for name, value in at.items()}
        assert all(e.fraction == 0 for row in found for e in substitute(row, given))
        assert any(e.fraction != 0 for row in basis for e in substitute(row, given))
