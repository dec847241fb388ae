"""The best tube for a machine, and what a tube asks of one, from code and for the command: `tubecert design`.

In: a specification with a machine, and what is asked for. Out: every attempt, each a certificate.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert import certificate
from tubecert.digits import short
from tubecert.errors import SpecError
from tubecert.expression import number_text, suggestion
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.library.asked import Named, effort_numbers
from tubecert.library.certification import Certification, certification_of
from tubecert.library.metrics import MetricLike, with_metric
from tubecert.library.plain import Number, number_texts
from tubecert.library.plain import number_text as text_of
from tubecert.library.specification import Specifiable, spec_of
from tubecert.library.trading import (
    CORRIDOR,
    PARETO,
    TUBE,
    Asked,
    corridor_settings,
    largest,
    parts_of,
    quantities,
    refused,
)
from tubecert.pipeline import Options
from tubecert.pipeline.design import Attempt as Tried
from tubecert.pipeline.design import Design as Attempts
from tubecert.pipeline.design import narrowest
from tubecert.pipeline.metric_search import search
from tubecert.pipeline.trade import Front, Offer, cheapest, front
from tubecert.pipeline.width import Measure, measure_in, measure_of
from tubecert.printable import visible
from tubecert.progress import Progress
from tubecert.report import design as told
from tubecert.report import trade as told_trade
from tubecert.report.progress import timed
from tubecert.spec import Setting, Spec
from tubecert.spec.load import load_source
from tubecert.spec.source import Source

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.enclosure.interval import Array

SEARCH: Final = "search"


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """A tube that was tried, `scale` times as wide as the specification's; `size`: what is proven of it, or None."""

    scale: Fraction
    size: float | None
    result: Result = field(repr=False)

    @property
    def certification(self) -> Certification:
        """The certificate, whatever its verdict."""
        return _sealed(self.result)


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The narrowest tube for a machine: every attempt in the order in which they were made.

    `metric` is the metric that was found for it, as a mapping that `tc.certify` takes; None where none was looked for,
    or the specification's own is better.
    """

    spec: Spec = field(repr=False)
    found: Attempts = field(repr=False)
    metric: Mapping[str, object] | None = field(default=None, repr=False)

    @property
    def attempts(self) -> tuple[Attempt, ...]:
        """Every size that was tried."""
        return tuple(map(_attempt, self.found.attempts))

    @property
    def best(self) -> Attempt | None:
        """The narrowest that is certified; None if none is."""
        return None if self.found.best is None else _attempt(self.found.best)

    def __str__(self) -> str:
        return told.summary(self.spec, self.found).plain

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_line(str(self), self.spec.name, self._style(), _rows(self.attempts))

    def _style(self) -> str:
        return str((self.found.best or self.found.attempts[0]).result.verdict)


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
                Attempt(scale=each.scale, size=each.size, result=each.offer.result),
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


def design(
    spec: Specifiable,
    *,
    minimise: Sequence[str] | None = None,
    metric: MetricLike | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    progress: Progress | None = None,
) -> Design:
    """The narrowest certified tube for the machine of a specification: `tubecert design`.

    `minimise`: the states and outputs whose half-widths count, without it those of `tube.half_widths`, or the radius.
    `metric` stands in for the specification's own; `"search"` looks for one for this machine. Raises `SpecError`.
    """
    found: list[Mapping[str, object]] = []

    def keep(text: str) -> MetricLike:
        found.append(json.loads(text))
        return found[-1]

    asked = opened(
        spec_of(spec), _options(gap, budget), minimise, metric, named=str, keep=keep, progress=timed(progress)
    )
    return Design(spec=asked.load(()), found=narrowed(asked), metric=found[0] if found else None)


def machines(
    spec: Specifiable,
    corridor: Number | Mapping[str, Number],
    *,
    metric: MetricLike | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    progress: Progress | None = None,
) -> Machines:
    """The cheapest machine for a tube: `tubecert design --corridor`. A radius, or half-widths by state."""
    if isinstance(corridor, Mapping):
        words = ",".join(f"{name}={text_of(width, str(name))}" for name, width in corridor.items())
    else:
        words = text_of(corridor, CORRIDOR)
    asked = opened(
        spec_of(spec),
        _options(gap, budget),
        None,
        metric,
        named=str,
        keep=json.loads,
        progress=timed(progress),
    )
    own, found = offered(words, asked)
    return Machines(spec=own, found=found)


def trade_off(
    spec: Specifiable,
    key: str,
    *,
    minimise: Sequence[str] | None = None,
    metric: MetricLike | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    progress: Progress | None = None,
) -> TradeOff:
    """The tube against a number of the machine: `tubecert design --pareto tube,KEY`.

    `key` is `hardware.rate`, `.delay`, `.noise` or `disturbance.bound`.
    """
    asked = opened(
        spec_of(spec),
        _options(gap, budget),
        minimise,
        metric,
        named=str,
        keep=json.loads,
        progress=timed(progress),
    )
    words = f"{TUBE},{key}"
    _, part = quantities(words, str)
    own, found = fronted(words, asked)
    return TradeOff(spec=own, part=part, found=found)


# -- what the command shares


def opened(
    spec: Spec,
    options: Options,
    minimise: Sequence[str] | None,
    metric: MetricLike | None,
    *,
    named: Named,
    keep: Callable[[str], MetricLike],
    progress: Progress | None,
) -> Asked:
    """A design of a specification; `keep` is given the text of a metric that is found, and says how it is given on.

    Raises `SpecError` where something is missing.
    """
    wanted = metric == SEARCH if isinstance(metric, str) else False
    source = Source.of(spec.path, spec.source)
    fixed = [Setting(path=path, text=text) for path, text in spec.settings]

    def plain(settings: Sequence[Setting]) -> Spec:
        # what a design sets itself takes the place of what was set of the same key
        kept = [own for own in fixed if not any(each.covers(own.path) for each in settings)]
        return load_source(source, (*kept, *settings)) if settings else spec

    asked = Asked(
        load=plain, options=options, measure=_minimised(spec, minimise, named), progress=progress, named=named
    )
    held = None if wanted else metric
    _check(spec if held is None else with_metric(spec, held)[0], searched=wanted)
    if wanted:
        text = _searched(spec, asked)
        held = None if text is None else keep(text)
    if held is None:
        return asked
    own, name = held, with_metric(spec, held)[1]
    return replace(
        asked,
        load=lambda settings: with_metric(plain(settings), own)[0],
        options=replace(options, metric=Path(name)),
    )


def narrowed(asked: Asked) -> Attempts:
    """Every attempt at the narrowest tube."""
    first = asked.load(())
    return narrowest(
        lambda scale: asked.load(_scaled(first, scale)), asked.options, asked.measure, asked.progress
    )


def offered(words: str, asked: Asked) -> tuple[Spec, tuple[Offer, ...]]:
    """The specification with the tube that is asked for, and the cheapest machine, part by part."""
    tube = corridor_settings(words, asked)
    spec = asked.load(tube)
    found = cheapest(
        lambda part: asked.load([*tube, largest(spec, part)]),
        parts_of(spec, asked.named),
        asked.options,
        asked.progress,
    )
    return spec, found


def fronted(words: str, asked: Asked) -> tuple[Spec, Front]:
    """The size of the tube against a number of the machine."""
    key, part = quantities(words, asked.named)
    spec = asked.load(())
    if part not in parts_of(spec, asked.named):
        message = f"{key} is no single number of this machine"
        raise refused(asked.named(PARETO), message, "see docs/design.md")
    found = front(
        lambda scale: asked.load([*_scaled(spec, scale), largest(spec, part)]),
        part,
        asked.measure,
        asked.options,
        asked.progress,
    )
    return spec, found


def _check(spec: Spec, *, searched: bool) -> None:
    """What a design needs; raises `SpecError`."""
    if spec.metric is None and not searched:
        raise _error(spec, "metric", "a design needs a metric", "tubecert synth, then --metric FILE")
    if spec.tube.epsilon is None and not spec.tube.half_widths:
        raise _error(spec, "tube", "a design needs a tube to begin with", "write tube: {half_widths: {...}}")


def _error(spec: Spec, path: str, message: str, help: str) -> SpecError:
    return SpecError([Finding(code="TC105", message=message, location=spec.location(path), help=help)])


def _minimised(spec: Spec, names: Sequence[str] | None, named: Named) -> Measure:
    """What counts: the states and outputs named, each in its own unit or that of its half-width; raises `SpecError`."""
    if names is None:
        return measure_of(spec)
    wrong = [name for name in names if name not in spec.lengths]
    if wrong:
        help = suggestion(wrong[0], spec.lengths, what="states and outputs" if spec.outputs else "states")
        message = f"{named('minimise')}: {visible(wrong[0])} is no state" + (
            " or output" if spec.outputs else ""
        )
        raise SpecError([Finding(code="TC122", message=message, help=help)])
    return measure_in(spec, names) or measure_of(spec)


def _scaled(spec: Spec, scale: Fraction) -> list[Setting]:
    """The keys of the tube, times a scale."""
    if scale == 1:
        return []
    sizes = {f"tube.half_widths.{name}": width for name, width in spec.tube.half_widths}
    if not sizes:
        radii = (("tube.epsilon", spec.tube.epsilon), ("tube.rho_a", spec.tube.rho_a))
        sizes = {key: value for key, value in radii if value is not None}
    return [Setting.of(f"{key}={number_text(value * scale)}") for key, value in sizes.items()]


def _searched(spec: Spec, asked: Asked) -> str | None:
    """The text of the metric that was found; None if the specification's own serves better."""

    def held(own: Spec, scale: Fraction) -> Spec:
        return replace(asked.load(_scaled(spec, scale)), metric=own.metric, synthesis=None)

    try:
        found = search(spec, held, asked.measure, asked.options, asked.progress)
    except ValueError as error:
        raise _error(
            spec, "system.B", f"--metric search: {error}", "tubecert synth, then --metric FILE"
        ) from error
    best = found.best
    if best is None and spec.metric is None:
        best = min(found.candidates, key=lambda each: each.told, default=None)
        if best is None:
            help = "raise hardware.rate, shrink the safe set, or lower the wind"
            raise _error(spec, "hardware", "no metric was found that may serve this machine", help)
    return None if best is None else best.text


def _options(gap: Number | None, budget: int | None) -> Options:
    numbers = effort_numbers(number_texts(gap=gap, budget=budget))
    return numbers.options(conditions=None, formulas="corrected")


def _attempt(each: Tried) -> Attempt:
    return Attempt(scale=each.scale, size=each.size, result=each.result)


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
