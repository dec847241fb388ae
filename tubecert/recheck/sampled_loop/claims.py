"""All claims of a certificate of a sampled loop in their order, each examined again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property, partial
from math import ceil

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.cover import Outcome
from tubecert.recheck.cover import Range as Ends
from tubecert.recheck.examination import Claim
from tubecert.recheck.metric import CONFIRMED, smooth, stated, together
from tubecert.recheck.planned import serves
from tubecert.recheck.reading import TIME
from tubecert.recheck.sampled_loop.conditions import Inequalities, phases_of
from tubecert.recheck.sampled_loop.exponential import column, joined, sizes
from tubecert.recheck.sampled_loop.held import single
from tubecert.recheck.sampled_loop.loop import Loop
from tubecert.recheck.sampled_loop.obstacles import cleared
from tubecert.recheck.sampled_loop.record import Certificate, InputUse, Proven, Result
from tubecert.recheck.sampled_loop.remainders import PLAN, Remainders, Size, Slow
from tubecert.recheck.sampled_loop.rows import Ground, Problem
from tubecert.recheck.sampled_loop.windows import Course, course_of
from tubecert.recheck.specified.numbers import Range
from tubecert.recheck.specified.trajectory import Expressed, Planned
from tubecert.recheck.times import time_range

_ROUNDING = {"single": Fraction(1, 2**24), "double": Fraction(1, 2**53)}
_FLUSHED = Fraction(1, 10**35)  # what a computer loses that has no subnormal numbers
_SECOND = 1 + Fraction(1, 2**20)  # rounding of what is a rounding already
ROWS = 53  # bits, in which rows are carried


def of(certificate: Certificate, budget: int) -> Iterator[Claim]:
    """Every claim; of a result that is not certified, only that it is what was written, for this specification."""
    same, result = certificate.stated_hash == certificate.hash, certificate.result
    yield Claim("the hash is that of the result", None, lambda: stated(same, "something was changed"))
    repeated = (
        (given == own, f"{path} is not what the specification has")
        for path, (given, own) in result.repeated.items()
    )
    yield Claim("the specification and what repeats it", None, lambda: _first_wrong(repeated))
    if result.verdict == "certified" and result.proven is not None:
        yield from _of_certified(Case(result, result.proven, budget))


def _of_certified(case: Case) -> Iterator[Claim]:
    result, proven, spec = case.result, case.proven, case.result.specification
    yield Claim("the verdict follows from what is certified", None, lambda: _first_wrong(_follows(result)))
    yield Claim("tables are numbers of single precision", None, lambda: _single(proven, spec.controller))
    yield Claim("the plan is that of the specification, and lasts", None, case.plan)
    yield Claim("f, B, E, h and the plan are smooth", None, case.smooth)
    yield Claim("recipe: parameters and cuts are of this loop", None, case.fits)
    for i, name in enumerate(spec.plant.states):
        yield Claim(f"the tube of {name} lies in the safe set", None, partial(case.inside, i))
    yield Claim("what acts on the loop is bounded", None, case.known)
    outputs = [
        *(f"|{name} - {name}*| inside the tube" for name in spec.plant.states),
        *(f"what is added to {name}" for name in spec.plant.inputs),
        *(f"memory {j + 1} of the controller" for j in range(proven.F.nrows())),
    ]
    for f, name in enumerate(outputs):
        yield Claim(name, None, partial(case.output, f), ROWS)
    for own in result.inputs:
        yield Claim(f"{own.name} keeps to its range", None, partial(case.keeps, own))
    for index, verdict in result.clearance:
        if verdict == "certified":
            yield Claim(f"the tube keeps away from obstacle {index + 1}", None, partial(case.cleared, index))
    for name, most in spec.half_widths.items():
        yield Claim(f"half-width of {name} <= {float(most):.6g}", None, partial(case.met, name, most))


def _first_wrong(statements: Iterator[tuple[bool, str]]) -> Outcome:
    return next((stated(False, why) for holds, why in statements if not holds), CONFIRMED)


def _follows(result: Result) -> Iterator[tuple[bool, str]]:
    spec = result.specification
    yield not result.lacks, "something is lacking"
    names = tuple(own.name for own in result.inputs)
    yield names == spec.plant.inputs, "inputs are not those of the specification"
    for own in result.inputs:
        yield own.limits == spec.limits.get(own.name), f"the limits of {own.name} are not the specification's"
        inside = own.limits is None or (own.limits[0] <= own.range[0] and own.range[1] <= own.limits[1])
        yield inside, f"{own.name} is not within its limits"
    indices = [index for index, _ in result.clearance]
    yield indices == list(range(len(spec.obstacles))), "clearance has not one entry for every obstacle"
    for (_, verdict), obstacle in zip(result.clearance, spec.obstacles, strict=True):
        yield verdict == "certified" or not obstacle.decides, "an obstacle that decides is not cleared"


def _single(proven: Proven, controller: str) -> Outcome:
    flat = [float(x) for table in (proven.F, proven.G, proven.M, proven.N) for x in table.entries()]
    if controller == "none" and (proven.F.nrows() or any(flat)):
        return stated(False, "there is a controller, and none was asked for")
    return stated(all(single(x) == x for x in flat), "an entry is no number of single precision")


class Case:
    """What the claims of one certificate have in common, made when it is first needed."""

    def __init__(self, result: Result, proven: Proven, budget: int) -> None:
        self.result, self.proven, self._budget = result, proven, budget
        self._spec = result.specification

    @cached_property
    def course(self) -> Course:
        """The plan."""
        return course_of(self._spec, self.result.plan)

    @cached_property
    def remainders(self) -> Remainders:
        """What is not linear."""
        own, recipe = self.proven, self.proven.recipe
        return Remainders(self.course, (own.A, own.B, own.E), recipe.windows, slow=recipe.slow)

    @cached_property
    def _slow(self) -> list[Slow]:
        """Slow signals where e is in the boxes of all stages."""
        widest = [max(own) for own in zip(*(own.half_widths for own in self.proven.stages), strict=True)]
        return self.remainders.slow(list(map(exact, widest)))

    @cached_property
    def inequalities(self) -> Inequalities:
        """Of this loop."""
        machine, own, n = self._spec.hardware, self.proven, len(self._spec.plant.states)
        H = arb_mat(n, len(self._slow), [eta.column[i] for i in range(n) for eta in self._slow])
        loop = Loop(own.A, own.B, H, own.F, own.G, own.M, own.N, machine.sample_time, machine.delay)
        noise, waiting, grounds = Size.of(machine.noise, n), loop.shape[3], []
        for begin, stage, acting in phases_of(own.stages, waiting):
            W, Z, U = (list(map(exact, sizes_)) for sizes_ in (stage.half_widths, stage.memory, acting))
            box = [*W, *Z, *U * waiting, *(eta.size for eta in self._slow)]
            rho = self.remainders.rho(W, U, self._slow)
            grounds.append(Ground(begin, stage, rho, self._rounding(loop, noise, W, Z), box))
        last, horizon = own.stages[-1].start + loop.whole + 1 + own.recipe.lags, self.course.horizon
        if horizon is not None:
            last = min(last, ceil(horizon / machine.sample_time) - 1)
        winds = self.remainders.sudden()
        problem = Problem(loop, noise, winds, self._slow, *self._start(), grounds, own.recipe.lags, last)
        return Inequalities(problem, own.recipe)

    def _rounding(self, loop: Loop, noise: Size, W: Sequence[Ball], Z: Sequence[Ball]) -> list[Ball]:
        """What dy (n), u (m) and zeta (z) are off by, (D.8)."""
        own, u, (n, _, z, _, _) = self.remainders, _ROUNDING[self._spec.hardware.arithmetic], loop.shape
        c, lost = (z + n + 3) * u, exact(_FLUSHED)
        measured = [
            (exact(PLAN) * x + exact(2 * u) * (2 * x + w + s)) * exact(_SECOND) + lost
            for x, w, s in zip(own.states_above, W, noise.each, strict=True)
        ]
        seen = [w + s + y for w, s, y in zip(W, noise.each, measured, strict=True)]
        told = sizes(joined([[loop.M, loop.N], [loop.F, loop.G]])) * column([*Z, *seen])
        planned = [*map(arb.__add__, own.inputs_above, own.held), *[arb(0)] * len(Z)]
        gamma = exact(c / (1 - c))
        return [*measured, *(gamma * (x + y) + lost for x, y in zip(planned, told.entries(), strict=True))]

    def _start(self) -> tuple[list[Ball], Ball]:
        """x(0) - x*(0): a point or a box (n), and within how much of that."""
        start, n = self._spec.start, len(self._spec.plant.states)
        if start.within is not None:
            return [arb(0)] * n, exact(start.within)
        ends = [(q, q) for q in start.at] if start.at is not None else list((start.box or {}).values())
        around = [exact((a + b) / 2) + arb(0, exact((b - a) / 2)) for a, b in ends]
        return [x - y for x, y in zip(around, self.course.curve.somewhere(), strict=True)], arb(0)

    # -- claims

    def plan(self) -> Outcome:
        """The knots are those of its task, and the plan goes on as is said."""
        trajectory = self._spec.trajectory
        if isinstance(trajectory, Planned):
            found = serves(trajectory, self.result.plan)
            if not found.holds:
                return found
        why = self.course.lasts()
        return stated(not why, why)

    def smooth(self) -> Outcome:
        """What everything owes is kept on the safe set, and along the plan."""
        spec, trajectory = self._spec, self._spec.trajectory
        time = time_range(spec.uncertainty, self.course.horizon)
        wind = () if spec.disturbance is None else spec.disturbance.duties
        ranges: dict[str, Ends] = {**spec.plant.safe_set, **spec.plant.ranges}
        if time is not None:
            ranges[TIME] = time
        duties = (*spec.plant.duties, *wind, *spec.uncertainty.duties)
        found = [smooth(duties, ranges, self._budget)]
        if isinstance(trajectory, Expressed):
            found.append(smooth(trajectory.duties, {TIME: (Fraction(0), trajectory.horizon)}, self._budget))
        return together(found)

    def fits(self) -> Outcome:
        """Cuts are there for every slow signal, and signals that are taken for slow have a rate."""
        signals = len(self._slow)
        if any(len(row) != signals for row in self.proven.recipe.cuts):
            return stated(False, f"there are {signals} slow signals, and cuts of another number")
        return stated(self.remainders.has_rates, "u* jumps, so that parameters are not slow")

    def inside(self, i: int) -> Outcome:
        """The tube of a state lies in the safe set."""
        W = exact(max(own.half_widths[i] for own in self.proven.stages))
        ends = list(self._spec.plant.safe_set.values())[i]
        return _within(ends, [own.x[i] for own in self.remainders.windows], W)

    def known(self) -> Outcome:
        """All that acts on the loop is bounded."""
        grounds = self.inequalities.problem.grounds
        if all(x.is_finite() for own in grounds for x in (*own.acting, *own.box)):
            return CONFIRMED
        return Outcome(verdict="undecided", why="a supremum is not finite")

    def output(self, f: int) -> Outcome:
        """|e_i| < W_i at all times; |delta_j| < U_j, and zeta in its box, at every sample."""
        return self.inequalities.output(f)

    def keeps(self, own: InputUse) -> Outcome:
        """u* and all that is added, with what a computer misses u* by, are in the range that is stated."""
        j = self._spec.plant.inputs.index(own.name)
        more = exact(max(stage.deviations[j] for stage in self.proven.stages))
        more += exact(PLAN) * self.remainders.inputs_above[j]
        return _within(own.range, [window.u[j] for window in self.remainders.windows], more)

    def cleared(self, index: int) -> Outcome:
        """The tube keeps away from an obstacle."""
        return cleared(self.course, self._spec.obstacles[index], self.proven.stages, self._budget)

    def met(self, name: str, wish: Fraction) -> Outcome:
        """A half-width that was asked for, of a state or an output, is kept by every stage."""
        row = self._spec.plant.lengths[name]
        widths = [
            sum(abs(factor) * width for factor, width in zip(row, own.half_widths, strict=True))
            for own in self.proven.stages
        ]
        return stated(max(widths) <= wish, "it is wider")


def _within(ends: Range, planned: Sequence[Ball], more: Ball) -> Outcome:
    low, high = map(exact, ends)
    if all(low <= x - more and x + more <= high for x in planned):
        return CONFIRMED
    return Outcome(verdict="undecided", why="it may leave it")
