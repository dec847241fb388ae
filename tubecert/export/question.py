"""The question that a certificate answers: specification, model and plan, and what code has of them.

In: a `Certificate`. Out: its specification, its model, and its plan as expressions or as pieces; or the reason why
there is no code for it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from fractions import Fraction
from itertools import pairwise
from typing import Final

from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Certificate
from tubecert.enclosure.interval import Array
from tubecert.export.controller import Pieces, refused
from tubecert.model import ControlAffineModel, build
from tubecert.spec import Spec, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan

_GAIN: Final = "feedback_gain"
_LONGEST: Final = 32  # characters of a name


def question(certificate: Certificate) -> tuple[Spec, Plan, ControlAffineModel]:
    """The specification in the certificate, its plan as it was certified, and its model."""
    data, knots = certificate.result.spec.effective.data, certificate.result.plan.exact_knots()
    if knots is not None:  # its plan was in a file
        rest = {"kind": "equilibrium", "at": ["0"] * len(certificate.result.spec.effective.system.states)}
        apart = ("initial_state", "obstacles", "simulation", "expect", "conditions")
        kept = {key: value for key, value in data.items() if key not in apart} | {"trajectory": rest}
        data = {key: _anytime(value) if key == "tube" else value for key, value in kept.items()}
    spec = load_text(json.dumps(dict(data)), "certificate")
    trajectory, model = spec.trajectory, build(spec)
    if knots is not None:
        if knots.interpolation == "hermite-simpson":
            raise refused(
                "a plan with quadratic inputs (interpolation: hermite-simpson) is not exported yet",
                "give its rows with interpolation: linear, and certify that",
            )
        horizon = certificate.result.spec.effective.trajectory.horizon
        return spec, piecewise_plan(model, knots, horizon), model
    x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
    return spec, Plan(x, u, trajectory.horizon), model


def _anytime(tube: Mapping[str, object]) -> Mapping[str, object]:
    """A tube without its windows, which are times of a plan."""
    return {key: value for key, value in tube.items() if key != "windows"}


def horizon_of(certificate: Certificate) -> Fraction | None:
    """How long the claim holds; None for ever."""
    claim = certificate.result.claim
    return None if claim.for_all_time or claim.horizon is None else Fraction(claim.horizon)


def gain_of(certificate: Certificate, name: str) -> Fraction:
    """du, from above: what the feedback is clipped by; one that is missing would be a controller without feedback."""
    gain = certificate.result.constants.get(_GAIN)
    if gain is None or gain.above is None:
        raise incomplete(name, f"the constant {_GAIN} has no bound")
    return Fraction(gain.above)


def identifier(name: str) -> str:
    """A name of C and Python."""
    found = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:_LONGEST] or "controller"
    return found if found[0].isalpha() else f"c_{found}"


def pieces_of(plan: PiecewisePlan, sample_time: Fraction) -> Pieces:
    """Coefficients in the middle of their enclosures."""
    found = plan.pieces
    start = plan.data.t[: len(found)]
    shortest = min((b - a for a, b in pairwise(start)), default=sample_time)
    return Pieces(
        start=start,
        x=_table(found.x.mid),
        u=_table(found.u.mid),
        most=int(sample_time / shortest) + 2,
        x_off=_table(found.x.rad),
        u_off=_table(found.u.rad),
        length=tuple(map(Fraction, found.length.hi.tolist())),
        continuous=plan.data.interpolation == "linear" or len(found) == 1,
    )


def _table(values: Array) -> tuple[tuple[tuple[Fraction, ...], ...], ...]:
    return tuple(tuple(tuple(map(Fraction, row)) for row in piece) for piece in values.tolist())
