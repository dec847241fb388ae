"""Metrics from code, and for the commands: `synth` finds one and proves it, `verify` decides one from elsewhere."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from tubecert import asking, certificate
from tubecert.asking import Number
from tubecert.certificate import file
from tubecert.errors import ExitCode, SpecError
from tubecert.findings import Finding, Location
from tubecert.library.certifying import BUDGET, DEADLINE
from tubecert.library.plain import Data, document_text
from tubecert.library.shown import Shown
from tubecert.library.specification import File, Specifiable, require_once, settings_in, spec_of
from tubecert.progress import Progress
from tubecert.records import to_json
from tubecert.report.page import Page
from tubecert.report.progress import timed
from tubecert.spec import Spec, Synthesis, metric_file
from tubecert.spec.metric import solver_name
from tubecert.spec.metric_file import FORMAT
from tubecert.spec.source import Source
from tubecert.synthesis import coefficients
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from fractions import Fraction

    from tubecert.certificate.result import MetricFile
    from tubecert.enclosure.constant import Constant
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.pipeline.verification import Verified

IN_CODE: Final = "given in code"  # what a certificate calls a metric that is no file
_BUDGET: Final = 2_000_000  # boxes of a verification
_OF_SECTION: Final = (
    "rate", "objective", "degree", "variables", "condition_number", "coordinates", "route", "solver",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class _Metric(Shown):
    """A metric on a safe set, as far as it is known: `found` has it all."""

    found: Synthesised | Verified = field(repr=False)
    name: str

    @property
    def verdict(self) -> Verdict:
        """`certified`: C1-C3 are proven; `refuted`: they fail, or no metric has the rate; else `undecided`."""
        return self.found.verdict

    @property
    def file(self) -> MetricFile | None:
        """The metric as its file has it, None if nothing is proven."""
        return self.found.file

    @property
    def proven(self) -> bool:
        """Whether C1-C3 are proven on the whole safe set."""
        return self.file is not None

    @property
    def dual_metric(self) -> tuple[tuple[str, ...], ...] | None:
        """W(x) (n, n) as expressions; None if nothing is proven."""
        return None if self.file is None else self.file.dual_metric

    @property
    def reason(self) -> str:
        """What fails, or why there is no metric, in words; empty if nothing does."""
        return "" if self.found.reason is None else self.found.reason.sentence

    def text(self) -> str:
        """The metric file. Raises `TubecertError` if nothing is proven."""
        if self.file is None:
            message = "there is no metric that is proven"
            raise SpecError([Finding(code="TC105", message=message, help="look at its reason")])
        return certificate.dump(self.file.to_json())

    def save(self, path: File) -> None:
        """Write the metric file, as `synth` does, over nothing but an older one that tubecert wrote.

        Raises `TubecertError` if nothing is proven, `TargetError`.
        """
        target, text = asking.text_of("path", path), self.text()
        file.spare(target, "metric file", help=file.OTHER)
        file.write_text(target, text, file.OTHER)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SynthesisedMetric(_Metric):
    """What a synthesis came to: a metric that is proven, or why there is none.

    `found` has the attempts, the metrics that were compared, and what is against other rates.
    """

    found: Synthesised = field(repr=False)
    states: tuple[str, ...] = field(repr=False)

    @property
    def rate(self) -> float | None:
        """The contraction rate in 1/s."""
        return None if self.file is None else float(self.file.rate)

    @property
    def condition_number(self) -> float | None:
        """A bound from above of the condition number over the safe set."""
        return None if self.file is None else self.file.condition_number.above

    def _page(self) -> Page:
        from tubecert.report.synthesis import page_of

        return page_of(self.found.search(), self.file, self.name, self.states)

    def _json(self) -> str:
        return certificate.dump(to_json(self.file or self.found.search()))

    @property
    def _exit_code(self) -> ExitCode:
        return ExitCode.INTERRUPTED if self.found.cut == "interrupted" else self.verdict.exit_code


class VerifiedMetric(_Metric):
    """What is known of a metric on a safe set; `found` has it all."""

    found: Verified

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

    def _page(self) -> Page:
        from tubecert.report.verification import page_of

        return page_of(self.name, self.found)


MetricLike: TypeAlias = "File | SynthesisedMetric | VerifiedMetric | Data"


def with_metric(spec: Spec, metric: MetricLike, rate: Fraction | None = None) -> tuple[Spec, str]:
    """The specification with a metric in place of its own, and what the metric is called; nothing of it is believed.

    `rate` stands in for that of coefficients. Raises `TubecertError`.
    """
    if not isinstance(metric, _Metric | Mapping):
        path = asking.text_of("metric", metric)
        return coefficients.with_metric_file(spec, path, rate), os.path.basename(path)
    whole = metric.text() if isinstance(metric, _Metric) else document_text({"format": FORMAT, **metric})
    return metric_file.with_metric(spec, Source.of(f"<{IN_CODE}>", whole)), IN_CODE


@asking.question({
    "metric": asking.Kind("The metric, in place of the specification's.", "METRIC"),
    "rate": asking.Exact("Decide at this rate, in 1/s, in place of the metric's own."),
    "gap": asking.Exact("Relative width to which the largest rate is enclosed.", below=1),
    "budget": BUDGET,
})  # fmt: skip
def verify(
    spec: Specifiable,
    metric: MetricLike | None = None,
    *,
    rate: Number | None = None,
    gap: Number = "1/1000",
    budget: int | None = None,
    progress: Progress | None = None,
) -> VerifiedMetric:
    """Decides C1-C3 of a metric on the safe set, without plan, uncertainty or tube: `tubecert verify`.

    Without `metric` it is the specification's own. `rate`, in 1/s, is asked about in place of the metric's. A file or a
    mapping with a system, its safe set and a metric suffices as `spec`. Raises `SpecError` if there is no metric.
    """
    from tubecert.enclosure.branch_and_bound import Effort
    from tubecert.pipeline.verification import verify as decided

    whole, name = spec_of(spec, reads="system"), ""
    if metric is not None:
        whole, name = with_metric(whole, metric, asking.exact(rate))
    effort = Effort(gap=float(gap), budget=budget or _BUDGET)
    found = decided(at_rate(whole, asking.exact(rate)), effort, timed(progress))
    return VerifiedMetric(found=found, name=name or whole.name)


def at_rate(spec: Spec, rate: Fraction | None) -> Spec:
    """The specification with another rate of its metric, if one is given; raises `SpecError` if it has no metric."""
    if spec.metric is None:
        place, message = Location(file=spec.path, line=1, column=1), "there is no metric to verify"
        help = "give a metric file after the specification (tubecert synth finds one), or metric.dual_metric and rate"
        raise SpecError([Finding(code="TC105", message=message, location=place, help=help)])
    return spec if rate is None else replace(spec, metric=replace(spec.metric, rate=rate))


@asking.question({
    "rate": asking.Exact("Contraction rate, in 1/s."),
    "objective": asking.Choice(
        "What is best. At a rate: the least condition number, the greatest margin. Else the rate that "
        "gives the least adaptation rate or the smallest tube, or the greatest rate.",
        words=("condition", "margin", "rate", "adaptation", "tube"),
    ),
    "degree": asking.Exact("Degree of W(x).  [raised until it works]", whole=True, least=0, most=8),
    "variables": asking.Names("States that W depends on, e.g. x1,x3.  [chosen]", "NAMES"),
    "condition_number": asking.Exact("Not to be exceeded on the safe set."),
    "coordinates": asking.Choice(
        "In which the condition number counts; auto: half-widths of the safe set.  [auto]",
        words=("auto", "identity"),
    ),
    "route": asking.Choice("How metrics are found.  [auto]", words=("auto", "sos", "cegis")),
    "solver": asking.Text(
        "Which solver proposes; NAME: one that cvxpy knows.  [clarabel]", "<clarabel|scs|cvxpy:NAME>"
    ),
    "table": asking.Flag("Compare metrics over a range of rates."),
    "rho_a": asking.Exact("Overrides tube.rho_a.", sets="tube.rho_a"),
    "epsilon": asking.Exact("Overrides tube.epsilon.", sets="tube.epsilon"),
    "budget": BUDGET,
    "deadline": DEADLINE,
})  # fmt: skip
def synth(
    spec: Specifiable,
    *,
    rate: Number | None = None,
    objective: str | None = None,
    degree: int | None = None,
    variables: str | Sequence[str] | None = None,
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
    from tubecert import pipeline
    from tubecert.kinds import ALONE, DISTANCE

    system, given = spec_of(spec, reads="plant"), asking.asker().given
    require_once(settings_in(system))
    # metrics are compared end to end by what the specification decides, else by the distance form
    decides = system.decides or DISTANCE.option
    options = pipeline.Options(rho_a=asking.exact(rho_a), epsilon=asking.exact(epsilon), conditions=decides)
    said: Any = {name: given[name] for name in _OF_SECTION if given.get(name) is not None}
    found = pipeline.synthesise(
        system,
        wanted_of(system, **said),
        options if budget is None else replace(options, budget=budget),
        pipeline.Listeners(
            progress=timed(progress),
            told=asking.hears(progress, "judged"),
            kept=asking.hears(progress, "kept"),
            deadline=pipeline.Deadline.after(deadline),
        ),
        table=table,
        # a tube that needs no adaptation is enough where neither an objective nor another certificate is asked for
        enough=objective is None and system.decides in (None, ALONE.option),
    )
    if found.cut == "interrupted" and found.file is None and not asking.asker().options:
        raise KeyboardInterrupt
    return metric_of(found, system)


def metric_of(found: Synthesised, system: Spec) -> SynthesisedMetric:
    """What a synthesis came to, as a value."""
    return SynthesisedMetric(found=found, name=system.name, states=system.states)


def wanted_of(
    system: Spec,
    *,
    rate: Fraction | None = None,
    objective: str | None = None,
    solver: str | None = None,
    variables: Sequence[str] | None = None,
    **said: Any,
) -> Synthesis:
    """What is asked for: the specification's section, changed by what is `said` of it.

    Without a section the rate is that of the specification's own metric. Raises `SpecError` if they do not go together.
    """
    own = system.synthesis
    if own is None:
        held = None if system.metric is None else system.metric.rate
        own = Synthesis(rate=held, objective="adaptation" if held is None else "condition")
    wanted, best = rate or own.rate, objective or own.objective
    if best == "rate" or (best in ("adaptation", "tube") and rate is None and own.objective != best):
        wanted = None  # searched for
    elif rate is not None and objective is None and own.rate is None:
        best = "condition"
    if best == "rate" and rate is not None:
        text = f"the objective rate searches for the rate; {asking.named('rate')} cannot be given"
        asking.refuse(asking.named("objective"), "rate", text)
    if best in ("condition", "margin") and wanted is None:
        text = f"the objective {best} needs {asking.named('rate')}, in 1/s"
        asking.refuse(asking.named("objective"), best, text)
    if solver is not None:
        known = "the solvers are clarabel, scs, and cvxpy:NAME for those that cvxpy knows"
        said["solver"] = solver_name(solver) or asking.refuse(asking.named("solver"), solver, known)
    if variables is not None:
        said["variables"] = variables
        if strange := [name for name in variables if name not in system.states]:
            known = f"{strange[0]} is no state; the states are {', '.join(system.states)}"
            asking.refuse(asking.named("variables"), ",".join(variables), known)
    return replace(own, **said, rate=wanted, objective=best, outputs=own.outputs if best == "tube" else ())
