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


@lru_cache(maxsize=4)
def _tapes(
    model: ControlAffineModel, base: tuple[Expression, ...] | None, E: Matrix, rest: Matrix
) -> tuple[Tape, Tape]:
    """f, base h, E, the rest and, where it moves, B, of t, states and parameters; B alone. Kept for the next level."""
    inputs = (TIME, *model.states, *dict(model.parameters))
    B, nothing = [entry for row in model.B for entry in row], [ZERO] * len(model.inputs)
    outputs = [*model.f, *(base or nothing), *(e for row in E for e in row), *(row[0] for row in rest)]
    return Tape([*outputs, *([] if model.constant_input else B)], inputs), Tape(B, inputs)


class Acting:
    """The disturbances of lanes, one after the other."""

    def __init__(
        self, parts: Sequence[Disturbance], model: ControlAffineModel, E: Matrix, rest: Matrix
    ) -> None:
        bases = {part.base for part in parts if part.base is not None}
        if len(bases) > 1:
            raise ValueError("lanes of one vector have one base of h")
        n, m, k = self._sizes = len(model.states), len(model.inputs), len(E[0]) if E else 0
        self._plant, self._input = _tapes(model, next(iter(bases), None), E, rest)
        nothing = [np.zeros(())] * len(self._input.inputs)
        self._B = self._input.run_floats(nothing, ()).reshape(n, m) if model.constant_input else None
        ends = np.cumsum([0, n, m, n * k, len(rest), n * m * (self._B is None)]).tolist()
        self._parts = [slice(a, b) for a, b in pairwise(ends)]
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
        """The plant's terms at a time and states x (n, N), with the lanes' parameters."""
        (n, m, k), N = self._sizes, x.shape[1]
        values = self._plant.run_floats_silenced([np.array(t), *x, *self._theta], (N,))
        f, base, E, rest, B = (values[part] for part in self._parts)
        return Terms(f, B.reshape(n, m, N) if self._B is None else self._B, base, E.reshape(n, k, N), rest)

    def input(self, t: float, x: Array) -> Array:
        """B alone, where it moves."""
        values = self._input.run_floats_silenced([np.array(t), *x, *self._theta], x.shape[1:])
        return values.reshape(*self._sizes[:2], -1)

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
