"""The time that a claim is about: the horizon, one period of h, or none where h is free of t."""

from __future__ import annotations

from fractions import Fraction

from tubecert.bounds.compute import time_range
from tubecert.enclosure.domain import Range
from tubecert.expression import Expression
from tubecert.findings import Finding
from tubecert.model import frequencies, time_period
from tubecert.spec import Spec


def time_of(spec: Spec) -> tuple[list[Finding], Range | None]:
    """The range of time that matters for h, or why there is none.

    What must hold for h to be defined may depend on t where h does not, as in 0*(1/(t + 1)).
    """
    try:
        return [], time_range(spec.trajectory.horizon, time_period(_of_uncertainty(spec)))
    except ValueError as error:
        finding = Finding(
            code="TC204",
            message=str(error),
            location=spec.location("uncertainty.h"),
            help="add trajectory.horizon, in seconds",
        )
        return [finding], None


def period_of(spec: Spec) -> tuple[Fraction, bool] | None:
    """The period of h as (q, whether times pi), in s; None if it is free of t, or has none to be seen."""
    found = frequencies(_of_uncertainty(spec))
    return None if found is None else found.period


def _of_uncertainty(spec: Spec) -> list[Expression]:
    """h, and what must hold for it to be defined."""
    terms = spec.uncertainty.h or ()
    owed = (duty.argument for term in terms for duty, _ in term.owed())
    return [*(term.expression for term in terms), *owed]
