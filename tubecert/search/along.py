"""Search of theorem HW: least levels window by window, and the radii that the constants are to be bounded for.

In floats, many bandwidths at once: each is a lane. From the widest levels on, each is lowered to what the windows
before it and itself need; that is monotone, and stops anywhere. What is printed is verified by the kernel. Implements:
theory section 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.conditions.arithmetic import Array, maximum, quiet
from tubecert.conditions.decimals import round_down, round_up
from tubecert.conditions.hardware import HardwareRecipe, Loop, Plant, Rounding, WindowProof
from tubecert.conditions.hardware.course import ages_of_feedback, base_of, resumed
from tubecert.conditions.hardware.estimation import Past, estimate
from tubecert.conditions.hardware.evaluation import Evaluated
from tubecert.conditions.hardware.windows import InWindow, Span, arrival, closed, entered, first, over
from tubecert.conditions.machine import Machine
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.search.hardware import setting_at
from tubecert.search.lanes import DEADBEAT, Lanes, Search, in_lanes
from tubecert.search.scan import serves

_DIGITS, _ROOM = 6, 9
_OMEGAS = 16
_ROUNDS = 40  # of lowering the levels
_STEP = 1.0002  # above what is needed
_SETTLED = 1e-4
_SPEEDS = 60
_FLOORS = (1.0, 0.6, 0.35, 0.2, 0.1, 0.05, 0.02)  # of where both parts of delta are the same
_WIDER = 1 + 1e-4  # of a radius, so that levels can be rounded up
_ROUNDED = 1.1  # the same where what `single` loses is not known yet
_LEAST = 1e-15


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """The windows of some lanes, and which lanes serve; `dhat` (windows, lanes)."""

    dhat: Array
    found: tuple[InWindow[Array], ...]
    good: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


class WindowSearch:
    """Theorem HW in floats, over one problem."""

    def __init__(self, problem: TubeProblem, machine: Machine, lost: Rounding | None = None) -> None:
        self.problem, self.machine = problem, machine
        self.R = machine.clip_radius(problem.constants.h)
        self.searches = [
            Search(each, each.machine, lost) for w in machine.windows if (each := over(problem, w)).machine
        ]
        self.rounding = self.searches[0].rounding
        # what is told of the whole tube rests on d < dbar there, however large a is in a window
        self.cap = float(reach(problem.proven()).lo)
        self.setting = setting_at(problem, machine, Fraction(1))
        pad = 2 * max(self.setting.sample_time, self.setting.feedback_time) + self.setting.delay
        self.spans = [
            Span(length=np.asarray(float(w.end - w.begin)), pad=np.asarray(float(pad)))
            for w in machine.windows
        ]

    @property
    def plants(self) -> list[Plant[Array]]:
        """Each window, in floats."""
        return [replace(s.plant, n=replace(s.plant.n, R=np.asarray(float(self.R)))) for s in self.searches]

    # -- one evaluation

    @quiet
    def evaluated(self, at: Lanes, dhat: Array) -> tuple[InWindow[Array], ...]:
        """Every window at levels (windows, lanes), with the least Y, S, N, np and a good floor."""
        found: list[InWindow[Array]] = []
        above = np.maximum(dhat, np.vstack([dhat[:1], dhat[:-1]]))
        for j, (p, span) in enumerate(zip(self.plants, self.spans, strict=True)):
            loop = in_lanes(at, above[j], predicts=self.machine.asked.predict, rounding=self.rounding)
            found.append(self._window(p, loop, span, found[-1] if found else None))
        return tuple(found)

    def _window(
        self, p: Plant[Array], loop: Loop[Array], span: Span[Array], before: InWindow[Array] | None
    ) -> InWindow[Array]:
        loop = self._settled(p, loop, before)
        if before is None:
            x = first(p, replace(loop, f0=loop.dhat), span).at
            floors = self._floors(x, None)
            tries = [first(p, replace(loop, f0=f0), span) for f0 in floors]
        else:
            x = entered(p, loop, before)
            floors = self._floors(x, arrival(x, before))
            tries = [self._following(replace(x, loop=replace(loop, f0=f0)), span, before) for f0 in floors]
        return _best(tries)

    @staticmethod
    def _following(x: Evaluated[Array], span: Span[Array], before: InWindow[Array]) -> InWindow[Array]:
        run = resumed(x.plant, x.loop, x.estimate, x.loss, maximum(arrival(x, before), x.loop.f0))
        return closed(replace(x, course=run), span)

    @staticmethod
    def _floors(x: Evaluated[Array], start: Array | None) -> list[Array]:
        """Around the floor at which both parts of delta are the same; that of the start where it is below."""
        n, age = x.plant.n, ages_of_feedback(x.loop)
        b = base_of(x.plant, x.loop, x.estimate) + x.loss.at(age.youngest)
        c = x.loss.at(age.oldest) * (x.loss.V_d * age.oldest + x.estimate.n_fb)
        even = (b + np.sqrt(b * b + 4 * n.lam * c)) / (2 * n.lam)
        found = [np.maximum(share * even, 1e-9 * x.loop.dhat) for share in _FLOORS]
        return found if start is None else [*found, np.clip(start, found[-1], even)]

    def _settled(self, p: Plant[Array], loop: Loop[Array], before: InWindow[Array] | None) -> Loop[Array]:
        """The loop with the least Y, S, N and np, but for rounding."""
        past = None
        if before is not None:
            p = replace(p, n=replace(p.n, H0=before.left))
            past = Past(acts=before.at.estimate.acts, sensed=before.at.estimate.sensed)
        for _ in range(_SPEEDS):
            e = estimate(p, loop, past)
            moved = np.abs(e.speed - loop.Y) + np.abs(e.bias - loop.S)
            loop = replace(loop, Y=e.speed, S=e.bias, N=e.ripple, np=e.prediction)
            if not np.any(moved > 1e-13 * loop.Y):
                break
        return loop

    # -- levels

    @quiet
    def levels(self, at: Lanes) -> Levels:
        """The least levels that are found, lane by lane."""
        ends = np.array([s.dbar for s in self.searches])[:, None]
        noisy = np.stack([x.at.estimate.n_fb for x in self.evaluated(at, ends + 0 * at.Ts)])
        dhat = np.maximum(np.minimum(self.cap, ends - noisy), 1e-9 * ends)
        for _ in range(_ROUNDS):
            found = self.evaluated(at, dhat)
            needed = np.stack([x.supremum for x in found])
            lower = np.minimum(dhat, np.where(np.isfinite(needed), _STEP * needed, dhat))
            still = np.max(1 - lower / dhat)
            dhat = lower
            if still < _SETTLED:
                break
        found = self.evaluated(at, dhat)
        return Levels(dhat=dhat, found=found, good=self._serves(dhat, found, ends))

    @staticmethod
    def _serves(
        dhat: Array, found: Sequence[InWindow[Array]], ends: Array
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        needed = np.stack([x.supremum for x in found])
        fits = np.stack([x.at.loop.dhat + x.at.estimate.n_fb for x in found]) <= ends
        curved = np.stack([np.broadcast_to(x.at.loss.chi > 0, dhat.shape[1:]) for x in found])
        return np.asarray(np.all((needed < dhat) & fits & curved & np.isfinite(needed), axis=0))

    def radii(self, levels: Levels, lane: int) -> list[Fraction]:
        """How wide the tube has to be in each window, at the levels of a lane."""
        found, wider = [], _ROUNDED if self.machine.asked.arithmetic == "single" else _WIDER
        for x, w in zip(levels.found, self.machine.windows, strict=True):
            needed = (x.at.loop.dhat + x.at.estimate.n_fb)[lane] / np.sqrt(float(x.at.plant.n.a))
            found.append(min(w.radius, round_up(float(needed) * wider, _DIGITS)))
        return found

    # -- the filter

    def chosen(self) -> tuple[Levels, int] | None:
        """The levels and the lane of the bandwidth with the least tube at its widest; None where none serves."""
        lanes = self._lanes(None)
        levels = self.levels(lanes)
        if self.setting.bandwidth is None:
            # around what comes nearest, which may serve where the grid does not
            closer = self.levels(self._lanes(float(lanes.omega[int(np.argmin(self._score(levels)))])))
            levels = min(levels, closer, key=lambda each: float(np.min(self._score(each))))
        lane = int(np.argmin(self._score(levels)))
        return (levels, lane) if levels.good[lane] else None

    def _score(self, levels: Levels) -> Array:
        """How wide the tube is at its widest; where the theorem does not hold, more than that of any which serves."""
        a = np.array([float(x.at.plant.n.a) for x in levels.found])[:, None]
        short = np.max(np.stack([x.supremum for x in levels.found]) / levels.dhat, axis=0)
        widest = np.max(levels.dhat / np.sqrt(a), axis=0)
        beyond = 1e6 * widest.max() * np.where(np.isfinite(short), 1 + short, 1e6)
        return np.asarray(np.where(levels.good, widest, beyond))

    def _lanes(self, near: float | None) -> Lanes:
        """Bandwidths from lambda/4 to no filter; or around one."""
        one = self.setting.lanes()
        if self.setting.bandwidth is not None:
            return one
        low, high = self.searches[0].rate / 4, DEADBEAT / float(self.setting.sample_time)
        ratio = (high / low) ** (1 / (_OMEGAS - 1))
        omegas = np.geomspace(low, high, _OMEGAS)
        if near is not None:
            omegas = np.clip(np.geomspace(near / ratio, near * ratio, 9), low, high)
        return replace(one[np.zeros(len(omegas), dtype=int)], omega=omegas)

    # -- decimals

    def recipe(self, levels: Levels, lane: int) -> HardwareRecipe | None:
        """The levels of a lane as decimals that prove something; else the last that was tried."""
        omega = float(levels.found[0].at.loop.omega[lane])  # type: ignore[index]
        setting, bandwidth = self.setting, self.setting.bandwidth
        if bandwidth is None and omega * float(setting.sample_time) < 0.9 * DEADBEAT:
            bandwidth = round_up(omega, 4)
        tried: HardwareRecipe | None = None
        for room in (1e-9, 1e-6, 1e-4, 1e-3):
            tried = self._printed(levels, lane, bandwidth, room)
            if tried is not None and serves(self.problem, tried):
                return tried
        return tried

    @quiet
    def _printed(
        self, levels: Levels, lane: int, bandwidth: Fraction | None, room: float
    ) -> HardwareRecipe | None:
        at = self.setting.lanes()
        omega = 2 * DEADBEAT / at.Ts if bandwidth is None else np.array([float(bandwidth)])
        cap = round_down(self.cap * (1 - 1e-12), 13)
        exact = [min(cap, round_up(float(x) * (1 + room), _DIGITS)) for x in levels.dhat[:, lane]]
        ends = [s.dbar for s in self.searches]
        dhat = np.minimum(np.array([float(x) for x in exact]), ends)[:, None]
        found = self.evaluated(replace(at, omega=omega), dhat)
        own = [_proof(level, x, room) for level, x in zip(exact, found, strict=True)]
        proofs = [each for each in own if each is not None]
        if len(proofs) < len(own):
            return None
        predictions = [w.prediction for w in proofs if w.prediction is not None]
        return HardwareRecipe(
            sample_time=self.setting.sample_time,
            delay=self.setting.delay,
            feedback_time=self.setting.feedback_time,
            bandwidth=bandwidth,
            noise=self.setting.noise,
            wind=self.setting.wind,
            clip_radius=self.R,
            level=max(w.level for w in proofs),
            floor=max(w.floor for w in proofs),
            speed=max(w.speed for w in proofs),
            bias=max(w.bias for w in proofs),
            ripple=max(w.ripple for w in proofs),
            prediction=max(predictions) if predictions else None,
            windows=tuple(proofs),
            rounding=self.rounding,
        )


def _best(tries: Sequence[InWindow[Array]]) -> InWindow[Array]:
    """Lane by lane, the try with the least supremum."""
    values = np.stack([np.where(np.isfinite(x.supremum), x.supremum, np.inf) for x in tries])
    at = np.argmin(values, axis=0)

    def pick(parts: Sequence[Array]) -> Array:
        return np.asarray(np.take_along_axis(np.stack(parts), at[None], axis=0)[0])

    x = tries[0]
    f0 = pick([t.at.loop.f0 for t in tries])
    return replace(
        x,
        at=replace(x.at, loop=replace(x.at.loop, f0=f0)),
        supremum=pick([t.supremum for t in tries]),
        end=pick([t.end for t in tries]),
    )


def _proof(level: Fraction, x: InWindow[Array], room: float) -> WindowProof | None:
    loop = x.at.loop
    sizes = [max(float(v[0]) * (1 + max(room, 1e-9)), _LEAST) for v in (loop.Y, loop.S, loop.N)]
    prediction = None if loop.np is None else max(float(loop.np[0]) * (1 + max(room, 1e-9)), _LEAST)
    if not np.all(np.isfinite([*sizes, prediction or 0.0, float(x.supremum[0])])):
        return None
    return WindowProof(
        level=level,
        floor=round_up(float(loop.f0[0]), _ROOM),
        speed=round_up(sizes[0], 13),
        bias=round_up(sizes[1], 13),
        ripple=round_up(sizes[2], 13),
        prediction=None if prediction is None else round_up(prediction, 13),
    )


def propose_in_windows(
    problem: TubeProblem, machine: Machine, lost: Rounding | None = None
) -> Proposal[HardwareRecipe]:
    """The least levels that are found, in the windows that the constants are known in; `lost` to rounding."""
    search = WindowSearch(problem, machine, lost)
    found = search.chosen()
    recipe = None if found is None else search.recipe(*found)
    return Proposal() if recipe is None else Proposal(decisive=recipe, role="machine")


def narrowed(problem: TubeProblem, machine: Machine) -> list[Fraction] | None:
    """Radii that the constants might be bounded for anew: what the least levels need; None where nothing serves."""
    search = WindowSearch(problem, machine)
    found = search.chosen()
    recipe = None if found is None else search.recipe(*found)
    return None if found is None or recipe is None or not serves(problem, recipe) else search.radii(*found)
