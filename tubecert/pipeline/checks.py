"""What makes a question meaningless, as located findings: missing parts, undefined expressions, rank, time."""

from __future__ import annotations

from fractions import Fraction

from tubecert.bounds.compute import time_range
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.domain import Range
from tubecert.expression import Expression
from tubecert.findings import Finding, Location
from tubecert.lint import lint, name_findings
from tubecert.model import build, domain_findings, frequencies, place, rank_decision, time_period
from tubecert.spec import Spec


def inspect(spec: Spec, budget: int = 200_000) -> list[Finding]:
    """What is wrong with, or odd about, the mathematics of a specification, without certifying it."""
    findings, time = time_of(spec)
    effort = Effort(budget=budget)
    if not findings:
        findings = domain_findings(spec, time, effort)
    if findings:
        return [*findings, *name_findings(spec)]
    decision = rank_decision(build(spec), spec.safe_set, effort)
    if decision.verdict == "refuted":
        findings.append(
            Finding(
                code="TC203",
                message=f"B loses rank in the safe set, at {place(decision.at)}",
                location=spec.location("system.B"),
                help="shrink the safe set, or remove an input that does nothing there",
            )
        )
    return findings + lint(spec, time, effort)


def missing_parts(spec: Spec) -> list[Finding]:
    """What a certification needs and a specification may lack."""
    remedy = "give metric.dual_metric and metric.rate, or metric.synthesise, or certify with --metric FILE"
    has_none = spec.metric is None and spec.synthesis is None
    return [*([_missing(spec, "metric", remedy)] if has_none else []), *missing_radii(spec)]


def missing_radii(spec: Spec) -> list[Finding]:
    """The radii of the tube, if they are not given."""
    found = []
    if spec.tube.epsilon is None:
        found.append(_missing(spec, "tube.epsilon", "give tube.epsilon, or --epsilon E"))
    if spec.tube.rho_a is None:
        found.append(_missing(spec, "tube.rho_a", "give tube.rho_a, or --rho-a R"))
    return found


def _missing(spec: Spec, key: str, remedy: str) -> Finding:
    return Finding(
        code="TC105",
        message=f"{key} is needed to certify",
        location=spec.location(key) or Location(file=spec.path, line=1, column=1),
        help=remedy,
    )


def time_of(spec: Spec) -> tuple[list[Finding], Range | None]:
    """The range of time that matters for h, or why there is none.

    What must hold for h to be defined may depend on t where h does not, as in 0*(1/(t + 1)).
    """
    try:
        return [], time_range(spec.trajectory.horizon, time_period(_of_uncertainty(spec)))
    except ValueError as error:
        finding = Finding(
            code="TC204",
            message=str(error),
            location=spec.location("uncertainty.h"),
            help="add trajectory.horizon, in seconds",
        )
        return [finding], None


def period_of(spec: Spec) -> tuple[Fraction, bool] | None:
    """The period of h as (q, whether times pi), in s; None if it is free of t, or has none to be seen."""
    found = frequencies(_of_uncertainty(spec))
    return None if found is None else found.period


def _of_uncertainty(spec: Spec) -> list[Expression]:
    """h, and what must hold for it to be defined."""
    terms = spec.uncertainty.h or ()
    owed = (duty.argument for term in terms for duty, _ in term.owed())
    return [*(term.expression for term in terms), *owed]
