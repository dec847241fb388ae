"""Metric synthesis by sums of squares: wall and verification over the solver's own time, plain cvxpy, growth.

python benchmarks/synthesis.py            # all but the large ones
python benchmarks/synthesis.py wall       # wall time over the solver's own
python benchmarks/synthesis.py verify     # rounding and the proof of C1-C3, over the solver's own time
python benchmarks/synthesis.py plain      # against Gram matrices as variables, through cvxpy
python benchmarks/synthesis.py growth     # with the degree of W, with the pieces, and with the number of states
python benchmarks/synthesis.py large      # the planar quadrotor with W of degree 3 and 4, and plainly with degree 2
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Sequence
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import parse, symbol
from tubecert.expression.matrix import Matrix
from tubecert.model import ControlAffineModel
from tubecert.synthesis import sos
from tubecert.synthesis.conic import ConicProgram, ConicSolution, solve
from tubecert.synthesis.family import metric_family
from tubecert.synthesis.polynomial import Conditions, polynomial_conditions
from tubecert.synthesis.problem import Proposal, SynthesisProblem
from tubecert.synthesis.rounding import VerifiedMetric, shortest_proven

ANGLE = "1.0471975512"


def model(f: dict[str, str], B: Sequence[Sequence[str]]) -> ControlAffineModel:
    """A system from texts."""
    symbols = {name: symbol(name) for name in f}

    def matrix(rows: Sequence[Sequence[str]]) -> Matrix:
        return tuple(tuple(parse(e, symbols=symbols).expression for e in row) for row in rows)

    inputs = tuple(f"u{j}" for j in range(len(B[0])))
    return ControlAffineModel(
        states=tuple(f),
        inputs=inputs,
        f=matrix([list(f.values())])[0],
        B=matrix(B),
        W=(),
        rate=Fraction(0),
        h=None,
    )


THREE_STATE = model({"x1": "-x1 + x3", "x2": "x1**2 - 2*x1*x3 - x2 + x3", "x3": "-x2"}, [["0"], ["0"], ["1"]])
PVTOL = model(
    {
        "px": "vx*cos(phi) - vz*sin(phi)",
        "pz": "vx*sin(phi) + vz*cos(phi)",
        "phi": "w",
        "vx": "vz*w - 9.81*sin(phi)",
        "vz": "-vx*w - 9.81*cos(phi)",
        "w": "0",
    },
    [["0", "0"]] * 4 + [["1/0.486", "1/0.486"], ["0.25/0.00383", "-0.25/0.00383"]],
)
PVTOL_BOX = {"phi": ANGLE, "vx": "2", "vz": "1", "w": ANGLE}


def three_state(degree: int = 2, rate: float = 0.999) -> SynthesisProblem:
    """The three-state system on |x| <= 0.1."""
    return problem(THREE_STATE, dict.fromkeys(THREE_STATE.states, "0.1"), degree, rate)


def pvtol(degree: int = 2, rate: float = 0.83) -> SynthesisProblem:
    """The planar quadrotor with true sine and cosine on the published box."""
    return problem(PVTOL, PVTOL_BOX, degree, rate)


def chain(states: int, rate: float = 0.3) -> SynthesisProblem:
    """An unstable pendulum at the end of a chain of integrators: x1' = sin(x1) + x2, ..., xn' = u."""
    names = [f"x{i}" for i in range(1, states + 1)]
    f = dict(zip(names, [*names[1:], "0"], strict=True))
    f["x1"] = "sin(x1) + x2"
    system = model(f, [["0"]] * (states - 1) + [["1"]])
    return problem(system, dict.fromkeys(names, "0.5"), 1, rate)


def problem(system: ControlAffineModel, box: dict[str, str], degree: int, rate: float) -> SynthesisProblem:
    """A problem on |x_i| <= box_i; states that do not matter get 1."""
    half = [Fraction(box.get(name, "1")) for name in system.states]
    return SynthesisProblem(
        model=system,
        safe_set=tuple((-h, h) for h in half),
        family=metric_family(system, degree=degree, variables=None),
        rate=rate,
    )


def plain(conditions: Conditions) -> Any:
    """The cvxpy problem with a matrix variable for every Gram matrix and an equation for every coefficient."""
    import cvxpy

    unknowns = cvxpy.Variable(conditions.unknowns.count)
    kappa = cvxpy.Variable()
    y = cvxpy.hstack([unknowns, kappa, np.ones(1)])
    constraints = []
    for condition in conditions.conditions:
        half = [(order + 1) // 2 for order in condition.orders]
        sums: dict[tuple[int, ...], Any] = {}
        for multiplier in [None, *(i for i, h in enumerate(half) if h)]:
            limits = [h - (i == multiplier) for i, h in enumerate(half)]
            monomials = list(product(*(range(h + 1) for h in limits)))
            size = len(monomials) * condition.size
            G = cvxpy.Variable((size, size), PSD=True)
            for (a, p), (b, q) in product(enumerate(monomials), repeat=2):
                rows = slice(a * condition.size, (a + 1) * condition.size)
                columns = slice(b * condition.size, (b + 1) * condition.size)
                power = [x + z for x, z in zip(p, q, strict=True)]
                _add(sums, power, G[rows, columns])
                if multiplier is not None:
                    power[multiplier] += 2
                    _add(sums, power, -G[rows, columns])
        table = condition.coefficients.reshape(*(o + 1 for o in condition.orders), -1, y.shape[0])
        upper = np.triu_indices(condition.size)
        places = {(i, j): j * (j + 1) // 2 + i for i, j in zip(*upper, strict=True)}
        for power, total in sums.items():
            known = all(p <= order for p, order in zip(power, condition.orders, strict=True))
            for (i, j), place in places.items():
                wanted = table[power][place] @ y if known else 0.0
                constraints.append(sum(part[i, j] for part in total) == wanted)
    return cvxpy.Problem(cvxpy.Minimize(kappa), constraints)


def _add(sums: dict[tuple[int, ...], Any], power: Sequence[int], block: Any) -> None:
    sums.setdefault(tuple(power), []).append(block)


class Run(NamedTuple):
    """What sums of squares propose, in how much wall time, and how much of it in the call of the solver."""

    proposal: Proposal
    seconds: float
    solver_seconds: float


def timed(asked: SynthesisProblem, runs: int = 1) -> Run:
    """The run of median wall time, after one to warm up where there are several."""
    found = [_run(asked) for _ in range(runs + (runs > 1))]
    return sorted(found[runs > 1 :], key=lambda own: own.seconds)[runs // 2]


def _run(asked: SynthesisProblem) -> Run:
    solver_seconds = 0.0

    def measured(program: ConicProgram, name: str) -> ConicSolution:
        nonlocal solver_seconds
        start = time.perf_counter()
        solution = solve(program, name)
        solver_seconds += time.perf_counter() - start
        return solution

    with patch.object(sos, "solve", measured):
        start = time.perf_counter()
        proposal = sos.propose_sos(asked)
        return Run(proposal=proposal, seconds=time.perf_counter() - start, solver_seconds=solver_seconds)


def wall() -> None:
    """Wall time over the solver's own."""
    for name, asked, runs in (("three-state", three_state(), 21), ("pvtol, degree 2", pvtol(), 3)):
        found = timed(asked, runs)
        print(
            f"{name}: kappa {found.proposal.kappa:.4f}, {found.seconds * 1e3:.1f} ms, "
            f"solver {found.solver_seconds * 1e3:.1f} ms, "
            f"ratio {found.seconds / found.solver_seconds:.2f} ({found.proposal.status})"
        )


def verification() -> None:
    """Rounding and proof of what the solver proposes, with the room to spare that `synth` asks for."""
    for name, asked, rate in (
        ("three-state", three_state(rate=0.9995), "0.999"),
        ("pvtol, degree 2", pvtol(rate=0.835), "0.83"),
        ("chain of 4 states", chain(4, rate=0.302), "0.3"),
    ):
        found = timed(asked)
        start = time.perf_counter()
        proven = shortest_proven(asked, found.proposal, Fraction(rate), Effort())
        seconds = time.perf_counter() - start
        outcome = (
            f"{proven.digits} digits, kappa {proven.condition_number.above:.4f} proven"
            if isinstance(proven, VerifiedMetric)
            else proven.tag
        )
        print(
            f"{name}: {outcome} in {seconds:.2f} s, solver {found.solver_seconds:.2f} s, "
            f"ratio {seconds / found.solver_seconds:.2f}"
        )


def against_plain(asked: SynthesisProblem, name: str, runs: int) -> None:
    """Against the plain formulation, from the same polynomials on; cvxpy is imported already."""
    import cvxpy  # noqa: F401

    ours = timed(asked, runs)
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        built = plain(polynomial_conditions(asked, pieces=0, symmetric=False))
        built.solve(solver="CLARABEL")
        times.append(time.perf_counter() - start)
    theirs = statistics.median(times)
    print(
        f"{name}: kappa {ours.proposal.kappa:.4f} in {ours.seconds:.3f} s, plainly through cvxpy {built.value:.4f} in "
        f"{theirs:.3f} s (solver {built.solver_stats.solve_time:.3f} s), {theirs / ours.seconds:.1f} times as long"
    )


def compare() -> None:
    """Small problems against cvxpy; the planar quadrotor is among the large ones."""
    against_plain(three_state(), "three-state", 5)


def growth() -> None:
    """With the degree of W and the number of states."""
    for degree in (1, 2):
        asked = pvtol(degree)
        _line(f"pvtol, degree {degree}", timed(asked))
    for states in (2, 4, 6, 8):
        _line(f"chain of {states} states", timed(chain(states)))


def large() -> None:
    """What takes minutes."""
    for degree in (3, 4):
        _line(f"pvtol, degree {degree}", timed(pvtol(degree)))
    against_plain(pvtol(), "pvtol, degree 2", 1)


def _line(name: str, found: Run) -> None:
    own = found.proposal
    print(
        f"{name}: kappa {own.kappa:.3f}, {found.seconds:.2f} s, solver {found.solver_seconds:.2f} s ({own.status})"
    )


if __name__ == "__main__":
    parts = {"wall": wall, "verify": verification, "plain": compare, "growth": growth, "large": large}
    for chosen in sys.argv[1:] or ("wall", "verify", "plain", "growth"):
        parts[chosen]()
