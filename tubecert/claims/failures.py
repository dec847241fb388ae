"""Why no metric was found."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.claims.family import Claim
from tubecert.claims.outcomes import Outcome
from tubecert.records import Tagged
from tubecert.verdict import Verdict


class Failure(Tagged):
    """Why a synthesis came to nothing."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RankUnproven(Failure):
    """B could not be proven of full rank, or is proven to lose it at the witness."""

    tag: ClassVar[str] = "rank_of_B"


@dataclass(frozen=True, slots=True, kw_only=True)
class UncontrollableMode(Failure):
    """A mode of the linearisation at the witness that no input reaches: no metric has a rate above `limit`, in 1/s."""

    tag: ClassVar[str] = "uncontrollable_mode"
    mode: tuple[float, float]
    limit: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableForbidden(Failure):
    """C3 forbids that W depends on `variable`; it may depend on those `permitted`."""

    tag: ClassVar[str] = "variable_forbidden"
    variable: str
    permitted: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoFrame(Failure):
    """No frame of vector fields that commute with the columns of B was found."""

    tag: ClassVar[str] = "no_frame"


@dataclass(frozen=True, slots=True, kw_only=True)
class NotWritable(Failure):
    """The metric is beyond what a specification can hold; `code` is that of the finding."""

    tag: ClassVar[str] = "not_writable"
    code: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NotProvenAsWritten(Failure):
    """The metric, read back as written, could not be proven; `condition` is the claim that failed."""

    tag: ClassVar[str] = "not_proven_as_written"
    condition: Claim


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionNumber(Failure):
    """The least condition number found at `rate` is above the limit that was given."""

    tag: ClassVar[str] = "condition_number"
    rate: Fraction
    condition_number: float


@dataclass(frozen=True, slots=True, kw_only=True)
class NothingFound(Failure):
    """No attempt led to a metric; the attempts stand in `result.synthesis`."""

    tag: ClassVar[str] = "nothing_found"
    attempts: int
    routes: tuple[str, ...]
    degrees: tuple[int, ...]
    last: Outcome | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoneCertified(Failure):
    """Metrics were found at `compared` rates from `slowest` to `fastest`, and none certifies.

    `slow` and `fast` are the claims that ended the certifications with the slowest and the fastest.
    """

    tag: ClassVar[str] = "none_certified"
    compared: int
    slowest: Fraction
    fastest: Fraction
    slow: Claim
    slow_verdict: Verdict
    fast: Claim
    fast_verdict: Verdict
