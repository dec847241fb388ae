"""Synthesis by sums of squares: its parts against definitions, its proposals against the verifier and against cvxpy."""

import importlib.util
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import optimum, semidefinite
from scipy import sparse
from systems import BOX_THREE, F_THREE, F_TWO, THREE, TWO, values
from systems import plain_model as model

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.tape import Tape
from tubecert.expression import ONE, ZERO, cos, sin, symbol
from tubecert.metric.verify import verify_metric
from tubecert.synthesis.chart import (
    Chart,
    NotPolynomialError,
    Variable,
    control_matrix,
    control_points,
    degrees_of,
    monomial_matrix,
)
from tubecert.synthesis.conic import Affine, ConicProgram, Semidefinite, solve, triangle
from tubecert.synthesis.family import metric_family
from tubecert.synthesis.frame import commuting_frame
from tubecert.synthesis.lifting import lift
from tubecert.synthesis.polynomial import polynomial_conditions
from tubecert.synthesis.problem import SynthesisProblem
from tubecert.synthesis.sos import gram_form, propose_sos

SOLVERS = ("clarabel", "scs")
THROUGH_CVXPY = ("cvxpy:CLARABEL", "cvxpy:SCS")
Q = Fraction


def problem(system, box, *, degree, rate, **options):
    box = tuple((Q(lo), Q(hi)) for lo, hi in box)
    family = metric_family(system, degree=degree, variables=options.pop("variables", None))
    return SynthesisProblem(model=system, safe_set=box, family=family, rate=rate, **options)


TWO_STATE = model(TWO, F_TWO, [["0.5"], ["-2"]])
BOX_FIVE = ((-5, 5),) * 2
THREE_STATE = model(THREE, F_THREE, [["0"], ["0"], ["1"]])
PENDULUM = model(("q", "w", "i"), ("w", "sin(q) + i", "-i"), [["0"], ["0"], ["1"]])
BOX_PENDULUM = ((-1, 1), (-1, 1), (-1, 1))
MOVING = model(("x", "y"), ("-x + y", "x**2 - y"), [["0"], ["1 + x**2"]])


def verified(asked, proposal, rate, digits=6):
    """The verifier's word on the proposal, rounded."""
    rounded = [[[Q(f"{x:.{digits}f}") for x in row] for row in v] for v in proposal.coefficients]
    exact = replace(asked.model, W=asked.family.dual_metric(rounded), rate=Q(rate))
    return verify_metric(exact, asked.safe_set, Effort(gap=0.1, budget=100_000))


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_largest_eigenvalue_is_a_conic_program(solver):
    a = np.random.default_rng(1).normal(size=(6, 6))
    a = a + a.T
    found = solve(ConicProgram(cost=np.ones(1), semidefinite=[semidefinite(-a, [np.eye(6)])]), solver)
    assert found.feasible
    assert found.objective == pytest.approx(np.linalg.eigvalsh(a)[-1], abs=1e-6)
    assert found.bound == pytest.approx(found.objective, abs=1e-6)


@pytest.mark.parametrize("solver", [*SOLVERS, *THROUGH_CVXPY])
def test_infeasible_is_an_opinion_and_has_no_value(solver):
    both = [semidefinite([[-1.0]], [[[1.0]]]), semidefinite([[-1.0]], [[[-1.0]]])]
    found = solve(ConicProgram(cost=np.ones(1), semidefinite=both), solver)
    assert found.feasible is False
    assert "infeasible" in found.status


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_data_that_are_not_finite_reach_no_solver(bad):
    found = solve(ConicProgram(cost=np.ones(1), semidefinite=[semidefinite([[bad]], [[[1.0]]])]))
    assert found.values is None
    assert found.feasible is None
    assert "not finite" in found.status


def test_too_few_iterations_are_said():
    a = np.diag(np.arange(8.0))
    program = ConicProgram(cost=np.ones(1), semidefinite=[semidefinite(-a, [np.eye(8)])])
    found = solve(program, iterations=1)
    assert found.feasible is None
    assert "max iterations" in found.status
    assert "inaccurate" in solve(program, "cvxpy:SCS", iterations=1, tolerance=1e-12).status


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(1, 5), min_size=1, max_size=3))
def test_all_solvers_agree_with_cvxpy(seed, orders):
    """Random programs that are feasible and bounded by construction: y = 0 is interior, the cost a sum of traces."""
    import cvxpy

    rng = np.random.default_rng(seed)
    N = 4
    slopes = [(s := rng.normal(size=(N, n, n))) + s.transpose(0, 2, 1) for n in orders]
    roots = [rng.normal(size=(n, n)) for n in orders]
    cost = sum(
        np.einsum("kij,ij->k", s, r @ r.T + np.eye(len(r))) for s, r in zip(slopes, roots, strict=True)
    )
    blocks = [semidefinite(np.eye(n), s).entries for n, s in zip(orders, slopes, strict=True)]
    entries = Affine(
        constant=np.concatenate([block.constant for block in blocks]),
        slopes=np.concatenate([block.slopes for block in blocks]),
    )
    program = ConicProgram(cost=cost, semidefinite=[Semidefinite(orders=tuple(orders), entries=entries)])
    y = cvxpy.Variable(N)
    parts = [np.eye(n) + sum(y[k] * s[k] for k in range(N)) >> 0 for n, s in zip(orders, slopes, strict=True)]
    oracle = optimum(cvxpy.Problem(cvxpy.Minimize(cost @ y), parts))
    for solver in (*SOLVERS, *THROUGH_CVXPY):
        answer = solve(program, solver, tolerance=1e-7)
        assert answer.feasible
        assert answer.objective == pytest.approx(oracle.value, rel=1e-4, abs=1e-4)
        assert answer.bound == pytest.approx(answer.objective, rel=1e-4, abs=1e-4)
        assert answer.objective == pytest.approx(cost @ answer.values)


def test_coefficients_of_a_polynomial_in_an_angle_and_a_state():
    """What is read off the nodes is the function, everywhere: 2 sin q cos q x^2 + x - 3 cos^2 q on an uneven box."""
    variables = Variable(name="q", lo=-0.5, hi=1.2, angle=1), Variable(name="x", lo=-1.0, hi=3.0, angle=0)
    chart = Chart(variables=variables, degrees=(2, 2))

    def function(q, x):
        return 2 * np.sin(q) * np.cos(q) * x**2 + x - 3 * np.cos(q) ** 2

    nodes, weight = chart.nodes()
    places, table = chart.coefficients(weight * function(*nodes.T), (0, 0))
    assert places.shape == (1, 0)
    assert table.shape == (1, 5, 3)
    u = np.random.default_rng(2).uniform(-1, 1, (40, 2))
    q, x = (v.value(u[:, i]) for i, v in enumerate(chart.variables))
    value = np.polynomial.polynomial.polyval2d(*u.T, table[0])
    assert value == pytest.approx(chart.variables[0].weight(u[:, 0], 2) * function(q, x), abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=2, max_size=6), st.integers(1, 4))
def test_control_points_bound_the_polynomial_and_meet_it_at_the_ends(coefficients, pieces):
    order = len(coefficients) - 1
    values = np.polynomial.polynomial.polyval(np.linspace(-1, 1, 201), np.array(coefficients))
    controls = control_matrix(order, pieces) @ np.linalg.solve(monomial_matrix(order), np.array(coefficients))
    assert controls.min() <= values.min() + 1e-9
    assert controls.max() >= values.max() - 1e-9
    assert controls[[0, -1]] == pytest.approx(values[[0, -1]], abs=1e-9)
    assert len(controls) == len(control_points(order, pieces)) == pieces * order + 1


def test_degrees_count_angles_once_and_refuse_what_is_no_polynomial():
    x, q = symbol("x"), symbol("q")
    degrees, angles = degrees_of([sin(q) * cos(2 * q) * x**3 + x, ONE + cos(q), ZERO])
    assert [dict(d) for d in degrees] == [{"q": 3, "x": 3}, {"q": 1}, {}]
    assert angles == {"q": 1}
    with pytest.raises(NotPolynomialError, match="quotient"):
        degrees_of([x / (1 + x**2)])
    with pytest.raises(NotPolynomialError, match="q enters both"):
        degrees_of([q * sin(q)])
    with pytest.raises(NotPolynomialError, match="reaches pi"):
        Variable(name="q", lo=-1.0, hi=3.2, angle=1)


def gram_value(form, entries, half, u):
    """Sum of Z'GZ and multipliers at u, from the definition, without symmetries."""
    from itertools import product

    size = form.orders[0] // int(np.prod([h + 1 for h in half]))
    total, row = np.zeros((size, size)), 0
    limits = [(half, 1.0)] + [
        (tuple(h - (i == k) for k, h in enumerate(half)), 1 - u[i] ** 2) for i, h in enumerate(half) if h
    ]
    for order, (most, factor) in zip(form.orders, limits, strict=True):
        G = np.zeros((order, order))
        upper = [(p, q) for q in range(order) for p in range(q + 1)]
        for place, (p, q) in enumerate(upper):
            G[p, q] = G[q, p] = entries[row + place]
        row += len(upper)
        z = np.array(
            [np.prod([u[k] ** e for k, e in enumerate(es)]) for es in product(*(range(m + 1) for m in most))]
        )
        Z = np.kron(z[:, None], np.eye(size))
        total += factor * Z.T @ G @ Z
    return total


@pytest.mark.parametrize(("orders", "size"), [((), 3), ((2,), 2), ((3,), 2), ((2, 4), 2), ((1, 2), 1)])
def test_every_choice_of_the_free_entries_gives_the_same_polynomial(orders, size):
    rng = np.random.default_rng(3)
    form = gram_form(orders, size)
    t = size * (size + 1) // 2
    shape = tuple(order + 1 for order in orders)
    table = rng.normal(size=(*shape, t))
    half = tuple((order + 1) // 2 for order in orders)
    for _ in range(3):
        u = rng.uniform(-1, 1, len(orders))
        free = rng.normal(size=form.free.shape[1])
        value = gram_value(form, form.pivots @ table.ravel() + form.free @ free, half, u)
        powers = np.ones(1)
        for k, order in enumerate(orders):
            powers = np.outer(powers, u[k] ** np.arange(order + 1)).ravel()
        upper = powers @ table.reshape(-1, t)
        expected = np.zeros((size, size))
        for place, (p, q) in enumerate(zip(*triangle(size), strict=True)):
            expected[p, q] = expected[q, p] = upper[place]
        assert value == pytest.approx(expected, abs=1e-10)


def test_symmetries_split_the_blocks():
    """[[even, odd], [odd, even]]: blocks of half the order, and 3 + 2 + 3 equations for 6 + 6 + 3 + 3 entries."""
    whole, split = gram_form((4,), 2), gram_form((4,), 2, ((-1, 1, -1),))
    assert whole.orders == (6, 4)
    assert split.orders == (3, 3, 2, 2)
    assert split.free.shape == (18, 10)


def least(coefficients):
    """The least value on [-1, 1] of a polynomial, by sums of squares: max r with p - r >= 0."""
    order = len(coefficients) - 1
    form = gram_form((order,), 1)
    slopes = sparse.hstack([form.pivots @ -np.eye(order + 1, 1), form.free])
    entries = Affine(constant=form.pivots @ np.array(coefficients), slopes=slopes)
    block = Semidefinite(orders=form.orders, entries=entries)
    return -solve(ConicProgram(cost=-np.eye(1, slopes.shape[1])[0], semidefinite=[block])).objective


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-2, 2).map(lambda x: round(x, 3)), min_size=3, max_size=7))
def test_in_one_variable_sums_of_squares_are_exact(coefficients):
    sampled = np.polynomial.polynomial.polyval(np.linspace(-1, 1, 4001), np.array(coefficients)).min()
    assert least(coefficients) == pytest.approx(sampled, abs=1e-4)


def rational(V):
    return [[[Q(float(x)) for x in row] for row in v] for v in V]


def contraction_values(asked, V, states):
    """-N'(F_0 + 2 rate W)N at a state, from the model's own matrices."""
    from tubecert.expression.matrix import multiply, transpose

    system = replace(asked.model, W=asked.family.dual_metric(rational(V)), rate=Q(asked.rate))
    form = multiply(transpose(system.annihilator), multiply(system.F, system.annihilator))
    return -values(form, system.states, np.array(states))


@pytest.mark.parametrize(
    ("system", "box", "degree", "states", "weight"),
    [
        (THREE_STATE, BOX_THREE, 2, lambda u: [(0.1 * u, 0.03, end) for end in (-0.1, 0.1)], lambda u: 1.0),
        (PENDULUM, BOX_PENDULUM, 2, lambda u: [(2 * np.arctan(np.tan(0.5) * u), end, 0.2) for end in (-1, 1)],
         lambda u: ((1 + (np.tan(0.5) * u) ** 2) / (1 + np.tan(0.5) ** 2)) ** 3),
    ],
    ids=["three_state", "pendulum"],
)  # fmt: skip
def test_conditions_are_the_matrices_they_stand_for(system, box, degree, states, weight):
    """Each polynomial, at any u, is C2's matrix at a vertex, times the angle's factor."""
    asked = problem(system, box, degree=degree, rate=0.375)
    found = polynomial_conditions(asked)
    y = np.random.default_rng(4).normal(size=found.unknowns.count)
    contraction = [c for c in found.conditions if c.name == "contraction"]
    assert contraction
    for u in (-1.0, -0.37, 0.2, 1.0):
        expected = weight(u) * contraction_values(asked, found.unknowns.matrices(y), states(u))
        i, j = triangle(contraction[0].size)
        for condition in contraction:
            powers = u ** np.arange(condition.orders[0] + 1)
            upper = np.tensordot(powers, condition.coefficients, 1)[:, :-2] @ y
            assert min(np.abs(upper - matrix[i, j]).max() for matrix in expected) < 1e-9


def test_affine_variables_become_vertices():
    """x3 enters the three-state condition affinely: two vertices, polynomials in x1 alone."""
    found = polynomial_conditions(problem(THREE_STATE, BOX_THREE, degree=2, rate=0.9))
    contraction = [c for c in found.conditions if c.name == "contraction"]
    assert [c.orders for c in contraction] == [(3,), (3,)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "box", "degree"),
    [(TWO_STATE, BOX_FIVE, 0), (THREE_STATE, BOX_THREE, 2), (PENDULUM, BOX_PENDULUM, 2)],
    ids=["two_state", "three_state", "pendulum"],
)
def test_eliminated_split_and_direct_is_what_cvxpy_finds_plainly(system, box, degree):
    """The plain formulation of benchmarks/synthesis.py: a variable for every Gram entry, no symmetries."""
    asked = problem(system, box, degree=degree, rate=0.5)
    conditions = polynomial_conditions(asked)
    everything = polynomial_conditions(asked, pieces=0, symmetric=False)
    assert conditions.unknowns.count <= everything.unknowns.count
    plain = optimum(benchmark().plain(everything))
    assert propose_sos(asked).kappa == pytest.approx(plain.value, rel=max(1e-5, 10 * plain.tolerance))


def benchmark():
    path = Path(__file__).parents[2] / "benchmarks" / "synthesis.py"
    spec = importlib.util.spec_from_file_location("synthesis_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_with_as_many_inputs_as_states_the_identity_is_best():
    system = model(TWO, F_TWO, [["1", "0"], ["0", "1"]])
    proposal = propose_sos(problem(system, BOX_FIVE, degree=0, rate=5.0))
    assert proposal.kappa == pytest.approx(1.0, abs=1e-6)
    assert proposal.coefficients[0] == pytest.approx(np.eye(2), abs=1e-6)


@pytest.mark.parametrize("status", ["Solved", "PrimalInfeasible"])
def test_a_solver_that_returns_nothing_finite_proposes_nothing(monkeypatch, status):
    import clarabel

    class Liar:
        def __init__(self, P, q, *rest):
            self.size = len(q)

        def solve(self):
            told = {"obj_val": 1.0, "obj_val_dual": 1.0, "iterations": 1, "solve_time": 0.0}
            return SimpleNamespace(x=[np.nan] * self.size, status=status, **told)

    monkeypatch.setattr(clarabel, "DefaultSolver", Liar)
    proposal = propose_sos(problem(TWO_STATE, BOX_FIVE, degree=0, rate=1.0))
    assert proposal.coefficients is None
    assert proposal.kappa == np.inf
    assert proposal.feasible is not True


def test_above_the_uncontrollable_mode_there_is_nothing():
    proposal = propose_sos(problem(THREE_STATE, BOX_THREE, degree=2, rate=1.01))
    assert proposal.feasible is not True
    assert "infeasible" in proposal.status or "almost" in proposal.status or "insufficient" in proposal.status


@pytest.mark.slow
def test_an_angle_is_treated_exactly():
    """A pendulum behind an actuator: verified with the true sine."""
    asked = problem(PENDULUM, BOX_PENDULUM, degree=2, rate=0.501)
    proposal = propose_sos(asked)
    assert proposal.feasible
    assert verified(asked, proposal, "0.5").verdict == "certified"


def test_an_angle_in_degrees_is_an_angle():
    """sin(71 q/4068) used to be no sine of an angle: sums of squares did not apply, and W moved with sin(q)."""
    degrees = Q(4068, 71)
    other = model(("q", "w", "i"), ("4068/71*w", "sin(71/4068*q) + i", "-i"), [["0"], ["0"], ["1"]])
    wide = ((-degrees, degrees), *BOX_PENDULUM[1:])
    found = []
    for system, box in ((PENDULUM, BOX_PENDULUM), (other, wide)):
        widths = tuple(Q(hi) for _, hi in box)
        asked = problem(system, box, degree=1, rate=0.501, coordinates="auto", half_widths=widths)
        assert [g.op for g in asked.family.functions[1:]] == ["sin", "cos"]
        found.append(propose_sos(asked))
        assert found[-1].feasible
    assert found[1].kappa == pytest.approx(found[0].kappa, rel=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(["1", "71/4068", "3/7"]), st.lists(st.integers(-5, 5), min_size=1, max_size=3))
def test_sines_of_multiples_are_polynomials_of_one_angle(unit, counts):
    q = symbol("q")
    own = [each(Fraction(unit) * k * q) for k in counts for each in (sin, cos)]
    lifted = lift(own)
    angle = float(lifted.units.get("q", 0)) * 0.7
    names = lifted.circles.get("q", ("s", "c"))
    values = Tape(lifted.expressions, names).run_floats(
        [np.array([f(angle)]) for f in (np.sin, np.cos)], (1,)
    )
    exact = [f(float(Fraction(unit)) * k * 0.7) for k in counts for f in (np.sin, np.cos)]
    assert np.ravel(values) == pytest.approx(exact, abs=1e-12)


def test_angles_without_a_common_unit_are_left_alone():
    q = symbol("q")
    lifted = lift([sin(q), sin(Fraction(137, 100) * q)], opaque=True)
    assert lifted.units == {"q": 1}
    assert list(lifted.atoms.values()) == [sin(Fraction(137, 100) * q)]


@pytest.mark.slow
def test_state_dependent_input():
    """The frame must be polynomial: the one in closed form is a quotient, to which sums of squares do not apply."""
    asked = problem(MOVING, ((-1, 1),) * 2, degree=1, rate=0.301)
    assert "a quotient is no polynomial" in propose_sos(asked).status
    asked = replace(asked, family=replace(asked.family, frame=commuting_frame(MOVING)))
    proposal = propose_sos(asked)
    assert proposal.feasible
    assert not asked.family.flat
    assert verified(asked, proposal, "0.3").verdict == "certified"


def test_the_input_floor_bounds_the_input_gain():
    asked = problem(THREE_STATE, BOX_THREE, degree=2, rate=0.91, floor="input")
    proposal = propose_sos(asked)
    proof = verified(asked, proposal, "0.9")
    assert proof.verdict == "certified"
    assert 1 / proof.lower_on_set.below <= proposal.kappa * (1 + 1e-3)  # W <= kappa I
    W = proposal.coefficients[0]
    assert np.linalg.inv(W)[2, 2] <= 1 + 1e-6  # B'MB <= 1
    assert proposal.kappa < propose_sos(replace(asked, floor="identity")).kappa


def test_a_limit_makes_more_an_opinion_of_infeasible():
    asked = problem(TWO_STATE, BOX_FIVE, degree=0, rate=1.74, limit=1.5)
    proposal = propose_sos(asked)
    assert proposal.feasible is False
    assert "above the limit" in proposal.status


def test_what_is_no_polynomial_is_not_applicable():
    system = model(TWO, ("-x1 + exp(x2)", "x1"), [["0"], ["1"]])
    proposal = propose_sos(problem(system, ((-1, 1),) * 2, degree=0, rate=0.1))
    assert proposal.coefficients is None
    assert proposal.feasible is None
    assert "do not apply" in proposal.status
