"""The inequalities of the sampled loop, and the one place where its tube becomes certified.

For every output o = c xi + direct terms and every sample k, b_o(k) bounds |o| if every earlier error was inside the
tube; (a) b of e_i < W_i on all of every sample, (b) b of delta_j <= U_j, (c) b of zeta <= Z. Then no first exit is
possible (theory of the sampled loop, section 5). Who proposed tables, tube and recipe does not matter. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert import digits
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array, fraction_bounds
from tubecert.enclosure.outward import number_above, number_below
from tubecert.enclosure.processor import require_ieee
from tubecert.findings import Finding
from tubecert.model import ControlAffineModel, domain_findings
from tubecert.sampled_loop.cells import MOST
from tubecert.sampled_loop.matrices import ROUNDED, UNIT, total
from tubecert.sampled_loop.obstacles import cleared
from tubecert.sampled_loop.record import Cleared, InputUse, Lack, Recipe, Stage, Tables
from tubecert.sampled_loop.remainders import Remainders, Sizes
from tubecert.sampled_loop.responses import Responses
from tubecert.sampled_loop.setting import PLAN_ROUNDING, ROUNDING, Loop
from tubecert.trajectory.make import unending
from tubecert.trajectory.plan import Family
from tubecert.verdict import Verdict

MOST_LAGS: Final = 50_000
MOST_PARTS: Final = 64
_TIMES: Final = 257  # of a plan at which it is looked at, beside its knots
_CAREFUL: Final = Effort(budget=200_000)
_FLUSHED: Final = 1e-35  # lost without subnormal numbers, in z + n <= 400 products and sums
_DIGITS: Final = 7
_INDEX = NDArray[np.intp]


class Boxes(NamedTuple):
    """What is claimed, or what follows, stage by stage: W (g, n) of e, U (g, m) of delta, Z (g, z) of zeta."""

    W: Array
    U: Array
    Z: Array

    @classmethod
    def of(cls, stages: Sequence[Stage], model: ControlAffineModel, *, above: bool) -> Boxes:
        """Of stages, as floats from above or from below."""

        def floats(rows: Sequence[Sequence[Fraction]]) -> Array:
            return np.array([[fraction_bounds(x)[above] for x in row] for row in rows]).reshape(len(rows), -1)

        return cls(
            floats([[own.half_widths[name] for name in model.states] for own in stages]),
            floats([[own.deviations[name] for name in model.inputs] for own in stages]),
            floats([own.memory for own in stages]),
        )


@dataclass(frozen=True, eq=False)
class Inequalities:
    """All b_o(k) of one loop, controller and recipe, for any tube whose stages begin at samples `starts`.

    They are monotone in the tube.
    """

    controller: Tables
    recipe: Recipe
    starts: tuple[int, ...]
    responses: Responses
    remainders: Remainders

    @classmethod
    def made(
        cls, remainders: Remainders, controller: Tables, recipe: Recipe, starts: Sequence[int] = (0,)
    ) -> Inequalities:
        """Those of the loop of `remainders`."""
        sizes = {"lags": recipe.lags, "pieces": recipe.pieces, "panels": recipe.panels}
        made = Responses(remainders.loop, controller, **sizes)
        return cls(controller, recipe, tuple(starts), made, remainders)

    @property
    def loop(self) -> Loop:
        """The loop that they are about."""
        return self.remainders.loop

    @property
    def last(self) -> int:
        """The last sample whose inequality is written down; that of a later one is the same."""
        whole = self.starts[-1] + self.loop.whole + 1 + self.recipe.lags
        return whole if self.loop.samples is None else min(whole, self.loop.samples - 1)

    def of(self, boxes: Boxes) -> Boxes:
        """The bounds that follow where the loop has kept to these boxes so far."""
        b, direct, spread = self.terms(boxes)
        n, m, nodes = self.loop.states, self.loop.inputs, len(self.responses.nodes)
        e = b[:, : n * nodes].reshape(len(b), nodes, n) + direct
        within = np.max(np.maximum(e[:, :-1], e[:, 1:]) + spread, axis=1)
        rest = b[:, n * nodes :]
        rest[0, m:] = 0.0  # (c) is for k >= 1: zeta is 0 at boot
        spans = list(pairwise([*self.starts, self.last + 1]))
        parts = (within, rest[:, :m], rest[:, m:])
        most = (np.array([np.max(own[a:b], axis=0, initial=0.0) for a, b in spans]) for own in parts)
        return Boxes(*(own * (1 + 4 * ROUNDED) for own in most))

    def terms(self, boxes: Boxes) -> tuple[Array, Array, Array]:
        """b of every row (K, R); direct terms at every node (K, nodes, n); what pieces add (K, pieces, n).

        But for roundings; a difference of two sums may be off by those of both.
        """
        own, L, k = self.responses, self.recipe.lags, np.arange(self.last + 1)
        (starts, sizes, slow), lag = self.phases(boxes), np.minimum(k, L)
        widest, e = sizes.max(axis=0), slice(own.passing, own.passing + self.loop.states)
        widest[e] = np.maximum(widest[e], self.loop.start.reach)  # zeta and v are 0 at boot
        b = total(own.now, widest) + self.slow(slow) + self.first(k)
        for start, end, size in zip(starts, [*starts[1:], self.last + 2], sizes, strict=True):
            answers = total(own.past, size[: own.passing])
            newer, older = np.clip(k - start, 0, lag), np.clip(k - end, 0, lag)
            b += answers[newer] - answers[older] + 4 * ROUNDED * answers[newer]
        phase = np.searchsorted(starts, k, side="right") - 1
        core = own.rows.shape[2] - own.eta.shape[2]  # eta stands with its cut
        late = total(np.abs(own.rows[L, :, :core]), sizes[:, own.passing : own.passing + core].T).T
        b[L + 1 :] += late[phase[1 : max(1, len(k) - L)]]  # |r_L| Xi of the sample L before
        acted = (total(each, sizes.T) for each in (own.direct, own.pieces))
        direct, spread = (np.moveaxis(each, -1, 0)[phase] for each in acted)
        return b, direct, spread

    def phases(self, boxes: Boxes) -> tuple[list[int], Array, Sizes]:
        """Parts of time in which one stage lasts and commands of the same stages act: first samples, (g,).

        With all that `Responses` count in each of them, (g, ..), and eta.
        """
        q, off = self.loop.whole, self._rounding(boxes)
        starts = sorted({0, *self.starts, *(k + q + 1 for k in self.starts[1:])})
        ends = [*starts[1:], starts[-1] + 1]
        of = np.searchsorted(self.starts, np.arange(starts[-1] + 2), side="right") - 1
        eta, found = self.remainders.sizes(boxes.W.max(axis=0)), []
        for start, end in zip(starts, ends, strict=True):
            acting = boxes.U[of[max(0, start - q - 1)] : of[end - 1] + 1].max(axis=0)
            W, Z = boxes.W[of[start]], boxes.Z[of[start]]
            rho, v = self.remainders.rho(W, acting, eta.size), np.tile(acting, q + 1)
            found.append(np.concatenate([np.ones(2), off, rho, W, Z, v, eta.size, eta.rate]))
        return starts, np.array(found), eta

    def _rounding(self, boxes: Boxes) -> Array:
        """r_y (n,), r_u (m,), r_z (z,): what the controller's own arithmetic is off by, of every stage (G9)."""
        loop, c, u = self.loop, self.controller, ROUNDING[self.loop.hardware.arithmetic]
        k = c.size + loop.states + 3
        gamma = k * u / (1 - k * u)
        W, Z = boxes.W.max(axis=0), boxes.Z.max(axis=0)
        above, noise = self.remainders.states_above, loop.noise.each
        y = PLAN_ROUNDING * above + 2 * u * (2 * above + W + noise) + _FLUSHED
        seen = W + noise + y
        planned = self.remainders.inputs_above + self.remainders.held
        delta = gamma * (planned + total(np.abs(c.M), Z) + total(np.abs(c.N), seen)) + _FLUSHED
        state = gamma * (total(np.abs(c.F), Z) + total(np.abs(c.G), seen)) + _FLUSHED
        return np.concatenate([y, delta, state])

    def slow(self, sizes: Sizes) -> Array:
        """eta by its rate up to the cut, and by its size from there on (D-cut), (K, R)."""
        rate, first, size = self._cut_apart
        return total(rate, sizes.rate) + total(first, sizes.first) + total(size, sizes.size)

    @cached_property
    def _cut_apart(self) -> tuple[Array, Array, Array]:
        """What |eta'|, |eta(0)| and |eta| count in every row, (K, R, r) each."""
        own, n, cuts = self.responses, self.loop.states, self.recipe.cuts
        k, (R, r) = np.arange(self.last + 1)[:, None, None], own.eta.shape[1:]
        about = [*np.tile(np.arange(n), len(own.nodes)), *range(n, len(cuts))]  # row by row: e, delta, zeta
        cut = np.array(cuts, dtype=np.intp).reshape(len(cuts), r)[about]
        lag = np.minimum(k, self.recipe.lags)
        rows, column = np.arange(R)[None, :, None], np.arange(r)[None, None]
        upto = np.minimum(lag, cut)
        entry = np.abs(own.eta[upto, rows, column])
        begins = (k <= cut) & (k <= self.recipe.lags)  # the row still holds the entry that meets eta(0)
        older, newer = own.size[lag, rows, column], own.size[upto, rows, column]
        return (
            own.rate[upto, rows, column],
            np.where(begins, entry, 0.0),
            np.where(begins, 0.0, entry) + (older - newer + 4 * ROUNDED * older),
        )

    def first(self, k: _INDEX) -> Array:
        """sup |r_k xi_0| of the start, for k <= L; afterwards nothing."""
        own, start, n = self.responses, self.loop.start, self.loop.states
        early = own.rows[: min(len(k), self.recipe.lags + 1), :, :n]
        known = np.abs(early @ start.known.mid[:, 0])
        size = np.abs(early)
        known += size @ (start.known.rad[:, 0] + start.box) + 64 * UNIT * (size @ start.known.magnitude[:, 0])
        if start.length:
            known += np.sqrt(np.sum(size * size, axis=-1)) * start.length
        found = np.zeros((len(k), own.rows.shape[1]))
        found[: len(early)] = known
        return found


class Checked(NamedTuple):
    """The verdict on stages and a recipe, with what else is proven or missing, as a result has it."""

    verdict: Verdict
    inputs: tuple[InputUse, ...] = ()
    clearance: tuple[Cleared, ...] = ()
    lacks: tuple[Lack, ...] = ()


def refuted(loop: Loop) -> Checked | None:
    """Where a plan that is known leaves the safe set, at a time that is looked at; None if nowhere, or of others."""
    plan = loop.plan
    if isinstance(plan, Family) or not loop.spec.trajectory.known:
        return None
    last = 0.0 if plan.horizon is None else fraction_bounds(plan.horizon)[0]
    knots = () if loop.knots is None else map(float, loop.knots.t)
    t = np.minimum([*np.linspace(0.0, last, _TIMES), *knots], last)
    x, lacks = plan.enclose(t, t)[0], []
    ends = zip(loop.model.states, x.lo.T, x.hi.T, loop.spec.safe_set, strict=True)
    for name, lo, hi, (least, most) in ends:
        k, j = np.argmin(hi), np.argmax(lo)
        goes, end, at = (hi[k], least, t[k]) if float(hi[k]) < least else (lo[j], most, t[j])
        if float(hi[k]) < least or float(lo[j]) > most:
            lacks.append(Lack(kind="plan", where=name, needed=float(goes), allowed=float(end), at=float(at)))
    return Checked(verdict=Verdict.REFUTED, lacks=tuple(lacks)) if lacks else None


def check(loop: Loop, controller: Tables, stages: Sequence[Stage], recipe: Recipe) -> Checked:
    """Whether the loop keeps to the stages, for everything that the specification lets happen."""
    require_ieee()
    if not _sound(loop, controller, stages, recipe):
        return Checked(verdict=Verdict.UNDECIDED, lacks=(Lack(kind="not_proven"),))
    starts = [own.start for own in stages]
    inequalities = Inequalities.made(Remainders(loop, recipe.windows), controller, recipe, starts)
    above, below = (Boxes.of(stages, loop.model, above=side) for side in (True, False))
    with np.errstate(all="ignore"):  # what is not finite bounds nothing
        found = inequalities.of(above)
    lacks = [*_short(loop, found, below), *_domain(loop, inequalities, above), *_wishes(loop, stages)]
    lacks += [Lack(kind="undefined", where=item.message) for item in undefined(loop)]
    if loop.slow and loop.unknown and inequalities.remainders.steep is None:
        lacks.append(Lack(kind="not_proven"))
    inputs, over = _inputs(loop, inequalities.remainders, above)
    clearance = cleared(loop, above.W, starts)
    blocked = [
        Lack(kind="obstacle", where=str(own.index + 1))
        for own in clearance
        if own.verdict is not Verdict.CERTIFIED and loop.spec.obstacles[own.index].decides
    ]
    lacks += [*over, *blocked]
    verdict = Verdict.UNDECIDED if lacks else Verdict.CERTIFIED
    return Checked(verdict=verdict, inputs=inputs, clearance=clearance, lacks=tuple(lacks))


def _sound(loop: Loop, controller: Tables, stages: Sequence[Stage], recipe: Recipe) -> bool:
    """Whether everything has the form that the theorem asks for."""
    n, m, z, r = loop.states, loop.inputs, controller.size, loop.H.shape[1]
    starts, shapes = [own.start for own in stages], {"F": (z, z), "G": (z, n), "M": (m, z), "N": (m, n)}
    tables = [(getattr(controller, name), shape) for name, shape in shapes.items()]
    return (
        all(own.shape == shape and (own.astype(np.float32) == own).all() for own, shape in tables)
        and loop.slow == (recipe.parameters == "slow")
        and not (isinstance(loop.plan, Family) and loop.afterwards != "nothing")
        and 1 <= recipe.lags <= MOST_LAGS
        and 1 <= recipe.windows <= MOST
        and 1 <= recipe.pieces <= MOST_PARTS
        and 1 <= recipe.panels <= MOST_PARTS
        and starts[:1] == [0]
        and all(a < b for a, b in pairwise(starts))
        and (loop.samples is None or starts[-1] < loop.samples)
        and all(len(own.memory) == z for own in stages)
        and len(recipe.cuts) == n + m + z
        and all(len(own) == r and all(0 <= cut <= recipe.lags for cut in own) for own in recipe.cuts)
        and all(np.isfinite(own).all() for own in (loop.A, loop.B, loop.E))
    )


def _short(loop: Loop, found: Boxes, claimed: Boxes) -> list[Lack]:
    """(a), (b), (c): strict for the error, which is what a first exit is about."""
    wide = ~(found.W < claimed.W).all(axis=0)
    if not wide.any() and all((own <= most).all() for own, most in zip(found[1:], claimed[1:], strict=True)):
        return []
    where = loop.model.states[int(np.argmax(wide))] if wide.any() else ""
    return [Lack(kind="no_fixed_point", where=where)]


def undefined(loop: Loop) -> list[Finding]:
    """What is not proven to be defined on the safe set, or at a time that matters; a plan that does not go on."""
    return unending(loop.spec, loop.plan.knots) or domain_findings(loop.spec, loop.times(), _CAREFUL)


def _domain(loop: Loop, inequalities: Inequalities, boxes: Boxes) -> list[Lack]:
    """(d): the tube lies in the safe set, on which everything is defined."""
    W = boxes.W.max(axis=0)
    cells = inequalities.remainders.cells
    lacks = []
    for i, (name, (low, high)) in enumerate(zip(loop.model.states, loop.spec.safe_set, strict=True)):
        least, most = number_below(cells.x.lo[:, i].min() - W[i]), number_above(cells.x.hi[:, i].max() + W[i])
        if not (least >= fraction_bounds(low)[1] and most <= fraction_bounds(high)[0]):
            over = max(float(low) - least, most - float(high))
            lacks.append(Lack(kind="safe_set", where=name, needed=float(over) if np.isfinite(over) else None))
    return lacks


def _wishes(loop: Loop, stages: Sequence[Stage]) -> list[Lack]:
    """Half-widths that were asked for, of states and outputs, and are not met."""
    states, lacks = loop.model.states, []
    weights = {name: {name: Fraction(1)} for name in states}
    weights |= {output.name: dict(zip(states, output.row, strict=True)) for output in loop.spec.outputs}
    for name, wish in loop.spec.tube.half_widths:
        shares = weights[name].items()
        most = max(sum(abs(share) * own.half_widths[state] for state, share in shares) for own in stages)
        if most > wish:
            lacks.append(Lack(kind="wish", where=name, needed=float(most), allowed=float(wish)))
    return lacks


def _inputs(loop: Loop, remainders: Remainders, boxes: Boxes) -> tuple[tuple[InputUse, ...], list[Lack]]:
    """What every input takes, and which of them leaves its limits."""
    limits, room = dict(loop.spec.limits), remainders.room
    low, high = remainders.inputs_range
    U = boxes.U.max(axis=0) + PLAN_ROUNDING * remainders.inputs_above
    uses, lacks = [], []
    for j, name in enumerate(loop.model.inputs):
        reach = number_above(U[j])
        least, most = number_below(low[j] - reach), number_above(high[j] + reach)
        ends = Fraction(digits.down(least, _DIGITS)), Fraction(digits.up(most, _DIGITS))
        given = limits.get(name)
        uses.append(InputUse(input=name, range=ends, limits=given))
        if given is not None and not (given[0] <= ends[0] and ends[1] <= given[1]):
            lacks.append(Lack(kind="inputs", where=name, needed=float(U[j]), allowed=float(room[j])))
    return tuple(uses), lacks
