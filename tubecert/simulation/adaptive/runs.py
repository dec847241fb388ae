"""What a simulation returns: the runs at the output times, what was worst between them, and what failed."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peak:
    """The largest value over all steps of every lane (N,), and when it was met (N,), in s."""

    value: Array
    time: Array

    def __post_init__(self) -> None:
        assert self.value.shape == self.time.shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Worst:
    """Peaks over *all* steps, not only over the output times; a sampled maximum, never a bound."""

    distance: Peak  # d(x*, x)
    deviation: Peak  # |S (x - x*)|
    u: Peak  # |u* + k + u_a|
    k: Peak
    xtilde: Peak  # |S xtilde|
    sigma_error: Peak  # |sigma_hat - h|
    h: Peak
    speed: Peak  # |S x'|


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A lane that was stopped: when, in s, and why."""

    lane: int
    t: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Runs:
    """N runs at K output times.

    Shapes: t (K,), x and x' = `slope` (N, K, n), x_plan (K, n), u_plan (K, m), k, u_a, sigma_hat and h (N, K, m),
    xtilde (N, K, n), distance (N, K), the Riemannian d(x*, x). u = u_plan + k + u_a is what acts. A quantity that a
    loop does not have is 0. `least` and `greatest` (N, m) are of every input, over all steps. After a lane was stopped
    its values are nan. `error` (N,) is twice the largest difference in |S x| to the run with steps twice as long, or an
    eighth of the difference before, an estimate of the error and mostly far above it; it is inf for a lane that was
    stopped. `unresolved` (N,) is the first output time at which that difference exceeds the tolerance, nan where it
    never does.
    """

    t: Array
    x: Array
    slope: Array
    x_plan: Array
    u_plan: Array
    k: Array
    u_a: Array
    sigma_hat: Array
    h: Array
    xtilde: Array
    distance: Array
    worst: Worst
    least: Array
    greatest: Array
    error: Array
    unresolved: Array
    failures: tuple[Failure, ...]
    steps: NDArray[np.int64]  # (N,), how many steps the run took

    @property
    def u(self) -> Array:
        """u* + k + u_a, (N, K, m)."""
        return np.asarray(self.u_plan + self.k + self.u_a)

    @property
    def lanes(self) -> int:
        """N."""
        return len(self.error)


def joined(parts: list[Runs]) -> Runs:
    """Runs of the same problem, one after the other; lanes are numbered through."""
    from itertools import accumulate

    assert parts
    starts = [0, *accumulate(len(part.error) for part in parts)]
    failures = tuple(
        Failure(lane=start + item.lane, t=item.t, reason=item.reason)
        for start, part in zip(starts, parts, strict=False)
        for item in part.failures
    )

    def stacked(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    peaks = {
        item.name: Peak(
            value=np.concatenate([getattr(part.worst, item.name).value for part in parts]),
            time=np.concatenate([getattr(part.worst, item.name).time for part in parts]),
        )
        for item in fields(Worst)
    }
    lanewise = ["x", "slope", "k", "u_a", "sigma_hat", "h", "xtilde", "distance"]
    lanewise += ["error", "unresolved", "least", "greatest"]
    return Runs(
        t=parts[0].t,
        x_plan=parts[0].x_plan,
        u_plan=parts[0].u_plan,
        worst=Worst(**peaks),
        failures=failures,
        steps=np.concatenate([part.steps for part in parts]),
        **{name: stacked(name) for name in lanewise},
    )
