"""A recipe of theorem H that may serve, searched for in few bits: a proposal, which `digital` examines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import exp, inf, isfinite, log

from flint import ctx

from tubecert.recheck.conditions import Setting
from tubecert.recheck.digital import Evaluation
from tubecert.recheck.recipe import Digital, MachineNumbers, Promise

_ROUGH = 64  # bits, for proposals
_RISES = 60
_CLOSE, _INFLATED, _LITTLE = Fraction(1, 10**12), Fraction(1, 10**9), Fraction(1, 10**30)
_GRID, _ZOOMS, _GOLDEN = 10, 28, 0.6180339887498949
_LAST, _MISSING = (
    3,
    10,
)  # points whose differences are compared with what is missing, and how often these fit there
_ENOUGH = 1 - 1e-9  # of the level
_FLOORS = (log(1e-5), 0.0)  # of the level
_FASTEST = 40.0  # omega Ts


@dataclass(frozen=True, slots=True)
class Valley:
    """Where a least value is looked for, between `low` and `high`, at first at so many points and one more."""

    low: float
    high: float
    points: int = _GRID

    def around(self, x: float) -> Valley:
        """Nearby."""
        reach = (self.high - self.low) / self.points
        return Valley(max(self.low, x - reach), min(self.high, x + reach), 2)


def proposed(
    setting: Setting,
    machine: MachineNumbers,
    promise: Promise,
    like: Digital,
    *,
    fixed: bool,
    beside: Digital | None = None,
) -> Digital | None:
    """A recipe for the loop and the level of `like` that may serve, None if none was found: a proposal.

    `fixed`: the bandwidth is not to be chosen. Of each bandwidth the least Y, S, N, np, then the best floor. `beside`:
    a recipe for nearly the same loop, around which one is looked for first.
    """

    def quality(omega: Fraction | None, floors: Valley) -> tuple[float, Digital | None]:
        at = _settled(setting, machine, promise, replace(like, bandwidth=omega))
        if at is None:
            return inf, None
        settled = Evaluation(setting, machine, promise, at)
        share, top = _least(lambda x: _top(settled.with_floor(_floor(at, x))), floors)
        return top, replace(at, floor=_floor(at, share))

    def searched(omegas: Valley, floors: Valley) -> tuple[float, Digital | None]:
        x, _ = _least(lambda x: quality(Fraction(exp(x)), floors)[0], omegas)
        return quality(Fraction(exp(x)), floors)

    floors = Valley(*_FLOORS)
    with ctx.workprec(_ROUGH):
        top, best = quality(like.bandwidth if fixed else None, floors)
        if fixed or top < _ENOUGH:
            return best if top < inf else None
        omegas = Valley(log(float(setting.rate)), log(_FASTEST / float(like.sample_time)))
        if beside is not None and beside.bandwidth is not None:
            near = omegas.around(log(beside.bandwidth)), floors.around(log(beside.floor / beside.level))
            least, found = searched(*near)
            if least < _ENOUGH:
                return found
        top, best = min((top, best), searched(omegas, floors), key=lambda pair: pair[0])
    return best if top < inf else None


def _floor(at: Digital, x: float) -> Fraction:
    """The floor that is a share of the level."""
    return at.level * Fraction(exp(x))


def _least(value: Callable[[float], float], within: Valley) -> tuple[float, float]:
    """Where a function with one valley is about least, and its value there; the first point where it is enough."""
    low, high, count = within.low, within.high, within.points
    best: list[tuple[float, float]] = []

    def at(x: float) -> float:
        y = value(x)
        best.append((y, x))
        return y

    points = [low + (high - low) * k / count for k in range(count + 1)]
    values: list[float] = []
    for x in points:
        values.append(at(x))
        if values[-1] < _ENOUGH:
            return x, values[-1]
    k = min(range(len(points)), key=lambda k: values[k])
    low, high = points[max(0, k - 1)], points[min(count, k + 1)]
    inner = [high - (high - low) * _GOLDEN, low + (high - low) * _GOLDEN]
    found = [at(x) for x in inner]
    for _ in range(_ZOOMS):
        if min(found) < _ENOUGH or _is_hopeless([y for y, _ in best]):
            break
        if found[0] <= found[1]:
            high, inner[1], found[1] = inner[1], inner[0], found[0]
            inner[0] = high - (high - low) * _GOLDEN
            found[0] = at(inner[0])
        else:
            low, inner[0], found[0] = inner[0], inner[1], found[1]
            inner[1] = low + (high - low) * _GOLDEN
            found[1] = at(inner[1])
    y, x = min(best)
    return x, y


def _is_hopeless(values: list[float]) -> bool:
    """Whether what the last points of a zoom differ by is nothing beside what is missing."""
    least = min(values)
    return least - _ENOUGH > _MISSING * (max(values[-_LAST:]) - least)


def _settled(setting: Setting, machine: MachineNumbers, promise: Promise, at: Digital) -> Digital | None:
    """With Y, S, N, np as small as they can be, and a little more."""
    now = replace(at, speed=_LITTLE, bias=Fraction(0), ripple=Fraction(0))
    if promise.predicts:
        now = replace(now, prediction=Fraction(0))
    for step in range(_RISES):
        found = Evaluation(setting, machine, promise, now).needed()
        values = [float(x.upper()) for x in found]
        if not all(isfinite(x) for x in values):
            return None
        Y, S, N, np_ = (Fraction(x) for x in values)
        settled = step > 1 and now.speed * (1 + _CLOSE) >= Y and now.bias * (1 + _CLOSE) + _LITTLE >= S
        now = replace(now, speed=Y, bias=S, ripple=N, prediction=np_ if promise.predicts else None)
        if settled:
            break
    more = 1 + _INFLATED
    return replace(
        now,
        speed=now.speed * more,
        bias=now.bias * more + _LITTLE,
        ripple=now.ripple * more + _LITTLE,
        prediction=None if now.prediction is None else now.prediction * more + _LITTLE,
    )


def _top(at: Evaluation) -> float:
    """max(d0, f0, d1, sup D) per level; infinite where that is no number."""
    top = float(at.course().top.upper() / at.level)
    return top if isfinite(top) else inf
