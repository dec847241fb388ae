"""The times that matter for h and f: a horizon, a period, or none where nothing depends on t."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.cover import Range
from tubecert.recheck.grammar import PI
from tubecert.recheck.identity import common_part
from tubecert.recheck.specified.numbers import TIME
from tubecert.recheck.specified.plant import Uncertainty
from tubecert.recheck.terms import Term, in_order, names, number_of, slopes

_WAVES = ("sin", "cos", "tan")
_NEEDED = "h or f depends on t without a period that can be seen, so a horizon is needed"


@dataclass(frozen=True, slots=True)
class Period:
    """`length` s, or that many times pi; 0 where nothing depends on t."""

    length: Fraction
    of_pi: bool

    @property
    def ball(self) -> Ball:
        """An enclosure."""
        length = exact(self.length)
        return length * arb.pi() if self.of_pi else length

    @property
    def text(self) -> str:
        """As it is written: `2/3`, `pi`, `2/3*pi`."""
        if not self.of_pi:
            return str(self.length)
        return "pi" if self.length == 1 else f"{self.length}*pi"


def period_of(given: Uncertainty, moving: Sequence[Term] = ()) -> Period:
    """A common period of h, of what h owes and of what else is `moving`; `ValueError` if none can be seen."""
    return common_period([*_terms(given), *moving])


def time_range(given: Uncertainty, horizon: Fraction | None, moving: Sequence[Term] = ()) -> Range | None:
    """The times that matter for h and what else is `moving`: the horizon, or one period; None if all are free of t.

    Raises `ValueError` if something depends on t with no horizon and no period that can be seen.
    """
    if TIME not in names([*_terms(given), *moving]):
        return None
    return Fraction(0), (period_of(given, moving).ball if horizon is None else horizon)


def _terms(given: Uncertainty) -> list[Term]:
    """h, and what it owes: 0/(1 + sin(t)) is 0, and yet depends on t."""
    return [*(given.h or ()), *(duty.argument for duty in given.duties)]


def common_period(terms: Sequence[Term]) -> Period:
    """Of terms in which t occurs in sin, cos, tan of q t + c only (all q rational, or all rational multiples of pi)."""
    rational: list[Fraction] = []
    of_pi: list[Fraction] = []
    bare: dict[Term, bool] = {}  # whether t can be reached without passing through a wave
    for term in in_order(terms):
        if term.op in _WAVES and bare[term.args[0]]:
            frequency = _frequency(slopes([term.args[0]], TIME)[0])
            if frequency is None:
                raise ValueError(_NEEDED)
            (of_pi if frequency[1] else rational).append(abs(frequency[0]))
            bare[term] = False
        else:
            bare[term] = term.value == TIME if term.op == "symbol" else any(bare[arg] for arg in term.args)
    if any(bare[term] for term in terms) or (rational and of_pi):
        raise ValueError(_NEEDED)
    common = Fraction(0)
    for q in rational or of_pi:
        common = common_part(common, q)
    return Period(2 / common if common else Fraction(0), of_pi=bool(rational and common))


def _frequency(slope: Term) -> tuple[Fraction, bool] | None:
    """q of the slope q, or q of q pi."""
    if slope.op == "const":
        return number_of(slope), False
    if slope is PI:
        return Fraction(1), True
    if slope.op == "mul" and PI in slope.args:
        q = slope.args[1 - slope.args.index(PI)]
        return (number_of(q), True) if q.op == "const" else None
    return None
