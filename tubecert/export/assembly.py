"""From a certificate to its controller: what cannot be exported, and the parts together.

In: a `Certificate` whose section `hardware` or `sampled` is certified. Out: a `Controller` or a `Continuous`, or the
reason why there is none.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Final

from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Certificate
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.conditions.hardware.geodesics import error_of_speed
from tubecert.coordinates import inverse
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.export import blocks, geodesics
from tubecert.export.blocks import INTEGRATION, Machine, forgotten
from tubecert.export.continuous.assembly import of_samples
from tubecert.export.controller import Boxes, Continuous, Controller, refused
from tubecert.export.followed import frobenius
from tubecert.export.question import gain_of, horizon_of, identifier, pieces_of, question
from tubecert.expression import free_symbols, topological
from tubecert.kinds import HARDWARE, SAMPLED
from tubecert.kinds.hardware import HardwareData
from tubecert.model import ControlAffineModel
from tubecert.spec import Picard
from tubecert.trajectory.pieces import PiecewisePlan
from tubecert.verdict import Verdict

_NOISE: Final = "noise_metric"  # n_M of one unit of noise
_SIZE: Final = "noise_size"  # n_E
_BENT: Final = ("lower", "symbols", "symbols_slope")
_MOST_EVERY: Final = 1000  # samples from one feedback to the next


def controller_of(certificate: Certificate, name: str = "the certificate") -> Controller | Continuous:
    """The controller that a certificate is about: H where there is a machine, unless C decides; else C.

    Raises `TubecertError` (TC710) with the reason where it certifies none that can be exported.
    """
    result = certificate.result
    data, decided = result.sections.get(HARDWARE.key), result.decided_by
    if isinstance(data, HardwareData) and (SAMPLED.key not in decided or HARDWARE.key in decided):
        return _of_machine(certificate, data, name)
    return of_samples(certificate, name)


def _of_machine(certificate: Certificate, data: HardwareData, name: str) -> Controller:
    if data.verdict is not Verdict.CERTIFIED:
        raise refused(
            f"{name} certifies no controller of a machine: its certificate H does not hold",
            "advice in its report says which machine would serve",
        )
    recipe = certificate.result.proof.of.get(HARDWARE.key)
    if not isinstance(recipe, HardwareRecipe) or data.level is None:
        raise incomplete(name, "the recipe of certificate H is missing")
    spec, plan, model = question(certificate)
    if spec.hardware is None:
        raise incomplete(name, "its specification has no section hardware")
    tube = certificate.result.tube
    bundle = spec.trajectory.bundle
    machine = Machine(
        name=spec.name,
        hash=certificate.hash,
        model=model,
        plan=plan,
        recipe=recipe,
        reach=_reach(certificate, recipe, spec.hardware.geodesic if geodesics.varies(model) else None),
        clip=data.clip,
        coordinates=None if tube is None else tube.coordinates,
        held=spec.hardware.held,
        horizon=horizon_of(certificate),
        ranges=tuple(data.inputs.get(each, (-math.inf, math.inf)) for each in model.inputs),
        feedback_gain=gain_of(certificate, name),
        geodesic=spec.hardware.geodesic,
        noise_size=_noise_size(certificate),
        boxes=None if bundle is None else Boxes(x=bundle.x, u=bundle.u),
    )
    return assembled(machine)


def assembled(machine: Machine) -> Controller:
    """The controller of a machine; raises TC710 where it cannot be exported."""
    model, plan, recipe = machine.model, machine.plan, machine.recipe
    _require(model, recipe, machine.geodesic)
    bent = geodesics.varies(model)
    pieces = pieces_of(plan, recipe.sample_time) if isinstance(plan, PiecewisePlan) else None
    boxes = machine.boxes
    _require_plan(machine)
    still, m = pieces is None and boxes is None and not free_symbols(plan.u), len(model.inputs)
    played, covered = not still and not machine.held, bool(recipe.rounding)
    if (
        played
        and pieces is None
        and boxes is None
        and any(node.op == "table" for node in topological(plan.u))
    ):
        raise refused(
            "a table stands in u*, of which Gauss's rule does not know the mean over a sample",
            "certify with hardware: {feedforward: held}, or write the plan into a CSV file",
        )
    return Controller(
        name=identifier(machine.name),
        system=machine.name,
        hash=machine.hash,
        states=model.states,
        inputs=model.inputs,
        sample_time=recipe.sample_time,
        delay=recipe.delay,
        horizon=machine.horizon,
        level=recipe.level,
        reach=machine.reach,
        metric=() if bent else inverse([[e.fraction for e in row] for row in model.W]),
        ranges=machine.ranges,
        share=forgotten(recipe),
        estimate=2 * recipe.clip_radius
        + recipe.bias
        + recipe.ripple,  # |h| <= R and |h - q| <= max(H0, S) + N
        feedback_gain=machine.feedback_gain,
        lost=recipe.rounding[0] if recipe.rounding else None,
        predicts=recipe.prediction is not None,
        held=machine.held,
        still=still,
        plan=blocks.plan(plan) if pieces is None and boxes is None else None,
        boxes=boxes,
        pieces=pieces,
        drift=blocks.drift(model),
        flow=blocks.flow(model),
        law=geodesics.law(model, machine.feedback_gain)
        if bent
        else blocks.law(model, machine.feedback_gain if covered else None),
        applied=blocks.applied(m, recipe, played=played),
        gauss=blocks.gauss(m) if played and pieces is None and boxes is None else None,
        bend=blocks.bend(plan) if played and pieces is None and boxes is None and covered else None,
        predictor=None if recipe.prediction is None else blocks.predictor(model, recipe.delay / INTEGRATION),
        estimator=blocks.estimator(machine),
        stretch=_stretch(machine),
        steep=blocks.steep(model) if covered and recipe.prediction is not None else None,
        swept=geodesics.swept(model, machine.geodesic) if bent and machine.geodesic is not None else None,
        moves=_moves(machine),
        every=int(recipe.feedback_time / recipe.sample_time),
    )


def _require_plan(machine: Machine) -> None:
    """Raises TC710 for what is not known of a plan that is handed in."""
    if machine.boxes is None:
        return
    if machine.recipe.prediction is not None:
        raise refused(
            "a prediction needs u* all along the delay, of which step is handed no more than its values at samples",
            "leave hardware.predict out, or certify the plan that the machine follows",
        )
    if machine.recipe.rounding:
        raise refused(
            "no bound of rounding is known for a plan that is handed in",
            "certify without hardware.arithmetic",
        )


def _moves(machine: Machine) -> tuple[Fraction, ...]:
    """|y_k - y_(k-1)| <= Y Ts + 2 nu n_E in coordinates of the tube, state by state, from above."""
    recipe, n = machine.recipe, len(machine.model.states)
    if machine.noise_size is None:
        return ()
    rows = machine.coordinates
    back = None if rows is None else inverse([[Fraction(q) for q in row] for row in rows])
    far = recipe.speed * recipe.sample_time + 2 * recipe.noise * machine.noise_size
    sizes = [Fraction(1) if back is None else sum((q * q for q in back[i]), Fraction(0)) for i in range(n)]
    return tuple(Fraction(float((Interval.of(far) * sqrt(Interval.of(size))).hi)) for size in sizes)


def _stretch(machine: Machine) -> Fraction:
    """|S| from above: what is off in x is at most that many times as long in the coordinates of the tube."""
    if machine.coordinates is None:
        return Fraction(1)
    rows = [[Fraction(q) for q in row] for row in machine.coordinates]
    return Fraction(float(frobenius(rows).hi))


def _require(model: ControlAffineModel, recipe: HardwareRecipe, geodesic: Picard | None) -> None:
    """Raises TC710 for what the exported code could not do."""
    if geodesics.varies(model) and geodesic is None:
        raise refused(
            "the metric is not constant: its geodesics have to be computed, and the certificate assumes exact ones",
            "certify with hardware: {geodesic: {nodes: 16, sweeps: 3}}, which allows for what that loses",
        )
    if model.gained:
        raise refused(
            "parameters known by ranges stand in B: the feedback is multiplied by 1/(1 - D_b) then, "
            "which is not exported yet",
            "give them one value",
        )
    every = recipe.feedback_time / recipe.sample_time
    if every.denominator > 1 or every > _MOST_EVERY:
        raise refused(
            "the samples of the feedback are no samples of the estimate: step is called at hardware.rate",
            f"take a hardware.rate that is 1, 2, ... or {_MOST_EVERY} times hardware.feedback_rate",
        )
    if model.time is not None:
        raise refused(
            "f depends on t, and exported code reads f(x)",
            "replay it: simulate knows the time; to export, take what depends on t into uncertainty.h",
        )
    unknown = free_symbols([*model.f, *(e for row in model.B for e in row)]) - {*model.states}
    if unknown:
        raise refused(
            f"the controller would need to know {', '.join(sorted(unknown))}", "give it a value of its own"
        )


def _reach(certificate: Certificate, recipe: HardwareRecipe, geodesic: Picard | None) -> Fraction:
    """dhat + n_M, rounded up; with a prediction dhat + n_P of theorem H-P; what a computed geodesic is off is added."""
    noise, metric = certificate.result.constants[_NOISE].above, certificate.result.metric
    upper = None if metric is None or metric.upper is None else metric.upper.above
    if noise is None or upper is None:
        raise incomplete("that is exported", "what noise is in the metric is missing")
    reach = looked_at(recipe, noise, upper)
    return reach if geodesic is None else reach + _off(certificate, geodesic, reach, upper)


def _noise_size(certificate: Certificate) -> Fraction | None:
    """n_E, from above."""
    own = certificate.result.constants.get(_SIZE)
    return None if own is None or own.above is None else Fraction(own.above)


def _off(certificate: Certificate, geodesic: Picard, reach: Fraction, upper: float) -> Fraction:
    """sqrt(A) e/2: how far d is off as it is computed, from above."""
    lower, G, L = (certificate.result.constants[name] for name in _BENT)
    if not lower.below or G.above is None or L.above is None:
        raise incomplete("that is exported", "what is known of its metric is missing")
    r = Interval.of(reach) / sqrt(Interval.of(Fraction(lower.below)))
    e = error_of_speed(geodesic, Interval.exact(G.above), Interval.exact(L.above), r)
    return Fraction(f"{float((sqrt(Interval.exact(upper)) * e / 2).hi) * (1 + 1e-6):.6e}")


def looked_at(recipe: HardwareRecipe, noise: float, upper: float) -> Fraction:
    """What d(x*, .) is at most where the feedback looks; n_M of one unit of noise and A are `noise` and `upper`."""
    looked = recipe.noise * Fraction(noise)
    if recipe.prediction is not None:
        looked = max(looked, recipe.prediction * Fraction(math.nextafter(math.sqrt(upper), math.inf)))
    return recipe.level + Fraction(f"{float(looked) * (1 + 1e-6):.6e}")
