"""The tube that is asked for, against the safe set and the start: what is known of it before anything is proven.

A ball is as wide as its radius. In coordinates of its own, and with a constant metric, the half-widths are those of
(1.7), in floats; with another metric, or none yet, nothing is said of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.findings import Finding, Severity
from tubecert.lint import codes
from tubecert.lint.codes import finding
from tubecert.spec import Spec

_ROUNDING = 1e-9
_BALL = "the tube needs a radius of at least"
_LESS = "reduce tube.epsilon, tube.rho_a or the initial offset, or enlarge the safe set"


def least_radius(spec: Spec) -> float:
    """No tube of this specification is thinner: epsilon + rho_a + the initial offset (0 where unknown).

    Of half-widths it is the least one, for comparison only: the other states make the tube thinner.
    """
    tube = spec.tube
    if tube.half_widths:
        return float(min(width for _, width in tube.half_widths))
    return _asked_radius(spec) + (0.0 if spec.within is None else float(spec.within))


def room_findings(spec: Spec, t: Array, x: Array) -> Iterator[Finding]:
    """A tube that leaves the safe set around the plan `x` (K, n) at times `t` (K,), or that the start is not in."""
    offset = _offset(spec, x)
    if spec.hardware is not None:
        # the tube is what is found: within wishes and the safe set, with the start in it
        sides, most = np.abs(offset) + float(spec.within or 0), _most(spec, x)
        if (sides > most * (1 + _ROUNDING)).any():
            yield _outside(spec, sides, most)
        return
    if not spec.tube.auto:
        rho = least_radius(spec) + float(np.linalg.norm(offset))
        yield from _too_wide(spec, t, x, np.full(len(spec.states), rho), f"{_BALL} {near(rho, 4)}")
        return
    W = _constant_metric(spec)
    if W is None:
        return
    widths = np.sqrt(np.diagonal(W))
    start = math.sqrt(max(0.0, float(offset @ np.linalg.solve(W, offset))))
    if not spec.tube.half_widths:
        yield from _too_wide(spec, t, x, (_asked_radius(spec) / widths.max() + start) * widths, "")
        return
    asked = np.array([float(dict(spec.tube.half_widths).get(name, 0)) for name in spec.states])
    level = np.min(asked[asked > 0] / widths[asked > 0], initial=math.inf)
    if len(spec.tube.half_widths) == np.count_nonzero(asked) and start >= level * (1 + _ROUNDING):
        yield _outside(spec, offset, level * widths)
    elif math.isfinite(level):
        yield from _too_wide(spec, t, x, np.where(asked > 0, level * widths, 0.0), "")


def _most(spec: Spec, x: Array) -> Array:
    """The widest tube of a machine that there can be at the start of a plan `x` (K, n), or of any of a family."""
    low, high = np.array(spec.safe_set, dtype=float).T
    starts = x if spec.trajectory.bundle else x[:1]
    wished = [float(dict(spec.tube.half_widths).get(name, math.inf)) for name in spec.states]
    return np.asarray(np.clip(np.minimum(starts - low, high - starts).min(axis=0), 1e-300, wished))


def _too_wide(spec: Spec, t: Array, x: Array, sides: Array, radius: str) -> Iterator[Finding]:
    """Where the tube leaves the safe set by most, against its own width there."""
    low, high = np.array(spec.safe_set, dtype=float).T
    free = np.minimum(x - low, high - x)
    k, i = np.unravel_index(int(np.argmax(np.nan_to_num(sides - free, nan=-np.inf))), free.shape)
    side, room, name = float(sides[i]), float(free[k, i]), spec.states[i]
    if not math.isfinite(side) or side - room <= _ROUNDING * side:
        return
    when = "" if len(t) == 1 else f" at t = {near(t[k], 4)} s"
    asked = f"tube.half_widths.{name}" if name in dict(spec.tube.half_widths) else ""
    reaches = (
        f"{radius} (epsilon + rho_a + initial offset)"
        if radius
        else f"the tube reaches {name}* +-{near(side, 4)}"
    )
    message = f"{reaches}, but{when} the plan is only {near(room, 4)} from the {name} side of the safe set"
    help = f"certify proves a tube of at most {near(room, 4)} there; ask for that" if asked else _LESS
    path = (asked or "tube") if spec.location(asked or "tube") else "safe_set"
    severity = Severity.WARNING if asked else Severity.ERROR  # half-widths are made to fit
    yield finding(spec, codes.NO_ROOM, path, message, help, severity=severity)


def _outside(spec: Spec, offset: Array, sides: Array) -> Finding:
    """That the start is not in the tube, by the state that is farthest off, in its width."""
    i = int(np.argmax(np.abs(offset) / sides))
    name, off, side = spec.states[i], float(abs(offset[i])), float(sides[i])
    beyond = (
        f", and the tube has {name}* +-{near(side, 4)} there"
        if off > side
        else " in a direction in which the tube is thin"
    )
    message = f"the initial state is outside of the tube: {name} is {near(off, 4)} from the plan's{beyond}"
    larger = "half-widths" if spec.hardware is None else "half-widths, or enlarge the safe set"
    help = f"start nearer to the plan, or ask for larger {larger}"
    path = "initial_state" if spec.location("initial_state") else "trajectory"
    return finding(spec, codes.START_OUTSIDE, path, message, help, severity=Severity.ERROR)


def _asked_radius(spec: Spec) -> float:
    return float((spec.tube.epsilon or Fraction(0)) + (spec.tube.rho_a or Fraction(0)))


def _offset(spec: Spec, x: Array) -> Array:
    """How far the start is from the plan's, by state: of a box its farthest corner; 0 where it is not said."""
    if spec.within is not None or spec.trajectory.task is not None:
        return np.zeros(len(spec.states))
    spread = np.array([(high - low) / 2 for low, high in spec.start_box] or 0, dtype=float)
    away = np.array(spec.x0, dtype=float) - x[0]
    return np.asarray(away + np.where(away < 0, -spread, spread))


def _constant_metric(spec: Spec) -> Array | None:
    """W, if there is one that does not move and is positive definite."""
    terms = () if spec.metric is None else spec.metric.dual_metric
    entries = [term.expression for row in terms for term in row]
    if not entries or not all(entry.is_constant for entry in entries):
        return None
    W = np.array([entry.fraction for entry in entries], dtype=float).reshape(len(terms), -1)
    return W if np.isfinite(W).all() and np.linalg.eigvalsh(W)[0] > 0 else None
