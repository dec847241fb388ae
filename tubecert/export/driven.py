"""Processor in the loop: compiled code drives the plant, against the adversaries that attack the loop of theorem H.

In: a setting and its machine (`simulate`), and compiled code. Out: how far it differs at every sample from the
reference, which sees the same measurements; how near the state comes to the level; and the time of a step. The plant is
integrated by Runge and Kutta's rule, a few steps for each sample. Nothing is proven.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.export.accounted import Accounted, accounts
from tubecert.export.compiled import Compiled
from tubecert.export.controller import Controller, Steering
from tubecert.export.program import Program, Writer
from tubecert.export.question import pieces_of
from tubecert.export.reference import Around, Reference, execute, handed_at
from tubecert.expression import ZERO
from tubecert.progress import Phase, Progress, Step
from tubecert.simulate.feedback import force
from tubecert.simulate.monte_carlo import case, disturbance_of
from tubecert.simulate.problem import Beside, Disturbance
from tubecert.simulate.setting import Setting
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan

C = TypeVar("C", bound=Steering)
_STEPS: Final = 2  # of the integration, at least, between instants at which an input changes
_SQUARE, _GREEDY = 1.0, 2.0  # choices of noise, see `simulate.problem.Beside`
_MIXED, _ADDED, _MODULUS = 1103515245, 12345, 2**31  # the draws of `simulate.machine`
_STEEP, _THIN = 3.0, 0.05  # of winds, see `simulate.feedback`


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """How many runs, drawn from which seed, of code in which precision."""

    count: int
    seed: int
    precision: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """What compiled code did in N runs of K samples.

    `difference`: the largest one to the reference, at a sample; `scale` the largest input; `distance`: the largest
    d(x*, x), of which `level` is proven; `escapes`: runs that reached it; `told`: steps that returned another status
    than 0 or "the horizon is over"; `step` and `worst`: seconds of a step, the median and the largest, called from
    Python. `lost`: the largest share, at a sample, of what the certificate allows rounding to cost; None where it is
    about exact arithmetic.
    """

    runs: int
    samples: int
    difference: float
    scale: float
    distance: float
    level: float
    escapes: tuple[int, ...]
    told: int
    step: float
    worst: float
    precision: str
    lost: float | None = None

    @property
    def agrees(self) -> bool:
        """Whether the difference is no more than rounding in `double` makes."""
        return self.precision == "single" or self.difference <= 1e-12 * max(1.0, self.scale)

    @property
    def fine(self) -> bool:
        """Whether nothing speaks against the code."""
        within = self.lost is None or self.lost <= 1
        return self.agrees and within and not self.escapes and not self.told


def driven(
    setting: Setting,
    code: Compiled,
    controller: Controller,
    given: Given,
    report: Progress | None = None,
) -> Driven:
    """Random runs and adversaries, as `simulate` draws them; every run is a lane of `code`."""
    kind = setting.on_machine or setting.uncertainty
    cases = [case(setting, kind, given.seed, number) for number in range(given.count)]
    around = controller if controller.boxes is None else following(controller, setting.plan)
    plant = Plant(setting, around, disturbance_of(setting, kind, cases))
    reference = Reference(controller=controller)
    x = np.array([item.start for item in cases])
    samples = int(Fraction(setting.horizon).limit_denominator(10**9) / controller.sample_time)
    seen = Seen(np.zeros(given.count))
    lost = controller.lost
    accounted = None if lost is None or not accounts(controller) else Accounted(controller, lost)
    acting: Array = np.zeros((given.count, len(controller.inputs)))
    for k in range(samples):
        if report is not None and k % 100 == 0:
            report(Step(phase=Phase.DRIVE, done=k, of=samples))
        reference.sample = k
        plant.turn(x)
        y = plant.measured(x)
        if controller.boxes is not None:
            reference.handed = code.handed = handed_at(around, k)
        if k == 0:
            acting = code.start(y)
            seen.compare(acting, reference.start(y))
        memory = None if accounted is None else code.memory()
        new = code.step(y)
        if accounted is not None and memory is not None:
            accounted.sample(k, code.measured(y), memory, code.memory())
        seen.compare(new, reference.step(y)[0])
        seen.told += int((code.status > 1).sum())
        reference.sample = k  # the plan is asked for at times after this sample
        for length, u in ((controller.delay, acting), (controller.sample_time - controller.delay, new)):
            begin = Fraction(0) if u is acting else controller.delay
            if length:
                x = plant.moved(x, (k * controller.sample_time + begin, length), u, seen)
        acting = new
    found = seen.driven(given, samples, float(controller.level), code.seconds)
    return found if accounted is None else replace(found, lost=accounted.share)


def following(controller: C, plan: Plan) -> C:
    """The controller of a family of plans, along one of them."""
    if not isinstance(plan, PiecewisePlan):
        raise ValueError("members of a family go through knots")
    return replace(controller, boxes=None, pieces=pieces_of(plan, controller.sample_time))


def joined(parts: Sequence[Driven]) -> Driven:
    """Runs along several plans as one."""
    before, escapes = 0, list[int]()
    for each in parts:
        escapes += [before + lane for lane in each.escapes]
        before += each.runs
    return replace(
        parts[0],
        runs=before,
        difference=max(each.difference for each in parts),
        scale=max(each.scale for each in parts),
        distance=max(each.distance for each in parts),
        escapes=tuple(escapes),
        told=sum(each.told for each in parts),
        step=parts[-1].step,  # the times of all calls are in it
        worst=parts[-1].worst,
    )


@dataclass(slots=True)
class Seen:
    """What has been largest so far; `distance` by run."""

    distance: Array
    difference: float = 0.0
    scale: float = 0.0
    told: int = 0

    def compare(self, found: Array, expected: Array) -> None:
        """Inputs (N, m) of the code and of the reference."""
        self.difference = max(self.difference, float(np.abs(found - expected).max()))
        self.scale = max(self.scale, float(np.abs(expected).max()))

    def driven(self, given: Given, samples: int, level: float, seconds: Sequence[float]) -> Driven:
        """What is told of it; `seconds` are those of every call of the code."""
        return Driven(
            runs=given.count,
            samples=samples,
            difference=self.difference,
            scale=self.scale,
            distance=float(self.distance.max()),
            level=level,
            escapes=tuple(int(lane) for lane in np.flatnonzero(~(self.distance < level))),
            told=self.told,
            step=float(np.median(seconds)),
            worst=float(np.max(seconds)),
            precision=given.precision,
        )


class Plant:
    """N plants under a disturbance, as `simulate.feedback` and `simulate.machine` have it, in numpy."""

    def __init__(self, setting: Setting, controller: Steering, disturbance: Disturbance) -> None:
        self._force = force(disturbance)
        self._own: Beside = self._force.beside
        self._layer = disturbance.layer
        self._plan = Around(controller=controller)
        self._adds_plan = controller.adds_plan
        self._program = _plant(setting)
        self._sizes = len(setting.model.states), len(setting.model.inputs), self._own.blowing.shape[1]
        lanes = len(self._own.wind)
        self._draw: NDArray[np.int64] = np.arange(1, lanes + 1)
        self._tally, self._noise, self._last = 0, np.zeros((lanes, self._sizes[0])), 0.0
        self._signal, self._slope, self._since = self._own.begin.copy(), np.zeros_like(self._own.begin), 0.0
        self._time = controller.sample_time

    @property
    def _now(self) -> float:
        return float(self._tally * self._time)

    def turn(self, x: Array) -> None:
        """At a sample the signal of the adversary turns: it moves along c, or along its direction."""
        own, t = self._own, self._now
        if not own.ramp.any():
            return
        _, _, _, c = self._at(x, t)
        aims = np.linalg.norm(own.along, axis=1) == 0.0
        direction = np.where(aims[:, None], c, own.along)
        size = np.maximum(np.linalg.norm(direction, axis=1), 1e-300)
        forwards = np.sign(np.sin(own.turning[:, 0] * t + own.turning[:, 1]) + 1e-300)
        self._signal = np.where(own.ramp[:, None] > 0, self._h(x, t, c), self._signal)
        self._slope = (own.ramp * forwards / size)[:, None] * direction
        self._since = t

    def measured(self, x: Array) -> Array:
        """y = x + n, and the next sample begins."""
        own, t = self._own, self._now
        lanes, Q = own.table.shape[0], own.table.shape[1]
        self._draw = (_MIXED * self._draw + _ADDED) % _MODULUS
        place, sign = (self._draw // 65536) % Q, np.ones(lanes)
        square = own.choice == _SQUARE
        place = np.where(square, 0, place)
        sign = np.where(square & ((self._tally // own.period.astype(np.int64)) % 2 == 1), -1.0, sign)
        greedy = own.choice == _GREEDY
        if greedy.any():
            place = np.where(greedy, self._costliest(x, t), place)
        step = sign[:, None] * own.table[np.arange(lanes), place] - self._noise
        size = np.linalg.norm(step, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            room = own.most * (t - self._last)
            share = np.where((self._tally == 0) | (size <= room), 1.0, room / size)
        self._noise = self._noise + share[:, None] * step
        self._tally, self._last = self._tally + 1, t
        return np.asarray(x + self._noise)

    def moved(self, x: Array, span: tuple[Fraction, Fraction], u: Array, seen: Seen) -> Array:
        """The states after a time in which u (and u*, where that is not in it) acts."""
        begin, length = span
        h = float(length / _STEPS)
        for k in range(_STEPS):
            t = float(begin + k * length / _STEPS)
            k1 = self.rate(x, t, u)
            k2 = self.rate(x + h / 2 * k1, t + h / 2, u)
            k3 = self.rate(x + h / 2 * k2, t + h / 2, u)
            k4 = self.rate(x + h * k3, t + h, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            self.look(x, t + h, seen)
        return x

    def look(self, x: Array, t: float, seen: Seen) -> None:
        """Notes how far the states are from the plan."""
        distance = self._plan.distance(x, np.asarray(t))
        seen.distance = np.fmax(seen.distance, np.nan_to_num(distance, nan=np.inf))

    def _on_plan(self, t: float) -> tuple[Array, Array]:
        return self._plan.plan(np.asarray(t))

    def rate(self, x: Array, t: float, u: Array) -> Array:
        """x' = f + B (u + h) + E w + r."""
        f, B, wind, c = self._at(x, t)
        acting = u if self._adds_plan else u + self._on_plan(t)[1]
        return np.asarray(f + np.einsum("lij,lj->li", B, acting + self._h(x, t, c)) + wind)

    def _at(self, x: Array, t: float) -> tuple[Array, Array, Array, Array]:
        """f (N, n), B (N, n, m), E w + r (N, n) and c = B'M z (N, m), which adversaries aim by."""
        n, m, k = self._sizes
        lanes = len(x)
        (found,) = execute(self._program, np.concatenate([x, self._own.theta], axis=1))
        f, B = found[:, :n], found[:, n : n + n * m].reshape(lanes, n, m)
        E = found[:, n + n * m : n + n * m + n * k].reshape(lanes, n, k)
        g = np.einsum("lij,lj->li", self._plan.metric(x), x - self._on_plan(t)[0])
        c = np.einsum("lij,li->lj", B, g)
        return f, B, self._wind(t, E, B, g, c) + found[:, n + n * m + n * k :], c

    def _h(self, x: Array, t: float, c: Array) -> Array:
        own = self._force
        angle = own.frequency * t + np.einsum("lwn,ln->lw", own.wave, x) + own.phase
        h = np.einsum("lwm,lw->lm", own.amplitude, np.sin(angle))
        size = np.sqrt((c * c).sum(axis=1) + self._layer**2)
        h = h + (own.push / size)[:, None] * c
        moving = self._own.ramp > 0
        h = h + np.where(moving[:, None], self._signal + (t - self._since) * self._slope, 0.0)
        h = np.clip(h, own.box[0], own.box[1])
        length = np.linalg.norm(h, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(h * np.where(length > own.radius, own.radius / length, 1.0)[:, None])

    def _wind(self, t: float, E: Array, B: Array, g: Array, c: Array) -> Array:
        own = self._own
        if not own.wind.any():
            return np.zeros(E.shape[:2])
        outward = np.where((own.aim == 1.0)[:, None], g, np.einsum("lij,lj->li", B, c))
        aimed = np.einsum("lik,li->lk", E, outward)
        w = np.where((own.aim == 0.0)[:, None], own.blowing, aimed)
        thin = np.where(own.aim > 0.0, (_THIN * self._layer) ** 2, 0.0)
        square = (w * w).sum(axis=1) + thin
        wave = np.clip(_STEEP * np.sin(own.gusting[:, 0] * t + own.gusting[:, 1]), -1.0, 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(square > 0.0, own.wind * wave / np.sqrt(square), 0.0)
        return np.asarray(np.einsum("lik,lk->li", E, share[:, None] * w))

    def _costliest(self, x: Array, t: float) -> NDArray[np.intp]:
        """Which noise makes the feedback cost most at the state, c'kappa of (H.14)."""
        _, _, _, c = self._at(x, t)
        table = self._own.table
        lanes, Q, n = table.shape
        y = (x[:, None, :] + table).reshape(lanes * Q, n)
        kappa = self._plan.kappa(y, np.asarray(t))[0].reshape(lanes, Q, -1)
        return np.asarray(np.argmax(np.einsum("lqm,lm->lq", kappa, c), axis=1))


def _plant(setting: Setting) -> Program:
    """f, B, E and r as one program of the states and of parameters in ranges."""
    model, writer = setting.model, Writer()
    names = (*model.states, *dict(model.parameters))
    places = dict(zip(names, writer.input("x", len(names)), strict=True))
    n = len(model.states)
    rest = setting.rest or tuple((ZERO,) for _ in range(n))
    rows = (*((e,) for e in model.f), *model.B, *setting.E, *rest)
    writer.output("all", [place for row in rows for place in writer.expressions(row, places)])
    return writer.finished("plant", "f, B, E and what no input reaches")
