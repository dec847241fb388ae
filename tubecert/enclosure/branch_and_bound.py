"""Suprema over a domain by vectorised branch and bound.

The result encloses the supremum: `below` is a value proven at a point proven to lie in the domain, `above` a bound
proven for every box that may meet it. Which boxes are split, and where, is heuristic; what is dropped never is.

A search that is long falls apart into parts, each a search of its own among some of the boxes that are left, with a
share of the budget: the same parts whoever searches them, so the result does not depend on how many workers there are.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.domain import Domain
from tubecert.enclosure.interval import Array
from tubecert.enclosure.objective import Estimate, Objective, Target
from tubecert.enclosure.processor import require_ieee
from tubecert.executor import Executor, WorkerError
from tubecert.progress import Phase, Progress, Step
from tubecert.verdict import Verdict

_BATCH: Final = 1024
_UNKNOWN: Final = 1e300  # an overestimate of this size tells nothing about its cause
_PROBES: Final = 64  # boxes whose corners are tried as points, per round
_ALONE: Final = 100_000  # boxes after which a supremum falls apart
_PARTS: Final = 32
_ALIKE: Final = 1e-13  # values that are no closer to each other differ, whatever rounded them
_SAME_PLACE: Final = 1e-9  # of the extent of the domain
_Boxes: TypeAlias = tuple[Array, Array, Array]  # lower corners (N, d), upper ones, and a bound (N,) for each


@dataclass(frozen=True, slots=True, kw_only=True)
class Supremum:
    """An enclosure [below, above] of a supremum, where `below` was found, and the work done."""

    below: float
    above: float
    at: dict[str, float]
    boxes: int
    reached: bool  # whether the requested gap was reached within the budget


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How hard to try.

    A relative `gap`, or an `absolute` one, suffices; a tenth of the gap is aimed at while the search is `cheap`
    (boxes); after `budget` boxes it gives up and reports the gap that it has. `workers` search the parts of a long
    supremum, if there are any: nothing that comes out depends on them.
    """

    gap: float = 0.01
    absolute: float = 1e-12
    budget: int = 2_000_000
    cheap: int = 4_000
    progress: Progress | None = None
    workers: Executor | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Whether an objective stays below a threshold everywhere: certified, refuted at a point, or undecided."""

    verdict: Verdict
    at: dict[str, float]
    value: float  # proven below at the witness when refuted, a proven bound from above otherwise
    boxes: int


def decide(objective: Objective, domain: Domain, threshold: float, effort: Effort) -> Decision:
    """Decide whether objective < threshold on the whole domain."""
    with np.errstate(all="ignore"):
        found = Search(objective, domain, effort, threshold).run()
    if found.below >= threshold:
        return Decision(verdict=Verdict.REFUTED, at=found.at, value=found.below, boxes=found.boxes)
    verdict = Verdict.CERTIFIED if found.above < threshold else Verdict.UNDECIDED
    return Decision(verdict=verdict, at=found.at, value=found.above, boxes=found.boxes)


def supremum(objective: Objective, domain: Domain, effort: Effort) -> Supremum:
    """Enclose the supremum of `objective` over `domain`.

    Raises `ValueError` if the domain turns out empty.
    """
    with np.errstate(all="ignore"):
        return Search(objective, domain, effort).run()


class Search:
    """One search: what it has found, and how much it has examined."""

    def __init__(
        self, objective: Objective, domain: Domain, effort: Effort, threshold: float | None = None
    ) -> None:
        self.objective, self.domain, self.effort = objective, domain, effort
        self.threshold = threshold
        # the domain may need more variables than the objective (a tube: time), placed after them
        self.variables = domain.variables(objective.variables)
        self.own = len(objective.variables)
        self.below, self.settled = -np.inf, -np.inf
        self.at: dict[str, float] = {}
        self.count = 0

    @property
    def target(self) -> float:
        """A bound at or below which a box need not be looked at again."""
        if self.threshold is not None:
            return float(np.nextafter(self.threshold, -np.inf))
        if not np.isfinite(self.below):
            return float(self.below)
        gap = self.effort.gap if self.count > self.effort.cheap else 0.1 * self.effort.gap
        return self.below + max(gap * abs(self.below), self.effort.absolute)

    @property
    def _asked(self) -> Target:
        """What bounds are to be: for a threshold, all that is below it is alike."""
        return Target(self.target, self.below if self.threshold is None else self.target)

    def run(self) -> Supremum:
        """The supremum.

        Raises `ValueError` if the domain turns out empty.
        """
        lo, hi = self.domain.boxes(self.variables)
        bound = np.full(len(lo), np.inf)
        self.extent = hi.max(axis=0) - lo.min(axis=0)
        self._probe(0.5 * (lo + hi))
        alone = _ALONE if self.threshold is None else None
        lo, hi, bound = self.search(lo, hi, bound, alone)
        if len(lo) and self._goes_on:
            bound = self._apart(lo, hi, bound)
        above = float(max(self.settled, bound.max(initial=-np.inf), self.below))
        if above == -np.inf:  # an objective that is not bounded settles at inf
            raise ValueError("the domain is empty")
        tolerance = max(self.effort.gap * abs(self.below), self.effort.absolute)
        return Supremum(
            below=float(self.below),
            above=above,
            at=self.at,
            boxes=self.count,
            reached=bool(above <= self.below + tolerance * (1 + 1e-9)),
        )

    def search(self, lo: Array, hi: Array, bound: Array, alone: int | None = None) -> _Boxes:
        """Split boxes until none is left, the budget is spent or so many were examined; those that are left."""
        while len(lo) and self._goes_on and (alone is None or self.count < alone):
            order = np.argsort(-bound, kind="stable")
            children, done = [], 0
            # the longer the queue, the more is taken at once: otherwise sorting would cost its square
            while done < min(len(lo), max(_BATCH, len(lo) // 4)) and self._goes_on:
                take = order[done : done + _BATCH]
                children.append(self._round(lo[take], hi[take], bound[take]))
                done += _BATCH
            rest = np.sort(order[done:])
            kept = bound[rest] > self.target
            self._settle(bound[rest][~kept])
            lo, hi, bound = (
                np.concatenate([old[rest][kept], *new])
                for old, new in zip((lo, hi, bound), zip(*children, strict=True), strict=True)
            )
            self._tell(float(bound.max(initial=-np.inf)))
        require_ieee()  # after the work: what was changed in between stays changed
        return lo, hi, bound

    def _tell(self, above: float) -> None:
        if self.effort.progress:
            told = float(max(self.settled, above))
            self.effort.progress(
                Step(phase=Phase.CERTIFICATION, count=self.count, below=self.below, above=told)
            )

    def _apart(self, lo: Array, hi: Array, bound: Array) -> Array:
        """Search the boxes in parts that know nothing of each other; bounds (P,) for what each holds.

        Every P-th box by bound is in the same part, so that the parts are alike.
        """
        order = np.argsort(-bound, kind="stable")
        taken = [order[first::_PARTS] for first in range(min(_PARTS, len(order)))]
        share = max(1, (self.effort.budget - self.count) // len(taken))
        part = _Part(
            self.objective,
            self.domain,
            replace(self.effort, budget=share, cheap=-1, progress=None, workers=None),
            self.below,
            self.extent,
        )
        left = {place: float(bound[take].max()) for place, take in enumerate(taken)}

        def ready(place: int, held: Supremum) -> None:
            self.count += held.boxes
            left[place] = held.above
            self._tell(max(left.values()))

        found = _shared(
            part, [(lo[take], hi[take], bound[take]) for take in taken], self.effort.workers, ready
        )
        for each in found:
            if _exceeds(each.below, self.below):
                self.below, self.at = each.below, each.at
        return np.array([each.above for each in found])

    @property
    def _goes_on(self) -> bool:
        refuted = self.threshold is not None and self.below >= self.threshold
        return self.count < self.effort.budget and not refuted

    def _round(self, lo: Array, hi: Array, bound: Array) -> _Boxes:
        """Bound a batch of boxes, settle those at or below the target, split the others."""
        lo, hi, alive = self.domain.contract(self.variables, lo, hi)
        lo, hi, bound = lo[alive], hi[alive], bound[alive]
        self.count += len(alive)
        if not len(lo):
            return lo, hi, bound
        self._probe(0.5 * (lo + hi)[np.argsort(-bound, kind="stable")[:_PROBES]])
        above = self.objective.upper(lo[:, : self.own], hi[:, : self.own], self._asked)
        estimate = self._widened(above, lo, hi)
        bound = np.minimum(bound, estimate.upper)
        self._probe(estimate.corner[np.argsort(-bound, kind="stable")[:_PROBES]])
        priority = self.domain.priorities(self.variables, lo, hi, estimate)
        choice = np.argmax(priority, axis=1) if priority.shape[1] else np.zeros(len(lo), dtype=np.intp)
        middle = _cuts(lo, hi, choice)
        rows = np.arange(len(lo))
        splittable = rows < 0
        if priority.shape[1]:
            inner = (lo[rows, choice] < middle) & (middle < hi[rows, choice])
            splittable = inner & (priority[rows, choice] > 0)
        done = (bound <= self.target) | ~splittable
        self._settle(bound[done])
        lo, hi, bound, middle = (x[~done] for x in (lo, hi, bound, middle))
        choice = choice[~done]
        rows = np.arange(len(lo))
        left_hi, right_lo = hi.copy(), lo.copy()
        left_hi[rows, choice], right_lo[rows, choice] = middle, middle
        return np.concatenate([lo, right_lo]), np.concatenate([left_hi, hi]), np.concatenate([bound, bound])

    def _widened(self, estimate: Estimate, lo: Array, hi: Array) -> Estimate:
        """The estimate with columns for the variables that only the domain needs."""
        extra = np.zeros((len(lo), len(self.variables) - self.own))
        middle = 0.5 * (lo + hi)[:, self.own :]
        caused = np.concatenate([estimate.caused, extra], axis=1)
        spread = np.concatenate([estimate.spread, extra], axis=1)
        # where nothing is known yet, every variable is split in turn: NaN and inf would choose one for ever
        known = np.all((caused < _UNKNOWN) & (spread < _UNKNOWN), axis=1, keepdims=True)
        share = np.where(self.extent > 0, (hi - lo) / np.where(self.extent > 0, self.extent, 1.0), 0.0)
        share[:, self.own :] = 0.0
        return Estimate(
            estimate.upper,
            np.concatenate([estimate.corner, middle], axis=1),
            np.where(known, caused, share),
            np.where(known, spread, share),
        )

    def _settle(self, bound: Array) -> None:
        self.settled = max(self.settled, float(bound.max(initial=-np.inf)))

    def _probe(self, points: Array) -> None:
        """Raise `below` by values at points proven to lie in the domain.

        Of places that are alike, as mirror images are, one is chosen by where it is: last digits differ between
        processors.
        """
        lo, hi = self.domain.inside(self.variables, points)
        if not len(lo):
            return
        values = self.objective.lower(lo[:, : self.own], hi[:, : self.own])
        values = np.where(np.isnan(values), -np.inf, values)
        places = 0.5 * (lo + hi)
        alike = np.flatnonzero(~_exceeds(values.max(), values))
        best = alike[_foremost(places[alike] / np.where(self.extent > 0, self.extent, 1.0))]
        if _exceeds(values[best], self.below):
            self.below = float(values[best])
            self.at = {v: float(x) for v, x in zip(self.variables, places[best], strict=True)}


@dataclass(frozen=True, slots=True)
class _Part:
    """A search in boxes, each with a bound, that knows the value `below`; sent to workers as it is."""

    objective: Objective
    domain: Domain
    effort: Effort
    below: float
    extent: Array

    def __call__(self, boxes: _Boxes) -> Supremum:
        """What the boxes hold."""
        with np.errstate(all="ignore"):
            search = Search(self.objective, self.domain, self.effort)
            search.below, search.extent = self.below, self.extent
            _, _, bound = search.search(*boxes)
        above = float(max(search.settled, bound.max(initial=-np.inf)))
        return Supremum(below=search.below, above=above, at=search.at, boxes=search.count, reached=False)


def _exceeds(value: float, other: Array | float) -> NDArray[np.bool_]:
    """Whether a value is larger than others by more than a rounding."""
    return np.asarray(value > other + np.where(np.isfinite(other), _ALIKE * np.abs(other), 0.0))


def _foremost(places: Array) -> int:
    """The last of places (P, d) in the order of their coordinates, the first of which counts most."""
    order = np.lexsort(np.round(places.T[::-1] / _SAME_PLACE)) if places.shape[1] else [0]
    return int(order[-1])


def _shared(
    part: _Part, items: Sequence[_Boxes], workers: Executor | None, ready: Callable[[int, Supremum], None]
) -> list[Supremum]:
    """What every part holds, in order; what is left of workers that are lost is done here."""
    found: dict[int, Supremum] = {}

    def kept(place: int, held: Supremum) -> None:
        found[place] = held
        ready(place, held)

    if workers is not None:
        with contextlib.suppress(WorkerError):
            workers.map(part, items, kept)
    for place, item in enumerate(items):
        if place not in found:
            kept(place, part(item))
    return [found[place] for place in range(len(items))]


def _cuts(lo: Array, hi: Array, choice: NDArray[np.intp]) -> Array:
    """Where to split: the middle, geometrically for ranges that span many orders of magnitude."""
    if not lo.shape[1]:
        return np.zeros(len(lo))
    rows = np.arange(len(lo))
    a, b = lo[rows, choice], hi[rows, choice]
    middle = 0.5 * a + 0.5 * b
    return np.where((a > 0) & (b > 4 * a), np.sqrt(a) * np.sqrt(b), middle)
