"""Runs against a promise: the largest share of every bound that was used, violations, what is no result, clearances.

All numbers of a run are known up to its own error estimate, relative to rho: a bound is broken only beyond that.
A comparison is a record of the summary as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.expression import Expression, derivatives
from tubecert.findings import Finding
from tubecert.model import TIME
from tubecert.simulation.adaptive.continuous import reason
from tubecert.simulation.adaptive.loops import Promise, Runs, Sizes
from tubecert.simulation.adaptive.setting import Setting
from tubecert.simulation.obstacles import in_plane, signed_distance
from tubecert.simulation.told import Clearance, Peak, RunAt, Stopped, Violation, Went
from tubecert.spec import Spec
from tubecert.verdict import Verdict

_USABLE: Final = 1e-2  # of rho: a run with a larger error estimate is no result
_EXACT: Final = 1e-6  # what rounding may add to a bound that is met with equality
_LISTED: Final = 20  # of the runs that left, stopped or came to nothing
_POINTS: Final = 2001  # of a curve, whose distances from obstacles are taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What runs used of the tube and of every bound; from `settled` on all of them stay in the ultimate radius.

    `first_exit` is the run that leaves the tube first, and when. `no_result` counts runs that tell nothing: those of
    them that are not `stopped` depend on the steps of the integration from the time in `unresolved` on.
    """

    runs: int
    left_the_tube: int
    first_outside: tuple[int, ...]
    first_exit: RunAt | None
    no_result: int
    unresolved: tuple[RunAt, ...]
    stopped: tuple[Stopped, ...]
    worst: Mapping[str, Peak]
    violations: tuple[Violation, ...]
    settled: float | None
    error_estimate: float
    went: Mapping[str, Went] = field(default_factory=dict)


class _Judged(NamedTuple):
    """Runs with what is known of each, (N,): whether it is a result, whether it left the tube, room for its error.

    `deviation` (N, K) is |S (x - x*)|.
    """

    setting: Setting
    runs: Runs
    usable: NDArray[np.bool_]
    left: NDArray[np.bool_]
    room: Array
    deviation: Array


def compare(setting: Setting, runs: Runs, promise: Promise | None) -> Comparison:
    """The comparison of runs with the tube, and with a promise if there is one.

    A run that was stopped has left the tube if it was far outside: its error estimate is void, its exit is not.
    """
    peak, usable = runs.found.peak, runs.error <= _USABLE * setting.rho
    room = _EXACT + np.where(usable, runs.error, 0.0) / setting.rho
    left = usable & (peak.deviation > setting.rho * (1 + room))
    left |= usable & (peak.distance > setting.reach * (1 + room))
    why, ended = runs.found.stopped, runs.found.ended
    left |= (why != 0) & (peak.deviation > 2 * setting.rho)
    deviation = np.linalg.norm(runs.off @ setting.S.T, axis=2)
    own = _Judged(setting, runs, usable, left, room, deviation)
    bounds = promise.bounds if promise else {"distance": setting.reach, "deviation": setting.rho}
    outside, void, any_usable = np.flatnonzero(left), ~usable & ~left, bool(usable.any())
    unknown = np.flatnonzero(void & (why == 0))[:_LISTED].tolist()
    return Comparison(
        runs=len(left),
        left_the_tube=len(outside),
        first_outside=tuple(outside[:_LISTED].tolist()),
        first_exit=_first_exit(own),
        no_result=int(void.sum()),
        unresolved=tuple(RunAt(run=lane, t=_finite(runs.found.unresolved[lane])) for lane in unknown),
        stopped=tuple(
            Stopped(run=lane, t=_finite(ended[lane]), reason=reason(int(why[lane]), setting.limit))
            for lane in np.flatnonzero(why)[:_LISTED].tolist()
        ),
        worst={name: _peak(own, name, bounds.get(name)) for name in Sizes._fields} if any_usable else {},
        violations=tuple(_violations(own, promise)) if promise else (),
        settled=_settled(own, promise.ultimate if promise else None),
        error_estimate=float(np.max(runs.error[usable], initial=0.0)),
        went=dict(_went(own, promise)) if any_usable else {},
    )


def _peak(own: _Judged, name: str, bound: float | None) -> Peak:
    found = own.runs.found
    peak, times = getattr(found.peak, name), getattr(found.peak_time, name)
    lane = int(np.argmax(np.where(own.usable, peak, -np.inf)))
    value, t = float(peak[lane]), float(times[lane])
    return Peak(value=value, bound=bound, share=value / bound if bound else None, run=lane, t=t)


def _first_exit(own: _Judged) -> RunAt | None:
    """The first run that is outside of the tube at an output time (else when its distance peaks)."""
    lanes = np.flatnonzero(own.left)
    if not len(lanes):
        return None
    beyond = (own.deviation > own.setting.rho) | (own.runs.distance > own.setting.reach)
    peaks = own.runs.found.peak_time.deviation
    at = np.where(beyond.any(axis=1), own.runs.t[np.argmax(beyond, axis=1)], peaks)
    lane = int(lanes[np.argmin(at[lanes])])
    return RunAt(run=lane, t=float(at[lane]))


def _settled(own: _Judged, ultimate: float | None) -> float | None:
    """From when on every run stays within the ultimate radius; None if one does not, or if there is none."""
    if ultimate is None or not own.usable.any():
        return None
    beyond = np.flatnonzero((own.deviation[own.usable] > ultimate).any(axis=0))
    after = beyond[-1] + 1 if len(beyond) else 0
    return float(own.runs.t[after]) if after < len(own.runs.t) else None


def _went(own: _Judged, promise: Promise | None) -> Iterator[tuple[str, Went]]:
    """The range of every input that has limits or a proven range, over all steps of the runs that are results."""
    ranges, spec = promise.ranges if promise else {}, own.setting.spec
    for name in dict.fromkeys((*(name for name, _ in spec.limits or ()), *ranges)):
        column, stays = spec.inputs.index(name), ranges.get(name)
        least = float(own.runs.found.least[column, own.usable].min())
        greatest = float(own.runs.found.greatest[column, own.usable].max())
        proven = (stays.least, stays.greatest) if stays else None
        yield name, Went(least=least, greatest=greatest, proven=proven)


def _violations(own: _Judged, promise: Promise) -> Iterator[Violation]:
    """Every bound that is broken, by the run that breaks it most."""
    runs, found, spec = own.runs, own.runs.found, own.setting.spec
    for name, bound in promise.bounds.items():
        values, when = (getattr(each, name)[:, None] for each in (found.peak, found.peak_time))
        yield from _broken(own, "tube" if name == "distance" else name, (values, when), bound, bound)
    rows = [*np.eye(len(spec.states)), *(np.array(output.row, dtype=float) for output in spec.outputs)]
    for name, row in zip((*spec.states, *(output.name for output in spec.outputs)), rows, strict=True):
        width, away = promise.half_widths[name], np.abs(runs.off @ row)
        yield from _broken(own, f"half-width of {name}", (away, runs.t), width, width)
    for name, stays in promise.ranges.items():
        column, size = spec.inputs.index(name), stays.greatest - stays.least
        ends = (("", found.greatest, stays.greatest), ("-", -found.least, -stays.least))
        for sign, values, bound in ends:  # when it was there is not known
            yield from _broken(
                own, f"input {sign}{name}", (values[column][:, None], np.array(np.nan)), bound, size
            )
    if promise.decay is not None:
        yield from _broken(own, "D(t)", (runs.distance, runs.t), promise.decay(runs.t), own.setting.reach)
    for lane in np.flatnonzero((found.stopped != 0) & own.left).tolist():
        t, value, rho = float(found.ended[lane]), float(found.peak.deviation[lane]), own.setting.rho
        yield Violation(of="tube", run=lane, t=t, value=value, bound=rho, share=value / rho)


def _broken(
    own: _Judged, name: str, met: tuple[Array, Array], bounds: Array | float, scale: float
) -> Iterator[Violation]:
    """Where values (N, K) are furthest beyond bounds (K,) and what the errors may add, parts of `scale`; with times."""
    values, times, bounds = np.broadcast_arrays(*met, bounds)
    excess = np.where(own.usable[:, None], values - bounds - (own.room * scale)[:, None], -np.inf)
    lane, step = np.unravel_index(int(np.argmax(np.nan_to_num(excess, nan=-np.inf))), excess.shape)
    if excess[lane, step] > 0:
        value, bound = float(values[lane, step]), float(bounds[lane, step])
        share, t = value / bound if bound > 0 else None, _finite(times[lane, step])
        yield Violation(of=name, run=int(lane), t=t, value=value, bound=bound, share=share)


def check_class(setting: Setting, runs: Runs, h: tuple[Expression, ...], where: str) -> None:
    """Raises if h leaves the class that was certified while the state is in the tube: such a run tests nothing.

    |h|, |h_x| and |h_t| are looked at along the runs, and |h| at the start.
    """
    kind, states = setting.uncertainty, setting.model.states
    tape = Tape([*h, *(e for name in (TIME, *states) for e in derivatives(h, name))], (TIME, *states))
    t, x = np.broadcast_to(runs.t, runs.distance.shape), np.moveaxis(runs.x, 2, 0)
    values = tape.run_floats([t, *x], t.shape).reshape(2 + len(states), kind.m, *t.shape)
    inside = np.cumsum(~(runs.distance < setting.reach), axis=1) == 0
    slopes = np.moveaxis(values[2:], (0, 1), (3, 2))
    with np.errstate(invalid="ignore"):
        h_x = np.linalg.norm(np.nan_to_num(slopes @ np.linalg.inv(setting.S)), ord=2, axis=(2, 3))
        size, h_t = np.linalg.norm(values[:2], axis=1)
    for words, found, bound, declared in (
        ("|h|", size, kind.h, "h"),
        ("|dh/dt|", h_t, kind.h_t, "h_t"),
        ("|dh/dx|", h_x, kind.h_x, "h_x"),
        ("|h| at the start", np.where(runs.t == 0, size, 0.0), kind.h_initial, "h"),
    ):
        lane, step = divmod(int(np.argmax(excess := np.where(inside, np.nan_to_num(found), 0.0))), t.shape[1])
        if (most := float(excess[lane, step])) > bound * (1 + _EXACT):
            message = (
                f"the uncertainty leaves the class that was certified: {words} is "
                f"{near(most)} > {near(bound)} at t = {near(runs.t[step], 4)}"
            )
            help = f"certify with {declared} declared in uncertainty.bounds"
            place = setting.spec.location(where)
            raise TubecertError([Finding(code="TC706", message=message, location=place, help=help)])


def of_tube(setting: Setting) -> tuple[Clearance, ...]:
    """That of the tube over the whole plan: what is proven, in the certificate."""
    return tuple(
        Clearance(clearance=_finite(own.clearance.below), t=own.t, collides=own.verdict is Verdict.REFUTED)
        for own in setting.result.clearance
    )


def of_plan(setting: Setting) -> tuple[Clearance, ...]:
    """That of the plan, in many points: no proof."""
    t = np.linspace(0.0, setting.horizon, _POINTS)
    return _of_curve(setting.spec, t, setting.plan.enclose(t, t)[0].mid)


def of_run(setting: Setting, runs: Runs) -> tuple[Clearance, ...]:
    """That of the first of runs, between output times by cubics with its own slopes: no proof."""
    t, x, slope = runs.t, runs.x[0], runs.slope[0]
    parts = -(-_POINTS // len(t))
    s, dt = np.arange(parts)[:, None, None] / parts, np.diff(t)[:, None]
    between = (1 - s) ** 2 * (1 + 2 * s) * x[:-1] + s**2 * (3 - 2 * s) * x[1:]
    between += s * (1 - s) * dt * ((1 - s) * slope[:-1] - s * slope[1:])
    times = (t[:-1] + s[..., 0] * dt[:, 0]).ravel()
    curve = np.concatenate([x, between.reshape(len(times), -1)])  # x: up to where a run was stopped
    return _of_curve(setting.spec, np.concatenate([t, times]), curve)


def _of_curve(spec: Spec, t: Array, x: Array) -> tuple[Clearance, ...]:
    """That of a curve (K, n) at times (K,); nan where it has ended."""
    found = []
    for obstacle in spec.obstacles:
        gaps = np.nan_to_num(signed_distance(obstacle, in_plane(spec, obstacle, x)), nan=np.inf)
        step = int(np.argmin(gaps))
        gap = float(gaps[step])
        found.append(Clearance(clearance=_finite(gap), t=float(t[step]), collides=gap <= 0))
    return tuple(found)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
