"""The claim in the certificate's own words, derived again from this room's reading of the specification.

`claim`: the state stays within the tube around the plan, over which time (and why for all of it, if there is no
horizon), on which set the metric is one, from which start, against which uncertainty.
"""

from __future__ import annotations

from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import stated
from tubecert.recheck.result import Claim, Plans, Result, Wind
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.trajectory import AnyPlan, Resting
from tubecert.recheck.times import period_of

TUBE = "tube"
_KEYS = (
    "id",
    "horizon",
    "for_all_time",
    "period",
    "domain",
    "start",
    "uncertainty",
    "plans",
    "wind",
    "parameters",
)


def own_claim(spec: Specification) -> Claim:
    """What a certificate of this specification claims; raises `ValueError` where it can claim nothing."""
    horizon = spec.trajectory.horizon
    for_all_time = period = None
    if horizon is None:
        assert isinstance(spec.trajectory, (Resting, AnyPlan)), "every other plan has a horizon"
        found = period_of(spec.uncertainty, spec.plant.moving)
        for_all_time = "periodic" if found.length else "autonomous"
        period = found.text if found.length else None
    return Claim(
        id=TUBE,
        horizon=horizon,
        for_all_time=for_all_time,
        period=period,
        domain=spec.plant.safe_set,
        start=spec.start,
        uncertainty=spec.uncertainty.words,
        plans=_plans(spec.trajectory) if isinstance(spec.trajectory, AnyPlan) else None,
        wind=None if spec.disturbance is None else Wind(spec.disturbance.length, spec.disturbance.rate),
        parameters=spec.plant.ranges or None,
    )


def _plans(family: AnyPlan) -> Plans:
    return Plans(x=family.x, u=family.u, defect=family.defect)


def agrees(result: Result) -> Outcome:
    """Whether `claim` is what follows from the specification."""
    own = own_claim(result.specification)
    for key in _KEYS:
        if getattr(own, key) != getattr(result.claim, key):
            return stated(False, f"claim.{key} is not that of the specification")
    return stated(True, "")
