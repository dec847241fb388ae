"""The estimate of the predictor A_m = -g I, P = I, and what a wind adds to theorems 0 and B. Trusted.

A general A_m would serve no better: with g = lmin(Q)/2 and its unit eigenvector v, v'A_m v = -g, so |A_m| >= g and
|A_m + omega I| >= |omega - g|, and -g I has the same q = 2 g, theory section 3. Without a wind every function of one
gives back what it was given, digit by digit. Implements: theory section 7.
"""

from __future__ import annotations

from tubecert.conditions.arithmetic import T, number, quiet, sqrt
from tubecert.conditions.problem import UNKNOWN, Numbers, Shortfall, TubeProblem


def pushed(n: Numbers[T]) -> T:
    """What lengthens the geodesic beside what the filter leaves of h: delta + beta_w |w|, (7.3)."""
    return n.delta if n.wind_push is None else n.delta + n.wind_push


def drifting(n: Numbers[T]) -> T:
    """The bound of |f + B u*|, and of E w with it: phi + D_E |w|, (7.4)."""
    return n.phi if n.wind_speed is None else n.phi + n.wind_speed


def _sum(first: T | None, second: T | None) -> T | None:
    if first is None or second is None:
        return second if first is None else first
    return first + second


def taken(n: Numbers[T]) -> T:
    """What is taken for a part of h at least: eps_w |w| of (7.9)."""
    return number(0, n.d0) if n.wind_error is None else n.wind_error


def is_felt(n: Numbers[T]) -> bool:
    """Whether anything that is no input acts."""
    return n.wind_speed is not None or n.rest_speed is not None


def felt(n: Numbers[T]) -> T:
    """What drives the prediction error of certificate B beside the inputs: zb of (7.7) for A_m = -g I."""
    found = _sum(n.wind_matched, n.rest_matched)
    return number(0, n.d0) if found is None else found


@quiet
def prediction_error(hs: T, s1: T, g: T) -> T:
    """Dxt = sqrt(2 (1+r_H) Dh s1/q + ((1+r_H) Dh)^2), q = 2 g: |xhat - x| <= Dxt/sqrt(Gamma), for P = I, (2.11)."""
    return sqrt(2 * hs * s1 / (2 * g) + hs**2)


def prediction(n: Numbers[T], s1: T, g: T, Gamma: T, zb: T) -> T:
    """The bound of |xt| of (7.8): not only what adaptation leaves, but what is no input."""
    hs, q = n.Dh + n.R, 2 * g
    drag = zb / q
    return sqrt(hs**2 / Gamma + (drag + sqrt(drag**2 + 2 * hs * s1 / (q * Gamma))) ** 2)


def provisos(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """Why nothing follows for a B that is not known: the theorems are stated for the one that the controller knows."""
    return (Shortfall(claim="gain_not_covered", margin=UNKNOWN),) if problem.gained else ()


def not_covered(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """Why certificate A says nothing: it is stated without anything beside the inputs."""
    wind, rest = problem.wind, problem.residual
    blows = wind is not None and wind.pushes
    moves = rest is not None and rest.size.above > 0
    return (Shortfall(claim="wind_not_covered", margin=UNKNOWN),) if blows or moves else ()
