"""A certificate in closed types: what it claims, of what, and the numbers that it states."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Enclosure
from tubecert.recheck.inputs import Limited
from tubecert.recheck.kinds.kind import Asked, Section
from tubecert.recheck.obstacles import Cleared
from tubecert.recheck.plans import Plan
from tubecert.recheck.reasons import Assumption, Reason
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.numbers import Range, Rows
from tubecert.recheck.specified.plant import Wanted
from tubecert.recheck.specified.trajectory import Start

MEASURED = (
    "lower",
    "upper",
    "f",
    "f_x",
    "B",
    "B_x",
    "b_x",
    "B_pinv",
    "B_pinv_x",
    "M_x",
    "u_star",
    "h",
    "h_x",
    "h_t",
    "h_initial",
    "feedback_gain",
    "metric_input_gain",
    "drift_on_plan",
    "initial_distance",
    "plan_defect",
    "plan_defect_metric",
)
INFIMA = ("lower",)  # constants whose lower side is used


@dataclass(frozen=True, slots=True)
class Plans:
    """The family of plans that is claimed about."""

    x: dict[str, Range]
    u: dict[str, Range]
    defect: Fraction


@dataclass(frozen=True, slots=True)
class Wind:
    """Every disturbance that is claimed about: |w| and, where it is known, |w'|."""

    bound: Fraction
    rate: Fraction | None


@dataclass(frozen=True, slots=True)
class Claim:
    """What the certificate says that it claims, in its own words."""

    id: str
    horizon: Fraction | None
    for_all_time: str | None
    period: str | None
    domain: dict[str, Range]
    start: Start
    uncertainty: str
    plans: Plans | None
    wind: Wind | None
    parameters: dict[str, Range] | None


@dataclass(frozen=True, slots=True)
class Overrides:
    """What the command line replaced in the specification; gains that were asked for.

    `settings`: numbers that were set, by path, beside what the specification says there.
    """

    epsilon: Fraction | None
    rho_a: Fraction | None
    bandwidth: Fraction | None
    adaptation_rate: Fraction | None
    conditions: str | None
    metric: str | None
    settings: dict[str, tuple[Fraction, Fraction]]

    @property
    def gains(self) -> Asked:
        """What was asked of gains."""
        return Asked(bandwidth=self.bandwidth, adaptation_rate=self.adaptation_rate)


@dataclass(frozen=True, slots=True)
class Geodesics:
    """The test for their uniqueness."""

    value: Enclosure
    holds: bool


@dataclass(frozen=True, slots=True)
class MetricSection:
    """What is claimed of the metric; None where a certification ended before."""

    rate: Fraction
    dual_metric: tuple[tuple[str, ...], ...]
    verdict: str
    margin: Enclosure | None
    largest_rate: Enclosure | None
    lower_on_set: Enclosure | None
    upper_on_set: Enclosure | None
    lower: Enclosure | None
    upper: Enclosure | None
    geodesics: Geodesics | None


@dataclass(frozen=True, slots=True)
class TubeSection:
    """Radii and half-widths; a tube that leaves the set has no half-widths. `coordinates` are the rows of S."""

    epsilon: Fraction
    rho_a: Fraction
    rho: Fraction
    rho_r: Fraction | None
    half_widths: dict[str, Fraction] | None
    coordinates: Rows | None


@dataclass(frozen=True, slots=True)
class Sections:
    """The section of every kind by its key, with those that decide."""

    by_key: dict[str, Section]
    decided_by: tuple[str, ...]


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
    sections: Sections | None


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate: its result, the hash that it states, and the hash that the result has; what no claim examines."""

    result: Result
    stated_hash: str
    hash: str
    unread: tuple[str, ...]
