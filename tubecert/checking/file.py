"""Checking one file: what `check` says about it, with or without a certification."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from tubecert.checking import cache
from tubecert.checking.expectations import UNDECIDED, Claim, Outcome, compared, outcome, outcome_of_metric
from tubecert.errors import ExitCode, TubecertError
from tubecert.findings import Finding, Severity
from tubecert.kept import nothing_kept
from tubecert.spec import Setting, Spec, load

if TYPE_CHECKING:
    from tubecert.progress import Progress

_GAP_OF_RATES = Fraction(1, 1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """How to check: with a certification, warnings as errors, and whether to remember (plans as well).

    `settings` stand in every file in place of its own keys; what is found then is about no file, and not remembered.
    """

    certify: bool = False
    strict: bool = False
    cached: bool = True
    settings: tuple[Setting, ...] = ()
    gap: Fraction = Fraction(1, 100)
    budget: int = 2_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What was found in one file; `claims` are those of its certification, `seconds` what the check took."""

    path: str
    findings: tuple[Finding, ...]
    code: ExitCode
    claims: tuple[Claim, ...] = ()
    seconds: float = 0.0


def check(path: str, options: CheckOptions, progress: Progress | None = None) -> Checked:
    """The findings of a file, and the exit code that they deserve."""
    with nothing_kept(not options.cached or bool(options.settings)):
        return _checked(path, options, progress)


def _checked(path: str, options: CheckOptions, progress: Progress | None) -> Checked:
    started = time.perf_counter()
    claims: tuple[Claim, ...] = ()
    try:
        spec = load(path, options.settings, "question")
        findings = _remembered("lint", spec, lambda: _inspected(spec))
        if options.certify and not _errors(findings):
            found = _outcome(spec, options, progress)
            findings = [*findings, *compared(spec, found)]
            claims = found.claims
    except TubecertError as error:
        findings = list(error.findings)
        return Checked(
            path=path, findings=tuple(findings), code=error.exit_code, seconds=time.perf_counter() - started
        )
    findings = [_promoted(item) for item in findings] if options.strict else findings
    return Checked(
        path=path,
        findings=tuple(findings),
        code=_code(findings),
        claims=claims,
        seconds=time.perf_counter() - started,
    )


def _inspected(spec: Spec) -> list[Finding]:
    from tubecert import pipeline  # numerics, only where they are needed

    return pipeline.inspect(spec)


def _errors(findings: list[Finding]) -> list[Finding]:
    return [item for item in findings if item.severity is Severity.ERROR]


def _promoted(finding: Finding) -> Finding:
    return replace(finding, severity=Severity.ERROR) if finding.severity is Severity.WARNING else finding


def _code(findings: list[Finding]) -> ExitCode:
    """Undecided only if nothing worse is the matter."""
    errors = _errors(findings)
    if not errors:
        return ExitCode.CERTIFIED
    if all(item.code == UNDECIDED for item in errors):
        return ExitCode.UNDECIDED
    return ExitCode.NOT_CERTIFIED


def _remembered(what: str, spec: Spec, work: Callable[[], list[Finding]]) -> list[Finding]:
    """Findings of a text that has not changed, or those that `work` finds."""
    name = cache.key_of_text(what, spec)
    kept = cache.read_findings(name, spec)
    if kept is None:
        kept = work()
        cache.write_findings(name, kept)
    return kept


def _outcome(spec: Spec, options: CheckOptions, progress: Progress | None) -> Outcome:
    """The outcome of a system that has not changed, or a new one; raises `TubecertError`."""
    name = cache.key_of_system(spec, options.gap, options.budget)
    kept = cache.read_outcome(name)
    if kept is None:
        work = _verified if spec.lacks else _certified if spec.hardware is None else _sampled
        kept = work(spec, options, progress)
        cache.write_outcome(name, kept)
    return kept


def _certified(spec: Spec, options: CheckOptions, progress: Progress | None) -> Outcome:
    from tubecert import pipeline

    effort = pipeline.Options(gap=options.gap, budget=options.budget)
    return outcome(pipeline.certify(spec, effort, progress))


def _sampled(spec: Spec, options: CheckOptions, progress: Progress | None) -> Outcome:
    """The same of a sampled loop, which counts no boxes."""
    from tubecert.checking.sampled import outcome as outcome_of
    from tubecert.loop_design.certification import certify

    return outcome_of(certify(spec, progress))


def _verified(spec: Spec, options: CheckOptions, progress: Progress | None) -> Outcome:
    """The same of a metric alone, at least as closely as `verify` encloses its largest rate."""
    from tubecert.enclosure.branch_and_bound import Effort
    from tubecert.pipeline.verification import verify

    effort = Effort(gap=float(min(options.gap, _GAP_OF_RATES)), budget=options.budget)
    return outcome_of_metric(verify(spec, effort, progress))
