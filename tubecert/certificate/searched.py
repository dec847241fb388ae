"""How a metric was searched for, as a certificate tells it: nothing rests on it but that it is what was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from tubecert.certificate.effective import Asked
from tubecert.claims.family import Reason
from tubecert.claims.outcomes import Outcome
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptData:
    """One proposal of a synthesis and what became of it."""

    rate: float
    degree: int
    floor: Literal["identity", "input"]
    route: str
    outcome: Outcome
    condition_number: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricRow:
    """One metric of a comparison; `input_gain` is beta/sqrt(a), `adaptation_rate` the least of the distance form."""

    rate: Fraction
    floor: Literal["identity", "input"]
    degree: int
    condition_number: float
    verdict: Verdict | None = None
    input_gain: float | None = None
    rho: float | None = None
    ultimate_radius: float | None = None
    adaptation_rate: float | None = None
    bandwidth: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RateLimit:
    """What is against another rate; there `factor` times the gains would be needed."""

    rate: Fraction
    cause: Literal["distance", "overshoot", "gains", "no_metric", "idle", "input_gain", "tube"]
    factor: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RateLimits:
    """What is against slower and against faster rates than the one that was chosen."""

    slower: RateLimit | None = None
    faster: RateLimit | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverData:
    """How a metric was found."""

    route: str
    degree: int
    variables: tuple[str, ...]
    digits: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchData:
    """What was tried by a synthesis, and why there is no metric where there is none."""

    objective: str
    verdict: Verdict
    attempts: tuple[AttemptData, ...]
    rate: Fraction | None = None
    table: tuple[MetricRow, ...] = ()
    limits: RateLimits | None = None
    cut: Literal["deadline", "interrupted", "no_adaptation", "plan"] | None = None
    solver: SolverData | None = None
    reason: Reason | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisData:
    """What was asked of a synthesis, and how it went."""

    asked: Asked
    search: SearchData | None = None
