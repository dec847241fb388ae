"""What is exported: the controller of a certificate H, as programs, tables and numbers, all exact.

In: a `Certificate` whose section `hardware` is certified. Out: a `Controller`, or the reason why there is none.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from itertools import pairwise
from typing import Final

from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Certificate
from tubecert.conditions.hardware import HardwareRecipe, Rounding
from tubecert.conditions.hardware.geodesics import error_of_speed
from tubecert.coordinates import Coordinates, Fields, inverse
from tubecert.enclosure.interval import Array, Interval, sqrt
from tubecert.errors import TubecertError
from tubecert.export import geodesics
from tubecert.export.geodesics import Swept
from tubecert.export.program import GREATEST, LEAST, RATIO, SHRINK, Place, Program, Writer
from tubecert.expression import derivatives, free_symbols, topological
from tubecert.expression.matrix import Matrix, multiply
from tubecert.findings import Finding
from tubecert.kinds import HARDWARE
from tubecert.kinds.hardware import HardwareData
from tubecert.model import TIME, ControlAffineModel, build
from tubecert.spec import Picard, Spec, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan
from tubecert.verdict import Verdict

INTEGRATION: Final = 4  # steps of the prediction of H-P
# of Gauss's rule over one sample: shares of it, and weights
NODES: Final = (Fraction("0.11270166537925831148"), Fraction(1, 2), Fraction("0.88729833462074168852"))
_WEIGHTS: Final = (Fraction(5, 18), Fraction(4, 9), Fraction(5, 18))
_DIGITS: Final = Context(prec=60)
LEAST_SIZE: Final = Fraction(1, 2**120)  # |c|^2 below which the feedback fades out
_NOISE: Final = "noise_metric"  # n_M of one unit of noise
_GAIN: Final = "feedback_gain"
_BENT: Final = ("lower", "symbols", "symbols_slope")
_LONGEST: Final = 32  # characters of a name


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """A plan through knots: `start` (K,) in s, x* (K, n, 4) and u* (K, m, 2) as polynomials of t - start.

    `most`: so many pieces can meet one sample at most. `x_off` and `u_off`, of the same shapes: how far a
    coefficient is from the exact one at most; `length` (K,) in s; `continuous`: u* does not jump.
    """

    start: tuple[Fraction, ...]
    x: tuple[tuple[tuple[Fraction, ...], ...], ...]
    u: tuple[tuple[tuple[Fraction, ...], ...], ...]
    most: int
    x_off: tuple[tuple[tuple[Fraction, ...], ...], ...]
    u_off: tuple[tuple[tuple[Fraction, ...], ...], ...]
    length: tuple[Fraction, ...]
    continuous: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """The controller of a certificate H for one computer.

    `name` begins every name in the code; `hash` is that of the certificate. Times in s; `horizon` None
    without end; `level`: d(x*, x) stays below it, and `reach` what d(x*, .) is at most where the feedback
    looks, as it is computed; `metric` is M, empty where it is not constant: then geodesics are `swept`; `ranges`:
    what is proven of every input; `share` is th; `estimate` bounds |q|, and `feedback_gain` is du. `lost`: what
    rounding may cost, where the certificate covers it. Of the plan, either the program `plan` or `pieces`.
    `bend` is u*'s sixth derivative, where its mean is that of three nodes and rounding is covered.
    `still`: u* is constant; `held`: u* is played from sample to sample.
    """

    name: str
    system: str
    hash: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    sample_time: Fraction
    delay: Fraction
    horizon: Fraction | None
    level: Fraction
    reach: Fraction
    metric: tuple[tuple[Fraction, ...], ...]
    ranges: tuple[tuple[float, float], ...]
    share: Fraction
    estimate: Fraction
    feedback_gain: Fraction
    lost: Rounding | None
    predicts: bool
    held: bool
    still: bool
    plan: Program | None
    pieces: Pieces | None
    drift: Program
    flow: Program
    law: Program
    applied: Program
    gauss: Program | None
    bend: Program | None
    predictor: Program | None
    estimator: Program
    swept: Swept | None = None

    @property
    def programs(self) -> tuple[Program, ...]:
        """Every program, in the order in which they are written."""
        swept = () if self.swept is None else self.swept.programs
        found = (self.plan, self.drift, self.flow, *swept, self.law, self.applied, self.gauss, self.predictor)
        return tuple(each for each in (*found, self.estimator) if each is not None)

    @property
    def adds_plan(self) -> bool:
        """Whether u* is in what a step returns: it is held, or constant."""
        return self.held or self.still


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
    )
    if certificate.result.claim.plans is not None or spec.trajectory.bundle is not None:
        raise refused(
            "a certificate of a family of plans is not exported", "certify the plan that the machine follows"
        )
    return assembled(machine)


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What a controller is made of.

    `clip` by input, empty for the ball of the recipe; `coordinates` S, by rows; `horizon` of the claim, None for ever;
    `feedback_gain` du; `geodesic`: how geodesics are computed.
    """

    name: str
    hash: str
    model: ControlAffineModel
    plan: Plan
    recipe: HardwareRecipe
    reach: Fraction
    clip: tuple[tuple[Fraction, Fraction], ...]
    coordinates: tuple[tuple[str, ...], ...] | None
    held: bool
    horizon: Fraction | None
    ranges: tuple[tuple[float, float], ...]
    feedback_gain: Fraction = Fraction(0)
    geodesic: Picard | None = None


def assembled(machine: Machine) -> Controller:
    """The controller of a machine; raises TC710 where it cannot be exported."""
    model, plan, recipe = machine.model, machine.plan, machine.recipe
    _require(model, recipe, machine.geodesic)
    bent = geodesics.varies(model)
    pieces = _pieces(plan, recipe.sample_time) if isinstance(plan, PiecewisePlan) else None
    still, m = pieces is None and not free_symbols(plan.u), len(model.inputs)
    played, covered = not still and not machine.held, bool(recipe.rounding)
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
        plan=_plan(plan) if pieces is None else None,
        pieces=pieces,
        drift=_drift(model),
        flow=_flow(model),
        law=geodesics.law(model, machine.feedback_gain)
        if bent
        else _law(model, machine.feedback_gain if covered else None),
        applied=_applied(m, recipe, played=played),
        gauss=_gauss(m) if played and pieces is None else None,
        bend=_bend(plan) if played and pieces is None and covered else None,
        predictor=None if recipe.prediction is None else _predictor(model, recipe.delay / INTEGRATION),
        estimator=_estimator(machine),
        swept=geodesics.swept(model, machine.geodesic) if bent and machine.geodesic is not None else None,
    )


def refused(message: str, help: str, code: str = "TC710") -> TubecertError:
    """The error for what cannot be exported."""
    return TubecertError([Finding(code=code, message=message, help=help)])


def _question(certificate: Certificate) -> tuple[Spec, Plan, ControlAffineModel]:
    """The specification in the certificate, its plan as it was certified, and its model."""
    data, knots = certificate.result.spec.effective.data, certificate.result.plan.exact_knots()
    if knots is not None:  # its plan was in a file
        rest = {"kind": "equilibrium", "at": ["0"] * len(certificate.result.spec.effective.system.states)}
        apart = ("initial_state", "obstacles", "simulation", "expect", "conditions")
        data = {key: value for key, value in data.items() if key not in apart} | {"trajectory": rest}
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
    if any(node.op == "table" for node in topological([*x, *u])):
        raise refused(
            "a table stands in the plan, which is not exported yet", "write its numbers into a CSV plan"
        )
    return spec, Plan(x, u, trajectory.horizon), model


def _require(model: ControlAffineModel, recipe: HardwareRecipe, geodesic: Picard | None) -> None:
    """Raises TC710 for what the exported code could not do."""
    if geodesics.varies(model) and geodesic is None:
        raise refused(
            "the metric is not constant: its geodesics have to be computed, and the certificate assumes exact ones",
            "certify with hardware: {geodesic: {nodes: 16, sweeps: 3}}, which allows for what that loses",
        )
    entries = [*model.f, *(e for rows in (model.B, model.W) for row in rows for e in row)]
    if any(node.op == "table" for node in topological(entries)):
        raise refused(
            "a table stands in f, B or W, which is not exported yet", "fit a polynomial, or a sum of tanh"
        )
    if model.gained:
        raise refused(
            "parameters known by ranges stand in B: the feedback is multiplied by 1/(1 - D_b) then, "
            "which is not exported yet",
            "give them one value",
        )
    if recipe.feedback_time != recipe.sample_time:
        raise refused(
            "the feedback has a clock of its own, which is not exported yet",
            "leave hardware.feedback_rate out",
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


def _states(writer: Writer, model: ControlAffineModel, name: str) -> tuple[list[Place], dict[str, Place]]:
    x = writer.input(name, len(model.states))
    return x, dict(zip(model.states, x, strict=True))


def _plan(plan: Plan) -> Program:
    writer = Writer()
    (t,) = writer.input("t", 1)
    writer.output("x", writer.expressions(plan.x, {TIME: t}))
    writer.output("u", writer.expressions(plan.u, {TIME: t}))
    return writer.finished("plan", "x*(t) and u*(t)")


def _drift(model: ControlAffineModel) -> Program:
    writer = Writer()
    _, names = _states(writer, model, "x")
    writer.output("f", writer.expressions(model.f, names))
    return writer.finished("drift", "f(x)")


def _flow(model: ControlAffineModel) -> Program:
    writer = Writer()
    x, u = writer.input("x", len(model.states)), writer.input("u", len(model.inputs))
    writer.output("v", _speed(writer, model, x, u))
    return writer.finished("flow", "v = f(x) + B(x) u")


def _speed(writer: Writer, model: ControlAffineModel, x: Sequence[Place], u: Sequence[Place]) -> list[Place]:
    names = dict(zip(model.states, x, strict=True))
    f, B = writer.expressions(model.f, names), writer.matrix(model.B, names)
    return [writer.add(each, writer.dot(row, u)) for each, row in zip(f, B, strict=True)]


def _predictor(model: ControlAffineModel, length: Fraction) -> Program:
    """A step of Runge and Kutta's rule; a, b, c are the inputs at its begin, middle and end."""
    writer = Writer()
    y = writer.input("y", len(model.states))
    inputs = [writer.input(name, len(model.inputs)) for name in ("a", "b", "c")]
    half, two = writer.constant(length / 2), writer.constant(2)

    def moved(share: Place, speed: Sequence[Place]) -> list[Place]:
        return [writer.add(p, writer.mul(share, v)) for p, v in zip(y, speed, strict=True)]

    first = _speed(writer, model, y, inputs[0])
    second = _speed(writer, model, moved(half, first), inputs[1])
    third = _speed(writer, model, moved(half, second), inputs[1])
    last = _speed(writer, model, moved(writer.constant(length), third), inputs[2])
    mean = [
        writer.total([p, writer.mul(two, q), writer.mul(two, r), s])
        for p, q, r, s in zip(first, second, third, last, strict=True)
    ]
    writer.output("x", moved(writer.constant(length / 6), mean))
    return writer.finished(
        "predictor", "a step of y' = f(y) + B(y) u; u is a, b, c at its begin, middle, end"
    )


def _applied(m: int, recipe: HardwareRecipe, *, played: bool) -> Program:
    """The mean of the inputs over the last sample: for the delay the input before the last one still acted."""
    writer, older = Writer(), recipe.delay / recipe.sample_time
    held, before = writer.input("held", m), writer.input("before", m)
    plan = writer.input("played", m) if played else [writer.constant(0)] * m
    p, q = writer.constant(1 - older), writer.constant(older)
    mean = [
        writer.total([writer.mul(p, a), writer.mul(q, b), c])
        for a, b, c in zip(held, before, plan, strict=True)
    ]
    writer.output("mean", mean)
    return writer.finished("applied", "the mean of the inputs that acted over the last sample")


def _gauss(m: int) -> Program:
    writer = Writer()
    nodes = [writer.input(name, m) for name in ("a", "b", "c")]
    weights = [writer.constant(q) for q in _WEIGHTS]
    writer.output("mean", [writer.dot(weights, each) for each in zip(*nodes, strict=True)])
    return writer.finished(
        "gauss", "the mean of u* over a sample, from its values at the three nodes of Gauss"
    )


def _bend(plan: Plan) -> Program:
    """Of six derivatives of u*, which the error of Gauss's rule is made of."""
    bent = list(plan.u)
    for _ in range(2 * len(NODES)):
        bent = derivatives(bent, TIME)
    writer = Writer()
    (t,) = writer.input("t", 1)
    writer.output("u", writer.expressions(bent, {TIME: t}))
    return writer.finished("bend", "the sixth derivative of u*(t)")


def _law(model: ControlAffineModel, most: Fraction | None) -> Program:
    """(0.5) in closed form: g = M z, alpha/2 = g'(f + B u* - v*) + lambda z'g, kappa = -(alpha/2)_+ B'g/|B'g|^2.

    With `most` (du), |kappa| is held below du d, which it is in exact arithmetic: theory 8.11.
    """
    writer = Writer()
    y, names = _states(writer, model, "y")
    f, n = writer.input("f", len(model.states)), range(len(model.states))
    xs, vs = writer.input("xs", len(n)), writer.input("vs", len(n))
    us = writer.input("us", len(model.inputs))
    M = inverse([[e.fraction for e in row] for row in model.W])
    B = writer.matrix(model.B, names)
    z = [writer.sub(p, q) for p, q in zip(y, xs, strict=True)]
    g = [writer.dot([writer.constant(q) for q in row], z) for row in M]
    square = writer.dot(z, g)
    w = [writer.sub(writer.add(f[i], writer.dot(B[i], us)), vs[i]) for i in n]
    excess = writer.add(writer.dot(g, w), writer.mul(writer.constant(model.rate), square))
    c = [writer.dot([B[i][j] for i in n], g) for j in range(len(us))]
    size = writer.dot(c, c)
    share = (
        writer.choose(RATIO, excess, size)
        if most is None
        else _held_below(writer, most, square, excess, size)
    )
    for name, places in (("z", z), ("c", c), ("excess", [excess])):
        writer.mark(name, places)
    writer.output("kappa", [writer.neg(writer.mul(share, each)) for each in c])
    writer.output("told", [square, excess, size])
    return writer.finished("law", "the feedback of least norm; told: d^2, alpha/2 and |c|^2")


def _held_below(writer: Writer, most: Fraction, square: Place, excess: Place, size: Place) -> Place:
    """min((alpha/2)_+/|c|, du d)/|c|, with |c| from 2^-60 on."""
    nothing = writer.constant(0)
    norm = writer.call("sqrt", writer.choose(GREATEST, size, writer.constant(LEAST_SIZE)))
    limit = writer.mul(writer.constant(most), writer.call("sqrt", writer.choose(GREATEST, square, nothing)))
    wanted = writer.div(writer.choose(GREATEST, excess, nothing), norm)
    return writer.div(writer.choose(LEAST, wanted, limit), norm)


def _estimator(machine: Machine) -> Program:
    """(H.5): q and its projection."""
    writer, model, recipe = Writer(), machine.model, machine.recipe
    m = len(model.inputs)
    y, names = _states(writer, model, "y")
    f, last_y, last_f = (writer.input(name, len(y)) for name in ("f", "last_y", "last_f"))
    q, mean = writer.input("q", m), writer.input("mean", m)
    rate, half = writer.constant(1 / recipe.sample_time), writer.constant(Fraction(1, 2))
    moved = [
        writer.sub(
            writer.mul(rate, writer.sub(y[i], last_y[i])), writer.mul(half, writer.add(last_f[i], f[i]))
        )
        for i in range(len(y))
    ]
    pinv = writer.matrix(_explained(machine), names)
    raw = [writer.sub(writer.dot(row, moved), u) for row, u in zip(pinv, mean, strict=True)]
    share = writer.constant(forgotten(recipe))
    new = [writer.add(p, writer.mul(share, writer.sub(s, p))) for p, s in zip(q, raw, strict=True)]
    if recipe.bandwidth is None:
        new = raw
    writer.output("q", new)
    writer.output("estimate", _clipped(writer, new, machine))
    return writer.finished("estimator", "one sample of the estimator and its filter; the estimate is clipped")


def _clipped(writer: Writer, q: Sequence[Place], machine: Machine) -> list[Place]:
    if machine.clip:
        return [
            writer.choose(LEAST, writer.choose(GREATEST, each, writer.constant(low)), writer.constant(high))
            for each, (low, high) in zip(q, machine.clip, strict=True)
        ]
    size = writer.call("sqrt", writer.dot(q, q))
    share = writer.choose(SHRINK, size, writer.constant(machine.recipe.clip_radius))
    return [writer.mul(share, each) for each in q]


def _explained(machine: Machine) -> Matrix:
    """(S B)^+ S, (m, n): what of a speed the inputs can make."""
    rows = machine.coordinates
    S = None if rows is None else Coordinates(tuple(tuple(Fraction(q) for q in row) for row in rows))
    pinv = Fields(machine.model, S).B_pinv
    return pinv if S is None else multiply(pinv, S.S)


def forgotten(recipe: HardwareRecipe) -> Fraction:
    """th = 1 - e^(-omega Ts), to 50 digits."""
    if recipe.bandwidth is None:
        return Fraction(1)
    exponent = -recipe.bandwidth * recipe.sample_time
    power = _DIGITS.divide(Decimal(exponent.numerator), Decimal(exponent.denominator))
    return 1 - Fraction(_DIGITS.exp(power))


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
