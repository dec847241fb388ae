"""What a synthesis comes out with: the metrics it compared, the metric as its file holds it, and what was tried.

In: proven metrics. Out: records for a certificate, a metric file and reports; what is read back from the text of a
metric, which is proven anew where it differs.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from math import inf, log

from tubecert.certificate.effective import Asked
from tubecert.certificate.result import (
    MetricFile,
    MetricRow,
    SearchData,
    SolverData,
    SynthesisData,
    metric_file,
)
from tubecert.certificate.sections import metric_data
from tubecert.claims.advice import ConstantInputs, LowerDegree, MendPlan
from tubecert.claims.family import Claim, Relax
from tubecert.claims.statements import PlanBounded, PlanInSafeSet, StartInTube
from tubecert.expression import to_text
from tubecert.metric.verify import MetricProof
from tubecert.records import Json, exact_json
from tubecert.spec import Spec, Synthesis
from tubecert.spec.metric import SYNTHESIS
from tubecert.spec.metric_file import FORMAT, with_metric
from tubecert.spec.source import Source
from tubecert.synthesis.rounding import VerifiedMetric
from tubecert.verdict import Verdict

_FAR = 50
_NARROWER = 0.01  # of the tube, in its logarithm


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(MetricRow):
    """One metric of a comparison.

    `verdict` is that of the kinds that decide, `claim` what failed; `alone`: certificate 0 holds, whatever decides;
    `mend`: what the plan lacks, if its defect alone takes the whole tube.
    `width`: of the tube in the outputs that were asked for; None: its radius counts.
    """

    claim: Claim | None = None
    alone: bool = False
    mend: MendPlan | None = None
    width: float | None = None
    metric: VerifiedMetric = field(repr=False)

    @property
    def counts(self) -> bool:
        """Whether something is certified with it."""
        return self.verdict is Verdict.CERTIFIED

    @property
    def missed(self) -> float:
        """How many times the tube the plan misses the dynamics by, where that is why nothing is certified; else 0."""
        if isinstance(self.claim, PlanBounded | PlanInSafeSet | StartInTube):
            return inf
        return 0.0 if self.counts or self.mend is None else self.mend.share

    @property
    def idle(self) -> bool:
        """Whether the filter that it needs is slower than its own contraction: faster rates gain by feedback alone."""
        return self.bandwidth is not None and self.bandwidth < self.rate

    @property
    def far(self) -> bool:
        """Whether the filter is so much faster than the contraction that a rate of twice this one is too slow still."""
        return self.counts and self.bandwidth is not None and self.bandwidth > _FAR * self.rate

    def score(self, objective: str) -> tuple[float, ...]:
        """Smaller is better; what is certified comes first."""
        rank, without = (0, self.rho or inf) if self.counts else (1, inf)
        demand = without if self.demand is None else self.demand  # without adaptation the radius counts
        if objective == "tube":
            size = self.rho if self.width is None else self.width
            # a slower metric has to be worth it
            narrow = inf if size is None else log(size) // _NARROWER
            return (rank, narrow, demand, self.condition_number)
        return (rank, demand, self.condition_number)

    def data(self) -> MetricRow:
        """As certificates and reports hold it."""
        return MetricRow(**{item.name: getattr(self, item.name) for item in fields(MetricRow)})


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesised(SearchData):
    """What became of a synthesis.

    `verdict`: certified (then `spec` has the metric and `file` is the metric file's content), refuted (no metric has
    the rate, or B loses rank, see `reason`), or undecided. `limits`: what is against other rates than the one chosen.
    `cut`: what ended the search before it was through, if anything did.
    """

    wanted: Synthesis
    spec: Spec | None = None
    file: MetricFile | None = None
    rows: tuple[Row, ...] = ()

    def data(self) -> SynthesisData:
        """`result.synthesis` of a certificate, with its notes."""
        return SynthesisData(asked=Asked(data=SYNTHESIS.written(self.wanted)), search=self.search())

    def search(self) -> SearchData:
        """What was tried; no times."""
        found = {item.name: getattr(self, item.name) for item in fields(SearchData)}
        found["table"] = tuple(row.data() for row in self.rows)
        found["solver"] = None if self.file is None else self.file.solver
        return SearchData(**found)


class TooLongError(Exception):
    """A metric is too long for a file, and so will others be; `code` is that of the finding."""

    def __init__(self, metric: VerifiedMetric, code: str) -> None:
        super().__init__(code)
        self.metric, self.code = metric, code


def read_back(spec: Spec, metric: VerifiedMetric) -> Spec:
    """The specification with the metric that its file will hold; raises `SpecError` if it is too long for one."""
    content = {"format": FORMAT, **_data(metric)}
    return with_metric(spec, Source.of("<synthesised>", json.dumps(content)))


def _data(metric: VerifiedMetric) -> Json:
    rows = [[to_text(e) for e in row] for row in metric.dual_metric]
    return {"rate": exact_json(metric.rate), "dual_metric": rows}


def file_of(spec: Spec, proof: MetricProof, metric: VerifiedMetric) -> MetricFile:
    """The file of a metric that is read back as that of `spec`, and proven."""
    solver = SolverData(
        route=metric.proposal.route,
        degree=metric.family.degree,
        variables=tuple(metric.family.variables),
        digits=metric.digits,
    )
    return metric_file(dict(zip(spec.states, spec.safe_set, strict=True)), metric_data(spec, proof), solver)


def shorter(metric: VerifiedMetric) -> Relax:
    """What makes a metric shorter: where B moves, its fields are what is long."""
    return LowerDegree() if metric.family.flat else ConstantInputs()
