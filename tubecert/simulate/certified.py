"""A certificate, read back: whether it is about this specification, its plan, and the numbers that simulation needs.

Nothing is believed that the hash does not cover; nothing is proven here either (that is `recheck`'s task).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Final, cast

from tubecert.certificate.belonging import compared
from tubecert.claims import Reason
from tubecert.errors import ExitCode, TubecertError
from tubecert.findings import Finding
from tubecert.model import ControlAffineModel
from tubecert.records import from_json
from tubecert.spec import Interpolation, Knots, Spec, Tube, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.words.advice import advice
from tubecert.words.claims import sentence

Result = Mapping[str, Any]

_UNUSED: Final = ("initial_state", "obstacles", "simulation", "expect", "conditions")  # of a metric alone


class Values(dict[str, float]):
    """Numbers by their names in the certificate; one that is missing is told as `TubecertError`."""

    def __missing__(self, name: str) -> float:
        raise _incomplete(f"{name} is missing")


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What one kind of certificate states: whether it is certified, by which recipe, and the radius in the long run.

    `recipe` are the numbers that it proves its claim with, by their names in `proof`.
    """

    certified: bool
    recipe: Values
    ultimate: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """What simulation reads of a certificate, as numbers: nothing else in this room reads its JSON.

    `reach` is dbar = sqrt(a) rho; `rate` lambda in 1/s; `upper` the bound A of lmax(M), where there is one;
    `constants` the safe sides, by their names in the certificate; `sections` by the names in `proof`.
    """

    rho: float
    reach: float
    rate: float
    upper: float | None
    half_widths: tuple[float, ...]
    constants: Values
    sections: Mapping[str, Section]

    def __getitem__(self, name: str) -> float:
        """The safe side of a constant."""
        return self.constants[name]

    def proven(self, section: str) -> Section | None:
        """A section, if there is one and it is certified."""
        found = self.sections.get(section)
        return found if found is not None and found.certified else None


def adopted(spec: Spec, result: Result) -> Spec:
    """The specification with what the certification had changed: radii and metric of the command line, a new metric.

    Raises `ForeignError` if the certificate is about another system.
    """
    compared(spec, result).require(spec, "the certificate")
    effective = result["spec"]["effective"]
    changed = result["overrides"]
    if "epsilon" in changed or "rho_a" in changed:
        radii = {name: Fraction(value) for name, value in effective["tube"].items()}
        spec = replace(spec, tube=Tube(**radii))
    if "metric" in changed or spec.metric is None:
        other = _without_plan(effective)
        spec = replace(spec, metric=other.metric, synthesis=other.synthesis)
    return spec


def _without_plan(effective: Mapping[str, Any]) -> Spec:
    """The specification in a certificate, at rest at 0: its plan may be in a file that is elsewhere."""
    rest = {"kind": "equilibrium", "at": ["0"] * len(effective["system"]["states"])}
    kept = {key: value for key, value in effective.items() if key not in _UNUSED}
    return load_text(json.dumps(kept | {"trajectory": rest}), "certificate")


def require_tube(result: Result) -> None:
    """Raises the reason why there is no tube to be compared with, if there is none."""
    if "rho_r" in result.get("tube", {}) and result.get("constants"):
        return
    reasons = [from_json(Reason, item, f"reasons[{i}]") for i, item in enumerate(result["reasons"])]
    reason = next((item for item in reasons if item.verdict == result["verdict"]), None)
    why = "certification stopped" if reason is None else sentence(reason)
    error = TubecertError(
        [
            Finding(
                code="TC703",
                message=f"there is no tube that a simulation could leave ({result['verdict']}: {why})",
                help=advice(reason.relax if reason else ()) or "tubecert certify tells more",
            )
        ]
    )
    error.exit_code = ExitCode.NOT_CERTIFIED if result["verdict"] == "refuted" else ExitCode.UNDECIDED
    raise error


def certified_plan(spec: Spec, model: ControlAffineModel, result: Result) -> Plan:
    """The plan that was certified: the specification's expressions, or the certificate's knots."""
    knots = result["plan"].get("knots")
    trajectory = spec.trajectory
    if knots is None:
        x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
        return Plan(x, u, trajectory.horizon)
    rows = {name: tuple(tuple(map(Fraction, row)) for row in knots[name]) for name in ("x", "u")}
    interpolation = cast(Interpolation, result["plan"]["interpolation"])
    exact = Knots(t=tuple(map(Fraction, knots["t"])), interpolation=interpolation, **rows)
    return piecewise_plan(model, exact, trajectory.horizon)


def read_numbers(result: Result) -> Certified:
    """What simulation reads of a certificate that has a tube; raises `TubecertError` if any of it is missing."""
    try:
        rho = _number(result["tube"]["rho"])
        metric = result["metric"]
        return Certified(
            rho=rho,
            reach=math.sqrt(metric["lower"][0]) * rho,
            rate=_number(metric["rate"]),
            upper=float(metric["upper"][1]) if "upper" in metric else None,
            half_widths=tuple(float(width) for width in result["tube"]["half_widths"].values()),
            constants=Values({name: float(item["above"]) for name, item in result["constants"].items()}),
            sections={name: _section(result, name, recipe) for name, recipe in result["proof"].items()},
        )
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError) as error:
        raise _incomplete(f"{type(error).__name__} {error}") from None


def _incomplete(why: str) -> TubecertError:
    message = f"the certificate is incomplete: {why}"
    help = "give the JSON file that certify has written"
    return TubecertError([Finding(code="TC601", message=message, help=help)])


def _section(result: Result, name: str, recipe: Mapping[str, Any]) -> Section:
    found = result.get(name) or {}
    ultimate = found.get("ultimate_radius")
    return Section(
        certified=result["formulas"] == "corrected" and found.get("verdict") == "certified" and bool(recipe),
        recipe=Values({name: _number(value) for name, value in (recipe or {}).items() if value is not None}),
        ultimate=None if ultimate is None else float(ultimate),
    )


def _number(value: float | str) -> float:
    """A number of a certificate: a decimal, or a text p/q."""
    return float(Fraction(value)) if isinstance(value, str) else float(value)
