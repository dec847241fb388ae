"""The best tube for a machine, and what a tube asks of one, from code and for the command: `tubecert design`.

In: a specification with a machine, and what is asked for. Out: every attempt, each a certificate.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf
from pathlib import Path
from typing import Final

from tubecert.errors import SpecError
from tubecert.expression import number_text, suggestion
from tubecert.findings import Finding
from tubecert.letters import HARDWARE
from tubecert.library.asked import Named, deadline_of, effort_numbers
from tubecert.library.designs import Design, Machines, TradeOff
from tubecert.library.metrics import MetricLike, with_metric
from tubecert.library.plain import Number, number_texts
from tubecert.library.plain import number_text as text_of
from tubecert.library.specification import Specifiable, spec_of
from tubecert.library.trading import (
    CORRIDOR,
    PARETO,
    TUBE,
    Asked,
    better_machines,
    corridor_settings,
    largest,
    parts_of,
    quantities,
    refused,
)
from tubecert.pipeline import Deadline, Options, certify
from tubecert.pipeline.design import Design as Attempts
from tubecert.pipeline.design import narrowest
from tubecert.pipeline.metric_search import Found, search
from tubecert.pipeline.sensitivities import Sensitivity
from tubecert.pipeline.sensitivities import sensitivities as sensitivities_of
from tubecert.pipeline.trade import Cheapest, Front, cheapest, front
from tubecert.pipeline.width import Measure, measure_in, measure_of, size_of
from tubecert.printable import visible
from tubecert.progress import Progress
from tubecert.report.progress import timed
from tubecert.spec import Setting, Spec
from tubecert.spec.load import load_source
from tubecert.spec.source import Source
from tubecert.stages.memory import Memory

SEARCH: Final = "search"


def design(
    spec: Specifiable,
    *,
    minimise: Sequence[str] | None = None,
    metric: MetricLike | None = None,
    sensitivities: bool = False,
    gap: Number | None = None,
    budget: int | None = None,
    deadline: Number | None = None,
    progress: Progress | None = None,
) -> Design:
    """The narrowest certified tube for the machine of a specification: `tubecert design`.

    `minimise`: the states and outputs whose half-widths count, without it those of `tube.half_widths`, or the radius.
    `metric` stands in for the specification's own; `"search"` looks for one for this machine. `sensitivities`: what the
    tube becomes with each number of the machine halved, and taken away. `deadline`: the best that was certified so many
    s from now, at least the tube that is asked for (a metric is looked for in full). Raises `SpecError`.
    """
    found: list[Mapping[str, object]] = []

    def keep(text: str) -> MetricLike:
        found.append(json.loads(text))
        return found[-1]

    asked = opened(
        spec_of(spec),
        _options(gap, budget),
        minimise,
        metric,
        named=str,
        keep=keep,
        progress=timed(progress),
        deadline=deadline_of(deadline),
    )
    memory = Memory()
    attempts = narrowed(asked, memory)
    better = improved(attempts, asked, memory) if sensitivities and attempts.cut is None else ()
    return Design(
        spec=asked.load(()), found=attempts, sensitivities=better, metric=found[0] if found else None
    )


def machines(
    spec: Specifiable,
    corridor: Number | Mapping[str, Number],
    *,
    metric: MetricLike | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    deadline: Number | None = None,
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
        deadline=deadline_of(deadline),
        as_it_is=True,
    )
    own, found = offered(words, asked)
    return Machines(spec=own, found=found.offers)


def trade_off(
    spec: Specifiable,
    key: str,
    *,
    minimise: Sequence[str] | None = None,
    metric: MetricLike | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    deadline: Number | None = None,
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
        deadline=deadline_of(deadline),
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
    deadline: Deadline | None = None,
    as_it_is: bool = False,
) -> Asked:
    """A design of a specification; `keep` is given the text of a metric that is found, and says how it is given on.

    With a metric that is looked for, a tube without coordinates of its own may be given some, unless it stays
    `as_it_is`. Raises `SpecError` where something is missing.
    """
    wanted = metric == SEARCH if isinstance(metric, str) else False
    asked = Asked(
        load=_loader(spec),
        options=options,
        measure=_minimised(spec, minimise, named),
        progress=progress,
        named=named,
        deadline=deadline,
    )
    held = None if wanted else metric
    _check(spec if held is None else with_metric(spec, held)[0], searched=wanted)
    if wanted:
        asked, text = _chosen(spec, asked, None if as_it_is else _in_coordinates(spec, asked))
        held = None if text is None else keep(text)
    if held is None:
        return asked
    own, name, load = held, with_metric(spec, held)[1], asked.load
    return replace(
        asked,
        load=lambda settings: with_metric(load(settings), own)[0],
        options=replace(options, metric=Path(name)),
    )


def _loader(spec: Spec) -> Callable[[Sequence[Setting]], Spec]:
    """What reads a specification with settings beside its own."""
    source = Source.of(spec.path, spec.source)
    fixed = [Setting(path=path, text=text) for path, text in spec.settings]

    def load(settings: Sequence[Setting]) -> Spec:
        # what a design sets itself takes the place of what was set of the same key
        kept = [own for own in fixed if not any(each.covers(own.path) for each in settings)]
        return load_source(source, _merged(kept, settings)) if settings else spec

    return load


def _in_coordinates(spec: Spec, asked: Asked) -> Asked | None:
    """The same with a tube in coordinates of its own, as wide in every state that counts as the ball is.

    None where the tube has them already, was asked for without, is cut into windows, or is not what H decides.
    """
    own = spec.tube
    if own.coordinates is not None or own.auto or own.windows is not None or not _of_machine(spec):
        return None
    width = number_text((own.epsilon or Fraction(0)) + (own.rho_a or Fraction(0)))
    widths = ", ".join(f"{name}: {width}" for name in asked.measure.units or spec.states)
    gap = "" if own.gap is None else f", gap: {own.gap}"
    shaped = asked.load([Setting(path=TUBE, text=f"{{half_widths: {{{widths}}}{gap}}}")])
    # a radius is one of x in a ball, and one of z in coordinates: half-widths are the same in both
    units = asked.measure.units or dict.fromkeys(spec.states, 1.0)
    return replace(asked, load=_loader(shaped), measure=Measure(units=units))


def _of_machine(spec: Spec) -> bool:
    """Whether certificate H decides."""
    return bool(spec.gained) or spec.decides in (HARDWARE.letter, HARDWARE.option, HARDWARE.key)


def _chosen(spec: Spec, asked: Asked, shaped: Asked | None) -> tuple[Asked, str | None]:
    """The tube, as it is or in coordinates of its own, and the text of a metric; None: the specification's own."""
    if shaped is None:
        return asked, _metric_of(spec, _found(spec, asked))
    asked = replace(asked, measure=shaped.measure)
    found = _found(spec, shaped)
    sizes = [
        size for size in (found.own, None if found.best is None else found.best.size) if size is not None
    ]
    ball = (
        size_of(certify(spec, asked.options, asked.progress, brief=True), asked.measure)
        if spec.metric
        else None
    )
    if ball is not None and ball <= min(sizes, default=inf):
        return asked, None
    return shaped, _metric_of(spec, found)


def _merged(fixed: Sequence[Setting], settings: Sequence[Setting]) -> list[Setting]:
    """Both; what a design sets of a mapping that was set as a whole, as in `tube={epsilon: 1}`, goes into its text."""
    found, left = list(fixed), []
    for each in settings:
        whole = next((k for k, own in enumerate(found) if own.covers(each.path)), None)
        key = each.path.rpartition(".")[2]
        number = re.compile(rf"\b{re.escape(key)}\s*:[^,{{}}]+")
        if whole is not None and number.search(found[whole].text):
            text = number.sub(f"{key}: {each.text}", found[whole].text, count=1)
            found[whole] = replace(found[whole], text=text)
        else:
            left.append(each)
    return [*found, *left]


def narrowed(asked: Asked, memory: Memory | None = None) -> Attempts:
    """Every attempt at the narrowest tube."""
    first = asked.load(())
    return narrowest(
        lambda scale: asked.load(_scaled(first, scale)),
        asked.options,
        asked.measure,
        asked.progress,
        memory,
        deadline=asked.deadline,
    )


def improved(found: Attempts, asked: Asked, memory: Memory) -> tuple[Sensitivity, ...]:
    """What a better machine would make of the narrowest tube; `memory` is that of the design."""
    first = asked.load(())
    return sensitivities_of(
        found,
        lambda scale, better: asked.load([*_scaled(first, scale), *better.settings]),
        better_machines(first, asked.named),
        options=asked.options,
        measure=asked.measure,
        memory=memory,
        progress=asked.progress,
        deadline=asked.deadline,
    )


def offered(words: str, asked: Asked) -> tuple[Spec, Cheapest]:
    """The specification with the tube that is asked for, and the cheapest machine, part by part."""
    tube = corridor_settings(words, asked)
    spec = asked.load(tube)
    found = cheapest(
        lambda part: asked.load([*tube, *largest(spec, part)]),
        parts_of(spec, asked.named),
        asked.options,
        asked.progress,
        deadline=asked.deadline,
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
        lambda scale: asked.load([*_scaled(spec, scale), *largest(spec, part)]),
        part,
        asked.measure,
        asked.options,
        asked.progress,
        deadline=asked.deadline,
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


def _found(spec: Spec, asked: Asked) -> Found:
    """Metrics for the machine, in the tube that is asked for."""
    own = asked.load(())

    def held(other: Spec, scale: Fraction) -> Spec:
        return replace(asked.load(_scaled(own, scale)), metric=other.metric, synthesis=None)

    try:
        return search(own, held, asked.measure, asked.options, asked.progress)
    except ValueError as error:
        raise _error(
            spec, "system.B", f"--metric search: {error}", "tubecert synth, then --metric FILE"
        ) from error


def _metric_of(spec: Spec, found: Found) -> str | None:
    """The text of the metric that was found; None if the specification's own serves better."""
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
