"""The metric file as values: a proven metric, what was proven of it, and how it was found. Trusted: yes.

Reading one as the metric of a specification is `spec.metric_file`'s task: it takes rate and matrix, and believes
nothing else that the file says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from tubecert.certificate.result import MetricData, SolverData
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Interval
from tubecert.records import Json, to_json
from tubecert.spec.metric_file import FORMAT


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricFile:
    """W and its rate in 1/s; on `verified_on`, lower I <= M <= upper I, and C2 holds with `margin` in 1/s to spare."""

    format: str
    rate: Fraction
    dual_metric: tuple[tuple[str, ...], ...]
    verified_on: Mapping[str, tuple[Fraction, Fraction]]
    lower: Constant
    upper: Constant
    condition_number: Constant
    solver: SolverData
    margin: Constant | None = None

    def to_json(self) -> Json:
        """What the file holds."""
        return to_json(self)


def metric_file(
    safe_set: Mapping[str, tuple[Fraction, Fraction]], metric: MetricData, solver: SolverData
) -> MetricFile:
    """The metric file of a metric that is proven on a safe set; raises `ValueError` if it is not."""
    lower, upper = metric.lower_on_set, metric.upper_on_set
    if lower is None or upper is None:
        raise ValueError("a proven metric has bounds")
    ratio = Interval(upper.below, upper.above) / Interval(lower.below, lower.above)
    return MetricFile(
        format=FORMAT,
        rate=metric.rate,
        dual_metric=metric.dual_metric,
        verified_on=safe_set,
        lower=lower,
        upper=upper,
        condition_number=Constant(below=float(ratio.lo), above=float(ratio.hi)).printable(),
        solver=solver,
        margin=metric.margin,
    )
