"""A certificate, read back: whether it is about this specification, its plan, and the numbers that simulation needs.

Nothing is believed that the hash does not cover; nothing is proven here either (that is `recheck`'s task).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.bounds.constants import WIND
from tubecert.certificate.belonging import as_set, compared
from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Result
from tubecert.conditions.theorem import Recipe
from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.findings import Finding
from tubecert.kinds.data import SectionData
from tubecert.model import ControlAffineModel
from tubecert.simulate.inputs import InputRange, proven_ranges
from tubecert.spec import Spec, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.verdict import Verdict
from tubecert.words.advice import advice
from tubecert.words.claims import sentence

_UNUSED: Final = ("initial_state", "obstacles", "simulation", "expect", "conditions")  # of a metric alone


class Values(dict[str, float]):
    """Numbers by their names in the certificate; one that is missing is told as `TubecertError`."""

    def __missing__(self, name: str) -> float:
        raise incomplete("that is simulated", f"{name} is missing")


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What one kind of certificate states: whether it is certified, by which recipe, and the radius in the long run.

    `recipe` are the numbers that it proves its claim with, by their names in `proof`; `ranges` what is proven of
    inputs that have limits.
    """

    certified: bool
    recipe: Values
    ultimate: float | None
    ranges: tuple[InputRange, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Acting:
    """What a wind of the size given, and unknown parameters, do: beta_w |w| + beta_r, D_E |w| + D_r, eps_w |w|."""

    push: float
    size: float
    taken: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """What simulation reads of a certificate, as numbers: nothing else in this room reads its JSON.

    `S` (n, n): the tube and the loop are designed in z = S x. `reach` is dbar = sqrt(a) rho; `rate` lambda in 1/s;
    `upper` the bound A of lmax(M), where there is one; `constants` the safe sides, by their names in the certificate;
    `sections` by the names in `proof`. `beside`: what acts and is no input. `output_widths`: those of the outputs.
    """

    rho: float
    reach: float
    rate: float
    upper: float | None
    half_widths: tuple[float, ...]
    S: Array
    constants: Values
    sections: Mapping[str, Section]
    beside: Acting
    output_widths: tuple[float, ...] = ()

    def __getitem__(self, name: str) -> float:
        """The safe side of a constant."""
        return self.constants[name]

    def proven(self, section: str) -> Section | None:
        """A section, if there is one and it is certified."""
        found = self.sections.get(section)
        return found if found is not None and found.certified else None


def adopted(spec: Spec, result: Result) -> Spec:
    """The specification with what the certification had changed: what the command line gave, a new metric.

    Raises `ForeignError` if the certificate is about another system.
    """
    compared(spec, result).require(spec, "the certificate")
    other = load_text(result.spec.effective.at_rest(_UNUSED), "certificate")
    spec = as_set(spec, result.overrides.settings)
    spec = replace(spec, tube=other.tube)
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
    why = "certification stopped" if reason is None else sentence(reason)
    error = TubecertError(
        [
            Finding(
                code="TC703",
                message=f"there is no tube that a simulation could leave ({result.verdict}: {why})",
                help=advice(reason.relax if reason else ()) or "tubecert certify tells more",
            )
        ]
    )
    error.exit_code = (result.verdict if result.verdict is Verdict.REFUTED else Verdict.UNDECIDED).exit_code
    raise error


def certified_plan(spec: Spec, model: ControlAffineModel, result: Result) -> Plan:
    """The plan that was certified: the specification's expressions, or the certificate's knots."""
    knots, trajectory = result.plan.exact_knots(), spec.trajectory
    if knots is None:
        x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
        return Plan(x, u, trajectory.horizon)
    return piecewise_plan(model, knots, trajectory.horizon)


def read_numbers(result: Result) -> Certified:
    """What simulation reads of a certificate that has a tube; raises `TubecertError` if any of it is missing."""
    tube, metric = result.tube, result.metric
    if tube is None or tube.half_widths is None or metric is None or metric.lower is None:
        raise incomplete("that is simulated", "it has no tube")
    rho, upper = float(tube.rho), None if metric.upper is None else metric.upper.above
    widths = tuple(tube.half_widths[name] for name in result.spec.effective.system.states)
    rows = tube.coordinates
    return Certified(
        rho=rho,
        reach=math.sqrt(metric.lower.below) * rho,
        rate=float(metric.rate),
        upper=upper if upper is None or math.isfinite(upper) else None,
        half_widths=widths,
        output_widths=tuple(tube.half_widths[name] for name in result.spec.effective.system.outputs),
        S=np.eye(len(widths))
        if rows is None
        else np.array([[float(Fraction(q)) for q in row] for row in rows]),
        constants=Values(
            {name: item.above for name, item in result.constants.items() if item.above is not None}
        ),
        sections={
            name: replace(_section(recipe, result.sections.get(name)), ranges=proven_ranges(result, name))
            for name, recipe in result.proof.of.items()
        },
        beside=_acting(result),
    )


def _acting(result: Result) -> Acting:
    found = {name: item.above or 0.0 for name, item in result.constants.items()}
    blown, left = (
        [found.get(name, 0.0) for name in WIND if name.startswith(kind)] for kind in ("wind_", "residual_")
    )
    wind = result.claim.wind
    size = 0.0 if wind is None else float(Fraction(wind.bound))
    push, speed, taken = (size * value for value in blown)
    return Acting(push=push + left[0], size=speed + left[1], taken=taken)


def _section(recipe: Recipe, found: SectionData | None) -> Section:
    numbers = {item.name: getattr(recipe, item.name) for item in fields(recipe)}
    return Section(
        certified=found is not None and found.verdict is Verdict.CERTIFIED,
        recipe=Values({name: float(x) for name, x in numbers.items() if isinstance(x, Fraction)}),
        ultimate=None if found is None else found.ultimate_radius,
    )
