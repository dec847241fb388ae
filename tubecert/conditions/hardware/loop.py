"""What theorem H is about: the loop of a recipe, and the plant, each in one arithmetic. Trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Generic

from tubecert.conditions import machine as machines
from tubecert.conditions.arithmetic import (
    T,
)
from tubecert.conditions.machine import Machine, MachineNumbers
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.enclosure.interval import Interval
from tubecert.spec import Picard


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowProof:
    """What theorem HW asks for in a window: the numbers of a recipe that are its own."""

    level: Fraction
    floor: Fraction
    speed: Fraction
    bias: Fraction
    ripple: Fraction
    prediction: Fraction | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Rounding:
    """What the arithmetic of the computer may lose at most (theorem H-R), in units of d^2/s, inputs, inputs, states.

    `feedback` r_a: alpha/2 + c'kappa may be that much above 0; `input` r_u: what acts differs from u0 + kappa - q^ by
    at most that; `estimate` r_q, of each sigma; `prediction` r_p, of the predicted state.
    """

    feedback: Fraction
    input: Fraction
    estimate: Fraction
    prediction: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareRecipe:
    """The proof of theorem H: the loop, and the numbers that the theorem asks for.

    The loop: `sample_time` Ts, `delay` tau, `feedback_time` Tf (Ts where the feedback has no rate of its own),
    `bandwidth` omega (None: no filter), `noise` nu in units of noise, `wind` |w|, `clip_radius` R. The proof: `level`
    dhat, `floor` f0, `speed` Y, `bias` S, `ripple` N, and `prediction` np of theorem H-P (None without prediction).
    With `windows` (theorem HW) they are the largest of the windows. `rounding`: none where the computer is exact, or
    what it may lose.
    """

    sample_time: Fraction
    delay: Fraction
    feedback_time: Fraction
    bandwidth: Fraction | None
    noise: Fraction
    wind: Fraction
    clip_radius: Fraction
    level: Fraction
    floor: Fraction
    speed: Fraction
    bias: Fraction
    ripple: Fraction
    prediction: Fraction | None
    windows: tuple[WindowProof, ...] = ()
    rounding: tuple[Rounding, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost(Generic[T]):
    """A `Rounding` in one arithmetic: r_a, r_u, r_q, r_p."""

    feedback: T
    input: T
    estimate: T
    prediction: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(Generic[T]):
    """A recipe in one arithmetic; `omega` None: th = 1; `np` None: no prediction; `lost` None: a computer is exact.

    Two clocks: `late` is 1 where the feedback's is the slower one, else 0; `off` is 1 where the slower one is no
    multiple of the faster one, else 0.
    """

    Ts: T
    tau: T
    Tf: T
    omega: T | None
    nu: T
    wbar: T
    dhat: T
    f0: T
    Y: T
    S: T
    N: T
    np: T | None
    late: T
    off: T
    lost: Lost[T] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant(Generic[T]):
    """All that is known of the system over the tube, in one arithmetic.

    `beta_w`, `D_E`, `eps_w`: what a wind does per |w|; `rest`: |r| of unknown parameters; `held`: whether u* is played
    from sample to sample; `drift`: the bound of |n_k - n_(k-1)|/Ts in units of noise; `gain`: D_b, None of a known B;
    `geodesic`: how geodesics are computed, None where they are exact.
    """

    n: Numbers[T]
    m: MachineNumbers[T]
    beta_w: T
    D_E: T
    eps_w: T
    rest: T
    held: bool = False
    drift: T | None = None
    gain: T | None = None
    geodesic: Picard | None = None


def in_step(first: Fraction, second: Fraction) -> bool:
    """Whether the longer of two sample times is a multiple of the shorter one, theory 8.4."""
    return (max(first, second) / min(first, second)).denominator == 1


def plant(problem: TubeProblem, R: Fraction) -> Plant[Interval]:
    """The safe side of everything that is known; `ValueError` without a machine."""
    machine, wind = machine_in(problem), problem.wind
    zero = Interval.of(0)
    n = problem.proven(R)
    return Plant(
        n=n,
        m=machines.proven(machine),
        beta_w=zero if wind is None else Interval.exact(wind.constants.push.above),
        D_E=zero if wind is None else Interval.exact(wind.constants.size.above),
        eps_w=zero if wind is None else Interval.exact(wind.constants.explained.above),
        rest=zero if problem.residual is None else Interval.exact(problem.residual.size.above),
        held=machine.asked.held,
        drift=None if machine.drift is None else Interval.of(machine.drift),
        gain=None if problem.gain is None else Interval.exact(problem.gain.error.above),
        geodesic=machine.asked.geodesic,
    )


def machine_in(problem: TubeProblem) -> Machine:
    """What theorem H knows of the machine; `ValueError` without one."""
    if problem.machine is None:
        raise ValueError("the specification says nothing of the hardware")
    return problem.machine


def loop_of(recipe: HardwareRecipe) -> Loop[Interval]:
    """A recipe in outward-rounded arithmetic."""
    Ts, Tf = recipe.sample_time, recipe.feedback_time
    return Loop(
        Ts=Interval.of(Ts),
        tau=Interval.of(recipe.delay),
        Tf=Interval.of(Tf),
        omega=None if recipe.bandwidth is None else Interval.of(recipe.bandwidth),
        nu=Interval.of(recipe.noise),
        wbar=Interval.of(recipe.wind),
        dhat=Interval.of(recipe.level),
        f0=Interval.of(recipe.floor),
        Y=Interval.of(recipe.speed),
        S=Interval.of(recipe.bias),
        N=Interval.of(recipe.ripple),
        np=None if recipe.prediction is None else Interval.of(recipe.prediction),
        late=Interval.of(int(Tf > Ts)),
        off=Interval.of(int(not in_step(Ts, Tf))),
        lost=lost_of(recipe.rounding, Interval.of),
    )


def lost_of(rounding: tuple[Rounding, ...], of: Callable[[Fraction], T]) -> Lost[T] | None:
    """What is lost, in the arithmetic that `of` makes numbers of."""
    if not rounding:
        return None
    (r,) = rounding
    return Lost(
        feedback=of(r.feedback), input=of(r.input), estimate=of(r.estimate), prediction=of(r.prediction)
    )
