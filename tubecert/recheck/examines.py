"""What examines what: every key of a result, with the claim that examines it. A key without a row is refused (TC603).

A row names the first words of a claim and the keys that it examines; of a pair [below, above] the side that is claimed.
`*` is a name of somebody else's, `**` all that stands below: the form of that is closed where it is read. Keys of rows
that name no claim are listed in the output as not examined; with `--spec` those of `FILE` are compared or told
(`certificate.belonging`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from tubecert.recheck.document import Node

NOTHING: Final = ""  # it claims nothing: for orientation
FILE: Final = "--spec"  # it says which file, and no claim rests on it
UNPROVEN: Final = "refuted"  # of what is not certified, examined in a certificate that says `refuted`

_ROWS: Final[Mapping[str, str]] = {
    "the verdict follows from the sections": """
        verdict decided_by overrides.conditions reasons.claim reasons.verdict reasons.section
        reasons.margins.* reasons.predictor_gain metric.verdict clearance.verdict clearance.decides
        inputs.input inputs.limits inputs.verdict inputs.bounds.*.least inputs.bounds.*.greatest
        spec.effective.conditions.decides spec.effective.obstacles.decide spec.effective.limits.*
    """,
    "the specification and what repeats it": """
        spec.effective_hash safe_set.* declared.* overrides.epsilon overrides.rho_a overrides.bandwidth
        overrides.adaptation_rate overrides.settings.* synthesis.asked.** plan.kind plan.interpolation
        plan.curve metric.rate metric.dual_metric tube.epsilon tube.rho_a tube.rho_r spec.effective.tubecert
        spec.effective.system.inputs spec.effective.uncertainty.bounds.* spec.effective.trajectory.kind
        spec.effective.trajectory.interpolation spec.effective.tube.coordinates
        spec.effective.tube.half_widths.*
    """,
    FILE: """
        spec.file_hash overrides.metric plan.file plan.file_hash spec.effective.name
        spec.effective.expect.** spec.effective.simulation.** spec.effective.system.units.*
        spec.effective.trajectory.file spec.effective.trajectory.knots spec.effective.trajectory.Q
        spec.effective.trajectory.R spec.effective.tube.gap
    """,
    "the claim is that of the specification": """
        claim.id claim.horizon claim.for_all_time claim.period claim.domain.* claim.start.**
        claim.uncertainty claim.plans.** claim.wind.** claim.parameters.* spec.effective.system.states
        spec.effective.system.parameters.* spec.effective.safe_set.* spec.effective.trajectory.horizon
        spec.effective.trajectory.x.* spec.effective.trajectory.u.* spec.effective.trajectory.defect
        spec.effective.disturbance.bound spec.effective.disturbance.rate
    """,
    "assumptions are complete": """
        assumptions.* spec.effective.adaptation.projection spec.effective.adaptation.projection.smooth
    """,
    UNPROVEN: "reasons.at.** reasons.failure.** reasons.* spec.effective.metric.synthesise.**",
    "plan_defect": """
        plan.knots.t plan.knots.x plan.knots.u spec.effective.trajectory.at spec.effective.trajectory.input
        spec.effective.trajectory.x spec.effective.trajectory.u
    """,
    "C2 on the safe set": """
        metric.margin metric.largest_rate spec.effective.system.f spec.effective.metric.rate
    """,
    "C1: M >= ": "metric.lower_on_set spec.effective.metric.dual_metric",
    "C1: M <= ": "metric.upper_on_set",
    "bounds are intervals": "metric.lower metric.upper",
    "geodesics are unique": "metric.unique_geodesics.value metric.unique_geodesics.holds",
    "rho = ": "tube.rho spec.effective.tube.epsilon spec.effective.tube.rho_a",
    "half-width of": "tube.half_widths.* spec.effective.system.outputs.*",
    "the tube lies in the safe set": "tube.coordinates",
    "clearance from obstacle": """
        clearance.clearance spec.effective.obstacles.polygon spec.effective.obstacles.disc.center
        spec.effective.obstacles.disc.radius
    """,
    "W in the plane of": """
        clearance.shape.diagonal clearance.shape.beside spec.effective.obstacles.states
    """,
    "u* of the plan": "inputs.plan.least inputs.plan.greatest",
    "what is added to u*": "inputs.bounds.*.feedback inputs.bounds.*.adaptation",
    "lower >= ": "constants.lower.below",
    NOTHING: """
        constants.lower.above constants.*.below no_adaptation.shortfalls.condition
        no_adaptation.shortfalls.margin conditions_26.shortfalls.condition conditions_26.shortfalls.margin
        distance.shortfalls.condition distance.shortfalls.margin
    """,
    "<=": "constants.*.above",
    "0: sup D": """
        no_adaptation.verdict no_adaptation.margin no_adaptation.distance no_adaptation.ultimate_radius
        proof.no_adaptation
    """,
    "0: without adaptation for |h| <": "no_adaptation.uncertainty_limit",
    "A: (26a)-(26c) at": """
        conditions_26.verdict conditions_26.bandwidth conditions_26.adaptation_rate
        conditions_26.predictor_gain conditions_26.projection_radius conditions_26.margins.*
        conditions_26.least_adaptation.bandwidth conditions_26.least_adaptation.adaptation_rate
        conditions_26.least_adaptation.predictor_gain conditions_26.least_adaptation.projection_radius
        conditions_26.least_adaptation.margins.*
    """,
    "A: ultimate radius": "conditions_26.ultimate_radius",
    "B: sup D < dbar at": """
        distance.verdict distance.split.bandwidth distance.split.adaptation_rate
        distance.split.predictor_gain distance.split.projection_radius distance.least_adaptation.bandwidth
        distance.least_adaptation.adaptation_rate distance.least_adaptation.predictor_gain
        distance.least_adaptation.projection_radius distance.asked.bandwidth distance.asked.adaptation_rate
        distance.asked.predictor_gain distance.asked.projection_radius proof.distance.bandwidth
        proof.distance.adaptation_rate proof.distance.predictor_gain proof.distance.projection_radius
        distance.split.margin distance.split.ultimate_radius distance.least_adaptation.margin
        distance.least_adaptation.ultimate_radius distance.asked.margin distance.asked.ultimate_radius
        proof.distance.speed proof.distance.prediction_error proof.distance.uncertainty
    """,
    "B: ultimate radius": "distance.ultimate_radius",
    "A: its recipe": """
        proof.conditions_26.bandwidth proof.conditions_26.adaptation_rate proof.conditions_26.predictor_gain
        proof.conditions_26.projection_radius spec.effective.adaptation.A_m
    """,
    "rank(B) = m on the safe set": "spec.effective.system.B",
    "f, B, W, h and the plan are smooth": """
        spec.effective.system.tables.*.interpolation spec.effective.system.tables.*.points
    """,
    "h <=": "spec.effective.uncertainty.h",
    "the plan serves its task": """
        spec.effective.trajectory.start spec.effective.trajectory.target spec.effective.trajectory.goal
    """,
    "initial_distance <=": """
        spec.effective.initial_state.at spec.effective.initial_state.within
        spec.effective.initial_state.box.*
    """,
    "metric.bounds: M >=": "spec.effective.metric.bounds.lower",
    "metric.bounds: M <=": "spec.effective.metric.bounds.upper",
    "wind_push <=": "spec.effective.disturbance.E",
}
_OF_EVERY: Final = (  # claims of a result that is not certified
    "the specification and what repeats it",
    "the claim is that of the specification",
    "bounds are intervals",
)
# what it is about
_GIVEN: Final = ("spec", "plan", "verdict", "reasons.claim", "reasons.verdict", "reasons.section")
_OF_REASONS: Final = ("reasons.margins.*", "reasons.predictor_gain")
EXAMINED: Final[Mapping[str, str]] = {key: claim for claim, keys in _ROWS.items() for key in keys.split()}


def met(result: Node) -> tuple[str, ...]:
    """The rows of what stands in a result; raises `CertificateError` for a key that has none."""
    return tuple(dict.fromkeys(_met(result, _TREE)))


def not_examined(result: Node, verdict: str) -> tuple[str, ...]:
    """Those that no claim examines; of a result that is not certified also the sections, if not all of them is."""
    rows, examined = met(result), (*_OF_EVERY, *([UNPROVEN] if verdict == "refuted" else []))
    told = [row for row in rows if EXAMINED[row] in (NOTHING, FILE)]
    if verdict != "certified":
        beside = (row for row in rows if EXAMINED[row] not in (NOTHING, FILE, *examined))
        told += (row if row in _OF_REASONS else row.partition(".")[0] for row in beside if row not in _GIVEN)
    return tuple(name for name in dict.fromkeys(told) if name not in _GIVEN)


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
