"""A specification and what was proven of its sampled loop, as the floats that a simulation needs. Trusted: no."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import symbol
from tubecert.expression.matrix import column, combine, multiply
from tubecert.model import TIME, build
from tubecert.sampled_loop.record import Result, Tables
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.setting import Loop, Size
from tubecert.simulation.kernels import Nominal
from tubecert.spec import Knots, Spec
from tubecert.trajectory.make import plan_of

_MEMORIES: Final = 2  # of the loop, that a run lasts where the claim is for ever
_SAMPLES: Final = (50, 20_000)  # of such a run, at least and at most


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Band:
    """Slow signals: |.| <= `size` (r,), |.'| <= `rate` (r,), and |.| <= `first` (r,) at the start.

    Those of h act beside the inputs `matched`, the others are the wind.
    """

    size: Array
    rate: Array
    first: Array
    matched: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting:
    """All of a simulation that its runs share: n states, m inputs, k columns of the wind, p parameters.

    Runs have `samples` K, of P parts each. `plant` gives x' of states, parameters, u + h, wind; `own` is the
    specification's h of states and t; `ranges` (p, 2). From sample `stages[g]` on, |x - x*| and |u - u*| are at most
    `bounds[g]` (G, n + m).
    """

    loop: Loop
    result: Result
    tables: Tables
    samples: int
    nominal: Nominal
    plant: Tape
    own: Tape | None
    ranges: Array
    stages: Array
    bounds: Array
    band: Band

    @property
    def spec(self) -> Spec:
        """The specification."""
        return self.loop.spec

    @property
    def names(self) -> tuple[str, ...]:
        """States, then inputs."""
        return *self.spec.states, *self.spec.inputs

    @property
    def Ts(self) -> float:
        """The sample time in s."""
        return float(self.loop.sample_time)

    @property
    def gusts(self) -> Size:
        """The wind that may jump, (k,)."""
        own = self.loop.gusts
        return Size(0 * own.each, length=False) if self.loop.sways else own

    def at(self, sample: int) -> Array:
        """The bounds (n + m, 1) of a sample."""
        return np.asarray(self.bounds[np.searchsorted(self.stages, sample, side="right") - 1][:, None])


def setting_of(spec: Spec, result: Result, duration: Fraction | None = None) -> Setting:
    """The setting of a result that has a tube; runs last `duration` s, or as long as the claim."""
    if result.nominal is None or result.controller is None:
        raise ValueError("there is no loop without tables")
    model, own = build(spec), result.planned
    matrices = {name: getattr(result.nominal, name).value for name in "ABE"}
    knots = None if own is None else Knots(t=own.t, x=own.x, u=own.u, interpolation=own.interpolation)
    slow = result.recipe is None or result.recipe.parameters == "slow"
    loop = Loop(spec=spec, model=model, plan=plan_of(spec, model, knots), knots=own, slow=slow, **matrices)
    arrays = {name: getattr(result.controller, name).value for name in "FGMN"}
    nodes = _nodes(loop)
    acts = nodes.index(loop.rest)
    widths = [[own.half_widths[x] for x in spec.states] for own in result.tube]
    deviations = [[own.deviations[u] for u in spec.inputs] for own in result.tube]
    bounds = np.hstack([np.array(widths, dtype=float), np.array(deviations, dtype=float)])
    return Setting(
        loop=loop,
        result=result,
        tables=result.controller,
        samples=_samples(loop, result, duration),
        nominal=Nominal(
            **matrices, **arrays, nodes=np.array(nodes, dtype=float), acts=acts, whole=loop.whole
        ),
        plant=_plant(loop),
        own=None if model.h is None else Tape(model.h, (*spec.states, TIME)),
        ranges=np.array([ends for _, ends in spec.ranges], dtype=float).reshape(-1, 2),
        stages=np.array([stage.start for stage in result.tube]),
        bounds=bounds,
        band=_band(loop, result, bounds[:, : loop.states].max(axis=0)),
    )


def _nodes(loop: Loop) -> list[Fraction]:
    """The ends of the parts of a sample: where an input takes over, and halves of what is long."""
    ends = sorted({Fraction(0), loop.rest, loop.sample_time})
    halves = {(a + b) / 2 for a, b in pairwise(ends) if b - a > loop.sample_time / 2}
    return sorted({*ends, *halves})


def _samples(loop: Loop, result: Result, duration: Fraction | None) -> int:
    Ts, horizon = loop.sample_time, result.claim.horizon
    asked = duration or (loop.spec.simulation and loop.spec.simulation.duration)
    if horizon is not None:
        return ceil(min(asked or horizon, horizon) / Ts)
    if asked:
        return ceil(asked / Ts)
    memory = _MEMORIES * result.recipe.lags if result.recipe else 0
    return min(_SAMPLES[1], max(_SAMPLES[0], ceil((loop.plan.horizon or 0) / Ts), memory))


def _plant(loop: Loop) -> Tape:
    """x' of states, parameters, u + h (m), w (k)."""
    model, k = loop.model, loop.E.shape[1]
    inputs, gusts = [f"u#{j}" for j in range(loop.inputs)], [f"w#{j}" for j in range(k)]
    slope = combine(
        1, column(loop.drift), 1, multiply(loop.gained, column([symbol(name) for name in inputs]))
    )
    if k:
        slope = combine(1, slope, 1, multiply(model.E, column([symbol(name) for name in gusts])))
    names = (*model.states, *(name for name, _ in model.parameters), *inputs, *gusts)
    return Tape([row[0] for row in slope], names)


def _band(loop: Loop, result: Result, widest: Array) -> Band:
    """h and the wind where their rates are known: as the theorem bounds them on the tube; a sudden h has no rate."""
    found = Remainders(loop, result.recipe.windows if result.recipe else 1).sizes(widest)
    count = len(found.size) - (len(loop.unknown) if loop.slow else 0)
    parts = [part[:count] for part in (found.size, found.rate, found.first)]
    if loop.jumps and loop.matched:
        most = loop.sudden[-1][1]
        size = most.each / np.sqrt(len(most.each) if most.length else 1)
        parts = [np.append(own, part) for own, part in zip((size, size * np.inf, size), parts, strict=True)]
    return Band(size=parts[0], rate=parts[1], first=parts[2], matched=loop.matched)
