"""All claims of a certificate in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

from flint import arb, ctx

from tubecert.recheck import clearances, consistency, geodesics, inputs, metric, start
from tubecert.recheck import wind as disturbed
from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.conditions import USED, Numbers, Setting, WindNumbers
from tubecert.recheck.constants import OVER_TUBE, bounded, contained, half_width, largest_push
from tubecert.recheck.coordinates import Coordinates
from tubecert.recheck.cover import SHARP, Claim, Domain, Outcome, stated, together
from tubecert.recheck.curve import Curve
from tubecert.recheck.document import Enclosure, digest
from tubecert.recheck.kinds.kind import Ground, Kind, Section
from tubecert.recheck.kinds.table import KINDS
from tubecert.recheck.place import Place
from tubecert.recheck.plans import serves
from tubecert.recheck.result import INFIMA, MEASURED, MetricSection, Result, TubeSection
from tubecert.recheck.specified.numbers import TIME
from tubecert.recheck.specified.plant import Metric
from tubecert.recheck.specified.trajectory import Expressed, Planned
from tubecert.recheck.system import System, curve_of, system_of
from tubecert.recheck.terms import all_zero

Bound = Callable[[System, Fraction, Domain, int], Outcome]


@dataclass(frozen=True)
class Case:
    """A certificate with a metric, read."""

    result: Result
    budget: int

    @cached_property
    def system(self) -> System:
        """Its system."""
        return system_of(self.result.specification)

    @cached_property
    def curve(self) -> Curve:
        """The plan."""
        with ctx.workprec(SHARP):
            s, trajectory = self.system, self.result.specification.trajectory
            drift = [row[0] for row in s.drift]
            return curve_of(
                trajectory, self.result.plan, s.states, s.inputs, drift, times=s.time, period=s.period
            )

    @cached_property
    def metric(self) -> MetricSection:
        """What is claimed of the metric."""
        assert self.result.metric is not None
        return self.result.metric

    @cached_property
    def tube(self) -> TubeSection:
        """What is claimed of the tube."""
        assert self.result.tube is not None
        return self.result.tube

    @cached_property
    def constants(self) -> dict[str, Enclosure]:
        """What is claimed of the constants."""
        assert self.result.constants is not None
        return self.result.constants

    @cached_property
    def sections(self) -> dict[str, Section]:
        """What is claimed of gains."""
        assert self.result.sections is not None
        return self.result.sections

    @cached_property
    def place(self) -> Place:
        """The tube."""
        tube, states = self.tube, self.system.states
        if tube.coordinates is None or tube.half_widths is None:
            return Place(self.system, self.curve, tube.rho, self.budget)
        sides = tuple(tube.half_widths[name] for name in states)
        return Place(self.system, self.curve, tube.rho, self.budget, Coordinates(tube.coordinates), sides)

    @cached_property
    def setting(self) -> Setting:
        """The constants on their safe sides."""
        with ctx.workprec(SHARP):
            bounds = {name: self.bound_if_any(name) for name in USED}
            # what has no bound is not a number: no comparison with what rests on it can hold
            values = {name: arb("nan") if q is None else exact(q) for name, q in bounds.items()}
            rest = [arb(0), arb(0)]
            if self.system.unknown is not None:  # theory 7: it pushes and drifts as if the plan did
                rest = [self._ball(name) for name in disturbed.OF_UNKNOWN]
                values["plan_defect_metric"] += rest[0]
                values["drift_on_plan"] += rest[1]
            return Setting(
                self.system,
                Numbers(**values),
                self.place.rho,
                self.tube.rho_a,
                self._wind,
                turns=not all(map(all_zero, self.place.fields.slopes(self.system.B))),
                rest=rest[1],
            )

    @property
    def _wind(self) -> WindNumbers | None:
        """What a disturbance does, if there is one."""
        wind = self.system.wind
        if wind is None:
            return None
        push, size, explained = (self._ball(name) for name in disturbed.CONSTANTS)
        return WindNumbers(push, size, explained, exact(wind.length))

    def _ball(self, name: str) -> Ball:
        """The upper end of a constant, not a number where it has none."""
        found = self.bound_if_any(name)
        return arb("nan") if found is None else exact(found)

    def bound(self, name: str) -> Fraction:
        """The side of a constant that the conditions use; raises `ValueError` where there is none."""
        found = self.bound_if_any(name)
        if found is None:
            raise ValueError(f"{name} has no bound")
        return found

    def bound_if_any(self, name: str) -> Fraction | None:
        """The same; None where the certificate states that none was found: it claims nothing of the constant then."""
        value = self.constants[name]
        return value.below if name in INFIMA else value.above

    @cached_property
    def whole(self) -> tuple[object, ...]:
        """What every claim about the system depends on."""
        return self.result.specification.content, self.budget

    @cached_property
    def over_tube(self) -> tuple[object, ...]:
        """What every claim over the tube depends on."""
        own = () if self.place.coordinates is None else (self.place.coordinates.S, self.place.sides)
        return *self.whole, self.knots, self.place.rho, *own

    @cached_property
    def knots(self) -> str:
        """The knots of the plan, as a hash."""
        return digest(repr(self.result.plan.knots))

    @cached_property
    def numbers(self) -> tuple[object, ...]:
        """What every claim about gains depends on."""
        used = (*USED, *(name for name in self.constants if name not in MEASURED))
        return *self.whole, self.place.rho, self.tube.rho_a, *(self.bound_if_any(name) for name in used)


def of_every(result: Result) -> Iterator[Claim]:
    """What every certificate says of itself, whatever its verdict."""
    yield Claim(
        "the specification and what repeats it",
        None,
        partial(consistency.first, consistency.specification, result),
    )
    yield Claim("the claim is that of the specification", None, partial(consistency.claimed, result))
    yield Claim("bounds are intervals", None, partial(consistency.first, consistency.bounds, result))


def of_certified(case: Case) -> Iterator[Claim]:
    """Every claim that a verdict `certified` rests on, and those that stand beside it."""
    result = case.result
    yield Claim(
        "the verdict follows from the sections", None, partial(consistency.first, consistency.verdict, result)
    )
    yield Claim("assumptions are complete", None, lambda: consistency.assumptions(result, case.system))
    yield from _on_set(case)
    yield from _tube(case)
    yield from _clearances(case)
    yield from _planned_inputs(case)
    yield from _constants(case)
    yield from _gains(case)


def _on_set(case: Case) -> Iterator[Claim]:
    s, budget, whole, shown = case.system, case.budget, case.whole, case.metric
    on_set, own = metric.on_set(s), case.result.specification.metric
    assert isinstance(own, Metric)
    yield Claim("f, B, W, h and the plan are smooth", case.over_tube, partial(_smooth, case))
    yield Claim("rank(B) = m on the safe set", whole, partial(metric.full_rank, s, budget))
    lower = None if shown.lower_on_set is None else shown.lower_on_set.below
    upper = None if shown.upper_on_set is None else shown.upper_on_set.above
    found = ((">=", lower, metric.lower_bound), ("<=", upper, metric.upper_bound))
    declared = ((">=", own.lower, metric.lower_bound), ("<=", own.upper, metric.upper_bound))

    def bounds(what: str, sides: tuple[tuple[str, Fraction | None, Bound], ...]) -> Iterator[Claim]:
        for relation, bound, holds in sides:
            if bound is not None:
                name = f"{what}: M {relation} {float(bound):.6g} I on the safe set"
                yield Claim(name, (*whole, bound), partial(holds, s, bound, on_set, budget))

    yield from bounds("C1", found)
    none = (lower is None, upper is None)
    yield Claim("C1 has bounds on the safe set", none, partial(stated, not any(none), "there are none"))
    yield from bounds("metric.bounds", declared)
    yield Claim("C3: the Killing condition", whole, partial(metric.killing, s))
    if len(s.inputs) < len(s.states):
        most = _rate_margin(case)
        yield Claim(
            f"C2 on the safe set at rate {float(s.rate):.6g} + {float(most):.4g}",
            (*whole, most),
            partial(metric.contraction, s, most, budget) if most > 0 else partial(stated, False, "no margin"),
        )


def _rate_margin(case: Case) -> Fraction:
    """The largest margin that is claimed for C2; 0 where none is."""
    margin, largest = case.metric.margin, case.metric.largest_rate
    margins = [
        Fraction(0) if margin is None or margin.below is None else margin.below,
        Fraction(0) if largest is None or largest.below is None else largest.below - case.system.rate,
    ]
    return max(margins) if margins[0] > 0 else Fraction(0)


def _smooth(case: Case) -> Outcome:
    s, trajectory = case.system, case.result.specification.trajectory
    time = s.times
    ranges = {**s.safe_set, **s.ranges, **({} if time is None else {TIME: time})}
    found = metric.smooth((*s.duties, *s.uncertainty.duties), ranges, case.budget)
    if not isinstance(trajectory, Expressed):
        return found
    along = metric.smooth(trajectory.duties, {TIME: (Fraction(0), trajectory.horizon)}, case.budget)
    return together([found, along])


def _tube(case: Case) -> Iterator[Claim]:
    place, trajectory, plan = case.place, case.result.specification.trajectory, case.result.plan
    lower, upper = case.bound_if_any("lower"), case.bound_if_any("upper")
    if isinstance(trajectory, Planned):
        key = *case.whole, case.knots
        yield Claim("the plan serves its task", key, partial(serves, trajectory, plan), SHARP)
    yield Claim(
        f"rho = {float(place.rho):.6g} is large enough",
        (*case.over_tube, lower, upper, case.tube.epsilon, case.tube.rho_a),
        partial(_radius, case),
        SHARP,
    )
    yield Claim("the tube lies in the safe set", case.over_tube, partial(contained, place))
    for name, width in (case.tube.half_widths or {}).items():
        yield Claim(
            f"half-width of {name} <= {float(width):.6g}",
            (*case.over_tube, case.system.lengths[name], width, lower),
            lambda name=name, width=width: half_width(  # type: ignore[misc]
                place, case.system.lengths[name], width, case.bound("lower")
            ),
        )


def _radius(case: Case) -> Outcome:
    """Rho holds both radii, and where these are asked for, what the start needs as well."""
    width = case.tube.epsilon + case.tube.rho_a
    if case.result.specification.half_widths:
        return stated(width <= case.place.rho, "it is smaller than epsilon + rho_a")
    return start.radius(case.place, width, case.bound("lower"), case.bound("upper"))


def _clearances(case: Case) -> Iterator[Claim]:
    place, lower = case.place, case.bound_if_any("lower")
    pairs = zip(case.result.specification.obstacles, case.result.clearance, strict=False)
    for k, (obstacle, own) in enumerate(pairs, start=1):
        yield Claim(
            f"W in the plane of {', '.join(obstacle.states)}",
            (*case.over_tube, obstacle.states, own.shape),
            partial(clearances.shaped, place, obstacle, own.shape),
        )
        if own.verdict != "certified" or lower is None or own.clearance.below is None:
            continue
        yield Claim(
            f"clearance from obstacle {k} >= {float(own.clearance.below):.6g}",
            (*case.over_tube, obstacle, own, lower),
            partial(clearances.keeps_away, place, obstacle, own, lower),
        )


def _planned_inputs(case: Case) -> Iterator[Claim]:
    for own in case.result.inputs:
        name = f"{own.name}* of the plan is in the range that is stated"
        key = *case.over_tube, own.name, own.least, own.greatest
        yield Claim(name, key, partial(inputs.on_plan, case.place, own))


def _limited(
    case: Case,
    names: Sequence[str],
    holds: Callable[[str, Fraction], Outcome],
    beside: Mapping[str, object] | None = None,
) -> Iterator[Claim]:
    """Constants that have a bound keep to it; what a claim depends on `beside` that, by name."""
    for name in names:
        limit = case.bound_if_any(name)
        if limit is not None:
            told = f"{name} {'>=' if name in INFIMA else '<='} {float(limit):.6g}"
            yield Claim(told, (*case.over_tube, limit, (beside or {}).get(name)), partial(holds, name, limit))


def _constants(case: Case) -> Iterator[Claim]:
    """Those over the tube, of the start, of a disturbance, of unknown parameters; the uniqueness of geodesics."""
    place, s, test = case.place, case.system, case.metric.unique_geodesics
    B, upper, beta = (case.bound_if_any(name) for name in ("B", "upper", "metric_input_gain"))
    yield from _limited(
        case,
        OVER_TUBE,
        lambda name, limit: bounded(place, name, limit, largest_push(B, upper)),
        {"feedback_gain": (B, upper)},
    )
    d0, H0 = "initial_distance", "h_initial"
    yield from _limited(case, [d0], lambda _, d: start.distance(place, d, case.bound("upper")), {d0: upper})
    yield from _limited(case, [H0], lambda _, h: start.uncertainty(place, h))
    if s.wind is not None:
        eps = case.bound_if_any("wind_explained")
        matched, own = None if beta is None or eps is None else beta * eps, disturbed.CONSTANTS
        yield from _limited(
            case, own, lambda name, q: disturbed.bounded(place, name, q, matched), dict.fromkeys(own, matched)
        )
    if s.unknown is not None:
        yield from _limited(case, disturbed.OF_UNKNOWN, partial(disturbed.unknown_bounded, place))
    if test is not None and test.holds:
        value, name = test.value.above, "geodesics are unique"
        if value is not None and value < 1:
            yield Claim(name, (*case.over_tube, value), partial(geodesics.unique, place, value))
        else:
            yield Claim(name, (value,), partial(stated, False, "the test is not below 1"))


def _gains(case: Case) -> Iterator[Claim]:
    sections, recipes = case.sections, case.result.recipes
    ground = Ground(setting=case.setting, constants=case.constants, depends=case.numbers)
    for kind in KINDS:
        section, own = sections[kind.key], ground
        missing = kind.uncovered(case.setting)
        if missing is not None:
            yield ground.claim(
                f"{kind.key}: it says that it covers no such disturbance",
                (section,),
                partial(_silent, section, missing),
            )
            own = replace(ground, setting=replace(case.setting, wind=None, rest=arb(0)), silent=True)
        yield from kind.claims(section, recipes.get(kind.key), own)
        yield from _inputs(case, kind, ground)


def _inputs(case: Case, kind: Kind[Any, Any], ground: Ground) -> Iterator[Claim]:
    """What a kind adds to inputs that have limits."""
    bounds = {own.name: own.bounds[kind.key] for own in case.result.inputs if kind.key in own.bounds}
    section, recipe = case.sections[kind.key], case.result.recipes.get(kind.key)
    if bounds:
        yield ground.claim(
            f"{kind.key}: what is added to u*",
            (tuple(bounds.items()), section, recipe),
            lambda: (
                stated(False, "it has no recipe")
                if recipe is None
                else inputs.added(kind.shares(section, recipe, ground), bounds)
            ),
        )


def _silent(section: Section, missing: str) -> Outcome:
    """A section that is not certified, and names why."""
    named = any(item.condition == missing for item in section.shortfalls)
    return stated(named and section.verdict != "certified", f"{missing} is not named")
