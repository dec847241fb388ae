"""The text of exported code against the certificate: what it computes, and what its rounding loses.

The text is run on measurements in balls with bounds of what rounding does at every operation, where a decimal stands
for any number that it is the nearest one to, and compared with the formulas of section 8 (`controller`): a sign, an
index or a digit is seen. That examines, and proves nothing; the bounds of `losses` are over all that can go in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import Ball, exact, larger, length, magnitude, root, sharp_norm
from tubecert.recheck.code.about import About
from tubecert.recheck.code.constants import otherwise
from tubecert.recheck.code.lookups import tables_in
from tubecert.recheck.code.losses import lost_by
from tubecert.recheck.code.prediction import STEPS, Model
from tubecert.recheck.code.reader import Code
from tubecert.recheck.code.run import Machine, Value, Vector, numbers
from tubecert.recheck.code.seen import KINDS, Rounded, known
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.controller import BITS, OfFamily, machine_of
from tubecert.recheck.controller import Machine as Formulas
from tubecert.recheck.lookup import Table
from tubecert.recheck.steering import Column, Steering

_SLACK = 16  # units of rounding of the largest input, for integrals that are computed by fine steps
_FEWEST = 8  # samples
_PREDICTED = 2**12  # the same, where the code integrates by steps that are less fine


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """A loss to rounding: what it is at most, and what the certificate allows for."""

    name: str
    most: Fraction
    allowed: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """How far the text is from the formulas, at most and of what it may be; `losses`, empty where none are covered.

    `otherwise`: names of numbers that are not those of the certificate.
    """

    difference: float
    share: float
    losses: tuple[Allowed, ...]
    otherwise: tuple[str, ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether the text computes the formulas, as far as was looked at."""
        return self.share <= 1

    @property
    def too_large(self) -> tuple[Allowed, ...]:
        """Losses that are not within what is allowed for."""
        return tuple(own for own in self.losses if not own.most <= own.allowed)


def examine(
    text: str,
    file: str,
    code: Code,
    measured: Sequence[Sequence[Fraction]],
    answered: Sequence[Sequence[float]] | None = None,
) -> Agreement:
    """The code of a certificate; raises `CertificateError`, and `UnreadError` for what it does not follow.

    `answered` is what compiled code made of what was measured, if there is a compiler.
    """
    formulas = machine_of(text, file)
    if formulas.recipe.losses is not None:  # which bound how far the rule of the code is from a solution
        formulas = replace(formulas, steps=STEPS)
    with ctx.workprec(BITS):
        rows = [[exact(q) for q in row] for row in measured]
        difference, share = agreement(code, formulas, rows, answered)
        return Agreement(
            difference=difference,
            share=share,
            losses=tuple(_losses(code, formulas)),
            otherwise=tuple(otherwise(code, formulas)),
        )


def agreement(
    code: Code,
    formulas: Formulas,
    measured: Sequence[Column],
    answered: Sequence[Sequence[float]] | None = None,
) -> tuple[float, float]:
    """The largest difference of an input, and of what it may be; `answered` is what compiled code made of the same.

    Raises `UnreadError` where what the numbers of the text are off has no bound.
    """
    measured = measured[: _claimed(formulas)]
    expected = list(formulas.answers(measured))
    slack = _PREDICTED if formulas.section.predict and formulas.steps != STEPS else _SLACK
    return apart(code.real, expected, _answers(code, formulas, measured), answered, slack)


def _claimed(formulas: Formulas) -> int | None:
    """How many samples lie within the horizon: of later ones nothing is claimed, nor what a plan is there."""
    horizon = formulas.case.curve.horizon
    return None if horizon is None else int(horizon / formulas.recipe.sample_time) + 1


def apart(
    real: str,
    expected: Sequence[Column],
    found: Iterable[Vector],
    answered: Sequence[Sequence[float]] | None,
    units: int = _SLACK,
) -> tuple[float, float]:
    """The largest difference of an entry, and of what it may be; raises `UnreadError` where that has no bound."""
    largest = arb(0)
    for row in expected:
        for each in row:
            largest = larger(largest, magnitude(each))
    slack = largest * KINDS[real].unit * units
    worst, share = arb(0), arb(0)
    for k, (answer, own) in enumerate(zip(found, expected, strict=True)):
        for j, (a, b) in enumerate(zip(numbers(answer), own, strict=True)):
            if not (a.error.is_finite() and a.value.is_finite()):
                if k > _FEWEST:  # errors of a prediction feed themselves
                    return float(worst), float(share.upper())
                raise UnreadError("what its numbers are off has no bound from one sample to the next")
            off = magnitude(a.value.mid() - b)
            if answered is not None:
                off = larger(off, magnitude(arb(answered[k][j]) - b))
            worst, share = larger(worst, off), larger(share, off / (a.error + slack))
    return float(worst), float(share.upper())


def _answers(code: Code, formulas: Formulas, measured: Sequence[Column]) -> Iterator[Vector]:
    """Of the text: start, and a step for every sample."""
    own = Rounded(KINDS[code.real], decides=True)
    machine = Machine(code, own, {"piece": place_of(formulas)})
    m, state = len(formulas.case.system.inputs), machine.state()
    for k, row in enumerate((measured[0], *measured)):
        u: Vector = [None] * m
        given: list[Vector] = [[known(each) for each in part] for part in _handed(formulas, row)]
        if k:
            machine.call(f"{code.name}_step", state, *given, u)
        else:
            machine.call(f"{code.name}_start", state, *given[:3], u)
        yield u


def _handed(formulas: Formulas, row: Column) -> list[Column]:
    """The vectors that a row is handed in as."""
    return [part for part in formulas.split(row) if part] if isinstance(formulas, OfFamily) else [row]


_CLOSE = arb(10) ** -10  # s, of a knot


def place_of(formulas: Steering) -> Callable[[Value], int]:
    """Which piece of its plan a time lies in."""
    parts = formulas.case.curve.parts

    def piece(t: Value) -> int:
        (own,) = numbers([t])
        begun = [k for k, part in enumerate(parts) if not own.value.mid() + _CLOSE < part.start]
        return max(begun, default=0)

    return piece


def _losses(code: Code, formulas: Formulas) -> Iterator[Allowed]:
    """Where the certificate is about rounding."""
    allowed = formulas.recipe.losses
    if allowed is None:
        return
    found = lost_by(code, about(formulas))
    for name in ("feedback", "input", "estimate", "prediction")[: 4 if formulas.section.predict else 3]:
        most: Ball = getattr(found, name)
        if not most.is_finite():
            raise UnreadError(f"what rounding costs the {name} has no bound")
        yield Allowed(name=name, most=_fraction(most.upper()), allowed=getattr(allowed, name))


def _fraction(x: Ball) -> Fraction:
    """Of a number that is one of the form m 2^e."""
    mantissa, exponent = x.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def about(formulas: Formulas) -> About:
    """What the certificate says of the loop."""
    case, recipe = formulas.case, formulas.recipe
    noise = case.machine
    if noise is None:
        raise UnreadError("there is no machine")
    looked = noise.noise_metric * exact(recipe.noise)
    if recipe.prediction is not None:  # n_P of theorem H-P; what it is at the feedback is larger
        looked = larger(looked, root(exact(case.bound("upper"))) * exact(recipe.prediction))
    decay = None if recipe.bandwidth is None else exact(recipe.bandwidth * recipe.sample_time)
    return About(
        curve=case.curve,
        inputs=len(case.system.inputs),
        metric=formulas.metric,
        widths=[root(row[i]) for i, row in enumerate(formulas.dual)],
        reach=exact(recipe.level) + looked,
        gain=exact(case.bound("feedback_gain")),
        estimate=exact(recipe.clip_radius + max(recipe.clip_radius, recipe.bias) + recipe.ripple),
        radius=exact(recipe.clip_radius),
        share=arb(1) if decay is None else -(-decay).expm1(),
        sample_time=recipe.sample_time,
        held=formulas.held,
        moves=moves_of(formulas, noise.noise_size),
        model=model_of(formulas),
        stretch=stretch_of(formulas),
        tables=read_by(formulas),
    )


def read_by(formulas: Formulas) -> tuple[Table, ...]:
    """Functions given by tables, in f, B and the plan."""
    system, curve = formulas.case.system, formulas.case.curve
    return tables_in(
        [*(row[0] for row in system.f), *(e for row in system.B for e in row), *curve.x, *curve.u]
    )


def model_of(formulas: Formulas) -> Model | None:
    """What the code integrates, where it predicts."""
    if not formulas.section.predict:
        return None
    system, curve = formulas.case.system, formulas.case.curve
    if not formulas.whole and curve.parts[0].values:
        raise UnreadError("a prediction in which a feedforward through knots is played has no bound here")
    return Model(
        states=tuple(system.states),
        f=tuple(row[0] for row in system.f),
        B=tuple(map(tuple, system.B)),
        delay=formulas.recipe.delay,
        u=() if formulas.whole else tuple(curve.u),
    )


def stretch_of(formulas: Formulas) -> Ball:
    """|S|: radii, and what is off of a predicted state, are lengths in the coordinates of the tube."""
    S = formulas.case.tube.coordinates
    return arb(1) if S is None else sharp_norm([[exact(q) for q in row] for row in S])


def moves_of(formulas: Formulas, noise_size: Ball) -> list[Ball]:
    """|S (y_k - y_(k-1))| <= Y Ts + 2 nu n_E, of which every state is a share: Cauchy and Schwarz."""
    recipe, S = formulas.recipe, formulas.case.tube.coordinates
    far = exact(recipe.speed) * exact(recipe.sample_time) + 2 * exact(recipe.noise) * noise_size
    n = len(formulas.metric)
    if S is None:
        return [far] * n
    back = arb_mat([[exact(q) for q in row] for row in S]).inv()
    return [far * length([back[i, j] for j in range(n)]) for i in range(n)]
