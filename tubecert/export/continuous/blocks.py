"""(4.5) as programs: what an estimate is at a sample, what the filter holds after it, and the predictor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from typing import Final

from tubecert.conditions.sampled import SampledRecipe
from tubecert.coordinates import Coordinates
from tubecert.export.blocks import explained
from tubecert.export.program import SHRINK, Place, Program, Writer
from tubecert.model import ControlAffineModel

_DIGITS: Final = Context(prec=60)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """What the programs of a loop are made of; `coordinates` are those of its tube."""

    model: ControlAffineModel
    recipe: SampledRecipe
    coordinates: Coordinates | None


def estimator(own: Parts) -> Program:
    """s_hat = -g/(e^(g Ts) - 1) xt, sigma_hat = clip(e^(g Ts) B^+ s_hat), xt = xhat - x at a sample."""
    writer, model, recipe = Writer(), own.model, own.recipe
    x, xhat = (writer.input(name, len(model.states)) for name in ("x", "xhat"))
    gain = recipe.predictor_gain
    kept = _exp(-gain * recipe.sample_time)
    error = [writer.sub(p, q) for p, q in zip(xhat, x, strict=True)]
    pull = writer.constant(gain * kept / (1 - kept))
    writer.output("s", [writer.neg(writer.mul(pull, each)) for each in error])
    explains = writer.matrix(explained(model, own.coordinates), dict(zip(model.states, x, strict=True)))
    whole = writer.constant(gain / (1 - kept))
    raw = [writer.neg(writer.mul(whole, writer.dot(row, error))) for row in explains]
    writer.output("q", raw)
    writer.output("estimate", _clipped(writer, raw, recipe.projection_radius))
    return writer.finished(
        "estimator", "what is adapted at a sample: s_hat, and sigma_hat before and after its clip"
    )


def _clipped(writer: Writer, q: Sequence[Place], radius: Fraction) -> list[Place]:
    size = writer.call("sqrt", writer.dot(q, q))
    share = writer.choose(SHRINK, size, writer.constant(radius))
    return [writer.mul(share, each) for each in q]


def filter_of(own: Parts) -> Program:
    """u_a' = -omega (u_a + sigma_hat), solved from a sample on: u_a e^(-omega s) - sigma_hat (1 - e^(-omega s))."""
    writer, m = Writer(), len(own.model.inputs)
    (since,) = writer.input("since", 1)
    u, sigma = writer.input("u", m), writer.input("sigma", m)
    kept = writer.call("exp", writer.neg(writer.mul(writer.constant(own.recipe.bandwidth), since)))
    rest = writer.sub(writer.constant(1), kept)
    both = zip(u, sigma, strict=True)
    writer.output("u", [writer.sub(writer.mul(kept, a), writer.mul(rest, b)) for a, b in both])
    return writer.finished("filtered", "u_a, s seconds after the sample at which it was u")


def observer(own: Parts) -> Program:
    """xhat' = v + s_hat - g xt, v being f(x) + B(x) u."""
    writer, n = Writer(), len(own.model.states)
    v, x, xhat, s = (writer.input(name, n) for name in ("v", "x", "xhat", "s"))
    gain = writer.constant(own.recipe.predictor_gain)
    rows = zip(v, x, xhat, s, strict=True)
    writer.output(
        "rate",
        [writer.sub(writer.add(a, d), writer.mul(gain, writer.sub(c, b))) for a, b, c, d in rows],
    )
    return writer.finished("observer", "xhat'; v is f(x) + B(x) u")


def _exp(exponent: Fraction) -> Fraction:
    """To 60 digits."""
    power = _DIGITS.divide(Decimal(exponent.numerator), Decimal(exponent.denominator))
    return Fraction(_DIGITS.exp(power))
