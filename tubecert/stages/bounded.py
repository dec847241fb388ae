"""Every constant over the tube, enclosed from both sides, and the problem that the theorems are asked about."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import isfinite
from typing import TypeVar

from tubecert.bounds.clearance import Section, clearance
from tubecert.bounds.compute import bound_constants
from tubecert.bounds.constants import BoundConstants
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.wind import residual_constants, wind_constants
from tubecert.certificate.result import ClearanceData
from tubecert.certificate.sections import declared_uncertainty
from tubecert.claims.advice import DeclareUncertaintyBound, RaiseBudget, ShrinkTube
from tubecert.claims.statements import ConstantBounded, UncertaintyBound
from tubecert.conditions.inputs import LimitedInput
from tubecert.conditions.problem import TubeProblem, Wind
from tubecert.coordinates import Coordinates, Fields
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.constant import Constant, printable_above
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Interval, fraction_bounds, sqrt
from tubecert.enclosure.objective import SumOfNorms
from tubecert.expression import number_text
from tubecert.kinds.table import needed_by_all
from tubecert.metric.geodesic import GeodesicTest, unique_geodesics
from tubecert.model import TIME
from tubecert.spec import Obstacle
from tubecert.stages.metric import finite
from tubecert.stages.question import Question, Stopped, stopped
from tubecert.stages.tube import TubeFound
from tubecert.tube import Tube
from tubecert.verdict import Verdict

T = TypeVar("T")
_SHARP = 1e-4  # of the width of its limits: how closely u* is enclosed at least


@dataclass(frozen=True, kw_only=True)
class Enclosed:
    """The constants over the tube; some may have no finite bound, and declared ones may be broken.

    `gaps`: the relative gaps, by name, of constants that were not enclosed to the gap of the question; `work`: about
    how much each of them took, against the others.
    """

    tube: TubeFound
    suprema: Suprema
    problem: TubeProblem
    gaps: Mapping[str, Fraction] = field(default_factory=dict)
    work: Mapping[str, int] = field(default_factory=dict)

    @property
    def question(self) -> Question:
        """What is asked."""
        return self.tube.question

    @property
    def constants(self) -> BoundConstants:
        """Every constant, by name."""
        return self.problem.constants


@dataclass(frozen=True, kw_only=True)
class Bounded:
    """What every kind needs is bounded, and what was declared holds.

    `half_widths`: |x_i - x_i*| is below, per state, and |c'(x - x*)|, per output. `geodesics`: whether minimising
    geodesics are proven unique.
    """

    enclosed: Enclosed
    half_widths: Mapping[str, float]
    geodesics: GeodesicTest
    clearances: tuple[ClearanceData, ...] = ()
    inputs: tuple[LimitedInput, ...] = ()

    def __post_init__(self) -> None:
        if _endless(self.enclosed) is not None:
            raise ValueError("a constant that every kind needs has no bound")

    @property
    def question(self) -> Question:
        """What is asked."""
        return self.enclosed.question

    @property
    def problem(self) -> TubeProblem:
        """What the theorems are asked about."""
        return self.enclosed.problem


def enclose(tube: TubeFound, gaps: Mapping[str, Fraction] | None = None) -> Enclosed:
    """Every constant over the tube; with `gaps`, those that are named to gaps of their own."""
    question, own = tube.question, dict(gaps or {})
    work: Counter[str] = Counter()
    now: Counter[str] = Counter()
    fresh = replace(
        question.suprema(tube.plan),
        coordinates=tube.coordinates,
        gaps={name: float(gap) for name, gap in own.items()},
        spent=(lambda name, boxes: now.update({name: boxes})) if own else None,
    )
    suprema = fresh.with_radius(tube.rho, tube.sides)
    declared = declared_in(tube.coordinates, declared_uncertainty(question.spec))
    metric = tube.lower, tube.upper

    def apart(names: tuple[str, ...], compute: Callable[[], T]) -> T:
        """What is known of constants to the same gaps, whatever those of others are."""
        closely = {name: number_text(own[name]) for name in names if name in own}
        on = tube.ground | {"constants": list(names), "closely": closely}

        def counted() -> tuple[T, Counter[str]]:
            now.clear()
            return compute(), Counter(now)

        found, boxes = question.memory.recall("constant", on, counted)
        work.update(boxes)
        return found

    if own:
        constants = bound_constants(suprema, question.start, metric, declared, apart)
    else:
        constants = question.memory.recall(
            "constants", tube.ground, lambda: bound_constants(suprema, question.start, metric, declared)
        )
    problem = _problem(tube, suprema, constants)
    return Enclosed(tube=tube, suprema=replace(suprema, spent=None), problem=problem, gaps=own, work=work)


def declared_in(coordinates: Coordinates | None, declared: Mapping[str, Constant]) -> Mapping[str, Constant]:
    """Declared bounds in the coordinates of the tube: a Lipschitz constant in x is one in z, times |S^-1|."""
    if coordinates is None:
        return declared
    stretch = Interval.exact(supremum(SumOfNorms([coordinates.S_inverse]), BoxDomain({}), Effort()).above)
    return {
        name: Constant(below=0.0, above=printable_above(float((Interval.exact(bound.above) * stretch).hi)))
        if name == "h_x"
        else bound
        for name, bound in declared.items()
    }


def bound(enclosed: Enclosed) -> Bounded | Stopped:
    """The constants, if they are bounded and as declared; then what else is told of the tube."""
    spec = enclosed.question.spec
    return unmet(enclosed) or Bounded(
        enclosed=enclosed,
        half_widths=half_widths(enclosed),
        geodesics=_geodesics(enclosed),
        clearances=tuple(_cleared(enclosed, obstacle) for obstacle in spec.obstacles),
        inputs=tuple(_limited(enclosed, name, limits) for name, limits in spec.limits),
    )


def unmet(enclosed: Enclosed) -> Stopped | None:
    """What keeps the theorems from being asked at all: a constant without a bound, a declared one that is broken."""
    return _unbounded(enclosed) or _undeclared(enclosed)


def _limited(enclosed: Enclosed, name: str, limits: tuple[Fraction, Fraction]) -> LimitedInput:
    """What u* does on the plan, in an input with limits."""
    low, high = limits
    sharp = _SHARP * float(high - low)
    least, greatest = enclosed.suprema.input_range(enclosed.question.spec.inputs.index(name), sharp)
    return LimitedInput(
        name=name,
        limits=limits,
        least=least.printable(),
        greatest=greatest.printable(),
        any_plan=not enclosed.question.spec.trajectory.known,
    )


def _cleared(enclosed: Enclosed, obstacle: Obstacle) -> ClearanceData:
    """How far the tube keeps from an obstacle."""
    tube, states = enclosed.tube, enclosed.question.spec.states
    first, second = (states.index(name) for name in obstacle.states)
    shape = enclosed.suprema.shape_in(first, second)
    section = Section(columns=(first, second), reach=_reach(tube), shape=shape, upper=_largest(tube))
    found = clearance(tube.plan, obstacle, section, enclosed.question.effort)
    return ClearanceData(
        verdict=found.verdict,
        decides=obstacle.decides,
        clearance=Constant(below=found.below, above=found.above).printable(),
        t=found.t,
        shape=shape,
        inside=found.inside,
    )


def _largest(tube: TubeFound) -> float:
    """A bound of lmax(M) in x over the tube: M = S'M_z S, so at most A times the sum of the squares of S."""
    if tube.coordinates is None:
        return tube.upper.above
    square = sum(row[i] for i, row in enumerate(tube.coordinates.gram))
    return fraction_bounds(Fraction(tube.upper.above) * square)[1]


def _reach(tube: TubeFound) -> Interval:
    """dbar = sqrt(a) rho, from below what the distance cannot reach."""
    return sqrt(Interval.exact(tube.lower.below)) * Interval.of(tube.rho)


def _problem(tube: TubeFound, suprema: Suprema, constants: BoundConstants) -> TubeProblem:
    question = tube.question
    spec, adaptation = question.spec, question.spec.adaptation
    epsilon, rho_a = tube.radii
    wind, blows = spec.disturbance, wind_constants(suprema, constants.metric_input_gain)
    return TubeProblem(
        constants=constants,
        wind=None if wind is None or blows is None else Wind(bound=wind.length, constants=blows),
        residual=residual_constants(suprema),
        gained=bool(question.model.gained),
        rate=question.model.rate,
        epsilon=epsilon,
        rho_a=rho_a,
        rho_r=tube.rho - rho_a,
        rho=tube.rho,
        horizon=spec.trajectory.horizon,
        states=len(spec.states),
        predictor_gain=adaptation.predictor_gain,
        smooth=adaptation.smooth,
    )


def _endless(enclosed: Enclosed) -> str | None:
    """A constant without a bound that every kind needs; what only some of them need is for those to say."""
    needed = needed_by_all(enclosed.problem)
    return next(
        (
            name
            for name, value, _ in enclosed.constants.items()
            if name in needed and not isfinite(value.above)
        ),
        None,
    )


def _unbounded(enclosed: Enclosed) -> Stopped | None:
    name = _endless(enclosed)
    if name is None:
        return None
    at = getattr(enclosed.constants, name).at
    relax = (RaiseBudget(), ShrinkTube())
    return stopped(enclosed, ConstantBounded(constant=name), Verdict.UNDECIDED, where=at, relax=relax)


def _undeclared(enclosed: Enclosed) -> Stopped | None:
    """Declared bounds of h must cover the h that is given as expressions."""
    declared = declared_uncertainty(enclosed.question.spec)
    if not declared or enclosed.question.model.h is None:
        return None
    # what is declared is about x, whatever the coordinates of the tube
    in_x = Fields(enclosed.question.model, None)
    suprema = replace(enclosed.suprema, gaps={})
    for name, derived in zip(("h", "h_x", "h_t"), suprema.uncertainty(in_x), strict=True):
        if name in declared and derived.above > declared[name].above:
            broken = derived.below > declared[name].above
            claim = UncertaintyBound(
                constant=name, declared=declared[name].above, reaches=finite(derived.below)
            )
            relax = (DeclareUncertaintyBound(constant=name, value=finite(derived.above)),)
            verdict = Verdict.REFUTED if broken else Verdict.UNDECIDED
            return stopped(enclosed, claim, verdict, where=derived.at, relax=relax)
    return None


def half_widths(enclosed: Enclosed) -> dict[str, float]:
    """|x_i - x_i*| <= sqrt(W_ii) d with d < dbar = sqrt(a) rho, and never more than rho; or the sides of the tube.

    Those of the outputs follow.
    """
    tube = enclosed.tube
    states = tube.question.spec.states
    if tube.sides is not None:
        return dict(zip(states, map(printable_above, tube.sides), strict=True)) | _of_outputs(enclosed)
    reach, most = _reach(tube), fraction_bounds(tube.rho)[1]
    found = {
        name: printable_above(min(float((Interval.exact(width.above) * reach).hi), most))
        for name, width in zip(states, enclosed.suprema.half_widths(), strict=True)
    }
    return found | _of_outputs(enclosed)


def _of_outputs(enclosed: Enclosed) -> dict[str, float]:
    """|c'(x - x*)| <= sqrt(c'W c) d for every output, (1.8), and in a ball never more than |c| rho."""
    tube, found = enclosed.tube, {}
    outputs = zip(enclosed.question.spec.outputs, enclosed.suprema.output_widths(), strict=True)
    for output, width in outputs:
        most = float((Interval.exact(width.above) * _reach(tube)).hi)
        if tube.sides is None:
            square = sum((factor**2 for factor in output.row), start=Fraction(0))
            most = min(most, float((sqrt(Interval.of(square)) * Interval.of(tube.rho)).hi))
        found[output.name] = printable_above(most)
    return found


def _geodesics(enclosed: Enclosed) -> GeodesicTest:
    """Whether minimising geodesics are proven unique; if not, that stays an assumption."""
    question, plan, suprema = enclosed.question, enclosed.tube.plan, enclosed.suprema
    model = question.model
    tube = Tube(plan, suprema.section, states=model.states, inputs=model.inputs, time=plan.time.get(TIME))
    effort = question.effort_of("geodesics")
    return question.memory.recall(
        "geodesics",
        enclosed.tube.ground,
        lambda: unique_geodesics(suprema.fields, tube, suprema.rho, effort),
    )
