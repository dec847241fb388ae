"""A synthesised metric as a file holds it: its text, what is read back from it, and what makes it shorter.

In: a metric that the ladder of `tubecert.synthesis` found. Out: the specification with it, or its file. Trusted: no,
what is read back is proven anew where it differs.
"""

from __future__ import annotations

import json

from tubecert.certificate.result import MetricFile, SolverData, metric_file
from tubecert.certificate.sections import metric_data
from tubecert.claims.advice import ConstantInputs, LowerDegree
from tubecert.claims.family import Relax
from tubecert.expression import to_text
from tubecert.metric.verify import MetricProof
from tubecert.records import Json, exact_json
from tubecert.spec import Spec
from tubecert.spec.metric_file import FORMAT, with_metric_text
from tubecert.synthesis.rounding import VerifiedMetric


class TooLongError(Exception):
    """A metric is too long for a file, and so will others be; `code` is that of the finding."""

    def __init__(self, metric: VerifiedMetric, code: str) -> None:
        super().__init__(code)
        self.metric, self.code = metric, code


def read_back(spec: Spec, metric: VerifiedMetric) -> Spec:
    """The specification with the metric that its file will hold; raises `SpecError` if it is too long for one."""
    content = {"format": FORMAT, **_data(metric)}
    return with_metric_text(spec, json.dumps(content), "<synthesised>")


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


def _data(metric: VerifiedMetric) -> Json:
    return {
        "rate": exact_json(metric.rate),
        "dual_metric": [[to_text(e) for e in row] for row in metric.dual_metric],
    }
