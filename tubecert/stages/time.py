"""The time that a claim is about: the horizon, one period of h and f, or none where both are free of t."""

from __future__ import annotations

from fractions import Fraction

from tubecert.bounds.compute import time_range
from tubecert.enclosure.domain import Range
from tubecert.expression.waves import frequencies
from tubecert.findings import Finding
from tubecert.model import TIME, moving_parts, time_period
from tubecert.spec import Spec


def time_of(spec: Spec) -> tuple[list[Finding], Range | None]:
    """The range of time that matters for h and f, or why there is none.

    What must hold for h to be defined may depend on t where h does not, as in 0*(1/(t + 1)).
    """
    try:
        return [], time_range(spec.trajectory.horizon, time_period(moving_parts(spec)))
    except ValueError as error:
        finding = Finding(
            code="TC204",
            message=str(error),
            location=spec.location("uncertainty.h"),
            help="add trajectory.horizon, in seconds",
        )
        return [finding], None


def period_of(spec: Spec) -> tuple[Fraction, bool] | None:
    """The period as (q, whether times pi), in s; None if nothing depends on t, or none is to be seen."""
    found = frequencies(moving_parts(spec), TIME)
    return None if found is None else found.period
