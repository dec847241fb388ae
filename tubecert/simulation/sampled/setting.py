"""A specification and what was proven of its sampled loop, as the floats that a simulation needs. Trusted: no."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import symbol
from tubecert.expression.matrix import column, combine, multiply
from tubecert.model import TIME, build
from tubecert.sampled_loop.record import Result, Tables
from tubecert.sampled_loop.remainders import Remainders, Sizes
from tubecert.sampled_loop.setting import Loop, Size
from tubecert.spec import Knots, Spec
from tubecert.trajectory.make import plan_of

_MEMORIES: Final = 2  # of the loop, that a run lasts where the claim is for ever
_SAMPLES: Final = (50, 20_000)  # of such a run, at least and at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """All of a simulation that its runs share: n states, m inputs, k columns of the wind, p parameters.

    Runs have `samples` K, of the parts between `nodes`, at one of which inputs change, `rest`. `plant` gives x' of
    states, parameters, u + h, wind; `own` is the specification's h of states and t; `ranges` (p, 2). `slow` signals (r)
    enter u and wind by `spread` (m + k, r). From sample `stages[g]` on, |x - x*| and |u - u*| are at most `bounds[g]`.
    """

    loop: Loop
    result: Result
    tables: Tables
    samples: int
    nodes: tuple[Fraction, ...]
    plant: Tape
    own: Tape | None
    ranges: Array
    slow: Sizes
    spread: Array
    stages: Array
    bounds: Array

    @property
    def spec(self) -> Spec:
        """The specification."""
        return self.loop.spec

    @property
    def names(self) -> tuple[str, ...]:
        """States, then inputs."""
        return *self.spec.states, *self.spec.inputs

    @cached_property
    def Ts(self) -> float:
        """The sample time in s."""
        return float(self.loop.sample_time)

    @cached_property
    def lengths(self) -> Array:
        """Of the parts of a sample, in s."""
        return np.diff(np.array(self.nodes, dtype=float))

    @cached_property
    def acts(self) -> int:
        """The part with which the input changes."""
        return self.nodes.index(self.loop.rest)

    @cached_property
    def gusts(self) -> Size:
        """The wind that may jump, (k,)."""
        own = self.loop.gusts
        return Size(0 * own.each, length=False) if self.loop.sways else own

    def at(self, sample: int | NDArray[np.int64]) -> Array:
        """The bounds (n + m,) of a sample, or (n + m, ..) of several."""
        return np.asarray(self.bounds[np.searchsorted(self.stages, sample, side="right") - 1].T)


def setting_of(spec: Spec, result: Result, duration: Fraction | None = None) -> Setting:
    """The setting of a result that has a tube; runs last `duration` s, or as long as the claim."""
    if result.nominal is None or result.controller is None:
        raise ValueError("there is no loop without tables")
    model, plan = build(spec), result.planned
    knots = None if plan is None else Knots(t=plan.t, x=plan.x, u=plan.u, interpolation=plan.interpolation)
    loop = Loop(
        spec=spec,
        model=model,
        plan=plan_of(spec, model, knots),
        knots=plan,
        slow=result.recipe is None or result.recipe.parameters == "slow",
        **{name: getattr(result.nominal, name) for name in "ABE"},
    )
    tube = [{**stage.half_widths, **stage.deviations} for stage in result.tube]
    bounds = np.array([[own[name] for name in (*spec.states, *spec.inputs)] for own in tube], dtype=float)
    return Setting(
        loop=loop,
        result=result,
        tables=result.controller,
        samples=_samples(loop, result, duration),
        nodes=_nodes(loop),
        plant=_plant(loop),
        own=None if model.h is None else Tape(model.h, (*spec.states, TIME)),
        ranges=np.array([ends for _, ends in spec.ranges], dtype=float).reshape(-1, 2),
        slow=_slow(loop, result, bounds[:, : loop.states].max(axis=0)),
        spread=np.eye(loop.inputs + loop.E.shape[1])[:, _entered(loop)],
        stages=np.array([stage.start for stage in result.tube]),
        bounds=bounds,
    )


def _nodes(loop: Loop) -> tuple[Fraction, ...]:
    """The ends of the parts of a sample: where an input takes over, and halves of what is long."""
    ends = sorted({Fraction(0), loop.rest, loop.sample_time})
    halves = {(a + b) / 2 for a, b in pairwise(ends) if b - a > loop.sample_time / 2}
    return tuple(sorted({*ends, *halves}))


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
    pushes = [f"{kind}#{j}" for kind, count in (("u", loop.inputs), ("w", k)) for j in range(count)]
    columns = [(*B, *E) for B, E in zip(loop.gained, model.E or [()] * loop.states, strict=True)]
    slope = combine(1, column(loop.drift), 1, multiply(columns, column([symbol(name) for name in pushes])))
    names = (*model.states, *(name for name, _ in model.parameters), *pushes)
    return Tape([row[0] for row in slope], names)


def _entered(loop: Loop) -> list[int]:
    """Which inputs, and components of the wind after these, the slow signals act beside."""
    return [*loop.matched, *(loop.inputs + np.arange(loop.E.shape[1] if loop.sways else 0)).tolist()]


def _slow(loop: Loop, result: Result, widest: Array) -> Sizes:
    """h and the wind where their rates are known: as the theorem bounds them on the tube; a sudden h has no rate."""
    found = Remainders(loop, result.recipe.windows if result.recipe else 1).sizes(widest)
    jumps = loop.jumps and loop.matched
    kept = len(_entered(loop)) - (len(loop.matched) if jumps else 0)  # behind these are parameters
    parts = [part[:kept] for part in (found.size, found.rate, found.first)]
    if jumps:
        most = loop.sudden[-1][1]
        size = most.each / np.sqrt(len(most.each) if most.length else 1)
        parts = [np.append(new, part) for part, new in zip(parts, (size, size * np.inf, size), strict=True)]
    return Sizes(*parts)
