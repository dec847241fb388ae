"""The search for the weights whose tables keep the tube small, and the tables; or why none were found.

In: a plant. Out: a `Design`. A pattern search on the logarithms of all weights, for the geometric mean of the fixed
point's widths, which needs no reference; inputs, the safe set and what is wished are its limits. Trusted: no; nothing
is proven by what is said to be missing either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import null_space, orth

from tubecert.enclosure.interval import Array
from tubecert.loop_design.observer import Observer, observe
from tubecert.loop_design.plant import Plant, in_units
from tubecert.loop_design.widths import STILL, Response, respond, rest_at, settle, sizes, spread
from tubecert.sampled_loop.record import Tables

FACTORS = (10.0, 3.0, 1.7, 3.0, 1.7, 1.3, 1.7, 1.3)  # on a weight
GAIN = 1e-3  # what a step must gain
STEPS, MANY = 24, 400  # of the fixed point in a search, and at the end
SPARE = 1.1  # times the remainder has a fixed point there: a proof does not find those that barely exist
UNSTABLE, OPEN = 1e9, 1e3  # what loops count that are not stable, or have no tube
ROOM = 0.95  # of an input, a wish and the safe set may be used without a price: rigorous bounds are a little wider
DEAR = 100.0  # what an input costs that needs twice its room: beyond it there is no certificate
FREE = 0.05  # what an input that nothing limits counts, beside the widths
SLOW = 0.03  # what lags count: twice as many must make the tube 2 % smaller
LONG = 3000  # lags, and more cost every state in proportion: they take long to prove
BRIEF = 100  # the same where nothing pushes: all that a loop has to do is to return
SEEN = 2.0  # times the noise of a state: to know it better than that is worth nothing
LATER = 1.0  # what the long run counts beside the tube for ever, where the start makes them differ


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Tables with zeta = (e, eta, v) observed; W (n,) and U (m,) as floats find them; `evaluations` of the search."""

    tables: Tables
    W: Array
    U: Array
    evaluations: int


@dataclass(eq=False)
class NoDesign(Exception):  # noqa: N818 -- an answer, not a fault
    """No tables keep a tube, or none were found.

    "no_design": no input moves a mode that does not die away, `where` the state in which it shows most, `needed` its
    growth in 1/s; without `where`, no stable loop was found. "inputs": input `where` needs that much of what is
    allowed. "no_fixed_point": state `where` grows past `needed`, `allowed` it would have without remainders.
    """

    kind: Literal["no_design", "inputs", "no_fixed_point"]
    where: int | None = None
    needed: float | None = None
    allowed: float | None = None


def design(plant: Plant, report: Callable[[int, float], None] | None = None) -> Design:
    """The tables with the smallest tube that the search has found; `report` is told evaluations and the best value.

    Raises `NoDesign` where a mode cannot be moved or held, or where the best loop found needs more input than there
    is, or has no tube.
    """
    if not (plant.room > 0).all():
        raise NoDesign("inputs", int(np.argmin(plant.room)))
    _refuse_unheld(plant)
    own = in_units(plant)
    s, u, _ = own.units
    if not np.isfinite(np.concatenate(own.units)).all():  # too much happens within a sample
        raise NoDesign("no_design")
    refuse_unmoved(own.A, own.B)
    search = _Search(observe(own), report or (lambda evaluations, value: None))
    if (reached := search.reach(search.best())) is None:
        raise NoDesign("no_design")
    first, needed = np.split(reached.alone * np.r_[s, u], [len(s)])
    if (needed > plant.room).any():
        j = int(np.argmax(needed - plant.room))
        raise NoDesign("inputs", j, float(needed[j]), float(plant.room[j]))
    size, moved = settle(own, reached.response.gain, reached.response.ever, MANY)
    W, U = np.split(size * np.r_[s, u], [len(s)])
    if moved > STILL and not plant.start.any():  # after a start the remainder falls
        worst = int(np.argmax(W / first))
        raise NoDesign("no_fixed_point", worst, float(W[worst]), float(first[worst]))
    (n, m), table = plant.B.shape, search.observer.rounded(reached.theta)
    tables = Tables(table[m:, n:], table[m:, :n], table[:m, n:], table[:m, :n])
    return Design(tables, np.maximum(W, plant.start), U, evaluations=search.evaluations)


def refuse_unmoved(A: Array, B: Array) -> None:
    """Modes outside of all that the inputs reach must die away by themselves; in units of order one."""
    reached = B
    for _ in A:
        reached = orth(np.hstack([reached, A @ reached]), rcond=1e-9)
    rest = null_space(reached.T)
    inner = rest.T @ A @ rest
    for growth, mode in zip(*np.linalg.eig(inner.T), strict=True):
        if growth.real > -1e-6 * np.abs(inner).max():
            raise NoDesign("no_design", int(np.argmax(np.abs(rest @ mode))), float(growth.real))


def _refuse_unheld(plant: Plant) -> None:
    """A real mode z = l'e that grows must be held against eta and wind, as large as it is when an input can answer.

    z' = g z + l'(B delta + H eta + E w): no controller, linear or not, does with less.
    """
    growths, modes = np.linalg.eig(plant.A.T)
    for growth, left in zip(growths, modes.T, strict=True):
        if growth.imag == 0 and growth.real > 1e-9 * np.abs(plant.A).max():
            wind = np.linalg.norm(left @ plant.E, 2 if plant.wind_ball else 1)
            pushed = wind + np.abs(left @ plant.H) @ plant.magnitude
            needed = pushed * np.exp(growth.real * (plant.sample_time + plant.delay))
            moved = np.abs(left @ plant.B)
            strength = moved[moved > 0] @ plant.room[moved > 0]
            if needed > strength:
                j = int(np.argmax(moved))
                raise NoDesign("inputs", j, float(plant.room[j] * needed / strength), float(plant.room[j]))


class _Reached(NamedTuple):
    """A controller and how far its loop is driven, (n + m,): `alone` without what grows with the tube, `ever`, `late`.

    `grows`: by which factor that widens the tube ever more; 0 where it may close.
    """

    theta: Array
    response: Response
    alone: Array
    ever: Array
    late: Array
    grows: float = 0.0


class _Search:
    """Hooke and Jeeves on the weights of one observer."""

    def __init__(self, observer: Observer, report: Callable[[int, float], None]) -> None:
        self.observer, self.report = observer, report
        self.plant = plant = observer.plant
        self.evaluations, self.n = 0, len(plant.A)
        self.constant = rest_at(plant, np.zeros(sum(plant.B.shape)))
        self.counts = np.array([1.0, LATER if plant.start.any() or plant.eta_start.any() else 0.0]) / self.n
        self.least = np.maximum(SEEN * plant.noise, 1e-30)
        self.most = np.minimum(plant.space, plant.wishes)
        self.long = LONG if plant.magnitude.any() or plant.E.any() else BRIEF

    def reach(self, weights: Array) -> _Reached | None:
        """How far the loop of these weights is driven, None if it is not stable.

        A tube falls after a start: for ever it has half the remainder of its beginning, half that of its long run.
        """
        self.evaluations += 1
        plant, theta = self.plant, self.observer.table(weights)
        response = None if theta is None else respond(plant, self.observer.sample, theta)
        if theta is None or response is None:
            return None
        alone, gain = sizes(plant, response.ever + response.gain @ self.constant), SPARE * response.gain
        late, moved = settle(plant, gain, response.long_run, STEPS)
        if not np.isfinite(moved):
            return _Reached(theta, response, alone, alone, late, spread(plant, gain, alone))
        rest = rest_at(plant, late)
        first = rest_at(plant, sizes(plant, response.ever + gain @ rest))
        ever = sizes(plant, response.ever + gain @ (0.5 * rest + 0.5 * first))
        return _Reached(theta, response, alone, ever, late)

    def value(self, weights: Array) -> float:
        """What the search makes small, a logarithm.

        The geometric mean of the widths; larger where inputs or the tube leave their room, or inputs cost nothing, and
        for loops that forget slowly. Where no tube closes, by which factor it grows.
        """
        if (reached := self.reach(weights)) is None:
            return UNSTABLE
        plant, lags = self.plant, reached.response.lags
        W, U = np.split(reached.ever, [self.n])
        if reached.grows:
            value = OPEN + np.log(reached.grows)
        else:
            over = np.maximum(0.0, W / self.most - ROOM)
            both = np.maximum([W, reached.late[: self.n]], self.least)
            value = self.counts @ np.log(both).sum(axis=1) + np.log1p(5 * over + 50 * over**2).sum()
        value += DEAR * np.maximum(0.0, U / plant.room - ROOM).sum()
        value += FREE * np.log(np.maximum(U[np.isinf(plant.room)], 1e-9)).sum()
        return float(value + SLOW * np.log(lags) + self.n * np.log(max(1.0, lags / self.long)))

    def best(self) -> Array:
        """From plain weights along every one while that gains, then along the whole sweep once more."""
        weights = np.zeros(sum(self.observer.sizes()))
        best = self.value(weights)
        for factor in FACTORS:
            origin = weights
            for direction in np.eye(len(weights)):
                for move in (np.log(factor) * direction, -np.log(factor) * direction):
                    before, (weights, best) = best, self._along(move, weights, best)
                    if best < before:
                        break
            weights, best = self._along(weights - origin, weights, best)
        return weights

    def _along(self, move: Array, weights: Array, best: float) -> tuple[Array, float]:
        while move.any() and (value := self.value(weights + move)) < best - GAIN:
            weights, best = weights + move, value
            self.report(self.evaluations, best)
        return weights, best
