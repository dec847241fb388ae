"""Values as the JSON of a certificate: constants, metric, declared bounds, assumptions.

Numbers are written so that a reader of exact decimals reads a bound: see `enclosure.constant`.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from tubecert.bounds.constants import Constant, Meaning, Witness
from tubecert.claims import (
    Assumption,
    ExactGeodesics,
    FirstOrderFilter,
    ForAllTime,
    HardProjection,
    LeastFeedback,
    PerfectState,
    SmoothProjection,
    StartAtRest,
    StraightGeodesics,
    UncertaintyAsDeclared,
    UncertaintyAsGiven,
    UpToHorizon,
)
from tubecert.enclosure.constant import printable_above, printable_below
from tubecert.expression import number_text
from tubecert.metric.geodesic import GeodesicTest
from tubecert.metric.verify import MetricProof
from tubecert.model import ControlAffineModel
from tubecert.spec import Spec, canonical
from tubecert.trajectory import Plan

Result = dict[str, Any]
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


def declared_data(spec: Spec) -> Result:
    """What is believed, not proven: bounds of an h that is not given as expressions."""
    if spec.uncertainty.h is not None or spec.uncertainty.bounds is None:
        return {}
    return {name: constant.above for name, constant in declared_uncertainty(spec).items()}


def safe_set_data(spec: Spec) -> dict[str, Any]:
    """[low, high] of every state, as decimals."""
    return {
        name: [decimal_data(low), decimal_data(high)]
        for name, (low, high) in zip(spec.states, spec.safe_set, strict=True)
    }


def claim_data(spec: Spec, period: tuple[Fraction, bool] | None) -> Result:
    """`result.claim`: what is claimed, in words of its own. `period` of h as (q, whether times pi), in s.

    The checker derives it again from its own reading of the specification. `bounds` count beside an expression only
    if |h| itself is declared: else H0 is that of the expression.
    """
    horizon, bounds = spec.trajectory.horizon, spec.uncertainty.bounds
    for_ever = None if horizon is not None else "autonomous" if period is None else "periodic"
    covers = "expression" if bounds is None or bounds.h is None else "expression or bounds"
    return {
        "id": "tube",
        "horizon": None if horizon is None else number_text(horizon),
        "for_all_time": for_ever,
        "period": None if for_ever != "periodic" or period is None else _period_text(*period),
        "domain": {
            name: [number_text(low), number_text(high)]
            for name, (low, high) in zip(spec.states, spec.safe_set, strict=True)
        },
        "start": {"at": [number_text(value) for value in spec.x0]}
        if spec.within is None
        else {"within": number_text(spec.within)},
        "uncertainty": "bounds" if spec.uncertainty.h is None else covers,
    }


def _period_text(q: Fraction, of_pi: bool) -> str:
    """An exact period in s, as `2/3`, `pi` or `2/3*pi`."""
    return str(q) if not of_pi else "pi" if q == 1 else f"{q}*pi"


def metric_data(spec: Spec, proof: MetricProof) -> Result:
    """`result.metric` as far as C1-C3 on the safe set tell."""
    metric = spec.metric
    assert metric is not None
    data: Result = {
        "rate": decimal_data(metric.rate),
        "dual_metric": canonical(spec)["metric"]["dual_metric"],
        "verdict": proof.verdict,
    }
    for name in ("margin", "largest_rate", "lower_on_set", "upper_on_set"):
        if (value := getattr(proof, name)) is not None:
            data[name] = pair_data(value.printable())
    return data


def plan_data(spec: Spec, plan: Plan) -> Result:
    """The plan as it was certified: `exact` expressions, or every knot with the rule that fills the gaps."""
    trajectory = spec.trajectory
    knots = plan.knots
    if knots is None:
        return {"kind": trajectory.kind, "interpolation": "exact", **_samples(plan)}
    data: Result = {
        "kind": trajectory.kind,
        **_samples(plan),
        "interpolation": knots.interpolation,
        "curve": "hermite",  # between knots x* is the cubic whose slopes at its ends are f(x*) + B(x*) u*
        "knots": {
            "t": [number_text(t) for t in knots.t],
            **{
                name: [[number_text(value) for value in row] for row in rows]
                for name, rows in (("x", knots.x), ("u", knots.u))
            },
        },
    }
    if trajectory.table is not None:
        data |= {"file": trajectory.table.file, "file_hash": f"sha256:{trajectory.table.sha256}"}
    return data


def _samples(plan: Plan) -> Result:
    """Points of the plan, to draw it: 7 digits, no part of any proof. A constant plan is one point."""
    end = 0.0 if plan.horizon is None else float(plan.horizon)
    t = np.zeros(1) if plan.is_constant else np.linspace(0.0, np.nextafter(end, 0.0), _SAMPLES)
    x = plan.enclose(t, t)[0]
    with np.errstate(invalid="ignore"):  # a curve that is not bounded
        middle = 0.5 * x.lo + 0.5 * x.hi
    if not np.all(np.isfinite(middle)):
        return {}
    rows = [[float(f"{value:.7g}") for value in row] for row in middle]
    return {"samples": {"t": [float(f"{value:.7g}") for value in t], "x": rows}}


def constant_data(value: Constant, meaning: Meaning) -> Result:
    """One entry of `result.constants`."""
    data: Result = {
        "below": _number(value.below),
        "above": _number(value.above),
        "symbol": meaning.symbol,
        "equation": meaning.equation,
        "unit": meaning.unit,
    }
    if value.at is not None:
        data["at"] = witness_data(value.at)
    return data


def witness_data(at: Witness) -> Result:
    """A time (if it matters) and a state."""
    return {**({} if at.t is None else {"t": at.t}), "x": list(at.x)}


def pair_data(value: Constant) -> list[float | None]:
    """[below, above]."""
    return [_number(value.below), _number(value.above)]


def _number(value: float) -> float | None:
    """A bound for JSON: null where there is none."""
    return value if math.isfinite(value) else None


def decimal_data(value: Fraction | None) -> float | str | None:
    """An exact number: a JSON number where one of at most 15 digits is exact, else a text `p/q`."""
    if value is None:
        return None
    near = float(value)
    return near if Fraction(repr(near)) == value else f"{value.numerator}/{value.denominator}"


def assumptions(
    spec: Spec, model: ControlAffineModel, geodesics: GeodesicTest | None = None
) -> tuple[Assumption, ...]:
    """Everything that is not proven here (docs/guarantee, "What is assumed").

    `geodesics` is the test for their uniqueness, once the tube is known.
    """
    flat = all(e.is_constant for row in model.W for e in row)
    smooth, horizon = spec.adaptation.smooth, spec.trajectory.horizon
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
