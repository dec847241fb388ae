"""From a certificate C to its controller: what cannot be exported, and the parts together.

In: a `Certificate` whose section `sampled` is certified. Out: a `Continuous`, or the reason why there is none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Certificate
from tubecert.conditions.sampled import SampledRecipe
from tubecert.coordinates import Coordinates, inverse
from tubecert.enclosure.constant import printable_above
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.export import blocks
from tubecert.export.continuous.blocks import Parts, estimator, filter_of, observer
from tubecert.export.controller import Boxes, Continuous, refused
from tubecert.export.geodesics import varies
from tubecert.export.question import gain_of, horizon_of, identifier, pieces_of, question
from tubecert.expression import free_symbols
from tubecert.kinds import SAMPLED
from tubecert.model import TIME, ControlAffineModel
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """What a controller of a certificate C is made of; `reach` is dbar, `coordinates` S by rows, `feedback_gain` du.

    `boxes` are those of a family of plans.
    """

    name: str
    hash: str
    model: ControlAffineModel
    plan: Plan
    recipe: SampledRecipe
    reach: Fraction
    coordinates: tuple[tuple[str, ...], ...] | None
    horizon: Fraction | None
    ranges: tuple[tuple[float, float], ...]
    feedback_gain: Fraction
    boxes: Boxes | None = None


def of_samples(certificate: Certificate, name: str) -> Continuous:
    """The controller of a certificate C; raises TC710 with the reason where there is none."""
    result = certificate.result
    data = result.sections.get(SAMPLED.key)
    if data is None or data.verdict is not Verdict.CERTIFIED:
        raise refused(
            f"{name} certifies no controller of a machine",
            "export is about certificates H and C: give the specification a section hardware, and certify it",
        )
    recipe = result.proof.of.get(SAMPLED.key)
    if not isinstance(recipe, SampledRecipe):
        raise incomplete(name, "the recipe of certificate C is missing")
    spec, plan, model = question(certificate)
    tube, bundle = result.tube, spec.trajectory.bundle
    ranges = {
        own.input: (own.bounds[SAMPLED.key].least, own.bounds[SAMPLED.key].greatest)
        for own in result.inputs
        if SAMPLED.key in own.bounds
    }
    return together(
        Loop(
            name=spec.name,
            hash=certificate.hash,
            model=model,
            plan=plan,
            recipe=recipe,
            reach=_reach(certificate),
            coordinates=None if tube is None else tube.coordinates,
            horizon=horizon_of(certificate),
            ranges=tuple(ranges.get(each, (-math.inf, math.inf)) for each in model.inputs),
            feedback_gain=gain_of(certificate, name),
            boxes=None if bundle is None else Boxes(x=bundle.x, u=bundle.u),
        )
    )


def together(loop: Loop) -> Continuous:
    """The controller of a loop; raises TC710 where it cannot be exported."""
    model, plan, recipe, rows = loop.model, loop.plan, loop.recipe, loop.coordinates
    _require(model)
    S = None if rows is None else Coordinates(tuple(tuple(Fraction(q) for q in row) for row in rows))
    own = Parts(model=model, recipe=recipe, coordinates=S)
    pieces = pieces_of(plan, recipe.sample_time) if isinstance(plan, PiecewisePlan) else None
    return Continuous(
        name=identifier(loop.name),
        system=loop.name,
        hash=loop.hash,
        states=model.states,
        inputs=model.inputs,
        sample_time=recipe.sample_time,
        horizon=loop.horizon,
        level=loop.reach,
        reach=loop.reach,
        metric=inverse([[e.fraction for e in row] for row in model.W]),
        ranges=loop.ranges,
        plan=blocks.plan(plan) if pieces is None and loop.boxes is None else None,
        boxes=loop.boxes,
        pieces=pieces,
        drift=blocks.drift(model),
        flow=blocks.flow(model),
        law=blocks.law(model, loop.feedback_gain),
        bandwidth=recipe.bandwidth,
        predictor_gain=recipe.predictor_gain,
        radius=recipe.projection_radius,
        estimator=estimator(own),
        filter=filter_of(own),
        observer=observer(own),
    )


def _require(model: ControlAffineModel) -> None:
    """Raises TC710 for what the exported code could not do."""
    if varies(model):
        raise refused(
            "the metric is not constant: its geodesics have to be computed, and theorem C assumes exact ones",
            "describe the computer: hardware: {rate: 500, geodesic: {nodes: 16, sweeps: 3}}, and certify again "
            "(certificate H allows for what they lose), or find a constant metric: tubecert synth SPEC --degree 0",
        )
    known = free_symbols([*model.f, *(e for row in model.B for e in row)]) - {*model.states}
    if TIME in known:
        raise refused(
            "f depends on t: what is exported of it knows the state only", "export is about f(x) and B(x)"
        )
    if known:
        raise refused(
            f"the controller would need to know {', '.join(sorted(known))}", "give it a value of its own"
        )


def _reach(certificate: Certificate) -> Fraction:
    """dbar = sqrt(a) rho, from above."""
    tube, metric = certificate.result.tube, certificate.result.metric
    if tube is None or metric is None or metric.lower is None or not metric.lower.below:
        raise incomplete("that is exported", "what is known of its metric is missing")
    dbar = sqrt(Interval.of(Fraction(metric.lower.below))) * Interval.of(Fraction(tube.rho))
    return Fraction(repr(printable_above(float(dbar.hi))))
