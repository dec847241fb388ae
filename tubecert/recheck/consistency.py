"""What the parts of a certificate say about one another, compared exactly: no arithmetic beyond equality.

The statements of assumptions are part of the claim: they must be those of this format, one by one.

The claim in the certificate's own words, derived again from this room's reading of the specification.

`claim`: the state stays within the tube around the plan, over which time (and why for all of it, if there is no
horizon), on which set the metric is one, from which start, against which uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

from tubecert.recheck import clearances, inputs
from tubecert.recheck.cover import CONFIRMED, Outcome, stated
from tubecert.recheck.document import Enclosure
from tubecert.recheck.kinds.kind import Statements
from tubecert.recheck.kinds.table import KINDS
from tubecert.recheck.monomials import degree
from tubecert.recheck.reasons import Assumption
from tubecert.recheck.result import Claim, Geodesics, Result, TubeSection, Wind
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.loop import LETTERS, Disturbance
from tubecert.recheck.specified.plant import Metric, Wanted
from tubecert.recheck.specified.trajectory import AnyPlan, Planned, Resting, Tabled
from tubecert.recheck.system import System
from tubecert.recheck.terms import names
from tubecert.recheck.times import period_of

_CLAIMS_ONLY = "the verdict is certified, but"
_CURVE = "hermite"  # between knots x* is the cubic whose slopes at its ends are f(x*) + B(x*) u*


def specification(result: Result) -> Statements:
    """What is repeated from the specification is the same there."""
    spec, metric, tube, plan = result.specification, result.metric, result.tube, result.plan
    yield result.effective_hash == spec.hash, "spec.effective_hash is not that of spec.effective"
    yield result.safe_set == spec.plant.safe_set, "safe_set is not that of the specification"
    if metric is not None and isinstance(spec.metric, Metric):
        same = metric.dual_metric == spec.metric.texts
        yield same, "metric.dual_metric is not that of the specification"
        yield metric.rate == spec.metric.rate, "metric.rate is not that of the specification"
    if tube is not None:
        yield from _tube(tube, spec)
    trajectory = spec.trajectory
    yield plan.kind == trajectory.kind, "plan.kind is not that of the specification"
    if plan.interpolation is not None:
        between = "exact"
        if isinstance(trajectory, (Tabled, Planned)):
            between = trajectory.between
        yield plan.interpolation == between, "plan.interpolation is not that of the specification"
        yield plan.curve in (None, _CURVE), "plan.curve is not what lies between knots"
    given = spec.uncertainty
    wanted = given.declared if given.h is None else {}
    yield result.declared.keys() == wanted.keys(), "declared is not what the specification declares"
    for name, value in wanted.items():  # rounded up where a float lies below the decimal
        shown = result.declared[name]
        used = None if result.constants is None or _rescaled(name, tube) else result.constants[name].above
        within = value <= shown and (used is None or shown <= used)
        yield within, f"declared.{name} is not between the specification's and the constant"
    yield from _overrides(result)
    yield from _synthesised(result)


def _rescaled(name: str, tube: TubeSection | None) -> bool:
    """A Lipschitz constant in x is another one in other coordinates; that it serves is examined with the constant."""
    return name == "h_x" and tube is not None and tube.coordinates is not None


def _tube(tube: TubeSection, spec: Specification) -> Statements:
    for name, own, given in (("epsilon", tube.epsilon, spec.epsilon), ("rho_a", tube.rho_a, spec.rho_a)):
        # within half-widths, rho_a may be more than there is room for
        asked = given is not None and not (name == "rho_a" and spec.half_widths and own < given)
        yield own == given if asked else own > 0, f"tube.{name} is not that of the specification"
    yield tube.rho_r in (None, tube.rho - tube.rho_a), "tube.rho_r is not rho - rho_a"
    shown = tube.coordinates is not None
    yield spec.coordinates or not shown, "tube.coordinates were not asked for"
    yield shown or not spec.coordinates or tube.half_widths is None, "tube.coordinates are missing"
    yield not shown or tube.half_widths is not None, "tube.half_widths are missing"
    for name, most in spec.half_widths.items():
        widths = tube.half_widths
        yield widths is None or widths[name] <= most, f"tube.half_widths.{name} is more than was asked for"


def _overrides(result: Result) -> Statements:
    given, spec, sections = result.overrides, result.specification, result.sections
    for name, own, value in (("epsilon", given.epsilon, spec.epsilon), ("rho_a", given.rho_a, spec.rho_a)):
        yield own in (None, value), f"overrides.{name} is not what spec.effective has"
    for path, (set_, had) in given.settings.items():
        yield set_ == had, f"overrides.settings.{path} is not what spec.effective has"
    if sections is None:
        return
    for kind in KINDS:
        if kind.key in sections:
            yield from kind.asked(sections[kind.key], given.gains)


def _synthesised(result: Result) -> Statements:
    """A metric that was synthesised is what was asked for: rate, states, degree, how ill-conditioned it may be."""
    asked, metric, own = result.synthesised, result.metric, result.specification.metric
    if isinstance(own, Wanted):
        yield asked == own, "synthesis.asked is not what the specification asks for"
    if asked is None:
        return
    if isinstance(own, Metric):
        flat = [e for row in own.dual for e in row]
        within = asked.variables is None or names(flat) <= set(asked.variables)
        yield within, "the metric depends on states that were not asked for"
        yield asked.degree is None or degree(flat) <= asked.degree, "the degree of the metric is too large"
    yield result.overrides.metric is None, "a metric was given, and yet one was synthesised"
    if metric is None:
        return
    yield asked.rate is None or asked.rate <= metric.rate, "metric.rate is less than what was asked for"
    if asked.condition_number is not None and metric.lower_on_set and metric.upper_on_set:
        low, high = metric.lower_on_set.below, metric.upper_on_set.above
        serves = low is not None and high is not None and high <= asked.condition_number * low
        yield serves, "the condition number of the metric is larger than what was asked for"


def bounds(result: Result) -> Statements:
    """Every constant is an interval; those of the metric agree with the section on it."""
    constants, metric = result.constants or {}, result.metric
    for name, value in constants.items():
        yield value.is_interval, f"constants.{name} is not an interval"
    if metric is None:
        return
    for name, own in (("lower", metric.lower), ("upper", metric.upper)):
        yield own is None or own == constants.get(name), f"metric.{name} is not constants.{name}"
    intervals: dict[str, Enclosure | None] = {
        "lower_on_set": metric.lower_on_set,
        "upper_on_set": metric.upper_on_set,
        "margin": metric.margin,
        "largest_rate": metric.largest_rate,
        "unique_geodesics": None if metric.unique_geodesics is None else metric.unique_geodesics.value,
    }
    for name, pair in intervals.items():
        yield pair is None or pair.is_interval, f"metric.{name} is not an interval"


def verdict(result: Result) -> Statements:
    """The verdict is that of the sections that decide it, and so are its reasons."""
    sections, metric = result.sections, result.metric
    assert sections is not None
    assert metric is not None
    yield metric.verdict == "certified", f"{_CLAIMS_ONLY} metric.verdict is not"
    deciding = result.decided_by
    yield bool(deciding) and len(set(deciding)) == len(deciding), "decided_by is not a list of sections"
    yield (
        _as_wanted(result, deciding),
        "decided_by is not what the specification, or --conditions, wants to decide",
    )
    for name in deciding:
        section = sections.get(name)
        if section is None:
            yield False, f"decided_by names {name[:40]!r}, which is no section"
            return
        yield section.verdict == "certified", f"{_CLAIMS_ONLY} {name}, which decides, is not"
    for name, section in sections.items():
        whole = section.verdict != "certified" or not section.shortfalls
        yield whole, f"{name} is certified and lists shortfalls"
    yield from clearances.agrees(result.specification.obstacles, result.clearance)
    yield from inputs.agrees(result.specification.limits, result.inputs, sections, deciding)
    for reason in result.reasons:
        yield reason.verdict == "certified", f"{_CLAIMS_ONLY} a reason says otherwise"
        yield reason.claim == "gains_suffice", f"{_CLAIMS_ONLY} a reason is not that gains suffice"
        named = reason.parameters["section"]
        yield named in deciding, f"a reason names {str(named)[:40]!r}, which does not decide"
        own = next(kind.said(sections[kind.key]) for kind in KINDS if kind.key == named)
        same = all(value == own.get(key) for key, value in reason.parameters.items() if key != "section")
        yield same, f"a reason repeats {named} otherwise than it is"
        yield reason.at is None, "a reason of what is certified names a point"


def _as_wanted(result: Result, deciding: tuple[str, ...]) -> bool:
    """Where the specification says who decides, that is who decides, or what stands for it in the overrides."""
    wanted, instead = result.specification.loop.decides, result.overrides.conditions
    if wanted is None or result.sections is None:
        return instead is None
    letter = instead or wanted
    if letter != "all":
        return set(deciding) == {LETTERS[letter]}
    return set(deciding) == {kind.key for kind in KINDS if kind.adapts and kind.key in result.sections}


def assumptions(result: Result, s: System) -> Outcome:
    """The list of what is assumed is that of this format, each with the parameters of the specification."""
    geodesics = None if result.metric is None else result.metric.unique_geodesics
    wanted = _assumed(s, geodesics)
    for own, named in zip(result.assumptions, wanted, strict=False):
        if own != named:
            return stated(
                False, f"where it says {own.id} it should say {named.id} as the specification has it"
            )
    return stated(len(result.assumptions) == len(wanted), "the list has fewer or more entries than there are")


def _assumed(s: System, geodesics: Geodesics | None) -> list[Assumption]:
    return [
        Assumption("least_feedback", {}),
        _geodesics(s, geodesics),
        Assumption("start_at_rest", {}),
        Assumption("hard_projection", {})
        if s.smooth is None
        else Assumption("smooth_projection", {"layer": s.smooth}),
        Assumption("perfect_state", {}),
        Assumption("first_order_filter", {}),
        Assumption("for_all_time", {})
        if s.horizon is None
        else Assumption("up_to_horizon", {"horizon": s.horizon}),
        Assumption("uncertainty_as_declared", {})
        if s.h is None
        else Assumption("uncertainty_as_given", {"any_within_bounds": "h" in s.declared}),
        *([] if s.wind is None else [_blowing(s.wind)]),
        *([Assumption("parameters_within", {})] if s.ranges else []),
    ]


def _blowing(wind: Disturbance) -> Assumption:
    known = {"bound": wind.length, "rate": wind.rate}
    return Assumption("wind_within", {name: value for name, value in known.items() if value is not None})


def _geodesics(s: System, test: Geodesics | None) -> Assumption:
    if s.flat:
        return Assumption("straight_geodesics", {})
    if test is None:
        return Assumption("exact_geodesics", {"uniqueness": "assumed"})
    uniqueness = "proven" if test.holds else "assumed"
    return Assumption("exact_geodesics", {"uniqueness": uniqueness, "value": test.value})


def first(statements: Callable[[Result], Statements], result: Result) -> Outcome:
    """All of them, or the first that is not so."""
    return next((stated(False, why) for holds, why in statements(result) if not holds), CONFIRMED)


def own_claim(spec: Specification) -> Claim:
    """What a certificate of this specification claims; raises `ValueError` where it can claim nothing."""
    plan, horizon = spec.trajectory, spec.trajectory.horizon
    for_all_time = period = None
    if horizon is None:
        assert isinstance(plan, (Resting, AnyPlan)), "every other plan has a horizon"
        found = period_of(spec.uncertainty, spec.plant.moving)
        for_all_time = "periodic" if found.length else "autonomous"
        period = found.text if found.length else None
    return Claim(
        id="tube",
        horizon=horizon,
        for_all_time=for_all_time,
        period=period,
        domain=spec.plant.safe_set,
        start=spec.start,
        uncertainty=spec.uncertainty.words,
        plans=(plan.x, plan.u, plan.defect) if isinstance(plan, AnyPlan) else None,
        wind=None if spec.disturbance is None else Wind(spec.disturbance.length, spec.disturbance.rate),
        parameters=spec.plant.ranges or None,
    )


def claimed(result: Result) -> Outcome:
    """Whether `claim` is what follows from the specification."""
    own = own_claim(result.specification)
    names = [item.name for item in fields(Claim)]
    other = [name for name in names if getattr(own, name) != getattr(result.claim, name)]
    return stated(not other, f"claim.{', '.join(other)} is not that of the specification")
