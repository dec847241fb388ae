"""What of the loop is not linear, bounded on the tube, and the sizes and rates of what its signals are.

Everything is a supremum over cells of the plan, by mean values: F(x + e) - F(x) - A e = int (F_x(x + a e) - A) da e,
with the integral bounded on `_LEVELS` parts of [0, 1], each on its own box. Trusted: yes.
Implements: theory of the sampled loop, section 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.tape import Tape
from tubecert.expression import Expression, derivatives, symbol
from tubecert.expression.matrix import column, combine, jacobian, multiply
from tubecert.model import TIME
from tubecert.sampled_loop.cells import (
    cells_of,
    end_of,
    in_time,
    largest_jump,
    moves_in_time,
    steepness,
)
from tubecert.sampled_loop.midrad import SUMMED, total
from tubecert.sampled_loop.setting import PLAN_ROUNDING, Loop
from tubecert.trajectory.family import Family

_LEVELS: Final = 4


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """Suprema of |eta|, |eta'|, |eta(0)|, (r,) each, from above."""

    size: Array
    rate: Array
    first: Array


class Remainders:
    """The suprema of one loop over its plan, split into `windows`."""

    def __init__(self, loop: Loop, windows: int) -> None:
        self.loop, self.windows = loop, windows
        self.cells = cells_of(loop, windows)
        names = (*loop.model.states, *loop.model.inputs)
        self._names = (*names, *(name for name, _ in loop.model.parameters))
        u = column([symbol(name) for name in loop.model.inputs])
        F = [row[0] for row in combine(1, column(loop.drift), 1, multiply(loop.gained, u))]
        known = [row[0] for row in combine(1, column(loop.model.f), 1, multiply(loop.model.B, u))]
        self._slopes = Tape([e for row in jacobian(F, names) for e in row], self._names)
        self._field = Tape(known, self._names)
        self._strange = [combine(1, ((F[i],),), -1, ((known[i],),))[0][0] for i in loop.unknown]
        self._E = Tape([e for row in loop.model.E for e in row], self._names)
        ends = [BoxDomain({name: each}).boxes((name,)) for name, each in loop.model.parameters]
        self._parameters = np.array([(lo[0, 0], hi[0, 0]) for lo, hi in ends]).reshape(-1, 2)
        self._timed = in_time(loop, self.cells, moves=moves_in_time(loop))
        self._h = Tape(loop.model.h or (), (*loop.model.states, TIME))
        slopes = jacobian(loop.model.h or (), (*loop.model.states, TIME))
        self._h_slopes = Tape([e for row in slopes for e in row], (*loop.model.states, TIME))

    # -- what is known before there is a tube ------------------------------------------------------------------------

    @cached_property
    def states_above(self) -> Array:
        """sup |x*_i|, (n,)."""
        return np.asarray(self.cells.x.magnitude.max(axis=0))

    @cached_property
    def inputs_range(self) -> tuple[Array, Array]:
        """inf and sup of u*, (m,) each."""
        return self.cells.u.lo.min(axis=0), self.cells.u.hi.max(axis=0)

    @cached_property
    def inputs_above(self) -> Array:
        """sup |u*_j|, (m,)."""
        return np.asarray(np.maximum(-self.inputs_range[0], self.inputs_range[1]))

    @cached_property
    def held(self) -> Array:
        """sup |u*_j - ubar_j| while a command acts, (m,), with the controller's own rounding of the plan (G9)."""
        return np.asarray((self._holding + PLAN_ROUNDING * self.inputs_above) * (1 + 1e-15))

    @property
    def _holding(self) -> Array:
        loop = self.loop
        rate = steepness(loop, len(self.cells))
        if loop.hold == "continuous" or (rate is None and isinstance(loop.plan, Family)):
            return np.zeros(loop.inputs)
        if rate is None:
            return largest_jump(loop)
        span = fraction_bounds(loop.sample_time if loop.hold == "left" else loop.sample_time / 2)[1]
        return np.asarray(rate * span * (1 + 1e-15))

    @cached_property
    def smooth(self) -> bool:
        """Whether u* has a rate, so that what parameters do along the plan is a component of eta."""
        return steepness(self.loop, len(self.cells)) is not None

    @cached_property
    def defect(self) -> Array:
        """sup |x*_i' - F_i(x*, u*, p0)|, (n,), and what stays of it in a point where the plan rests."""
        end = end_of(self.loop)
        rest = 0.0 if end is None else self._run(self._field, end.x, end.u).magnitude[:, 0]
        return np.asarray(np.maximum(self.loop.defect, rest))

    @cached_property
    def speed(self) -> Interval:
        """x*' on every cell, (n, N)."""
        own = self._run(self._field, self.cells.x, self.cells.u)
        reach = self.defect[:, None] + 0 * own.lo
        return own + Interval(-reach, reach)

    # -- on the tube -------------------------------------------------------------------------------------------------

    def middle(self) -> tuple[Array, Array, Array]:
        """Floats in the middle of F_x, F_u and E along the plan: (n, n), (n, m), (n, k)."""
        n, m = self.loop.states, self.loop.inputs
        slopes = self._run(self._slopes, self.cells.x, self.cells.u)
        E = self._run(self._E, self.cells.x, self.cells.u)
        both = [0.5 * own.lo.min(axis=1) + 0.5 * own.hi.max(axis=1) for own in (slopes, E)]
        Fz = both[0].reshape(n, n + m)
        return Fz[:, :n], Fz[:, n:], both[1].reshape(n, -1)

    def rho(self, W: Array, U: Array, size: Array) -> Array:
        """What is left where |e| <= W, |delta| <= U, |eta| <= size: through I and the columns of B, (n + m,)."""
        loop, x = self.loop, self.cells.x
        n = loop.states
        weights = np.concatenate([W, U + self.held]) * (1 + 1e-15)
        parts = []
        for level in range(1, _LEVELS + 1):
            share = level / _LEVELS * (1 + 1e-15)
            off = self._off(_wider(x, share * W), _wider(self.cells.u, share * U + self.held))
            parts.append(total(off, weights))
        bent = np.max(np.mean(parts, axis=0), axis=0) * SUMMED
        tube = _wider(x, W)
        gain = self._off(tube, _wider(self.cells.u, U + self.held)).max(axis=0)[:, n:]  # |B(x, p) - B|
        through = self._of_inputs(size)
        moved = total(gain, through) + self._shaken(tube, size)
        sudden = 0.0 if loop.slow else total(self._strangeness, np.ones(1))
        return np.concatenate(
            [(bent + self.defect + sudden + moved) * SUMMED, (self.held + self._slope(W)) * SUMMED]
        )

    def _off(self, x: Interval, u: Interval) -> Array:
        """|F_z - (A, B)| on boxes: (N, n, n + m)."""
        n, m = self.loop.states, self.loop.inputs
        own = self._run(self._slopes, x, u)
        nominal = np.hstack([self.loop.A, self.loop.B]).reshape(-1, 1)
        off = (own - Interval.exact(nominal)).sanitised().magnitude
        return np.ascontiguousarray(off.T).reshape(-1, n, n + m)

    def _of_inputs(self, size: Array) -> Array:
        """|h_j| by input: of components of eta, or of what is sudden; (m,)."""
        found = np.zeros(self.loop.inputs)
        if self.loop.jumps:
            found[:] = self._declared()[0]
        else:
            found[list(self.loop.matched)] = size[: len(self.loop.matched)]
        return found

    def _shaken(self, tube: Interval, size: Array) -> Array:
        """sup |(E(x) - E) w|, (n,): by rows, against a length or against components."""
        k = self.loop.E.shape[1]
        if not k:
            return np.zeros(self.loop.states)
        own = self._run(self._E, tube, _wider(self.cells.u, np.zeros(self.loop.inputs)))
        off = (own - Interval.exact(self.loop.E.reshape(-1, 1))).sanitised().magnitude
        rows = np.max(off.reshape(self.loop.states, k, -1), axis=2)
        gusts = self.loop.gusts
        if gusts.length and not self.loop.sways:
            return np.asarray(np.sqrt(np.sum(rows * rows, axis=1)) * gusts.each[0] * SUMMED + 1e-150)
        return total(rows, gusts.each)

    def _slope(self, W: Array) -> Array:
        """sup |h_j(t, x* + e) - h_j(t, x*)|, (m,)."""
        loop = self.loop
        found = np.zeros(loop.inputs)
        if loop.jumps:
            return found
        if loop.model.h is None:
            length = np.sqrt(np.sum(W * W)) * SUMMED + 1e-150
            return np.asarray(found + self._declared()[1] * length * (1 + 1e-15))
        n = loop.states
        steep = self._h_run(self._h_slopes, _wider(self._timed.x, W)).magnitude
        rows = total(np.ascontiguousarray(steep.reshape(loop.inputs, n + 1, -1)[:, :n].swapaxes(1, 2)), W)
        return np.asarray(np.max(rows, axis=1))

    def _declared(self) -> tuple[float, float, float]:
        """Bounds of |h|, of its slope and of its rate, of an h that is not given otherwise."""
        bounds = self.loop.spec.uncertainty.bounds
        given = (None, None, None) if bounds is None else (bounds.h, bounds.h_x, bounds.h_t)
        h, steep, fast = (np.inf if each is None else fraction_bounds(each)[1] for each in given)
        return h, steep, fast

    # -- the components of eta ---------------------------------------------------------------------------------------

    def sizes(self, W: Array) -> Sizes:
        """Of eta in the order of the columns of H, where |e| <= W."""
        loop = self.loop
        parts = [] if loop.jumps or not loop.matched else [self._uncertainty(W)]
        wind = loop.spec.disturbance
        if wind is not None and wind.rate is not None:
            each = loop.gusts.each
            parts.append((each, np.full(len(each), fraction_bounds(wind.rate)[1]), each))
        if loop.slow and loop.unknown:
            parts.append((self._strangeness[:, 0], self._strange_rate, self._strangeness[:, 0]))
        if not parts:
            nothing = np.zeros(0)
            return Sizes(nothing, nothing, nothing)
        return Sizes(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _uncertainty(self, W: Array) -> tuple[Array, Array, Array]:
        """Of h: its size on the tube, its rate along the plan, its size on the plan at time 0."""
        own = list(self.loop.matched)
        if self.loop.model.h is None:
            h, steep, fast = self._declared()
            speed = self.speed.magnitude
            length = float(np.max(np.sqrt(np.sum(speed * speed, axis=0)))) * SUMMED
            size = np.full(len(own), h)
            return size, np.full(len(own), (fast + steep * length) * (1 + 1e-15)), size
        size = self._h_run(self._h, _wider(self._timed.x, W)).magnitude.max(axis=1)[own]
        return size, self._h_rate[own], self._h_first().magnitude.max(axis=1)[own]

    @cached_property
    def _h_rate(self) -> Array:
        """sup |h_t + h_x x*'| along the plan, (m,)."""
        n, m, timed = self.loop.states, self.loop.inputs, self._timed
        steep = self._h_run(self._h_slopes, timed.x)
        repeats = len(timed) // len(self.cells)
        speed = self.speed[:, np.repeat(np.arange(len(self.cells)), repeats)]
        rows = []
        for j in range(m):
            whole = steep[j * (n + 1) + n]
            for i in range(n):
                whole = whole + steep[j * (n + 1) + i] * speed[i]
            rest = (
                steep[j * (n + 1) + n] if self.loop.afterwards == "rest" else whole
            )  # where x*' = 0, h_t alone
            rows.append(whole.sanitised().hull(rest.sanitised()).magnitude.max())
        return np.array(rows)

    def _h_first(self) -> Interval:
        """h(0, x*(0)), (m, N)."""
        plan = self.loop.plan
        n = self.loop.states
        if isinstance(plan, Family):
            x, count = self.cells.x, len(self.cells)
        else:
            start = Tape(plan.start, ()).run([], ())
            x, count = start[None, :], 1
        now = Interval.exact(np.zeros(count))
        return self._h.run([*(x[:, i] for i in range(n)), now], (count,))

    @cached_property
    def _strangeness(self) -> Array:
        """sup |F_i(x*, u*, p) - F_i(x*, u*, p0)| along the plan, (unknown, 1) or, of all rows, (n, 1)."""
        natural = self._of_strange(self._strange).magnitude.max(axis=1)
        names = [name for name, _ in self.loop.model.parameters]
        slopes = [self._of_strange(derivatives(self._strange, name)).magnitude for name in names]
        reach = 0.5 * (self._parameters[:, 1] - self._parameters[:, 0]) * (1 + 1e-12)
        centred = total(np.stack(slopes, axis=-1), reach).max(axis=1) if names else natural
        found = np.minimum(natural, centred)
        if self.loop.slow:
            return np.asarray(found[:, None])
        every = np.zeros((self.loop.states, 1))
        every[list(self.loop.unknown), 0] = found
        return every

    @cached_property
    def _strange_rate(self) -> Array:
        """sup of how fast that changes along the plan, (unknown,)."""
        rate = steepness(self.loop, len(self.cells))
        if rate is None:
            return np.full(len(self.loop.unknown), np.inf)
        found = np.zeros(len(self.loop.unknown))
        speeds = (*self.speed.magnitude.max(axis=1), *rate)
        names = (*self.loop.model.states, *self.loop.model.inputs)
        for name, speed in zip(names, speeds, strict=True):
            slope = self._of_strange(derivatives(self._strange, name)).magnitude.max(axis=1)
            found = found + np.where(slope > 0, slope * speed, 0.0)
        return np.asarray(found * SUMMED)

    # -- tapes -------------------------------------------------------------------------------------------------------

    def _of_strange(self, expressions: Sequence[Expression]) -> Interval:
        return self._run(Tape(expressions, self._names), self.cells.x, self.cells.u)

    def _run(self, tape: Tape, x: Interval, u: Interval) -> Interval:
        count = len(x.lo)
        values = [each[:, i] for each in (x, u) for i in range(each.lo.shape[1])]
        values += [Interval(np.full(count, low), np.full(count, high)) for low, high in self._parameters]
        return tape.run(values, (count,))

    def _h_run(self, tape: Tape, x: Interval) -> Interval:
        return tape.run([*(x[:, i] for i in range(x.lo.shape[1])), self._timed.t], (len(x.lo),))


def _wider(x: Interval, by: Array) -> Interval:
    """Boxes that are wider by `by` on each side."""
    return x + Interval(-by, by)
