"""Search of certificate H: the least level at a machine, and the largest sample time, delay, noise or wind.

In floats, many machines at once: each is a lane. Over (dhat, omega, f0) there is a valley - bias s1/omega against noise
omega - so that a coarse grid starts and zooms follow. Round first, then verify the printed decimals: the exact theorem
is not monotone in Ts. Implements: theory section 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import hardware as theorem_h
from tubecert.conditions import machine as machines
from tubecert.conditions.arithmetic import Array, least_solution, quiet
from tubecert.conditions.decimals import round_down, round_up
from tubecert.conditions.hardware import HardwareRecipe, Loop, Plant, Rounding, gains
from tubecert.conditions.hardware.loop import lost_of
from tubecert.conditions.machine import Machine
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Asked, Proposal
from tubecert.kernel import obstacles
from tubecert.search.scan import boundary_log, largest, serves

DIGITS = 4
_ROOM = 9  # digits of what only the proof needs
DEADBEAT = 40.0  # omega Ts of a filter that might as well not be there
_PREDICTIONS = 4  # steps of the fixed point of np; what is printed is verified
_LEVELS = 24
_ZOOMS = 26
_HAIR = 1 + 1e-12
_TIE = 1e-7
_LEAST = 1e-15  # of what is 0 but for rounding
_CURVE_POINTS = 13
_NOTHING_LOST = Rounding(
    feedback=Fraction(0), input=Fraction(0), estimate=Fraction(0), prediction=Fraction(0)
)

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lanes:
    """Machines, one per lane: all arrays have one shape; `omega` NaN where it is to be found."""

    Ts: Array
    tau: Array
    Tf: Array
    nu: Array
    wbar: Array
    omega: Array

    def __getitem__(self, index: object) -> Lanes:
        """Some of the lanes, or the same with axes added."""
        return Lanes(**{name: getattr(self, name)[index] for name in Lanes.__slots__})


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What is free at a machine, per lane."""

    dhat: Array
    omega: Array
    f0: Array


def in_lanes(at: Lanes, dhat: Array, *, predicts: bool, rounding: tuple[Rounding, ...] = ()) -> Loop[Array]:
    """The loops of machines at levels, with nothing proven of Y, S, N and np, and the level for a floor."""
    zero = np.zeros(np.broadcast_shapes(at.Ts.shape, dhat.shape))
    ratio = np.maximum(at.Ts, at.Tf) / np.minimum(at.Ts, at.Tf)
    return Loop(
        Ts=at.Ts + zero,
        tau=at.tau + zero,
        Tf=at.Tf + zero,
        omega=at.omega + zero,
        nu=at.nu + zero,
        wbar=at.wbar + zero,
        dhat=dhat + zero,
        f0=dhat + zero,
        Y=zero,
        S=zero,
        N=zero,
        np=zero if predicts else None,
        late=np.where(at.Tf > at.Ts, 1.0, 0.0) + zero,
        off=np.where(np.abs(ratio - np.round(ratio)) > 1e-9, 1.0, 0.0) + zero,
        lost=lost_of(rounding, lambda q: np.asarray(float(q))),
    )


class Search:
    """Theorem H in floats, over one problem; `lost`: what rounding may cost."""

    def __init__(self, problem: TubeProblem, machine: Machine, lost: Rounding | None = None) -> None:
        self.rounding = () if machine.asked.arithmetic is None else (lost or _NOTHING_LOST,)
        self.problem = problem
        self.machine = machine
        self.R = machine.clip_radius(problem.constants.h)
        exact = theorem_h.plant(problem, self.R)
        self.plant = Plant(
            n=problem.floats(self.R),
            m=machines.floats(exact.m),
            beta_w=exact.beta_w.hi,
            D_E=exact.D_E.hi,
            eps_w=exact.eps_w.hi,
            rest=exact.rest.hi,
            held=exact.held,
            drift=None if exact.drift is None else exact.drift.hi,
            gain=None if exact.gain is None else exact.gain.hi,
        )
        self.dbar = float(reach(self.plant.n))
        self.rate = float(self.plant.n.lam)

    # -- what a choice needs

    @quiet
    def settled(self, at: Lanes, chosen: Choice) -> Loop[Array]:
        """The loop with the least Y, S, N and np; but for rounding, what the theorem asks for."""
        loop = in_lanes(
            replace(at, omega=chosen.omega),
            chosen.dhat,
            predicts=self.machine.asked.predict,
            rounding=self.rounding,
        )
        loop = replace(loop, f0=chosen.f0 + 0 * loop.Ts)
        for _ in range(1 if loop.np is None else _PREDICTIONS):
            Y = self._least_speed(loop)
            loop = self._filtered(replace(loop, Y=Y))
            e = theorem_h.estimate(self.plant, loop)
            loop = replace(loop, Y=np.maximum(Y, e.speed), np=e.prediction)
        return self._filtered(loop)

    def _filtered(self, loop: Loop[Array]) -> Loop[Array]:
        """With the least S and N."""
        zero = 0 * loop.Y
        e = theorem_h.estimate(self.plant, replace(loop, S=zero, N=zero))
        return replace(loop, S=gains.settled(self.plant, e.bias, e.ripple), N=e.ripple)

    def _least_speed(self, loop: Loop[Array]) -> Array:
        """The least Y: every term of the minimum and maximum in X is affine in Y."""
        n, DB = self.plant.n, gains.acting(self.plant, self.plant.n.DB)
        still, moving = (theorem_h.estimate(self.plant, replace(loop, Y=loop.Y * 0 + y)) for y in (0.0, 1.0))
        wait = loop.Ts + loop.tau
        drift = n.phi + DB * (still.kb + still.ups) + self.plant.D_E * loop.wbar

        def least(*parts: tuple[Array, Array]) -> Array:
            first = sum((x for x, _ in parts), still.s1 * wait)
            second = sum((y for _, y in parts), moving.s1 * wait)
            return least_solution(drift + DB * first, DB * (second - first))

        ripple = still.ripple, moving.ripple
        bias = tuple(gains.settled(self.plant, e.bias, e.ripple) for e in (still, moving))
        settled = least((bias[0], bias[1]), ripple)
        return np.minimum(drift + DB * (n.Dh + n.R), np.maximum(settled, least((n.H0, n.H0), ripple)))

    @quiet
    def needed(self, at: Lanes, chosen: Choice) -> Array:
        """What dhat has to exceed, over dhat, and what dbar has to, over dbar: below 1 where the theorem holds."""
        x = theorem_h.evaluated(self.plant, self.settled(at, chosen))
        # of what serves alike, what is less in the long run
        stays = (x.course.supremum() + _TIE * x.course.bound.ultimate()) / x.loop.dhat
        fits = (x.loop.dhat + x.estimate.n_fb) / self.dbar
        worst = np.maximum(stays, fits)
        good = np.isfinite(worst) & (x.loss.chi > 0) & (at.tau <= at.Ts * _HAIR)
        if self.machine.asked.predict:
            good = good & (at.tau <= at.Tf * _HAIR)
        return np.where(good, worst, np.inf)

    # -- minima over what is free

    def _omegas(self, at: Lanes, share: Array) -> Array:
        """From lambda/4 to no filter, in logarithms of omega, at a share in [0, 1]; what is asked for where it is."""
        low, high = np.log(self.rate / 4), np.log(DEADBEAT / at.Ts)
        return np.where(np.isnan(at.omega), np.exp(low + (high - low) * share), at.omega)

    def least(self, at: Lanes, dhat: Array | None = None) -> tuple[Array, Choice]:
        """The least `needed` per lane with a choice that has it; at a given dhat, or over dhat too."""
        top = np.maximum(self.dbar - at.nu * float(self.plant.m.n_M), 1e-9 * self.dbar)
        free = dhat is None

        def chosen(point: Array) -> Choice:
            level = (
                top[:, None] * np.exp(-9 * point[0])
                if dhat is None
                else np.broadcast_to(dhat[:, None], point[0].shape)
            )
            return Choice(
                dhat=level, omega=self._omegas(at[:, None], point[1]), f0=level * np.exp(-14 * point[2])
            )

        counts = (7 if free else 1, 13, 9)
        axes = [(np.arange(k) + 0.5) / k if k > 1 else np.array([0.0]) for k in counts]
        axes[1][-1] = 1.0
        axes[0] = axes[0] - axes[0][0]
        start = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")])
        lanes = np.arange(len(at.Ts))
        points = np.repeat(start[:, None, :], len(lanes), axis=1)
        steps = np.repeat(np.array([[0.5 / k] for k in counts]), len(lanes), axis=1)
        best: Array = np.full(len(lanes), np.inf)
        place = np.zeros((3, len(lanes)))
        around = _AROUND_3 if free else _AROUND_2
        for _ in range(_ZOOMS):
            values = self.needed(at[:, None], chosen(points))
            index = np.argmin(values, axis=1)
            better = values[lanes, index] < best
            best = np.where(better, values[lanes, index], best)
            place = np.where(better, points[:, lanes, index], place)
            steps = np.where(better, steps, 0.5 * steps)
            points = np.clip(place[:, :, None] + steps[:, :, None] * around[:, None, :], 0.0, 1.0)
        found = chosen(place[:, :, None])
        return best, Choice(dhat=found.dhat[:, 0], omega=found.omega[:, 0], f0=found.f0[:, 0])

    def levels(self, at: Lanes, rounds: int = 4) -> Choice:
        """The least levels that are found, with their choices; NaN where there is none."""
        best, best_choice = self.least(at)
        low = max(float(self.plant.n.d0), 1e-6 * self.dbar)
        grid = np.geomspace(np.full(len(at.Ts), low), np.full(len(at.Ts), self.dbar), _LEVELS)
        grid = np.sort(np.vstack([grid, best_choice.dhat]), axis=0)
        holds = self._holds(at, grid) | ((grid == best_choice.dhat) & (best < 1))
        lanes, first = np.arange(len(at.Ts)), np.argmax(holds, axis=0)
        good, bad = grid[first, lanes], grid[np.maximum(first - 1, 0), lanes]
        dhat = boundary_log(lambda x: self._holds(at, x), good, bad, rounds=rounds)
        value, choice = self.least(at, dhat)
        # what was found by a search over all levels serves where the one at a single level has missed it
        kept = np.where(value < 1, True, False)
        dhat = np.where(kept, dhat, np.where(best < 1, best_choice.dhat, np.nan))
        return Choice(
            dhat=dhat,
            omega=np.where(kept, choice.omega, best_choice.omega),
            f0=np.where(kept, choice.f0, best_choice.f0),
        )

    def _holds(self, at: Lanes, dhat: Array) -> Mask:
        """Whether the theorem holds at levels, shape `(points, lanes)`."""
        repeated = at[np.tile(np.arange(dhat.shape[1]), dhat.shape[0])]
        best, _ = self.least(repeated, dhat.ravel())
        return np.asarray(best < 1).reshape(dhat.shape)


def _around(free: tuple[bool, ...]) -> Array:
    """Steps of a zoom: -1, 0, 1 in each direction that is free, shape (directions, points)."""
    ways = [np.array([-1.0, 0.0, 1.0]) if each else np.array([0.0]) for each in free]
    return np.stack([a.ravel() for a in np.meshgrid(*ways, indexing="ij")])


_AROUND_3, _AROUND_2 = _around((True, True, True)), _around((False, True, True))


# -- machines


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
    return proof_at(search, setting, printed(setting, nearest, 0.0), 1e-6) if np.isfinite(best[0]) else None


def served(search: Search, setting: Setting, choice: Choice) -> HardwareRecipe | None:
    """A choice as decimals that prove something, with a level as low as they allow; else the last that was tried."""
    recipe: HardwareRecipe | None = None
    for own in _near(search, setting, choice):
        for inflation in (1e-9, 1e-6):
            recipe = proof_at(search, setting, own, inflation)
            if recipe is not None and serves(search.problem, recipe):
                return recipe
    return recipe


def _near(search: Search, setting: Setting, choice: Choice) -> Iterator[Printed]:
    """The choice with more and more room, what is free chosen again for each level; then what has the most of it.

    Each is looked for only if none before it serves: nearly always the first does.
    """
    at, tried = setting.lanes(), []
    for room in (1e-7, 1e-5, 1e-4, 1e-3, None):
        level = None if room is None else np.array([float(printed(setting, choice, room).level)])
        tried.append(search.least(at, level)[1])
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


def proof_at(search: Search, setting: Setting, own: Printed, inflation: float) -> HardwareRecipe | None:
    """The recipe at printed numbers: Y, S, N and np in floats, inflated, as decimals; None where they have no bound."""
    at = setting.lanes()
    omega = 2 * DEADBEAT / at.Ts if own.bandwidth is None else np.array([float(own.bandwidth)])
    chosen = Choice(dhat=np.array([float(own.level)]), omega=omega, f0=np.array([float(own.floor)]))
    loop = search.settled(at, chosen)
    sizes = [max(float(x[0]) * (1 + inflation), _LEAST) for x in (loop.Y, loop.S, loop.N)]
    prediction = None if loop.np is None else max(float(loop.np[0]) * (1 + inflation), _LEAST)
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

    return _largest(search, at, _ends(search), points=60)


def repeated(lane: Lanes, count: int) -> Lanes:
    """One lane, so many times."""
    return lane[np.zeros(count, dtype=int)]


def sampled_at(machine: Machine, base: Lanes, Ts: Array) -> Lanes:
    """The same machines with other sample times, and what follows from them."""
    follows = machine.asked.feedback_time is None
    return replace(
        base, Ts=Ts, Tf=Ts if follows else base.Tf, tau=Ts if machine.asked.one_sample else base.tau
    )


def _largest(search: Search, at: Callable[[Array], Lanes], ends: tuple[float, float], points: int) -> float:
    def test(x: Array) -> Mask:
        best, _ = search.least(at(x.ravel()))
        return np.asarray(best < 1).reshape(x.shape)

    return float(largest(test, np.array([ends[0]]), np.array([ends[1]]), points=points)[0])


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
            _largest(search, lambda x: sampled_at(machine, repeated(base, len(x)), x), ends, 40),
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
    found = []
    for i, each in enumerate(settings):
        own = Choice(dhat=choices.dhat[[i]], omega=choices.omega[[i]], f0=choices.f0[[i]])
        recipe = served(search, each, own) if np.isfinite(own.dhat[0]) else None
        if recipe is not None:
            found.append(recipe)
    return tuple(found)


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
    curve = _curve(search, setting) if asked.curve and serves(problem, recipe) else ()
    return Proposal(decisive=recipe, role="largest" if searched else "machine", curve=curve)
