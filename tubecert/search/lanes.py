"""Loops of theorem H in floats, many machines at once: what is least at each, and which choices reach it.

Each machine is a lane. Over (dhat, omega, f0) there is a valley - bias s1/omega against noise omega - so that a coarse
grid starts and zooms follow. Nothing is proven here. Implements: theory section 8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import hardware as theorem_h
from tubecert.conditions import machine as machines
from tubecert.conditions.arithmetic import Array, least_solution, quiet
from tubecert.conditions.hardware import Loop, Plant, Rounding, gains
from tubecert.conditions.hardware.loop import lost_of
from tubecert.conditions.machine import Machine
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import TubeProblem
from tubecert.search.scan import boundary_log

DEADBEAT = 40.0  # omega Ts of a filter that might as well not be there
_PREDICTIONS = 4  # steps of the fixed point of np; what is printed is verified
_LEVELS = 24
_ZOOMS = 26
_HAIR = 1 + 1e-12
_TIE = 1e-7
_STEEP = 200.0  # more than logarithms of what is needed change along the unit cube
_FINE = 1e-3  # steps after which nothing finite will be found
LEAST = 1e-15  # of what is 0 but for rounding
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

    def __getitem__(self, index: object) -> Choice:
        """Those of some of the lanes."""
        return Choice(**{name: getattr(self, name)[index] for name in Choice.__slots__})


def in_lanes(at: Lanes, dhat: Array, *, predicts: bool, rounding: tuple[Rounding, ...] = ()) -> Loop[Array]:
    """The loops of machines at levels, with nothing proven of Y, S, N and np, and the level for a floor."""
    zero = np.zeros(np.broadcast_shapes(at.Ts.shape, dhat.shape))
    ratio = np.maximum(at.Ts, at.Tf) / np.minimum(at.Ts, at.Tf)
    return Loop(
        Ts=at.Ts,
        tau=at.tau,
        Tf=at.Tf,
        omega=at.omega,
        nu=at.nu,
        wbar=at.wbar,
        dhat=dhat + zero,
        f0=dhat + zero,
        Y=zero,
        S=zero,
        N=zero,
        np=zero if predicts else None,
        late=np.where(at.Tf > at.Ts, 1.0, 0.0),
        off=np.where(np.abs(ratio - np.round(ratio)) > 1e-9, 1.0, 0.0),
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
            geodesic=exact.geodesic,
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
        loop = replace(loop, f0=chosen.f0)
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
        """The least Y: every term of the minimum and maximum in X is affine in Y, and known from Y = 0 and 1."""
        n, DB = self.plant.n, gains.acting(self.plant, self.plant.n.DB)
        e = theorem_h.estimate(self.plant, replace(loop, Y=np.stack([0 * loop.Y, 0 * loop.Y + 1])))
        wait = loop.Ts + loop.tau
        drift = n.phi + DB * (e.kb + e.ups) + self.plant.D_E * loop.wbar

        def least(*parts: Array) -> Array:
            first, second = sum(parts, start=e.s1 * wait)
            return least_solution(drift + DB * first, DB * (second - first))

        settled = least(gains.settled(self.plant, e.bias, e.ripple), e.ripple)
        return np.minimum(drift + DB * (n.Dh + n.R), np.maximum(settled, least(n.H0, e.ripple)))

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
        best, place = self._zoomed(at, dhat, decides=False)
        found = self._chosen(at, dhat, place[:, :, None])
        return best, Choice(dhat=found.dhat[:, 0], omega=found.omega[:, 0], f0=found.f0[:, 0])

    def holds(self, at: Lanes, dhat: Array | None = None) -> Mask:
        """Whether the least `needed` is below 1, per lane: no closer than that takes."""
        return np.asarray(self._zoomed(at, dhat, decides=True)[0] < 1)

    def _chosen(self, at: Lanes, dhat: Array | None, point: Array) -> Choice:
        """Points of the unit cube (3, lanes, points) as choices (lanes, points)."""
        top = np.maximum(self.dbar - at.nu * float(self.plant.m.n_M), 1e-9 * self.dbar)
        level = (
            top[:, None] * np.exp(-9 * point[0])
            if dhat is None
            else np.broadcast_to(dhat[:, None], point[0].shape)
        )
        return Choice(
            dhat=level, omega=self._omegas(at[:, None], point[1]), f0=level * np.exp(-14 * point[2])
        )

    def _zoomed(self, at: Lanes, dhat: Array | None, *, decides: bool) -> tuple[Array, Array]:
        """The least `needed` that is found and its place in the unit cube (3, lanes).

        `decides`: a lane is left as soon as it is below 1, or so far above that smaller steps do not lead there.
        """
        count = len(at.Ts)
        start, sizes = _grid(free=dhat is None)
        around = _AROUND_3 if dhat is None else _AROUND_2
        points = np.repeat(start[:, None, :], count, axis=1)
        steps = np.repeat(sizes, count, axis=1)
        best, place = np.full(count, np.inf), np.zeros((3, count))
        left = np.arange(count)
        for _ in range(_ZOOMS):
            own, level, rows = at[left], None if dhat is None else dhat[left], np.arange(len(left))
            values = self.needed(own[:, None], self._chosen(own, level, points))
            index = np.argmin(values, axis=1)
            least = values[rows, index]
            better = least < best[left]
            best[left] = np.where(better, least, best[left])
            place[:, left] = np.where(better, points[:, rows, index], place[:, left])
            steps[:, left] = np.where(better, steps[:, left], 0.5 * steps[:, left])
            if decides:
                left = left[_open(best[left], steps[:, left].max(axis=0))]
                if not len(left):
                    break
            points = np.clip(place[:, left, None] + steps[:, left, None] * around[:, None, :], 0.0, 1.0)
        return best, place

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
        return self.holds(repeated, dhat.ravel()).reshape(dhat.shape)


def _grid(*, free: bool) -> tuple[Array, Array]:
    """Where zooms start, (3, points) of the unit cube, and their steps (3, 1); `free`: over levels, too."""
    counts = (7 if free else 1, 13, 9)
    axes = [(np.arange(k) + 0.5) / k if k > 1 else np.array([0.0]) for k in counts]
    axes[1][-1] = 1.0
    axes[0] = axes[0] - axes[0][0]
    start = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")])
    return start, np.array([[0.5 / k] for k in counts])


def _open(best: Array, step: Array) -> Mask:
    """Where smaller steps may still tell whether the least value is below 1."""
    far = np.where(np.isfinite(best), best * np.exp(-_STEEP * step) >= 1, step < _FINE)
    return np.asarray(~((best < 1) | far))


def _around(free: tuple[bool, ...]) -> Array:
    """Steps of a zoom: -1, 0, 1 in each direction that is free, shape (directions, points)."""
    ways = [np.array([-1.0, 0.0, 1.0]) if each else np.array([0.0]) for each in free]
    return np.stack([a.ravel() for a in np.meshgrid(*ways, indexing="ij")])


_AROUND_3 = _around((True, True, True))
_AROUND_2 = _around((False, True, True))
