"""A certificate in closed types: what it claims, of what, and the numbers that it states."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from tubecert.recheck.document import Enclosure, Node, enclosure, may, nullable, one_of, reads
from tubecert.recheck.inputs import Limited
from tubecert.recheck.kinds.kind import VERDICTS, Asked, Section
from tubecert.recheck.obstacles import Cleared
from tubecert.recheck.plans import Plan
from tubecert.recheck.reasons import Assumption, Reason
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.loop import DECIDES
from tubecert.recheck.specified.numbers import Range, Rows, ranges
from tubecert.recheck.specified.plant import Wanted
from tubecert.recheck.specified.trajectory import Start

MEASURED = (
    "lower", "upper", "f", "f_x", "B", "B_x", "b_x", "B_pinv", "B_pinv_x", "M_x", "u_star", "h", "h_x", "h_t",
    "h_initial", "feedback_gain", "metric_input_gain", "drift_on_plan", "initial_distance", "plan_defect",
    "plan_defect_metric",
)  # fmt: skip
INFIMA = ("lower",)  # constants whose lower side is used


Plans = tuple[dict[str, Range], dict[str, Range], Fraction]
"""The family of plans that is claimed about: where x* and u* are, and the defect."""


@dataclass(frozen=True, slots=True)
class Wind:
    """Every disturbance that is claimed about: |w| and, where it is known, |w'|."""

    bound: Fraction = reads(Node.exact)
    rate: Fraction | None = may(Node.exact)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What the certificate says that it claims, in its own words."""

    id: str = reads(Node.text)
    horizon: Fraction | None = reads(nullable(Node.exact))
    for_all_time: str | None = reads(nullable(Node.text))
    period: str | None = reads(nullable(Node.text))
    domain: dict[str, Range]
    start: Start
    uncertainty: str = reads(Node.text)
    plans: Plans | None = None
    wind: Wind | None = may(lambda node: node.record(Wind))
    parameters: dict[str, Range] | None = may(ranges)


@dataclass(frozen=True, slots=True, kw_only=True)
class Overrides:
    """What the command line replaced in the specification; gains that were asked for.

    `settings`: numbers that were set, by path, beside what the specification says there.
    """

    epsilon: Fraction | None = may(Node.decimal)
    rho_a: Fraction | None = may(Node.decimal)
    bandwidth: Fraction | None = may(Node.decimal)
    adaptation_rate: Fraction | None = may(Node.decimal)
    conditions: str | None = may(one_of(*DECIDES))
    metric: str | None = may(Node.text)
    settings: dict[str, tuple[Fraction, Fraction]] = field(default_factory=dict)

    @property
    def gains(self) -> Asked:
        """What was asked of gains."""
        return {"bandwidth": self.bandwidth, "adaptation_rate": self.adaptation_rate}


@dataclass(frozen=True, slots=True)
class Geodesics:
    """The test for their uniqueness."""

    value: Enclosure = reads(enclosure)
    holds: bool = reads(Node.flag)


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricSection:
    """What is claimed of the metric; None where a certification ended before."""

    rate: Fraction = reads(Node.decimal)
    dual_metric: tuple[tuple[str, ...], ...]
    verdict: str = reads(one_of(*VERDICTS))
    margin: Enclosure | None = may(enclosure)
    largest_rate: Enclosure | None = may(enclosure)
    lower_on_set: Enclosure | None = may(enclosure)
    upper_on_set: Enclosure | None = may(enclosure)
    lower: Enclosure | None = may(enclosure)
    upper: Enclosure | None = may(enclosure)
    unique_geodesics: Geodesics | None = may(lambda node: node.record(Geodesics))


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeSection:
    """Radii and half-widths; a tube that leaves the set has no half-widths. `coordinates` are the rows of S."""

    epsilon: Fraction = reads(Node.decimal)
    rho_a: Fraction = reads(Node.decimal)
    rho: Fraction = reads(Node.decimal)
    rho_r: Fraction | None = may(Node.decimal)
    half_widths: dict[str, Fraction] | None = None
    coordinates: Rows | None = None


@dataclass(frozen=True, slots=True)
class Result:
    """What was proven: for a verdict other than `certified` as far as the certification came."""

    verdict: str
    specification: Specification
    effective_hash: str
    claim: Claim
    overrides: Overrides
    plan: Plan
    safe_set: dict[str, Range]
    assumptions: tuple[Assumption, ...]
    declared: dict[str, Fraction]
    reasons: tuple[Reason, ...]
    recipes: dict[str, object]  # `result.proof`, by the key of the kind
    synthesised: Wanted | None
    metric: MetricSection | None
    tube: TubeSection | None
    clearance: tuple[Cleared, ...]
    inputs: tuple[Limited, ...]
    constants: dict[str, Enclosure] | None
    sections: dict[str, Section] | None  # of every kind by its key
    decided_by: tuple[str, ...]
