"""From a certificate to its controller: the question that it answers, what cannot be exported, and the parts together.

In: a `Certificate` whose section `hardware` is certified. Out: a `Controller`, or the reason why there is none.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from fractions import Fraction
from itertools import pairwise
from typing import Final

from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Certificate
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.conditions.hardware.geodesics import error_of_speed
from tubecert.coordinates import inverse
from tubecert.enclosure.interval import Array, Interval, sqrt
from tubecert.export import blocks, geodesics
from tubecert.export.blocks import INTEGRATION, Machine, forgotten
from tubecert.export.controller import Controller, Pieces, refused
from tubecert.expression import free_symbols, topological
from tubecert.kinds import HARDWARE
from tubecert.kinds.hardware import HardwareData
from tubecert.model import ControlAffineModel, build
from tubecert.spec import Picard, Spec, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan
from tubecert.verdict import Verdict

_NOISE: Final = "noise_metric"  # n_M of one unit of noise
_SIZE: Final = "noise_size"  # n_E
_GAIN: Final = "feedback_gain"
_BENT: Final = ("lower", "symbols", "symbols_slope")
_LONGEST: Final = 32  # characters of a name
_MOST_EVERY: Final = 1000  # samples from one feedback to the next


def controller_of(certificate: Certificate, name: str = "the certificate") -> Controller:
    """The controller that a certificate is about.

    Raises `TubecertError` (TC710) with the reason where it certifies none that can be exported.
    """
    data = certificate.result.sections.get(HARDWARE.key)
    if not isinstance(data, HardwareData) or data.verdict is not Verdict.CERTIFIED:
        raise refused(
            f"{name} certifies no controller of a machine",
            "export is about certificate H: give the specification a section hardware, and certify it",
        )
    recipe = certificate.result.proof.of.get(HARDWARE.key)
    if not isinstance(recipe, HardwareRecipe) or data.level is None:
        raise incomplete(name, "the recipe of certificate H is missing")
    spec, plan, model = _question(certificate)
    if spec.hardware is None:
        raise incomplete(name, "its specification has no section hardware")
    tube = certificate.result.tube
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
        horizon=_horizon(certificate),
        ranges=tuple(data.inputs.get(each, (-math.inf, math.inf)) for each in model.inputs),
        feedback_gain=_gain(certificate, name),
        geodesic=spec.hardware.geodesic,
        noise_size=_noise_size(certificate),
    )
    if certificate.result.claim.plans is not None or spec.trajectory.bundle is not None:
        raise refused(
            "a certificate of a family of plans is not exported", "certify the plan that the machine follows"
        )
    return assembled(machine)


def assembled(machine: Machine) -> Controller:
    """The controller of a machine; raises TC710 where it cannot be exported."""
    model, plan, recipe = machine.model, machine.plan, machine.recipe
    _require(model, recipe, machine.geodesic)
    bent = geodesics.varies(model)
    pieces = _pieces(plan, recipe.sample_time) if isinstance(plan, PiecewisePlan) else None
    still, m = pieces is None and not free_symbols(plan.u), len(model.inputs)
    played, covered = not still and not machine.held, bool(recipe.rounding)
    if played and pieces is None and any(node.op == "table" for node in topological(plan.u)):
        raise refused(
            "a table stands in u*, of which Gauss's rule does not know the mean over a sample",
            "certify with hardware: {feedforward: held}, or write the plan into a CSV file",
        )
    return Controller(
        name=_identifier(machine.name),
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
        plan=blocks.plan(plan) if pieces is None else None,
        pieces=pieces,
        drift=blocks.drift(model),
        flow=blocks.flow(model),
        law=geodesics.law(model, machine.feedback_gain)
        if bent
        else blocks.law(model, machine.feedback_gain if covered else None),
        applied=blocks.applied(m, recipe, played=played),
        gauss=blocks.gauss(m) if played and pieces is None else None,
        bend=blocks.bend(plan) if played and pieces is None and covered else None,
        predictor=None if recipe.prediction is None else blocks.predictor(model, recipe.delay / INTEGRATION),
        estimator=blocks.estimator(machine),
        swept=geodesics.swept(model, machine.geodesic) if bent and machine.geodesic is not None else None,
        moves=_moves(machine),
        every=int(recipe.feedback_time / recipe.sample_time),
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


def _question(certificate: Certificate) -> tuple[Spec, Plan, ControlAffineModel]:
    """The specification in the certificate, its plan as it was certified, and its model."""
    data, knots = certificate.result.spec.effective.data, certificate.result.plan.exact_knots()
    if knots is not None:  # its plan was in a file
        rest = {"kind": "equilibrium", "at": ["0"] * len(certificate.result.spec.effective.system.states)}
        apart = ("initial_state", "obstacles", "simulation", "expect", "conditions")
        kept = {key: value for key, value in data.items() if key not in apart} | {"trajectory": rest}
        data = {key: _anytime(value) if key == "tube" else value for key, value in kept.items()}
    spec = load_text(json.dumps(dict(data)), "certificate")
    trajectory, model = spec.trajectory, build(spec)
    if knots is not None:
        if knots.interpolation == "hermite-simpson":
            raise refused(
                "a plan with quadratic inputs (interpolation: hermite-simpson) is not exported yet",
                "give its rows with interpolation: linear, and certify that",
            )
        horizon = certificate.result.spec.effective.trajectory.horizon
        return spec, piecewise_plan(model, knots, horizon), model
    x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
    return spec, Plan(x, u, trajectory.horizon), model


def _anytime(tube: Mapping[str, object]) -> Mapping[str, object]:
    """A tube without its windows, which are times of a plan."""
    return {key: value for key, value in tube.items() if key != "windows"}


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


def _gain(certificate: Certificate, name: str) -> Fraction:
    """du, from above: what the feedback is clipped by; one that is missing would be a controller without feedback."""
    gain = certificate.result.constants.get(_GAIN)
    if gain is None or gain.above is None:
        raise incomplete(name, f"the constant {_GAIN} has no bound")
    return Fraction(gain.above)


def _horizon(certificate: Certificate) -> Fraction | None:
    """How long the claim holds; None for ever."""
    claim = certificate.result.claim
    return None if claim.for_all_time or claim.horizon is None else Fraction(claim.horizon)


def _identifier(name: str) -> str:
    """A name of C and Python."""
    found = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:_LONGEST] or "controller"
    return found if found[0].isalpha() else f"c_{found}"


def _pieces(plan: PiecewisePlan, sample_time: Fraction) -> Pieces:
    """Coefficients in the middle of their enclosures."""
    found = plan.pieces
    start = plan.data.t[: len(found)]
    shortest = min((b - a for a, b in pairwise(start)), default=sample_time)
    return Pieces(
        start=start,
        x=_table(found.x.mid),
        u=_table(found.u.mid),
        most=int(sample_time / shortest) + 2,
        x_off=_table(found.x.rad),
        u_off=_table(found.u.rad),
        length=tuple(map(Fraction, found.length.hi.tolist())),
        continuous=plan.data.interpolation == "linear" or len(found) == 1,
    )


def _table(values: Array) -> tuple[tuple[tuple[Fraction, ...], ...], ...]:
    return tuple(tuple(tuple(map(Fraction, row)) for row in piece) for piece in values.tolist())
