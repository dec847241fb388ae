"""Constants of the reference systems for tests of conditions and search: sampled or stated, never proven."""

from fractions import Fraction
from typing import Any

import numpy as np

from tubecert.bounds.constants import TABLE, BoundConstants, Constant
from tubecert.conditions import rates
from tubecert.conditions.distance import DistanceRecipe, margin_distance_along
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe, margins_26_along
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.enclosure.interval import Interval
from tubecert.kernel import judge
from tubecert.kinds.kind import Section
from tubecert.kinds.table import kind_of
from tubecert.pipeline import Options, question_of
from tubecert.pipeline.certification import answer
from tubecert.search.proposers import PROPOSERS
from tubecert.spec import Spec
from tubecert.stages.judged import Judged
from tubecert.verdict import Verdict

W_CONSTANT = np.array(
    [[0.20365, 0.00015, -0.00566], [0.00015, 0.21671, -0.00566], [-0.00566, -0.00566, 0.21607]]
)
W_LINEAR = np.array([[0, -0.4073, -0.00133], [-0.4073, -0.00061, 0.00998], [-0.00133, 0.00998, 0.06785]])
W_SQUARE = np.array([[0, 0, 0.00053], [0, 0.81459, 0.00308], [0.00053, 0.00308, 0.00343]])
X0 = np.array([0.01, -0.01, 0.01])


def constants(**values: float | tuple[float, float]) -> BoundConstants:
    """Constants by name; a pair is an enclosure, what is not named is 0 (1 where 0 makes no sense)."""
    default = dict.fromkeys(TABLE, 0.0) | {"lower": 1.0, "upper": 1.0}
    if "h_initial" not in values:
        values = values | {"h_initial": values.get("h", 0.0)}
    pairs = {
        name: value if isinstance(value, tuple) else (value, value)
        for name, value in (default | values).items()
    }
    return BoundConstants(**{name: Constant(below=lo, above=hi) for name, (lo, hi) in pairs.items()})


def two_state(**options: Any) -> TubeProblem:
    """The function-level row of the two-state system, eps = .6, rho_a = .1."""
    values = {
        "lower": 0.20086, "upper": 0.32823, "f": 19.87, "f_x": 60.0, "B": float(np.hypot(0.5, 2.0)),
        "B_pinv": float(1 / np.hypot(0.5, 2.0)), "u_star": 3.03, "h": 2.511177, "h_x": 0.1, "h_t": 4.0,
        "feedback_gain": 6.29599, "metric_input_gain": 1.03048, "drift_on_plan": 19.4787,
    } | options.pop("values", {})  # fmt: skip
    defaults = {
        "rate": Fraction("1.74"), "epsilon": Fraction("0.6"), "rho_a": Fraction("0.1"),
        "rho_r": Fraction("0.6"), "rho": Fraction("0.7"), "states": 2,
    }  # fmt: skip
    return TubeProblem(constants=constants(**values), **(defaults | options))


def _metric(x: np.ndarray) -> np.ndarray:
    x1 = x[..., 0, None, None]
    return np.linalg.inv(W_CONSTANT + W_LINEAR * x1 + W_SQUARE * x1**2)


def _f(x: np.ndarray) -> np.ndarray:
    x1, x2, x3 = x[..., 0], x[..., 1], x[..., 2]
    return np.stack([-x1 + x3, x1**2 - 2 * x1 * x3 - x2 + x3, -x2], axis=-1)


def _segment_length(x: np.ndarray) -> float:
    s = (np.arange(2000) + 0.5) / 2000
    M = _metric(s[:, None] * x)
    return float(np.mean(np.sqrt(np.einsum("i,kij,j->k", x, M, x))))


def three_state(**options: Any) -> TubeProblem:
    """The three-state system of the paper: eps = rho_a = .01, a = 3.85 and A = 5.88 declared, lambda = .9999.

    |h_x| = 0, so |xdot| and the feedback gain do not reach the gains.
    """
    a, A = 3.85, 5.88
    offset = float(np.linalg.norm(X0))
    rho_r = np.sqrt(A / a) * offset + 0.01
    rho = rho_r + 0.01
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(4000, 3))
    x = rho * np.vstack([directions / np.linalg.norm(directions, axis=1)[:, None], np.eye(3), -np.eye(3)])
    M = _metric(x)
    x1 = x[:, 0, None, None]
    M_x = M @ (W_LINEAR + 2 * x1 * W_SQUARE) @ M
    values = {
        "lower": a,
        "upper": A,
        "f": float(np.linalg.norm(_f(x), axis=1).max()),
        "f_x": 2.0,
        "B": 1.0,
        "B_pinv": 1.0,
        "M_x": float(np.linalg.norm(M_x, 2, axis=(1, 2)).max()),
        "h": 0.1,
        "h_t": 0.2,
        "feedback_gain": 0.7,
        "metric_input_gain": float(np.sqrt(_metric(np.zeros(3))[2, 2])),
        "drift_on_plan": float(np.linalg.norm(_f(x), axis=1).max()),
        "initial_distance": _segment_length(X0),
    } | options.pop("values", {})
    defaults = {
        "rate": Fraction("0.9999"), "epsilon": Fraction("0.01"), "rho_a": Fraction("0.01"),
        "rho_r": Fraction(rho_r), "rho": Fraction(rho * (1 + 1e-12)), "states": 3,
    }  # fmt: skip
    return TubeProblem(constants=constants(**values), **(defaults | options))


# every term of every formula is alive; the start is far enough off for sup D to be an interior maximum
ALIVE = {
    "lower": 0.9, "upper": 1.7, "f": 3.1, "f_x": 2.3, "B": 1.2, "B_x": 0.15, "b_x": 0.11, "B_pinv": 1.1,
    "B_pinv_x": 0.13, "M_x": 0.21, "u_star": 0.8, "h": 0.35, "h_x": 0.06, "h_t": 0.9, "h_initial": 0.3,
    "feedback_gain": 1.3, "metric_input_gain": 1.4, "drift_on_plan": 2.9, "initial_distance": 0.45,
    "plan_defect": 0.02, "plan_defect_metric": 0.02,
}  # fmt: skip


def alive(**options) -> TubeProblem:
    """A synthetic problem in which every constant matters."""
    values = ALIVE | options.pop("values", {})
    defaults = {
        "rate": Fraction("1.3"), "epsilon": Fraction("0.5"), "rho_a": Fraction("0.2"),
        "rho_r": Fraction("0.7"), "rho": Fraction("0.9"), "predictor_gain": Fraction("3.5"), "states": 2,
    }  # fmt: skip
    return TubeProblem(constants=constants(**values), **(defaults | options))


def _judged(letter: str, problem: TubeProblem, asked: dict[str, Any]) -> Any:
    """Without a curve, which takes longer than the rest, unless it is asked for."""
    kind = kind_of(letter)
    wanted = Asked(**{"curve": False} | asked)
    return kind.section(problem, PROPOSERS[kind.theorem.recipe].propose(problem, wanted))


def judged_26(problem: TubeProblem, **asked: Any) -> Section[RateRecipe]:
    """What is proposed and decided for certificate A."""
    return _judged("A", problem, asked)


def judged_distance(problem: TubeProblem, **asked: Any) -> Section[DistanceRecipe]:
    """What is proposed and decided for certificate B."""
    return _judged("B", problem, asked)


def verdict_at(problem: TubeProblem, recipe: RateRecipe) -> Verdict:
    """What the kernel decides about one recipe."""
    return judge(problem, rates.THEOREM, Proposal(decisive=recipe)).verdict


def margins_26(problem: TubeProblem, recipe: RateRecipe) -> dict[str, Interval]:
    """Margins of one recipe, scalars."""
    return {claim: margin[0] for claim, margin in margins_26_along(problem, [recipe]).items()}


def margin_distance(problem: TubeProblem, recipe: DistanceRecipe) -> Interval:
    """The margin of one recipe."""
    return margin_distance_along(problem, [recipe])[0]


def problem_of(spec: Spec, options: Options) -> TubeProblem:
    """The problem that a certification comes to, with proven constants."""
    end = answer(question_of(spec, options))
    assert isinstance(end, Judged), end
    return end.bounded.problem
