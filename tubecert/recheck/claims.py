"""All claims of a certificate in their order, each with everything it depends on as its key.

Equal keys mean equal outcomes: a memory of outcomes may be shared between certificates that differ in a field or two.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

from flint import arb, ctx

from tubecert.recheck import consistency, gains, geodesics, metric, start
from tubecert.recheck.balls import exact
from tubecert.recheck.conditions import USED, Numbers, Setting
from tubecert.recheck.constants import OVER_TUBE, bounded, contained, half_width
from tubecert.recheck.cover import Outcome
from tubecert.recheck.curve import Curve
from tubecert.recheck.document import Node, digest
from tubecert.recheck.place import Place
from tubecert.recheck.predictor import Gains
from tubecert.recheck.reading import TIME, Duty
from tubecert.recheck.system import System, read_curve, read_system

_BITS = 64  # for boxes
_SHARP = 160  # for formulas at decimals
_ROUND_UP = Fraction(1001, 1000)

Memory = MutableMapping[str, Outcome]


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the certificate, what it depends on, and how to examine it."""

    name: str
    key: tuple[object, ...]
    examine: Callable[[], Outcome] = field(repr=False)
    bits: int = _BITS

    def outcome(self, memory: Memory | None = None) -> Outcome:
        """The outcome; what arithmetic cannot represent is undecided."""
        if memory is None:
            return self._examined()
        name = json.dumps([self.name, self.key], default=str, sort_keys=True)
        if name not in memory:
            memory[name] = self._examined()
        return memory[name]

    def _examined(self) -> Outcome:
        with ctx.workprec(self.bits):
            try:
                return self.examine()
            except (ArithmeticError, ValueError) as error:
                return Outcome(verdict="undecided", why=f"it cannot be evaluated: {error}")


@dataclass(frozen=True)
class Case:
    """A certificate, read."""

    result: Node
    budget: int

    @cached_property
    def effective(self) -> Node:
        """The specification inside."""
        return self.result["spec"]["effective"]

    @cached_property
    def system(self) -> System:
        """Its system; the metric is that of the specification, or the one that was synthesised for it."""
        own = self.effective["metric"]
        if "dual_metric" in own.mapping():
            return read_system(self.effective)
        return read_system(
            Node({**self.effective.mapping(), "metric": self.result["metric"].value}, "spec.effective")
        )

    @cached_property
    def plan(self) -> tuple[Curve, list[Duty]]:
        """The plan, and where its expressions must be defined."""
        with ctx.workprec(_SHARP):
            return read_curve(self.effective, self.result["plan"], self.system)

    @cached_property
    def curve(self) -> Curve:
        """The plan."""
        return self.plan[0]

    @cached_property
    def place(self) -> Place:
        """The tube."""
        return Place(self.system, self.curve, self.result["tube"]["rho"].number(), self.budget)

    @cached_property
    def setting(self) -> Setting:
        """The constants on their safe sides."""
        with ctx.workprec(_SHARP):
            bounds = {name: self.bound_if_any(name) for name in USED}
            # what has no bound is not a number: no comparison with what rests on it can hold
            values = {name: arb("nan") if q is None else exact(q) for name, q in bounds.items()}
        return Setting(self.system, Numbers(**values), self.place.rho)

    def bound(self, name: str) -> Fraction:
        """The side of a constant that the conditions use."""
        return self._side(name).number()

    def bound_if_any(self, name: str) -> Fraction | None:
        """The same; None where the certificate states that none was found: it claims nothing of the constant then."""
        side = self._side(name)
        return None if side.value is None else side.number()

    def _side(self, name: str) -> Node:
        side = "below" if name in ("lower", "input_gain_least") else "above"
        return self.result["constants"][name][side]

    @cached_property
    def whole(self) -> tuple[object, ...]:
        """What every claim about the system depends on."""
        parts = {key: value for key, value in self.effective.mapping().items() if key not in _IDLE}
        metric = self.result.get("metric")  # none was found: what is claimed then is about the system
        return digest(parts), metric and digest(metric["dual_metric"].value), self.budget

    @cached_property
    def over_tube(self) -> tuple[object, ...]:
        """What every claim over the tube depends on."""
        plan = self.result["plan"].mapping()
        return *self.whole, digest([plan.get("knots"), plan.get("interpolation")]), self.place.rho

    @cached_property
    def numbers(self) -> tuple[object, ...]:
        """What every claim about gains depends on."""
        return *self.whole, self.place.rho, *(self.bound_if_any(name) for name in USED)


_IDLE = {"name", "expect", "simulation", "obstacles"}


def of_certified(case: Case) -> Iterator[Claim]:
    """Every claim that a verdict `certified` rests on, and those that stand beside it."""
    yield from _statements(case)
    yield from _on_set(case)
    yield from _tube(case)
    yield from _constants(case)
    yield from _gains(case)


def _statements(case: Case) -> Iterator[Claim]:
    result, system = case.result, case.system
    outcomes = {
        "the specification and what repeats it": consistency.specification(result, system),
        "bounds are intervals": consistency.bounds(result),
        "the verdict follows from the sections": consistency.verdict(result),
        "assumptions are complete": consistency.assumptions(result, system),
    }
    for name, outcome in outcomes.items():
        yield Claim(name, (outcome.verdict, outcome.why), lambda outcome=outcome: outcome)  # type: ignore[misc]


def _on_set(case: Case) -> Iterator[Claim]:
    s, budget, whole, shown = case.system, case.budget, case.whole, case.result["metric"]
    on_set = metric.on_set(s)
    lower, upper = shown["lower_on_set"].pair()[0].number(), shown["upper_on_set"].pair()[1].number()
    yield Claim("f, B, W, h are smooth", (*case.over_tube,), lambda: _smooth(case))
    yield Claim(
        f"C1: M >= {float(lower):.6g} I on the safe set",
        (*whole, lower),
        lambda: metric.lower_bound(s, lower, on_set, budget),
    )
    yield Claim(
        f"C1: M <= {float(upper):.6g} I on the safe set",
        (*whole, upper),
        lambda: metric.upper_bound(s, upper, on_set, budget),
    )
    yield Claim("C3: the Killing condition", whole, lambda: metric.killing(s))
    if len(s.inputs) < len(s.states):
        margin = shown["margin"].pair()[0].number()
        rate = shown["largest_rate"].pair()[0].number()
        most = max(margin, rate - s.rate)
        yield Claim(
            f"C2 on the safe set at rate {float(s.rate):.6g} + {float(most):.4g}",
            (*whole, most),
            lambda: metric.contraction(s, most, budget) if most > 0 else metric.stated(False, "no margin"),
        )


def _smooth(case: Case) -> Outcome:
    s = case.system
    time = metric.time_range(s)
    ranges = {**s.safe_set, **({} if time is None else {TIME: time})}
    found = metric.smooth(s.duties, ranges, case.budget)
    horizon = Fraction(0) if s.horizon is None else s.horizon
    along = metric.smooth(case.plan[1], {TIME: (Fraction(0), horizon)}, case.budget)
    return metric.together([found, along])


def _tube(case: Case) -> Iterator[Claim]:
    s, place = case.system, case.place
    lower, upper = case.bound("lower"), case.bound("upper")
    yield Claim(
        f"rho = {float(place.rho):.6g} is large enough",
        (*case.over_tube, lower, upper),
        lambda: start.radius(place, lower, upper),
        _SHARP,
    )
    yield Claim("the tube lies in the safe set", case.over_tube, lambda: contained(place))
    widths = case.result["tube"]["half_widths"]
    for i, name in enumerate(s.states):
        width = widths[name].number()
        yield Claim(
            f"half-width of {name} <= {float(width):.6g}",
            (*case.over_tube, width, lower),
            lambda i=i, width=width: half_width(place, i, width, lower),  # type: ignore[misc]
        )


def _constants(case: Case) -> Iterator[Claim]:
    place, over = case.place, case.over_tube
    B, upper = case.bound("B"), case.bound("upper")
    # smax(Theta B) <= |B| sqrt(A)
    largest = Fraction(float(B) * float(upper) ** 0.5) * _ROUND_UP if upper > 0 else Fraction(0)
    for name in OVER_TUBE:
        limit = case.bound_if_any(name)
        if limit is None:
            continue
        relation = ">=" if name in ("lower", "input_gain_least") else "<="
        yield Claim(
            f"{name} {relation} {float(limit):.6g}",
            (*over, limit, largest if name == "feedback_gain" else None),
            lambda name=name, limit=limit: bounded(place, name, limit, largest),  # type: ignore[misc]
        )
    d0, H0 = case.bound("initial_distance"), case.bound_if_any("h_initial")
    yield Claim(
        f"initial_distance <= {float(d0):.6g}", (*over, d0, upper), lambda: start.distance(place, d0, upper)
    )
    if H0 is not None:
        yield Claim(f"h_initial <= {float(H0):.6g}", (*over, H0), lambda: start.uncertainty(place, H0))
    test = case.result["metric"].get("unique_geodesics")
    if test is not None and test["holds"].flag():
        value = test["value"].pair()[1].number()
        yield Claim(
            "geodesics are unique",
            (*over, value),
            lambda: (
                geodesics.unique(place, value)
                if value < 1
                else metric.stated(False, "the test is not below 1")
            ),
        )


def _gains(case: Case) -> Iterator[Claim]:
    result, setting, proof = case.result, case.setting, case.result["proof"]
    A, B, C = (result[name] for name in gains.SECTIONS)

    def claim(name: str, parts: tuple[object, ...], examine: Callable[[], Outcome]) -> Claim:
        return Claim(name, (*case.numbers, digest(parts)), examine, _SHARP)

    if gains.is_certified(A):
        at = gains.section_gains(A)
        shown = {key: value for key, value in A.mapping().items() if key not in ("curve", "least_adaptation")}
        derived = {name: result["constants"][name]["above"].value for name in consistency.DERIVED}
        yield claim("A: the predictor", (shown,), lambda: gains.loop(A, case.system))
        yield claim(
            "A: derived constants",
            (shown, derived),
            lambda: gains.derived_constants(result["constants"], setting, at),
        )
        yield claim(f"A: (26a)-(26c) at {_words(at)}", (shown,), lambda: gains.margins(A, setting, at))
        yield claim("A: ultimate radius", (shown,), lambda: gains.ultimate_26(A, setting, at))
        recipe = proof["conditions_26"]
        yield claim(
            "A: its recipe",
            (shown, recipe.value),
            lambda: metric.stated(gains.gains_of(recipe) == at, "it is for other gains"),
        )
        least = A.get("least_adaptation")
        if least is not None:
            own = gains.gains_of(least)
            yield claim(
                f"A: (26a)-(26c) at {_words(own)}", (least.value,), lambda: gains.margins(least, setting, own)
            )
        yield claim("A: the curve is feasible", (shown, A["curve"].value), lambda: gains.curve_26(A, setting))
    if gains.is_certified(B):
        chosen = gains.decisive(B)[0]
        for name in ("asked", "split", "least_adaptation"):
            pair = B.get(name)
            if pair is not None:
                recipe_B = proof["distance"] if name == chosen else None
                yield claim(
                    f"B: sup D < dbar at {_words(gains.gains_of(pair))}",
                    (pair.value, recipe_B and recipe_B.value),
                    lambda pair=pair, recipe_B=recipe_B: gains.distance_pair(pair, setting, recipe_B),  # type: ignore[misc]
                )
        yield claim("B: ultimate radius", (B.value,), lambda: gains.agreed(B))
        yield claim("B: the curve is feasible", (B.value,), lambda: gains.distance_curve(B, setting))
    if gains.is_certified(C):
        recipe_C = proof["sampled"]
        words = f"omega = {float(C['bandwidth'].number()):.6g}, Ts = {float(C['sample_time'].number()):.6g}"
        yield claim(
            f"C: sup D < dbar at {words}",
            (C.value, recipe_C.value),
            lambda: gains.sampled(C, setting, recipe_C),
        )
        yield claim("C: the curve is feasible", (C.value,), lambda: gains.sampled_curve(C, setting))


def _words(at: Gains) -> str:
    return f"omega = {float(at.bandwidth):.6g}, Gamma = {float(at.adaptation_rate):.6g}"
