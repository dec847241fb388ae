"""Claims about the inputs and the metric: rank of B, C1 to C3, declared bounds."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.claims.bounds import reached
from tubecert.claims.failures import Failure, rank
from tubecert.claims.family import Claim, Reason, Side
from tubecert.digits import down, near
from tubecert.enclosure.constant import Constant
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class RankOfB(Claim):
    """B(x) has full rank on the safe set."""

    tag: ClassVar[str] = "rank_of_B"
    name: ClassVar[str] = "rank of B"

    def _why(self, reason: Reason) -> str:
        return rank(reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricFound(Claim):
    """A metric was found; `failure` says why not."""

    name: ClassVar[str] = "metric synthesis"
    failure: Failure

    def _why(self, reason: Reason) -> str:
        return self.failure.told(reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricDefinite(Claim):
    """C1: W(x) is positive definite on the safe set."""

    name: ClassVar[str] = "metric, definiteness"

    def _why(self, reason: Reason) -> str:
        refuted = reason.verdict is Verdict.REFUTED
        return "W is not positive definite (C1)" if refuted else "W could not be proven positive (C1)"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricKilling(Claim):
    """C3: the Lie derivative of W along the column of `input` vanishes; `residual` is an entry of it at the witness."""

    name: ClassVar[str] = "metric, inputs"
    input: str
    residual: float | None = None

    def _why(self, reason: Reason) -> str:
        condition = "C3 (the Killing condition)"
        if self.residual is None:
            return f"{condition} could not be proven exactly for input {self.input}"
        return f"{condition} fails for input {self.input}: its residual is {near(self.residual, 3)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricContraction(Claim):
    """C2 at `rate`, in 1/s; `largest_rate` encloses the supremum of the rates that the metric supports."""

    name: ClassVar[str] = "metric, contraction"
    rate: Fraction
    largest_rate: Constant

    def _why(self, reason: Reason) -> str:
        below, above = self.largest_rate.below, self.largest_rate.above
        if reason.verdict is not Verdict.REFUTED:
            lies = f"the largest rate lies in [{near(below, 10)}, {near(above, 10)}]"
            return f"{lies}, too close to the rate {near(self.rate)} to tell"
        supported = "no rate could be proven"
        if above <= 0:
            supported = "this metric supports no positive rate"
        elif below > 0:
            supported = f"the largest rate that this metric supports is {down(below, 6)}"
        return f"C2 fails at rate {near(self.rate)}: {supported}"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricBound(Claim):
    """The bound of M on the safe set that is `declared`; the eigenvalue is proven to reach `reaches`."""

    name: ClassVar[str] = "declared bounds of the metric"
    side: Side
    declared: Fraction
    reaches: float | None

    def _why(self, reason: Reason) -> str:
        eigenvalue = "lmin(M)" if self.side == "lower" else "lmax(M)"
        declared = f"metric.bounds.{self.side} is {near(self.declared)}"
        return f"{declared}, but {eigenvalue} reaches {reached(self.reaches)}"


METRIC_CLAIMS = (MetricDefinite, MetricContraction, MetricKilling)
