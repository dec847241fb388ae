"""Batches of lanes, one after the other, by the compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tubecert.enclosure.interval import Array
from tubecert.simulate import integrator
from tubecert.simulate.problem import Disturbance, LoopProblem
from tubecert.simulate.runs import Runs

_FIT = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Lanes of one problem: starts `x0` (N, n) and a disturbance of N lanes."""

    problem: LoopProblem
    x0: Array
    disturbance: Disturbance


def integrate(batches: Sequence[Batch], *, tolerance: float, level: int | None = None) -> tuple[Runs, ...]:
    """The runs of every batch, to an error of about `tolerance`; of proposals, at a `level`, ten times of it."""
    asked = tolerance if level is None else _FIT * tolerance
    return tuple(
        integrator.integrate(each.problem, each.x0, each.disturbance, tolerance=asked) for each in batches
    )
