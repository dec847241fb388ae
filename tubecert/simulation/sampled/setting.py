"""A specification and what was proven of its sampled loop, in floats; what its runs follow. Trusted: no."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.model import TIME, build
from tubecert.sampled_loop.record import Result, Tables
from tubecert.sampled_loop.remainders import Remainders, Sizes
from tubecert.sampled_loop.setting import Loop, Size, driven
from tubecert.simulation.plans import Steering, integrated, waves
from tubecert.spec import Bundle, Spec
from tubecert.trajectory.make import plan_of

Integers = NDArray[np.int64]
_MEMORIES: Final = 2  # of the loop, that a run lasts where the claim is for ever
_SAMPLES: Final = (50, 20_000)  # of such a run, at least and at most
_OUTPUTS: Final = 250  # samples at whose start runs are compared, and drawn
_AFTER: Final = 1e-9  # of a sample time after its left end: there u* has jumped


class Setting:
    """All that runs share: n states and m inputs, whose `names` these are, k columns of the wind, p parameters.

    Runs have `samples` K of `Ts` s. A sample has P parts of `lengths` (P,) between its `nodes` in s; with part `acts`
    the input changes. Of all nodes `t` (K P + 1,) are the times in s, `outputs` (S,) the numbers of those at which runs
    are compared, `limits` (K P + 1, n + m) what |x - x*| and |u - u*| are at most: the `bounds` (G, n + m) of stages,
    which begin with the samples `stages` (G,). `plant` gives x' of states, u + h, wind, parameters, which are in
    `ranges` (p, 2); `h` is the specification's, of states and t. Beside `gusts`, which may jump, r `slow` signals
    enter u and wind by `spread` (m + k, r).
    """

    def __init__(self, loop: Loop, result: Result, tables: Tables, samples: int) -> None:
        self.loop, self.result, self.tables, self.samples = loop, result, tables, samples
        self.spec, self.names, self.Ts = loop.spec, loop.names, float(loop.sample_time)
        ends = sorted({Fraction(0), loop.rest, loop.sample_time})
        halves = ((a + b) / 2 for a, b in pairwise(ends) if b - a > loop.sample_time / 2)
        self.nodes = tuple(sorted({*ends, *halves}))
        *begins, _ = nodes = np.array(self.nodes, dtype=float)
        self.lengths, self.acts, P = np.diff(nodes), self.nodes.index(loop.rest), len(begins)
        self.t = np.append(np.add.outer(np.arange(samples) * self.Ts, begins), samples * self.Ts)
        self.outputs: Integers = P * np.unique(np.linspace(0, samples, _OUTPUTS + 1).astype(np.int64))

        model, m, k = loop.model, loop.inputs, loop.E.shape[1]
        winds = [f"w#{j}" for j in range(k)]
        slope = driven(loop.field, model.E, winds) if model.E else loop.field
        self.plant = Tape(slope, (*loop.names, *winds, *(name for name, _ in model.parameters)))
        self.h = None if model.h is None else Tape(model.h, (*model.states, TIME))
        self.ranges = np.array([ends for _, ends in loop.spec.ranges], dtype=float).reshape(-1, 2)

        tube = [{**stage.half_widths, **stage.deviations} for stage in result.tube]
        self.stages: Integers = np.array([stage.start for stage in result.tube])
        self.bounds = np.array([[own[name] for name in loop.names] for own in tube], dtype=float)
        of_nodes = np.append(np.repeat(np.arange(samples), P), samples - 1)
        self.limits = self.bounds[np.searchsorted(self.stages, of_nodes, side="right") - 1]
        self.gusts = Size(0 * loop.gusts.each, length=False) if loop.sways else loop.gusts
        entered = [*loop.matched, *(range(m, m + k) if loop.sways else ())]
        self.spread, self.slow = np.eye(m + k)[:, entered], self._slow(len(entered))

    def _slow(self, count: int) -> Sizes:
        """Those that enter u, then winds: as the theorem bounds them on the tube; an h that may jump has no rate."""
        loop, recipe = self.loop, self.result.recipe
        widest = self.bounds[:, : loop.states].max(axis=0)
        own = Remainders(loop, recipe.windows if recipe else 1).sizes(widest)
        size, rate, first = own.size, own.rate, own.first
        if loop.jumps and loop.matched:
            jump = np.full(loop.inputs, loop.declared[0] / np.sqrt(loop.inputs))
            size, first = np.append(jump, size), np.append(jump, first)
            rate = np.append(np.full(loop.inputs, np.inf), rate)
        return Sizes(size[:count], rate[:count], first[:count])  # behind these are parameters


def setting_of(spec: Spec, result: Result, duration: Fraction | None = None) -> Setting:
    """The setting of a result that has a tube; runs last `duration` s, or as long as the claim."""
    nominal, tables, recipe = result.nominal, result.controller, result.recipe
    if nominal is None or tables is None:
        raise ValueError("there is no loop without tables")
    model, knots = build(spec), result.planned
    plan, slow = plan_of(spec, model, knots), recipe is None or recipe.parameters == "slow"
    A, B, E = nominal.A, nominal.B, nominal.E
    loop = Loop(spec=spec, model=model, plan=plan, knots=knots, slow=slow, A=A, B=B, E=E)
    return Setting(loop, result, tables, _samples(loop, result, duration))


def _samples(loop: Loop, result: Result, duration: Fraction | None) -> int:
    Ts, horizon = loop.sample_time, result.claim.horizon
    asked = duration or (loop.spec.simulation and loop.spec.simulation.duration) or horizon
    if asked is not None:
        return ceil((asked if horizon is None else min(asked, horizon)) / Ts)
    memory = _MEMORIES * result.recipe.lags if result.recipe else 0
    return min(_SAMPLES[1], max(_SAMPLES[0], ceil((loop.plan.horizon or 0) / Ts), memory))


class Course(NamedTuple):
    """x* (K P + 1, n, N) at the ends of all parts, inputs as they are held (K + q + 1, m, N), interval by interval.

    The first interval ends when the first command acts. With one plan for all, N is 1. `ends` (N,): the first
    sample at which a plan is none of the family, because x* leaves P. `inputs`: u*(t) (m, 1), where it is not held.
    """

    x: Array
    held: Array
    ends: Array
    inputs: Callable[[float], Array] | None = None


def course_of(setting: Setting) -> Course:
    """The plan of a specification that is no family."""
    loop, Ts, K = setting.loop, setting.Ts, setting.samples
    plan, end = loop.plan, None if loop.plan.horizon is None else float(loop.plan.horizon)

    def at(t: Array) -> tuple[Array, Array]:
        if end is not None and loop.afterwards != "repeat":
            t = np.minimum(t, end)
        elif end is not None and plan.knots is not None:  # formulas go on
            t = np.mod(t, end)
        x, u = plan.enclose(t, t)
        return x.mid[:, :, None], u.mid[:, :, None]

    acts = float(loop.rest) + np.arange(-1, K + loop.whole) * Ts
    low, high = np.maximum(acts, 0.0), acts + Ts
    held = at(low + _AFTER * Ts if loop.hold == "left" else (low + high) / 2)[1]
    moving = loop.hold == "continuous" and not plan.is_constant
    inputs = (lambda t: at(np.full(1, t))[1][0]) if moving else None
    return Course(at(setting.t)[0], held, np.full(1, K + 1), inputs)


def courses_of(setting: Setting, bundle: Bundle, draws: Array) -> Course:
    """Plans of a family from `draws` (4 n + 3 m, N) in [0, 1), steered to stay in P.

    Their inputs are square waves, held or with the rate that they may have.
    """
    (n, m), K, acts, loop = setting.loop.B.shape, setting.samples, setting.acts, setting.loop
    boxes = (np.array(box, dtype=float) for box in (bundle.x, bundle.u))
    steer = Steering(loop.A, loop.B, setting.Ts, *boxes)
    rate = None if bundle.input_rate is None else np.array(bundle.input_rate, dtype=float)[:, None]
    x, u = steer.inside(draws[-n:]), steer.u + np.zeros((1, draws.shape[1]))
    path, held, ends = [x], [], np.full(draws.shape[1], K + 1)
    for k in range(K + loop.whole + 1):
        wish = waves(draws[:-n], K, k)
        lengths = setting.lengths[:acts] if k == 0 else np.roll(setting.lengths, -acts)
        asked, most = steer.input(x, wish[:m]), lengths.sum() * (0.0 if rate is None else rate)
        first, u = (asked, asked) if rate is None else (u, np.clip(asked, u - most, u + most))
        slope = partial(_slope, setting, (first, u, lengths.sum()), float(bundle.defect) * wish[m:])
        for begin, length in zip((np.cumsum(lengths) - lengths).tolist(), lengths.tolist(), strict=True):
            x = integrated(slope, begin, x, length, 2)
            path.append(x)
        held.append(first if loop.hold == "left" else (first + u) / 2)
        ends = np.where(steer.within(x), ends, np.minimum(ends, max(0, k - 1)))
    return Course(np.stack(path[: len(setting.t)]), np.stack(held), ends)


def _slope(setting: Setting, ramp: tuple[Array, Array, float], missed: Array, t: float, x: Array) -> Array:
    """x*' of lanes whose inputs go from the first (m, N) to the last in so many s, with what is missed (n, N)."""
    u = ramp[0] + t / ramp[2] * (ramp[1] - ramp[0])
    known = *np.zeros(setting.loop.E.shape[1]), *setting.ranges.mean(axis=1)
    return setting.plant.run_floats([*x, *u, *known], x[0].shape) + missed
