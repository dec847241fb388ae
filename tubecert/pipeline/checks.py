"""What makes a question meaningless, as located findings: missing parts, undefined expressions, rank, time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.domain import Range
from tubecert.errors import SpecError
from tubecert.findings import Finding, Location, Severity
from tubecert.lint import lint, name_findings
from tubecert.model import build, domain_findings, place, rank_decision
from tubecert.spec import Spec, Synthesis
from tubecert.spec.load import NO_SEARCH
from tubecert.spec.metric_file import of_no_metric
from tubecert.stages.question import Options, time_of
from tubecert.trajectory.make import unending
from tubecert.verdict import Verdict


def inspect(spec: Spec, budget: int = 200_000) -> list[Finding]:
    """What is wrong with, or odd about, the mathematics of a specification, without certifying it."""
    findings, time = time_of(spec)
    effort = Effort(budget=budget)
    if spec.hardware is not None and spec.trajectory.task is None:  # whose knots are still to be found
        table = spec.trajectory.table
        findings = findings or unending(spec, None if table is None else table.knots)
    if not findings:
        findings = domain_findings(spec, time, effort)
    if findings:
        return [*findings, *name_findings(spec)]
    return [*_rank_findings(spec, effort), *lint(spec, time, effort)]


def _rank_findings(spec: Spec, effort: Effort) -> list[Finding]:
    """An error where B loses rank, a warning where that is not known."""
    if spec.hardware is not None:  # the sampled loop is proven whatever the rank
        return []
    decision = rank_decision(build(spec), spec.safe_set, effort)
    if decision.verdict is Verdict.CERTIFIED:
        return []
    refuted = decision.verdict is Verdict.REFUTED
    place_of = f"B loses rank in the safe set, at {place(decision.at)}"
    return [
        Finding(
            code="TC203" if refuted else "TC209",
            severity=Severity.ERROR if refuted else Severity.WARNING,
            message=place_of if refuted else "B could not be proven to have full rank on the safe set",
            location=spec.location("system.B"),
            help="shrink the safe set, or remove an input that does nothing there",
        )
    ]


def sound_time(spec: Spec, options: Options, lacking: Callable[[Spec], Iterable[Finding]]) -> Range | None:
    """The range of time that matters; raises `SpecError` for what makes the question meaningless, or is lacking."""
    findings, time = time_of(spec)
    findings += lacking(spec)
    findings = findings or domain_findings(spec, time, Effort(budget=options.budget))
    if any(item.severity is Severity.ERROR for item in findings):
        raise SpecError(findings)
    return time


def missing_parts(spec: Spec) -> list[Finding]:
    """What a certification in continuous time needs and a specification may lack, or has and may not have."""
    if refused := of_no_metric(spec):
        return refused
    file = Path(spec.path)
    found = f"{file.stem}.metric.json"
    remedy = "give metric.dual_metric and metric.rate, or have one found: metric: {synthesise: {}}"
    if file.suffix in (".yaml", ".yml"):
        synth, certify = f"tubecert synth {spec.path}", f"tubecert certify {spec.path} --metric {found}"
        remedy = f"`{synth}` finds one; then `{certify}`. Or {remedy}"
    has_none = spec.metric is None and spec.synthesis is None
    remedy += ". Beside hardware: {rate: 500}, the computer of the loop, no metric is needed, and no radius"
    return [*([_missing(spec, "metric", remedy)] if has_none else []), *missing_radii(spec)]


def unsearchable(spec: Spec) -> list[Finding]:
    """What no metric is found for: an f that depends on t, or a sampled loop, which has none."""
    if build(spec).time is None:
        return of_no_metric(spec)
    message = "f depends on t, and metrics are not found for that"
    return [Finding(code="TC112", message=message, location=spec.location("system.f"), help=NO_SEARCH)]


def missing_sections(spec: Spec, wanted: Synthesis) -> list[Finding]:
    """What metrics are compared by and the specification lacks, where they are compared by what they certify."""
    if not spec.lacks or wanted.objective not in ("adaptation", "tube"):
        return []
    lacking = " and ".join(spec.lacks)
    message = f"the specification lacks {lacking}, and metrics are compared by what they certify"
    help = f"add {lacking}; or ask for the best metric at a rate, which needs neither: --rate 1 (in 1/s)"
    return [Finding(code="TC105", message=message, location=spec.location("tubecert"), help=help)]


def missing_radii(spec: Spec) -> list[Finding]:
    """The radii of the tube, if neither they nor half-widths are given."""
    found = []
    if spec.tube.half_widths:
        return [_beside_half_widths(spec)] if spec.tube.epsilon is not None else []
    if spec.tube.epsilon is None:
        whole = "" if spec.tube.rho_a is not None else f"; or {_half_widths(spec)}"
        found.append(_missing(spec, "tube.epsilon", f"give tube.epsilon, or --epsilon E{whole}"))
    if spec.tube.rho_a is None:
        found.append(_missing(spec, "tube.rho_a", "give tube.rho_a, or --rho-a R"))
    return found


def _half_widths(spec: Spec) -> str:
    """A tube that is asked for in the units of its states."""
    shown = ", ".join(f"{name}: ..." for name in spec.states[:3])
    return f"how far states may be off, in their units: tube: {{half_widths: {{{shown}}}}}"


def _beside_half_widths(spec: Spec) -> Finding:
    return Finding(
        code="TC112",
        message="--epsilon beside tube.half_widths, which fix the whole tube",
        location=spec.location("tube.half_widths"),
        help="leave out --epsilon, or give tube.epsilon instead of half_widths",
    )


def _missing(spec: Spec, key: str, remedy: str) -> Finding:
    return Finding(
        code="TC105",
        message=f"{key} is needed to certify",
        location=spec.location(key) or Location(file=spec.path, line=1, column=1),
        help=remedy,
    )
