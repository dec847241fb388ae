"""The search for the weights whose tables keep the tube small, and the tables; or why none were found.

In: a plant. Out: a `Design`. A pattern search on the logarithms of all weights, first for the geometric mean of the
widths without remainders, which needs no reference, then for the largest of the fixed point's widths with them,
relative to the first or to what is wished. Trusted: no; nothing is proven by what is said to be missing either.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import null_space, orth

from tubecert.enclosure.interval import Array
from tubecert.loop_design.observer import Observer, observe
from tubecert.loop_design.plant import Plant, in_units
from tubecert.loop_design.widths import STILL, Response, respond, rest_at, settle, sizes, spread
from tubecert.sampled_loop.record import Tables

COARSE = (10.0, 3.0)  # factors on groups of weights
FINE = (3.0, 1.7, 3.0, 1.7, 1.3)  # on groups and on single weights
GAIN = 1e-3  # what a step must gain
STEPS, MANY = 24, 400  # of the fixed point in a search, and at the end
SPARE = 1.1  # times the remainder has a fixed point there: a proof does not find those that barely exist
UNSTABLE, OPEN = 1e9, 1e3  # what loops count that are not stable, or have no tube
ROOM = 0.95  # of an input may be used without a price: rigorous bounds are a little wider
FREE = 0.05  # what an input that nothing limits counts, beside the widths
SLOW = 0.03  # what lags count: twice as many must make the tube 2 % smaller
LONG = 3000  # lags, and more cost in proportion: they take long to prove
BRIEF = 100  # the same, once for every state, where neither h nor wind acts: the loop has only to return
SEEN = 2.0  # times the noise of a state: to know it better than that is worth nothing
LATER = 1.0  # what the long run counts beside the tube for ever, where the start makes them differ
GROWN = 10.0  # times its width without remainders is the most that a state is compared with
WISH = 0.9  # of a half-width that is wished is aimed at
UNASKED = 2.0  # times its first half-width is what a state may have for another one's wish


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
    weights = search.found()
    if (reached := search.response(weights)) is None:
        raise NoDesign("no_design")
    theta, response = reached
    alone = sizes(own, response.ever + response.gain @ search.constant)
    needed = alone[len(s) :] * u
    if (needed > plant.room).any():
        j = int(np.argmax(needed - plant.room))
        raise NoDesign("inputs", j, float(needed[j]), float(plant.room[j]))
    size, moved = settle(own, response.gain, response.ever, MANY)
    (W, U), first = np.split(size * np.r_[s, u], [len(s)]), alone[: len(s)] * s
    # one that falls after a start has a smaller remainder than at first
    if moved > STILL and not plant.start.any():
        worst = int(np.argmax(W / first))
        raise NoDesign("no_fixed_point", worst, float(W[worst]), float(first[worst]))
    (n, m), table = plant.B.shape, search.observer.rounded(theta)
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


@dataclass(frozen=True, slots=True, eq=False)
class _Reached:
    """How far a loop is driven: W for ever and in the long run (2, n), U (m,).

    `grows`: by which factor what is not linear widens a tube ever more; 0 where it may close.
    """

    lags: float
    W: Array
    U: Array
    grows: float = 0.0


class _Search:
    """Hooke and Jeeves on the weights of one observer: first without, then with what grows with the tube."""

    def __init__(self, observer: Observer, report: Callable[[int, float], None]) -> None:
        self.observer, self.report = observer, report
        self.plant = plant = observer.plant
        self.evaluations = 0
        self.n = len(plant.A)
        self.constant = rest_at(plant, np.zeros(sum(plant.B.shape)))
        self.counts = np.array([1.0, LATER if plant.start.any() or plant.eta_start.any() else 0.0]) / self.n
        self.least = np.maximum(SEEN * plant.noise, 1e-30)
        self.reference: Array | None = None
        self.most = np.full((0, self.n), np.inf)  # of W for ever, once wishes are met
        sorts, many = np.repeat(range(6), observer.sizes()), np.repeat(observer.sizes(), observer.sizes())
        self.groups = np.array([1.0 * (sorts == sort) for sort in (1, 2, 3, 4)])
        self.singles = np.eye(len(sorts))[(many > 1) | (sorts == 0) | (sorts == 5)]

    def found(self) -> Array:
        """The best weights: without remainders, with them, and where wishes are met still narrower."""
        weights, wished = self.run(self.within()), np.isfinite(self.plant.wishes)
        alone, grown = self.reach(weights), self.reach(weights, STEPS)
        if alone is None or grown is None or not (wished.any() or (grown.W > (1 + 1e-4) * alone.W).any()):
            return weights
        first = np.minimum(grown.W, GROWN * alone.W) * (UNASKED if wished.any() else 1.0)
        self.reference = np.maximum(first, self.least)
        self.reference[:, wished] = WISH * self.plant.wishes[wished]
        weights = self.run(weights)
        if not self.meets_wishes(weights):
            weights = min(weights, self.run(self.within()), key=self.value)
        if not wished.any() or not self.meets_wishes(weights):
            return weights
        self.reference, self.most = None, self.plant.wishes[None]
        return self.run(weights, FINE[1:2])

    def within(self) -> Array:
        """First weights: inputs grow dear, and eta slow, until no input leaves its room."""
        weights = np.zeros(self.groups.shape[1])
        for _ in range(8):
            reached = self.reach(weights)
            if reached and (self.plant.room >= reached.U).all():
                break
            weights = weights + np.log(10) * np.array([1, 1, -1, 0]) @ self.groups
        return weights

    def meets_wishes(self, weights: Array) -> bool:
        """Whether the tube of these weights is as narrow as wished, and not wider than the safe set."""
        reached, most = self.reach(weights, STEPS), np.minimum(self.plant.wishes, self.plant.space)
        return reached is not None and not reached.grows and bool((most >= reached.W).all())

    def response(self, weights: Array) -> tuple[Array, Response] | None:
        """Theta of these weights and what it answers; None if the loop is not stable."""
        self.evaluations += 1
        theta = self.observer.table(weights)
        response = None if theta is None else respond(self.plant, self.observer.sample, theta)
        return None if theta is None or response is None else (theta, response)

    def reach(self, weights: Array, steps: int = 0) -> _Reached | None:
        """How far the loop of these weights is driven; without `steps` no remainder grows.

        A tube falls after a start: for ever it has half the remainder of its beginning, half that of its long run.
        """
        if (found := self.response(weights)) is None:
            return None
        response, plant, n = found[1], self.plant, self.n
        known = response.gain @ self.constant
        alone, late = (sizes(plant, rows + known) for rows in (response.ever, response.long_run))
        if not steps:
            return _Reached(response.lags, np.array([alone, late])[:, :n], alone[n:])
        gain = SPARE * response.gain
        late, moved = settle(plant, gain, response.long_run, steps)
        if not np.isfinite(moved):
            return _Reached(
                response.lags, np.array([late, late])[:, :n], alone[n:], spread(plant, gain, alone)
            )
        rest = rest_at(plant, late)
        first = sizes(plant, response.ever + gain @ rest)
        ever = sizes(plant, response.ever + gain @ (0.5 * rest + 0.5 * rest_at(plant, first)))
        return _Reached(response.lags, np.array([ever, late])[:, :n], ever[n:])

    def value(self, weights: Array) -> float:
        """What the search makes small, a logarithm.

        The geometric mean of the widths or, with a reference, their 8-norm relative to it; larger where inputs or the
        tube leave their room, or inputs cost nothing, and for loops that forget slowly. Where no tube closes, by which
        factor it grows.
        """
        steps = STEPS if self.reference is not None or len(self.most) else 0
        if (reached := self.reach(weights, steps)) is None:
            return UNSTABLE
        W, plant = reached.W, self.plant
        used = [reached.U / plant.room, W[0] / plant.space, (W[0] / self.most).ravel()]
        if reached.grows:
            value, used = OPEN + np.log(reached.grows), used[:1]
        elif self.reference is None:
            value = self.counts @ np.log(np.maximum(W, self.least)).sum(axis=1)
        else:
            value = np.log(self.counts @ ((W / self.reference) ** 8).sum(axis=1)) / 8
        over = np.maximum(0.0, np.concatenate(used) - ROOM)
        free = FREE * np.log(np.maximum(reached.U[np.isinf(plant.room)], 1e-9)).sum()
        most, states = (LONG, 1) if plant.pushed else (BRIEF, self.n)
        forgets = SLOW * np.log(reached.lags) + states * np.log(max(1.0, reached.lags / most))
        return float(value + np.log1p(5 * over + 50 * over**2).sum() + free + forgets)

    def run(self, weights: Array, fine: Sequence[float] = FINE) -> Array:
        """Along every direction while that gains, then along the whole sweep once more."""
        best = self.value(weights)
        single = np.concatenate([self.groups, self.singles])
        sweeps = [(factor, self.groups) for factor in COARSE] + [(factor, single) for factor in fine]
        for factor, directions in sweeps:
            origin = weights
            for direction in directions:
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
