"""All claims of a certificate of a sampled loop in their order, each examined again."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property, partial

from flint import arb, arb_mat

from tubecert.recheck import planned
from tubecert.recheck.balls import exact
from tubecert.recheck.cover import Outcome, Range
from tubecert.recheck.examination import Claim
from tubecert.recheck.metric import CONFIRMED, smooth, stated, together
from tubecert.recheck.reading import TIME
from tubecert.recheck.sampled_loop.conditions import Inequalities, Rounding, phases_of
from tubecert.recheck.sampled_loop.loop import Loop
from tubecert.recheck.sampled_loop.obstacles import cleared
from tubecert.recheck.sampled_loop.record import Certificate, Floats, InputUse, Proven, Result
from tubecert.recheck.sampled_loop.remainders import Remainders, Size
from tubecert.recheck.sampled_loop.rows import Ground, Problem, Signals, Start
from tubecert.recheck.sampled_loop.windows import Course, course_of
from tubecert.recheck.specified.trajectory import Expressed, Planned
from tubecert.recheck.times import time_range

_ROUNDING = {"single": Fraction(1, 2**24), "double": Fraction(1, 2**53)}
_PLAN = Fraction(1, 2**24)
ROWS = 53  # bits, in which rows are carried


def of(certificate: Certificate, budget: int) -> Iterator[Claim]:
    """Every claim; of a result that is not certified, only that it is what was written, for this specification."""
    same, result = certificate.stated_hash == certificate.hash, certificate.result
    yield Claim("the hash is that of the result", None, lambda: stated(same, "something was changed"))
    yield Claim("the specification and what repeats it", None, lambda: _first_wrong(_repeated(result)))
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
    for i, name in enumerate(spec.plant.states):
        yield Claim(f"|{name} - {name}*| inside the tube", None, partial(case.errors, i), ROWS)
    for j, name in enumerate(spec.plant.inputs):
        yield Claim(f"what is added to {name}", None, partial(case.deviation, j), ROWS)
    for j in range(len(proven.tables.F)):
        yield Claim(f"memory {j + 1} of the controller", None, partial(case.memory, j), ROWS)
    for own in result.inputs:
        yield Claim(f"{own.name} keeps to its range", None, partial(case.keeps, own))
    for index, verdict in result.clearance:
        if verdict == "certified":
            yield Claim(f"the tube keeps away from obstacle {index + 1}", None, partial(case.cleared, index))
    for name, most in spec.half_widths.items():
        yield Claim(f"half-width of {name} <= {float(most):.6g}", None, partial(case.met, name, most))


def _first_wrong(statements: Iterator[tuple[bool, str]]) -> Outcome:
    return next((stated(False, why) for holds, why in statements if not holds), CONFIRMED)


def _repeated(result: Result) -> Iterator[tuple[bool, str]]:
    spec = result.specification
    yield result.effective_hash == spec.hash, "spec.effective_hash is not that of spec.effective"
    for path, (given, own) in result.settings.items():
        yield given == own, f"spec.settings.{path} is not what spec.effective has"
    horizon = spec.trajectory.horizon if spec.afterwards == "nothing" else None
    yield result.horizon == horizon, "claim.horizon is not that of the specification"
    yield result.afterwards == spec.afterwards, "claim.afterwards is not that of the specification"
    yield result.hold == spec.hardware.hold, "claim.hold is not that of the specification"


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
    tables = proven.tables
    flat = [x for table in (tables.F, tables.G, tables.M, tables.N) for row in table for x in row]
    if controller == "none" and (tables.F or any(flat)):
        return stated(False, "there is a controller, and none was asked for")
    return stated(all(map(_is_single, flat)), "an entry is no number of single precision")


def _is_single(x: float) -> bool:
    try:
        return bool(struct.unpack("<f", struct.pack("<f", x))[0] == x)
    except OverflowError:
        return False


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
        own, recipe = self.proven.nominal, self.proven.recipe
        return Remainders(self.course, own.A, own.B, own.E, recipe.windows, slow=recipe.slow)

    @cached_property
    def _widest(self) -> list[arb]:
        """W of all stages together."""
        return [exact(max(own)) for own in zip(*(own.half_widths for own in self.proven.stages), strict=True)]

    @cached_property
    def inequalities(self) -> Inequalities:
        """Of this loop."""
        spec, proven, remainders = self._spec, self.proven, self.remainders
        machine, n, m = spec.hardware, len(spec.plant.states), len(spec.plant.inputs)
        slow = remainders.slow(self._widest)
        tables, noise = proven.tables, Size.of(machine.noise, n)
        z, r = len(tables.F), len(slow)
        loop = Loop(
            A=_matrix(proven.nominal.A, n, n),
            B=_matrix(proven.nominal.B, n, m),
            H=arb_mat(n, r, [own.column[i] for i in range(n) for own in slow]),
            F=_matrix(tables.F, z, z),
            G=_matrix(tables.G, z, n),
            M=_matrix(tables.M, m, z),
            N=_matrix(tables.N, m, n),
            sample=machine.sample_time,
            delay=machine.delay,
        )
        signals = Signals(
            noise=noise.each,
            noise_length=noise.length,
            winds=[
                (_matrix(own, n, len(own[0])), size.each, size.length) for own, size in remainders.sudden()
            ],
            slow=[own.size for own in slow],
            rates=[own.rate for own in slow],
            first=[own.first for own in slow],
        )
        above = [x + y for x, y in zip(remainders.inputs_above, remainders.held, strict=True)]
        rounding = Rounding(_ROUNDING[machine.arithmetic], remainders.states_above, above)
        grounds = []
        for begin, stage, acting in phases_of(proven.stages, loop.waiting):
            W, Z, U = (list(map(exact, own)) for own in (stage.half_widths, stage.memory, acting))
            rho = remainders.rho(W, U, slow)
            box = [*W, *Z, *U * loop.waiting, *signals.slow]
            grounds.append(Ground(begin, stage, *rho, *rounding.of(loop, noise.each, W, Z), box))
        lags, intervals = proven.recipe.lags, self.course.intervals
        last = proven.stages[-1].start + loop.whole + 1 + lags
        last = last if intervals is None else min(last, intervals - 1)
        return Inequalities(Problem(loop, signals, self._start(), grounds, lags, last), proven.recipe)

    def _start(self) -> Start:
        """x(0) - x*(0)."""
        start, n = self._spec.start, len(self._spec.plant.states)
        if start.within is not None:
            return Start([arb(0)] * n, exact(start.within))
        planned_ = self.course.curve.somewhere()
        ends = [(q, q) for q in start.at] if start.at is not None else list((start.box or {}).values())
        around = [exact((a + b) / 2) + arb(0, exact((b - a) / 2)) for a, b in ends]
        return Start([x - y for x, y in zip(around, planned_, strict=True)], arb(0))

    # -- claims

    def plan(self) -> Outcome:
        """The knots are those of its task, and the plan goes on as is said."""
        trajectory = self._spec.trajectory
        if isinstance(trajectory, Planned):
            found = planned.serves(trajectory, self.result.plan)
            if not found.holds:
                return found
        why = self.course.lasts()
        return stated(not why, why)

    def smooth(self) -> Outcome:
        """What everything owes is kept on the safe set, and along the plan."""
        spec, trajectory = self._spec, self._spec.trajectory
        time = time_range(spec.uncertainty, self.course.horizon)
        wind = () if spec.disturbance is None else spec.disturbance.duties
        ranges: dict[str, Range] = {**spec.plant.safe_set, **spec.plant.ranges}
        if time is not None:
            ranges[TIME] = time
        duties = (*spec.plant.duties, *wind, *spec.uncertainty.duties)
        found = [smooth(duties, ranges, self._budget)]
        if isinstance(trajectory, Expressed):
            found.append(smooth(trajectory.duties, {TIME: (Fraction(0), trajectory.horizon)}, self._budget))
        return together(found)

    def fits(self) -> Outcome:
        """Cuts are there for every slow signal, and signals that are taken for slow have a rate."""
        signals = len(self.remainders.slow(self._widest))
        rows = all(len(row) == signals for row in self.proven.recipe.cuts)
        if not rows:
            return stated(False, f"there are {signals} slow signals, and cuts of another number")
        return stated(self.remainders.has_rates, "u* jumps, so that parameters are not slow")

    def inside(self, i: int) -> Outcome:
        """The tube of a state lies in the safe set."""
        _, holds = list(self.remainders.inside(self._widest))[i]
        return CONFIRMED if holds else Outcome(verdict="undecided", why="it could not be shown")

    def known(self) -> Outcome:
        """All that acts on the loop is bounded."""
        grounds = self.inequalities.problem.grounds
        finite = all(
            x.is_finite() for own in grounds for x in (*own.remainder, *own.through_inputs, *own.box)
        )
        return CONFIRMED if finite else Outcome(verdict="undecided", why="a supremum is not finite")

    def errors(self, i: int) -> Outcome:
        """|e_i| < W_i at all times."""
        return self.inequalities.errors(i)

    def deviation(self, j: int) -> Outcome:
        """|delta_j| <= U_j at every sample."""
        return self.inequalities.deviation(j)

    def memory(self, j: int) -> Outcome:
        """|zeta_j| in its box."""
        return self.inequalities.memory(j)

    def keeps(self, own: InputUse) -> Outcome:
        """u* and all that is added, with what a computer misses u* by, are in the range that is stated."""
        j = self._spec.plant.inputs.index(own.name)
        more = exact(max(stage.deviations[j] for stage in self.proven.stages))
        more += exact(_PLAN) * self.remainders.inputs_above[j]
        low, high = map(exact, own.range)
        holds = all(low <= u - more and u + more <= high for u in self.remainders.inputs(j))
        return CONFIRMED if holds else Outcome(verdict="undecided", why="it may leave it")

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


def _matrix(rows: Floats | Sequence[Sequence[float]], p: int, q: int) -> arb_mat:
    return arb_mat(p, q, [arb(x) for row in rows for x in row])
