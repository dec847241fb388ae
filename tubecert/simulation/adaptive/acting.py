"""What acts on the lanes: the plant's terms at their states, the disturbance, wind and parameters of every lane."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression
from tubecert.expression.matrix import Matrix
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulation.adaptive.loops import Disturbance

_STEEP: Final = 3.0  # how much more than a sine the wave of a wind is a square
_NOTHING: Final = 1e-300  # so small that nothing is divided by less
_THIN: Final = 0.05  # of the layer: where a wind that aims turns round


class Terms(NamedTuple):
    """Of the plant at N states: f (n, N), B (n, m, N) or constant (n, m), base h (m, N), E (n, k, N), the rest (n, N).

    The rest is what unknown parameters do that no input can.
    """

    f: Array
    B: Array
    base: Array
    E: Array
    rest: Array


class Plant:
    """The terms of a model, evaluated at many states."""

    def __init__(
        self, model: ControlAffineModel, base: tuple[Expression, ...] | None, E: Matrix, rest: Matrix
    ) -> None:
        n, m, k = len(model.states), len(model.inputs), len(E[0]) if E else 0
        inputs = (TIME, *model.states, *dict(model.parameters))
        entries = [entry for row in model.B for entry in row]
        constant = model.constant_input
        self._constant = Tape(entries, ()).run_floats([], ()).reshape(n, m) if constant else None
        outputs = [*model.f, *(base or [ZERO] * m), *(e for row in E for e in row), *(row[0] for row in rest)]
        self._tape = Tape([*outputs, *([] if constant else entries)], inputs)
        self._input = Tape(entries, inputs)
        ends = np.cumsum([0, n, m, n * k, len(rest), 0 if constant else n * m]).tolist()
        self._parts = [slice(a, b) for a, b in pairwise(ends)]
        self._sizes = n, m, k

    def terms(self, t: float, x: Array, theta: Array) -> Terms:
        """At a time, states x (n, N) and parameters (p, N)."""
        n, m, k = self._sizes
        N = x.shape[1]
        values = self._tape.run_floats_silenced([np.array(t), *x, *theta], (N,))
        f, base, E, rest, B = (values[part] for part in self._parts)
        own = B.reshape(n, m, N) if self._constant is None else self._constant
        return Terms(f, own, base, E.reshape(n, k, N), rest)

    def input(self, t: float, x: Array, theta: Array) -> Array:
        """B alone, (n, m, N) or constant (n, m)."""
        if self._constant is not None:
            return self._constant
        n, m, _ = self._sizes
        return self._input.run_floats_silenced([np.array(t), *x, *theta], x.shape[1:]).reshape(n, m, -1)


@lru_cache(maxsize=4)
def plant(model: ControlAffineModel, base: tuple[Expression, ...] | None, E: Matrix, rest: Matrix) -> Plant:
    """The plant of a problem, kept for its next level."""
    return Plant(model, base, E, rest)


class Acting:
    """The disturbances of lanes, one after the other."""

    def __init__(
        self, parts: Sequence[Disturbance], model: ControlAffineModel, E: Matrix, rest: Matrix
    ) -> None:
        bases = {part.base for part in parts if part.base is not None}
        if len(bases) > 1:
            raise ValueError("lanes of one vector have one base of h")
        self._plant = plant(model, next(iter(bases), None), E, rest)
        sizes = [len(part.push) for part in parts]
        self._based = np.repeat([float(part.base is not None) for part in parts], sizes)
        self._own = Disturbance(
            None, *(_joined(list(each)) for each in zip(*(own[1:] for own in parts), strict=True))
        )
        self._pushes, self._blows = bool(self._own.push.any()), bool(self._own.wind.any())
        self._clips = bool(np.isfinite(self._own.radius).any())
        self._unknown = np.repeat([float(len(part.theta) > 0) for part in parts], sizes)
        self._theta = (
            self._own.theta if len(self._own.theta) else np.zeros((len(model.parameters), sum(sizes)))
        )

    def terms(self, t: float, x: Array) -> Terms:
        """The plant's terms, with the lanes' parameters."""
        return self._plant.terms(t, x, self._theta)

    def input(self, t: float, x: Array) -> Array:
        """B alone."""
        return self._plant.input(t, x, self._theta)

    def h(self, t: float, x: Array, base: Array, push: Array) -> Array:
        """h (m, N) at x (n, N), where `push` (m, N) is B'M gamma_s."""
        h, own = base * self._based, self._own
        if len(own.phase):
            angle = own.frequency * t + np.einsum("win,in->wn", own.wave, x) + own.phase
            h += np.einsum("wjn,wn->jn", own.amplitude, np.sin(angle))
        if self._pushes:
            h += own.push / np.sqrt(np.einsum("jn,jn->n", push, push) + own.layer**2) * push
        if self._clips:
            size = np.sqrt(np.einsum("jn,jn->n", h, h))
            h *= np.minimum(1.0, own.radius / np.maximum(size, _NOTHING))
        return np.asarray(h)

    def wind(self, t: float, terms: Terms, pushes: tuple[Array, Array]) -> Array:
        """E w and what unknown parameters do, (n, N); `pushes`: M gamma_s and B B'M gamma_s."""
        found, own = terms.rest * self._unknown if len(terms.rest) else np.zeros_like(terms.f), self._own
        if not self._blows:
            return found
        aims = [(terms.E * way[:, None]).sum(axis=0) for way in pushes]
        w = np.where(own.aim == 0, own.blowing, np.where(own.aim == 1, *aims))
        square = np.where(own.aim > 0, (_THIN * own.layer) ** 2, 0.0) + (w**2).sum(axis=0)
        wave = np.clip(_STEEP * np.sin(own.gusting[0] * t + own.gusting[1]), -1.0, 1.0)
        share = np.where(square > 0, own.wind * wave / np.sqrt(square), 0.0)
        return np.asarray(found + (terms.E * (share * w)).sum(axis=1))


def _joined(parts: Sequence[Array]) -> Array:
    """Arrays (.., N) one after the other; where they are of unequal size the rest is 0."""
    shape = np.max([part.shape[:-1] for part in parts], axis=0).astype(int)
    rooms = [[*((0, most) for most in shape - part.shape[:-1]), (0, 0)] for part in parts]
    return np.concatenate([np.pad(*each) for each in zip(parts, rooms, strict=True)], axis=-1)
