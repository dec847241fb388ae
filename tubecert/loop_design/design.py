"""The search for the weights whose tables keep the tube small, and the tables.

In: a plant. Out: a `Design`. A pattern search on the logarithms of all weights, first for the geometric mean of the
widths without remainders, which needs no reference, then for the largest of the fixed point's widths with them,
relative to the first or to what is wished. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.loop_design.observer import Observer, in_units, observe, rounded, units_of
from tubecert.loop_design.plant import Plant
from tubecert.loop_design.unfound import NoDesign, refuse_hopeless
from tubecert.loop_design.widths import Response, Table, respond, settle, step_of

__all__ = ["Design", "design"]

COARSE = (10.0, 3.0)  # factors on groups of weights
FINE = (3.0, 1.7, 1.7, 1.3)  # on groups and on single weights
GAIN = 1e-3  # what a step must gain
STEPS = 8  # of the fixed point in a search
SEARCHED = 3000  # lags in a search
SUMMED = 20_000  # lags at the end
UNSTABLE = 1e9
FREE = 0.05  # what an input that nothing limits counts, beside the widths
SLOW = 0.03  # what lags count: twice as many must make the tube 2 % smaller
LATER = 0.1  # what the long run counts beside the tube for ever, where the start makes them differ


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """Tables F (z, z), G (z, n), M (m, z), N (m, n) of numbers of single precision, zeta = (e, eta, v) observed.

    W (n,), U (m,): the tube that floats find with them, start included. `evaluations` of the search.
    """

    F: Array
    G: Array
    M: Array
    N: Array
    W: Array
    U: Array
    evaluations: int


def design(plant: Plant, report: Callable[[int, float], None] | None = None) -> Design:
    """The tables with the smallest tube that the search has found; `report` is told evaluations and their best.

    Raises `NoDesign` where a mode cannot be moved or held, or where the best loop found needs more input than there
    is, or has no tube.
    """
    units = units_of(plant)
    observer = observe(in_units(plant, units))
    refuse_hopeless(observer.plant)
    aim = _Aim(observer, report)
    weights = aim.search(aim.linear, aim.within())
    if aim.refer(weights):
        weights = aim.search(aim.settled, weights)
    if (table := observer.table(weights)) is None:
        raise NoDesign("no_design")
    table = rounded(observer, table, units)
    W, U = _tube(plant, table)
    return Design(F=table.F, G=table.G, M=table.M, N=table.N, W=W, U=U, evaluations=aim.evaluations)


class _Aim:
    """What a search makes small, of one observer, and how often it was asked."""

    def __init__(self, observer: Observer, report: Callable[[int, float], None] | None) -> None:
        self.observer = observer
        self.plant = observer.plant
        self.started = bool(self.plant.start.any() or self.plant.eta_start.any())
        self.counts = np.repeat([1.0, LATER] if self.started else [1.0], len(self.plant.A)) / len(
            self.plant.A
        )
        self.report = report
        self.evaluations = 0
        self.constant = _at(self.plant, np.zeros(len(self.plant.A)), np.zeros(len(self.plant.room)))
        self.sizes = np.ones(1)
        self.inputs = np.ones(1)

    def response(self, weights: Array) -> Response | None:
        """What the loop of these weights does, of which no search sees more lags than `SEARCHED`."""
        self.evaluations += 1
        table = self.observer.table(weights)
        return None if table is None else respond(self.plant, self.observer.step, table, SEARCHED)

    def rows(self, response: Response) -> list[Array]:
        """Bounds of all outputs without what grows with the tube: of the tube for ever, and in the long run."""
        rows = [response.ever, response.long_run] if self.started else [response.ever]
        return [each + response.gain @ self.constant for each in rows]

    def linear(self, weights: Array) -> float:
        """The geometric mean of the widths without remainders, made larger where inputs are too small."""
        if (response := self.response(weights)) is None:
            return UNSTABLE
        W, U = self._split(response, self.rows(response))
        return float(np.exp(np.log(np.maximum(W, 1e-30)) @ self.counts)) * self._dear(response, U, 1.0)

    def settled(self, weights: Array) -> float:
        """The 8-norm of the fixed point's widths, relative to those of the first search or to what is wished."""
        if (response := self.response(weights)) is None:
            return UNSTABLE
        found = [settle(self.plant, response, rows, STEPS) for rows in self.rows(response)]
        W, U = np.concatenate([W for W, _, _ in found]), found[0][1]
        return float(((W / self.sizes) ** 8 @ self.counts) ** (1 / 8)) * self._dear(response, U, self.inputs)

    def refer(self, weights: Array) -> bool:
        """Measure what `settled` compares with; whether it differs from `linear` at all."""
        if (response := self.response(weights)) is None:
            return False
        rows = self.rows(response)
        W, self.inputs = self._split(response, rows)
        n = len(self.plant.A)
        wished = np.concatenate([self.plant.wishes, np.full(len(W) - n, np.inf)])
        self.sizes = np.where(np.isfinite(wished), 0.9 * wished, 2 * W) if np.isfinite(wished).any() else W
        grown = response.gain @ (_at(self.plant, W[:n], self.inputs) - self.constant)
        return bool(np.isfinite(wished).any() or (grown > 1e-4 * rows[0]).any())

    def _split(self, response: Response, rows: list[Array]) -> tuple[Array, Array]:
        found = [response.split(each, len(self.plant.A)) for each in rows]
        return np.concatenate([W for W, _ in found]), found[0][1]

    def _dear(self, response: Response, U: Array, usual: Array | float) -> float:
        """A factor: inputs near and beyond their room, inputs that nothing limits, and loops that forget slowly."""
        over = np.maximum(0.0, U / self.plant.room - 0.98)
        free = ~np.isfinite(self.plant.room)
        factor = 1 + float((5 * over + 50 * over**2).sum())
        factor *= float(np.prod(np.where(free, U / usual, 1.0) ** FREE))
        return factor * max(response.lags, 20.0) ** SLOW

    def within(self) -> Array:
        """First weights: inputs grow dear, and eta slow, until no input leaves its room."""
        weights = np.zeros(sum(self.observer.sizes()))
        calmer = np.array([1, 1, -1, 0]) @ self._groups()
        for _ in range(8):
            response = self.response(weights)
            if (
                response is not None
                and (response.split(response.ever, len(self.plant.A))[1] <= self.plant.room).all()
            ):
                break
            weights = weights + np.log(10) * calmer
        return weights

    def _groups(self) -> Array:
        """Directions of the search: all weights of inputs, of their changes, of eta, of shocks."""
        sort = np.repeat(np.arange(6), self.observer.sizes())
        return np.array([(sort == i).astype(float) for i in (1, 2, 3, 4)])

    def _singles(self) -> Array:
        sizes = np.repeat(self.observer.sizes(), self.observer.sizes())
        sort = np.repeat(np.arange(6), self.observer.sizes())
        return np.eye(len(sort))[(sizes > 1) | (sort == 0) | (sort == 5)]

    def search(self, aim: Callable[[Array], float], weights: Array) -> Array:
        """Hooke and Jeeves: along every direction while it gains, then along the whole sweep once more."""
        groups = [d for d in self._groups() if d.any()]
        sweeps = [(factor, groups) for factor in COARSE] + [
            (factor, [*groups, *self._singles()]) for factor in FINE
        ]
        best = aim(weights)
        for factor, directions in sweeps:
            origin = weights
            for direction in directions:
                for move in (np.log(factor) * direction, -np.log(factor) * direction):
                    weights, best, moved = self._along(aim, weights, best, move)
                    if moved:
                        break
            if (weights != origin).any():
                weights, best, _ = self._along(aim, weights, best, weights - origin)
        return weights

    def _along(
        self, aim: Callable[[Array], float], weights: Array, best: float, move: Array
    ) -> tuple[Array, float, bool]:
        moved = False
        while (value := aim(weights + move)) < best * (1 - GAIN):
            weights, best, moved = weights + move, value, True
            if self.report:
                self.report(self.evaluations, best)
        return weights, best, moved


def _at(plant: Plant, W: Array, U: Array) -> Array:
    return np.minimum(np.nan_to_num(plant.remainder(W, U), nan=np.inf, posinf=np.inf), 1e300)


def _tube(plant: Plant, table: Table) -> tuple[Array, Array]:
    """W, U of rounded tables by the fixed point, followed to its end; or `NoDesign`."""
    n = len(plant.A)
    response = respond(plant, step_of(plant), table, SUMMED)
    if response is None:
        raise NoDesign("no_design")
    rows = response.ever + response.gain @ _at(plant, np.zeros(n), np.zeros(len(plant.room)))
    _refuse_inputs(plant, response.split(rows, n)[1])
    W, U, settled = settle(plant, response, rows, 400)
    if not settled:
        alone = response.split(rows, n)[0]
        worst = int(np.argmax(W / alone))
        raise NoDesign("no_fixed_point", worst, float(W[worst]), float(alone[worst]))
    _refuse_inputs(plant, U)
    return np.maximum(W, plant.start), U


def _refuse_inputs(plant: Plant, U: Array) -> None:
    worst = int(np.argmax(U / plant.room))
    if U[worst] > plant.room[worst]:
        raise NoDesign("inputs", worst, float(U[worst]), float(plant.room[worst]))
