"""Why no metric was found, and what became of each attempt to find one."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from tubecert.claims.family import Claim, Member, Reason, plain
from tubecert.digits import near
from tubecert.records import Tagged
from tubecert.verdict import Verdict


class Outcome(Member, Tagged):
    """What a route came to; all but `Proven` are why there is no metric by it."""

    __slots__ = ()


Proven = plain(__name__, Outcome, "Proven", "proven")


class NoProposal(Outcome):
    """The route proposed nothing; `status` is what its solver said."""

    says = "{route}: {status}"
    route: str
    status: str


class WrongShape(Outcome):
    """The route proposed coefficients of a wrong shape."""

    says = "{route} gave coefficients of a wrong shape"
    route: str


class NotProven(Outcome):
    """The proposal, rounded, could not be proven, or is refuted: `condition` failed."""

    route: str
    condition: Claim
    verdict: Verdict

    def _told(self) -> str:
        return f"{self.route}: {Reason(claim=self.condition, verdict=self.verdict).message}"


class ConditionUnbounded(Outcome):
    """The condition number of what was proposed could not be bounded."""

    says = "{route}: the condition number could not be bounded"
    route: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """One proposal of a synthesis and what became of it; `condition_number` is proven, None if nothing was."""

    rate: float
    degree: int
    floor: Literal["identity", "input"]
    route: str
    outcome: Outcome
    condition_number: float | None = None

    @property
    def undecided(self) -> bool:
        """Whether it may be a metric, but its proof ran out of boxes."""
        return isinstance(self.outcome, NotProven) and self.outcome.verdict is Verdict.UNDECIDED


class Failure(Member, Tagged):
    """Why a synthesis came to nothing."""

    __slots__ = ()

    def why(self, reason: Reason) -> str:
        """Why, in one sentence; `reason` is that of the claim that there is a metric."""
        return self._why(reason)

    def _why(self, reason: Reason) -> str:
        return self.told()


def rank(reason: Reason) -> str:
    """What is known of the rank of B."""
    refuted = reason.verdict is Verdict.REFUTED
    return "B loses rank in the safe set" if refuted else "B could not be proven of full rank"


class RankUnproven(Failure):
    """B could not be proven of full rank, or is proven to lose it at the witness."""

    tag = "rank_of_B"

    def _why(self, reason: Reason) -> str:
        return rank(reason)


class UncontrollableMode(Failure):
    """A mode of the linearisation at the witness that no input reaches: no metric has a rate above `limit`, in 1/s."""

    mode: tuple[float, float]
    limit: Fraction

    def _why(self, reason: Reason) -> str:
        real, imaginary = self.mode
        pair = f" +- {near(abs(imaginary))}i" if abs(imaginary) > 1e-9 else ""
        mode = f"the linearisation at an equilibrium has the uncontrollable mode {near(real)}{pair}"
        return f"{mode}: no metric has a rate above {near(self.limit, 12)}"


class VariableForbidden(Failure):
    """C3 forbids that W depends on `variable`; it may depend on those `permitted`."""

    variable: str
    permitted: tuple[str, ...]

    def _why(self, reason: Reason) -> str:
        permitted = ", ".join(self.permitted) or "nothing"
        return f"W cannot depend on {self.variable}: C3 (the Killing condition) permits {permitted}"


class NoFrame(Failure):
    """No frame of vector fields that commute with the columns of B was found."""

    says = "no frame of vector fields that commute with the columns of B was found"


class NotWritable(Failure):
    """The metric is beyond what a specification can hold; `code` is that of the finding."""

    code: str

    def _why(self, reason: Reason) -> str:
        from tubecert.spec.codes import title  # with YAML, which a page of words does without

        return f"the metric cannot be written: {title(self.code)}"


class NotProvenAsWritten(Failure):
    """The metric, read back as written, could not be proven; `condition` is the claim that failed."""

    condition: Claim

    def _why(self, reason: Reason) -> str:
        return f"the metric as written could not be proven: {self.condition.why(reason)}"


class ConditionNumber(Failure):
    """The least condition number found at `rate` is above the limit that was given."""

    says = "the least condition number found at rate {rate} is {condition_number:5}, above the limit"
    rate: Fraction
    condition_number: float


class NothingFound(Failure):
    """No attempt led to a metric; the attempts stand in `result.synthesis`."""

    attempts: int
    routes: tuple[str, ...]
    degrees: tuple[int, ...]
    last: Outcome | None

    def _why(self, reason: Reason) -> str:
        if not self.attempts:
            return "no metric was found"
        degrees, routes = ", ".join(map(str, self.degrees)), " and ".join(self.routes)
        last = "" if self.last is None else f"; the last: {self.last.told()}"
        metric = "metric that serves" if isinstance(self.last, Proven) else "metric"
        attempts = "1 attempt" if self.attempts == 1 else f"{self.attempts} attempts"
        return f"no {metric} was found: {attempts} by {routes}, degree {degrees}{last}"


class NoneCertified(Failure):
    """Metrics were found at `compared` rates from `slowest` to `fastest`, and none certifies.

    `slow` and `fast` are the claims that ended the certifications with the slowest and the fastest.
    """

    compared: int
    slowest: Fraction
    fastest: Fraction
    slow: Claim
    slow_verdict: Verdict
    fast: Claim
    fast_verdict: Verdict

    def _why(self, reason: Reason) -> str:
        slowest, fastest = near(self.slowest), near(self.fastest)
        slow = Reason(claim=self.slow, verdict=self.slow_verdict).message
        fast = Reason(claim=self.fast, verdict=self.fast_verdict).message
        if self.compared == 1:
            return f"the metric at rate {slowest} 1/s does not certify: {slow}"
        rates = f"none of {self.compared} metrics, of rates from {slowest} to {fastest} 1/s, certifies"
        return (
            f"{rates}: {slow}" if slow == fast else f"{rates}: at the slowest {slow}; at the fastest {fast}"
        )
