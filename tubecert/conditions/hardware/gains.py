"""What an uncertain gain of the inputs costs theorem H: (H.30)-(H.35). Trusted.

The plant has B (I + Delta) in place of B, |Delta| <= D_b < 1, and the controller multiplies kappa by 1/(1 - D_b). Where
nothing of B is unknown every function here gives back what it was given, digit by digit. Implements: theory 8.10.
"""

from __future__ import annotations

from tubecert.conditions.arithmetic import T, exp, log1p_ratio, number, quiet, sqrt
from tubecert.conditions.hardware.loop import Loop, Plant
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.verdict import UNKNOWN, Shortfall


def acting(p: Plant[T], x: T) -> T:
    """|(I + Delta) v| of an input v that is at most x, by (H.30)."""
    return x if p.gain is None else (1 + p.gain) * x


def raised(p: Plant[T], x: T) -> T:
    """x/(1 - D_b): what the feedback is multiplied by, (H.33)."""
    return x if p.gain is None else x / (1 - p.gain)


def steepness(p: Plant[T]) -> T:
    """How much of |(I + Delta) kappa| there is per distance: du, or du (1 + D_b)/(1 - D_b), (H.33)."""
    return acting(p, raised(p, p.n.du))


def applied(p: Plant[T], ups: T, kb: T) -> T:
    """What B is multiplied by in x': |u + h|, or |u* + (I + Delta)(u - u* + h)|, by (H.32)."""
    n = p.n
    if p.gain is None:
        return n.Dus + ups + kb + n.R + n.Dh
    return n.Dus + acting(p, ups + kb + n.R + n.Dh)


def mistaken(p: Plant[T], loop: Loop[T], s1: T, kb: T, ups: T) -> T:
    """What the estimate takes for h and is not, (H.34): D_b (kb + ups + S + N + s1 (Ts/2 + tau)); 0 of a known gain."""
    if p.gain is None:
        return number(0, loop.Ts)
    return p.gain * (kb + ups + loop.S + loop.N + s1 * (loop.Ts / 2 + loop.tau))


def unpredicted(p: Plant[T], X: T, kb: T, ups: T) -> T:
    """What a prediction does not know of the inputs: |h - q^|, or |(I + Delta)(h - q^) + Delta (kappa + u0 - u*)|.

    (H.35).
    """
    return X if p.gain is None else acting(p, X) + p.gain * (kb + ups)


def settled(p: Plant[T], bias: T, ripple: T) -> T:
    """The least S, by what is needed at S = N = 0 and by the N that is needed: (H.34) solved for S."""
    return bias if p.gain is None else raised(p, bias + p.gain * ripple)


@quiet
def forgetting(p: Plant[T], loop: Loop[T]) -> T | None:
    """The rate at which the filter forgets, (H.35): omega, or -log(r)/Ts; None where it does at once."""
    if p.gain is None:
        return loop.omega
    nothing = number(0, loop.Ts)
    kept = nothing if loop.omega is None else exp(-(loop.omega * loop.Ts))
    r = (kept + sqrt(kept**2 + 4 * (1 - kept) * p.gain)) / 2
    return (1 - r) * log1p_ratio(r - 1) / loop.Ts


def uncovered(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """Why H says nothing of a gain: inputs act where the controller's do not, or |Delta| < 1 is not proven."""
    gain = problem.gain
    if gain is None:
        return ()
    if not gain.matched:
        return (Shortfall(claim="gain_unmatched", margin=UNKNOWN),)
    return () if gain.error.above < 1 else (Shortfall(claim="gain_range", margin=UNKNOWN),)
