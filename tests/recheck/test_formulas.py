"""Theorems 0, A and B of the producer against those of recheck: two readings of one text, and mutations of both.

Every operation, every whole number, every minimum and every branch of the formulas is changed in turn, in the source
that runs, on either side: the numbers of the other side must tell. What no problem tells from the truth is listed, with
the reason why it is no fault.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from types import CodeType, FunctionType, ModuleType

import numpy as np
import pytest
from flint import arb, ctx
from lies import exactly
from problems import ALIVE, alive
from test_recheck_formulas import gains_of, proof_of, reading

from tubecert.bounds.constants import ResidualConstants, WindConstants
from tubecert.conditions import alone, distance, obstacles, rates, wind
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem, Wind
from tubecert.conditions.rates import RateRecipe
from tubecert.enclosure.interval import Interval
from tubecert.recheck import conditions
from tubecert.recheck.balls import exact
from tubecert.recheck.kinds import alone as own_alone
from tubecert.search.distance import recipes_at

F = Fraction
WIND = ("push", "size", "explained")
LESS = F(999, 1000)
LIES = ("speed", "prediction_error", "uncertainty", "projection_radius")
Point = tuple[TubeProblem, RateRecipe, DistanceRecipe]
Told = dict[str, tuple[float, float]]


def drawn(rng: np.random.Generator) -> Point:
    """A problem in which every constant matters, and gains; some without wind, of a constant B, with a lying recipe."""
    values = {name: float(x * np.exp(rng.normal() / 3)) for name, x in ALIVE.items()}
    values["upper"] = values["lower"] * float(rng.uniform(1, 3))
    values["h_initial"] = values["h"] * float(rng.uniform(0, 1))
    values["initial_distance"] /= 5
    if rng.random() < 0.5:
        values |= {"B_x": 0.0, "B_pinv_x": 0.0, "b_x": 0.0}
    blown, moved = rng.random() < 0.5, rng.random() < 0.5
    gust = WindConstants(**{name: exactly(float(rng.uniform(0.2, 2))) for name in WIND})
    rest = ResidualConstants(**{name: exactly(float(rng.uniform(0.01, 0.1))) for name in ("push", "size")})
    problem = alive(
        values=values,
        predictor_gain=[None, F("3.5")][rng.integers(2)],
        horizon=[None, F(1, 3), F(5)][rng.integers(3)],
        smooth=[None, F(1, 10)][rng.integers(2)],
        wind=Wind(bound=F(1, 20), constants=gust) if blown else None,
        residual=rest if moved else None,
    )
    gains = {
        "bandwidth": F(int(rng.integers(1, 900)), 10),
        "adaptation_rate": F(10) ** int(rng.integers(2, 9)),
    }
    g = problem.predictor_gain or F(int(10 ** rng.uniform(0, 3)), 10)
    at = RateRecipe(predictor_gain=g, projection_radius=problem.projection_radius, **gains)
    own = recipes_at(problem, [(at.bandwidth, at.adaptation_rate, g)])[0]
    lie = [None, *LIES][rng.integers(1 + len(LIES))]
    if lie == "projection_radius":
        at = replace(at, projection_radius=at.projection_radius * LESS)
    return problem, at, own if lie is None else replace(own, **{lie: getattr(own, lie) * LESS})


def ends(value: Interval | float) -> tuple[float, float]:
    return (float(value.lo), float(value.hi)) if isinstance(value, Interval) else (float(value), float(value))


def of_producer(problem: TubeProblem, gains: RateRecipe, own: DistanceRecipe) -> Told:
    """Every number of the theorems at some gains, enclosed."""
    n, omega = problem.proven(gains.projection_radius), Interval.of(gains.bandwidth)
    g = Interval.of(gains.predictor_gain)
    Y, S, e = map(Interval.of, (own.speed, own.uncertainty, own.prediction_error))
    D = distance.distance_bound(n, omega, S, e)
    low = float(distance.margin_distance_along(problem, [own]).lo[0])
    stated = low > -np.inf
    found: dict[str, Interval | float] = {
        "0: A1": alone.ultimate(n),
        "0: sup D": alone.supremum(n),
        "B: Y": distance.speed_needed(n, S, e),
        "B: S": distance.uncertainty(n, Y, omega),
        "B: e": distance.error_needed(n, Y, omega, g, Interval.of(gains.adaptation_rate)),
        "B: A1": D.ultimate() if stated else np.inf,
        "B: sup D": D.supremum() if stated else np.inf,
        "B: margin": low,
        "dbar": obstacles.reach(n),
    }
    for name, constant in rates.derived_constants(problem, gains).items():
        found[f"A: {name}"] = constant.above
    if not wind.is_felt(n):
        for name, margin in rates.margins_26_along(problem, [gains]).items():
            found[f"A: {name}"] = float(margin.lo[0])
    return {name: ends(value) for name, value in found.items()}


def of_recheck(problem: TubeProblem, gains: RateRecipe, own: DistanceRecipe) -> Told:
    """The same, as recheck reads it."""
    with ctx.workprec(160):
        setting, at, proof = reading(problem), gains_of(gains), proof_of(own)
        S = (setting.n.h_t + setting.n.h_x * proof.speed) / exact(gains.bandwidth)
        held = setting.n.h_initial.max(proof.uncertainty) + proof.prediction_error
        D = conditions.distance_bound(setting, at, proof)
        found = {
            "0: A1": own_alone.settled(setting, setting.n.h),
            "0: sup D": own_alone.supremum(setting, setting.n.h),
            "B: Y": conditions.speed_needed(setting, gains.projection_radius, held),
            "B: S": S,
            "B: e": conditions._error(setting, at, proof.speed),
            "B: A1": arb("nan") if D is None else D.ultimate(),
            "B: sup D": arb("nan") if D is None else D.supremum(),
            "B: margin": arb("nan") if D is None else conditions.margin(setting, D.supremum()),
            "dbar": setting.reach,
            **{f"A: {name}": value for name, value in conditions.derived(setting, at).items()},
        }
        if setting.still:
            found |= {f"A: {name}": value for name, value in conditions.margins_26(setting, at).items()}
        return {name: (float(value.lower()), float(value.upper())) for name, value in found.items()}


def differs(one: Told, other: Told) -> bool:
    """Whether both readings of a number are apart; one that bounds nothing on one side bounds nothing on the other."""
    assert one.keys() == other.keys()
    for name, (low, high) in one.items():
        own = other[name]
        if not (np.isfinite(high) and np.isfinite(own[1])):
            if np.isfinite(high) or np.isfinite(own[1]):
                return True
            continue
        slack = 1e-9 * abs(high) + 1e-12
        if own[0] > high + slack or own[1] < low - slack or high - low > 1e3 * slack:
            return True
    return False


@pytest.fixture(scope="module")
def points() -> list[tuple[Point, Told, Told]]:
    rng = np.random.default_rng(4)
    made = [drawn(rng) for _ in range(60)]
    return [(at, of_producer(*at), of_recheck(*at)) for at in made]


# -- mutations

UNTOLD = {
    # it is asked for where something is felt
    "producer": {"conditions.wind.felt 1: 1"},
    # only its sign counts
    "recheck": {"recheck.conditions.Setting.still 1: self.wind.size / self.wind.bound"},
}
OF_PRODUCER = {
    alone: "ultimate supremum",
    rates: "rate_terms zetas filter_error rate_margins theta _derived",
    distance: "drift_bound speed_needed uncertainty filter_error estimation_gain error_needed distance_bound",
    obstacles: "reach",
    wind: "pushed drifting taken is_felt felt prediction_error prediction",
}
OF_RECHECK = {
    own_alone: "settled supremum _at_the_end",
    conditions: (
        "prediction_error derived margins_26 _error blown_prediction speed_needed distance_bound Setting.still"
        " Distance.ultimate Setting.pushed Setting.drifting Setting.blown Setting.beside Setting.taken Setting.reach"
        " Setting.radius_serves Setting.predictor"
    ),
}
SWAPPED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult}
NAMES = {"minimum": "maximum", "maximum": "minimum", "min": "max", "max": "min"}


def sites(tree: ast.AST) -> Iterator[tuple[ast.AST, str, object]]:
    """What can be changed: a node, its field, and what stands there instead."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and type(node.op) in SWAPPED:
            yield node, "op", SWAPPED[type(node.op)]()
        elif isinstance(node, ast.Constant) and type(node.value) is int:
            yield node, "value", node.value + 1
        elif isinstance(node, ast.Name) and node.id in NAMES:
            yield node, "id", NAMES[node.id]
        elif isinstance(node, ast.Attribute) and node.attr in NAMES:
            yield node, "attr", NAMES[node.attr]
        elif isinstance(node, ast.IfExp):
            yield node, "test", ast.UnaryOp(ast.Not(), node.test)


def mutants(formulas: dict[ModuleType, str]) -> Iterator[tuple[str, FunctionType, CodeType]]:
    """Every change, by function and text, with the code of the changed function."""
    for module, named in formulas.items():
        for name in named.split():
            at = module
            for part in name.split("."):
                at = inspect.getattr_static(at, part)
            for wrapped in ("fget", "__func__"):
                at = getattr(at, wrapped, at)
            function = inspect.unwrap(at)
            (tree,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(function))).body
            tree.decorator_list = []
            for k, (node, key, changed) in enumerate(sites(ast.Module(tree.body, []))):
                before = getattr(node, key)
                setattr(node, key, changed)
                whole = compile(ast.fix_missing_locations(ast.Module([tree], [])), "mutant", "exec")
                yield (
                    f"{module.__name__.removeprefix('tubecert.')}.{name} {k}: {ast.unparse(node)}",
                    function,
                    next(c for c in whole.co_consts if isinstance(c, CodeType)),
                )
                setattr(node, key, before)


@contextmanager
def instead(function: FunctionType, code: CodeType) -> Iterator[None]:
    """The function with other code, wherever it was imported."""
    before = function.__code__
    function.__code__ = code
    try:
        yield
    finally:
        function.__code__ = before


def is_told(reading: Callable[..., Told], truth: list[tuple[Point, Told]]) -> bool:
    """Whether some number at some point is not that of the other side; that point comes first from then on."""
    for k, (at, other) in enumerate(truth):
        try:
            told = differs(reading(*at), other)
        except Exception:  # a change that raises is told, too
            return True
        if told:
            truth.insert(0, truth.pop(k))
            return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize("side", ["producer", "recheck"])
def test_every_change_of_a_formula_is_noticed(side, points):
    formulas, reading = (OF_PRODUCER, of_producer) if side == "producer" else (OF_RECHECK, of_recheck)
    truth = [(at, theirs if side == "producer" else ours) for at, ours, theirs in points]
    count, unnoticed = 0, set()
    for words, function, code in mutants(formulas):
        count += 1
        with instead(function, code):
            unnoticed |= set() if is_told(reading, truth) else {words}
    assert count > 150
    assert unnoticed == UNTOLD[side]
    assert not is_told(reading, truth)
