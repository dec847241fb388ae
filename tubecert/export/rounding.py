"""How much the arithmetic of a controller can lose: a bound of every error of its programs. Trusted.

In: a `Controller` and the type it computes in. Out: the numbers of theorem H-R (theory 8.11), each an upper bound.
Every operation is followed twice: what it gives in exact arithmetic lies in an interval, and what a computer gives
differs from that by an error at most, both rounded outward. Nothing is assumed of how errors cancel.
Assumed, and said in the files: IEEE 754, rounded to nearest, every operation in its own type or fused with the next;
functions of math.h within 4 units in the last place (sqrt, by IEEE 754, within half a unit).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Final

import numpy as np

from tubecert.conditions.hardware import Rounding
from tubecert.coordinates import inverse
from tubecert.enclosure import interval
from tubecert.enclosure.interval import Array, Interval, sqrt
from tubecert.enclosure.outward import up
from tubecert.export.blocks import LEAST_SIZE
from tubecert.export.controller import Controller, Pieces
from tubecert.export.followed import (
    FLOATS,
    Float,
    Followed,
    UncoveredError,
    by_pieces,
    combined,
    floats_of,
    frobenius,
    intervals_of,
    known_by_size,
    largest_of,
    length_of,
    over_pieces,
    printed,
    size_of,
    steepest,
)
from tubecert.export.lookups import followed as looked_up
from tubecert.export.prediction import Predicted, off
from tubecert.export.program import GREATEST, LEAST, TABLE, Program, Step
from tubecert.spec import Arithmetic

_LIBRARY: Final = 8  # units that a function of math.h may be off: 4 in the last place
_GAUSS: Final = 2016000  # of the error of Gauss's rule with three nodes: f^(6) length^6/2016000 of the mean
_MOST_SAMPLES: Final = 2**32 - 1
_PIECES: Final = 64  # of the horizon, along which a plan is followed


def rounding_of(controller: Controller, arithmetic: Arithmetic) -> Rounding:
    """The numbers of theorem H-R for exported code; raises `UncoveredError` where none are derived."""
    with np.errstate(all="ignore"):
        return _Analysis(controller, FLOATS[arithmetic]).rounding()


def within(controller: Controller, arithmetic: Arithmetic) -> bool:
    """Whether the certificate of a controller allows for what its code can lose; raises `UncoveredError`."""
    own, lost = rounding_of(controller, arithmetic), controller.lost
    return lost is not None and all(getattr(own, each) <= getattr(lost, each) for each in Rounding.__slots__)


class _Analysis:
    """The programs of a controller, one after the other, on all that can go in."""

    def __init__(self, controller: Controller, real: Float) -> None:
        if controller.swept is not None:
            raise UncoveredError("geodesics that are computed", "take a constant metric")
        if controller.pieces is not None and not controller.pieces.continuous:
            raise UncoveredError("a plan through knots whose input jumps", "write interpolation: linear")
        self.c, self.real, self.u = controller, real, Interval.of(real.unit)
        self.eta, self.estimate = Interval.of(real.least), Interval.of(controller.estimate)
        self.m, self.n = len(controller.inputs), len(controller.states)
        W = inverse([list(row) for row in controller.metric])
        self.widths = [sqrt(Interval.of(W[i][i])) * Interval.of(controller.reach) for i in range(self.n)]
        self.norm_M, self.norm_W = frobenius(controller.metric), frobenius(W)

    def rounding(self) -> Rounding:
        """r_a, r_u, r_q and r_p."""
        xs, us = self._plan()
        law = self._law(xs, us)
        return Rounding(
            feedback=printed(law.lost),
            input=printed(law.beside + self._written(law, us) + self._clipped()),
            estimate=printed(self._estimated(xs, law, us)),
            prediction=self._predicted(xs, law, us),
        )

    def _predicted(self, xs: Sequence[Followed], law: _Law, us: Sequence[Followed]) -> Fraction:
        if not self.c.predicts:
            return Fraction(0)
        wrong, ends = law.beside + self._written(law, us), self.c.horizon or Fraction(0)
        near, narrow = self._near(xs), min(self.widths, key=lambda width: float(width.lo))
        given = Predicted(near=near, us=us, feedback=law.feedback, wrong=wrong, narrow=narrow, horizon=ends)
        return printed(off(self.c, given, self._run))

    # -- what goes in

    @property
    def _horizon(self) -> Fraction:
        if self.c.horizon is None:
            raise UncoveredError(
                "a plan that moves without end: the time itself loses digits", "give trajectory.horizon"
            )
        if self.c.horizon >= _MOST_SAMPLES * self.c.sample_time:
            raise UncoveredError("a plan of more samples than the code counts")
        return max(self.c.horizon, self.c.sample_time)

    def _late(self) -> Interval:
        """How far a time is off that is at most the horizon.

        The counter, Ts, their product and the horizon are rounded, and so are a node of Gauss's rule (a number of 20
        digits) and its sum.
        """
        return 9 * self.u * Interval.of(self._horizon) + 4 * self.eta

    def _time(self, plan: Program) -> Followed:
        """The time of a sample, which is counted and multiplied; the code stops at the horizon."""
        if not _reads_input(plan):
            return Followed(value=Interval.exact(np.zeros(1)), error=np.zeros(1))
        late = self._late()
        knots = np.linspace(0.0, float(up(float(self._horizon))), _PIECES + 1)
        return Followed(value=Interval(knots[:-1], knots[1:]), error=np.full(_PIECES, float(late.hi)))

    def _plan(self) -> tuple[list[Followed], list[Followed]]:
        if self.c.pieces is not None:
            return self._through_knots(self.c.pieces)
        if self.c.plan is None:
            raise UncoveredError("a plan of no known form")
        t = self._time(self.c.plan)
        out = self._run(self.c.plan, {"t": [t]})
        return [by_pieces(t, x) for x in out["x"]], [by_pieces(t, u) for u in out["u"]]

    def _through_knots(self, plan: Pieces) -> tuple[list[Followed], list[Followed]]:
        """Piece by piece; where a time near a knot is taken for one in the next piece, x* and u* go on continuously."""
        late = self._late()
        start, length = intervals_of(plan.start), intervals_of(plan.length)
        begun = late + (self.u * Interval.exact(start.magnitude) + self.eta)
        r = Interval(-2 * begun.hi, (length + 2 * begun).hi)
        since = self._rounded(r, begun)
        rows = [
            [self._polynomial(since, late, values[:, i], off[:, i]) for i in range(values.shape[1])]
            for values, off in (
                (floats_of(plan.x), floats_of(plan.x_off)),
                (floats_of(plan.u), floats_of(plan.u_off)),
            )
        ]
        return rows[0], rows[1]

    def _polynomial(self, r: Followed, late: Interval, values: Array, off: Array) -> Followed:
        """a_0 + r (a_1 + r (a_2 + ...)), of every piece; `values` (K, powers) are floats, `off` bounds their errors."""
        powers = [
            Followed(
                value=Interval.exact(values[:, k]) + Interval(-off[:, k], off[:, k]),
                error=(
                    Interval.exact(off[:, k]) + self.u * Interval.exact(np.abs(values[:, k])) + self.eta
                ).hi,
            )
            for k in range(values.shape[1])
        ]
        found = powers[-1]
        slope = Interval.exact(np.zeros(len(values)))
        for k in range(len(powers) - 2, -1, -1):
            slope = slope * r.value + found.value
            found = self._rounded(*combined("mul", r, found))
            found = self._rounded(*combined("add", powers[k], found))
        wrong = 4 * late * Interval.exact(float(np.max(slope.sanitised().magnitude)))
        worst = np.full_like(found.error, np.max(found.error))  # of whichever piece the code takes
        return Followed(value=found.value, error=(Interval.exact(worst) + wrong).hi)

    def _near(self, xs: Sequence[Followed]) -> list[Followed]:
        """What may be measured: in the tube around x*, and without an error, as it is what the code has."""
        return [
            Followed(value=x.value + Interval(-w.hi, w.hi), error=0 * x.error)
            for x, w in zip(xs, self.widths, strict=True)
        ]

    # -- the feedback

    def _law(self, xs: Sequence[Followed], us: Sequence[Followed]) -> _Law:
        """r_a, and what kappa may be above du d: theory 8.11, (H.37), (H.38)."""
        y = self._near(xs)
        f = self._run(self.c.drift, {"x": y})["f"]
        vs = self._run(self.c.flow, {"x": xs, "u": us})["v"]
        found = self._run(self.c.law, {"y": y, "f": f, "xs": xs, "vs": vs, "us": us}, apart=("y", "xs"))
        z, c, (excess,), (square, *_) = (found[name] for name in ("z", "c", "excess", "told"))
        e_z, e_c, e_a = length_of(z), length_of(c), Interval.exact(excess.error)
        C = size_of(c)
        theta = 2 * (self.m + 8) * self.u + self.m * self.eta / Interval.of(LEAST_SIZE)
        nu = (2 * self.n + 4) * self.u * self.norm_M * self.norm_W
        if not float(nu.hi) < 0.5:
            raise UncoveredError("the metric, in this type: its distances have no digit that is right")
        du, reach = Interval.of(self.c.feedback_gain), Interval.of(self.c.reach)
        off = sqrt(self.norm_M) * e_z
        lost = sqrt(self.eta * (self.n + 2) ** 2 * (1 + self.norm_M) * (1 + reach * reach * self.norm_W))
        beyond = du * (off + (nu + 6 * self.u) * (reach + off) + lost)  # e_l, (H.38)
        L = du * reach + beyond
        if not bool(np.all(beyond.hi <= (du * reach).lo)):
            raise UncoveredError("the feedback, in this type: its limit has no digit that is right")
        least = sqrt(Interval.of(LEAST_SIZE))
        self._require_no_overflow((C * C, (L + excess.most) / least, square.most))
        # a share and its product with c may underflow
        above = beyond + theta * L + self.eta * (2 * C + 2 * self.m + 4)
        r_a = e_a + L * (7 * e_c + 4 * theta * (C + e_c)) + 2 * C * beyond + 2 * L * least + C * above
        return _Law(lost=largest_of(r_a), beside=largest_of(above), feedback=largest_of(L + above))

    def _require_no_overflow(self, sizes: Sequence[Interval]) -> None:
        """Of what (H.37) computes after c and alpha/2."""
        if not all(bool(np.all(x.sanitised().hi < self.real.most)) for x in sizes):
            raise UncoveredError(
                "a feedback that overflows in this type; other units of the metric may serve"
            )

    def _written(self, law: _Law, us: Sequence[Followed]) -> Interval:
        """u* and the two sums that make the input of kappa, u* and the estimate."""
        most = law.feedback + largest_of(size_of(us)) + self.estimate
        return largest_of(length_of(us)) + 3 * self.u * (most + most) + 4 * self.m * self.eta

    def _clipped(self) -> Interval:
        """The projection: of a box its ends are rounded, of a ball the length, the share and the product."""
        square = self.m * self.estimate * self.estimate
        self._require_no_overflow((square,))
        # a length of which the square underflows may not be clipped
        unseen = 2 * sqrt((self.m + 2) * self.eta)
        return (self.m + 8) * self.u * self.estimate + 4 * self.m * self.eta + unseen

    # -- the estimate

    def _estimated(self, xs: Sequence[Followed], law: _Law, us: Sequence[Followed]) -> Interval:
        """r_q: all that one sample adds to q, over th."""
        y = self._near(xs)
        f = self._run(self.c.drift, {"x": y})["f"]
        pieces = len(y[0].error)
        # what was measured a sample before may lie in the piece before
        last_y, last_f = [over_pieces(x) for x in y], [over_pieces(x) for x in f]
        held = law.feedback + largest_of(size_of(us)) + 2 * self.estimate
        acted = [known_by_size(held, pieces) for _ in range(self.m)]
        given = {"held": acted, "before": acted}
        if not self.c.adds_plan:
            given["played"] = self._played(us, self._written(law, us))
        mean = self._run(self.c.applied, given)["mean"]
        q = [known_by_size(self.estimate, pieces) for _ in range(self.m)]
        seen = {"y": y, "f": f, "last_y": last_y, "last_f": last_f}
        apart = ("y", "last_y") if self.c.moves else None
        new = self._run(self.c.estimator, {**seen, "q": q, "mean": mean}, apart)["q"]
        share = Interval.of(self.c.share)
        # th and pi are decimals of 50 digits at least
        return largest_of(length_of(new) * (1 + Interval.of(Fraction(1, 10**9)))) / share

    def _played(self, us: Sequence[Followed], written: Interval) -> list[Followed]:
        """The mean of u* over a sample; what acted differs from u* by what is `written` at most."""
        if self.c.pieces is not None:
            means = [self._mean_through_knots(self.c.pieces, u) for u in us]
        elif self.c.gauss is not None and self.c.bend is not None:
            means = self._mean_by_gauss(self.c.gauss, self.c.bend, us)
        else:
            raise UncoveredError("the mean of a feedforward that moves within a sample")
        return [replace(x, error=(Interval.exact(x.error) + written).hi) for x in means]

    def _mean_by_gauss(self, gauss: Program, bend: Program, us: Sequence[Followed]) -> list[Followed]:
        """Its error is Ts^6/2016000 times the sixth derivative of u*."""
        nodes = [over_pieces(u) for u in us]
        found = self._run(gauss, {"a": nodes, "b": nodes, "c": nodes})["mean"]
        bends = self._run(bend, {"t": [self._time(bend)]})["u"]
        share = Interval.of(self.c.sample_time**6 / _GAUSS)
        return [
            replace(
                x,
                error=(Interval.exact(x.error) + share * Interval.exact(over_pieces(b).value.magnitude)).hi,
            )
            for x, b in zip(found, bends, strict=True)
        ]

    def _mean_through_knots(self, plan: Pieces, u: Followed) -> Followed:
        """Shares of a sample times u* in their middles: theory (H.43)."""
        late, passes = self._late(), plan.most
        knots = [*plan.start, plan.start[-1] + plan.length[-1]]
        shortest = Interval.of(min(b - a for a, b in pairwise(knots))) - 2 * late
        sample = Interval.of(self.c.sample_time) + 2 * late
        # of pieces of this length a sample meets no more than that
        if not (shortest.lo > 0 and (sample / shortest).hi < passes - 1 and (4 * late).hi < sample.lo):
            raise UncoveredError("times between knots, in this type: they have no digit that is right")
        own = over_pieces(u)
        theta = 2 * (passes + 6) * self.u
        if not float(theta.hi) < 0.5:
            raise UncoveredError("the mean of a feedforward through so many knots")
        lost = theta * own.most + 2 * passes * self.eta * (own.most + 1)
        return replace(own, error=(2 * Interval.exact(own.error) + lost).hi)

    # -- steps

    def _run(
        self, program: Program, given: Mapping[str, Sequence[Followed]], apart: tuple[str, str] | None = None
    ) -> dict[str, list[Followed]]:
        """What comes out of a program; `apart`: vectors whose entries differ by the half-widths at most."""
        memory: list[Followed] = []
        for step in program.steps:
            found = self._step(program, step, memory, given)
            if apart is not None and step.operation == "sub":
                args = [program.steps[p] for p in step.places]
                found = self._moved(found, args) if apart[1] == "last_y" else self._met(found, args, apart)
            memory.append(found)
        ports = (*program.outputs, *program.marked)
        return {port.name: [memory[place] for place in port.places] for port in ports}

    def _met(self, found: Followed, args: Sequence[Step], apart: tuple[str, str]) -> Followed:
        """y_i - x*_i lies within the half-width."""
        first, second = args
        names = (first.name, second.name) if {first.operation, second.operation} == {"input"} else None
        if names != apart or first.index != second.index:
            return found
        w = self.widths[first.index].hi
        return Followed(
            value=Interval(np.maximum(found.value.lo, -w), np.minimum(found.value.hi, w)), error=found.error
        )

    def _moved(self, found: Followed, args: Sequence[Step]) -> Followed:
        """y_i and the one of a sample before are near to each other, and are what the code has."""
        first, second = args
        if (first.name, second.name) != ("y", "last_y") or first.index != second.index:
            return found
        w = float(Interval.of(self.c.moves[first.index]).hi)
        value = Interval(np.maximum(found.value.lo, -w), np.minimum(found.value.hi, w))
        return self._rounded(value, Interval.exact(np.zeros_like(found.error)))

    def _step(
        self,
        program: Program,
        step: Step,
        memory: Sequence[Followed],
        given: Mapping[str, Sequence[Followed]],
    ) -> Followed:
        if step.operation == "input":
            return given[step.name][step.index]
        if step.operation == "constant":
            off = Interval.of(abs(step.value - self.real.near(step.value)))
            return Followed(value=Interval.of(step.value), error=np.asarray(off.hi))
        args = [memory[place] for place in step.places]
        if step.operation == "neg":
            return Followed(value=-args[0].value, error=args[0].error)
        if step.operation == "choose":
            return self._chosen(step.name, args[0], args[1])
        if step.name.startswith(TABLE):
            return looked_up(program.table(step), args[0], self.real, self._rounded)
        if step.operation == "call":
            found = self._called(step.name, args[0])
            least = (args[0].value - Interval.exact(args[0].error)).lo
            clamped = program.steps[step.places[0]].name == GREATEST  # never below 0, whatever the rounding
            sure = clamped or step.name != "sqrt" or bool(np.all(least >= 0))
            return found if sure else replace(found, error=found.error + np.inf)
        return self._rounded(*combined(step.operation, args[0], args[1]))

    def _rounded(self, value: Interval, error: Interval, units: int = 1) -> Followed:
        """With the rounding of the operation itself."""
        most = Interval.exact(value.magnitude) + error
        whole = error + units * self.u * most + units * self.eta
        sure = np.asarray(most.hi) < self.real.most  # of what overflows, and of NaN, nothing is known
        return Followed(value=value, error=np.where(sure, whole.hi, np.inf))

    def _chosen(self, name: str, a: Followed, b: Followed) -> Followed:
        """The lesser or the greater of two moves by no more than they do; of other choices nothing is asked."""
        error = np.maximum(a.error, b.error)
        x, y = a.value, b.value
        if name == LEAST:
            return Followed(value=Interval(np.minimum(x.lo, y.lo), np.minimum(x.hi, y.hi)), error=error)
        if name == GREATEST:
            return Followed(value=Interval(np.maximum(x.lo, y.lo), np.maximum(x.hi, y.hi)), error=error)
        return Followed(value=Interval(-np.inf, np.inf), error=error + np.inf)

    def _called(self, name: str, a: Followed) -> Followed:
        value, off = getattr(interval, name)(a.value), Interval.exact(a.error)
        wide = Interval((a.value - off).lo, (a.value + off).hi)
        error = Interval.exact(steepest(name, wide)) * off
        if name == "sqrt":
            # |sqrt(p) - sqrt(q)| <= sqrt(|p - q|), where the slope has no bound
            error = Interval.exact(np.fmin(error.sanitised().hi, sqrt(off).hi))
        return self._rounded(value, error, 1 if name == "sqrt" else _LIBRARY)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Law:
    """r_a; what kappa is above du d at most; and a bound of |kappa|."""

    lost: Interval
    beside: Interval
    feedback: Interval


def _reads_input(program: Program) -> bool:
    """Whether anything but what goes in is made of what goes in."""
    read = {place for step in program.steps for place in step.places}
    written = {place for port in program.outputs for place in port.places}
    given = {place for port in program.inputs for place in port.places}
    return bool(given & (read | written))
