"""A certificate, read back: whether it is about this specification, its plan, and what it promises about a loop.

Nothing is believed that the hash does not cover; nothing is proven here either (that is `recheck`'s task).
Implements: theory 4, the bounds D(t), |k| <= du dbar, |xtilde| <= Dxt/sqrt(Gamma), |sigma_hat - h| <= Dh + R_H.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal

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
from tubecert.kinds import Name
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certified:
    """A certificate that has a tube, with what of it is computed with; `certified["h"]`: the safe side of a constant.

    `S` (n, n): the tube and the loop are designed in z = S x. `reach` is dbar = sqrt(a) rho; `rate` lambda in 1/s;
    `upper` the bound A of lmax(M), where there is one. `half_widths` by state and output.
    """

    result: Result
    rho: float
    reach: float
    rate: float
    upper: float | None
    S: Array
    half_widths: Mapping[str, float]

    @classmethod
    def of(cls, result: Result) -> Certified:
        """What simulation reads of a certificate; raises `TubecertError` if it has no tube."""
        tube, metric = result.tube, result.metric
        if tube is None or tube.half_widths is None or metric is None or metric.lower is None:
            raise incomplete("that is simulated", "it has no tube")
        rho, upper, rows = float(tube.rho), metric.upper, tube.coordinates
        return cls(
            result=result,
            rho=rho,
            reach=math.sqrt(metric.lower.below) * rho,
            rate=float(metric.rate),
            upper=upper.above if upper is not None and math.isfinite(upper.above) else None,
            S=np.eye(len(result.spec.effective.system.states))
            if rows is None
            else np.array([[float(Fraction(entry)) for entry in row] for row in rows]),
            half_widths=tube.half_widths,
        )

    def __getitem__(self, name: str) -> float:
        found = self._known(name)
        if found is None:
            raise incomplete("that is simulated", f"{name} is missing")
        return found

    def _known(self, name: str) -> float | None:
        bound = self.result.constants.get(name)
        return None if bound is None else bound.above

    def beside(self, what: Literal["push", "size"]) -> float:
        """What a wind of the size given, and unknown parameters, do: beta_w |w| + beta_r, or D_E |w| + D_r."""
        wind = self.result.claim.wind
        size = 0.0 if wind is None else float(Fraction(wind.bound))
        return size * (self._known(f"wind_{what}") or 0.0) + (self._known(f"residual_{what}") or 0.0)

    def proven(self, name: Name) -> Gains | None:
        """The gains of a kind with the numbers of their proof, if it is certified."""
        section, recipe = self.result.sections.get(name.key), self.result.proof.of.get(name.key)
        certified = section is not None and section.verdict is Verdict.CERTIFIED
        return recipe if certified and isinstance(recipe, (RateRecipe, DistanceRecipe)) else None


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


def promise(certified: Certified, name: Name) -> Promise | None:
    """What a kind of certificate promises about the adaptive loop; None if it certifies nothing."""
    recipe = certified.proven(name)
    if recipe is None:
        return None
    k = certified["feedback_gain"] * certified.reach  # (2.3) |k| <= du dbar
    radius = float(recipe.projection_radius)  # R_H
    bounds = {
        "distance": certified.reach,  # d(x*, x) < dbar
        "deviation": certified.rho,  # 1.4 (i)
        "k": k,
        "u": certified["u_star"] + k + radius,  # (0.4), |u_a| <= R_H
        "sigma_error": certified["h"] + radius,  # (2.10)
        "xtilde": _prediction_error(certified, recipe),
    }
    inputs = certified.result.inputs
    return Promise(
        bounds=bounds,
        half_widths=certified.half_widths,
        ranges={own.input: own.bounds[name.key] for own in inputs if name.key in own.bounds},
        ultimate=certified.result.sections[name.key].ultimate_radius,
        decay=_decay(certified, recipe)
        if isinstance(recipe, DistanceRecipe)
        else None,  # A bounds the tube only
    )


def _prediction_error(certified: Certified, recipe: Gains) -> float:
    """Dxt/sqrt(Gamma), (2.11): of A with its own constant Dxt; of B with s1 = Dht + Dhx Y, and (7.8) beside a wind."""
    Gamma = float(recipe.adaptation_rate)
    if isinstance(recipe, RateRecipe):
        return certified["prediction_error"] / math.sqrt(Gamma)
    s1 = certified["h_t"] + certified["h_x"] * float(recipe.speed)
    most, q = certified["h"] + float(recipe.projection_radius), 2 * float(recipe.predictor_gain)
    drag = certified.beside("size") / q
    if not drag:
        return math.sqrt((2 * most * s1 / q + most**2) / Gamma)
    return math.hypot(most / math.sqrt(Gamma), drag + math.sqrt(drag**2 + 2 * most * s1 / (q * Gamma)))


def _decay(certified: Certified, recipe: DistanceRecipe) -> Decay:
    """(2.15) with H0, and S and e of the recipe."""
    return Decay(
        rate=certified.rate,
        bandwidth=float(recipe.bandwidth),
        start=certified["initial_distance"],
        beta=certified["metric_input_gain"],
        defect=certified["plan_defect_metric"] + certified.beside("push"),
        first=certified["h_initial"],
        rest=float(recipe.uncertainty),
        error=float(recipe.prediction_error),
    )
