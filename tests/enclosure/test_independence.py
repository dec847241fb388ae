"""Independent columns, proven by a left inverse: never where they are dependent, and whatever LAPACK says."""

from fractions import Fraction

import numpy as np
import pytest

from tubecert.enclosure.branch_and_bound import Effort, decide
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.objective import Dependence, Target
from tubecert.expression import constant, cos, parse, sin, symbol
from tubecert.expression.matrix import Matrix

NAMES = ("x", "y")
x, y = (symbol(name) for name in NAMES)
SYMBOLS = {"x": x, "y": y}
BOX = BoxDomain({"x": (Fraction(-1), Fraction(1)), "y": (Fraction(-1), Fraction(1))})


def read(rows: list[list[str]]) -> Matrix:
    return tuple(tuple(parse(e, symbols=SYMBOLS).expression for e in row) for row in rows)


def verdict(rows: list[list[str]]) -> str:
    return decide(Dependence(read(rows)), BOX, 1.0, Effort(budget=4_000)).verdict


@pytest.mark.parametrize(
    "rows",
    [
        [["1", "x/3"], ["y/3", "1"], ["x", "y"]],
        [["2 + sin(3*x)"], ["y"]],
        [["cos(2*x)", "-sin(2*x)"], ["sin(2*x)", "cos(2*x)"]],
        [["x"], ["1 - x"]],
    ],
)
def test_independent_columns_are_proven(rows: list[list[str]]) -> None:
    assert verdict(rows) == "certified"


@pytest.mark.slow
@pytest.mark.parametrize(
    "rows",
    [
        [["x"], ["y"]],
        [["3*x - 1"], ["3*y - 1"]],
        [["(3*x - 1)**2"], ["0"]],
        [["x", "y"], ["y", "x"]],
        [["1", "x"], ["x", "1"]],  # at two corners
        [["0"], ["0"]],
        [["1/x"], ["1"]],  # unbounded
    ],
)
def test_dependent_columns_are_never_proven(rows: list[list[str]]) -> None:
    assert verdict(rows) == "undecided"


@pytest.mark.slow
@pytest.mark.parametrize("lie", ["zero", "huge", "nan", "turned", "noise"])
def test_a_lying_inverse_proves_nothing_false(lie: str, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = np.linalg.pinv

    def pinv(a: np.ndarray) -> np.ndarray:
        inverse = honest(a)
        rng = np.random.default_rng(0)
        return {
            "zero": 0 * inverse,
            "huge": inverse * 1e200,
            "nan": inverse * np.nan,
            "turned": -inverse,
            "noise": inverse + rng.normal(size=inverse.shape),
        }[lie]

    monkeypatch.setattr(np.linalg, "pinv", pinv)
    for rows in ([["x", "y"], ["y", "x"]], [["3*x - 1"], ["3*y - 1"]]):
        assert verdict(rows) == "undecided"


def test_the_bound_holds_at_points_of_the_box() -> None:
    """For the R of each box |I - R B(x)| never exceeds the bound, in exact arithmetic up to 1e-12."""
    B = ((2 + sin(x), x * y), (y**2, cos(y) + 1), (x, constant(1)))
    objective = Dependence(B)
    rng = np.random.default_rng(1)
    lo = rng.uniform(-1, 0.8, (40, 2))
    hi = lo + rng.uniform(0, 0.2, (40, 2))
    seen: list[np.ndarray] = []
    honest = np.linalg.pinv
    np.linalg.pinv = lambda a: seen.append(honest(a)) or seen[-1]  # type: ignore[assignment,func-returns-value]
    try:
        bound = objective.upper(lo, hi, Target(1.0)).upper
    finally:
        np.linalg.pinv = honest  # type: ignore[assignment]
    for share in rng.uniform(0, 1, (200, 40, 2)):
        p, q = (lo + share * (hi - lo)).T
        value = np.moveaxis(
            np.array([[2 + np.sin(p), p * q], [q**2, np.cos(q) + 1], [p, np.ones(40)]]), -1, 0
        )
        norm = np.linalg.norm(np.eye(2) - seen[0] @ value, 2, axis=(-2, -1))
        assert (norm <= bound * (1 + 1e-12)).all()
