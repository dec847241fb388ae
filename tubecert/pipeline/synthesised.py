"""What a synthesis comes out with: the metrics it compared, the metric file, and what was tried.

In: proven metrics. Out: records for a certificate, a metric file and reports.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, isfinite

from tubecert.certificate.effective import Asked
from tubecert.certificate.metric_file import MetricFile
from tubecert.certificate.result import AttemptData, MetricRow, SynthesisData
from tubecert.claims import Reason
from tubecert.spec import Spec, Synthesis
from tubecert.spec.canonical import synthesis_data
from tubecert.synthesis.ladder import Attempt
from tubecert.synthesis.problem import Floor
from tubecert.synthesis.rounding import VerifiedMetric
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One metric of a sweep.

    `input_gain`: beta/sqrt(a) over the tube; `adaptation_rate`: the least of the distance form.
    """

    rate: Fraction
    floor: Floor
    degree: int
    condition_number: float
    verdict: Verdict | None = None
    input_gain: float | None = None
    rho: float | None = None
    ultimate_radius: float | None = None
    adaptation_rate: float | None = None
    metric: VerifiedMetric = field(repr=False)

    def score(self, objective: str) -> tuple[float, ...]:
        """Smaller is better; what is not certified comes last."""
        if objective == "tube":
            wanted = (_or_inf(self.rho), _or_inf(self.ultimate_radius))
        else:
            wanted = (_or_inf(self.adaptation_rate), 0.0)
        certified = self.verdict is Verdict.CERTIFIED
        return (*wanted, self.condition_number) if certified else (inf, inf, self.condition_number)

    def data(self) -> MetricRow:
        """As certificates and reports hold it."""
        return MetricRow(
            rate=self.rate,
            floor=self.floor,
            degree=self.degree,
            condition_number=self.condition_number,
            verdict=self.verdict,
            input_gain=self.input_gain,
            rho=self.rho,
            ultimate_radius=self.ultimate_radius,
            adaptation_rate=self.adaptation_rate,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesised:
    """What became of a synthesis.

    `verdict`: certified (then `spec` has the metric and `file` is the metric file's content), refuted (no metric has
    the rate, or B loses rank, see `reason`), or undecided.
    """

    verdict: Verdict
    wanted: Synthesis
    spec: Spec | None = None
    file: MetricFile | None = None
    reason: Reason | None = None
    rows: tuple[Row, ...] = ()
    attempts: tuple[Attempt, ...] = ()

    def data(self) -> SynthesisData:
        """`result.synthesis` of a certificate: what was asked for, what was tried; no times."""
        return SynthesisData(
            asked=Asked(data=synthesis_data(self.wanted)),
            objective=self.wanted.objective,
            verdict=self.verdict,
            attempts=tuple(map(_attempt, self.attempts)),
            rate=self.wanted.rate,
            table=tuple(row.data() for row in self.rows),
            solver=None if self.file is None else self.file.solver,
            reason=self.reason,
        )


def _attempt(attempt: Attempt) -> AttemptData:
    return AttemptData(
        rate=attempt.rate,
        degree=attempt.degree,
        floor=attempt.floor,
        route=attempt.route,
        outcome=attempt.outcome,
        condition_number=attempt.condition_number,
    )


def _or_inf(value: float | None) -> float:
    return inf if value is None or not isfinite(value) else value
