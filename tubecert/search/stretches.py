"""Search of theorems BW and CW: the least Gamma, or the largest Ts, for which every window has a level, and the levels.

In floats, many gains at once: each is a lane. From the widest levels and speeds on, each is lowered to what is needed;
that is monotone, and stops anywhere. What is printed is verified by the kernel. Implements: theory section 4f.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import distance_windows, sampled_windows
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.decimals import round_down, round_up
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.obstacles import reach
from tubecert.conditions.predictor import predictor
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.proposal import Asked, Proposal
from tubecert.conditions.sampled import SampledRecipe, ages
from tubecert.conditions.stretches import Course, LevelProof, over, speed_needed
from tubecert.search.distance import best_gain, printed_gain
from tubecert.search.scan import boundary_log, largest, minimum_log, serves

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
Run = Callable[[Sequence[Array]], Sequence[Course[Array]]]
"""The windows at given speeds."""

_DIGITS = 4  # of gains
_STEP = 1 + 1e-4  # of a level above what is needed
_ROUGH, _FINE = 10, 60  # rounds of lowering levels and speeds
_LEAST_RATE, _MOST_RATE = 1e-2, 1e18
_ROUNDS = 5  # of bisection, 4 bits each
_SHORTEST, _LONGEST = 1e-7, 1e1  # sample times considered, in units of 1/rate
_FORGOTTEN = 10.0  # times 1/q: what the estimator held is nothing by then
_WIDER = 1.003  # of a radius, so that levels can rise a little
_ROOMS = (1e-8, 1e-6, 1e-4, 1e-3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Levels and speeds of every window, (lanes,) each, and which lanes serve."""

    levels: tuple[Array, ...]
    speeds: tuple[Array, ...]
    good: Mask


class PartSearch:
    """The parts of one problem in floats, for one radius of the projection."""

    def __init__(self, problem: TubeProblem, R_H: Fraction) -> None:
        self.problem, self.R_H = problem, R_H
        self.numbers = [over(problem, part).floats(R_H) for part in problem.parts]
        if not problem.constant_input:
            self.numbers = [
                replace(n, wind_matched=n.wind_speed, rest_matched=n.rest_speed) for n in self.numbers
            ]
        whole = reach(problem.floats(R_H))
        self.caps = [np.minimum(reach(n), whole) for n in self.numbers]
        self.lengths = [np.asarray(float(part.end - part.begin)) for part in problem.parts]
        self.shortest = min(part.end - part.begin for part in problem.parts)

    @quiet
    def lowered(self, run: Run, shape: tuple[int, ...], rounds: int) -> Levels:
        """Levels and speeds from the widest on."""
        caps = [np.broadcast_to(cap, shape) for cap in self.caps]
        levels = list(caps)
        speeds = [self._speed(n, level, n.Dh + n.R) for n, level in zip(self.numbers, levels, strict=True)]
        good: Mask = np.zeros(shape, dtype=bool)
        for _ in range(rounds):
            found = run(speeds)
            speeds = [
                self._speed(n, level, course.uncertainty)
                for n, level, course in zip(self.numbers, levels, found, strict=True)
            ]
            levels = [np.fmin(cap, course.supremum * _STEP) for cap, course in zip(caps, found, strict=True)]
            good = np.all([c.supremum < level for c, level in zip(found, levels, strict=True)], axis=0)
        return Levels(levels=tuple(levels), speeds=tuple(speeds), good=good)

    @staticmethod
    def _speed(n: Numbers[Array], level: Array, uncertainty: Array) -> Array:
        return speed_needed(n, level, uncertainty) * (1 + 1e-9)

    # -- theorem BW

    def _distance_run(self, omega: Array, Gamma: Array, g: Array | None) -> tuple[Run, Array]:
        p = predictor(self.problem.A_m, omega, g)
        settling = np.minimum(_FORGOTTEN / p.q, float(self.shortest) / 4)
        loop = distance_windows.Loop(omega=omega, Gamma=Gamma, predictor=p, settling=settling)
        return (
            lambda speeds: [
                own.course for own in distance_windows.along(self.numbers, self.lengths, speeds, loop)
            ],
            settling,
        )

    def _gain(self, omega: Array) -> Array | None:
        if self.problem.A_m is not None:
            g = self.problem.predictor_gain
            return None if g is None else np.asarray(float(g))
        fastest = max(self.numbers, key=lambda n: float(n.phi))
        return best_gain(fastest, omega, speed_needed(fastest, reach(fastest), fastest.Dh + fastest.R))

    def least_rate(self, omega: Array) -> Array:
        """The least Gamma per bandwidth, (lanes,), infinite where none serves."""

        def test(Gamma: Array) -> Mask:
            w = np.broadcast_to(omega, Gamma.shape)
            run, _ = self._distance_run(w, Gamma, self._gain(w))
            return self.lowered(run, Gamma.shape, _ROUGH).good

        most, least = np.full(omega.shape, _MOST_RATE), np.full(omega.shape, _LEAST_RATE)
        found = boundary_log(test, most, least, _ROUNDS)
        return np.where(test(most[None])[0], found, np.inf)

    def best_bandwidth(self) -> float:
        """Where the least Gamma is least."""
        rate = float(self.problem.rate)
        return minimum_log(self.least_rate, rate, 1e5 * rate, 3)

    def distance_recipe(self, omega: Fraction, Gamma: Fraction) -> DistanceRecipe | None:
        """The least levels at printed gains, if they prove something."""
        g = printed_gain(self.problem, max(self.numbers, key=lambda n: float(n.phi)), omega, 0.0)
        w, rate = (np.array([float(x)]) for x in (omega, Gamma))
        run, settling = self._distance_run(w, rate, None if g is None else np.array([float(g)]))
        waits = round_down(float(settling.min()), _DIGITS)
        found = self.lowered(run, (1,), _FINE)
        if not found.good[0]:
            return None
        for room in _ROOMS:
            windows = self._printed(found, room)
            recipe = DistanceRecipe(
                bandwidth=omega,
                adaptation_rate=Gamma,
                predictor_gain=g,
                projection_radius=self.R_H,
                speed=max(own.speed for own in windows),
                prediction_error=Fraction(1),
                uncertainty=Fraction(1),
                settling=waits,
                windows=windows,
            )
            recipe = self._with_sizes(recipe)
            if serves(self.problem, recipe):
                return recipe
        return None

    @quiet
    def _with_sizes(self, recipe: DistanceRecipe) -> DistanceRecipe:
        """With the largest S and e of its windows."""
        w, rate, waits = (
            np.array([float(x)]) for x in (recipe.bandwidth, recipe.adaptation_rate, recipe.settling or 0)
        )
        g = None if recipe.predictor_gain is None else np.array([float(recipe.predictor_gain)])
        loop = distance_windows.Loop(
            omega=w, Gamma=rate, predictor=predictor(self.problem.A_m, w, g), settling=waits
        )
        speeds = [np.array([float(own.speed)]) for own in recipe.windows]
        found = distance_windows.along(self.numbers, self.lengths, speeds, loop)
        S, e = (
            max(float(getattr(own, name)[0]) for own in found) * (1 + 1e-9)
            for name in ("uncertainty", "error")
        )
        if not np.isfinite([S, e]).all():
            return recipe
        return replace(
            recipe, uncertainty=round_up(max(S, 1e-30), 13), prediction_error=round_up(max(e, 1e-30), 13)
        )

    # -- theorem CW

    def _sampled_run(self, Ts: Array, omega: Array, g: Array) -> Run:
        age = ages(Ts, omega, g)
        loop = sampled_windows.Loop(Ts=Ts, omega=omega, m=age.m, w=age.w)
        return lambda speeds: [
            own.course for own in sampled_windows.along(self.numbers, self.lengths, speeds, loop)
        ]

    def longest(self, omega: Array | None) -> float:
        """The largest Ts, at omega = 1/Ts or at a bandwidth; 0 where none serves."""
        g = self.problem.predictor_gain

        def test(Ts: Array) -> Mask:
            w = 1 / Ts if omega is None else np.broadcast_to(omega, Ts.shape)
            gain = w if g is None else np.broadcast_to(float(g), Ts.shape)
            short = Ts < 0.499 * float(self.shortest)
            return short & self.lowered(self._sampled_run(Ts, w, gain), Ts.shape, _ROUGH).good

        rate = float(self.problem.rate)
        ends = np.array([_SHORTEST / rate]), np.array([_LONGEST / rate])
        return float(largest(test, *ends, points=60)[0])

    def sampled_recipe(self, Ts: Fraction, omega: Fraction) -> SampledRecipe | None:
        """The least levels at printed gains, if they prove something."""
        g = self.problem.predictor_gain or omega
        run = self._sampled_run(*(np.array([float(x)]) for x in (Ts, omega, g)))
        found = self.lowered(run, (1,), _FINE)
        if not found.good[0]:
            return None
        for room in _ROOMS:
            windows = self._printed(found, room)
            recipe = SampledRecipe(
                sample_time=Ts,
                bandwidth=omega,
                predictor_gain=g,
                projection_radius=self.R_H,
                speed=max(own.speed for own in windows),
                windows=windows,
            )
            if serves(self.problem, recipe):
                return recipe
        return None

    # -- decimals

    def _printed(self, found: Levels, room: float) -> tuple[LevelProof, ...]:
        """Levels and speeds with some room, none beyond its tube."""
        ends = [round_down(float(cap) * (1 - 1e-12), 13) for cap in self.caps]
        return tuple(
            LevelProof(
                level=min(round_up(float(level[0]) * (1 + room), 7), end),
                speed=round_up(float(speed[0]) * (1 + room), 13),
            )
            for level, speed, end in zip(found.levels, found.speeds, ends, strict=True)
        )

    def radii(self, recipe: DistanceRecipe | SampledRecipe) -> list[Fraction]:
        """How wide the tubes have to be for the levels of a recipe, and a little more."""
        return [
            min(part.radius, round_up(_WIDER * float(own.level) / np.sqrt(float(n.a)), 6))
            for part, own, n in zip(self.problem.parts, recipe.windows, self.numbers, strict=True)
        ]


def _least(search: PartSearch, bandwidth: Fraction | None) -> DistanceRecipe | None:
    """The recipe of least Gamma, at a bandwidth if one is given."""
    omega = round_up(search.best_bandwidth(), _DIGITS) if bandwidth is None else bandwidth
    rate = float(search.least_rate(np.array([float(omega)]))[0])
    if not np.isfinite(rate):
        return None
    for more in (1.0, 1.001, 1.01, 2.0):
        recipe = search.distance_recipe(omega, round_up(rate * more, _DIGITS))
        if recipe is not None:
            return recipe
    return None


def propose_distance_in_parts(problem: TubeProblem, asked: Asked) -> Proposal[DistanceRecipe]:
    """The gains of least Gamma, or those asked for, with the least levels that are found."""
    search = PartSearch(problem, problem.projection_radius)
    recipe = _least(search, asked.bandwidth)
    if asked.adaptation_rate is not None and recipe is not None:
        recipe = search.distance_recipe(recipe.bandwidth, asked.adaptation_rate)
    if recipe is None:
        return Proposal()
    role = "least_adaptation" if asked.bandwidth is None and asked.adaptation_rate is None else "asked"
    return Proposal(decisive=recipe, role=role)


def propose_sampled_in_parts(problem: TubeProblem, asked: Asked) -> Proposal[SampledRecipe]:
    """The largest sample time, or the one asked for, with the least levels that are found."""
    search = PartSearch(problem, problem.clipping_radius)
    fixed = None if asked.bandwidth is None else np.array([float(asked.bandwidth)])
    most = float(asked.sample_time) if asked.sample_time is not None else search.longest(fixed)
    for less in (1e-6, 1e-3, 1e-2, 0.1):
        if not most > 0:
            break
        Ts = asked.sample_time or round_down(most * (1 - less), _DIGITS)
        recipe = search.sampled_recipe(Ts, asked.bandwidth or round_up(1 / Ts, _DIGITS))
        if recipe is not None:
            return Proposal(decisive=recipe, role="pair")
    return Proposal()


def gains_found(problem: TubeProblem, asked: Asked) -> list[DistanceRecipe | SampledRecipe]:
    """What would be proposed."""
    found = (propose_distance_in_parts(problem, asked), propose_sampled_in_parts(problem, asked))
    return [each.decisive for each in found if each.decisive is not None]


def radii_for(problem: TubeProblem, recipes: Sequence[DistanceRecipe | SampledRecipe]) -> list[Fraction]:
    """Radii that the constants might be bounded for anew: what the least levels need."""
    found = [PartSearch(problem, recipe.projection_radius).radii(recipe) for recipe in recipes]
    return [max(each) for each in zip(*found, strict=True)]


def serve_still(problem: TubeProblem, recipes: Sequence[DistanceRecipe | SampledRecipe]) -> bool:
    """Whether the gains that were found for other constants have levels here."""
    return all(_levels_at(problem, recipe) is not None for recipe in recipes)


def _levels_at(
    problem: TubeProblem, recipe: DistanceRecipe | SampledRecipe
) -> DistanceRecipe | SampledRecipe | None:
    search = PartSearch(problem, recipe.projection_radius)
    if isinstance(recipe, SampledRecipe):
        return search.sampled_recipe(recipe.sample_time, recipe.bandwidth)
    return search.distance_recipe(recipe.bandwidth, recipe.adaptation_rate)
