"""What a search over machines, radii or settings found, as values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tubecert import certificate
from tubecert.digits import short
from tubecert.expression import number_text
from tubecert.libraries import versions
from tubecert.library.certification import Certification, certification_of
from tubecert.pipeline.design import Attempt as Tried
from tubecert.pipeline.design import Design as Attempts
from tubecert.pipeline.sensitivities import Sensitivity
from tubecert.pipeline.trade import Front, Offer
from tubecert.printable import visible
from tubecert.report import design as told
from tubecert.report import trade as told_trade
from tubecert.spec import Spec

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.enclosure.interval import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """A tube that was tried, `scale` times as wide as the specification's; `size`: what is proven of it, or None."""

    scale: Fraction
    size: float | None
    result: Result = field(repr=False)
    whole: Callable[[], Result] = field(repr=False, compare=False)

    @property
    def certification(self) -> Certification:
        """The certificate, whatever its verdict; certified again, in full, where it was one among others."""
        return _sealed(self.whole())


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The narrowest tube for a machine: every attempt in the order in which they were made.

    `metric` is the metric that was found for it, as a mapping that `tc.certify` takes; None where none was looked for,
    or the specification's own is better. `sensitivities`: the tubes of better machines, where they were asked for.
    """

    spec: Spec = field(repr=False)
    found: Attempts = field(repr=False)
    metric: Mapping[str, object] | None = field(default=None, repr=False)
    sensitivities: tuple[Sensitivity, ...] = ()

    @property
    def attempts(self) -> tuple[Attempt, ...]:
        """Every size that was tried."""
        return tuple(map(_attempt, self.found.attempts))

    @property
    def best(self) -> Attempt | None:
        """The narrowest that is certified; None if none is."""
        best = self.found.best
        return None if best is None else replace(_attempt(best), whole=partial(_known, best.result))

    def __str__(self) -> str:
        return told.summary(self.spec, self.found).plain

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_line(str(self), self.spec.name, self._style(), _rows(self.attempts))

    def _style(self) -> str:
        return str(self.found.shown.result.verdict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """The cheapest machine in one `part`: `sample_time` or `delay` in s, `noise` or `wind`; the rest is as it was.

    `value` is the largest that is certified, exact; None where nothing is.
    """

    part: str
    value: Fraction | None
    result: Result = field(repr=False)

    @property
    def certification(self) -> Certification:
        """The certificate, whatever its verdict."""
        return _sealed(self.result)


@dataclass(frozen=True, slots=True, kw_only=True)
class Machines:
    """What a tube asks of a machine, part by part, each alone."""

    spec: Spec = field(repr=False)
    found: tuple[Offer, ...] = field(repr=False)

    @property
    def parts(self) -> tuple[Machine, ...]:
        """Every part that is a single number."""
        return tuple(Machine(part=each.part, value=each.value, result=each.result) for each in self.found)

    def __getitem__(self, part: str) -> Machine:
        """One part by its name; raises `KeyError`."""
        for each in self.parts:
            if each.part == part:
                return each
        raise KeyError(part)

    def __str__(self) -> str:
        return told_trade.offers_summary(self.spec, self.found).plain

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        rows = [(each.part, "none" if each.value is None else number_text(each.value)) for each in self.parts]
        return notebook.of_line(str(self), self.spec.name, "", rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class TradeOff:
    """The tube against one `part` of the machine: each point a certificate, narrow tubes first."""

    spec: Spec = field(repr=False)
    part: str
    found: Front = field(repr=False)

    @property
    def points(self) -> tuple[tuple[Attempt, Machine], ...]:
        """What no other point beats in both: the tube, and the largest value of the part in it."""
        return tuple(
            (
                Attempt(
                    scale=each.scale,
                    size=each.size,
                    result=each.offer.result,
                    whole=partial(_known, each.offer.result),
                ),
                Machine(part=self.part, value=each.offer.value, result=each.offer.result),
            )
            for each in self.found.best
        )

    @property
    def curve(self) -> Array:
        """Proven size of the tube and value of the part, (K, 2)."""
        rows = [(tube.size or 0.0, float(own.value or 0)) for tube, own in self.points]
        curve = np.array(rows, dtype=float).reshape(-1, 2)
        curve.flags.writeable = False
        return curve

    def __str__(self) -> str:
        count, tried = len(self.found.best), len(self.found.points)
        return f"{visible(self.spec.name)}: {self.part} against the tube: {count} of {tried} sizes that were tried"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        rows = [(short(size), short(value)) for size, value in self.curve]
        return notebook.of_line(str(self), self.spec.name, "", rows)


def _attempt(each: Tried) -> Attempt:
    return Attempt(scale=each.scale, size=each.size, result=each.result, whole=each.whole)


def _known(result: Result) -> Result:
    """What is there already in full."""
    return result


def _sealed(result: Result) -> Certification:
    run = {"command": "tubecert.design", "versions": versions()}
    return certification_of(certificate.seal(result.to_json(), run))


def _rows(attempts: Sequence[Attempt]) -> list[tuple[str, str]]:
    """Scales with what came of them."""
    return [
        (f"{short(each.scale)} times as wide", str(each.result.verdict) + _wide(each.size))
        for each in attempts
    ]


def _wide(size: float | None) -> str:
    return "" if size is None else f": {short(size)}"
