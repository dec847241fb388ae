"""The blocks of a controller as programs: plan, drift, feedback, means of inputs, predictor, estimator.

The feedback is (0.5), the estimator (H.5), the predictor the rule of Runge and Kutta of H-P.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from typing import Final

from tubecert.conditions.hardware import HardwareRecipe
from tubecert.coordinates import Coordinates, Fields, inverse
from tubecert.export.controller import Boxes
from tubecert.export.program import GREATEST, LEAST, RATIO, SHRINK, Place, Program, Writer
from tubecert.expression import derivatives, topological
from tubecert.expression.matrix import Matrix, multiply
from tubecert.model import TIME, ControlAffineModel
from tubecert.spec import Picard
from tubecert.trajectory import Plan

INTEGRATION: Final = 4  # steps of the prediction of H-P
# of Gauss's rule over one sample: shares of it, and weights
NODES: Final = (Fraction("0.11270166537925831148"), Fraction(1, 2), Fraction("0.88729833462074168852"))
_WEIGHTS: Final = (Fraction(5, 18), Fraction(4, 9), Fraction(5, 18))
_DIGITS: Final = Context(prec=60)
LEAST_SIZE: Final = Fraction(1, 2**120)  # |c|^2 below which the feedback fades out


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What a controller is made of.

    `clip` by input, empty for the ball of the recipe; `coordinates` S, by rows; `horizon` of the claim, None for ever;
    `feedback_gain` du; `geodesic`: how geodesics are computed; `noise_size` n_E, where rounding is asked for;
    `boxes` of a family of plans.
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
    noise_size: Fraction | None = None
    boxes: Boxes | None = None


def _states(writer: Writer, model: ControlAffineModel, name: str) -> tuple[list[Place], dict[str, Place]]:
    x = writer.input(name, len(model.states))
    return x, dict(zip(model.states, x, strict=True))


def plan(plan: Plan) -> Program:
    """x*(t) and u*(t) as a program."""
    writer = Writer()
    (t,) = writer.input("t", 1)
    writer.output("x", writer.expressions(plan.x, {TIME: t}))
    writer.output("u", writer.expressions(plan.u, {TIME: t}))
    return writer.finished("plan", "x*(t) and u*(t)")


def drift(model: ControlAffineModel) -> Program:
    """f(x) as a program."""
    writer = Writer()
    _, names = _states(writer, model, "x")
    writer.output("f", writer.expressions(model.f, names))
    return writer.finished("drift", "f(x)")


def flow(model: ControlAffineModel) -> Program:
    """v = f(x) + B(x) u as a program."""
    writer = Writer()
    x, u = writer.input("x", len(model.states)), writer.input("u", len(model.inputs))
    writer.output("v", _speed(writer, model, x, u))
    return writer.finished("flow", "v = f(x) + B(x) u")


def _speed(writer: Writer, model: ControlAffineModel, x: Sequence[Place], u: Sequence[Place]) -> list[Place]:
    names = dict(zip(model.states, x, strict=True))
    f, B = writer.expressions(model.f, names), writer.matrix(model.B, names)
    return [writer.add(each, writer.dot(row, u)) for each, row in zip(f, B, strict=True)]


def predictor(model: ControlAffineModel, length: Fraction) -> Program:
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


def steep(model: ControlAffineModel) -> Program | None:
    """The derivatives J (n, n) of f + B u by states, and B (n, m); None where a table has no derivative in code."""
    if any(node.op == "table" for node in topological([*model.f, *(e for row in model.B for e in row)])):
        return None
    writer, n = Writer(), range(len(model.states))
    x, u = writer.input("x", len(n)), writer.input("u", len(model.inputs))
    names = dict(zip(model.states, x, strict=True))
    columns = []
    for state in model.states:
        own = writer.expressions(derivatives(list(model.f), state), names)
        turned = [writer.expressions(derivatives(list(row), state), names) for row in model.B]
        columns.append([writer.add(own[i], writer.dot(turned[i], u)) for i in n])
    writer.output("J", [columns[j][i] for i in n for j in n])
    writer.output("B", [place for row in writer.matrix(model.B, names) for place in row])
    return writer.finished("steep", "the derivatives of f + B u, and B")


def applied(m: int, recipe: HardwareRecipe, *, played: bool) -> Program:
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


def gauss(m: int) -> Program:
    """Gauss's mean of u* over a sample, from its three nodes."""
    writer = Writer()
    nodes = [writer.input(name, m) for name in ("a", "b", "c")]
    weights = [writer.constant(q) for q in _WEIGHTS]
    writer.output("mean", [writer.dot(weights, each) for each in zip(*nodes, strict=True)])
    return writer.finished(
        "gauss", "the mean of u* over a sample, from its values at the three nodes of Gauss"
    )


def bend(plan: Plan) -> Program:
    """Of six derivatives of u*, which the error of Gauss's rule is made of."""
    bent = list(plan.u)
    for _ in range(2 * len(NODES)):
        bent = derivatives(bent, TIME)
    writer = Writer()
    (t,) = writer.input("t", 1)
    writer.output("u", writer.expressions(bent, {TIME: t}))
    return writer.finished("bend", "the sixth derivative of u*(t)")


def law(model: ControlAffineModel, most: Fraction | None) -> Program:
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


def estimator(machine: Machine) -> Program:
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


def explained(model: ControlAffineModel, S: Coordinates | None) -> Matrix:
    """(S B)^+ S, (m, n): what of a speed the inputs can make."""
    pinv = Fields(model, S).B_pinv
    return pinv if S is None else multiply(pinv, S.S)


def _explained(machine: Machine) -> Matrix:
    rows = machine.coordinates
    S = None if rows is None else Coordinates(tuple(tuple(Fraction(q) for q in row) for row in rows))
    return explained(machine.model, S)


def forgotten(recipe: HardwareRecipe) -> Fraction:
    """th = 1 - e^(-omega Ts), to 50 digits."""
    if recipe.bandwidth is None:
        return Fraction(1)
    exponent = -recipe.bandwidth * recipe.sample_time
    power = _DIGITS.divide(Decimal(exponent.numerator), Decimal(exponent.denominator))
    return 1 - Fraction(_DIGITS.exp(power))
