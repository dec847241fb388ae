"""Metrics from code: found and proven, or from elsewhere and decided; and what `synth` shares with it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final, TypeAlias

from tubecert import certificate, pipeline
from tubecert.certificate.metric_file import MetricFile
from tubecert.claims.family import Reason
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Constant
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.kinds import ALONE, DISTANCE
from tubecert.library import plain
from tubecert.library.asked import (
    SynthesisNumbers,
    Wishes,
    at_rate,
    degree_of,
    one_of,
    require_once,
    synthesis_numbers,
    verification_numbers,
    wanted_of,
)
from tubecert.library.plain import Data, Number, number_texts
from tubecert.library.specification import File, Specifiable, Specification, spec_of
from tubecert.progress import Progress
from tubecert.report.progress import timed
from tubecert.spec import Spec, metric_file
from tubecert.spec.metric import COORDINATES, OBJECTIVES, ROUTES
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.pipeline.verification import Verified
    from tubecert.report.page import Page

IN_CODE: Final = "given in code"  # what a certificate calls a metric that is no file


class _Held:
    """What metrics from code have in common: a metric file that can be kept, if the metric is proven."""

    __slots__ = ()

    @property
    def file(self) -> MetricFile | None:
        """The metric as its file has it, None if it is not proven."""
        raise NotImplementedError

    @property
    def proven(self) -> bool:
        """Whether C1-C3 are proven on the whole safe set."""
        return self.file is not None

    @property
    def dual_metric(self) -> tuple[tuple[str, ...], ...] | None:
        """W(x) (n, n) as expressions; None if nothing is proven."""
        return None if self.file is None else self.file.dual_metric

    def text(self) -> str:
        """The metric file. Raises `TubecertError` if nothing is proven."""
        if self.file is None:
            message = "there is no metric that is proven"
            raise SpecError([Finding(code="TC105", message=message, help="look at its reason")])
        return certificate.dump(self.file.to_json())

    def save(self, path: File) -> None:
        """Write the metric file, as `synth` does. Raises `TubecertError` if nothing is proven, `TargetError`."""
        certificate.write_text(os.fspath(path), self.text(), "choose another file")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SynthesisedMetric(_Held):
    """What a synthesis came to: a metric that is proven, or why there is none.

    `found` has the attempts, the metrics that were compared, and what is against other rates.
    """

    found: Synthesised = field(repr=False)
    given: Specification

    @property
    def verdict(self) -> Verdict:
        """`certified`: a metric is proven; `refuted`: none has the rate; `undecided`: none was found."""
        return self.found.verdict

    @property
    def file(self) -> MetricFile | None:
        """The metric as its file has it, None if there is none."""
        return self.found.file

    @property
    def rate(self) -> float | None:
        """The contraction rate in 1/s."""
        return None if self.file is None else float(self.file.rate)

    @property
    def condition_number(self) -> float | None:
        """A bound from above of the condition number over the safe set."""
        return None if self.file is None else self.file.condition_number.above

    @property
    def reason(self) -> str:
        """Why there is none, in words; empty if there is one."""
        return _sentence(self.found.reason)

    def __str__(self) -> str:
        from tubecert.report.text import headline

        return headline(self._page()).plain

    def __repr__(self) -> str:
        return f"<SynthesisedMetric: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(self._page())

    def _page(self) -> Page:
        from tubecert.report.synthesis import page_of

        return page_of(self.found.search(), self.file, self.given.name, self.given.states)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VerifiedMetric(_Held):
    """What is known of a metric on a safe set; `found` has it all."""

    found: Verified = field(repr=False)
    name: str

    @property
    def verdict(self) -> Verdict:
        """On C1-C3 at the rate."""
        return self.found.verdict

    @property
    def file(self) -> MetricFile | None:
        """The metric as its file has it, None if it is not proven."""
        return self.found.file

    @property
    def rate(self) -> float:
        """The contraction rate in 1/s that was asked about."""
        return float(self.found.rate)

    @property
    def largest_rate(self) -> Constant | None:
        """The supremum of the rates for which C2 holds, enclosed `below` and `above`; C3 has no part in it."""
        return self.found.largest_rate

    @property
    def condition_number(self) -> Constant | None:
        """The condition number over the safe set, enclosed."""
        return self.found.condition_number

    @property
    def reason(self) -> str:
        """What fails, in words; empty if nothing does."""
        return _sentence(self.found.reason)

    def __str__(self) -> str:
        from tubecert.report.text import headline

        return headline(self._page()).plain

    def __repr__(self) -> str:
        return f"<VerifiedMetric: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(self._page())

    def _page(self) -> Page:
        from tubecert.report.verification import page_of

        return page_of(self.name, self.found)


MetricLike: TypeAlias = File | SynthesisedMetric | VerifiedMetric | Data


def with_metric(spec: Spec, metric: MetricLike, rate: Fraction | None = None) -> tuple[Spec, str]:
    """The specification with a metric in place of its own, and what the metric is called; nothing of it is believed.

    `rate` stands in for that of coefficients. Raises `TubecertError`.
    """
    if isinstance(metric, (SynthesisedMetric, VerifiedMetric)):
        return metric_file.with_metric_text(spec, metric.text(), f"<{IN_CODE}>"), IN_CODE
    if isinstance(metric, Mapping):
        whole = {"format": metric_file.FORMAT, **metric}
        return metric_file.with_metric_text(spec, plain.document_text(whole), f"<{IN_CODE}>"), IN_CODE
    path = os.fspath(metric)
    return metric_file.with_metric(spec, path, rate), os.path.basename(path)


def verify(
    spec: Specifiable,
    metric: MetricLike | None = None,
    *,
    rate: Number | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    progress: Progress | None = None,
) -> VerifiedMetric:
    """Decides C1-C3 of a metric on the safe set, without plan, uncertainty or tube: `tubecert verify`.

    Without `metric` it is the specification's own. `rate`, in 1/s, is asked about in place of the metric's. A file or a
    mapping with a system, its safe set and a metric suffices as `spec`. Raises `SpecError` if there is no metric.
    """
    from tubecert.pipeline.verification import verify as decided

    numbers = verification_numbers(number_texts(rate=rate, gap=gap, budget=budget), str)
    wanted, effort = numbers.rate, Effort(gap=float(numbers.gap), budget=numbers.budget)
    whole, name = spec_of(spec, reads="system"), ""
    if metric is not None:
        whole, name = with_metric(whole, metric, wanted)
    return VerifiedMetric(
        found=decided(at_rate(whole, wanted), effort, timed(progress)), name=name or whole.name
    )


def synthesise(
    spec: Specifiable,
    *,
    rate: Number | None = None,
    objective: str | None = None,
    degree: int | None = None,
    variables: Sequence[str] | None = None,
    condition_number: Number | None = None,
    coordinates: str | None = None,
    route: str | None = None,
    solver: str | None = None,
    table: bool = False,
    rho_a: Number | None = None,
    epsilon: Number | None = None,
    budget: int | None = None,
    deadline: Number | None = None,
    progress: Progress | None = None,
) -> SynthesisedMetric:
    """Finds a metric and proves it: `tubecert synth`, with the same options.

    Returns what came of it, also if there is no metric. An interruption returns the best that was proven by then, if
    anything was. Raises `SpecError` for what makes the question meaningless.
    """
    texts = number_texts(
        rate=rate,
        condition_number=condition_number,
        rho_a=rho_a,
        epsilon=epsilon,
        budget=budget,
        deadline=deadline,
    )
    numbers = synthesis_numbers(texts, str)
    system = spec_of(spec)
    require_once(system, texts)
    wishes = Wishes(
        rate=numbers.rate,
        objective=one_of("objective", objective, OBJECTIVES),
        degree=degree_of(degree),
        variables=None if variables is None else tuple(map(str, variables)),
        condition_number=numbers.condition_number,
        coordinates=one_of("coordinates", coordinates, COORDINATES),
        route=one_of("route", route, ROUTES),
        solver=solver,
    )
    seconds = numbers.deadline
    found = pipeline.synthesise(
        system,
        wanted_of(system, wishes, str),
        options_of(system, numbers),
        timed(progress),
        table=table,
        deadline=None if seconds is None else pipeline.Deadline.after(float(seconds)),
        enough=content(system, objective),
    )
    if found.cut == "interrupted" and found.file is None:
        raise KeyboardInterrupt
    return SynthesisedMetric(found=found, given=Specification(spec=system))


def content(system: Spec, objective: str | None) -> bool:
    """Whether a tube that needs no adaptation is enough: neither an objective nor another certificate is asked for."""
    return objective is None and system.decides in (None, ALONE.option)


def options_of(system: Spec, numbers: SynthesisNumbers) -> pipeline.Options:
    """How metrics are compared end to end: by what the specification decides, else by the distance form."""
    options = pipeline.Options(
        rho_a=numbers.rho_a, epsilon=numbers.epsilon, conditions=system.decides or DISTANCE.option
    )
    return options if numbers.budget is None else replace(options, budget=numbers.budget)


def _sentence(reason: Reason | None) -> str:
    return "" if reason is None else reason.sentence
