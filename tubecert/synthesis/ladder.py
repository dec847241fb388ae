"""From a wish to a proven metric: degrees, routes and back-offs are tried until one proposal survives its proof.

A route proposes, `rounding` shortens, `tubecert.metric.verify` decides; no solver's status is believed. Every attempt
is kept, so that a failure can say what was tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import inf, sqrt

from tubecert.claims.failures import Attempt, Outcome, Proven
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import round_down
from tubecert.metric.verify import Proofs
from tubecert.model import ControlAffineModel
from tubecert.progress import Phase, Progress, Step
from tubecert.synthesis.family import Choice, MetricFamily, metric_family
from tubecert.synthesis.problem import Floor, Proposal, SynthesisProblem
from tubecert.synthesis.rounding import VerifiedMetric, shortest_proven

Route = Callable[[SynthesisProblem], Proposal]
Box = tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What is wanted: a metric of `model` on `safe_set`.

    `degree` None: raised as long as it pays; `variables` None: chosen; `routes` in the order in which they are tried
    for constant W, backwards where W moves; `limit` of the condition number. Unless
    `thorough`, only the first route and back-off are tried; `rounds`: of all proposals together. `pace`: where the
    search for the largest rate begins, in 1/s.
    """

    model: ControlAffineModel = field(repr=False)
    safe_set: Box
    routes: tuple[tuple[str, Route], ...]
    degree: int | None = None
    variables: tuple[str, ...] | None = None
    limit: float | None = None
    solver: str = "clarabel"
    coordinates: Choice = "identity"
    half_widths: tuple[Fraction, ...] = ()
    thorough: bool = True
    rounds: int | None = None
    effort: Effort = field(default_factory=Effort)
    proofs: Proofs = field(default_factory=Proofs)
    pace: Fraction = Fraction(1)
    progress: Progress | None = None


def kappa(metric: VerifiedMetric) -> float:
    """What a problem minimises, as it came out."""
    plain = metric.floor == "identity" and metric.coordinates == "identity"
    return metric.condition_number.above if plain else metric.proposal.kappa


def guarded(name: str, route: Route, problem: SynthesisProblem) -> Proposal:
    """What a route proposes; a solver that breaks down has proposed nothing."""
    try:
        return route(problem)
    except (ArithmeticError, ValueError, RuntimeError) as error:
        what = " ".join(str(error).split())[:120] or type(error).__name__
        return Proposal(
            route=name,
            coefficients=None,
            kappa=float("inf"),
            feasible=None,
            status=f"broke down ({what})",
        )


def routes(choice: str) -> tuple[tuple[str, Route], ...]:
    """The route that was chosen; for `auto` both: counterexamples for constant W, sums of squares first where it moves.

    Counterexamples treat every expression, sums of squares only polynomials, sines and cosines.
    """
    from tubecert.synthesis import cegis, sos

    known: dict[str, Route] = {"cegis": cegis.propose, "sos": sos.propose_sos}
    names = ("cegis", "sos") if choice == "auto" else (choice,)
    return tuple((name, known[name]) for name in names)


_DEGREES = (0, 1, 2, 3, 4)
_BACK_OFF = (1e-3, 1e-4, 1e-5)  # relative to the rate: what the proof may need
_ROOM = 6.0  # so much more where W moves: it is proven box by box, and the more to spare the fewer there are
_RETREAT = 10.0  # a feasible proposal that fails its proof is asked for again with so much more
_LEAST, _MOST = Fraction(1, 1024), Fraction(1024)  # of searched rates, in those that the system is of
_PAYS = 0.9  # a higher degree must lower the condition number to this share
_SHARP = 1.01  # a searched rate is settled to this factor
_LOOKS = 4  # for advice on what would work instead
_POLISHES = 0.9997  # a back-off that is ten times smaller must lower kappa to this share
_POLISH_BOXES = 20_000  # what its proof may cost
_SMALL = 3  # states up to which metrics are polished in any coordinates
_CHEAP_ROUNDS, _CHEAP_BOXES = 30, 20_000  # what advice may cost, if the search did not cost more


class Ladder:
    """Metrics at rates; what was found (`proven`), and what was tried (`attempts`), is kept."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self.attempts: list[Attempt] = []
        self.proven: list[VerifiedMetric] = []
        self.rounds = 0  # of all proposals so far
        self._families: dict[int, MetricFamily] = {}
        self._found: dict[tuple[Fraction, Floor, float, int | None], VerifiedMetric | None] = {}
        self._wider: dict[int, float] = {}  # by degree: so much more back-off was needed
        self._least_degree = 0  # below it nothing worked at a rate that was asked for before
        self._hardest: float = 0.0

    def metric(
        self, rate: Fraction, floor: Floor = "identity", enough: float = 0.0, most: int | None = None
    ) -> VerifiedMetric | None:
        """A proven metric at a rate, of nearly the least condition number (or input gain); None if none was found.

        The degree is raised as long as that pays, or until the condition number is `enough`, or up to the degree
        `most`.
        """
        key = rate, floor, enough, most
        if key not in self._found:
            self._found[key] = self._searched(rate, floor, enough, most)
        return self._found[key]

    @property
    def flat(self) -> bool:
        """Whether W moves with no more than the degree that is asked for: B is constant."""
        return self._family(0).flat

    def largest_rate(self, limit: float | None, least: Fraction | None = None) -> VerifiedMetric | None:
        """A metric of the largest rate with one of condition number up to `limit`, to a factor `_SHARP`."""
        best = self._first(limit, least)
        if best is None:
            return None
        failed = None
        while failed is None and best.rate < _MOST * self.request.pace:
            found = self._within(round_down(best.rate * 2, 2), limit)
            failed = round_down(best.rate * 2, 2) if found is None else None
            best = found or best
        if failed is None:
            return best
        while failed > best.rate * Fraction(_SHARP):
            middle = round_down(sqrt(best.rate * failed), 4)
            if not best.rate < middle < failed:
                break
            found = self._within(middle, limit)
            best, failed = (found, failed) if found else (best, middle)
        return best

    def lower_rate(self, rate: Fraction) -> Fraction | None:
        """A rate below one that does not work, found with few quick attempts; None if none of them works."""
        quick = self._quick()
        factor = _largest(lambda f: quick._within(round_down(rate * f, 2), self.request.limit) is not None)
        self.rounds += quick.rounds
        return factor and round_down(rate * factor, 2)

    def smaller_box(self, rate: Fraction) -> Fraction | None:
        """A factor by which the box, shrunk about its centre, has a metric at `rate`; likewise."""

        def works(factor: Fraction) -> bool:
            box = shrunk(self.request.safe_set, factor)
            quick = self._quick(safe_set=box)
            found = quick.metric(rate, enough=inf) is not None
            self.rounds += quick.rounds
            return found

        return _largest(works)

    def cheap(self) -> Ladder:
        """A ladder for advice: metrics of the lowest degree, by the first route, for as much work as this one did."""
        request = self.request
        return Ladder(
            replace(
                request,
                thorough=False,
                routes=request.routes[:1],
                degree=request.degree or 0,
                rounds=max(self.rounds, _CHEAP_ROUNDS),
                effort=replace(request.effort, budget=min(request.effort.budget, _CHEAP_BOXES)),
            )
        )

    def _quick(self, **changes: Box) -> Ladder:
        """One with the first route and back-off, for the rounds that are left."""
        request = self.request
        left = None if request.rounds is None else max(request.rounds - self.rounds, 0)
        return Ladder(replace(request, thorough=False, rounds=left, **changes))  # type: ignore[arg-type]

    # -- one rate -----------------------------------------------------------------------------------------------

    def _first(self, limit: float | None, least: Fraction | None) -> VerifiedMetric | None:
        """A metric at `least`, or at the largest power of four times the pace that has one."""
        if least is not None:
            return self._within(least, limit)
        rate = self.request.pace
        while rate >= _LEAST * self.request.pace:
            if found := self._within(rate, limit):
                return found
            rate /= 4
        return None

    def _within(self, rate: Fraction, limit: float | None) -> VerifiedMetric | None:
        found = self.metric(rate, enough=inf if limit is None else limit)
        if found is None or (limit is not None and found.condition_number.above > limit):
            return None
        return found

    def _searched(
        self, rate: Fraction, floor: Floor, enough: float, most: int | None
    ) -> VerifiedMetric | None:
        best: VerifiedMetric | None = None
        for degree in self._degrees(rate):
            if most is not None and self._family(degree).degree > most:
                break
            found = self._at_degree(rate, floor, degree)
            if best is None and found is not None and rate >= self._hardest:
                self._least_degree, self._hardest = degree, float(rate)
            if found is None:
                continue
            pays = best is None or kappa(found) <= _PAYS * kappa(best)
            best = found if best is None else min(best, found, key=kappa)
            if not pays or kappa(best) <= enough:
                break
        return best if best is None or enough or not self._sharp else self._polished(best)

    @property
    def _sharp(self) -> bool:
        """Whether the least condition number is wanted to .1 %: not for large systems as others published them."""
        request = self.request
        small = request.coordinates == "auto" or len(request.model.states) <= _SMALL
        return small and request.thorough

    def _polished(self, best: VerifiedMetric) -> VerifiedMetric:
        """The metric again with smaller back-offs, as long as these lower kappa and can be proven cheaply."""
        name = best.proposal.route
        route = dict(self.request.routes).get(name, self.request.routes[0][1])
        effort = self.request.effort
        effort = replace(effort, budget=min(effort.budget, _POLISH_BOXES))
        degree = best.family.degree
        for back_off in _BACK_OFF[1:]:
            problem = replace(self._problem(best.rate, best.floor, degree, back_off), sharp=True)
            proposal = guarded(name, route, problem)
            self.rounds += proposal.rounds
            if not proposal.kappa < _POLISHES * kappa(best):
                break
            outcome = self._judged(problem, proposal, best.rate, effort)
            if isinstance(outcome, Outcome):
                break
            best = min(best, outcome, key=kappa)
        return best

    def _at_degree(self, rate: Fraction, floor: Floor, degree: int) -> VerifiedMetric | None:
        known = self.request.routes
        order = known[::-1] if self._family(degree).degree else known
        for name, route in order if self.request.thorough else order[:1]:
            found = self._route(rate, floor, degree, name, route)
            if found is not None:
                return found
        return None

    def _degrees(self, rate: Fraction) -> Iterator[int]:
        """The degree that was asked for, or from the least that may work on: a higher rate needs no lower degree."""
        if self.request.degree is not None:
            yield self.request.degree
            return
        last = -1
        for degree in _DEGREES:
            if rate >= self._hardest and degree < self._least_degree:
                continue
            family = self._family(degree)
            if family.degree > last:
                yield degree
            last = family.degree

    def _route(
        self, rate: Fraction, floor: Floor, degree: int, name: str, route: Route
    ) -> VerifiedMetric | None:
        """One route at one degree: a smaller back-off if it finds nothing, a larger one if the proof fails."""
        retreated = False
        room = (_ROOM if self._family(degree).degree else 1.0) * self._wider.get(degree, 1.0)
        back_offs = [room * part for part in (_BACK_OFF if self.request.thorough else _BACK_OFF[:1])]
        while back_offs and self.rounds != self.request.rounds:
            back_off = back_offs.pop(0)
            problem = self._problem(rate, floor, degree, back_off)
            proposal = guarded(name, route, problem)
            self.rounds += proposal.rounds
            outcome = self._judged(problem, proposal, rate, self.request.effort)
            if isinstance(outcome, VerifiedMetric):
                if retreated and self.request.coordinates == "auto":
                    self._wider[degree] = (
                        _RETREAT  # at other rates, too: a proof that fails costs as much as one that holds
                    )
                return outcome
            if proposal.coefficients is not None and not retreated and self.request.thorough:
                # what was found may be no solution but for a solver's last digits: smaller ones are left to be tried
                back_offs, retreated = [back_off * _RETREAT, *back_offs], True
            elif retreated and proposal.coefficients is not None:
                return None
        return None

    def _problem(self, rate: Fraction, floor: Floor, degree: int, back_off: float) -> SynthesisProblem:
        request = self.request
        # then kappa is the condition number
        plain = floor == "identity" and request.coordinates == "identity"
        return SynthesisProblem(
            model=request.model,
            safe_set=request.safe_set,
            family=self._family(degree),
            rate=float(rate) * (1 + back_off),
            floor=floor,
            limit=1.05 * request.limit if request.limit is not None and plain else None,
            solver=request.solver,
            coordinates=request.coordinates,
            half_widths=request.half_widths,
            rounds=None if request.rounds is None else request.rounds - self.rounds,
            progress=request.progress,
        )

    def _family(self, degree: int) -> MetricFamily:
        if degree not in self._families:
            self._families[degree] = metric_family(
                self.request.model,
                degree=degree,
                variables=self.request.variables,
                safe_set=self.request.safe_set,
            )
        return self._families[degree]

    def _judged(
        self, problem: SynthesisProblem, proposal: Proposal, rate: Fraction, effort: Effort
    ) -> VerifiedMetric | Outcome:
        """What the proof makes of a proposal, which is kept and told."""
        outcome = shortest_proven(problem, proposal, rate, effort, self.request.proofs)
        number = outcome.condition_number.above if isinstance(outcome, VerifiedMetric) else None
        attempt = Attempt(
            rate=float(rate),
            degree=problem.family.degree,
            floor=problem.floor,
            route=proposal.route,
            outcome=Proven() if isinstance(outcome, VerifiedMetric) else outcome,
            condition_number=number,
        )
        self.attempts.append(attempt)
        if isinstance(outcome, VerifiedMetric):
            self.proven.append(outcome)
        if self.request.progress:
            words = attempt.outcome.tag if number is None else f"proven, condition number {number:.4g}"
            self.request.progress(
                Step(phase=Phase.SYNTHESIS, name=f"rate {attempt.rate:.4g}, degree {attempt.degree}: {words}")
            )
        return outcome


def _largest(works: Callable[[Fraction], bool]) -> Fraction | None:
    """The largest factor seen to work: bisected in (0, 1), a few times only."""
    low, high = Fraction(0), Fraction(1)
    for _ in range(_LOOKS):
        middle = (low + high) / 2
        low, high = (middle, high) if works(middle) else (low, middle)
    return low or None


def shrunk(box: Sequence[tuple[Fraction, Fraction]], factor: Fraction) -> Box:
    """The box scaled about its centre."""
    result = []
    for low, high in box:
        centre, half = (low + high) / 2, (high - low) / 2 * factor
        result.append((centre - half, centre + half))
    return tuple(result)
