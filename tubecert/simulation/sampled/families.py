"""What the lanes follow: the plan of a specification, or of a family a random plan for every lane.

A plan of a family (`simulation.plans`) counts as long as x* is in P. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.plans import Steering, integrated, waves
from tubecert.simulation.sampled.setting import Setting
from tubecert.spec.types import Bundle

_AFTER: Final = 1e-9  # of a sample time after its left end: there u* has jumped


class Course(NamedTuple):
    """x* (J + 1, n, N) at the ends of all parts, inputs as they are held (K + q + 1, m, N), interval by interval.

    The first interval ends when the first command acts. With one plan for all, N is 1. `ends` (N,): the first
    sample at which a plan is none of the family. `inputs`: u*(t) (m, 1), where it is not held.
    """

    x: Array
    held: Array
    ends: Array
    inputs: Callable[[float], Array] | None = None

    def of(self, lanes: NDArray[np.intp]) -> Course:
        """What some lanes follow."""
        if len(self.ends) == 1:
            return self
        return self._replace(x=self.x[..., lanes], held=self.held[..., lanes], ends=self.ends[lanes])


def course_of(setting: Setting) -> Course:
    """The plan of a specification that is no family."""
    Ts, plan, claim, K = setting.Ts, setting.loop.plan, setting.result.claim, setting.samples
    end = None if plan.horizon is None else float(plan.horizon)

    def at(t: Array) -> tuple[Array, Array]:
        if end is not None and claim.afterwards != "repeat":
            t = np.minimum(t, end)
        elif end is not None and plan.knots is not None:
            t = np.mod(t, end)
        x, u = plan.enclose(t, t)
        return x.mid[:, :, None], u.mid[:, :, None]

    nodes = np.array(setting.nodes[:-1], dtype=float)
    acts = float(setting.loop.rest) + np.arange(-1, K + setting.loop.whole) * Ts
    low, high = np.maximum(acts, 0.0), acts + Ts
    moving = claim.hold == "continuous" and not plan.is_constant
    x = at(np.append(np.add.outer(np.arange(K) * Ts, nodes), K * Ts))[0]
    held = at(low + _AFTER * Ts if claim.hold == "left" else (low + high) / 2)[1]
    return Course(x, held, np.full(1, K + 1), (lambda t: at(np.full(1, t))[1][0]) if moving else None)


def courses(setting: Setting, bundle: Bundle, draws: Array) -> Course:
    """A random plan for every lane from its draws, `drawn(setting)` of each (.., N); N plans."""
    (n, m), K, acts, hold = setting.loop.B.shape, setting.samples, setting.acts, setting.result.claim.hold
    boxes = (np.array(box, dtype=float) for box in (bundle.x, bundle.u))
    steer = Steering(setting.loop.A, setting.loop.B, setting.Ts, *boxes)
    rate = None if bundle.input_rate is None else np.array(bundle.input_rate, dtype=float)[:, None]
    x, u = steer.inside(draws[-n:]), steer.u + np.zeros((1, draws.shape[1]))
    path, held, ends = [x], [], np.full(draws.shape[1], K + 1)
    for k in range(K + setting.loop.whole + 1):
        wish = waves(draws[:-n], K, k)
        lengths = setting.lengths[:acts] if k == 0 else np.roll(setting.lengths, -acts)
        asked, most = steer.input(x, wish[:m]), lengths.sum() * (0.0 if rate is None else rate)
        first, u = (asked, asked) if rate is None else (u, np.clip(asked, u - most, u + most))
        slope = partial(_slope, setting, (first, u, lengths.sum()), float(bundle.defect) * wish[m:])
        for begin, length in zip((np.cumsum(lengths) - lengths).tolist(), lengths.tolist(), strict=True):
            x = integrated(slope, begin, x, length, 2)
            path.append(x)
        held.append(first if hold == "left" else (first + u) / 2)
        ends = np.where(steer.within(x), ends, np.minimum(ends, max(0, k - 1)))
    return Course(np.stack(path[: K * len(setting.lengths) + 1]), np.stack(held), ends)


def _slope(setting: Setting, ramp: tuple[Array, Array, float], missed: Array, t: float, x: Array) -> Array:
    """x*' of lanes whose inputs go from the first (m, N) to the last in so many s, with what is missed (n, N)."""
    now = ramp[0] + t / ramp[2] * (ramp[1] - ramp[0])
    still = np.zeros(setting.loop.E.shape[1])
    return setting.plant.run_floats([*x, *setting.ranges.mean(axis=1), *now, *still], x[0].shape) + missed


def drawn(setting: Setting) -> int:
    """How many draws a plan of a family needs."""
    n, m = setting.loop.states, setting.loop.inputs
    return 3 * (n + m) + n
