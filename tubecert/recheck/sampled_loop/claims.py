"""All claims of a certificate of a sampled loop in their order, each examined again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
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
from tubecert.recheck.sampled_loop.held import single
from tubecert.recheck.sampled_loop.loop import Loop, column, joined, sizes
from tubecert.recheck.sampled_loop.obstacles import cleared
from tubecert.recheck.sampled_loop.record import Certificate, Proven
from tubecert.recheck.sampled_loop.remainders import PLAN, Remainders, Size, Slow
from tubecert.recheck.sampled_loop.theorem import Inequalities, Phase, phases_of
from tubecert.recheck.sampled_loop.windows import Course, course_of
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.numbers import Range
from tubecert.recheck.specified.trajectory import Expressed, Planned
from tubecert.recheck.times import time_range

_ROUNDING = {"single": Fraction(1, 2**24), "double": Fraction(1, 2**53)}
_FLUSHED = Fraction(1, 10**35)  # what a computer loses that has no subnormal numbers
_SECOND = 1 + Fraction(1, 2**20)  # rounding of what is a rounding already
ROWS = 53  # bits, in which rows are carried


def of(certificate: Certificate, budget: int) -> Iterator[Claim]:
    """Every claim; of a result that is not certified, only that it is what was written, for this specification."""
    same, spec, proven = (
        certificate.stated_hash == certificate.hash,
        certificate.specification,
        certificate.proven,
    )
    yield Claim("the hash is that of the result", None, lambda: stated(same, "something was changed"))
    repeated = {**certificate.repeated, **(proven.repeated if proven else {})}
    wrong = (
        stated(False, f"{path} is not what the specification has")
        for path, (given, own) in repeated.items()
        if given != own
    )
    yield Claim("the specification and what repeats it", None, lambda: next(wrong, CONFIRMED))
    if proven is None:
        return
    case = Case(spec, proven, budget)
    yield Claim("limits are kept, and obstacles that decide", None, case.follows)
    yield Claim("tables are numbers of single precision", None, case.single)
    yield Claim("the plan is that of the specification, and lasts", None, case.plan)
    yield Claim("f, B, E, h and the plan are smooth", None, case.smooth)
    for i, name in enumerate(spec.plant.states):
        yield Claim(f"the tube of {name} lies in the safe set", None, partial(case.inside, i))
    outputs = [
        *(f"|{name} - {name}*| inside the tube" for name in spec.plant.states),
        *(f"what is added to {name}" for name in spec.plant.inputs),
        *(f"memory {j + 1} of the controller" for j in range(proven.F.nrows())),
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
        return Remainders(self.course, (own.A, own.B, own.E), recipe.windows, slow=recipe.slow)

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
        loop = Loop(own.A, own.B, H, own.F, own.G, own.M, own.N, machine.sample_time, machine.delay)
        noise, phases = Size.of(machine.noise, n), []
        for begin, stage, acting in phases_of(own.stages, loop.waiting):
            W, Z, U = (list(map(exact, sizes_)) for sizes_ in (stage.half_widths, stage.memory, acting))
            box = [*W, *Z, *U * loop.waiting, *(eta.size for eta in self.slow)]
            rounded, rho = self._rounding(noise, W, Z), self.remainders.rho(W, U, self.slow)
            phases.append(Phase(begin, stage, box, rounded, rho))
        last, horizon = own.stages[-1].start + loop.whole + 1 + own.recipe.lags, self.course.horizon
        if horizon is not None:
            last = min(last, ceil(horizon / machine.sample_time) - 1)
        winds, start = self.remainders.sudden(), self._start()
        return Inequalities(loop, own.recipe, phases, noise, winds, self.slow, *start, last)

    def _rounding(self, noise: Size, W: Sequence[Ball], Z: Sequence[Ball]) -> list[Ball]:
        """What dy (n), u (m) and zeta (z) are off by, (D.8)."""
        own, tables, u = self.remainders, self._proven, _ROUNDING[self._spec.hardware.arithmetic]
        c, lost = (len(Z) + len(W) + 3) * u, exact(_FLUSHED)
        measured = [
            (exact(PLAN) * x + exact(2 * u) * (2 * x + w + s)) * exact(_SECOND) + lost
            for x, w, s in zip(own.states_above, W, noise.each, strict=True)
        ]
        seen = [w + s + y for w, s, y in zip(W, noise.each, measured, strict=True)]
        told = sizes(joined([[tables.M, tables.N], [tables.F, tables.G]])) * column([*Z, *seen])
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
        limits = [spec.limits.get(name) for name in spec.plant.inputs]
        for given, (low, high) in zip(limits, own.ranges, strict=True):
            if given is not None and not given[0] <= low <= high <= given[1]:
                return stated(False, "an input is not within its limits")
        decided = all(away or not it.decides for away, it in zip(own.cleared, spec.obstacles, strict=True))
        return stated(decided, "an obstacle that decides is not cleared")

    def single(self) -> Outcome:
        """Tables are numbers of single precision; where no controller is asked for it has no memory, and adds 0."""
        own = self._proven
        flat = [float(x) for table in (own.F, own.G, own.M, own.N) for x in table.entries()]
        if self._spec.controller == "none" and (own.F.nrows() or any(flat)):
            return stated(False, "there is a controller, and none was asked for")
        return stated(all(single(x) == x for x in flat), "an entry is no number of single precision")

    def plan(self) -> Outcome:
        """The knots are those of its task, and the plan goes on as is said."""
        task = self._spec.trajectory
        found = serves(task, self._proven.plan) if isinstance(task, Planned) else CONFIRMED
        why = "it is not over, or not where it began, when it begins again"
        return together([found, stated(self.course.goes_on, why)])

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

    def cleared(self, index: int) -> Outcome:
        """The tube keeps away from an obstacle."""
        return cleared(self.course, self._spec.obstacles[index], self._proven.stages, self._budget)

    def met(self, name: str, wish: Fraction) -> Outcome:
        """A half-width that was asked for, of a state or an output, is kept by every stage."""
        row = self._spec.plant.lengths[name]
        widths = [
            sum(abs(factor) * width for factor, width in zip(row, own.half_widths, strict=True))
            for own in self._proven.stages
        ]
        return stated(max(widths) <= wish, "it is wider")


def _within(ends: Range, planned: Iterable[Ball], more: Ball) -> Outcome:
    low, high = map(exact, ends)
    if all(low <= x - more and x + more <= high for x in planned):
        return CONFIRMED
    return Outcome(verdict="undecided", why="it may leave it")
