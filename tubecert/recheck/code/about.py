"""What a code is examined against, and what it may lose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball
from tubecert.recheck.code.prediction import Model
from tubecert.recheck.curve import Curve
from tubecert.recheck.lookup import Table


@dataclass(frozen=True, kw_only=True)
class About:
    """What a certificate says of the loop.

    `metric` M and `widths` sqrt(W_ii); `reach` bounds d(x*, y); `gain` is du, `estimate` bounds |q|, `radius` |q^|;
    `share` is th; `held`: u* is held from sample to sample. `moves`: how far what is measured moves in one, by state.
    `tables` are those that its functions read. `model` is what a prediction integrates; None without one.
    """

    curve: Curve
    inputs: int
    metric: list[list[Ball]]
    widths: list[Ball]
    reach: Ball
    gain: Ball
    estimate: Ball
    radius: Ball
    share: Ball
    sample_time: Fraction
    held: bool
    moves: Sequence[Ball] = ()
    model: Model | None = None
    stretch: Ball = field(default_factory=lambda: arb(1))
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """Upper bounds of r_a, r_u, r_q and r_p."""

    feedback: Ball
    input: Ball
    estimate: Ball
    prediction: Ball
