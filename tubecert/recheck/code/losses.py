"""What exported code can lose to its rounding: bounds of recheck's own for the numbers of theorem H-R.

Implements: theory 8.11 (H.36), for a constant metric. In: the text of the code, read, and
what the certificate says of the machine. Every function of the text is run on balls that contain all that goes in, at
stations along the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb

from tubecert.recheck.balls import Ball, between, exact, larger, length, magnitude, root
from tubecert.recheck.code.about import About, Lost
from tubecert.recheck.code.lookups import looked_up
from tubecert.recheck.code.pieces import (
    any_of,
    jumps,
    mean_of,
    mean_rounded,
    require_passes,
    steepest,
    tables_of,
)
from tubecert.recheck.code.prediction import Model, cut
from tubecert.recheck.code.reader import Code
from tubecert.recheck.code.rows import Numbers, around, empty, greatest, named, near, row, slackened
from tubecert.recheck.code.run import Counter, Machine, Own, State, Value, Vector, numbers
from tubecert.recheck.code.seen import KINDS, SINCE, Rounded, Seen, known
from tubecert.recheck.code.shape import ball_of, box_of, law_of
from tubecert.recheck.code.stations import Station, stations
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.curve import CLOCK
from tubecert.recheck.program import Program
from tubecert.recheck.terms import Term, slopes

_GAUSS = 2016000  # of the error of Gauss's rule with three nodes
_NODES = 3
_MOST_SAMPLES = 2**32 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fed:
    """r_a; how far the feedback is above du d; and a bound of its length."""

    lost: Ball
    above: Ball
    size: Ball


def lost_by(code: Code, about: About) -> Lost:
    """The bounds; raises `UnreadError` for code of which none are derived."""
    if ("predicted" in code.functions) != (about.model is not None):
        raise UnreadError("the code and the certificate do not agree whether the state is predicted")
    return _Analysis(code, about).lost()


class _Analysis:
    """The functions of a code on all that can go in."""

    def __init__(self, code: Code, about: About) -> None:
        self.code, self.of, self.m = code, about, about.inputs
        self.kind = KINDS[code.real]
        self.n = len(about.widths)
        self.box = [width * about.reach for width in about.widths]
        sides = dict(enumerate(self.box))
        moves = dict(enumerate(about.moves))
        self.rounded = Rounded(self.kind, apart=("y", "xs"), widths=sides, moves=moves)
        self.law = law_of(code.functions["law"], self.m)
        self.stations = stations(about.curve, about.sample_time)
        self.tables = tables_of(code, about.curve)
        if about.curve.horizon is not None and about.curve.horizon / about.sample_time >= _MOST_SAMPLES:
            raise UnreadError("a plan of more samples than the code counts has no bound here")

    def lost(self) -> Lost:
        """The worst of all stations."""
        fed = [self._fed(station) for station in self.stations]
        above, size = (greatest([own.above for own in fed]), greatest([own.size for own in fed]))
        input, estimate = arb(0), arb(0)
        for station in self.stations:
            own, q = self._stepped(station, size)
            input, estimate = larger(input, own), larger(estimate, q)
        return Lost(
            feedback=greatest([own.lost for own in fed]),
            input=above + input,
            estimate=estimate / self.of.share,
            prediction=arb(0) if self.of.model is None else self._predicted(self.of.model, above, size),
        )

    def _predicted(self, model: Model, above: Ball, size: Ball) -> Ball:
        """r_p: what the text rounds over the delay, its input being off as well, and how far exact steps are off."""
        seen = [
            own.value for own in any_of([[near([x], side) for x, side in zip(xs, self.box, strict=True)]
            for xs, _ in self.plans])
        ]  # fmt: skip
        us, until = any_of([u for _, u in self.plans]), self.stations[-1].end
        wrong = [above] * self.m
        if self._whole:
            wrong = [above + u.error + self.kind.unit * (u.most + size) + self.kind.least for u in us]
        acting = [around(size + off) for off in wrong]  # of the loop, and of the code
        if self._whole:
            acting = [u.value + own for u, own in zip(us, acting, strict=True)]
        t = Seen(between(0, until), greatest([self._sampled(own).error for own in self.stations]))
        given: Vector = [Seen(value, error) for value, error in zip(acting, wrong, strict=True)]
        found = empty(self.n)
        self._machine().call("predicted", [known(own) for own in seen], t, given, found)
        narrow = min(self.box, key=lambda side: float(side.lower()))
        exactly = cut(model, seen, acting, narrow, until)
        return self.of.stretch * (length([own.error for own in numbers(found)]) + exactly)

    def _machine(self, **instead: Own) -> Machine:
        return Machine(self.code, self.rounded, self._functions | instead, self.tables)

    @cached_property
    def _functions(self) -> dict[str, Own]:
        return looked_up(self.code, self.of.tables, self.rounded)

    # -- the plan

    @cached_property
    def plans(self) -> list[tuple[Numbers, Numbers]]:
        """x* and u* at the samples of every station."""
        return [self._plan(station, self._looked(station)) for station in self.stations]

    def _looked(self, station: Station) -> Seen:
        """The time at which the feedback looks: a delay after a sample where the state is predicted."""
        t = self._sampled(station)
        if self.of.model is None:
            return t
        later = self.rounded.both("+", t, self._machine().number(f"{self.code.name.upper()}_DELAY"))
        return Seen(between(station.begin, station.end), later.error)

    def _time(self, station: Station) -> Counter:
        """The number of a sample in a station, and of those before."""
        Ts = exact(self.of.sample_time)

        def count(before: int) -> Seen:
            low = larger(station.begin / Ts - before, arb(0))
            value = between(low, larger(station.end / Ts - before, arb(0)))
            return self.rounded.rounded(value, arb(0)) if self.code.real == "float" else known(value)

        return Counter(count)

    def _sampled(self, station: Station) -> Seen:
        """The time of a sample, as the code has it."""
        Ts = self._machine().number(f"{self.code.name.upper()}_SAMPLE_TIME")
        return self.rounded.both("*", self._time(station).converted(), Ts)

    def _plan(self, station: Station, t: Seen) -> tuple[Numbers, Numbers]:
        """x* and u* at times of a station."""
        machine, x, u = self._machine(piece=lambda _: station.piece), empty(self.n), empty(self.m)
        machine.call("on_plan", t, x, u)
        if "START" not in self.code.tables:
            return numbers(x), numbers(u)
        # a time near a knot may be taken for one of the next piece: x* and u* go on continuously
        off = numbers([machine.left["on_plan"]["s"]])[0].error + self._begun
        if not off < station.beside:
            raise UnreadError("times have no digit that is right")
        slack = [2 * off * steep + jump for steep, jump in self._apart]
        return slackened(x, slack[: self.n]), slackened(u, slack[self.n :])

    @property
    def _begun(self) -> Ball:
        return greatest([own.error for own in numbers(self.tables["START"])])

    @cached_property
    def _apart(self) -> list[tuple[Ball, Ball]]:
        curve = self.of.curve
        return list(zip(steepest(curve, self.stations[0].beside), jumps(curve), strict=True))

    def _known(self, station: Station) -> dict[str, Own]:
        """What is known of a station: its piece, and where times near knots matter what is on the plan."""
        looked: dict[str, Own] = {"piece": lambda _: station.piece}
        return looked | ({"on_plan": self._on_plan(station)} if self.tables else {})

    def _on_plan(self, station: Station) -> Own:
        """What is on the plan where the feedback looks."""

        def on_plan(*given: Value) -> None:
            for found, own in zip(given[1:], self.plans[station.own], strict=True):
                row(found)[:] = own

        return on_plan

    # -- the feedback

    def _fed(self, station: Station) -> _Fed:
        """T = alpha/2 + c'kappa and |kappa|, of what (H.37) computes at any y of the tube."""
        x, seen = self.plans[station.own][0], list[Seen]()

        def law(*given: Value) -> None:
            y, f, xs, *rest = given
            machine.own("law", named("y", y), f, named("xs", xs), *rest)
            seen[:] = numbers([machine.within("law", each) for each in (*self.law.c, self.law.excess)])
            row(rest[-2])[:] = [known(arb(0))] * self.m

        machine = self._machine(**self._known(station), law=law)
        y: Vector = [near([own], side) for own, side in zip(x, self.box, strict=True)]
        machine.call("feedback", y, self._looked(station), empty(self.m))
        *c, excess = seen
        off = [own.error for own in x]
        form = [
            magnitude(e) * p * q
            for row, p in zip(self.of.metric, off, strict=True)
            for e, q in zip(row, off, strict=True)
        ]
        e_x = root(sum(form, start=arb(0)))
        return self._bounded(c, excess, e_x)

    @cached_property
    def _form(self) -> tuple[Ball, Ball]:
        """How far d^2 is off as computed: a share of it, and what underflow adds. It is a form of degree 2 in z."""

        def off(*, underflows: bool) -> Ball:
            own = Rounded(self.kind, underflows=underflows, apart=("y", "xs"))
            y: Vector = [Seen(around(side), arb(0), origin=("y", i)) for i, side in enumerate(self.box)]
            xs: Vector = [Seen(arb(0), arb(0), origin=("xs", i)) for i in range(self.n)]
            rest = [[known(arb(0)) for _ in range(k)] for k in (self.n, self.n, self.m)]
            told = empty(3)
            f, vs, us = (list[Value](each) for each in rest)
            Machine(self.code, own, self._functions).call("law", y, f, xs, vs, us, empty(self.m), told)
            square = numbers(told[:1])[0]
            if square.degree != 2:
                raise UnreadError("the square of the distance is no form of degree 2")
            return square.error

        share = off(underflows=False)
        return share / (self.of.reach * self.of.reach), off(underflows=True) - share

    def _bounded(self, c: Numbers, excess: Seen, e_x: Ball) -> _Fed:
        """See docs/theory.md, 8.11: the same three cases, with constants of its own."""
        u, eta, m = self.kind.unit, self.kind.least, self.m
        nu, lowest = self._form
        e_c, C = length([own.error for own in c]), length([own.most for own in c])
        gain, du, D = self.kind.nearest(self.law.gain), self.of.gain, self.of.reach
        grown = gain * (1 + u) ** 2 * root(1 + nu) - du
        shrunk = du - gain * (1 - u) ** 2 * root(1 - nu)
        e_l = larger(magnitude(grown), magnitude(shrunk)) * (D + e_x) + du * e_x
        e_l = e_l + gain * (1 + u) ** 2 * root(lowest.max(0)) + eta
        L = du * D + e_l
        least = self.kind.nearest(self.law.least)
        more, less = (1 + u) ** m + m * eta / least, (1 - u) ** m - m * eta / least
        theta = larger((1 + u) * root(more) - 1, 1 - (1 - u) * root(less))
        rho = (1 + u) / (1 - theta) - 1
        tiny, low = eta * (C + m), root(least)
        above = e_l + L * ((1 + rho) * (1 + u) - 1) + tiny
        sigma = L * (1 + rho) + eta * C
        rest = sigma * e_c + (C + e_c) * (u * sigma + m * eta) + eta * (C + C * C)
        wanted = excess.error + 2 * rho * (L + eta) * C / (1 - rho)
        limited = e_l * (C + e_c) + L * e_c + rho * L * C
        faint = L * (low + e_c)
        lost = larger(larger(wanted, limited), faint) + rest + (C + e_c) * above
        sizes = (C * C, excess.most / low, L / low, D * D * (1 + nu))
        if not (nu < 1 and all(size < self.kind.most for size in sizes)):
            raise UnreadError("the feedback may overflow in this type, or has no digit that is right")
        return _Fed(lost=lost, above=above, size=L + above)

    # -- a sample

    def _stepped(self, station: Station, feedback: Ball) -> tuple[Ball, Ball]:
        """How far the input is off, beside the feedback; and q."""
        q, played = list[Value](), [] if self._whole else self._played(station)

        def law(*given: Value) -> None:
            kappa, told = given[-2:]
            row(kappa)[:] = [known(around(feedback))] * self.m
            row(told)[:] = [known(between(0, self.kind.most))] * 3

        def estimator(*given: Value) -> None:
            y, f, last, *rest = given
            machine.own("estimator", named(SINCE[0], y), f, named(SINCE[1], last), *rest)
            new, clipped = given[-2:]
            q[:] = row(new)
            row(clipped)[:] = [Seen(around(self.of.radius), self._clipped())] * self.m

        def mean(*given: Value) -> None:
            found = row(given[-1])
            if self.tables:
                found[:] = self._mean_through(station, numbers([*given[:2]]))
            else:
                machine.own("mean_of_plan", *given)
                found[:] = slackened(found, self._bent(station))
            found[:] = slackened(found, played)

        machine = self._machine(**self._known(station), law=law, estimator=estimator, mean_of_plan=mean)
        u = empty(self.m)
        y: Vector = [near([x], side) for x, side in zip(self.plans[station.own][0], self.box, strict=True)]
        if self.of.model is not None:
            machine.instead |= self._ahead(machine, station, y)
        machine.call(f"{self.code.name}_step", self._state(station, feedback), y, u)
        lost = [own.error for own in numbers(u)]
        if self._whole:
            return length(lost), length([own.error for own in numbers(q)])
        # whoever adds the feedforward rounds once more
        whole = length([a + b for a, b in zip(played, lost, strict=True)])
        more = self.kind.unit * (self._largest_input + feedback + self.of.radius)
        return whole + more, length([own.error for own in numbers(q)])

    def _ahead(self, machine: Machine, station: Station, y: Vector) -> dict[str, Own]:
        """A state that is predicted lies where measured ones do; the feedback looks at the plan a delay later."""

        def predicted(*given: Value) -> None:
            row(given[-1])[:] = y

        def feedback(*given: Value) -> Value:
            before = dict(machine.instead)
            machine.instead["on_plan"] = self._on_plan(station)
            found = machine.own("feedback", *given)
            machine.instead = before
            return found

        return {"predicted": predicted, "feedback": feedback}

    def _state(self, station: Station, feedback: Ball) -> State:
        """What is kept from a sample before."""
        before = zip(*(self.plans[k][0] for k in station.since), strict=True)
        y: Vector = [near(own, side) for own, side in zip(before, self.box, strict=True)]
        f = empty(self.n)
        machine = self._machine()
        machine.call("drift", y, f)
        acted = feedback + self._largest_input + self.of.radius * (1 + 8 * self.kind.unit)
        rows: State = {"y": y, "f": f, "q": [known(around(self.of.estimate))] * self.m}
        rows |= {name: [known(around(acted))] * self.m for name in ("feedback", "held", "before")}
        rows["since"] = 0  # the feedback is computed: where it is held, less is rounded
        state = machine.state()
        for name, old in state.items():
            state[name] = rows[name] if name in rows else self._time(station) if old is None else old
        return state

    @property
    def _whole(self) -> bool:
        """Whether u* is in what a step gives."""
        return self.of.held or not self.of.curve.moves

    @cached_property
    def _largest_input(self) -> Ball:
        """|u*|."""
        return greatest([length([own.most for own in u]) for _, u in self.plans])

    def _played(self, station: Station) -> list[Ball]:
        """How far each input of `feedforward` is off, over the sample that ends in a station."""
        t = between(larger(station.begin - exact(self.of.sample_time), arb(0)), station.end)

        def on_plan(*given: Value) -> None:  # a sample may meet several pieces
            row(given[2])[:] = any_of([u for _, u in self.plans])

        found, machine = empty(self.m), self._machine(**({"on_plan": on_plan} if self.tables else {}))
        machine.call(f"{self.code.name}_feedforward", self.rounded.rounded(t, arb(0)), found)
        return [own.error for own in numbers(found)]

    @cached_property
    def _middles(self) -> Numbers:
        """u* in the middle of two times of any station."""
        half = Fraction(1, 2)
        rows = []
        for station in self.stations:
            t = self._sampled(station)
            middle = self.rounded.both("*", known(exact(half)), self.rounded.both("+", t, t))
            rows.append(self._plan(station, middle)[1])
        return any_of(rows)

    def _mean_through(self, station: Station, ends: Numbers) -> Numbers:
        """The mean of a u* through knots over the sample between two times."""
        passes = mean_of(self.code.functions["mean_of_plan"], self.code.real)
        late = self._sampled(station).error
        if any(not own.error <= late for own in ends):
            raise UnreadError("the ends of a sample are no times of samples")
        require_passes(passes, self.of.curve, exact(self.of.sample_time), late + self._begun)
        return [mean_rounded(own, passes, self.kind) for own in self._middles]

    def _bent(self, station: Station) -> list[Ball]:
        """The error of Gauss's rule, by the sixth derivative of u*."""
        if "gauss" not in self.code.functions:
            raise UnreadError("the mean of a feedforward through knots has no bound here")
        Ts = self.of.sample_time
        (part,) = self.of.curve.parts
        own = Program(self._sixth, (CLOCK, *part.values))
        t = between(larger(station.begin - exact(Ts), arb(0)), station.end)
        return [exact(Ts**6 / _GAUSS) * magnitude(value) for value in own.run([t, *part.values.values()])]

    @cached_property
    def _sixth(self) -> list[Term]:
        found = list(self.of.curve.u)
        for _ in range(2 * _NODES):
            found = slopes(found, CLOCK)
        return found

    def _clipped(self) -> Ball:
        """Of a box its ends stand for others; of a ball the length, the share and the product are rounded."""
        u, eta, m, R = self.kind.unit, self.kind.least, self.m, self.of.radius
        own = self.code.functions["estimator"]
        if box_of(own, m) is not None:
            return u * R + eta
        ball_of(own, m)
        theta = (1 + u) * root((1 + u) ** m) - 1
        unseen = 2 * root((m + 2) * eta)  # of a length of which the square underflows
        return R * ((1 + theta) ** 2 * (1 + u) ** 4 - 1) + unseen + 4 * m * eta
