"""What would help: what changes a number, what can be done, and last what is wrong with the plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from functools import partial
from typing import Final, Literal

from tubecert.claims.family import CONSTANTS, Member, Relax, Side, plain
from tubecert.digits import down, near, up
from tubecert.records import Tagged

_OF_H: Final = ("h", "h_x", "h_t")
_LONGEST: Final = 60  # characters of h
_advice = partial(plain, __name__, Relax)


class HalveConstant(Relax):
    """With the constant halved, the least Gamma is `factor` times what it is."""

    constant: str
    factor: float

    def of(self, h: Sequence[str]) -> str:
        """What it would lower, and by how much; with the expressions of h, if they are given."""
        symbol, words = CONSTANTS[self.constant]
        whole = h[0] if len(h) == 1 else f"[{', '.join(h)}]"
        shown = whole if len(whole) <= _LONGEST else f"{whole[:_LONGEST]} ..."
        told, share = f"{words}, h = {shown}" if h else words, 100 * (1 - self.factor)
        return f"halving {symbol} ({told}) would lower the least Gamma by {share:.0f} %"


class PlanRemedy(Member, Tagged):
    """What would lower the defect of a plan."""

    __slots__ = ()


_remedy = partial(plain, __name__, PlanRemedy)
CorrectPlan = _remedy("CorrectPlan", "correct x or u there")
MoreKnots = _remedy("MoreKnots", "give more knots, or integrate the dynamics between them")


class OtherInterpolation(PlanRemedy):
    """With another interpolation of the inputs the defect would be `defect`."""

    says = "with interpolation: {interpolation} it would be {defect:3}"
    interpolation: Literal["hold", "linear"]
    defect: float


class MendPlan(Relax):
    """The plan misses x' = f + B u by up to `defect` (at t, if known), which alone takes `share` of the tube."""

    defect: float
    share: float
    remedy: PlanRemedy
    t: float | None = None

    def _told(self) -> str:
        where = "" if self.t is None else f" (at t = {near(self.t, 4)} s)"
        misses = f"the plan misses x' = f + B u by up to {near(self.defect, 3)}{where}"
        share = 100 * self.share
        part = f"{near(share, 2)} % of" if share <= 1000 else f"{near(self.share, 2)} times"
        return f"{misses}, which alone takes {part} the tube: {self.remedy.told()}"


class RaiseBudget(Relax):
    """A larger budget of boxes may decide it; `proof`: a proof of a synthesis ran out of it."""

    proof: bool = False

    def _told(self) -> str:
        return "raise --budget" + (": a proof ran out of boxes" if self.proof else "")


ShrinkTube = _advice("ShrinkTube", "shrink the tube")
ReduceRadii = _advice("ReduceRadii", "reduce epsilon, rho_a or the initial error")
LeavePlanRoom = _advice("LeavePlanRoom", "plan with more room to the limits")
ReduceInitialError = _advice("ReduceInitialError", "reduce the initial error")
EnlargeSafeSet = _advice("EnlargeSafeSet", "enlarge the safe set")


class FitTube(Relax):
    """A tube that fits into the safe set: radii of `most` in all."""

    most: float

    def _told(self) -> str:
        return f"epsilon + rho_a and what the start takes of at most {down(self.most, 4)} would fit"


class MeasureTube(Relax):
    """A tube that certifies: within `half_widths`, or where these are none of the same radii in coordinates: auto."""

    half_widths: Mapping[str, Fraction] = field(default_factory=dict)
    bandwidth: float | None = None
    adaptation_rate: float | None = None

    def _told(self) -> str:
        widths = ", ".join(f"{name}: {near(width)}" for name, width in self.half_widths.items())
        asked = f"half_widths: {{{widths}}}" if widths else "coordinates: auto"
        gains = {"omega": self.bandwidth, "Gamma": self.adaptation_rate}
        told = " and ".join(f"{name} = {near(gain, 3)}" for name, gain in gains.items() if gain is not None)
        return f"tube: {{{asked}}}, which certifies" + (f" with about {told}" if told else "")


class ShrinkSafeSet(Relax):
    """A smaller safe set: to `factor` of its size about its centre, where `rate` works, if that is known."""

    factor: float | None = None
    rate: Fraction | None = None

    def _told(self) -> str:
        if self.factor is None or self.rate is None:
            return "shrink the safe set"
        shrunk = f"the safe set shrunk to {near(self.factor, 3)} of its size about its centre"
        return f"{shrunk}, where {near(self.rate)} works"


class LowerRate(Relax):
    """A lower rate of the metric: `to` that one, where it is known to be supported."""

    to: float | None = None

    def _told(self) -> str:
        return "lower the rate" if self.to is None else f"lower metric.rate to {down(self.to, 6)}"


OtherMetric = _advice("OtherMetric", "give another dual metric")


class DeclareMetricBound(Relax):
    """A bound of M that holds."""

    side: Side | None = None
    value: float | None = None

    def _told(self) -> str:
        if self.side is None or self.value is None:
            return "declare metric.bounds"
        rounded = down if self.side == "lower" else up
        return f"declare {self.side}: {rounded(self.value, 6)}"


class DeclareUncertaintyBound(Relax):
    """A bound of the uncertainty that holds."""

    constant: str
    value: float | None

    def _told(self) -> str:
        return f"declare {self.constant}: {'-' if self.value is None else up(self.value, 6)}"


class AskForRateBelow(Relax):
    """Ask for a rate below `rate`."""

    says = "ask for a rate below {rate}"
    rate: Fraction


class AskForRateUpTo(Relax):
    """`rate` works on this safe set."""

    says = "a rate up to {rate}, which works on this box"
    rate: Fraction


GiveInput = _advice("GiveInput", "give it an input")
OtherVariables = _advice("OtherVariables", "choose other variables, or leave them to tubecert")
LowerDegree = _advice("LowerDegree", "ask for a lower degree")
ConstantInputs = _advice(
    "ConstantInputs",
    "choose inputs in which B is constant, such as the accelerations of joints (tubecert init --template arm2 "
    "shows how)",
)


class HigherDegree(Relax):
    """A degree of W above `degree`, or none asked for."""

    says = "a degree above {degree}, or auto"
    degree: int


class RaiseConditionNumber(Relax):
    """A higher limit of the condition number."""

    says = "raise condition_number to {to:4}"
    to: float


def advice(items: Sequence[Relax], h: Sequence[str] = ()) -> str:
    """What would help; empty if nothing is known to. `h`: the expressions of the uncertainty, as they are written."""
    halves = [item for item in items if isinstance(item, HalveConstant)]
    about_h = next((item for item in halves if item.constant in _OF_H), None)
    halvings = ", ".join(item.of(h if item is about_h else ()) for item in halves)
    plans = [item.told() for item in items if isinstance(item, MendPlan)]
    others = [item for item in items if not isinstance(item, (HalveConstant, MendPlan))]
    return "; ".join(filter(None, (halvings, _alternatives(others), *plans)))


def _alternatives(items: Sequence[Relax]) -> str:
    tried = [item.told() for item in items if _is_tried(item)]
    if tried:
        return f"try {'; or '.join(tried)}"
    said = [item.told() for item in items]
    return ", or ".join([", ".join(said[:-1]), said[-1]] if len(said) > 1 else said)


def _is_tried(item: Relax) -> bool:
    """Whether it is told what is known to work."""
    known = isinstance(item, ShrinkSafeSet) and item.factor is not None
    return known or isinstance(item, (HigherDegree, AskForRateUpTo, MeasureTube))
