"""All claims of a certificate of a sampled loop in their order, each examined again."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property, partial
from math import ceil, inf, isfinite

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, column, exact, joined, sizes
from tubecert.recheck.clearances import along, contains, somewhere
from tubecert.recheck.cover import CONFIRMED, Claim, Outcome, stated, together
from tubecert.recheck.cover import Range as Ends
from tubecert.recheck.curve import Segment
from tubecert.recheck.metric import smooth
from tubecert.recheck.obstacles import apart
from tubecert.recheck.plans import serves
from tubecert.recheck.sampled_loop.record import Proven, Result, single
from tubecert.recheck.sampled_loop.remainders import PLAN, Course, Remainders, Size, Slow, course_of
from tubecert.recheck.sampled_loop.theorem import Inequalities, Loop, Phase, phases_of
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.numbers import TIME, Range
from tubecert.recheck.specified.trajectory import Expressed, Planned
from tubecert.recheck.times import time_range

_ROUNDING = {"single": Fraction(1, 2**24), "double": Fraction(1, 2**53)}
_FLUSHED = Fraction(1, 10**35)  # what a computer loses that has no subnormal numbers
_SECOND = 1 + Fraction(1, 2**20)  # rounding of what is a rounding already
_SHOWN = Fraction(1, 10**9)  # how far what is told of a plan may be off, on the scale of the safe set
ROWS = 53  # bits, in which rows are carried


def of(result: Result, budget: int) -> Iterator[Claim]:
    """Every claim; of a result that is not certified, that it is for this specification, and what refutes it."""
    spec, proven = result.specification, result.proven
    repeated = {**result.repeated, **(proven.repeated if proven else {})}
    wrong = ", ".join(path for path, (given, own) in repeated.items() if given != own)
    why = f"not what the specification has: {wrong}"
    yield Claim("the specification and what repeats it", None, lambda: stated(not wrong, why))
    if result.plan is not None:
        course = course_of(spec, result.plan)
        for i, *told in result.outside:
            name = f"the plan itself leaves the safe set in {spec.plant.states[i]}"
            yield Claim(name, None, partial(_outside, course, i, *told))
    if proven is None:
        return
    case = Case(spec, proven, budget)
    yield Claim("the verdict follows from what is certified", None, case.follows)
    yield Claim("tables are numbers of single precision", None, case.single)
    yield Claim("the plan is that of the specification, and lasts", None, case.plan)
    yield Claim("f, B, E, h and the plan are smooth", None, case.smooth)
    for i, name in enumerate(spec.plant.states):
        yield Claim(f"the tube of {name} lies in the safe set", None, partial(case.inside, i))
    outputs = [
        *(f"|{name} - {name}*| inside the tube" for name in spec.plant.states),
        *(f"what is added to {name}" for name in spec.plant.inputs),
        *(f"memory {j + 1} of the controller" for j in range(proven.tables["F"].nrows())),
    ]
    for f, name in enumerate(outputs):
        yield Claim(name, None, partial(case.output, f), ROWS)
    for j, name in enumerate(spec.plant.inputs):
        yield Claim(f"{name} keeps to its range", None, partial(case.keeps, j))
    for index, away in enumerate(proven.cleared):
        if away:
            yield Claim(f"the tube keeps away from obstacle {index + 1}", None, partial(case.cleared, index))
    for name, most in spec.half_widths.items():
        yield Claim(f"half-width of {name} <= {float(most):.6g}", None, partial(case.met, name, most))


class Case:
    """What the claims of one certificate have in common, made when it is first needed."""

    def __init__(self, spec: SampledSpecification, proven: Proven, budget: int) -> None:
        self._spec, self._proven, self._budget = spec, proven, budget

    @cached_property
    def course(self) -> Course:
        """The plan."""
        return course_of(self._spec, self._proven.plan)

    @cached_property
    def remainders(self) -> Remainders:
        """What is not linear."""
        own, recipe = self._proven, self._proven.recipe
        return Remainders(self.course, own.nominal, recipe.windows, slow=recipe.slow)

    @cached_property
    def widest(self) -> list[Fraction]:
        """Half-widths that hold on all stages, (n,)."""
        return [max(own) for own in zip(*(own.half_widths for own in self._proven.stages), strict=True)]

    @cached_property
    def slow(self) -> list[Slow]:
        """Slow signals where e is in the boxes of all stages."""
        return self.remainders.slow(list(map(exact, self.widest)))

    @cached_property
    def inequalities(self) -> Inequalities:
        """Of this loop."""
        machine, own, n = self._spec.hardware, self._proven, len(self._spec.plant.states)
        H = arb_mat(n, len(self.slow), [eta.column[i] for i in range(n) for eta in self.slow])
        A, B, _ = own.nominal
        loop = Loop(A, B, H, [*own.tables.values()], (machine.sample_time, machine.delay))
        noise, phases = Size.of(machine.noise, n), []
        for begin, stage, acting in phases_of(own.stages, loop.waiting):
            W, Z, U = (list(map(exact, sizes_)) for sizes_ in (stage.half_widths, stage.memory, acting))
            box = [*W, *Z, *U * loop.waiting, *(eta.size for eta in self.slow), *self._rounding(noise, W, Z)]
            phases.append(Phase(begin, stage, box, self.remainders.rho(W, U, self.slow)))
        last, horizon = own.stages[-1].start + loop.whole + 1 + own.recipe.lags, self.course.horizon
        if horizon is not None:
            last = min(last, ceil(horizon / machine.sample_time) - 1)
        winds, start = self.remainders.sudden(), self._start()
        return Inequalities(loop, own.recipe, phases, noise, winds, self.slow, *start, last)

    def _rounding(self, noise: Size, W: Sequence[Ball], Z: Sequence[Ball]) -> list[Ball]:
        """What dy (n), u (m) and zeta (z) are off by, (D.8)."""
        own, tables, u = self.remainders, self._proven.tables, _ROUNDING[self._spec.hardware.arithmetic]
        c, lost = (len(Z) + len(W) + 3) * u, exact(_FLUSHED)
        measured = [
            (exact(PLAN) * x + exact(2 * u) * (2 * x + w + s)) * exact(_SECOND) + lost
            for x, w, s in zip(own.states_above, W, noise.each, strict=True)
        ]
        seen = [w + s + y for w, s, y in zip(W, noise.each, measured, strict=True)]
        rows = joined([[tables["M"], tables["N"]], [tables["F"], tables["G"]]])
        told = sizes(rows) * column([*Z, *seen])
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

    def follows(self) -> Outcome:
        """Ranges of inputs are within their limits, and obstacles that decide are cleared."""
        spec, own = self._spec, self._proven
        used = dict(zip(spec.plant.inputs, own.ranges, strict=True))
        if any(used[name][0] < low or high < used[name][1] for name, (low, high) in spec.limits.items()):
            return stated(False, "an input is not within its limits")
        decided = all(away or not it.decides for away, it in zip(own.cleared, spec.obstacles, strict=True))
        return stated(decided, "an obstacle that decides is not cleared")

    def single(self) -> Outcome:
        """Tables are numbers of single precision; where no controller is asked for it has no memory, and adds 0."""
        flat = [float(x) for table in self._proven.tables.values() for x in table.entries()]
        if self._spec.controller == "none" and (self._proven.tables["F"].nrows() or any(flat)):
            return stated(False, "there is a controller, and none was asked for")
        return stated(all(single(x) == x for x in flat), "an entry is no number of single precision")

    def plan(self) -> Outcome:
        """The knots are those of its task, the plan goes on as is said, and no stage begins after its end."""
        task, horizon, last = self._spec.trajectory, self.course.horizon, self._proven.stages[-1].start
        found = serves(task, self._proven.plan) if isinstance(task, Planned) else CONFIRMED
        why = "it is not over, or not where it began, when it begins again"
        met = horizon is None or last * self._spec.hardware.sample_time < horizon
        begins = stated(met, "a stage begins after its end")
        return together([found, stated(self.course.goes_on, why), begins])

    def smooth(self) -> Outcome:
        """What everything owes is kept on the safe set, and along the plan."""
        spec, plan, budget = self._spec, self._spec.trajectory, self._budget
        time, wind = time_range(spec.uncertainty, self.course.horizon), spec.disturbance
        timed: dict[str, Ends] = {} if time is None else {TIME: time}
        duties = (*spec.plant.duties, *spec.uncertainty.duties, *(wind.duties if wind else ()))
        found = [smooth(duties, {**spec.plant.safe_set, **spec.plant.ranges, **timed}, budget)]
        if isinstance(plan, Expressed):
            found.append(smooth(plan.duties, {TIME: (Fraction(0), plan.horizon)}, budget))
        return together(found)

    def inside(self, i: int) -> Outcome:
        """The tube of a state lies in the safe set."""
        ends = list(self._spec.plant.safe_set.values())[i]
        return _within(ends, (own.x[i] for own in self.remainders.windows), exact(self.widest[i]))

    def output(self, f: int) -> Outcome:
        """|e_i| < W_i at all times; |delta_j| < U_j, and zeta in its box, at every sample."""
        return self.inequalities.output(f)

    def keeps(self, j: int) -> Outcome:
        """u* and all that is added, with what a computer misses u* by, are in the range that is stated."""
        more = exact(max(stage.deviations[j] for stage in self._proven.stages))
        more += exact(PLAN) * self.remainders.inputs_above[j]
        return _within(self._proven.ranges[j], (own.u[j] for own in self.remainders.windows), more)

    def met(self, name: str, wish: Fraction) -> Outcome:
        """A half-width that was asked for, of a state or an output, is kept by every stage."""
        row = self._spec.plant.lengths[name]
        stages = (zip(row, own.half_widths, strict=True) for own in self._proven.stages)
        widest = max(sum(abs(factor) * width for factor, width in own) for own in stages)
        return stated(widest <= wish, "it is wider")

    # -- obstacles: rectangles about segments of the plan, halved where needed; exact

    def cleared(self, index: int) -> Outcome:
        """No rectangle of a stage that may last at a segment meets an obstacle, and the plan starts outside of it."""
        obstacle, start = self._spec.obstacles[index], self.course.curve.somewhere()
        pair = [self._spec.plant.states.index(name) for name in obstacle.states]
        x, y = (somewhere(start[i]) for i in pair)
        if obstacle.radius is None and contains(obstacle.corners, (x, y)):
            return Outcome(verdict="undecided", why="the plan starts in the obstacle")

        def clear(segment: Segment) -> bool:
            widths, sides = self._widths(*segment.when), [(i, *segment.x[i]) for i in pair]
            if not all(isfinite(low) and isfinite(high) for _, low, high in sides):
                return False
            box = [(Fraction(low) - widths[i], Fraction(high) + widths[i]) for i, low, high in sides]
            return apart(obstacle, box)

        return along(self.course.curve.root, self._budget, clear)

    def _widths(self, begin: float, end: float) -> list[Fraction]:
        """The widest stage that may last then: the plan's time is that of the loop, unless it repeats or is any."""
        horizon, after, course = self._spec.trajectory.horizon, self._spec.afterwards, self.course
        if horizon is None or after == "repeat" or course.family is not None or not course.curve.moves:
            return self.widest
        if after == "rest" and end >= float(horizon) * (1 - 1e-9):
            end = inf
        starts = [own.start * self._spec.hardware.sample_time for own in self._proven.stages]
        met = self._proven.stages[bisect_right(starts, max(0.0, begin)) - 1 : bisect_right(starts, end)]
        return [max(own) for own in zip(*(own.half_widths for own in met), strict=True)]


def _outside(course: Course, i: int, at: Fraction, goes: Fraction, end: Fraction) -> Outcome:
    """At a time of the plan a state of it is as far out as is told, beyond an end of its range."""
    ends, horizon = list(course.spec.plant.safe_set.values())[i], course.spec.trajectory.horizon
    if not 0 <= at <= (at if horizon is None else horizon) or float(end) not in map(float, ends):
        return stated(False, "that is no time of the plan, or no end of the safe set")
    x = course.curve.at(at)[0][i]
    near = bool(abs(x - exact(goes)) <= exact(_SHOWN) * (abs(x) + exact(ends[1] - ends[0])))
    above = float(end) == float(ends[1])
    beyond = bool(x > exact(ends[1])) if above else bool(x < exact(ends[0]))
    return stated(near and beyond, f"it is at {float(x.mid()):.9g} then")


def _within(ends: Range, planned: Iterable[Ball], more: Ball) -> Outcome:
    low, high = map(exact, ends)
    if all(low <= x - more and x + more <= high for x in planned):
        return CONFIRMED
    return Outcome(verdict="undecided", why="it may leave it")
