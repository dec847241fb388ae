"""What examines what: every key of a result, with the claim that examines it. A key without a row is refused (TC603).

A row names the first words of a claim. A pair [below, above] is examined on the side that is claimed. `*` is a name of
somebody else's, `**` all that stands below: the form of that is closed where it is read. Rows that name no claim are
listed in the output as not examined; with `--spec` those of `FILE` are compared or told (`certificate.belonging`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from tubecert.recheck.document import Node
from tubecert.recheck.kinds.table import KEYS

NOTHING: Final = ""  # it claims nothing: for orientation
FILE: Final = "--spec"  # it says which file, and no claim rests on it
UNPROVEN: Final = "refuted"  # of what is not certified, examined in a certificate that says `refuted`

_WHOLE: Final = "the specification and what repeats it"
_CLAIM: Final = "the claim is that of the specification"
_VERDICT: Final = "the verdict follows from the sections"
_SMOOTH: Final = "f, B, W, h and the plan are smooth"
_RADIUS: Final = "rho = "
_PLAN: Final = "plan_defect"
_0: Final = "0: sup D"
_A: Final = "A: (26a)-(26c) at"
_B: Final = "B: sup D < dbar at"

EXAMINED: Final[Mapping[str, str]] = {
    "verdict": _VERDICT,
    "decided_by": _VERDICT,
    "spec.effective_hash": _WHOLE,
    "spec.file_hash": FILE,
    "safe_set.*": _WHOLE,
    "declared.*": _WHOLE,
    "claim.id": _CLAIM,
    "claim.horizon": _CLAIM,
    "claim.for_all_time": _CLAIM,
    "claim.period": _CLAIM,
    "claim.domain.*": _CLAIM,
    "claim.start.**": _CLAIM,
    "claim.uncertainty": _CLAIM,
    "claim.plans.**": _CLAIM,
    "claim.wind.**": _CLAIM,
    "claim.parameters.*": _CLAIM,
    "overrides.epsilon": _WHOLE,
    "overrides.rho_a": _WHOLE,
    "overrides.bandwidth": _WHOLE,
    "overrides.adaptation_rate": _WHOLE,
    "overrides.conditions": _VERDICT,
    "overrides.metric": FILE,
    "overrides.settings.*": _WHOLE,
    "assumptions.*": "assumptions are complete",
    "reasons.claim": _VERDICT,
    "reasons.verdict": _VERDICT,
    "reasons.section": _VERDICT,
    "reasons.margins.*": _VERDICT,
    "reasons.predictor_gain": _VERDICT,
    "reasons.at.**": UNPROVEN,
    "reasons.failure.**": UNPROVEN,
    "reasons.*": UNPROVEN,
    "synthesis.asked.**": _WHOLE,
    "plan.kind": _WHOLE,
    "plan.interpolation": _WHOLE,
    "plan.curve": _WHOLE,
    "plan.file": FILE,
    "plan.file_hash": FILE,
    "plan.knots.t": _PLAN,
    "plan.knots.x": _PLAN,
    "plan.knots.u": _PLAN,
    "metric.rate": _WHOLE,
    "metric.dual_metric": _WHOLE,
    "metric.verdict": _VERDICT,
    "metric.margin": "C2 on the safe set",
    "metric.largest_rate": "C2 on the safe set",
    "metric.lower_on_set": "C1: M >= ",
    "metric.upper_on_set": "C1: M <= ",
    "metric.lower": "bounds are intervals",
    "metric.upper": "bounds are intervals",
    "metric.unique_geodesics.value": "geodesics are unique",
    "metric.unique_geodesics.holds": "geodesics are unique",
    "tube.epsilon": _WHOLE,
    "tube.rho_a": _WHOLE,
    "tube.rho": _RADIUS,
    "tube.rho_r": _WHOLE,
    "tube.half_widths.*": "half-width of",
    "tube.coordinates": "the tube lies in the safe set",
    "clearance.verdict": _VERDICT,
    "clearance.decides": _VERDICT,
    "clearance.clearance": "clearance from obstacle",
    "clearance.shape.diagonal": "W in the plane of",
    "clearance.shape.beside": "W in the plane of",
    "inputs.input": _VERDICT,
    "inputs.limits": _VERDICT,
    "inputs.verdict": _VERDICT,
    "inputs.plan.least": "u* of the plan",
    "inputs.plan.greatest": "u* of the plan",
    "inputs.bounds.*.least": _VERDICT,
    "inputs.bounds.*.greatest": _VERDICT,
    "inputs.bounds.*.feedback": "what is added to u*",
    "inputs.bounds.*.adaptation": "what is added to u*",
    "constants.lower.below": "lower >= ",
    "constants.lower.above": NOTHING,
    "constants.*.above": "<=",
    "constants.*.below": NOTHING,
    "no_adaptation.verdict": _0,
    "no_adaptation.margin": _0,
    "no_adaptation.distance": _0,
    "no_adaptation.uncertainty_limit": "0: without adaptation for |h| <",
    "no_adaptation.ultimate_radius": _0,
    "conditions_26.verdict": _A,
    "conditions_26.bandwidth": _A,
    "conditions_26.adaptation_rate": _A,
    "conditions_26.predictor_gain": _A,
    "conditions_26.projection_radius": _A,
    "conditions_26.margins.*": _A,
    "conditions_26.ultimate_radius": "A: ultimate radius",
    "distance.verdict": _B,
    "distance.ultimate_radius": "B: ultimate radius",
    **{
        f"{pair}.{key}": claim
        for pair, claim in (
            ("conditions_26.least_adaptation", _A),
            ("distance.split", _B),
            ("distance.least_adaptation", _B),
            ("distance.asked", _B),
            ("proof.conditions_26", "A: its recipe"),
            ("proof.distance", _B),
        )
        for key in ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")
    },
    "conditions_26.least_adaptation.margins.*": _A,
    **{
        f"distance.{pair}.{key}": _B
        for pair in ("split", "least_adaptation", "asked")
        for key in ("margin", "ultimate_radius")
    },
    **{
        f"{section}.shortfalls.{key}": NOTHING  # of what is not certified
        for section in KEYS
        for key in ("condition", "margin")
    },
    "proof.no_adaptation": _0,
    "proof.distance.speed": _B,
    "proof.distance.prediction_error": _B,
    "proof.distance.uncertainty": _B,
    # -- the specification: what it says is not believed either, but used
    "spec.effective.tubecert": _WHOLE,
    "spec.effective.name": FILE,
    "spec.effective.expect.**": FILE,
    "spec.effective.simulation.**": FILE,
    "spec.effective.system.states": _CLAIM,
    "spec.effective.system.inputs": _WHOLE,
    "spec.effective.system.units.*": FILE,
    "spec.effective.system.parameters.*": _CLAIM,
    "spec.effective.system.f": "C2 on the safe set",
    "spec.effective.system.B": "rank(B) = m on the safe set",
    "spec.effective.system.outputs.*": "half-width of",
    "spec.effective.system.tables.*.interpolation": _SMOOTH,
    "spec.effective.system.tables.*.points": _SMOOTH,
    "spec.effective.safe_set.*": _CLAIM,
    "spec.effective.uncertainty.h": "h <=",
    "spec.effective.uncertainty.bounds.*": _WHOLE,
    "spec.effective.trajectory.kind": _WHOLE,
    "spec.effective.trajectory.horizon": _CLAIM,
    "spec.effective.trajectory.at": _PLAN,
    "spec.effective.trajectory.input": _PLAN,
    "spec.effective.trajectory.x": _PLAN,
    "spec.effective.trajectory.u": _PLAN,
    "spec.effective.trajectory.x.*": _CLAIM,
    "spec.effective.trajectory.u.*": _CLAIM,
    "spec.effective.trajectory.defect": _CLAIM,
    "spec.effective.trajectory.interpolation": _WHOLE,
    "spec.effective.trajectory.start": "the plan serves its task",
    "spec.effective.trajectory.target": "the plan serves its task",
    "spec.effective.trajectory.goal": "the plan serves its task",
    "spec.effective.trajectory.file": FILE,
    "spec.effective.trajectory.knots": FILE,
    "spec.effective.trajectory.Q": FILE,
    "spec.effective.trajectory.R": FILE,
    "spec.effective.initial_state.at": "initial_distance <=",
    "spec.effective.initial_state.within": "initial_distance <=",
    "spec.effective.initial_state.box.*": "initial_distance <=",
    "spec.effective.metric.dual_metric": "C1: M >= ",
    "spec.effective.metric.rate": "C2 on the safe set",
    "spec.effective.metric.bounds.lower": "metric.bounds: M >=",
    "spec.effective.metric.bounds.upper": "metric.bounds: M <=",
    "spec.effective.metric.synthesise.**": UNPROVEN,
    "spec.effective.tube.epsilon": _RADIUS,
    "spec.effective.tube.rho_a": _RADIUS,
    "spec.effective.tube.coordinates": _WHOLE,
    "spec.effective.tube.half_widths.*": _WHOLE,
    "spec.effective.tube.gap": FILE,
    "spec.effective.adaptation.A_m": "A: its recipe",
    "spec.effective.adaptation.projection": "assumptions are complete",
    "spec.effective.adaptation.projection.smooth": "assumptions are complete",
    "spec.effective.conditions.decides": _VERDICT,
    "spec.effective.obstacles.states": "W in the plane of",
    "spec.effective.obstacles.polygon": "clearance from obstacle",
    "spec.effective.obstacles.disc.center": "clearance from obstacle",
    "spec.effective.obstacles.disc.radius": "clearance from obstacle",
    "spec.effective.obstacles.decide": _VERDICT,
    "spec.effective.limits.*": _VERDICT,
    "spec.effective.disturbance.E": "wind_push <=",
    "spec.effective.disturbance.bound": _CLAIM,
    "spec.effective.disturbance.rate": _CLAIM,
}


def met(result: Node) -> tuple[str, ...]:
    """The rows of what stands in a result; raises `CertificateError` for a key that has none."""
    return tuple(dict.fromkeys(_met(result, _TREE)))


def not_examined(result: Node) -> tuple[str, ...]:
    """Those that no claim examines."""
    return tuple(row for row in met(result) if EXAMINED[row] in (NOTHING, FILE))


_ROW = "row#"  # no key is written so
_REST = "**"
Tree = dict[str, Any]


def _grown() -> Tree:
    """The rows by their keys: a tree, with the row at its leaf."""
    whole: Tree = {}
    for row in EXAMINED:
        place = whole
        for key in row.split("."):
            place = place.setdefault(key, {})
        place[_ROW] = row
    return whole


_TREE: Final = _grown()


def _met(node: Node, place: Tree) -> Iterator[str]:
    """The rows of what stands at a place of the tree, and below it."""
    if _REST in place:
        yield place[_REST][_ROW]
    elif isinstance(node.value, dict) and (node.value or _ROW not in place):
        for key, own in node.items():
            inner = place.get(key, place.get("*"))
            if inner is None:
                raise own.refused("is nothing that a claim examines")
            yield from _met(own, inner)
    elif isinstance(node.value, list) and any(isinstance(item, dict) for item in node.value):
        for item in node.entries():
            yield from _met(item, place)
    elif _ROW in place:
        yield place[_ROW]
    elif node.value:  # null and empty say nothing
        raise node.refused("is nothing that a claim examines")
