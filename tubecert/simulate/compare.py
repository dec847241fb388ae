"""Runs against a promise: the largest share of every bound that was used, violations, and what is no result.

All numbers of a run are known up to its own error estimate, relative to rho: a bound is broken only beyond that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.expression import Expression, derivatives
from tubecert.findings import Finding
from tubecert.model import TIME
from tubecert.simulate.inputs import InputUse, beyond, used
from tubecert.simulate.promise import Promise
from tubecert.simulate.runs import Runs
from tubecert.simulate.setting import Setting

USABLE: Final = 1e-2  # of rho: a run with a larger error estimate is no result
_EXACT: Final = 1e-6  # what rounding may add to a bound that is met with equality
SHOWN: Final = ("distance", "deviation", "k", "u", "xtilde", "sigma_error", "speed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Use:
    """The largest value of a quantity over some runs: its bound (None: not promised), and where it was met."""

    value: float
    bound: float | None
    lane: int
    time: float

    @property
    def share(self) -> float | None:
        """Value over bound."""
        return None if not self.bound else self.value / self.bound


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """A bound that a run broke: what, by which factor, and where; `name` `tube` is d(x*, x) < dbar itself."""

    name: str
    lane: int
    time: float
    value: float
    bound: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What runs used of the tube and of every bound; from `settled` on all of them stay in the ultimate radius.

    `first_exit` is the lane that leaves the tube first, and when; `unresolved` are lanes that are no result, and from
    when on they depend on the steps of the integration.
    """

    count: int
    uses: Mapping[str, Use]
    violations: tuple[Violation, ...]
    outside: tuple[int, ...]  # lanes that left the tube
    unreliable: tuple[int, ...]  # lanes that are no result
    error: float
    settled: float | None = None
    final: float | None = None
    failures: tuple[tuple[int, float, str], ...] = field(default=())
    first_exit: tuple[int, float] | None = None
    unresolved: tuple[tuple[int, float], ...] = ()
    inputs: tuple[InputUse, ...] = ()


def compare(setting: Setting, runs: Runs, promise: Promise | None) -> Comparison:
    """The comparison of runs with the tube, and with a promise if there is one."""
    usable = runs.error <= USABLE * setting.rho
    stopped = {item.lane for item in runs.failures}
    slack = 1 + _EXACT + np.where(usable, runs.error, 0.0) / setting.rho
    bounds = {"distance": setting.reach, "deviation": setting.rho}
    bounds |= dict(promise.bounds) if promise else {}
    uses = {name: _use(runs, name, bounds.get(name), usable) for name in SHOWN} if usable.any() else {}
    outside = usable & (runs.worst.deviation.value > setting.rho * slack)
    outside |= usable & (runs.worst.distance.value > setting.reach * slack)
    lanes = set(np.flatnonzero(outside).tolist()) | _left_before(setting, runs)
    unreliable = [int(lane) for lane in np.flatnonzero(~usable) if lane not in lanes and lane not in stopped]
    return Comparison(
        count=runs.lanes,
        uses=uses,
        violations=tuple(_violations(setting, runs, promise, usable, slack)) if promise else (),
        outside=tuple(sorted(lanes)),
        unreliable=tuple(unreliable),
        error=float(np.max(runs.error[usable], initial=0.0)),
        settled=_settled(setting, runs, promise, usable),
        final=float(np.max(_deviation(setting, runs)[usable, -1])) if usable.any() else None,
        failures=tuple((item.lane, item.t, item.reason) for item in runs.failures),
        first_exit=_first_exit(setting, runs, sorted(lanes)),
        unresolved=tuple((lane, float(runs.unresolved[lane])) for lane in unreliable),
        inputs=used(setting.spec, runs, usable, promise.ranges if promise else ()),
    )


def merged(parts: Sequence[Comparison]) -> Comparison:
    """One comparison of runs along several plans; lanes are numbered through."""
    starts = [0, *accumulate(part.count for part in parts)]
    shifted = [_shifted(part, start) for part, start in zip(parts, starts, strict=False)]
    settled = [part.settled for part in parts]
    return Comparison(
        count=starts[-1],
        uses={
            name: max((part.uses[name] for part in shifted if name in part.uses), key=lambda use: use.value)
            for name in SHOWN
            if any(name in part.uses for part in shifted)
        },
        violations=tuple(item for part in shifted for item in part.violations),
        outside=tuple(lane for part in shifted for lane in part.outside),
        unreliable=tuple(lane for part in shifted for lane in part.unreliable),
        error=max(part.error for part in parts),
        settled=None if None in settled else max(t for t in settled if t is not None),
        final=max((part.final for part in parts if part.final is not None), default=None),
        failures=tuple(item for part in shifted for item in part.failures),
        first_exit=min(
            (part.first_exit for part in shifted if part.first_exit is not None),
            key=lambda exit: exit[1],
            default=None,
        ),
        unresolved=tuple(item for part in shifted for item in part.unresolved),
        inputs=tuple(
            reduce(InputUse.joined, same) for same in zip(*(p.inputs for p in parts if p.inputs), strict=True)
        ),
    )


def _shifted(part: Comparison, start: int) -> Comparison:
    """The comparison with its lanes counted from `start` on."""
    return replace(
        part,
        uses={name: replace(use, lane=start + use.lane) for name, use in part.uses.items()},
        violations=tuple(replace(item, lane=start + item.lane) for item in part.violations),
        outside=tuple(start + lane for lane in part.outside),
        unreliable=tuple(start + lane for lane in part.unreliable),
        failures=tuple((start + lane, t, reason) for lane, t, reason in part.failures),
        first_exit=None if part.first_exit is None else (start + part.first_exit[0], part.first_exit[1]),
        unresolved=tuple((start + lane, t) for lane, t in part.unresolved),
    )


def _use(runs: Runs, name: str, bound: float | None, usable: NDArray[np.bool_]) -> Use:
    peak = getattr(runs.worst, name)
    lane = int(np.argmax(np.where(usable, peak.value, -np.inf)))
    return Use(value=float(peak.value[lane]), bound=bound, lane=lane, time=float(peak.time[lane]))


def _deviation(setting: Setting, runs: Runs) -> Array:
    """|S (x - x*)|, (N, K)."""
    return np.asarray(np.linalg.norm((runs.x - runs.x_plan) @ setting.S.T, axis=2))


def _left_before(setting: Setting, runs: Runs) -> set[int]:
    """Lanes that were stopped after they had left the tube: their error estimate is void, their exit is not."""
    return {item.lane for item in runs.failures if runs.worst.deviation.value[item.lane] > 2 * setting.rho}


def _first_exit(setting: Setting, runs: Runs, lanes: Sequence[int]) -> tuple[int, float] | None:
    """The first of these lanes that is outside of the tube at an output time (else when its distance peaks)."""
    if not lanes:
        return None
    rows = list(lanes)
    beyond = (_deviation(setting, runs)[rows] > setting.rho) | (runs.distance[rows] > setting.reach)
    first = np.where(beyond.any(axis=1), runs.t[np.argmax(beyond, axis=1)], runs.worst.deviation.time[rows])
    earliest = int(np.argmin(first))
    return lanes[earliest], float(first[earliest])


def _violations(
    setting: Setting, runs: Runs, promise: Promise, usable: NDArray[np.bool_], slack: Array
) -> list[Violation]:
    """Every bound that is broken, by the lane that breaks it most."""
    found = []
    for name, bound in promise.bounds.items():
        peak = getattr(runs.worst, name)
        excess = np.where(usable, peak.value - bound * slack, -np.inf)
        found += _broken(name, excess, peak.value, np.full(runs.lanes, bound), peak.time)
    room = np.where(usable, slack - 1, np.inf)[:, None]
    gap = np.abs(runs.x - runs.x_plan)
    for i, width in enumerate(promise.half_widths):
        name = f"half-width of {setting.spec.states[i]}"
        found += _over_time(name, gap[:, :, i], np.full(len(runs.t), width), runs.t, room * width)
    for output, width in zip(setting.spec.outputs, promise.output_widths, strict=False):
        values = np.abs((runs.x - runs.x_plan) @ np.array([float(q) for q in output.row]))
        found += _over_time(
            f"half-width of {output.name}", values, np.full(len(runs.t), width), runs.t, room * width
        )
    for name, values, bound, size in beyond(runs, promise.ranges):
        excess = np.where(usable, values - bound - (slack - 1) * size, -np.inf)
        found += _broken(name, excess, values, np.full(runs.lanes, bound), np.full(runs.lanes, np.nan))
    if promise.decay is not None:
        found += _over_time("D(t)", runs.distance, promise.decay(runs.t), runs.t, room * setting.reach)
    for item in runs.failures:
        if item.lane in _left_before(setting, runs):
            peak = float(runs.worst.deviation.value[item.lane])
            found.append(Violation(name="tube", lane=item.lane, time=item.t, value=peak, bound=setting.rho))
    return found


def _over_time(name: str, values: Array, allowed: Array, t: Array, room: Array) -> list[Violation]:
    """Values (N, K) against a bound (K,) at times (K,), with `room` (N, 1) for errors."""
    excess = np.nan_to_num(values - allowed - room, nan=-np.inf, neginf=-np.inf)
    worst = np.argmax(excess, axis=1)
    lanes = np.arange(len(values))
    return _broken(name, excess[lanes, worst], values[lanes, worst], allowed[worst], t[worst])


def _broken(name: str, excess: Array, values: Array, bounds: Array, times: Array) -> list[Violation]:
    lane = int(np.argmax(excess))
    if not excess[lane] > 0:
        return []
    return [
        Violation(
            name="tube" if name == "distance" else name,
            lane=lane,
            time=float(times[lane]),
            value=float(values[lane]),
            bound=float(bounds[lane]),
        )
    ]


def _settled(
    setting: Setting, runs: Runs, promise: Promise | None, usable: NDArray[np.bool_]
) -> float | None:
    """From when on every run stays within the ultimate radius; None if one does not, or if there is none."""
    if promise is None or promise.ultimate is None or not usable.any():
        return None
    beyond = (_deviation(setting, runs)[usable] > promise.ultimate).any(axis=0)
    if not beyond.any():
        return 0.0
    last = int(np.flatnonzero(beyond)[-1])
    return None if last + 1 == len(runs.t) else float(runs.t[last + 1])


def check_class(setting: Setting, runs: Runs, h: tuple[Expression, ...], where: str) -> None:
    """Raises if h leaves the class that was certified while the state is in the tube: such a run tests nothing.

    |h|, |h_x| and |h_t| are looked at along the runs, and |h| at the start.
    """
    kind = setting.uncertainty
    states = setting.model.states
    tape = Tape([*h, *(e for name in (TIME, *states) for e in derivatives(h, name))], (TIME, *states))
    t, x = np.broadcast_to(runs.t, runs.distance.shape), np.moveaxis(runs.x, 2, 0)
    values = tape.run_floats([t, *x], t.shape).reshape(1 + 1 + len(states), kind.m, *t.shape)
    inside = np.cumsum(~(runs.distance < setting.reach), axis=1) == 0
    slopes = np.moveaxis(values[2:], (0, 1), (3, 2))
    with np.errstate(invalid="ignore"):
        sizes = {
            "h": np.linalg.norm(values[0], axis=0),
            "h_t": np.linalg.norm(values[1], axis=0),
            "h_x": np.linalg.norm(np.nan_to_num(slopes @ np.linalg.inv(setting.S)), ord=2, axis=(2, 3)),
        }
    sizes["h_initial"] = np.where(runs.t == 0, sizes["h"], 0.0)
    words = {"h": "|h|", "h_t": "|dh/dt|", "h_x": "|dh/dx|", "h_initial": "|h| at the start"}
    for name, size in sizes.items():
        bound = getattr(kind, name)
        excess = np.where(inside, np.nan_to_num(size), 0.0)
        lane, step = np.unravel_index(int(np.argmax(excess)), excess.shape)
        if excess[lane, step] > bound * (1 + _EXACT):
            message = (
                f"the uncertainty leaves the class that was certified: {words[name]} is "
                f"{near(excess[lane, step])} > {near(bound)} at t = {near(runs.t[step], 4)}"
            )
            help = f"certify with {name if name != 'h_initial' else 'h'} declared in uncertainty.bounds"
            raise TubecertError(
                [Finding(code="TC706", message=message, location=setting.spec.location(where), help=help)]
            )
