"""Plans and numbers that are hard for the search: symmetry about the origin, points far away, radii that underflow."""

from dataclasses import replace
from fractions import Fraction

import pytest
from systems import plain_model

from tubecert.claims.family import Reason
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.expression import constant, symbol
from tubecert.expression.parse import parse
from tubecert.model import rank_decision
from tubecert.pipeline import Options, certify
from tubecert.records import from_json
from tubecert.spec import Knots, load_text
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.trajectory.plan import constant_plan
from tubecert.tube import Tube, containment

x, y, z = symbol("x"), symbol("y"), symbol("z")
ZERO, ONE = constant(0), constant(1)
EYE = ((ONE, ZERO), (ZERO, ONE))
LINEAR = replace(plain_model(("x", "y"), ("y - x", "-y"), [["0"], ["1"]]), W=EYE, rate=Fraction(1, 2))


def knots(*rows: str) -> Knots:
    """Knots from lines of t, x, y, u."""
    table = [tuple(map(Fraction, row.split())) for row in rows]
    t, x, u = (tuple(row[part] for row in table) for part in (0, slice(1, 3), slice(3, None)))
    return Knots(t=t, x=x, u=u, interpolation="linear")


def test_a_plan_at_rest_is_no_harder_than_an_equilibrium():
    """About the origin a norm has the same value at opposite vertices: it must be split all the same."""
    plan = piecewise_plan(LINEAR, knots("0 0 0 0", "1 0 0 0"))
    tube = Tube(plan, 0.4, states=("x", "y"), inputs=("u",), time=(Fraction(0), Fraction(1)))
    found = supremum(SumOfNorms([LINEAR.drift_on_plan()]), tube, Effort())
    assert found.above <= 1.01 * found.below
    assert found.boxes < 20_000


@pytest.mark.slow
@pytest.mark.parametrize(
    "f",
    [(y - x, -y, -z), (-x, -y, -z), (y - x, -y, Fraction(1, 3) - z), (x * y, y * z - Fraction(1, 5), x * z)],
    ids=["coupled", "isotropic", "shifted", "bilinear"],
)
def test_drifts_that_are_symmetric_about_the_plan_are_bounded(f):
    plan = constant_plan([Fraction(0)] * 3, [Fraction(0)], None)
    tube = Tube(plan, 0.4, states=("x", "y", "z"), inputs=("u",), time=None)
    found = supremum(SumOfNorms([tuple((e,) for e in f)]), tube, Effort(budget=200_000))
    assert found.above <= 1.0101 * found.below


SPEC = """tubecert: 1
name: hard
system: {states: [x, y], inputs: [u], f: ["-x + y", "-y"], B: [[0], [1]]}
safe_set: {x: [-1.8, 1.8], y: [-2, 2]}
uncertainty: {h: ["0.05*sin(t)"]}
metric: {rate: 0.5, dual_metric: [[1, 0], [0, 1]]}
trajectory: {kind: equilibrium, at: [0, 0]}
"""
TUBE = "tube: {epsilon: 0.3, rho_a: 0.1}\n"


def verdict(text: str):
    """The verdict and the claim that decided it."""
    result = certify(load_text(text, "spec.yaml"), Options()).to_json()
    reason = from_json(Reason, result["reasons"][-1], "reason")
    return result["verdict"], reason.claim.title, reason.message


def test_a_start_beyond_all_squares_is_refuted():
    word, claim, message = verdict(SPEC + TUBE + "initial_state: {at: [1e300, -1e300]}\n")
    assert (word, claim) == ("refuted", "assumption 1: the tube lies in the safe set")
    assert "the tube leaves the safe set" in message


@pytest.mark.parametrize("start", ["", "initial_state: {within: 1e-290}\n"])
def test_a_radius_whose_square_underflows_is_undecided(start):
    word, claim, _ = verdict(SPEC + "tube: {epsilon: 1e-300, rho_a: 1e-300}\n" + start)
    assert (word, claim) == ("undecided", "radius of the tube")


@pytest.mark.parametrize(("lower", "start"), [("1e-300", "0"), ("1e-300", "1e-3"), ("1e-250", "1e250")])
def test_declared_bounds_of_the_metric_may_be_absurd(lower, start):
    absurd = SPEC.replace("rate: 0.5,", f"rate: 0.5, bounds: {{lower: {lower}, upper: 1e250}},")
    word, claim, message = verdict(absurd + TUBE + f"initial_state: {{at: [{start}, 0]}}\n")
    assert (word, claim) == ("undecided", "radius of the tube")
    assert "beyond the range of numbers" in message


@pytest.mark.slow
def test_inputs_that_are_nearly_parallel_are_no_crash():
    """The closed form of the feedback gain holds nowhere: its bound is infinite, and the exact one stands."""
    two = SPEC.replace("[u], f:", "[u, v], f:").replace("[[0], [1]]", '[[1, 1], [1, "1 + 1e-9"]]')
    word, _, _ = verdict(two.replace('["0.05*sin(t)"]', '["0.05*sin(t)", "0"]') + TUBE)
    assert word == "certified"


def far_beyond(data: Knots, horizon: Fraction | None, f) -> str:
    model = replace(LINEAR, f=f)
    box = ((Fraction(-9, 5), Fraction(9, 5)), (Fraction(-2), Fraction(2)))
    return containment(
        piecewise_plan(model, data, horizon), Fraction(2, 5), ("x", "y"), box, Effort(budget=20_000)
    ).verdict


def test_a_knot_beyond_the_horizon_refutes_nothing():
    """f is undefined at the last knot, which shapes the last piece but is not reached."""
    f = (y - x + x / (x - Fraction(19, 10)), -y)
    data = knots("0 0 0 0", "1 0 0 0", "2 1.9 0 1")
    assert far_beyond(data, Fraction(3, 2), f) == "undecided"
    assert far_beyond(data, None, f) == "refuted"


@pytest.mark.slow
def test_a_curve_far_outside_is_refuted_within_few_boxes():
    assert far_beyond(knots("0 0 0 0", "1 1e300 0 0"), None, LINEAR.f) == "refuted"


@pytest.mark.parametrize("entry", ["1", "2 + sin(x25)"])
def test_many_inputs_are_no_hang(entry):
    """Of 32 states and 16 inputs there are 6e8 minors; B = (0, D) has one that matters."""
    names = tuple(f"x{i}" for i in range(32))
    value = parse(entry, symbols={name: symbol(name) for name in names}).expression
    B = tuple(tuple(value if i == 16 + j else ZERO for j in range(16)) for i in range(32))
    model = replace(LINEAR, states=names, inputs=tuple(f"u{j}" for j in range(16)), f=(ZERO,) * 32, B=B)
    decision = rank_decision(model, [(Fraction(-1), Fraction(1))] * 32, Effort())
    assert decision.verdict == "certified"
    assert len(model.pivots[0]) == 1


@pytest.mark.slow
def test_a_minor_that_is_not_the_only_one_refutes_nothing():
    """Each of x and y vanishes somewhere, both together never: B = (x, y) on a set without the origin."""
    model = replace(LINEAR, B=((x,), (y,)))
    box = [(Fraction(-1), Fraction(1)), (Fraction(1, 2), Fraction(1))]
    assert rank_decision(model, box, Effort()).verdict == "certified"
    both = replace(LINEAR, B=((x,), (y - x**2,)))
    around = [box[0], (Fraction(-1, 8), Fraction(1))]
    assert rank_decision(both, around, Effort(budget=2_000)).verdict == "refuted"
