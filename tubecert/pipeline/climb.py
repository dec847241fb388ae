"""Rates for a metric, from slow to fast, by what a certification with each of them comes to.

A slow metric leaves the uncertainty much room (the distance grows as 1/rate), a fast one is ill-conditioned: its tube
overshoots, its feedback is strong. So certifiable rates form an interval as a rule. The climb doubles the rate from a
slow scale of the system until nothing is gained any more, and then halves the steps (geometrically) around the best.
Untrusted: it chooses among metrics that are proven.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import inf, log2, sqrt

import numpy as np

from tubecert.certificate.result import RateLimit, RateLimits
from tubecert.claims.statements import TubeInSafeSet, TubeRadius
from tubecert.enclosure.constant import round_down
from tubecert.enclosure.tape import Tape
from tubecert.model import ControlAffineModel
from tubecert.pipeline.listening import Cut
from tubecert.pipeline.synthesised import Row
from tubecert.spec import Spec
from tubecert.synthesis.problem import FLOORS, Floor

_DOUBLINGS, _HALVINGS = 12, 10
_WORSE = 2  # rates in a row that are worse than the best end the climb
_BY_PLAN = 2  # rates that fail by the plan end it,
_NO_LESS = 0.75  # unless the second misses by less than this share of the first (twice the rate may halve it)
_BEYOND = 8.0  # and by no more than this many tubes
_ROUNDS = 2  # of refinement: factors of sqrt(2), then of its root
_BELOW = 4  # the climb starts so far below the slowest mode
_LONGER = 1.1  # times the gain is what a metric of a lower degree may ask for
_ROUNDER = 0.95  # of the condition number
_UP = 1 + 1e-9  # so that rounding down starts from what the last digits of a mode do not change
_UNUSUAL = 64  # such a slow scale, or its inverse, is one of another unit of time
_NOTHING = 1e-3  # a mode is 0 below this share of the fastest motion

Compare = Callable[[Fraction, Floor, bool], Row | None]


@dataclass(slots=True)
class Climb:
    """What was tried: the best row of each rate, None where there is no metric.

    `compare` certifies a metric of a rate and a floor; at a degree that is raised as long as it pays only if `full`,
    and not beyond `degree` otherwise. `enough`: a tube that needs no adaptation is.
    """

    compare: Compare
    objective: str
    enough: bool = False
    tried: dict[Fraction, Row | None] = field(default_factory=dict)

    @property
    def best(self) -> Row | None:
        """The best row that counts; one that needs no adaptation where that is enough."""
        rows = [row for row in self.tried.values() if row is not None and row.counts]
        alone = [row for row in rows if row.alone] if self.enough else []
        return min(alone or rows, key=self._score, default=None)

    @property
    def degree(self) -> int | None:
        """The degree that sufficed so far, None if nothing did: higher ones are dear, and are left to the best rate."""
        degrees = [row.degree for row in self.tried.values() if row is not None and row.counts]
        return max(degrees, default=None)

    def run(self, start: Fraction) -> None:
        """The whole search."""
        self._up(start)
        best = self.best
        if not self.ended and (best is None or best.rate == start):
            self._down(start)
        if self.ended:
            return
        for _ in range(_ROUNDS):
            if (best := self.best) is not None:
                for rate in self._around(best.rate):
                    self._try(rate, best.floor)
        if (best := self.best) is not None:
            self._try(best.rate, best.floor, full=True)
        if (best := self.best) is not None:
            self._try(best.rate, "input")
        if (best := self.best) is not None and best.floor == "input":
            for rate in self._around(best.rate):
                self._try(rate, best.floor)

    def at(self, rate: Fraction) -> None:
        """The metrics of one rate."""
        for floor in FLOORS:
            if not self.ended:
                self._try(rate, floor, full=True)

    @property
    def ended(self) -> Cut | None:
        """Why nothing more is to be found, if that is so."""
        rows = [row for row in self.tried.values() if row is not None]
        if self.enough and any(row.counts and row.alone for row in rows):
            return "no_adaptation"
        if self.best is not None or len(rows) < _BY_PLAN:
            return None
        before, last = rows[-_BY_PLAN:]
        hopeless = before.missed and last.missed >= min(_NO_LESS * before.missed, _BEYOND)
        return "plan" if hopeless else None

    def limits(self) -> RateLimits | None:
        """What is against a slower and against a faster rate than the best; told where gains are what decides."""
        best = self.best
        if best is None or best.adaptation_rate is None or self.objective == "tube" or self.ended:
            return None
        slower = max((rate for rate in self.tried if rate < best.rate), default=None)
        faster = min((rate for rate in self.tried if rate > best.rate), default=None)
        end = RateLimit(rate=best.rate, cause="idle") if best.idle and slower is not None else None
        return RateLimits(
            slower=None if slower is None else self._limit(slower, best),
            faster=end if faster is None else self._limit(faster, best),
        )

    # -- steps ---------------------------------------------------------------------------------------------------

    def _up(self, start: Fraction) -> None:
        rate, worse, overshoots = start, 0, 0
        for _ in range(_DOUBLINGS):
            before = self.best
            row = self._try(rate)
            if row is None or (before is not None and not row.counts) or self.ended:
                return
            if row.counts:
                worse = 0 if self.best is row else worse + 1
                if worse == _WORSE or row.idle:
                    return
            elif _overshoots(row):
                overshoots += 1
                if overshoots == _WORSE:
                    return
            rate *= 4 if row.far else 2

    def _down(self, start: Fraction) -> None:
        above = self.tried.get(start)
        for k in range(1, _HALVINGS + 1):
            before = self.best
            row = self._try(round_down(start / 2**k, 3))
            if self.ended or (before is not None and self.best is before):
                return
            if row is not None and not row.counts and not (_overshoots(row) and _rounder(row, above)):
                return
            above = row

    def _try(self, rate: Fraction, floor: Floor = "identity", *, full: bool = False) -> Row | None:
        row = self.compare(rate, floor, full)
        known = self.tried.get(rate)
        if known is None or (row is not None and self._better(row, known)):
            self.tried[rate] = row
        return row

    def _better(self, row: Row, known: Row) -> bool:
        """Whether a metric takes the place of another; one of a higher degree is longer, and has to be worth it.

        Where one of least input gain leaves the filter idle it is the feedback that does its work, in a tube that is
        many times wider in the states that no half-width is asked of.
        """
        if row.floor == "input" and row.idle and known.counts and self.objective != "tube":
            return False
        if row.demand is not None and row.degree > known.degree:
            row = replace(row, demand=_LONGER * row.demand)
        return self._score(row) < self._score(known)

    def _around(self, best: Fraction) -> list[Fraction]:
        """Rates halfway, in their logarithms, to the neighbours that were tried."""
        slower = max((rate for rate in self.tried if rate < best), default=None)
        faster = min((rate for rate in self.tried if rate > best), default=None)
        return [round_down(sqrt(best * other), 3) for other in (slower, faster) if other is not None]

    def _score(self, row: Row) -> tuple[float, ...]:
        return row.score(self.objective)

    def _limit(self, rate: Fraction, best: Row) -> RateLimit:
        row = self.tried[rate]
        if row is None:
            return RateLimit(rate=rate, cause="no_metric")
        if not row.counts:
            return RateLimit(rate=rate, cause="overshoot" if _overshoots(row) else "gains")
        factor = row.demand / best.demand if row.demand and best.demand else None
        longer = max(float(best.rate / rate), 1.0)  # a distance grows as 1/rate
        grown = (row.input_gain or 0) * (best.rho or 0) * longer > (best.input_gain or inf) * (row.rho or inf)
        if not grown:
            return RateLimit(rate=rate, cause="tube", factor=factor)
        return RateLimit(rate=rate, cause="distance" if longer > 1 else "input_gain", factor=factor)


def slow_scale(model: ControlAffineModel, spec: Spec) -> Fraction:
    """A rate below those that matter, in 1/s: a fourth of the slowest mode at the centre of the safe set.

    Where the linearisation has no mode but 0 (chains of integrators), the speed at which it moves the half-widths of
    the set stands in. No rate is useful that is below 1/horizon. Free of units, but for the unit of time.
    """
    centre = np.array([float((low + high) / 2) for low, high in spec.safe_set])
    half = np.array([float((high - low) / 2) for low, high in spec.safe_set])
    n = len(centre)
    with np.errstate(all="ignore"):
        slopes = Tape([e for row in model.f_x for e in row], model.states).run_floats(
            list(centre[:, None]), (1,)
        )
    A = np.asarray(slopes, dtype=float).reshape(n, n) * half[None, :] / half[:, None]
    scale = _slowest(A) / _BELOW
    if spec.trajectory.horizon is not None:
        scale = max(scale, 1 / float(spec.trajectory.horizon))
    return round_down(Fraction(scale * _UP), 2)


def pace(slow: Fraction) -> Fraction:
    """Where a search for the largest rate begins, in 1/s: at 1, but for systems of quite another scale of time."""
    usual = 1 / _UNUSUAL <= slow <= _UNUSUAL
    return Fraction(1) if usual else Fraction(4) ** round(log2(slow) / 2)


def _slowest(A: np.ndarray) -> float:
    """The least modulus of a mode that is not 0, else the norm, else 1."""
    if not np.isfinite(A).all():
        return 1.0
    norm = float(np.linalg.norm(A, 2))
    modes = np.abs(np.linalg.eigvals(A))
    moving = modes[modes > _NOTHING * norm]
    return float(moving.min()) if len(moving) else norm or 1.0


def _rounder(row: Row, above: Row | None) -> bool:
    """Whether a slower rate made the metric rounder, so that a still slower one may overshoot less."""
    return above is None or row.condition_number < _ROUNDER * above.condition_number


def _overshoots(row: Row) -> bool:
    """Whether the certification ended at the size of the tube."""
    return isinstance(row.claim, TubeInSafeSet | TubeRadius)
