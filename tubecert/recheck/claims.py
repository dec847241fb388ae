"""All claims of a certificate in their order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from flint import arb, ctx

from tubecert.recheck import clearances, consistency, geodesics, inputs, metric, start
from tubecert.recheck import wind as disturbed
from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.conditions import USED, Numbers, Setting, WindNumbers
from tubecert.recheck.constants import OVER_TUBE, bounded, contained, half_width, largest_push
from tubecert.recheck.coordinates import Coordinates
from tubecert.recheck.cover import SHARP, Claim, Outcome, stated, together
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
    yield Claim("the specification and what repeats it", None, lambda: consistency.specification(result))
    yield Claim("the claim is that of the specification", None, lambda: consistency.claimed(result))
    yield Claim("bounds are intervals", None, lambda: consistency.bounds(result))


def of_certified(case: Case) -> Iterator[Claim]:
    """Every claim that a verdict `certified` rests on, and those that stand beside it."""
    result = case.result
    yield Claim("the verdict follows from the sections", None, lambda: consistency.verdict(result))
    yield Claim("assumptions are complete", None, lambda: consistency.assumptions(result, case.system))
    yield from _on_set(case)
    yield from _tube(case)
    yield from _clearances(case)
    yield from _planned_inputs(case)
    yield from _constants(case)
    yield from _gains(case)


def _on_set(case: Case) -> Iterator[Claim]:
    s, budget, whole, shown = case.system, case.budget, case.whole, case.metric
    on_set = metric.on_set(s)
    yield Claim("f, B, W, h and the plan are smooth", (*case.over_tube,), lambda: _smooth(case))
    yield Claim("rank(B) = m on the safe set", whole, lambda: metric.full_rank(s, budget))
    lower = None if shown.lower_on_set is None else shown.lower_on_set.below
    upper = None if shown.upper_on_set is None else shown.upper_on_set.above
    if lower is not None:
        yield Claim(
            f"C1: M >= {float(lower):.6g} I on the safe set",
            (*whole, lower),
            lambda: metric.lower_bound(s, lower, on_set, budget),
        )
    if upper is not None:
        yield Claim(
            f"C1: M <= {float(upper):.6g} I on the safe set",
            (*whole, upper),
            lambda: metric.upper_bound(s, upper, on_set, budget),
        )
    yield Claim(
        "C1 has bounds on the safe set",
        (lower is None, upper is None),
        lambda: stated(None not in (lower, upper), "there are none"),
    )
    yield from _declared(case)
    yield Claim("C3: the Killing condition", whole, lambda: metric.killing(s))
    if len(s.inputs) < len(s.states):
        most = _rate_margin(case)
        yield Claim(
            f"C2 on the safe set at rate {float(s.rate):.6g} + {float(most):.4g}",
            (*whole, most),
            lambda: metric.contraction(s, most, budget) if most > 0 else stated(False, "no margin"),
        )


def _declared(case: Case) -> Iterator[Claim]:
    """What the specification itself says of M on the safe set."""
    s, own = case.system, case.result.specification.metric
    assert isinstance(own, Metric)
    for relation, bound, holds in (
        (">=", own.lower, metric.lower_bound),
        ("<=", own.upper, metric.upper_bound),
    ):
        if bound is not None:
            yield Claim(
                f"metric.bounds: M {relation} {float(bound):.6g} I on the safe set",
                case.whole,
                lambda bound=bound, holds=holds: holds(s, bound, metric.on_set(s), case.budget),  # type: ignore[misc]
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
        yield Claim(
            "the plan serves its task", (*case.whole, case.knots), lambda: serves(trajectory, plan), SHARP
        )
    yield Claim(
        f"rho = {float(place.rho):.6g} is large enough",
        (*case.over_tube, lower, upper, case.tube.epsilon, case.tube.rho_a),
        lambda: _radius(case),
        SHARP,
    )
    yield Claim("the tube lies in the safe set", case.over_tube, lambda: contained(place))
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
            lambda obstacle=obstacle, own=own: clearances.shaped(place, obstacle, own.shape),  # type: ignore[misc]
        )
        if own.verdict != "certified" or lower is None or own.clearance.below is None:
            continue
        yield Claim(
            f"clearance from obstacle {k} >= {float(own.clearance.below):.6g}",
            (*case.over_tube, obstacle, own, lower),
            lambda obstacle=obstacle, own=own: clearances.keeps_away(place, obstacle, own, lower),  # type: ignore[misc]
        )


def _planned_inputs(case: Case) -> Iterator[Claim]:
    for own in case.result.inputs:
        yield Claim(
            f"{own.name}* of the plan is in the range that is stated",
            (*case.over_tube, own.name, own.least, own.greatest),
            lambda own=own: inputs.on_plan(case.place, own),  # type: ignore[misc]
        )


def _constants(case: Case) -> Iterator[Claim]:
    place, over = case.place, case.over_tube
    B, upper = case.bound_if_any("B"), case.bound_if_any("upper")
    for name in OVER_TUBE:
        limit = case.bound_if_any(name)
        if limit is None:
            continue
        relation = ">=" if name in INFIMA else "<="
        yield Claim(
            f"{name} {relation} {float(limit):.6g}",
            (*over, limit, (B, upper) if name == "feedback_gain" else None),
            lambda name=name, limit=limit: bounded(place, name, limit, largest_push(B, upper)),  # type: ignore[misc]
        )
    d0, H0 = case.bound_if_any("initial_distance"), case.bound_if_any("h_initial")
    if d0 is not None:
        yield Claim(
            f"initial_distance <= {float(d0):.6g}",
            (*over, d0, upper),
            lambda: start.distance(place, d0, case.bound("upper")),
        )
    if H0 is not None:
        yield Claim(f"h_initial <= {float(H0):.6g}", (*over, H0), lambda: start.uncertainty(place, H0))
    yield from _beside(case)
    test = case.metric.unique_geodesics
    if test is not None and test.holds:
        value = test.value.above
        yield Claim(
            "geodesics are unique",
            (*over, value),
            lambda: (
                geodesics.unique(place, value)
                if value is not None and value < 1
                else stated(False, "the test is not below 1")
            ),
        )


def _beside(case: Case) -> Iterator[Claim]:
    """The constants of a disturbance and of unknown parameters, as far as they are bounded."""
    place, over = case.place, case.over_tube
    beta, eps = case.bound_if_any("metric_input_gain"), None
    if case.system.wind is not None:
        eps = case.bound_if_any("wind_explained")
    matched = None if beta is None or eps is None else beta * eps
    for name in disturbed.CONSTANTS if case.system.wind is not None else ():
        limit = case.bound_if_any(name)
        if limit is not None:
            yield Claim(
                f"{name} <= {float(limit):.6g}",
                (*over, limit, matched),
                lambda name=name, limit=limit: disturbed.bounded(place, name, limit, matched),  # type: ignore[misc]
            )
    for name in disturbed.OF_UNKNOWN if case.system.unknown is not None else ():
        limit = case.bound_if_any(name)
        if limit is not None:
            yield Claim(
                f"{name} <= {float(limit):.6g}",
                (*over, limit),
                lambda name=name, limit=limit: disturbed.unknown_bounded(place, name, limit),  # type: ignore[misc]
            )


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
                lambda section=section, missing=missing: _silent(section, missing),  # type: ignore[misc]
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
