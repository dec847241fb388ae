"""C1, C2 and C3 on the whole set: what must be certified is, what must be refused is, with a witness that holds."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
import scipy.linalg
from balls import exactly as q
from balls import prove
from flint import arb, ctx
from systems import (
    BOX_THREE,
    BOX_TWO,
    PRINTED_THREE,
    PRINTED_TWO,
    matrix_of,
    plain_model,
    polynomial_three,
    scaled,
    three_forms,
    three_state,
    times,
    two_forms,
    two_state,
)

from tubecert.claims.family import Reason
from tubecert.claims.statements import MetricContraction, MetricDefinite, MetricKilling
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import constant, substitute
from tubecert.metric import verify
from tubecert.metric.verify import verify_metric
from tubecert.verdict import Verdict

EFFORT = Effort()


@pytest.fixture(autouse=True)
def precision():
    before, ctx.prec = ctx.prec, 200
    yield
    ctx.prec = before


def verdict_of(model, box, effort=EFFORT):
    return verify_metric(model, box, effort)


def exact(e, model, x):
    """An expression at a rational point; everything here is polynomial, so the value is rational."""
    values = dict(zip(model.states, map(constant, x), strict=True))
    return substitute([e], values)[0].fraction


def restricted(model, x, rate):
    """B_perp'(F_0 + 2 rate W)B_perp at a rational point, exactly."""
    form = [[exact(e, model, x) for e in row] for row in model.drift_form]
    W = [[exact(e, model, x) for e in row] for row in model.W]
    n = len(W)
    F = [[form[i][j] + 2 * rate * W[i][j] for j in range(n)] for i in range(n)]
    basis = [[e.fraction for e in row] for row in model.annihilator]
    return times([list(r) for r in zip(*basis, strict=True)], times(F, basis))


def is_negative_definite(m):
    """By Sylvester's criterion, for 1 x 1 and 2 x 2, exact or in balls (then: proven)."""
    if len(m) == 1:
        return bool(m[0][0] < 0)
    return bool(m[0][0] < 0) and bool(m[0][0] * m[1][1] - m[0][1] * m[1][0] > 0)


def has_a_positive_direction(m):
    """Whether some v has v'mv > 0, exactly."""
    if len(m) == 1:
        return m[0][0] > 0
    return m[0][0] > 0 or m[1][1] > 0 or m[0][0] * m[1][1] - m[0][1] * m[1][0] < 0


def why(proof):
    """What a proof says that failed."""
    return Reason(claim=proof.failed, verdict=Verdict(proof.verdict)).message


def assert_witness(model, proof, rate, box):
    """The refutation re-evaluated at its point in exact arithmetic."""
    assert proof.verdict == "refuted"
    assert isinstance(proof.failed, MetricContraction)
    x = [Fraction(v) for v in proof.at.x]
    assert all(lo <= v <= hi for v, (lo, hi) in zip(x, box, strict=True))
    assert has_a_positive_direction(restricted(model, x, rate))


@pytest.mark.slow
def test_the_five_digit_three_state_metric_is_certified():
    proof = verdict_of(three_state(), BOX_THREE)
    assert proof.verdict == "certified"
    assert proof.largest_rate.below <= 0.999998100 <= proof.largest_rate.above + 1e-6
    assert round(proof.largest_rate.above, 6) == 0.999998
    assert 0 < proof.margin.below < 9.81e-5 < proof.margin.above + 1e-8
    assert verify_metric(three_state(), BOX_THREE, EFFORT, closely=True).margin.below > 9.7e-5
    assert proof.lower_on_set.below <= 3.87523 <= proof.lower_on_set.above + 1e-4
    assert proof.upper_on_set.above == pytest.approx(5.8403, abs=1e-4)


@pytest.mark.slow
def test_where_c2_holds_with_room_a_hundredth_of_the_rate_is_enough(monkeypatch):
    """Nothing that is claimed needs more digits, and each costs as much as all before it."""
    asked, model = [], three_state(rate="1/2")
    searched = verify.supremum

    def noted(objective, domain, effort):
        asked.append(effort.absolute)
        return searched(objective, domain, effort)

    monkeypatch.setattr(verify, "supremum", noted)
    rate = verify_metric(model, BOX_THREE, EFFORT).largest_rate
    assert asked[2:] == [0.005]  # after the bounds of M
    assert 1e-4 < rate.above - rate.below <= 0.005
    assert rate.below <= 0.999998 <= rate.above + 1e-6


@pytest.mark.slow
def test_at_rate_one_it_is_refuted_with_a_witness_that_holds():
    model = three_state(rate="1")
    proof = verdict_of(model, BOX_THREE)
    assert_witness(model, proof, Fraction(1), BOX_THREE)
    assert "0.999998" in why(proof)
    assert proof.margin.above < 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "box", "largest"),
    [(three_state(PRINTED_THREE, rate="1"), BOX_THREE, 0.99654), (two_state(PRINTED_TWO), BOX_TWO, 1.73934)],
    ids=["three_state", "two_state"],
)
def test_metrics_as_printed_in_the_paper_are_refuted(model, box, largest):
    proof = verdict_of(model, box)
    assert_witness(model, proof, model.rate, box)
    assert proof.largest_rate.below == pytest.approx(largest, abs=1e-5)
    assert proof.largest_rate.above == pytest.approx(largest, abs=1e-5)
    # and the rate that it names is supported
    named = Fraction(why(proof).split()[-1])
    assert verdict_of(replace(model, rate=named), box).verdict == "certified"


def test_the_five_digit_two_state_metric_is_certified():
    proof = verdict_of(two_state(), BOX_TWO)
    assert proof.verdict == "certified"
    assert proof.largest_rate.below == pytest.approx(1.74358, abs=2e-5)
    assert proof.lower_on_set.above == pytest.approx(0.20086, abs=1e-5)
    assert proof.upper_on_set.above == pytest.approx(0.32823, abs=1e-5)


@pytest.mark.slow
def test_c2_of_the_three_state_system_holds_in_ball_arithmetic():
    def contracts(x):
        forms = three_forms([x[0], arb("nan"), x[1]], q)  # x2 does not enter
        return is_negative_definite(
            [[forms["F0"][i][j] + 2 * q("0.95") * forms["W"][i][j] for j in range(2)] for i in range(2)]
        )

    assert prove([BOX_THREE[0], BOX_THREE[2]], contracts, 3000) > 1


def test_c2_of_the_two_state_system_holds_in_ball_arithmetic():
    def contracts(x):
        forms = two_forms([arb("nan"), x[0]], q)  # x1 does not enter
        v = [q("2"), q("0.5")]
        total = sum(
            v[i] * v[j] * (forms["F0"][i][j] + 2 * q("1.7") * forms["W"][i][j])
            for i in range(2)
            for j in range(2)
        )
        return bool(total < 0)

    prove([BOX_TWO[1]], contracts, 3000)


@pytest.mark.slow
def test_eigenvalues_of_w_are_bounded_in_ball_arithmetic():
    proof = verdict_of(three_state(), BOX_THREE)
    largest, least = 1 / proof.lower_on_set.below, 1 / proof.upper_on_set.above

    def bounded(x):
        W = three_forms(x, q)["W"]
        low = [
            [W[i][j] - (arb(least) * (1 - arb("1e-3")) if i == j else 0) for j in range(3)] for i in range(3)
        ]
        high = [
            [(arb(largest) * (1 + arb("1e-3")) if i == j else 0) - W[i][j] for j in range(3)]
            for i in range(3)
        ]
        return positive_definite(low) and positive_definite(high)

    prove([BOX_THREE[0]], lambda x: bounded([x[0], arb(0), arb(0)]), 3000)


def positive_definite(m):
    """Proven by the leading minors of a 3 x 3 matrix of balls."""
    second = m[0][0] * m[1][1] - m[0][1] * m[1][0]
    third = (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )
    return bool(m[0][0] > 0) and bool(second > 0) and bool(third > 0)


def test_the_models_forms_are_those_written_by_hand():
    x = [Fraction(3, 70), Fraction(-1, 13), Fraction(1, 11)]
    model, forms = three_state(), three_forms(x, Fraction)
    for name, rows in (("drift_form", "F0"), ("W", "W"), ("f_x", "f_x")):
        mine = [[exact(e, model, x) for e in row] for row in getattr(model, name)]
        assert mine == forms[rows]
    model, forms = two_state(), two_forms(x[:2], Fraction)
    assert [[exact(e, model, x[:2]) for e in row] for row in model.drift_form] == forms["F0"]


def sampled_rate(dW):
    """The largest rate of the three-state metric with W + dW, on a grid that has the corners: an upper bound of it."""
    axis = np.linspace(-0.1, 0.1, 21)
    found = np.inf
    for x1, x3 in product(axis, axis):
        forms = three_forms([x1, 0.0, x3], float)
        W = np.array(forms["W"]) + dW
        moved = np.array(forms["f_x"]) @ W
        F0 = moved + moved.T - forms["f"][0] * np.array(forms["W_1"])
        found = min(found, -np.max(scipy.linalg.eigh(F0[:2, :2], W[:2, :2], eigvals_only=True)) / 2)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("i", "j"), [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2)])
@pytest.mark.parametrize("sign", [1, -1])
def test_one_entry_moved_by_a_thousandth_is_judged_as_the_sampled_rate_says(i, j, sign):
    W, dW = polynomial_three(), np.zeros((3, 3))
    W[i][j] = W[j][i] = f"{W[i][j]} + ({sign}e-3)"
    dW[i, j] = dW[j, i] = sign * 1e-3
    model = three_state(W)
    proof = verdict_of(model, BOX_THREE)
    rate = sampled_rate(dW)
    assert proof.largest_rate.below <= rate + 1e-12
    assert proof.largest_rate.above >= rate - 2e-3
    if (i, j) == (1, 1):  # this entry hardly matters: the worst direction is that of x1
        assert rate > 0.9999
        assert proof.verdict == "certified"
    else:
        assert rate < 0.9999
        assert_witness(model, proof, model.rate, BOX_THREE)


@pytest.mark.slow
@pytest.mark.parametrize("wrong", range(7))
def test_a_wrong_sign_in_f_is_refused(wrong):
    terms = [["-x1", "x3"], ["x1**2", "-2*x1*x3", "-x2", "x3"], ["-x2"]]
    flat = [(i, k) for i, row in enumerate(terms) for k in range(len(row))]
    i, k = flat[wrong]
    terms[i][k] = f"-({terms[i][k]})"
    model = three_state(f=[" + ".join(f"({e})" for e in row) for row in terms])
    proof = verdict_of(model, BOX_THREE)
    if (i, k) == (2, 0):
        # the last row of f does not enter C2: it is matched by the input
        assert proof.verdict == "certified"
    else:
        assert_witness(model, proof, model.rate, BOX_THREE)


def test_a_metric_that_depends_on_an_actuated_state_is_refused():
    W = polynomial_three()
    W[0][0] = "0.20365 + 1e-9*x3"
    proof = verdict_of(three_state(W), BOX_THREE)
    assert proof.verdict == "refuted"
    assert isinstance(proof.failed, MetricKilling)
    assert proof.failed.input == "u"


@pytest.mark.slow
def test_a_killing_defect_that_vanishes_identically_is_no_defect():
    W = polynomial_three()
    W[0][0] = "0.20365*(sin(x3)**2 + cos(x3)**2)"
    assert verdict_of(three_state(W), BOX_THREE).verdict == "certified"


@pytest.mark.parametrize("entry", ["0.05*x1 - 0.004", "-0.2", "0", "x1**2"])
def test_a_metric_that_is_not_positive_is_refused(entry):
    W = polynomial_three()
    W[2][2] = entry
    proof = verdict_of(three_state(W), BOX_THREE, Effort(budget=20_000))
    assert isinstance(proof.failed, MetricDefinite)
    assert proof.verdict == "refuted"
    x = [Fraction(v) for v in proof.at.x]
    numbers = [[float(exact(e, three_state(W), x)) for e in row] for row in three_state(W).W]
    assert np.linalg.eigvalsh(np.array(numbers))[0] <= 1e-15


@pytest.mark.slow
def test_a_metric_that_vanishes_at_one_point_is_not_certified():
    proof = verdict_of(two_state([["1", "0"], ["0", "(x1 - 1/3)**2"]]), BOX_TWO, Effort(budget=20_000))
    assert isinstance(proof.failed, MetricDefinite)
    assert proof.verdict != "certified"


@pytest.mark.slow
def test_the_rate_is_judged_exactly():
    proof = verdict_of(three_state(), BOX_THREE)
    below, above = Fraction(proof.largest_rate.below), Fraction(proof.largest_rate.above)
    gap = above - below
    assert verdict_of(replace(three_state(), rate=below - gap), BOX_THREE).verdict == "certified"
    assert verdict_of(replace(three_state(), rate=above + gap), BOX_THREE).verdict == "refuted"


@pytest.mark.slow
def test_a_tiny_budget_is_undecided_never_certified():
    for budget in (1, 10, 30):
        proof = verdict_of(three_state(), BOX_THREE, Effort(budget=budget))
        assert proof.verdict == "undecided"
        assert proof.largest_rate.below <= 0.999998
        assert proof.largest_rate.above >= 0.999998


@pytest.mark.slow
def test_a_drift_that_cannot_be_bounded_within_the_budget_is_no_crash():
    f = ("-x1/(x1**2 - x1*x2 + x2**2 + 1/10)", "-x2")
    unit = matrix_of([["1", "0"], ["0", "1"]], ())
    model = replace(plain_model(("x1", "x2"), f, [["0"], ["1"]]), W=unit, rate=Fraction(1, 100))
    box = ((Fraction(-2), Fraction(2)),) * 2
    assert verdict_of(model, box, Effort(budget=1)).largest_rate.below == -np.inf
    proof = verdict_of(model, box)
    assert proof.verdict == "refuted"
    assert "no positive rate" in why(proof)


@pytest.mark.slow
@pytest.mark.parametrize("factor", ["1e-2", "0.3", "1e2"])
def test_scaling_the_metric_changes_no_rate(factor):
    plain = verdict_of(three_state(), BOX_THREE)
    proof = verdict_of(three_state(scaled(polynomial_three(), factor)), BOX_THREE)
    assert proof.verdict == "certified"
    assert proof.largest_rate.below == pytest.approx(plain.largest_rate.below, abs=2e-6)
    assert proof.lower_on_set.above * float(factor) == pytest.approx(plain.lower_on_set.above, rel=2e-4)
    assert proof.upper_on_set.above * float(factor) == pytest.approx(plain.upper_on_set.above, rel=2e-4)


@pytest.mark.slow
def test_permuted_states_change_no_rate():
    order = (2, 0, 1)
    model = three_state()
    states, f, B = (tuple(rows[i] for i in order) for rows in (model.states, model.f, model.B))
    moved = replace(
        model, states=states, f=f, B=B, W=tuple(tuple(model.W[i][j] for j in order) for i in order)
    )
    plain, proof = verdict_of(model, BOX_THREE), verdict_of(moved, BOX_THREE)
    assert proof.verdict == "certified"
    assert proof.largest_rate.below == pytest.approx(plain.largest_rate.below, abs=2e-6)
    assert proof.upper_on_set.above == pytest.approx(plain.upper_on_set.above, rel=2e-4)


def test_a_smaller_set_supports_no_smaller_rate():
    rates = []
    for half in ("0.1", "0.05", "0.01"):
        box = ((-Fraction(half), Fraction(half)),) * 3
        rates.append(verdict_of(three_state(PRINTED_THREE, rate="0.9"), box).largest_rate)
    for wide, narrow in pairwise(rates):
        assert narrow.above >= wide.below
        assert narrow.below >= wide.below - 1e-3


def turned(rate):
    """x' = R(c x) of a linear system in coordinates that make B depend on the state: y = (x1, x2 + x1^2/2)."""
    # x1' = -x1 + u, x2' = -2 x2  ->  y1' = -y1 + u, y2' = -2 (y2 - y1^2/2) + y1 (-y1 + u)
    f = ("-y1", "-2*y2 + y1**2 - y1**2")
    B = [["1"], ["y1"]]
    # W = J J' with J the Jacobian of the map, so that it is the identity in x
    W = [["1", "y1"], ["y1", "1 + y1**2"]]
    names = ("y1", "y2")
    return replace(plain_model(names, f, B), W=matrix_of(W, names), rate=Fraction(rate))


def test_an_input_that_depends_on_the_state_is_projected_out():
    # in x the actuated direction is x1 and the other contracts at rate 2, and so it must be in y
    box = ((Fraction(-1), Fraction(1)),) * 2
    proof = verdict_of(turned("1.9"), box)
    assert proof.verdict == "certified"
    assert proof.largest_rate.below == pytest.approx(2, abs=1e-2)
    assert proof.largest_rate.above >= 2
    refused = verdict_of(turned("2.01"), box)
    assert refused.verdict == "refuted"
    assert isinstance(refused.failed, MetricContraction)


@pytest.mark.slow
def test_finslers_lemma_agrees_with_the_moving_annihilator(monkeypatch):
    from tubecert.metric import verify

    box = ((Fraction(-1), Fraction(1)),) * 2
    direct = verdict_of(turned("1.9"), box)
    monkeypatch.setattr(verify, "_moving_annihilator", lambda *_: None)
    finsler = verdict_of(turned("1.9"), box)
    assert finsler.verdict == "certified"
    assert finsler.largest_rate.below <= direct.largest_rate.above
    assert direct.largest_rate.below <= finsler.largest_rate.above
    assert verdict_of(turned("2.01"), box).verdict == "refuted"


# -- mutations -----------------------------------------------------------------------------------------------
