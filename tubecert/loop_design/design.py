"""The search for the weights whose tables keep the tube small, and the tables.

In: a plant. Out: a `Design`. A pattern search on the logarithms of all weights, first for the geometric mean of the
widths without remainders, which needs no reference, then for the largest of the fixed point's widths with them,
relative to the first or to what is wished. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.loop_design import unfound
from tubecert.loop_design.observer import Observer, in_units, observe, rounded, units_of
from tubecert.loop_design.plant import Plant
from tubecert.loop_design.unfound import NoDesign
from tubecert.loop_design.widths import Response, respond, rest_at, sample_of, settle, sizes
from tubecert.sampled_loop.record import Tables

COARSE = (10.0, 3.0)  # factors on groups of weights
FINE = (3.0, 1.7, 3.0, 1.7, 1.3)  # on groups and on single weights
GAIN = 1e-3  # what a step must gain
STEPS = 8  # of the fixed point in a search
SPARE = 1.1  # times the remainder has a fixed point there: a proof does not find those that barely exist
SEARCHED, SUMMED = 3000, 20_000  # lags in a search, and at the end
UNSTABLE = 1e9
ROOM = 0.95  # of an input may be used without a price: rigorous bounds are a little wider
FREE = 0.05  # what an input that nothing limits counts, beside the widths
SLOW = 0.03  # what lags count: twice as many must make the tube 2 % smaller
LATER = 1.0  # what the long run counts beside the tube for ever, where the start makes them differ
WISH = 0.9  # of a half-width that is wished is aimed at
UNASKED = 2.0  # times its first half-width is what a state may have for another one's wish


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Tables with zeta = (e, eta, v) observed; W (n,) and U (m,) as floats find them; `evaluations` of the search."""

    tables: Tables
    W: Array
    U: Array
    evaluations: int


def design(plant: Plant, report: Callable[[int, float], None] | None = None) -> Design:
    """The tables with the smallest tube that the search has found; `report` is told evaluations and the best value.

    Raises `NoDesign` where a mode cannot be moved or held, or where the best loop found needs more input than there
    is, or has no tube.
    """
    unfound.refuse_inputs(plant, np.full_like(plant.room, 1e-300))
    with np.errstate(all="ignore"):
        units = units_of(plant)
    if not np.isfinite(np.concatenate(units)).all():  # too much happens within a sample
        raise NoDesign("no_design")
    observer = observe(in_units(plant, units))
    unfound.refuse_unmoved(observer.plant.A, observer.plant.B)
    unfound.refuse_unheld(plant)
    search = _Search(observer, report or (lambda evaluations, value: None))
    weights = search.run(search.within())
    if search.refer(weights):
        weights = search.run(weights)
        if not search.meets_wishes(weights):
            weights = min(weights, search.run(search.within()), key=search.value)
        if np.isfinite(plant.wishes).any() and search.meets_wishes(weights):
            weights = search.narrowed(weights)
    if (found := observer.table(weights)) is None:
        raise NoDesign("no_design")
    (n, m), theta = plant.B.shape, rounded(observer, found, units)
    tables = Tables(theta[m:, n:], theta[m:, :n], theta[:m, n:], theta[:m, :n])
    return Design(tables, *_tube(plant, theta), evaluations=search.evaluations)


def _tube(plant: Plant, theta: Array) -> tuple[Array, Array]:
    """W, U of rounded tables by the fixed point, followed to its end; or `NoDesign`.

    A tube that falls after a start has a smaller remainder than one of its first size: with a start, none is refused.
    """
    n, m = plant.B.shape
    if (response := respond(plant, sample_of(plant), theta, SUMMED)) is None:
        raise NoDesign("no_design")
    alone = sizes(plant, response.ever + response.gain @ rest_at(plant, np.zeros(n + m)))
    unfound.refuse_inputs(plant, alone[n:])
    size, settled = settle(plant, response.gain, response.ever, 400)
    if not plant.start.any():
        if not settled:
            worst = int(np.argmax(size[:n] / alone[:n]))
            raise NoDesign("no_fixed_point", worst, float(size[worst]), float(alone[worst]))
        unfound.refuse_inputs(plant, size[n:])
    return np.maximum(size[:n], plant.start), size[n:]


class _Search:
    """Hooke and Jeeves on the weights of one observer: first without, then with what grows with the tube."""

    def __init__(self, observer: Observer, report: Callable[[int, float], None]) -> None:
        self.observer, self.report = observer, report
        self.plant = plant = observer.plant
        self.evaluations = 0
        self.n = len(plant.A)
        self.constant = rest_at(plant, np.zeros(sum(plant.B.shape)))
        self.counts = np.array([1.0, LATER if plant.start.any() or plant.eta_start.any() else 0.0]) / self.n
        self.reference: Array | None = None
        self.most = np.full((0, self.n), np.inf)  # of W for ever, once wishes are met
        sorts, many = np.repeat(range(6), observer.sizes()), np.repeat(observer.sizes(), observer.sizes())
        self.groups = np.array([1.0 * (sorts == sort) for sort in (1, 2, 3, 4)])
        self.singles = np.eye(len(sorts))[(many > 1) | (sorts == 0) | (sorts == 5)]

    def _reach(self, weights: Array, steps: int) -> tuple[Response, Array, Array] | None:
        """The response, W for ever and in the long run (2, n), and U; without `steps`, no remainder grows.

        A tube falls after a start: for ever it has half the remainder of its beginning, half that of its long run.
        """
        self.evaluations += 1
        theta, plant = self.observer.table(weights), self.plant
        if theta is None or not (response := respond(plant, self.observer.sample, theta, SEARCHED)):
            return None
        gain, added = (
            (SPARE * response.gain, 0.0) if steps else (0.0 * response.gain, response.gain @ self.constant)
        )
        late = settle(plant, gain, response.long_run + added, steps)[0]
        rest = rest_at(plant, late)
        first = sizes(plant, response.ever + added + gain @ rest)
        ever = sizes(plant, response.ever + added + gain @ (0.5 * rest + 0.5 * rest_at(plant, first)))
        return response, np.array([ever, late])[:, : self.n], ever[self.n :]

    def value(self, weights: Array) -> float:
        """What the search makes small.

        The geometric mean of the widths or, with a reference, their 8-norm relative to it; larger where inputs or the
        tube leave their room, or inputs cost nothing, and for loops that forget slowly.
        """
        steps = STEPS if self.reference is not None or len(self.most) else 0
        if (reached := self._reach(weights, steps)) is None:
            return UNSTABLE
        response, W, U = reached
        if self.reference is None:
            value = np.exp(self.counts @ np.log(np.maximum(W, 1e-30)).sum(axis=1))
        else:
            value = (self.counts @ ((W / self.reference) ** 8).sum(axis=1)) ** (1 / 8)
        parts = U / self.plant.room, W[0] / self.plant.space, (W[0] / self.most).ravel()
        over = np.maximum(0.0, np.concatenate(parts) - ROOM)
        free = np.where(np.isinf(self.plant.room), U, 1.0)
        return float(value * (1 + 5 * over + 50 * over**2).prod() * free.prod() ** FREE * response.lags**SLOW)

    def within(self) -> Array:
        """First weights: inputs grow dear, and eta slow, until no input leaves its room."""
        weights = np.zeros(self.groups.shape[1])
        for _ in range(8):
            reached = self._reach(weights, 0)
            if reached and (reached[2] <= self.plant.room).all():
                break
            weights = weights + np.log(10) * np.array([1, 1, -1, 0]) @ self.groups
        return weights

    def refer(self, weights: Array) -> bool:
        """Take these weights' widths, or wishes, as the reference; whether that makes any difference."""
        alone, grown = self._reach(weights, 0), self._reach(weights, STEPS)
        if alone is None or grown is None:
            return False
        wished = np.isfinite(self.plant.wishes)
        grows = any((more > (1 + 1e-4) * less).any() for less, more in zip(alone[1:], grown[1:], strict=True))
        self.reference = np.minimum(grown[1], 1e3 * alone[1]) * (UNASKED if wished.any() else 1.0)
        self.reference[:, wished] = WISH * self.plant.wishes[wished]
        return bool(wished.any() or grows)

    def meets_wishes(self, weights: Array) -> bool:
        """Whether the tube of these weights is as narrow as wished, and not wider than the safe set."""
        reached = self._reach(weights, STEPS)
        return reached is not None and bool(
            (reached[1] <= np.minimum(self.plant.wishes, self.plant.space)).all()
        )

    def narrowed(self, weights: Array) -> Array:
        """From weights that meet the wishes on to narrower tubes that meet them as well."""
        self.reference, self.most = None, self.plant.wishes[None]
        return self.run(weights, FINE[1:2])

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
        while move.any() and (value := self.value(weights + move)) < best * (1 - GAIN):
            weights, best = weights + move, value
            self.report(self.evaluations, best)
        return weights, best
