"""What a certification found, in short; and its comparison with the `expect:` block of a specification."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite

from tubecert.certificate.result import Result
from tubecert.claims.advice import advice
from tubecert.claims.conditions import SECTIONS
from tubecert.claims.family import Reason
from tubecert.claims.statements import METRIC_CLAIMS, MetricFound, input_title
from tubecert.digits import near
from tubecert.enclosure.constant import Constant
from tubecert.expression import number_text
from tubecert.findings import Finding, Location
from tubecert.pipeline.verification import Verified
from tubecert.spec import Spec
from tubecert.spec.tube import METRICS, WIDTHS
from tubecert.verdict import Verdict

VERDICT_MISMATCH = "TC502"
RANGE_MISMATCH = "TC503"
REFUTED = "TC504"
UNDECIDED = "TC505"

_LARGEST_RATE = "largest_rate"


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A claim of a certification with its verdict; `message` says what binds or fails."""

    name: str
    verdict: Verdict
    message: str = ""
    relax: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A certification in short: verdict, that on the metric if it was reached, numbers that can be expected, claims."""

    verdict: Verdict
    metric: Verdict | None
    numbers: tuple[tuple[str, float], ...]
    claims: tuple[Claim, ...]

    def __post_init__(self) -> None:
        if not all(isfinite(value) for _, value in self.numbers):
            raise ValueError("a number of a certification is finite")


def outcome(result: Result) -> Outcome:
    """What a `result` comes down to."""
    return Outcome(
        verdict=result.verdict,
        metric=None if result.metric is None else result.metric.verdict,
        numbers=tuple(_numbers(result)),
        claims=tuple(_claims(result)),
    )


def _numbers(result: Result) -> Iterator[tuple[str, float]]:
    """rho, the least clearance, the largest share of limits, the gains of the first certificate that decides."""
    if result.metric is not None and result.metric.largest_rate is not None:
        yield from _largest_rate(result.metric.largest_rate)
    if result.tube is not None:
        yield "rho", float(result.tube.rho)
        yield from ((f"{WIDTHS}.{name}", width) for name, width in (result.tube.half_widths or {}).items())
    if result.clearance:
        yield "clearance", min(each.clearance.below for each in result.clearance)
    uses = [each.use(result.decided_by) for each in result.inputs]
    if uses and None not in uses:
        yield "inputs", max(use for use in uses if use is not None)
    pair = next(iter(result.deciding().values()), None)
    if pair is not None:
        if pair.bandwidth is not None:
            yield "bandwidth", float(pair.bandwidth)
        if pair.adaptation_rate is not None:
            yield "adaptation_rate", float(pair.adaptation_rate)


def _largest_rate(enclosed: Constant) -> Iterator[tuple[str, float]]:
    """What is proven that the metric supports, if there is a bound."""
    if isfinite(enclosed.below):
        yield _LARGEST_RATE, enclosed.below


def outcome_of_metric(found: Verified) -> Outcome:
    """What the verification of a metric comes down to."""
    numbers = () if found.largest_rate is None else tuple(_largest_rate(found.largest_rate))
    claim = Claim(name="metric", verdict=found.verdict) if found.reason is None else _claim(found.reason)
    return Outcome(verdict=found.verdict, metric=found.verdict, numbers=numbers, claims=(claim,))


def _claim(reason: Reason, h: Sequence[str] = ()) -> Claim:
    return Claim(
        name=reason.claim.title,
        verdict=reason.verdict,
        message=reason.message,
        relax=advice(reason.relax, h),
    )


def _claims(result: Result) -> Iterator[Claim]:
    """A claim per reason, and one per certificate that has no reason among them."""
    named = {getattr(reason.claim, "section", None) for reason in result.reasons}
    for reason in result.reasons:
        yield _claim(reason, result.spec.effective.uncertainty.h)
    of_metric = any(isinstance(reason.claim, (*METRIC_CLAIMS, MetricFound)) for reason in result.reasons)
    if result.metric is not None and not of_metric:
        yield Claim(name="metric", verdict=result.metric.verdict)
    for number, each in enumerate(result.clearance, start=1):
        if each.decides and each.verdict is Verdict.CERTIFIED:
            yield Claim(name=f"clearance from obstacle {number}", verdict=each.verdict)
    for own in result.inputs:
        if own.verdict is Verdict.CERTIFIED:
            yield Claim(name=input_title(own.input), verdict=own.verdict)
    for section in result.decided_by:
        if section in result.sections and section not in named:
            yield Claim(name=SECTIONS[section], verdict=result.sections[section].verdict)


def compared(spec: Spec, found: Outcome) -> list[Finding]:
    """What is not as expected; without an expectation, a verdict that is not `certified`."""
    if spec.lacks:
        return metric_compared(spec, found)
    expect = spec.expect
    if expect is None:
        return list(_not_certified(spec, found))
    told = [] if expect.metric is None else list(_metric(spec, expect.metric, found))
    if expect.verdict is None:
        told += _not_certified(spec, found)
    elif expect.verdict != found.verdict:
        message = f"the verdict is {found.verdict}, expected: {expect.verdict}"
        told.append(_mismatch(spec, "expect.verdict", message, found))
    return [*told, *_ranges(spec, expect.ranges, found)]


def metric_compared(spec: Spec, found: Outcome) -> list[Finding]:
    """The same of a metric alone: what a file expects beside it is not looked at."""
    expect = spec.expect
    locked = None if expect is None else expect.metric
    told = _not_certified(spec, found) if locked is None else _metric(spec, locked, found)
    ranges = () if expect is None else [each for each in expect.ranges if each[0] == _LARGEST_RATE]
    return [*told, *_ranges(spec, ranges, found)]


def _metric(spec: Spec, expected: str, found: Outcome) -> Iterator[Finding]:
    told = "not decided" if found.metric is None else METRICS[found.metric]
    if told != expected:
        message = f"metric: {told}, expected: {expected}"
        yield _mismatch(spec, "expect.metric", message, found)


def _mismatch(spec: Spec, where: str, message: str, found: Outcome) -> Finding:
    why = "; ".join(claim.message for claim in found.claims if claim.verdict == found.verdict)
    return Finding(code=VERDICT_MISMATCH, message=message, location=spec.location(where), help=why[:400])


def _not_certified(spec: Spec, found: Outcome) -> Iterator[Finding]:
    if found.verdict is Verdict.CERTIFIED:
        return
    top = spec.location("name") or Location(file=spec.path, line=1, column=1)
    for claim in found.claims:
        if claim.verdict == found.verdict:
            yield Finding(
                code=REFUTED if found.verdict is Verdict.REFUTED else UNDECIDED,
                message=f"{found.verdict}: {claim.name}: {claim.message}",
                location=top,
                help=claim.relax,
            )


def _ranges(
    spec: Spec, ranges: Iterable[tuple[str, tuple[Fraction, Fraction]]], found: Outcome
) -> Iterator[Finding]:
    numbers = dict(found.numbers)
    for name, (least, most) in ranges:
        value = numbers.get(name)
        if value is not None and least <= Fraction(str(value)) <= most:
            continue
        shown = "is not in the certificate" if value is None else f"is {near(value)}"
        yield Finding(
            code=RANGE_MISMATCH,
            message=f"{name} {shown}, expected: [{number_text(least)}, {number_text(most)}]",
            location=spec.location(f"expect.{name}"),
            help="find out what has changed; if it is meant, change the range",
        )
