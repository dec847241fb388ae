"""Search of certificate H: the least level at a machine, and the largest sample time, delay, noise or wind.

In floats (`lanes`), then in decimals: round first, then verify the printed decimals, for the exact theorem is not
monotone in Ts. Implements: theory section 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import hardware as theorem_h
from tubecert.conditions.arithmetic import Array
from tubecert.conditions.decimals import round_down, round_up
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.conditions.machine import Machine
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Asked, Proposal
from tubecert.kernel import obstacles
from tubecert.search.lanes import DEADBEAT, LEAST, Choice, Lanes, Mask, Search
from tubecert.search.scan import largest, serves

DIGITS = 4
_UNALIKE = 0.7  # of the inflation: for a Y that S is a multiple of
_LEAST_ROOM = 1e-7
_ROOM = 9  # digits of what only the proof needs
_ROOMS = (_LEAST_ROOM, 1e-5, 1e-4, 1e-3, None)
_CURVE_POINTS = 13
_ROUNDS = 7  # to 2e-9: four digits of it are printed
_ASIDE = 1e-9  # of the largest level: n_M in floats is not n_M


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A machine in exact numbers; `bandwidth` None is searched for."""

    sample_time: Fraction
    delay: Fraction
    feedback_time: Fraction
    noise: Fraction
    wind: Fraction
    bandwidth: Fraction | None

    def lanes(self) -> Lanes:
        """One lane."""
        return Lanes(
            Ts=np.array([float(self.sample_time)]),
            tau=np.array([float(self.delay)]),
            Tf=np.array([float(self.feedback_time)]),
            nu=np.array([float(self.noise)]),
            wbar=np.array([float(self.wind)]),
            omega=np.array([np.nan if self.bandwidth is None else float(self.bandwidth)]),
        )


def setting_at(problem: TubeProblem, machine: Machine, value: Fraction) -> Setting:
    """The machine that is asked for, with `value` for the number that is searched for, if one is."""
    asked, wind = machine.asked, problem.wind
    Ts = value if asked.sample_time is None else asked.sample_time
    delay = Ts if asked.one_sample else value if asked.delay is None else asked.delay
    noise = Fraction(1) if isinstance(asked.noise, tuple) else value if asked.noise is None else asked.noise
    gust = Fraction(0) if wind is None else value if wind.bound is None else wind.bound
    return Setting(
        sample_time=Ts,
        delay=delay,
        feedback_time=Ts if asked.feedback_time is None else asked.feedback_time,
        noise=noise,
        wind=gust,
        bandwidth=asked.bandwidth,
    )


def recipe_at(search: Search, setting: Setting) -> HardwareRecipe | None:
    """The least level that is found for a machine; where none serves, what comes nearest, if anything is finite."""
    at = setting.lanes()
    choice = search.levels(at)
    if np.isfinite(choice.dhat[0]):
        return served(search, setting, choice)
    best, nearest = search.least(at)
    if not np.isfinite(best[0]):
        return None
    # the largest level there may be, rounded into what (H.10) allows: what it lacks is then said of (H.12) alone
    own = printed(setting, nearest, 0.0)
    allowed = round_down(float(nearest.dhat[0]) * (1 - _ASIDE), DIGITS + 1)
    return proof_at(search, setting, replace(own, level=allowed), 1e-6)


def served(
    search: Search, setting: Setting, choice: Choice, first: Choice | None = None
) -> HardwareRecipe | None:
    """A choice as decimals that prove something, with a level as low as they allow; else the last that was tried.

    `first`: what is free at the level with the least room, where that is known.
    """
    recipe: HardwareRecipe | None = None
    for share in (1.0, _UNALIKE):
        for own in _near(search, setting, choice, first):
            for inflation in (1e-9, 1e-6):
                recipe = proof_at(search, setting, own, inflation, share)
                if recipe is not None and serves(search.problem, recipe):
                    return recipe
    return recipe


def _near(search: Search, setting: Setting, choice: Choice, first: Choice | None = None) -> Iterator[Printed]:
    """The choice with more and more room, what is free chosen again for each level; then what has the most of it.

    Each is looked for only if none before it serves: nearly always the first does.
    """
    at = setting.lanes()
    tried: list[Choice] = []
    for room in _ROOMS:
        level = None if room is None else np.array([float(printed(setting, choice, room).level)])
        known = first if first is not None and not tried else None
        tried.append(known or search.least(at, level)[1])
        yield printed(setting, tried[-1], 0.0)
    # without a filter the theorem knows of no horizon, and a short one may be what is needed
    yield from (printed(setting, each, 0.0, filtered=True) for each in tried)


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """What was chosen, as decimals; `bandwidth` None: no filter."""

    bandwidth: Fraction | None
    level: Fraction
    floor: Fraction


def printed(setting: Setting, choice: Choice, room: float, *, filtered: bool = False) -> Printed:
    """A choice of one lane as decimals, the level with `room`; `filtered`: with a bandwidth in any case."""
    omega, bandwidth = float(choice.omega[0]), setting.bandwidth
    if bandwidth is None and (filtered or omega * float(setting.sample_time) < 0.9 * DEADBEAT):
        bandwidth = round_up(omega, DIGITS)
    return Printed(
        bandwidth=bandwidth,
        level=round_up(float(choice.dhat[0]) * (1 + room) * (1 - 1e-15), DIGITS + 1),
        floor=round_up(float(choice.f0[0]), _ROOM),
    )


def proof_at(
    search: Search, setting: Setting, own: Printed, inflation: float, share: float = 1.0
) -> HardwareRecipe | None:
    """The recipe at printed numbers: Y, S, N and np in floats, inflated, as decimals; None where they have no bound.

    Y by a `share` of the inflation: where S is a multiple of Y and no more, an equal one leaves S nothing to spare.
    """
    at = setting.lanes()
    omega = 2 * DEADBEAT / at.Ts if own.bandwidth is None else np.array([float(own.bandwidth)])
    chosen = Choice(dhat=np.array([float(own.level)]), omega=omega, f0=np.array([float(own.floor)]))
    loop = search.settled(at, chosen)
    room = (share * inflation, inflation, inflation)
    bare = zip((loop.Y, loop.S, loop.N), room, strict=True)
    sizes = [max(float(x[0]) * (1 + more), LEAST) for x, more in bare]
    prediction = None if loop.np is None else max(float(loop.np[0]) * (1 + inflation), LEAST)
    if not np.all(np.isfinite([*sizes, prediction or 0.0])):
        return None
    Y, S, N = (round_up(value, 13) for value in sizes)
    return HardwareRecipe(
        sample_time=setting.sample_time,
        delay=setting.delay,
        feedback_time=setting.feedback_time,
        bandwidth=own.bandwidth,
        noise=setting.noise,
        wind=setting.wind,
        clip_radius=search.R,
        level=own.level,
        floor=own.floor,
        speed=Y,
        bias=S,
        ripple=N,
        prediction=None if prediction is None else round_up(prediction, 13),
        rounding=search.rounding,
    )


def largest_value(search: Search) -> float:
    """The largest number of what is searched for that serves, in floats; 0 if none does."""
    asked = search.machine.asked
    one = setting_at(search.problem, search.machine, Fraction(1)).lanes()

    def at(x: Array) -> Lanes:
        base = repeated(one, len(x))
        if asked.largest == "noise":
            return replace(base, nu=x)
        if asked.largest == "wind":
            return replace(base, wbar=x)
        if asked.largest == "delay":
            return replace(base, tau=x)
        return sampled_at(search.machine, base, x)

    return _largest(search, at, _ends(search), points=60, rounds=_ROUNDS)


def repeated(lane: Lanes, count: int) -> Lanes:
    """One lane, so many times."""
    return lane[np.zeros(count, dtype=int)]


def sampled_at(machine: Machine, base: Lanes, Ts: Array) -> Lanes:
    """The same machines with other sample times, and what follows from them."""
    follows = machine.asked.feedback_time is None
    return replace(
        base, Ts=Ts, Tf=Ts if follows else base.Tf, tau=Ts if machine.asked.one_sample else base.tau
    )


def _largest(
    search: Search, at: Callable[[Array], Lanes], ends: tuple[float, float], points: int, rounds: int
) -> float:
    def test(x: Array) -> Mask:
        return search.holds(at(x.ravel())).reshape(x.shape)

    low, high = (np.array([end]) for end in ends)
    return float(largest(test, low, high, points=points, rounds=rounds)[0])


def _ends(search: Search) -> tuple[float, float]:
    """Between what the largest number is looked for."""
    asked = search.machine.asked
    if asked.largest == "delay" and asked.sample_time is not None:
        return 1e-6 * float(asked.sample_time), float(asked.sample_time)
    if asked.largest == "noise":
        most = search.dbar / max(float(search.plant.m.n_M), 1e-300)
        return 1e-9 * most, most
    if asked.largest == "wind":
        most = search.rate * search.dbar / max(float(search.plant.beta_w), 1e-300)
        return 1e-9 * most, 10 * most
    return 1e-9 / search.rate, 1e2 / search.rate


def _largest_values(search: Search) -> Iterator[Fraction]:
    """Decimals to try for what is searched for, the largest first."""
    asked = search.machine.asked
    found, most = largest_value(search), asked.sample_time
    if asked.largest == "delay" and most is not None and found > 0.999 * float(most):
        yield most
    for attempt in range(4 if found > 0 else 0):
        yield round_down(found * (1 - 1e-9) * (1 - attempt * 2e-4), DIGITS)
    if asked.largest != "sample_time":
        yield Fraction(0)


def _curve(search: Search, setting: Setting) -> tuple[HardwareRecipe, ...]:
    """Levels against the sample time, at machines that are else the same; at most up to where none serves any more."""
    given, machine = float(setting.sample_time), search.machine
    base = setting.lanes()
    if machine.asked.largest == "sample_time":
        most = given
    else:
        ends = (0.5 * given, 1e2 / search.rate)
        most = max(
            _largest(search, lambda x: sampled_at(machine, repeated(base, len(x)), x), ends, 40, rounds=6),
            given,
        )
    least = given / 16 if machine.asked.one_sample else max(given / 16, float(setting.delay), 1e-9 * most)
    times = np.geomspace(least, most, _CURVE_POINTS) if least < most else np.array([given])
    exact = sorted({round_down(value * (1 - 1e-9), 3) for value in times} | {setting.sample_time})
    settings = [
        replace(
            setting,
            sample_time=Ts,
            delay=Ts if machine.asked.one_sample else setting.delay,
            feedback_time=Ts if machine.asked.feedback_time is None else setting.feedback_time,
            bandwidth=machine.asked.bandwidth,
        )
        for Ts in exact
        if machine.asked.one_sample or setting.delay <= Ts
    ]
    lanes = sampled_at(
        machine, repeated(base, len(settings)), np.array([float(x.sample_time) for x in settings])
    )
    choices = search.levels(lanes, rounds=3)
    there = np.flatnonzero(np.isfinite(choices.dhat))
    found = _all_served(search, [settings[i] for i in there], choices[there], lanes[there])
    return tuple(recipe for recipe in found if recipe is not None)


def _all_served(
    search: Search, settings: Sequence[Setting], choices: Choice, lanes: Lanes
) -> Iterator[HardwareRecipe | None]:
    """Choices of several machines as decimals; what is free at the first levels to be tried is chosen side by side."""
    tried = [printed(each, choices[[i]], _LEAST_ROOM).level for i, each in enumerate(settings)]
    _, first = search.least(lanes, np.array([float(level) for level in tried]))
    for i, each in enumerate(settings):
        yield served(search, each, choices[[i]], first[[i]])


def propose_hardware(problem: TubeProblem, asked: Asked) -> Proposal[HardwareRecipe]:
    """The least level at the machine that is asked for, or at the largest one of what is searched for.

    Gains that are asked for are those of other loops: this one is the specification's.
    """
    machine = problem.machine
    if machine is None or obstacles(problem, theorem_h.THEOREM):
        return Proposal()
    search = Search(problem, machine, asked.lost)
    searched = machine.asked.largest is not None
    recipe: HardwareRecipe | None = None
    for value in _largest_values(search) if searched else [Fraction(1)]:
        setting = setting_at(problem, machine, value)
        recipe = recipe_at(search, setting)
        if recipe is not None and serves(problem, recipe):
            break
    if recipe is None:
        return Proposal()
    # what rounding may cost belongs to one sample time: no curve over others
    wanted = asked.curve and not search.rounding
    curve = _curve(search, setting) if wanted and serves(problem, recipe) else ()
    return Proposal(decisive=recipe, role="largest" if searched else "machine", curve=curve)
