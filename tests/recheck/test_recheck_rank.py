"""B has full rank on the whole safe set: a claim of every certificate, whatever its shape and kind (R20).

C2 is about the null space of B', so it shows the rank where there are fewer inputs than states; certificate 0 needs no
left inverse. Where there are as many inputs as states nothing else asks for it.
"""

from fractions import Fraction
from types import SimpleNamespace

import pytest
from rechecked import case_of, certified, examine, failing, respecified, sealed, terms
from systems import SMALL

from tubecert.recheck import metric
from tubecert.recheck.kinds.rates import DERIVED

NAME = "rank(B) = m on the safe set"

SQUARE = """
tubecert: 1
name: square
system:
  states: [x, y]
  inputs: [u, v]
  f: [x, y]
  B: [[1, 0], [0, 1]]
safe_set: {x: [-1, 1], y: [-1, 1]}
uncertainty: {h: [0, 0]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0, 0]}
initial_state: {at: [0.05, 0]}
metric: {rate: 1, dual_metric: [[1, 0], [0, 1]]}
tube: {epsilon: 0.2, rho_a: 0.1}
conditions: {decides: "0"}
"""


def with_B(rows):
    """A certificate 0 whose B is another, with all that is known of its inverse left out, and both hashes right."""
    honest = certified(SQUARE.replace("[[1, 0], [0, 1]]\nsafe", "[[1, 1], [1, 3]]\nsafe"), conditions=None)

    def change(effective):
        effective["system"]["B"] = rows

    document = respecified(honest, change)
    result = document["result"]
    for name in ("B_pinv", "B_pinv_x", "feedback_gain"):
        result["constants"][name]["above"] = None
    for name in ("B_x", "b_x"):  # of B that moves
        result["constants"][name]["above"] = 10.0
    result["constants"] = {key: own for key, own in result["constants"].items() if key not in DERIVED}
    for key in ("conditions_26", "distance"):
        left = {"verdict": "undecided", "shortfalls": []}
        result[key] = {name: left.get(name) for name in result[key]}
    result["proof"] = {"no_adaptation": {}}
    return sealed(document)


def outcome(rows, budget=2_000):
    return metric.full_rank(case_of(with_B(rows)).system, budget)


@pytest.mark.parametrize(
    "rows",
    [
        [["1", "1"], ["1", "1"]],
        [["1", "-y"], ["0", "x"]],
        [["1", "-1"], ["-1", "1"]],
        [["0", "0"], ["0", "1"]],
    ],
    ids=["constant", "lost on a line", "opposite", "a column of zeros"],
)
def test_dependent_columns_of_a_square_B_are_a_contradiction(rows):
    """The first two were confirmed; certify refutes them: x - y grows whatever u is."""
    assert outcome(rows).verdict == "contradicted"
    found = examine(with_B(rows), 2_000)
    assert [name for name, _ in failing(found)] == [NAME]
    assert found.verdict == "contradicted"


def test_a_zero_that_no_point_shows_is_not_confirmed():
    """det B = (x - 1/3)^2 has no sign change."""
    assert outcome([["1", "0"], ["0", "(x - 1/3)**2"]]).verdict == "undecided"


@pytest.mark.parametrize(
    "rows",
    [[["1", "0"], ["0", "1"]], [["2", "x"], ["y", "1"]], [["-1", "0"], ["sin(x)", "1"]]],
    ids=["identity", "moving", "negative"],
)
def test_full_rank_is_confirmed(rows):
    assert outcome(rows).verdict == "confirmed"


@pytest.mark.parametrize("shape", [(3, 1), (3, 2), (5, 5)])
def test_every_shape_is_asked(shape):
    """More states than inputs, and more columns than a determinant is written out for: by B'B."""
    n, m = shape
    states, inputs = [f"x{i}" for i in range(n)], [f"u{i}" for i in range(m)]
    B = [[str(int(i == j)) for j in range(m)] for i in range(n)]
    good = _system(states, inputs, B)
    assert metric.full_rank(good, 100).verdict == "confirmed"
    for row in B:
        row[-1] = row[0] if m > 1 else "0"
    assert not metric.full_rank(_system(states, inputs, B), 100).holds


def test_more_inputs_than_states_have_no_full_rank():
    assert metric.full_rank(_system(["x"], ["u", "v"], [["1", "1"]]), 100).verdict == "contradicted"


@pytest.mark.slow
@pytest.mark.parametrize("conditions", ["no_adaptation", "distance", "all"])
def test_the_claim_stands_in_every_certificate(conditions):
    for text in (SMALL, SQUARE.replace('"0"', '"all"')):
        found = examine(certified(text, conditions=conditions))
        assert NAME in [claim.name for claim in found.claims]
        assert found.verdict == "confirmed"


def _system(states, inputs, B):
    rows = [terms(row, states) for row in B]
    box = {name: (Fraction(-1), Fraction(1)) for name in states}
    return SimpleNamespace(states=tuple(states), inputs=tuple(inputs), B=rows, safe_set=box, time=None)
