"""Problems for certificates 0, A and B, what honest searches say of them, and lies about each of their numbers."""

from collections.abc import Iterator
from dataclasses import fields, replace
from fractions import Fraction
from functools import cache
from itertools import combinations, product
from typing import Any

import numpy as np
from problems import ALIVE, alive, two_state

from tubecert.bounds.constants import ResidualConstants, WindConstants
from tubecert.conditions.alone import NoGains
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem, Wind
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.theorem import Asked
from tubecert.enclosure.constant import Constant
from tubecert.search.distance import recipes_at
from tubecert.search.proposers import PROPOSERS

F = Fraction
KINDS = {"0": NoGains, "A": RateRecipe, "B": DistanceRecipe}
NUMBERS = {kind: tuple(item.name for item in fields(recipe)) for kind, recipe in KINDS.items()}


def exactly(x: float) -> Constant:
    return Constant(below=x, above=x)


def wind(bound: str, *, size: float = 0.2, explained: float = 0.1) -> Wind:
    own = WindConstants(push=exactly(0.15), size=exactly(size), explained=exactly(explained))
    return Wind(bound=F(bound), constants=own)


REST = ResidualConstants(push=exactly(0.02), size=exactly(0.03))
TURNING = {"B_x": 0.05, "B_pinv_x": 0.02}
WIDE = {name: (x, 1.01 * x) if name == "lower" else (0.99 * x, x) for name, x in ALIVE.items()}
# each with the kinds that are proven for it
PROBLEMS: dict[str, tuple[TubeProblem, str]] = {
    "every term alive": (alive(), "0AB"),
    "constants that are enclosed": (alive(values=WIDE), "0AB"),
    "radii that were rounded": (alive(rho_r=F("0.7") * (1 + F(5, 10**10))), "0AB"),
    "a start near the plan": (alive(values={"initial_distance": 0.01}, horizon=F(1, 2)), "0AB"),
    "any predictor": (alive(predictor_gain=None), "0AB"),
    "a smooth projection": (alive(smooth=F(1, 4)), "0AB"),
    "a short horizon": (alive(horizon=F(1, 5)), "0AB"),
    "a plan that ends": (two_state(horizon=F(3)), "AB"),
    "B turns": (two_state(values=TURNING), "AB"),
    "a wind, B turns": (two_state(values=TURNING, wind=wind("0.05"), residual=REST), "B"),
    "a wind": (two_state(values={"h": 0.9}, wind=wind("0.2"), residual=REST, predictor_gain=F(40)), "B"),
    "a wind alone": (two_state(wind=wind("0.05")), "B"),
    "a wind that nothing is left of": (two_state(wind=wind("0")), "AB"),
    "parameters that are unknown": (two_state(residual=REST), "B"),
}
OF_GAINS = (F(200), F(10**9), F(40))  # where a search has nothing to say


@cache
def honest(name: str, kind: str) -> Any:
    """What the search hands over; where it has no answer, gains that would do for a problem like it."""
    problem, proven = PROBLEMS[name]
    if kind in proven:
        return PROPOSERS[KINDS[kind]].propose(problem, Asked(curve=False)).decisive
    omega, Gamma, g = OF_GAINS
    if kind == "0":
        return NoGains()
    if kind == "B":
        return recipes_at(problem, [(omega, Gamma, g)])[0]
    R_H = problem.projection_radius
    return RateRecipe(bandwidth=omega, adaptation_rate=Gamma, predictor_gain=g, projection_radius=R_H)


SMALLER = (F(-1), F(0), F("1e-30"), F("1e-3"), F("0.1"), F("0.5"), F("0.9"), F("0.99"), F("0.999999"))
LARGER = (F("1.000001"), F("1.001"), F("1.1"), F(2), F(10), F(1000), F("1e30"))


def told(recipe: Any, kind: str) -> Iterator[tuple[str, Any]]:
    """Every number of a recipe replaced by another one."""
    for name, factor in product(NUMBERS[kind], SMALLER + LARGER):
        yield f"{name} times {float(factor):g}", replace(recipe, **{name: getattr(recipe, name) * factor})


def told_twice(recipe: Any, kind: str) -> Iterator[tuple[str, Any]]:
    """Pairs of numbers, which may hide each other."""
    for names, factor in product(combinations(NUMBERS[kind], 2), map(F, ("0.99", "0.1", "10", "-1"))):
        changed = {name: getattr(recipe, name) * factor for name in names}
        yield f"{' and '.join(names)} times {float(factor):g}", replace(recipe, **changed)


# -- numbers of any size

OMEGAS = ("rate", "twice the rate", F(40))


@cache
def problems() -> list[TubeProblem]:
    """Constants of any size, beside each other; rates that are equal to what they are compared with."""
    rng, made = np.random.default_rng(5), []
    for k in range(40):
        values = {name: float(x * np.exp(rng.uniform(-2, 1))) for name, x in ALIVE.items()}
        values["B_x"] *= k % 3 > 0
        made.append(
            alive(
                values=values,
                predictor_gain=F(int(rng.integers(1, 90)), 10),
                horizon=None if k % 2 else F(int(rng.integers(1, 40)), 10),
            )
        )
    return made


def at(problem: TubeProblem, kind: str, omega: str | Fraction) -> Any:
    """Gains of some size, at a bandwidth that may be equal to what it is compared with."""
    named = {"rate": problem.rate, "twice the rate": 2 * problem.rate}
    return replace(
        honest("every term alive", kind),
        bandwidth=named.get(omega, omega),
        adaptation_rate=F(10) ** 6,
        predictor_gain=problem.predictor_gain,
        projection_radius=problem.projection_radius,
    )
