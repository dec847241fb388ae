"""A recipe put into every formula of theorem H. Trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from tubecert.conditions.arithmetic import T
from tubecert.conditions.hardware.course import Course, course
from tubecert.conditions.hardware.estimation import Estimate, estimate
from tubecert.conditions.hardware.feedback import Loss, loss
from tubecert.conditions.hardware.loop import Loop, Plant


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated(Generic[T]):
    """A recipe put into every formula."""

    plant: Plant[T]
    loop: Loop[T]
    estimate: Estimate[T]
    loss: Loss[T]
    course: Course[T]


def evaluated(p: Plant[T], loop: Loop[T]) -> Evaluated[T]:
    """Every formula of theorem H at a recipe."""
    e = estimate(p, loop)
    cost = loss(p, loop, e)
    return Evaluated(plant=p, loop=loop, estimate=e, loss=cost, course=course(p, loop, e, cost))
