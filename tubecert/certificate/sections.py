"""What is proven as the values of a certificate: claim, metric, plan, constants, declared bounds, assumptions.

Numbers are rounded so that a reader of exact decimals reads a bound: see `enclosure.constant`.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from tubecert.bounds.constants import Constant, Meaning
from tubecert.certificate.result import (
    Blowing,
    Bound,
    Claimed,
    KnotTexts,
    MetricData,
    PlanData,
    Plans,
    Samples,
    Start,
)
from tubecert.claims.assumptions import (
    ExactGeodesics,
    FirstOrderFilter,
    ForAllTime,
    HardProjection,
    LeastFeedback,
    ParametersWithin,
    PerfectState,
    SmoothProjection,
    StartAtRest,
    StraightGeodesics,
    UncertaintyAsDeclared,
    UncertaintyAsGiven,
    UpToHorizon,
    WindWithin,
)
from tubecert.claims.family import Assumption
from tubecert.enclosure.constant import printable_above, printable_below
from tubecert.enclosure.interval import Interval
from tubecert.expression import number_text
from tubecert.metric.geodesic import GeodesicTest
from tubecert.metric.verify import MetricProof
from tubecert.model import ControlAffineModel
from tubecert.spec import Bundle, Disturbance, Spec, canonical
from tubecert.trajectory import Plan

_SAMPLES = 201


def declared_metric(spec: Spec) -> tuple[Constant, Constant] | None:
    """The declared (a, A), if both are declared."""
    metric = spec.metric
    if metric is None or metric.lower is None or metric.upper is None:
        return None
    return _exactly(metric.lower), _exactly(metric.upper)


def declared_uncertainty(spec: Spec) -> dict[str, Constant]:
    """The declared bounds of h, h_x and h_t, by name."""
    bounds = spec.uncertainty.bounds
    if bounds is None:
        return {}
    values = {"h": bounds.h, "h_x": bounds.h_x, "h_t": bounds.h_t}
    return {name: _exactly(value) for name, value in values.items() if value is not None}


def _exactly(value: Fraction) -> Constant:
    return Constant(below=printable_below(value), above=printable_above(value))


def declared_data(spec: Spec) -> dict[str, float]:
    """What is believed, not proven: bounds of an h that is not given as expressions."""
    if spec.uncertainty.h is not None or spec.uncertainty.bounds is None:
        return {}
    return {name: constant.above for name, constant in declared_uncertainty(spec).items()}


def claim_data(spec: Spec, period: tuple[Fraction, bool] | None) -> Claimed:
    """`result.claim`: what is claimed, in words of its own. `period` of h as (q, whether times pi), in s.

    The checker derives it again from its own reading of the specification. `bounds` count beside an expression only
    if |h| itself is declared: else H0 is that of the expression.
    """
    horizon, bounds = spec.trajectory.horizon, spec.uncertainty.bounds
    periodic = horizon is None and period is not None
    return Claimed(
        id="tube",
        horizon=None if horizon is None else number_text(horizon),
        for_all_time=None if horizon is not None else "periodic" if periodic else "autonomous",
        period=_period_text(*period) if periodic and period is not None else None,
        domain={
            name: (number_text(low), number_text(high))
            for name, (low, high) in zip(spec.states, spec.safe_set, strict=True)
        },
        start=_start(spec),
        plans=None if spec.trajectory.bundle is None else _plans(spec, spec.trajectory.bundle),
        uncertainty="bounds"
        if spec.uncertainty.h is None
        else "expression"
        if bounds is None or bounds.h is None
        else "expression_or_bounds",
        wind=None if spec.disturbance is None else _wind(spec.disturbance),
        parameters={name: (number_text(low), number_text(high)) for name, (low, high) in spec.ranges} or None,
    )


def _wind(wind: Disturbance) -> Blowing:
    return Blowing(bound=number_text(wind.length), rate=None if wind.rate is None else number_text(wind.rate))


def _start(spec: Spec) -> Start:
    if spec.within is not None:
        return Start(within=number_text(spec.within))
    if not spec.start_box:
        return Start(at=tuple(map(number_text, spec.x0)))
    sides = zip(spec.states, spec.start_box, strict=True)
    return Start(box={name: (number_text(low), number_text(high)) for name, (low, high) in sides})


def _plans(spec: Spec, bundle: Bundle) -> Plans:
    x, u = (
        {name: (number_text(low), number_text(high)) for name, (low, high) in zip(names, box, strict=True)}
        for names, box in ((spec.states, bundle.x), (spec.inputs, bundle.u))
    )
    return Plans(x=x, u=u, defect=number_text(bundle.defect))


def _period_text(q: Fraction, of_pi: bool) -> str:
    """An exact period in s, as `2/3`, `pi` or `2/3*pi`."""
    return str(q) if not of_pi else "pi" if q == 1 else f"{q}*pi"


def metric_data(spec: Spec, proof: MetricProof) -> MetricData:
    """`result.metric` as far as C1-C3 on the safe set tell.

    The margin is that of the rate as it is printed: a small difference would tell rounding errors of the whole.
    """
    metric = spec.metric
    if metric is None:
        raise ValueError("a proof is about a metric")
    largest = _printable(proof.largest_rate)
    return MetricData(
        rate=metric.rate,
        dual_metric=tuple(map(tuple, canonical(spec)["metric"]["dual_metric"])),
        verdict=proof.verdict,
        margin=None if largest is None else _beyond(largest, metric.rate),
        largest_rate=largest,
        lower_on_set=_printable(proof.lower_on_set),
        upper_on_set=_printable(proof.upper_on_set),
    )


def _beyond(rate: Constant, asked: Fraction) -> Constant:
    margin = Interval(rate.below, rate.above) - Interval.of(asked)
    return Constant(below=float(margin.lo), above=float(margin.hi)).printable()


def _printable(value: Constant | None) -> Constant | None:
    return None if value is None else value.printable()


def plan_data(spec: Spec, plan: Plan) -> PlanData:
    """The plan as it was certified: `exact` expressions, or every knot with the rule that fills the gaps."""
    kind, table, knots = spec.trajectory.kind, spec.trajectory.table, plan.knots
    if knots is None:
        return PlanData(kind=kind, interpolation="exact", samples=_samples(plan))
    x, u = (tuple(tuple(map(number_text, row)) for row in rows) for rows in (knots.x, knots.u))
    return PlanData(
        kind=kind,
        interpolation=knots.interpolation,
        curve="hermite",  # between knots x* is the cubic whose slopes at its ends are f(x*) + B(x*) u*
        knots=KnotTexts(t=tuple(map(number_text, knots.t)), x=x, u=u),
        samples=_samples(plan),
        file=None if table is None else table.file,
        file_hash=None if table is None else f"sha256:{table.sha256}",
    )


def _samples(plan: Plan) -> Samples | None:
    """Points of the plan, to draw it: 7 digits, no part of any proof. A constant plan is one point, a family none."""
    if plan.allowance is not None:
        return None
    end = 0.0 if plan.horizon is None else float(plan.horizon)
    t = np.zeros(1) if plan.is_constant else np.linspace(0.0, np.nextafter(end, 0.0), _SAMPLES)
    x = plan.enclose(t, t)[0]
    with np.errstate(invalid="ignore"):  # a curve that is not bounded
        middle = 0.5 * x.lo + 0.5 * x.hi
    if not np.all(np.isfinite(middle)):
        return None
    rows = tuple(tuple(float(f"{value:.7g}") for value in row) for row in middle)
    return Samples(t=tuple(float(f"{value:.7g}") for value in t), x=rows)


def constant_data(value: Constant, meaning: Meaning) -> Bound:
    """One entry of `result.constants`; no number where there is no bound."""
    return Bound(
        below=_finite(value.below),
        above=_finite(value.above),
        symbol=meaning.symbol,
        equation=meaning.equation,
        unit=meaning.unit,
        at=value.at,
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def assumptions(
    spec: Spec, model: ControlAffineModel, geodesics: GeodesicTest | None = None
) -> tuple[Assumption, ...]:
    """Everything that is not proven here (docs/guarantee, "What is assumed").

    `geodesics` is the test for their uniqueness, once the tube is known.
    """
    flat = all(e.is_constant for row in model.W for e in row)
    smooth, horizon, wind = spec.adaptation.smooth, spec.trajectory.horizon, spec.disturbance
    return (
        LeastFeedback(),
        StraightGeodesics() if flat else _geodesic_assumption(geodesics),
        StartAtRest(),
        HardProjection() if smooth is None else SmoothProjection(layer=smooth),
        PerfectState(),
        FirstOrderFilter(),
        ForAllTime() if horizon is None else UpToHorizon(horizon=horizon),
        UncertaintyAsDeclared()
        if spec.uncertainty.h is None
        else UncertaintyAsGiven(any_within_bounds=_any_start(spec)),
        *(() if wind is None else (WindWithin(bound=wind.length, rate=wind.rate),)),
        *(() if not spec.ranges else (ParametersWithin(),)),
    )


def _any_start(spec: Spec) -> bool:
    """Whether H0 covers every h within the bounds: only if |h| itself is declared, else it is the expression's own."""
    bounds = spec.uncertainty.bounds
    return bounds is not None and bounds.h is not None


def _geodesic_assumption(test: GeodesicTest | None) -> ExactGeodesics:
    """What is assumed of geodesics of a metric that is not constant."""
    if test is None:
        return ExactGeodesics(uniqueness="assumed")
    return ExactGeodesics(uniqueness="proven" if test.holds else "assumed", value=test.value.printable())
