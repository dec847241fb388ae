"""What became of an attempt to find a metric."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tubecert.claims.family import Claim
from tubecert.records import Tagged
from tubecert.verdict import Verdict


class Outcome(Tagged):
    """What a route came to; all but `Proven` are why there is no metric by it."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Proven(Outcome):
    """A metric, proven."""

    tag: ClassVar[str] = "proven"


@dataclass(frozen=True, slots=True, kw_only=True)
class NoProposal(Outcome):
    """The route proposed nothing; `status` is what its solver said."""

    tag: ClassVar[str] = "no_proposal"
    route: str
    status: str


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongShape(Outcome):
    """The route proposed coefficients of a wrong shape."""

    tag: ClassVar[str] = "wrong_shape"
    route: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NotProven(Outcome):
    """The proposal, rounded, could not be proven, or is refuted: `condition` failed."""

    tag: ClassVar[str] = "not_proven"
    route: str
    condition: Claim
    verdict: Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionUnbounded(Outcome):
    """The condition number of what was proposed could not be bounded."""

    tag: ClassVar[str] = "condition_unbounded"
    route: str
