"""What a synthesis comes out with: the metrics it compared, the metric file, and what was tried.

In: proven metrics. Out: plain data for a certificate, a metric file and reports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, isfinite
from typing import Any

from tubecert.certificate.sections import decimal_data, pair_data
from tubecert.claims import Reason
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Interval
from tubecert.records import to_json
from tubecert.spec import Spec, Synthesis
from tubecert.spec.canonical import synthesis_data
from tubecert.spec.metric_file import FORMAT
from tubecert.synthesis.ladder import Attempt
from tubecert.synthesis.problem import Floor
from tubecert.synthesis.rounding import VerifiedMetric


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One metric of a sweep.

    `input_gain`: beta/sqrt(a) over the tube; `adaptation_rate`: the least of the distance form.
    """

    rate: Fraction
    floor: Floor
    degree: int
    condition_number: float
    verdict: str = ""
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
        return (
            (*wanted, self.condition_number)
            if self.verdict == "certified"
            else (inf, inf, self.condition_number)
        )

    def data(self) -> dict[str, Any]:
        """For reports and files."""
        numbers = {
            "input_gain": self.input_gain,
            "rho": self.rho,
            "ultimate_radius": self.ultimate_radius,
            "adaptation_rate": self.adaptation_rate,
        }
        return {
            "rate": decimal_data(self.rate),
            "floor": self.floor,
            "degree": self.degree,
            "condition_number": self.condition_number,
            **({"verdict": self.verdict} if self.verdict else {}),
            **{name: value for name, value in numbers.items() if value is not None},
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesised:
    """What became of a synthesis.

    `verdict`: certified (then `spec` has the metric and `file` is the metric file's content), refuted (no metric has
    the rate, or B loses rank, see `reason`), or undecided.
    """

    verdict: str
    wanted: Synthesis
    spec: Spec | None = None
    file: dict[str, Any] | None = None
    reason: Reason | None = None
    rows: tuple[Row, ...] = ()
    attempts: tuple[Attempt, ...] = ()

    def data(self) -> dict[str, Any]:
        """`result.synthesis` of a certificate: what was asked for, what was tried; no times."""
        wanted = self.wanted
        data: dict[str, Any] = {
            "asked": synthesis_data(wanted),
            "objective": wanted.objective,
            "verdict": self.verdict,
            "attempts": [
                {
                    "rate": a.rate,
                    "degree": a.degree,
                    "floor": a.floor,
                    "route": a.route,
                    "outcome": to_json(a.outcome),
                    **({} if a.condition_number is None else {"condition_number": a.condition_number}),
                }
                for a in self.attempts
            ],
        }
        if wanted.rate is not None:
            data["rate"] = decimal_data(wanted.rate)
        if self.rows:
            data["table"] = [row.data() for row in self.rows]
        if self.file is not None:
            data["solver"] = self.file["solver"]
        if self.reason is not None:
            data["reason"] = to_json(self.reason)
        return data


def metric_file(
    safe_set: Mapping[str, Any], metric: Mapping[str, Any], solver: Mapping[str, Any]
) -> dict[str, Any]:
    """The content of a metric file: the metric, and what was proven of it on the safe set (`result.metric`)."""
    low, high = (Interval(*(float(side) for side in metric[key])) for key in ("lower_on_set", "upper_on_set"))
    ratio = high / low
    condition = Constant(below=float(ratio.lo), above=float(ratio.hi)).printable()
    content: dict[str, Any] = {
        "format": FORMAT,
        "rate": metric["rate"],
        "dual_metric": metric["dual_metric"],
        "verified_on": dict(safe_set),
        "lower": metric["lower_on_set"],
        "upper": metric["upper_on_set"],
        "condition_number": pair_data(condition),
        "solver": dict(solver),
    }
    return content | {"margin": metric["margin"]} if "margin" in metric else content


def _or_inf(value: float | None) -> float:
    return inf if value is None or not isfinite(value) else value
