"""What of the loop is not linear, bounded on the tube, and the sizes and rates of what its signals are.

Everything is a supremum over cells of the plan, by mean values: F(x + e) - F(x) - A e = int (F_x(x + a e) - A) da e,
with the integral bounded on `_LEVELS` parts of [0, 1], each on its own box. Trusted: yes.
Implements: theory of the sampled loop, section 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.tape import Tape
from tubecert.expression import derivatives
from tubecert.expression.matrix import jacobian
from tubecert.model import TIME
from tubecert.sampled_loop.cells import cells_of, end_of, in_time, largest_jump, steepness
from tubecert.sampled_loop.matrices import lengths, total
from tubecert.sampled_loop.setting import PLAN_ROUNDING, Loop, driven
from tubecert.trajectory.plan import Family

_LEVELS: Final = 4


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """Suprema of |eta|, |eta'|, |eta(0)|, (r,) each, from above."""

    size: Array
    rate: Array
    first: Array


class Remainders:
    """The suprema of one loop over its plan, split into `windows`.

    Along the plan: `states_above` sup |x*_i| (n,); `inputs_range` inf and sup of u* and `inputs_above` sup |u*_j|, (m,)
    each; `room`: how far each input may go from the plan's, near, infinite where nothing limits it; `steep`: sup
    |u*'_j|, None if u* jumps, and what parameters do along the plan has no rate; `held`: sup |u*_j - ubar_j| while a
    command acts, with the controller's own rounding of the plan (G9).
    """

    def __init__(self, loop: Loop, windows: int) -> None:
        self.loop, self.windows, model = loop, windows, loop.model
        self.cells = cells_of(loop, windows)
        self._timed = in_time(loop, self.cells)
        self._names = (*loop.names, *(name for name, _ in model.parameters))
        known = driven(model.f, model.B, model.inputs)
        rows = zip(jacobian(loop.field, loop.names), model.E or ((),) * loop.states, strict=True)
        self._slopes = Tape([e for row in rows for part in row for e in part], self._names)  # F_x, F_u, E
        self._field = Tape(known, self._names)
        self._strange = [loop.field[i] - known[i] for i in loop.unknown]
        ends = [BoxDomain({name: each}).boxes((name,)) for name, each in model.parameters]
        self._parameters = np.array([(lo[0, 0], hi[0, 0]) for lo, hi in ends]).reshape(-1, 2)
        timed = (*model.states, TIME)
        self._h = Tape(model.h or (), timed)
        self._h_slopes = Tape([e for row in jacobian(model.h or (), timed) for e in row], timed)

        low, high = self.inputs_range = self.cells.u.lo.min(axis=0), self.cells.u.hi.max(axis=0)
        self.states_above = self.cells.x.magnitude.max(axis=0)
        self.inputs_above = np.maximum(-low, high)
        limits = dict(loop.spec.limits)
        least, most = np.array([limits.get(name, (-np.inf, np.inf)) for name in model.inputs], dtype=float).T
        self.room = np.minimum(most - high, low - least)
        self.steep = steepness(loop, len(self.cells))
        self.held = np.asarray((self._holding() + PLAN_ROUNDING * self.inputs_above) * (1 + 1e-15))

    # -- along the plan ----------------------------------------------------------------------------------------------

    def _holding(self) -> Array:
        loop = self.loop
        if loop.hold == "continuous" or (self.steep is None and isinstance(loop.plan, Family)):
            return np.zeros(loop.inputs)
        if self.steep is None:
            return largest_jump(loop)
        span = fraction_bounds(loop.sample_time if loop.hold == "left" else loop.sample_time / 2)[1]
        return np.asarray(self.steep * span)

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

    def middle(self) -> tuple[Array, ...]:
        """Floats in the middle of F_x, F_u and E along the plan: (n, n), (n, m), (n, k)."""
        n, m = self.loop.states, self.loop.inputs
        slopes = self._run(self._slopes, self.cells.x, self.cells.u)
        found = (0.5 * slopes.lo.min(axis=1) + 0.5 * slopes.hi.max(axis=1)).reshape(n, -1)
        return tuple(np.split(found, [n, n + m], axis=1))

    def rho(self, W: Array, U: Array, size: Array) -> Array:
        """What is left where |e| <= W, |delta| <= U, |eta| <= size: through I and the columns of B, (n + m,)."""
        loop, n, z = self.loop, self.loop.states, len(self.loop.names)
        nominal, weights, parts = np.hstack([loop.A, loop.B, loop.E]), np.concatenate([W, U + self.held]), []
        for level in range(1, _LEVELS + 1):
            share = level / _LEVELS * (1 + 1e-15)
            x, u = _wider(self.cells.x, share * W), _wider(self.cells.u, share * U + self.held)
            off = (
                (self._run(self._slopes, x, u) - Interval.exact(nominal.reshape(-1, 1))).sanitised().magnitude
            )
            off = np.ascontiguousarray(off.T).reshape(-1, *nominal.shape)
            parts.append(total(off[:, :, :z], weights))
        bent, widest = np.max(np.mean(parts, axis=0), axis=0), off.max(axis=0)
        blown = total(widest[:, z:], loop.gusts.each) if loop.sways else loop.gusts.weigh(widest[:, z:])
        moved = total(widest[:, n:z], self._of_inputs(size)) + blown
        sudden = np.zeros(n)
        if not loop.slow:
            sudden[list(loop.unknown)] = self._strangeness[0]
        return np.concatenate([bent + self.defect + sudden + moved, self.held + self._slope(W)])

    def _of_inputs(self, size: Array) -> Array:
        """|h_j| by input: of components of eta, or of what is sudden; (m,)."""
        if self.loop.jumps:
            return np.full(self.loop.inputs, self.loop.declared[0])
        found = np.zeros(self.loop.inputs)
        found[list(self.loop.matched)] = size[: len(self.loop.matched)]
        return found

    def _slope(self, W: Array) -> Array:
        """sup |h_j(t, x* + e) - h_j(t, x*)|, (m,)."""
        n, m = self.loop.states, self.loop.inputs
        if self.loop.jumps:
            return np.zeros(m)
        if self.loop.model.h is None:
            return np.full(m, self.loop.declared[1] * lengths(W)[0])
        steep = self._h_run(self._h_slopes, _wider(self._timed.x, W)).magnitude.reshape(m, n + 1, -1)
        return np.asarray(np.max(total(np.ascontiguousarray(steep[:, :n].swapaxes(1, 2)), W), axis=1))

    # -- the components of eta ---------------------------------------------------------------------------------------

    def sizes(self, W: Array) -> Sizes:
        """Of eta in the order of the columns of H, where |e| <= W."""
        loop, wind = self.loop, self.loop.spec.disturbance
        nothing = np.zeros(0)
        parts = [(nothing, nothing, nothing)]
        if loop.matched and not loop.jumps:
            parts.append(self._uncertainty(W))
        if wind is not None and wind.rate is not None:
            each = loop.gusts.each
            parts.append((each, np.full(len(each), fraction_bounds(wind.rate)[1]), each))
        if loop.slow:
            size, rate = self._strangeness
            parts.append((size, rate, size))
        return Sizes(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _uncertainty(self, W: Array) -> tuple[Array, Array, Array]:
        """Of h: its size on the tube, its rate along the plan, its size on the plan at time 0."""
        own = list(self.loop.matched)
        if self.loop.model.h is None:
            h, steep, fast = self.loop.declared
            speed = float(np.max(lengths(self.speed.magnitude.T)))
            size = np.full(len(own), h)
            return size, np.full(len(own), fast + steep * speed), size
        size = self._h_run(self._h, _wider(self._timed.x, W)).magnitude.max(axis=1)
        now = np.zeros(1)
        x, _ = self.loop.plan.enclose(now, now)
        first = self._h.run([*(x[:, i] for i in range(x.lo.shape[1])), Interval.exact(now)], (1,))
        return size[own], self._h_rate[own], first.magnitude[own, 0]

    @cached_property
    def _h_rate(self) -> Array:
        """sup |h_t + h_x x*'| along the plan, (m,); where the plan rests x*' = 0."""
        n, timed = self.loop.states, self._timed
        steep = self._h_run(self._h_slopes, timed.x)
        speed = self.speed[:, np.repeat(np.arange(len(self.cells)), len(timed) // len(self.cells))]
        rows = []
        for j in range(0, len(steep.lo), n + 1):
            still = steep[j + n]
            whole = sum((steep[j + i] * speed[i] for i in range(n)), start=still).sanitised()
            found = whole.hull(still.sanitised()) if self.loop.afterwards == "rest" else whole
            rows.append(found.magnitude.max())
        return np.array(rows)

    @cached_property
    def _strangeness(self) -> tuple[Array, Array]:
        """sup |F_i(x*, u*, p) - F_i(x*, u*, p0)| along the plan, and of how fast that changes, (unknown,) each.

        It is 0 at p0, as its slopes by x and u are: slopes by p bound them as well.
        """
        loop, x, u = self.loop, self.cells.x, self.cells.u
        if not self._strange:
            return np.zeros(0), np.zeros(0)
        rows = [*self._strange, *(e for name in loop.names for e in derivatives(self._strange, name))]
        slopes = [e for name, _ in loop.model.parameters for e in derivatives(rows, name)]
        found = self._run(Tape([*rows, *slopes], self._names), x, u).magnitude
        reach = 0.5 * (self._parameters[:, 1] - self._parameters[:, 0])
        by_slopes = np.moveaxis(found[len(rows) :].reshape(len(reach), len(rows), -1), 0, -1)
        found = np.minimum(found[: len(rows)], total(by_slopes, reach))
        steep = np.full(loop.inputs, np.inf) if self.steep is None else self.steep
        speeds = np.vstack([self.speed.magnitude, np.repeat(steep[:, None], len(x.lo), axis=1)])
        size, moved = found[: len(loop.unknown)], found[len(loop.unknown) :]
        with np.errstate(invalid="ignore"):
            rates = np.where(moved > 0, moved * np.repeat(speeds, len(size), axis=0), 0.0)
        rate = np.sum(rates.reshape(len(speeds), *size.shape), axis=0)
        return size.max(axis=1), rate.max(axis=1)

    # -- tapes -------------------------------------------------------------------------------------------------------

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
