"""A certificate, read back: whether it is about this specification, its plan, what a promise about a loop is.

Nothing is believed that the hash does not cover; nothing is proven here either (that is `recheck`'s task).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tubecert.certificate.belonging import as_set, compared
from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Result
from tubecert.claims.advice import advice
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.inputs import InputBound
from tubecert.conditions.rates import RateRecipe
from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.model import ControlAffineModel
from tubecert.spec import Spec, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.verdict import Verdict

_UNUSED: Final = ("initial_state", "obstacles", "simulation", "expect", "conditions")  # of a metric alone
Gains = RateRecipe | DistanceRecipe


def adopted(spec: Spec, result: Result) -> Spec:
    """The specification with what the certification had changed: what the command line gave, a new metric.

    Raises `ForeignError` if the certificate is about another system.
    """
    compared(spec, result).require(spec, "the certificate")
    other = load_text(result.spec.effective.at_rest(_UNUSED), "certificate")
    spec = replace(as_set(spec, result.overrides.settings), tube=other.tube)
    if result.overrides.metric is None and spec.metric is not None:
        return spec
    return replace(spec, metric=other.metric, synthesis=other.synthesis)


def require_family(spec: Spec, options: Sequence[str]) -> None:
    """Raises TC708 if there is one plan only, and options say which of many is to be followed."""
    if spec.trajectory.bundle is not None or not options:
        return
    message = f"{' and '.join(options)}: this specification has one plan, not a family of them"
    help = "leave it away, or certify a family: trajectory: {kind: any, x: {...}, u: {...}}"
    raise TubecertError(
        [Finding(code="TC708", message=message, location=spec.location("trajectory.kind"), help=help)]
    )


def require_tube(result: Result) -> None:
    """Raises the reason why there is no tube to be compared with, if there is none."""
    if result.tube is not None and result.tube.rho_r is not None and result.constants:
        return
    reason = next((item for item in result.reasons if item.verdict is result.verdict), None)
    why = "certification stopped" if reason is None else reason.sentence
    message = f"there is no tube that a simulation could leave ({result.verdict}: {why})"
    help = advice(reason.relax if reason else ()) or "tubecert certify tells more"
    error = TubecertError([Finding(code="TC703", message=message, help=help)])
    error.exit_code = (result.verdict if result.verdict is Verdict.REFUTED else Verdict.UNDECIDED).exit_code
    raise error


def certified_plan(spec: Spec, model: ControlAffineModel, result: Result) -> Plan:
    """The plan that was certified: the specification's expressions, or the certificate's knots."""
    knots, trajectory = result.plan.exact_knots(), spec.trajectory
    if knots is None:
        x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
        return Plan(x, u, trajectory.horizon)
    return piecewise_plan(model, knots, trajectory.horizon)


def sup(result: Result, name: str, otherwise: float | None = None) -> float:
    """The safe side of a constant; raises `TubecertError` if it is not known, and there is no other value for that."""
    bound = result.constants.get(name)
    found = otherwise if bound is None or bound.above is None else bound.above
    if found is None:
        raise incomplete("that is simulated", f"{name} is missing")
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """D(t) of theorem B: d(x*, x) <= D(t), (2.15)."""

    rate: float
    bandwidth: float
    start: float  # d0
    beta: float
    defect: float
    first: float  # H0
    rest: float  # S
    error: float  # e, of the estimate, which is there from the start

    def __call__(self, t: Array) -> Array:
        """D at times t (K,)."""
        settled = (self.beta * (self.rest + self.error) + self.defect) / self.rate
        gap = self.bandwidth - self.rate
        e_rate, e_band = np.exp(-self.rate * t), np.exp(-self.bandwidth * t)
        K = t * e_rate if abs(gap) < 1e-9 * self.rate else (e_rate - e_band) / gap
        return np.asarray(
            settled + (self.start - settled) * e_rate + self.beta * (self.first - self.rest) * K
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """What is certified of the adaptive loop: `bounds` by the names of peaks, half-widths by state and output.

    `ultimate` is the radius in the long run, `decay` the bound of the distance over time; either may be missing.
    `ranges`: those of inputs that have limits, by name.
    """

    bounds: Mapping[str, float]
    half_widths: Mapping[str, float]
    ranges: Mapping[str, InputBound]
    ultimate: float | None = None
    decay: Decay | None = None
