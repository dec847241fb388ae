"""Claims about the inputs and the metric: rank of B, C1 to C3, declared bounds."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.claims.failures import Failure
from tubecert.claims.family import Claim, Side
from tubecert.enclosure.constant import Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class RankOfB(Claim):
    """B(x) has full rank on the safe set."""

    tag: ClassVar[str] = "rank_of_B"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricFound(Claim):
    """A metric was found; `failure` says why not."""

    tag: ClassVar[str] = "metric_found"
    failure: Failure


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricDefinite(Claim):
    """C1: W(x) is positive definite on the safe set."""

    tag: ClassVar[str] = "metric_definite"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricKilling(Claim):
    """C3: the Lie derivative of W along the column of `input` vanishes; `residual` is an entry of it at the witness."""

    tag: ClassVar[str] = "metric_killing"
    input: str
    residual: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricContraction(Claim):
    """C2 at `rate`, in 1/s; `largest_rate` encloses the supremum of the rates that the metric supports."""

    tag: ClassVar[str] = "metric_contraction"
    rate: Fraction
    largest_rate: Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricBound(Claim):
    """The bound of M on the safe set that is `declared`; the eigenvalue is proven to reach `reaches`."""

    tag: ClassVar[str] = "metric_bound"
    side: Side
    declared: Fraction
    reaches: float | None


METRIC_CLAIMS = (MetricDefinite, MetricContraction, MetricKilling)
