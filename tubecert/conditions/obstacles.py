"""What no gains can overcome in 0 and B: a tube too narrow for where the plan starts or drifts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tubecert.conditions.arithmetic import T, sqrt
from tubecert.conditions.kernels import DistanceBound
from tubecert.conditions.problem import Numbers, Shortfall, TubeProblem
from tubecert.conditions.wind import pushed
from tubecert.enclosure.interval import Interval


def reach(n: Numbers[T]) -> T:
    """The distance that cannot be reached inside the tube: dbar = sqrt(a) rho, section 0 of the theory."""
    return sqrt(n.a) * n.rho


def obstacles(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """What no gains can overcome: dbar <= d0, dbar <= delta/lambda."""
    safe, whole = problem.proven(), problem.enclosed()
    allowed = reach(safe), reach(whole)
    items = (obstacle("initial_distance", allowed, (safe.d0, whole.d0)), _pushes(problem, allowed))
    return tuple(item for item in items if item is not None)


def _pushes(problem: TubeProblem, allowed: tuple[Interval, Interval]) -> Shortfall | None:
    """What no input makes up for: the plan's defect, with it unknown parameters, with both the wind."""
    causes = {"plan_defect": replace(problem, wind=None, residual=None)}
    if problem.residual is not None:
        causes["parameters"] = replace(problem, wind=None)
    if problem.wind is not None:
        causes["wind"] = problem
    for claim, each in causes.items():
        found = obstacle(claim, allowed, (_residual(each.proven()), _residual(each.enclosed())))
        if found is not None:
            return found
    return None


def _residual(n: Numbers[Interval]) -> Interval:
    """What a plan defect and a wind alone lead to: delta/lambda, or what of it the horizon allows.

    (2.15) without the other terms.
    """
    still = DistanceBound(
        d0=0 * n.d0,
        beta=n.beta,
        H0=0 * n.H0,
        S=0 * n.H0,
        e=0 * n.H0,
        delta=pushed(n),
        lam=n.lam,
        omega=2 * n.lam,
        horizon=n.horizon,
    )
    return still.supremum()


def obstacle(claim: str, allowed: Sequence[Interval], needed: Sequence[Interval]) -> Shortfall | None:
    """The reason, unless allowed > needed is proven; both on the safe side first, then enclosed, theory 4.2."""
    low, high = (1 - x / y for x, y in zip(needed, allowed, strict=True))
    if low.lo > 0:
        return None
    margin = Interval(low.lo, np.maximum(low.lo, high.hi))
    return Shortfall(claim=claim, margin=margin, allowed=float(allowed[0].lo), needed=float(needed[0].hi))
