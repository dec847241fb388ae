"""Families that satisfy C3, rounding, the ladder, and solvers that lie: nothing is written that is not proven."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from systems import plain_model as model
from systems import values
from texts import OLDER_METRIC, ROOT

from tubecert.claims.failures import NotProven, VariableForbidden
from tubecert.claims.statements import MetricContraction
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import round_down
from tubecert.expression import is_zero
from tubecert.metric.verify import verify_metric
from tubecert.model import build
from tubecert.spec import load
from tubecert.synthesis import cegis, sos
from tubecert.synthesis.coefficients import with_metric_file
from tubecert.synthesis.diagnose import is_hurwitz, uncontrollable_mode
from tubecert.synthesis.family import FamilyError, invariants, metric_family, suggested
from tubecert.synthesis.ladder import Ladder, Request, routes, shrunk
from tubecert.synthesis.problem import Proposal
from tubecert.synthesis.rounding import rounded, shortest_proven

D = "(1 + 0.2*sin(th)**2)"
CART_POLE = model(
    ("x", "th", "v", "w"),
    (
        "v",
        "w",
        f"0.2*sin(th)*(0.5*w**2 - 9.81*cos(th))/{D}",
        f"(1.2*9.81*sin(th) - 0.1*w**2*cos(th)*sin(th))/(0.5*{D})",
    ),
    [["0"], ["0"], [f"1/{D}"], [f"-cos(th)/(0.5*{D})"]],
)
DET = "((3 + cos(q2))*0.5 - (0.5 + 0.5*cos(q2))**2)"
ARM = model(
    ("q1", "q2", "d1", "d2"),
    ("d1", "d2", "sin(q1)", "sin(q1 + q2)"),
    [
        ["0", "0"],
        ["0", "0"],
        [f"0.5/{DET}", f"-(0.5 + 0.5*cos(q2))/{DET}"],
        [f"-(0.5 + 0.5*cos(q2))/{DET}", f"(3 + cos(q2))/{DET}"],
    ],
)
OBLIQUE = model(("x", "y"), ("-x + 2*y", "-0.25*y**3 - 3*x + 4*y"), [["0.5"], ["-2"]])
ROLLING = model(("a", "b", "c"), ("b + sin(a)", "c - a**2", "-c"), [["0"], ["0"], ["1 + exp(a)/2"]])
MODELS = [CART_POLE, ARM, OBLIQUE, ROLLING]


@pytest.mark.slow
@pytest.mark.parametrize("system", MODELS, ids=["cart-pole", "arm", "oblique", "rolling"])
@settings(max_examples=2, deadline=None)
@given(seed=st.integers(0, 10**6), degree=st.integers(0, 2))
def test_every_member_of_a_family_satisfies_the_killing_condition(system, seed, degree):
    family = metric_family(system, degree=degree)
    rng = np.random.default_rng(seed)
    n = len(system.states)
    blocks = rng.integers(-9, 10, (len(family.functions), n, n))
    blocks = blocks + np.swapaxes(blocks, 1, 2)
    W = family.dual_metric([[[Fraction(int(v)) for v in row] for row in block] for block in blocks])
    moved = replace(system, W=W)
    for j in range(len(system.inputs)):
        assert all(is_zero(e) is True for row in moved.killing_defect(j) for e in row)


def test_what_the_killing_condition_forbids_is_refused_by_name():
    with pytest.raises(FamilyError) as caught:
        metric_family(CART_POLE, degree=1, variables=["v"])
    assert caught.value.failure == VariableForbidden(variable="v", permitted=("x", "th"))
    assert list(invariants(OBLIQUE)) == ["4*x + y"]
    assert list(suggested(CART_POLE)) == ["th"]


@pytest.mark.parametrize("system", MODELS, ids=["cart-pole", "arm", "oblique", "rolling"])
def test_frames_are_independent_everywhere(system):
    frame = metric_family(system, degree=0).frame
    n = len(frame)
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (200, n))
    assert np.abs(np.linalg.det(values(frame, system.states, points))).min() > 0.3


@pytest.mark.slow
@given(
    st.integers(2, 9), st.lists(st.floats(-1e3, 1e3).filter(lambda v: abs(v) > 1e-3), min_size=4, max_size=4)
)
def test_rounding_is_symmetric_and_as_near_as_its_digits(digits, entries):
    values = np.array(entries).reshape(1, 2, 2)
    exact = rounded(values, digits)
    symmetric = 0.5 * (values + np.swapaxes(values, 1, 2))
    own = np.sqrt(np.abs(np.diag(symmetric[0])))
    unit = np.outer(own, own) * 10.0 ** (1 - digits)
    assert exact[0][0][1] == exact[0][1][0]
    assert all((Fraction(10) ** 20 * q).denominator == 1 for row in exact[0] for q in row)
    assert (np.abs(np.array(exact, dtype=float) - symmetric) <= 0.5 * unit * (1 + 1e-9)).all()


@given(st.floats(1e-6, 1e6), st.integers(1, 6))
def test_digits_rounded_down_are_below(value, digits):
    low = round_down(value, digits)
    assert 0 < low <= Fraction(value) <= low * (1 + Fraction(10) ** (1 - digits))


@given(st.integers(1, 4).flatmap(lambda n: st.lists(st.integers(-4, 4), min_size=n * n, max_size=n * n)))
def test_hurwitz_agrees_with_eigenvalues(entries):
    n = int(len(entries) ** 0.5)
    A = np.array(entries, dtype=float).reshape(n, n)
    slowest = np.linalg.eigvals(A).real.max()
    rows = [[Fraction(v) for v in entries[i * n : (i + 1) * n]] for i in range(n)]
    if abs(slowest) > 1e-6:
        assert is_hurwitz(rows) == (slowest < 0)
    else:
        assert not (is_hurwitz(rows) and slowest > 1e-3)


def test_a_mode_that_no_input_reaches_bounds_the_rate_exactly():
    three = load(str(ROOT / "configs" / "three_state.yaml"))
    origin = [(Fraction(0),) * 3]
    system = build(three)
    assert uncontrollable_mode(system, origin, Fraction(999, 1000)) is None
    for rate in (Fraction(1), Fraction(101, 100)):
        mode = uncontrollable_mode(system, origin, rate)
        assert mode.bound == pytest.approx(1)
        assert mode.failure().mode == (-1.0, 0.0)
    assert uncontrollable_mode(CART_POLE, [(Fraction(0),) * 4], Fraction(50)) is None
    # forced: x' = x + u, y' = -2 y + x - 1 with the equilibrium x = 1 held by u = -1 (y = 0), and a mode at -2 cut off
    forced = model(("x", "y"), ("x", "-2*y"), [["1"], ["0"]])
    at_one = uncontrollable_mode(forced, [(Fraction(1), Fraction(0))], Fraction(3))
    assert at_one.bound == pytest.approx(2)
    assert uncontrollable_mode(forced, [(Fraction(1), Fraction(1))], Fraction(3)) is None  # no equilibrium


# -- the ladder

BOX = ((Fraction(-5), Fraction(5)),) * 2


def ladder(route, system=OBLIQUE, box=BOX, **more):
    return Ladder(Request(model=system, safe_set=box, routes=(("test", route),), **more))


@pytest.mark.slow
def test_the_rate_is_searched_up_to_what_is_possible():
    """A double integrator in a box has a metric of any rate; its condition number grows, and a limit ends it."""
    double = model(("x", "y"), ("y", "0"), [["0"], ["1"]])
    box = ((Fraction(-1), Fraction(1)),) * 2
    found = ladder(cegis.propose, double, box).largest_rate(20.0)
    assert found.condition_number.above <= 20
    higher = ladder(cegis.propose, double, box).metric(found.rate * Fraction(11, 10))
    assert higher.condition_number.above > 20


@pytest.mark.slow
def test_advice_names_a_rate_and_a_box_that_work():
    double = model(("x", "y"), ("y", "0"), [["0"], ["1"]])
    box = ((Fraction(-1), Fraction(1)),) * 2
    rate = ladder(cegis.propose, double, box, limit=20.0).lower_rate(Fraction(8))
    assert 0 < rate < 8
    assert ladder(cegis.propose, double, box).metric(rate).condition_number.above <= 20
    assert ladder(cegis.propose, double, box).metric(Fraction(8)).condition_number.above > 20
    lonely = model(("x", "y"), ("x**2 - x", "0"), [["0"], ["1"]])  # -1 + 2 x < -1/2 up to x = 1/4 only
    assert ladder(cegis.propose, lonely, box, degree=0).metric(Fraction(1, 2)) is None
    factor = ladder(cegis.propose, lonely, box, degree=0).smaller_box(Fraction(1, 2))
    assert Fraction(1, 8) < factor < Fraction(1, 4)


@pytest.mark.slow
def test_a_proof_that_runs_out_of_boxes_asks_for_more_of_them(tmp_path):
    spec = str(ROOT / "configs" / "quadrotor3d.yaml")
    result = synth(spec, "--route", "cegis", "--budget", "1", "-o", str(tmp_path / "m"))
    assert result.exit_code == 4
    assert "raise --budget" in result.stdout


def test_the_box_is_shrunk_about_its_centre():
    assert shrunk(((Fraction(0), Fraction(4)),), Fraction(1, 2)) == ((Fraction(1), Fraction(3)),)


def liar(kind, seed=0):
    """A route that answers confidently, and wrongly."""
    rng = np.random.default_rng(seed)

    def propose(problem):
        honest = cegis.propose(problem)
        values = honest.coefficients
        assert values is not None
        wrong = {
            "perturbed": values + 0.3 * rng.standard_normal(values.shape),
            "nan": np.full_like(values, np.nan),
            "infinite": np.where(np.eye(values.shape[1]) > 0, np.inf, values),
            "negated": -values,
            "zero": np.zeros_like(values),
            "asymmetric": values + np.triu(np.ones_like(values)) * 2,
            "shape": values[:, :1],
            "nothing": None,
        }[kind]
        return replace(honest, coefficients=wrong, feasible=True, status="optimal", kappa=1.0)

    return propose


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["perturbed", "nan", "infinite", "negated", "zero", "asymmetric", "shape", "nothing"]
)
def test_a_lying_solver_leads_to_no_metric_that_is_not_one(kind):
    for seed in range(3):
        found = ladder(liar(kind, seed), degree=0).metric(Fraction("1.7"))
        if found is not None:  # a perturbation may happen to be a metric: then it is one
            assert kind in ("perturbed", "asymmetric")
            W = np.array([[float(e.fraction) for e in row] for row in found.dual_metric])
            assert np.linalg.eigvalsh(W)[0] > 0
            for y in np.linspace(-5, 5, 101):
                A = np.array([[-1, 2], [-3, 4 - 0.75 * y**2]])
                v = np.array([4.0, 1.0])
                assert v @ (A @ W + W @ A.T + 2 * 1.7 * W) @ v <= 1e-12


def broken(problem):
    raise np.linalg.LinAlgError("did not converge")


def test_a_solver_that_breaks_down_has_proposed_nothing():
    tried = ladder(broken, degree=0)
    assert tried.metric(Fraction(1)) is None
    assert "did not converge" in tried.attempts[0].outcome.status


@pytest.mark.parametrize("kind", ["negated", "nan", "nothing"])
def test_a_lying_solver_writes_no_file(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(cegis, "propose", liar(kind))
    from tubecert.pipeline import synthesis

    monkeypatch.setattr(synthesis, "routes", lambda choice: (("cegis", cegis.propose),))
    target = tmp_path / "metric.json"
    target.write_text(OLDER_METRIC)
    spec = str(ROOT / "configs" / "two_state.yaml")
    done = run("synth", spec, "--rate", "1.7", "--degree", "0", "-v", "-o", target)
    assert done.exit_code == 4
    assert target.read_text() == OLDER_METRIC
    assert "undecided two_state" in done.output
    assert "Tried" in done.output


def test_an_infeasible_answer_marked_optimal_is_rejected_with_its_reason():
    problem = ladder(cegis.propose, degree=0)._problem(Fraction(2), "identity", 0, 0.0)
    lie = Proposal(
        route="test",
        coefficients=np.eye(2)[None],
        kappa=1.0,
        feasible=True,
        status="optimal",
    )
    outcome = shortest_proven(problem, lie, Fraction(2), Effort())
    assert isinstance(outcome, NotProven)
    assert isinstance(outcome.condition, MetricContraction)


def synth(*arguments):
    return run("synth", *arguments)


@pytest.mark.slow
def test_the_three_state_metric(tmp_path):
    target = tmp_path / "m.json"
    spec = ROOT / "configs" / "three_state.yaml"
    done = synth(spec, "--rate", "0.999", "-o", target)
    assert done.exit_code == 0, done.output
    content = json.loads(target.read_text())
    assert content["condition_number"][1] <= 0.26 / 0.17
    assert content["margin"][0] > 0
    again = with_metric_file(load(str(spec)), str(target))
    assert verify_metric(build(again), again.safe_set, Effort()).verdict == "certified"
    certified = run("certify", spec, "--metric", target, "-q", "-o", tmp_path / "c.json")
    assert certified.exit_code == 0, certified.output


def test_a_rate_beyond_the_uncontrollable_mode_is_refuted_by_name(tmp_path):
    target = tmp_path / "m.json"
    done = synth(ROOT / "configs" / "three_state.yaml", "--rate", "1.01", "-o", target)
    assert done.exit_code == 1
    assert "uncontrollable mode -1" in done.output
    assert not target.exists()


@pytest.mark.parametrize(
    ("options", "where", "words"),
    [
        (["--rate", "-1"], "--rate: error TC112", "positive"),
        (["--objective", "rate", "--rate", "1"], "--objective: error TC112", "cannot be given"),
        (["--variables", "x9"], "--variables: error TC112", "no state"),
        (["--condition-number", "abc"], "--condition-number: error TC108", ""),
    ],
)
def test_wrong_options_are_located(options, where, words, tmp_path):
    done = synth(ROOT / "configs" / "three_state.yaml", *options, "-o", tmp_path / "m.json")
    assert done.exit_code == 2
    assert where in done.output
    assert words in done.output
    assert "Traceback" not in done.output


@pytest.mark.slow
def test_the_shipped_metric_is_proven_where_the_tube_is():
    """On the whole safe set `certify` proves it, which takes half a minute."""
    file = str(ROOT / "configs" / "pvtol_adaptation.metric.json")
    spec = with_metric_file(load(str(ROOT / "configs" / "pvtol.yaml")), file)
    assert spec.metric.rate == Fraction("1.84")
    tube = ((Fraction(-3, 10), Fraction(3, 10)),) * 6
    proof = verify_metric(build(spec), tube, Effort(gap=0.1))
    assert proof.verdict == "certified"
    assert proof.margin.below > 0.008


def test_a_plot_that_is_no_svg_is_refused(tmp_path):
    done = synth(ROOT / "configs" / "two_state.yaml", "--rate", "1", "--plot", tmp_path / "rates.pdf")
    assert done.exit_code == 2
    assert "drawn as SVG" in done.output
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_end_to_end_objective_compares_certificates(tmp_path):
    plot = tmp_path / "rates.svg"
    spec = ROOT / "configs" / "two_state_orbit.yaml"
    wanted = ["--rate", "1.5", "--objective", "adaptation"]
    done = synth(spec, *wanted, "--plot", plot, "--json", "-o", tmp_path / "m.json")
    assert done.exit_code == 0, done.output
    assert plot.read_text().startswith("<svg ")
    content = json.loads(done.stdout)
    assert content["rate"] == 1.5


@pytest.mark.slow
@pytest.mark.parametrize("route", ["cegis", "sos"])
@pytest.mark.parametrize("rate", ["1.5", "1.742857"])
def test_condition_numbers_are_within_a_thousandth_of_the_least(route, rate):
    """The least is that of the two worst points: v'(f_x W + W f_x')v is affine in x2^2, which goes from 0 to 25."""
    cvxpy = pytest.importorskip("cvxpy")
    W, kappa, v = cvxpy.Variable((2, 2), symmetric=True), cvxpy.Variable(), np.array([2.0, 0.5])
    conditions = [W >> np.eye(2), kappa * np.eye(2) >> W]
    for square in (0, 25):
        A = np.array([[-1, 2], [-3, 4 - 0.75 * square]])
        conditions.append(v @ (A @ W + W @ A.T + 2 * float(rate) * W) @ v <= 0)
    least = cvxpy.Problem(cvxpy.Minimize(kappa), conditions).solve(solver="CLARABEL")
    proposers = {"cegis": cegis.propose, "sos": sos.propose_sos}
    found = ladder(proposers[route], degree=0).metric(Fraction(rate))
    assert least * (1 - 1e-6) <= found.condition_number.above <= 1.001 * least


@pytest.mark.slow
@pytest.mark.parametrize("choice", ["auto", "sos"])
def test_the_three_state_metric_is_as_good_as_that_of_plain_sums_of_squares(choice):
    """Degree 2 at rate .999: 1.4792 elsewhere."""
    three = load(str(ROOT / "configs" / "three_state.yaml"))
    request = Request(model=build(three), safe_set=three.safe_set, routes=routes(choice), degree=2)
    assert Ladder(request).metric(Fraction("0.999")).condition_number.above <= 1.4792 * 1.001
