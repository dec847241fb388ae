"""Coordinates z = S x for the tube, its radius and its half-widths, proposed from samples in floats.

S'S is a multiple of the metric at a point of the plan, or of the inverse of the mean dual metric: whichever makes the
metric in the tube most like the identity in z. For a constant metric it is the metric itself. Untrusted: that S is
invertible is checked where it is read, and every constant in z is proven.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from functools import partial, reduce
from math import sqrt

import numpy as np

from tubecert.bounds.level import Proposed
from tubecert.coordinates import Coordinates
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.model import ControlAffineModel
from tubecert.trajectory import Plan

_TIMES = 17
_DIRECTIONS = 48
_PASSES = 4
_DIGITS = Context(prec=9)
_ALIKE = 1e-9
_INSIDE = 0.97  # of the room in the safe set: samples may miss the widest place


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What is asked of the tube: half-widths `asked` of some states, or else a `width` beyond the start's distance, of
    the state that moves farthest.

    Those of the states are followed by those of the `outputs` (k, n). A tube that would leave the safe set through a
    state for which nothing is asked is made as much narrower.
    `apart` (n,) is x(0) - x*(0); where any start within a radius is allowed, that is `within`. `box` (n, 2) is the safe
    set.
    """

    asked: tuple[Fraction | None, ...] | None
    width: float
    apart: Array
    within: float
    box: Array
    outputs: Array

    def start(self, S: Array) -> float:
        """How far the start is from the plan's, in z."""
        return float(np.linalg.norm(S @ self.apart) + self.within * np.linalg.norm(S, 2))

    def level(self, around: Array, S: Array, start: float, centres: Array) -> float:
        """Dbar, given W at points (K, n, n), S, the start's distance, and points of the plan (K', n)."""
        if self.asked is None:
            return self.width / _reach(S) + start
        n = len(self.box)
        C = np.vstack([np.eye(n), self.outputs])
        widths = np.sqrt(np.max(np.diagonal(C @ around @ C.T, axis1=1, axis2=2), axis=0))
        level = min(float(w) / float(s) for w, s in zip(self.asked, widths, strict=True) if w is not None)
        room = np.minimum(centres - self.box[:, 0], self.box[:, 1] - centres).min(axis=0)
        beyond = [
            _INSIDE * float(free) / float(width)
            for asked, free, width in zip(self.asked[:n], room, widths[:n], strict=True)
            if asked is None and 0 < free < level * width
        ]
        return min([level, *beyond])


def propose(model: ControlAffineModel, plan: Plan, wish: Wish) -> tuple[Coordinates, Proposed]:
    """Coordinates, and a tube in them; raises `ValueError` where the metric has no finite value on the plan."""
    dual = Tape([e for row in model.W for e in row], model.states)
    centres = _on_plan(plan)
    around = _values(dual, centres)
    if not len(around):
        raise ValueError("the metric has no finite value on the plan")
    S = _factor(around.mean(axis=0))
    for _ in range(_PASSES):
        bounds = _spectrum(around, S)
        S = S * sqrt(bounds[0])
        ratio = sqrt(bounds[1] / bounds[0])
        widths = _widths(around)
        level = wish.level(around, S, ratio * wish.start(S), centres)
        if all(e.is_constant for row in model.W for e in row):
            break
        around = _values(dual, _samples(centres, S, level, level * widths, wish.box))
        candidates = [around.mean(axis=0), *_values(dual, centres[:: max(1, len(centres) // 4)])]
        S = reduce(partial(_better, around), map(_factor, candidates))
    bounds = _spectrum(around, S)
    S = S * sqrt(bounds[0])
    if wish.asked is None:
        widths = _widths(around)
        level = wish.level(around, S, sqrt(bounds[1] / bounds[0]) * wish.start(S), centres)
    sides = tuple(Fraction(float(side)) for side in level * widths)
    if wish.asked is not None:
        # |z| = 1 at the rim of the tube: Gamma, which has a meaning with P = S'S only, is then the same for c W
        S, level = S / level, 1.0
    else:
        # |z| bounds every state, whatever the scale of the metric
        S, level = (S * _reach(S), level * _reach(S))
    coordinates = Coordinates(tuple(tuple(map(_short, row)) for row in S))
    return coordinates, Proposed(rho=_short(level), sides=sides)


def _reach(S: Array) -> float:
    """How far the state that moves farthest is off where |S x| <= 1."""
    return float(np.linalg.norm(np.linalg.inv(S), axis=1).max())


def _widths(duals: Array) -> Array:
    """Sup sqrt(W_ii) over samples, (n,)."""
    return np.asarray(np.sqrt(np.max(np.diagonal(duals, axis1=1, axis2=2), axis=0)))


def _on_plan(plan: Plan) -> Array:
    """Points of the plan, (K, n)."""
    end = 0.0 if plan.horizon is None else float(plan.horizon)
    t = np.zeros(1) if plan.is_constant else np.linspace(0.0, np.nextafter(end, 0.0), _TIMES)
    return plan.enclose(t, t)[0].mid


def _values(dual: Tape, points: Array) -> Array:
    """W at points (K, n), where it is positive definite: (K', n, n)."""
    n = points.shape[1]
    with np.errstate(all="ignore"):
        values = dual.run_floats(list(points.T), (len(points),)).T.reshape(-1, n, n)
    values = values[np.isfinite(values).all(axis=(1, 2))]
    scale = np.sqrt(np.abs(np.diagonal(values, axis1=1, axis2=2)))
    scale = np.where(scale > 0, scale, 1.0)
    least = np.linalg.eigvalsh(values / scale[:, :, None] / scale[:, None, :])[:, 0]
    return np.asarray(values[least > 0])


def _samples(centres: Array, S: Array, level: float, sides: Array, box: Array) -> Array:
    """Points of |S (x - x*)| <= level, within the half-widths and the safe set."""
    n = S.shape[0]
    drawn = np.random.default_rng(0).normal(size=(_DIRECTIONS, n))
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    z = level * np.vstack([np.zeros((1, n)), np.eye(n), -np.eye(n), drawn, 0.5 * drawn])
    offset = np.clip(z @ np.linalg.inv(S).T, -sides, sides)
    corners = np.vstack([offset, sides * np.eye(n), -sides * np.eye(n)])
    points = (centres[:, None] + corners[None]).reshape(-1, n)
    return np.asarray(np.clip(points, box[:, 0], box[:, 1]))


def _spectrum(duals: Array, S: Array) -> tuple[float, float]:
    """The least and the greatest eigenvalue of S^-T M S^-1 over samples."""
    values = np.linalg.eigvalsh(S @ duals @ S.T)
    return 1 / float(values[:, -1].max()), 1 / float(values[:, 0].min())


def _condition(duals: Array, S: Array) -> float:
    least, greatest = _spectrum(duals, S)
    return greatest / least


def _better(duals: Array, S: Array, other: Array) -> Array:
    """The other one, if it is better by more than a rounding: ties would be decided by the processor."""
    return other if _condition(duals, other) < (1 - _ALIKE) * _condition(duals, S) else S


def _factor(dual: Array) -> Array:
    """S = L^-1, lower triangular, where L L' = W: S'S = W^-1. In plain arithmetic, the same everywhere."""
    n = len(dual)
    W = [[float(value) for value in row] for row in dual]
    L = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            rest = W[i][j] - sum(L[i][k] * L[j][k] for k in range(j))
            L[i][j] = sqrt(rest) if i == j else rest / L[j][j]
    S = [[0.0] * n for _ in range(n)]
    for j in range(n):
        for i in range(j, n):
            own = float(i == j) - sum(L[i][k] * S[k][j] for k in range(j, i))
            S[i][j] = own / L[i][i]
    return np.array(S)


def _short(value: float) -> Fraction:
    """A decimal of few digits."""
    return Fraction(_DIGITS.create_decimal(Decimal(float(value))))
