"""What became of an attempt to find a metric."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.claims.family import Claim, Reason, Said, plain
from tubecert.records import Tagged
from tubecert.verdict import Verdict


class Outcome(Said, Tagged):
    """What a route came to; all but `Proven` are why there is no metric by it."""

    __slots__ = ()


Proven = plain(__name__, Outcome, "Proven", "proven")


@dataclass(frozen=True, slots=True, kw_only=True)
class NoProposal(Outcome):
    """The route proposed nothing; `status` is what its solver said."""

    route: str
    status: str

    def _told(self) -> str:
        return f"{self.route}: {self.status}"


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongShape(Outcome):
    """The route proposed coefficients of a wrong shape."""

    route: str

    def _told(self) -> str:
        return f"{self.route} gave coefficients of a wrong shape"


@dataclass(frozen=True, slots=True, kw_only=True)
class NotProven(Outcome):
    """The proposal, rounded, could not be proven, or is refuted: `condition` failed."""

    route: str
    condition: Claim
    verdict: Verdict

    def _told(self) -> str:
        return f"{self.route}: {Reason(claim=self.condition, verdict=self.verdict).message}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionUnbounded(Outcome):
    """The condition number of what was proposed could not be bounded."""

    route: str

    def _told(self) -> str:
        return f"{self.route}: the condition number could not be bounded"
